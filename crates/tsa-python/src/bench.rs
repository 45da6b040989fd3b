//! Many emulated rigs in this process: under the firmware's control code ([`Bench`]), or with the motor's speed given ([`Plant`]).

use crate::errors::wrong;
use crate::{Scene, errors};
use numpy::PyArray3;
use pyo3::prelude::*;
use rig_control::{Controller, DriveReading};
use rig_link::messages::{Accepted, EventKind, HomingResult, LoadChoice, Refusal, Request, State};
use rig_plant::bench::{ControlBench, ControlLaw, ControlTick, MotorSpeed, MotorTick};
use rig_plant::rig::EmulatedRig;
use rig_plant::{PlantChange, PlantSettings, RigPreset, Truth};
use std::f64::consts::TAU;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Rigs that are worked on between two looks at Python's signals.
const CHUNK: usize = 32;
/// Longest start-up (s), longest homing (s), longest move beyond what distance and speed need (s).
const START_S: f64 = 10.0;
const HOMING_S: f64 = 60.0;
const MOVE_SLACK_S: f64 = 60.0;
/// Ticks at rest over which the end of a move is averaged, as `rigctl move` does.
const REST_TICKS: u32 = 30;

/// The columns of one tick, by their names in Python: numbers, then words.
const TELEMETRY: [&str; 19] = [
    "t_s",
    "target_m",
    "setpoint_m",
    "position_m",
    "twist_rad",
    "load_n",
    "load_error_n",
    "position_error_m",
    "tr_rad_per_m",
    "drive_current_a",
    "drive_speed_rad_per_s",
    "time_left_s",
    "twist_scale",
    "gap_m",
    "encoder_rad",
    "supply_v",
    "true_position_m",
    "true_twist_rad",
    "true_load_n",
];
const WORDS: [&str; 5] = ["state", "fault", "faults", "limit", "doubts"];
const SENSED: [&str; 6] = ["t_s", "encoder_rad", "gap_m", "drive_current_a", "drive_speed_rad_per_s", "supply_v"];
const TRUTH: [&str; 14] = [
    "t_s",
    "position_m",
    "gap_m",
    "pretwist_gap_m",
    "gap_speed_m_per_s",
    "twist_rad",
    "load_n",
    "pull_n",
    "string_torque_nm",
    "motor_angle_rad",
    "motor_speed_rad_per_s",
    "motor_current_a",
    "motor_energy_j",
    "driven_rad",
];
const HOMED: [&str; 6] = ["duration_s", "load_n", "load_error_n", "friction_n", "zero_error_rad", "reference_gap_m"];
const MOVED: [&str; 11] = [
    "target_m",
    "position_m",
    "error_m",
    "true_error_m",
    "position_error_m",
    "load_n",
    "load_error_n",
    "tr_start_rad_per_m",
    "tr_end_rad_per_m",
    "turns",
    "duration_s",
];

fn number(value: Option<f32>) -> f64 {
    value.map_or(f64::NAN, f64::from)
}

fn truth(t: &Truth) -> [f64; TRUTH.len()] {
    [
        t.t_s,
        t.position_m,
        t.gap_m,
        t.pretwist_gap_m,
        t.gap_speed_m_per_s,
        t.twist_rad,
        t.load_n,
        t.pull_n,
        t.string_torque_nm,
        t.motor_angle_rad,
        t.motor_speed_rad_per_s,
        t.motor_current_a,
        t.motor_energy_j,
        t.driven_rad,
    ]
}

/// What a tick shows, in the order of the columns.
trait Shows: ControlLaw + Sized {
    const NUMBERS: &'static [&'static str];
    const WORDS: &'static [&'static str];

    fn numbers(bench: &ControlBench<Self>, last: &Self::Decision) -> Vec<f64>;
    fn words(last: &Self::Decision) -> Vec<String>;
}

impl Shows for Controller {
    const NUMBERS: &'static [&'static str] = &TELEMETRY;
    const WORDS: &'static [&'static str] = &WORDS;

    fn numbers(bench: &ControlBench, ControlTick { telemetry: t, sensors: s, .. }: &ControlTick) -> Vec<f64> {
        let truth = bench.truth();
        vec![
            t.t_us as f64 * 1e-6,
            number(t.target_m),
            number(t.setpoint_m),
            number(t.position_m),
            number(t.twist_rad),
            number(t.load_n),
            number(t.load_error_n),
            number(t.position_error_m),
            number(t.tr_rad_per_m),
            t.drive_current_a.into(),
            t.drive_speed_rad_per_s.into(),
            number(t.time_left_s),
            number(t.twist_scale),
            number(s.gap_m),
            s.shaft_rad.into(),
            number(s.supply_v),
            bench.true_position_m(),
            truth.twist_rad,
            truth.load_n,
        ]
    }

    fn words(ControlTick { telemetry: t, .. }: &ControlTick) -> Vec<String> {
        let name = |name: Option<&str>| name.unwrap_or_default().to_owned();
        vec![
            t.state.name().to_owned(),
            name(t.fault.map(|fault| fault.name())),
            t.fault.map_or(String::new(), |_| t.faults.to_string()),
            name(t.limit.map(|limit| limit.name())),
            t.doubts.to_string(),
        ]
    }
}

impl Shows for MotorSpeed {
    const NUMBERS: &'static [&'static str] = &SENSED;
    const WORDS: &'static [&'static str] = &[];

    fn numbers(bench: &ControlBench<Self>, MotorTick { inputs, .. }: &MotorTick) -> Vec<f64> {
        let constants = bench.rig.parameters();
        let (current_a, speed) = match inputs.drive {
            DriveReading::Reports { current_ma, speed_rpm, .. } => {
                (1e-3 * f64::from(current_ma), f64::from(speed_rpm) * TAU / 60.0)
            }
            _ => (f64::NAN, f64::NAN),
        };
        let gap = |code: f32| constants.lvdt_gap_at_code_zero_m() + constants.lvdt_metres_per_code() * f64::from(code);
        vec![
            inputs.now_us as f64 * 1e-6,
            inputs.encoder_counts as f64 / constants.counts_per_rad(),
            inputs.lvdt.map_or(f64::NAN, |block| gap(block.mean_code)),
            current_a,
            speed,
            number(inputs.supply.map(|supply| supply.volts)),
        ]
    }

    fn words(_: &MotorTick) -> Vec<String> {
        Vec::new()
    }
}

/// Rows of ticks of one rig; words by their place in a list.
struct Rows {
    numbers: Vec<f64>,
    truth: Vec<f64>,
    codes: Vec<f64>,
    words: Vec<String>,
}

/// Names and values of numbers, of the truth, and of words by their place in a list of them.
type Ticks<'py> = (
    (Vec<&'static str>, Bound<'py, PyArray3<f64>>),
    (Vec<&'static str>, Bound<'py, PyArray3<f64>>),
    (Vec<&'static str>, Bound<'py, PyArray3<f64>>, Vec<String>),
);

/// Names, the values of each rig, and why a rig has none.
type Results = (Vec<&'static str>, Vec<Vec<f64>>, Vec<String>);

/// Emulated rigs, each with why there is none.
struct Rigs<C: ControlLaw>(Vec<Mutex<Result<Box<ControlBench<C>>, String>>>);

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<C: Shows + Clone + Send> Rigs<C>
where
    C::Decision: Send,
{
    /// The rigs of a preset that seeds name, each with further changes, after their first tick.
    fn new(
        py: Python<'_>,
        scene: &rig_config::Scene,
        preset: &str,
        seeds: &[u64],
        plant: &[String],
        control: impl Fn(&EmulatedRig) -> C + Sync,
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
            let mut bench = ControlBench::on(rig, control);
            bench.tick(None);
            Ok(Box::new(bench))
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
    fn results<const N: usize>(
        &self,
        py: Python<'_>,
        names: [&'static str; N],
        f: impl Fn(usize, &mut ControlBench<C>) -> Result<[f64; N], String> + Sync,
    ) -> PyResult<Results> {
        let rows = self.each(py, f)?.into_iter().map(|row| match row {
            Ok(values) => (values.to_vec(), String::new()),
            Err(why) => (vec![f64::NAN; N], why),
        });
        let (values, why) = rows.unzip();
        Ok((names.to_vec(), values, why))
    }

    /// Ticks of all rigs; without any, the last one again.
    fn ticks<'py>(&self, py: Python<'py>, ticks: usize) -> PyResult<Ticks<'py>> {
        let rows = self.each(py, |_, bench| {
            let (mut rows, mut left) = (Rows { numbers: vec![], truth: vec![], codes: vec![], words: vec![] }, ticks);
            loop {
                if left > 0 {
                    bench.tick(None);
                }
                let Some(last) = &bench.last else { return Err("it has not begun".into()) };
                rows.numbers.extend(C::numbers(bench, last));
                rows.truth.extend(truth(&bench.truth()));
                for word in C::words(last) {
                    let place = rows.words.iter().position(|known| *known == word);
                    rows.codes.push(place.unwrap_or(rows.words.len()) as f64);
                    if place.is_none() {
                        rows.words.push(word);
                    }
                }
                left = left.saturating_sub(1);
                if left == 0 {
                    return Ok(rows);
                }
            }
        })?;
        let count = ticks.max(1);
        let mut words: Vec<String> = vec![String::new()];
        let (mut numbers, mut truths, mut codes) = (Vec::new(), Vec::new(), Vec::new());
        for row in rows {
            let row = row.unwrap_or_else(|_| Rows {
                numbers: vec![f64::NAN; count * C::NUMBERS.len()],
                truth: vec![f64::NAN; count * TRUTH.len()],
                codes: vec![0.0; count * C::WORDS.len()],
                words: vec![String::new()],
            });
            let of_all: Vec<f64> = row
                .words
                .into_iter()
                .map(|word| {
                    let place = words.iter().position(|known| *known == word).unwrap_or_else(|| {
                        words.push(word);
                        words.len() - 1
                    });
                    place as f64
                })
                .collect();
            numbers.extend(row.numbers);
            truths.extend(row.truth);
            codes.extend(row.codes.into_iter().map(|code| of_all[code as usize]));
        }
        let shaped = |values: Vec<f64>, names: &[&'static str]| {
            let array = numpy::ndarray::Array3::from_shape_vec((self.0.len(), count, names.len()), values);
            array.map(|array| (names.to_vec(), PyArray3::from_owned_array(py, array))).map_err(errors::broken)
        };
        let (names, codes) = shaped(codes, C::WORDS)?;
        Ok((shaped(numbers, C::NUMBERS)?, shaped(truths, &TRUTH)?, (names, codes, words)))
    }
}

/// Asks the control code for something in the next tick.
fn ask(bench: &mut ControlBench, request: Request) -> Result<(), String> {
    match bench.tick(Some(request)).reply {
        Some(Ok(Accepted::Started | Accepted::Done | Accepted::Unhomed)) => Ok(()),
        Some(Err(refusal)) => Err(refused(refusal)),
        None => Err("the control code gave no answer".into()),
    }
}

fn refused(refusal: Refusal) -> String {
    errors::in_python(&format!("refused: {refusal}"))
}

/// Why the rig is in another state than it should be in.
fn instead(bench: &ControlBench, when: &str) -> String {
    match (bench.control.state(), bench.control.fault()) {
        (State::Fault, Some(fault)) => format!("fault {fault} {when}"),
        (State::EStop, _) => format!("emergency stop {when}"),
        (state, _) => format!("{state} {when}"),
    }
}

/// Waits for the drive's start-up.
fn ready(bench: &mut ControlBench) -> Result<(), String> {
    let starts = |b: &ControlBench| b.control.state() == State::Boot;
    if starts(bench) && !bench.until(START_S, |b| !starts(b)) {
        return Err("the drive does not start: is it powered, is the bus wired?".into());
    }
    Ok(())
}

fn home(bench: &mut ControlBench, load: LoadChoice) -> Result<[f64; HOMED.len()], String> {
    ready(bench)?;
    let start_s = bench.time_s();
    ask(bench, Request::Home { load })?;
    bench.until(HOMING_S, |b| b.control.state() != State::Homing);
    let duration_s = bench.time_s() - start_s;
    let ended = bench
        .events
        .iter()
        .rev()
        .find(|(t_s, kind)| *t_s > start_s && matches!(kind, EventKind::Homed(_) | EventKind::HomingRefused(_)));
    // The tick that ends homing shows no load yet.
    match ended.map(|(_, kind)| *kind) {
        Some(EventKind::Homed(found)) if bench.control.state() == State::Ready => {
            bench.run(0.05);
            let HomingResult { load_n, load_error_n, friction_n, zero_error_rad, reference_gap_m, .. } = found;
            let [a, b, c, d, e] = [load_n, load_error_n, friction_n, zero_error_rad, reference_gap_m].map(f64::from);
            Ok([duration_s, a, b, c, d, e])
        }
        Some(EventKind::HomingRefused(failure)) => Err(format!("homing failed: {failure}")),
        _ => Err(instead(bench, "while homing")),
    }
}

fn move_to(
    bench: &mut ControlBench,
    target_m: f64,
    speed_m_per_s: f64,
    load: LoadChoice,
) -> Result<[f64; MOVED.len()], String> {
    let Some(before) = bench.last.as_ref().map(|last| last.telemetry) else { return Err("it has not begun".into()) };
    let start_s = bench.time_s();
    ask(bench, Request::Move { target_m: target_m as f32, speed_m_per_s: speed_m_per_s as f32, load })?;
    let distance_m = (target_m - number(before.position_m)).abs();
    // A heavy load may be slower than requested, because the motor has its own limit.
    let limit_s = 4.0 * distance_m / speed_m_per_s.abs().clamp(1e-6, 1e-3) + MOVE_SLACK_S;
    bench.until(limit_s, |b| b.control.state() != State::Moving);
    if bench.control.state() != State::Holding {
        return Err(instead(bench, "on the way"));
    }
    let duration_s = bench.time_s() - start_s;
    let (mut sum, mut true_sum, mut after) = (0.0, 0.0, before);
    for _ in 0..REST_TICKS {
        after = bench.tick(None).telemetry;
        sum += number(after.position_m);
        true_sum += bench.true_position_m();
    }
    let position_m = sum / f64::from(REST_TICKS);
    Ok([
        target_m,
        position_m,
        position_m - target_m,
        true_sum / f64::from(REST_TICKS) - target_m,
        number(after.position_error_m),
        number(after.load_n),
        number(after.load_error_n),
        number(before.tr_rad_per_m),
        number(after.tr_rad_per_m),
        (number(after.twist_rad) - number(before.twist_rad)) / TAU,
        duration_s,
    ])
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
        let (table, constants) = (fit.table.table(), scene.constants());
        let control = Controller::new(&table, constants, None);
        Rigs::new(py, scene, rig, &seeds, &plant, |_| control.clone()).map(Self)
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

    fn move_to(
        &self,
        py: Python<'_>,
        targets_m: Vec<f64>,
        speeds_m_per_s: Vec<f64>,
        loads_n: Vec<f64>,
    ) -> PyResult<Results> {
        self.0.results(py, MOVED, |k, bench| move_to(bench, targets_m[k], speeds_m_per_s[k], load_of(&loads_n, k)))
    }

    /// Begins moves, which takes one tick.
    fn begin_move(
        &self,
        py: Python<'_>,
        targets_m: Vec<f64>,
        speeds_m_per_s: Vec<f64>,
        loads_n: Vec<f64>,
    ) -> PyResult<Results> {
        self.0.results(py, [], |k, bench| {
            let (target_m, speed_m_per_s) = (targets_m[k] as f32, speeds_m_per_s[k] as f32);
            ask(bench, Request::Move { target_m, speed_m_per_s, load: load_of(&loads_n, k) }).map(|()| [])
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
        let rigs = Rigs::new(py, &scene.0, rig, &seeds, &plant, MotorSpeed::of)?;
        let reports = |b: &ControlBench<MotorSpeed>| {
            b.last.as_ref().is_some_and(|last| matches!(last.inputs.drive, DriveReading::Reports { .. }))
        };
        let started = rigs.each(py, |_, bench| {
            let started = bench.until(START_S, reports);
            started.then_some(()).ok_or_else(|| "the drive does not start: is it powered, is the bus wired?".into())
        })?;
        for (rig, started) in rigs.0.iter().zip(started) {
            if let Err(why) = started {
                *locked(rig) = Err(why);
            }
        }
        Ok(Self(rigs))
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

    /// The scene's current limit (A), and the maximum speed of the motor (rad/s).
    #[staticmethod]
    fn limits(scene: &Scene) -> (f64, f64) {
        (scene.0.rig.drive_current_limit_a, scene.0.rig.motor_speed_max_rad_per_s)
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
