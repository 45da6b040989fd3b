//! Many emulated rigs in this process: under the firmware's control code ([`Bench`]), or with the motor's speed given ([`Plant`]).

use crate::errors::{in_python, wrong};
use crate::{Scene, errors, locked};
use numpy::PyArray3;
use numpy::ndarray::Array3;
use pyo3::prelude::*;
use rig_control::{Controller, DriveReading, Outputs};
use rig_link::messages::{Fault, HomingFailure, Limit, LoadChoice, Request, Telemetry};
use rig_plant::bench::{ControlBench, ControlLaw, MotorSpeed, MotorTick};
use rig_plant::rig::EmulatedRig;
use rig_plant::{PlantChange, PlantSettings, RigPreset, Truth};
use rigctl::export::WORDS;
use rigctl::session::homing::HomeResult;
use rigctl::session::motion::{MoveResult, REST_ROWS};
use rigctl::session::row::{RangeEnd, Row};
use std::f64::consts::TAU;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;

/// Rigs that are worked on between two looks at Python's signals.
const CHUNK: usize = 32;
/// Time for which a rig is left alone after its homing (s): the tick that ends homing shows no load yet.
const HOMED_S: f64 = 0.05;

/// What is not known is not a number in Python.
fn number<N: Into<f64>>(value: Option<N>) -> f64 {
    value.map_or(f64::NAN, N::into)
}

/// Fields of a struct as columns, first those that are always known: a constant with their names, and a function that gives their
/// numbers.
macro_rules! columns {
    ($names:ident, $numbers:ident($of:ty): $($known:ident)* $(, perhaps: $($perhaps:ident)*)?) => {
        const $names: &[&str] = &[$(stringify!($known)),* $(, $(stringify!($perhaps)),*)?];

        fn $numbers(of: &$of) -> Vec<f64> {
            vec![$(f64::from(of.$known)),* $(, $(number(of.$perhaps)),*)?]
        }
    };
}

// The tension of one string is left out: what it takes of the pull is computed at power-up only.
columns!(TELEMETRY, telemetry(Row): t_s, perhaps: drive_current_a drive_speed_rad_per_s
    target_m setpoint_m position_m twist_rad load_n load_error_n position_error_m tr_rad_per_m time_left_s twist_scale gap_m
    encoder_rad supply_v true_position_m true_twist_rad true_load_n);
columns!(TRUTH, truth(Truth):
    t_s position_m gap_m pretwist_gap_m gap_speed_m_per_s twist_rad load_n pull_n string_torque_nm motor_angle_rad
    motor_speed_rad_per_s motor_current_a motor_energy_j driven_rad);
columns!(HOMED, homed(HomeResult): duration_s load_n load_error_n friction_n zero_error_rad reference_gap_m);
columns!(MOVED, moved(MoveResult):
    target_m position_m error_m load_n tr_start_rad_per_m tr_end_rad_per_m turns duration_s, perhaps:
    true_error_m position_error_m load_error_n);
const SENSED: &[&str] = &["t_s", "encoder_rad", "gap_m", "drive_current_a", "drive_speed_rad_per_s", "supply_v"];

/// What a tick shows, in the order of the columns.
trait Shows: ControlLaw + Sized {
    const NUMBERS: &'static [&'static str];
    const WORDS: &'static [&'static str] = &[];

    /// Numbers and words.
    fn show(bench: &ControlBench<Self>, last: &Self::Decision, truth: &Truth) -> (Vec<f64>, Vec<String>);
}

/// What the tool would make of a tick.
fn row(bench: &ControlBench, telemetry: &Telemetry, truth: &Truth) -> Row {
    let load_at_range_end = telemetry.load_n.and_then(|n| RangeEnd::of(n, bench.control.load_range_n()));
    let row = Row::new(telemetry.t_us as f64 * 1e-6, telemetry, Some(truth), bench.home_gap_m);
    Row { load_at_range_end, homing_failure: bench.homing_failure, ..row }
}

impl Shows for Controller {
    const NUMBERS: &'static [&'static str] = TELEMETRY;
    const WORDS: &'static [&'static str] = &WORDS;

    fn show(bench: &ControlBench, last: &Outputs, truth: &Truth) -> (Vec<f64>, Vec<String>) {
        let row = row(bench, &last.telemetry, truth);
        // In the order of `WORDS`.
        let words = [
            Some(row.state.name()),
            row.fault.map(Fault::name),
            row.faults.as_deref(),
            row.limit.map(Limit::name),
            row.doubts.as_deref(),
            row.load_at_range_end.map(RangeEnd::name),
            row.homing_failure.map(HomingFailure::name),
        ];
        (telemetry(&row), words.map(|word| word.unwrap_or_default().to_owned()).into())
    }
}

impl Shows for MotorSpeed {
    const NUMBERS: &'static [&'static str] = SENSED;

    fn show(bench: &ControlBench<Self>, last: &MotorTick, _: &Truth) -> (Vec<f64>, Vec<String>) {
        let (inputs, constants) = (&last.inputs, bench.rig.parameters());
        let drive = match inputs.drive {
            DriveReading::Reports { current_ma, speed_rpm, .. } => Some((current_ma, speed_rpm)),
            _ => None,
        };
        let gap_m =
            |code: f32| constants.lvdt_gap_at_code_zero_m() + constants.lvdt_metres_per_code() * f64::from(code);
        let numbers = vec![
            inputs.now_us as f64 * 1e-6,
            inputs.encoder_counts as f64 / constants.counts_per_rad(),
            number(inputs.lvdt.map(|block| gap_m(block.mean_code))),
            number(drive.map(|(current_ma, _)| 1e-3 * f64::from(current_ma))),
            number(drive.map(|(_, speed_rpm)| f64::from(speed_rpm) * TAU / 60.0)),
            number(inputs.supply.and_then(|supply| supply.volts)),
        ];
        (numbers, vec![])
    }
}

/// Names of the numbers, of the words and of the truth; their values in this order by rig and tick, words by their place in a list;
/// and that list.
type Ticks<'py> = ([&'static [&'static str]; 3], Bound<'py, PyArray3<f64>>, Vec<String>);

/// Names, the values of each rig, and why a rig has none.
type Results = (Vec<&'static str>, Vec<Vec<f64>>, Vec<String>);

/// Emulated rigs, each with why there is none.
struct Rigs<C: ControlLaw>(Vec<Mutex<Result<Box<ControlBench<C>>, String>>>);

impl<C: Shows + Clone + Send> Rigs<C>
where
    C::Decision: Send,
{
    /// The rigs of a preset that seeds name, each with further changes, after their first tick and what follows it.
    fn new(
        py: Python<'_>,
        scene: &rig_config::Scene,
        preset: &str,
        seeds: &[u64],
        plant: &[String],
        control: impl Fn(&EmulatedRig) -> C + Sync,
        start: impl Fn(&mut ControlBench<C>) -> Result<(), String> + Sync,
    ) -> PyResult<Self> {
        scene.check_rig().map_err(|e| errors::of_kind("scene", &e.to_string()))?;
        let preset: RigPreset = preset.parse().map_err(|e| wrong(format!("rig: {e}")))?;
        let changes: Vec<PlantChange> =
            plant.iter().map(|change| change.parse()).collect::<Result<_, _>>().map_err(wrong)?;
        changes.iter().try_for_each(|change| change.check()).map_err(wrong)?;
        let made = |seed: u64| {
            let mut settings = PlantSettings::preset(preset, seed);
            changes.iter().try_for_each(|change| settings.apply(*change)).map_err(|e| e.to_string())?;
            let rig = EmulatedRig::new(scene, settings, seed).map_err(|e| e.to_string())?;
            let control = control(&rig);
            let mut bench = Box::new(ControlBench::on(rig, control));
            bench.tick(None);
            start(&mut bench).map(|()| bench)
        };
        let made = py.detach(|| rigctl::parallel::parallel(&|_, _| {}, seeds.len(), |k| made(seeds[k])));
        Ok(Self(made.into_iter().map(Mutex::new).collect()))
    }

    fn copy(&self) -> Self {
        Self(self.0.iter().map(|rig| Mutex::new(locked(rig).clone())).collect())
    }

    fn errors(&self) -> Vec<String> {
        self.0.iter().map(|rig| locked(rig).as_ref().err().cloned().unwrap_or_default()).collect()
    }

    /// `f` of each rig by its number, on all cores, without Python's lock. A panic is the end of that rig alone.
    fn each<T: Send>(
        &self,
        py: Python<'_>,
        f: impl Fn(usize, &mut ControlBench<C>) -> Result<T, String> + Sync,
    ) -> PyResult<Vec<Result<T, String>>> {
        let mut all = Vec::with_capacity(self.0.len());
        for start in (0..self.0.len()).step_by(CHUNK) {
            let count = CHUNK.min(self.0.len() - start);
            all.extend(py.detach(|| {
                rigctl::parallel::parallel(&|_, _| {}, count, |k| {
                    let rig = &mut *locked(&self.0[start + k]);
                    let bench = rig.as_mut().map_err(|why| why.clone())?;
                    catch_unwind(AssertUnwindSafe(|| f(start + k, bench))).unwrap_or_else(|_| {
                        let why = "it has panicked: standard error says why".to_owned();
                        *rig = Err(why.clone());
                        Err(why)
                    })
                })
            }));
            py.check_signals()?;
        }
        Ok(all)
    }

    /// Results of all rigs, with the names of their columns.
    fn results(
        &self,
        py: Python<'_>,
        names: &[&'static str],
        f: impl Fn(usize, &mut ControlBench<C>) -> Result<Vec<f64>, String> + Sync,
    ) -> PyResult<Results> {
        let rows = self.each(py, f)?.into_iter().map(|row| match row {
            Ok(values) => (values, String::new()),
            Err(why) => (vec![f64::NAN; names.len()], in_python(&why)),
        });
        let (values, why) = rows.unzip();
        Ok((names.to_vec(), values, why))
    }

    /// Ticks of all rigs; without any, the last one again.
    fn ticks<'py>(&self, py: Python<'py>, ticks: usize) -> PyResult<Ticks<'py>> {
        let names = [C::NUMBERS, C::WORDS, TRUTH];
        let (count, width) = (ticks.max(1), names.concat().len());
        let words = Mutex::new(Vec::new());
        let place_of = |word: &String| {
            let mut words = locked(&words);
            let place = words.iter().position(|known| known == word).unwrap_or_else(|| {
                words.push(word.clone());
                words.len() - 1
            });
            place as f64
        };
        let rows = self.each(py, |_, bench| {
            let mut values = Vec::with_capacity(count * width);
            for _ in 0..count {
                if ticks > 0 {
                    bench.tick(None);
                }
                let (last, now) = (bench.last.as_ref().ok_or("it has not begun")?, bench.truth());
                let (numbers, words) = C::show(bench, last, &now);
                values.extend(numbers.into_iter().chain(words.iter().map(place_of)).chain(truth(&now)));
            }
            Ok(values)
        })?;
        let mut values = Vec::with_capacity(rows.len() * count * width);
        rows.into_iter().for_each(|row| values.extend(row.unwrap_or_else(|_| vec![f64::NAN; count * width])));
        let values = Array3::from_shape_vec((self.0.len(), count, width), values).map_err(errors::broken)?;
        Ok((names, PyArray3::from_owned_array(py, values), locked(&words).clone()))
    }
}

fn home(bench: &mut ControlBench, load: LoadChoice) -> Result<Vec<f64>, String> {
    let duration_s = bench.home_under(load)?;
    bench.run(HOMED_S);
    let found = bench.found.ok_or("homing has no result")?;
    Ok(homed(&HomeResult::new(duration_s, &found, None)))
}

fn move_to(bench: &mut ControlBench, target_m: f64, speed_m_per_s: f32, load: LoadChoice) -> Result<Vec<f64>, String> {
    let before = bench.telemetry().ok_or("it has not begun")?;
    let duration_s = bench.move_to(target_m as f32, speed_m_per_s, load)?;
    let rest = (0..REST_ROWS).map(|_| {
        let tick = bench.tick(None);
        row(bench, &tick.telemetry, &bench.truth())
    });
    let rest: Vec<Row> = rest.collect();
    MoveResult::at_rest(target_m, &before, &rest, duration_s)
        .map(|result| moved(&result))
        .ok_or_else(|| "no rest".into())
}

/// A load that is given for each rig; one that is not a number is not given.
fn load_of(loads_n: &[f64], k: usize) -> LoadChoice {
    Some(loads_n[k]).filter(|n| !n.is_nan()).map_or(LoadChoice::Auto, |n| LoadChoice::Known(n as f32))
}

/// Emulated rigs under the firmware's control code.
#[pyclass(frozen)]
pub(crate) struct Bench(Rigs<Controller>);

#[pymethods]
impl Bench {
    #[new]
    fn new(py: Python<'_>, scene: &Scene, rig: &str, seeds: Vec<u64>, plant: Vec<String>) -> PyResult<Self> {
        let scene = &scene.0;
        let fit = py.detach(|| scene.fit_table()).map_err(|e| errors::of_kind("scene", &e.to_string()))?;
        let control = Controller::new(&fit.table.table(), scene.constants(), None);
        Rigs::new(py, scene, rig, &seeds, &plant, |_| control.clone(), |_| Ok(())).map(Self)
    }

    fn copy(&self) -> Self {
        Self(self.0.copy())
    }

    fn errors(&self) -> Vec<String> {
        self.0.errors()
    }

    fn ticks<'py>(&self, py: Python<'py>, ticks: usize) -> PyResult<Ticks<'py>> {
        self.0.ticks(py, ticks)
    }

    fn home(&self, py: Python<'_>, loads_n: Vec<f64>) -> PyResult<Results> {
        self.0.results(py, HOMED, |k, bench| home(bench, load_of(&loads_n, k)))
    }

    /// Moves; without `wait` the moves only begin, which takes one tick.
    fn move_to(
        &self,
        py: Python<'_>,
        targets_m: Vec<f64>,
        speeds_m_per_s: Vec<f64>,
        loads_n: Vec<f64>,
        wait: bool,
    ) -> PyResult<Results> {
        self.0.results(py, if wait { MOVED } else { &[] }, |k, bench| {
            let (target_m, speed_m_per_s, load) = (targets_m[k], speeds_m_per_s[k] as f32, load_of(&loads_n, k));
            if wait {
                return move_to(bench, target_m, speed_m_per_s, load);
            }
            bench.ask(Request::Move { target_m: target_m as f32, speed_m_per_s, load }).map(|()| vec![])
        })
    }
}

/// Emulated rigs whose motors turn as they are told.
#[pyclass(frozen)]
pub(crate) struct Plant(Rigs<MotorSpeed>);

#[pymethods]
impl Plant {
    /// The drives have started.
    #[new]
    fn new(py: Python<'_>, scene: &Scene, rig: &str, seeds: Vec<u64>, plant: Vec<String>) -> PyResult<Self> {
        Rigs::new(py, &scene.0, rig, &seeds, &plant, MotorSpeed::of, ControlBench::start).map(Self)
    }

    fn copy(&self) -> Self {
        Self(self.0.copy())
    }

    fn errors(&self) -> Vec<String> {
        self.0.errors()
    }

    fn ticks<'py>(&self, py: Python<'py>, ticks: usize) -> PyResult<Ticks<'py>> {
        self.0.ticks(py, ticks)
    }

    /// What the motors are to do from the next tick on.
    fn set(&self, py: Python<'_>, speeds_rad_per_s: Vec<f64>, currents_a: Vec<f64>) -> PyResult<()> {
        let set = |k: usize, bench: &mut ControlBench<MotorSpeed>| {
            (bench.control.speed_rad_per_s, bench.control.current_a) = (speeds_rad_per_s[k], currents_a[k]);
            Ok(())
        };
        self.0.each(py, set).map(drop)
    }
}
