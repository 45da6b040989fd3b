//! What a user does with a new rig: calibrates the LVDT against callipers, records sweeps under weighed loads, identifies
//! the mechanism's constants from them, and builds the firmware with the table of the identified scene.

use super::floor::{Check, Finding};
use super::subject::Subject;
use crate::load_changes::lay_on;
use crate::sweep::{SPEED_RAD_PER_S, identified, swept};
use crate::{ControlBench, constants, scene, table};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rig_control::{Controller, RigConstants, settings};
use rig_link::messages::{LoadChoice, Request, SettingValues, State};
use rig_plant::units::STANDARD_GRAVITY;
use rigctl::identify::Identified;
use rigctl::identify::constants::Constant;
use rigctl::identify::laws::Law;
use rigctl::log::sweep::Sweep;
use rigctl::lvdt_points::{self, Point, uncalibrated};
use std::f64::consts::{PI, TAU};
use tsa_model::twist_from_turns;
use tsa_table::Table;

/// Loads of the sweeps (kg): the ends of what will be lifted, and between.
pub const SWEEP_LOADS_KG: [f64; 3] = [0.15, 0.6, 1.5];
/// The sweep that is recorded again after the heaviest load, and that load (kg): it shows what the rods remember.
const AFTER_KG: [f64; 2] = [SWEEP_LOADS_KG[1], SWEEP_LOADS_KG[2]];
/// How long the rods carry that load, and how long they then rest before homing (s), as `rigctl sweep --after` has it.
const CARRIED_S: f64 = 3.0;
/// Turns past the half-turn pre-twist.
const TURNS: f64 = 7.5;
/// Turns, besides half those of the sweeps, at which predicted contractions are compared with the rig's own.
const HELD_OUT_TURNS: f64 = 6.5;
/// How often a sweep is tried whose homing or turns fail, each time from another twist.
const TRIES: u8 = 3;
/// Loads of the calibration (kg), and for each how many points lie on how long a way up from the half-turn pre-twist (m):
/// together they cover the gaps of all loads and sweeps.
const CALIBRATION: [(f64, usize, f64); 2] = [(1.5, 3, 0.007), (0.3, 8, 0.026)];
/// What the gauge reads to (m).
const GAUGE_M: f64 = 20e-6;

/// What the board is built and set up with.
#[derive(Clone, Debug)]
pub struct Firmware {
    /// The table.
    pub table: &'static Table<'static>,
    /// The scene's constants.
    pub constants: RigConstants,
    /// The settings.
    pub settings: SettingValues,
}

impl Firmware {
    /// Of the default scene, nothing set.
    pub fn as_built() -> Self {
        Self { table: table(), constants: constants(), settings: settings::defaults(&constants()) }
    }

    /// The control code, as after power-up.
    pub fn boot(&self) -> Controller {
        let mut control = Controller::new(self.table, self.constants, None);
        control.set_up(&self.settings);
        control
    }
}

/// The firmware whose LVDT was calibrated. Where that fails it goes on as it is.
pub fn calibrated(subject: &Subject) -> Firmware {
    let as_built = Firmware::as_built();
    let settings = calibrate(&subject.at_calibration()).unwrap_or(as_built.settings);
    Firmware { settings, ..as_built }
}

/// The firmware that the rig is used with, and what was identified. Who cannot identify a rig, or finds no table for it, goes on
/// with the default scene's table.
pub fn commission(subject: &Subject) -> (Firmware, Result<Identified, String>) {
    let firmware = calibrated(subject);
    let found = sweeps(&subject.at_calibration(), &firmware).and_then(|sweeps| identified(&sweeps));
    let built = found.and_then(|found| Ok((build(&found, &firmware).map_err(|why| format!("table: {why}"))?, found)));
    match built {
        Ok((built, found)) => (built, Ok(found)),
        Err(why) => (firmware, Err(why)),
    }
}

/// How what was identified compares with the rig.
pub fn judged(subject: &Subject, found: &Result<Identified, String>) -> Vec<Finding> {
    let subject = &subject.at_calibration();
    let held_out = |value, note| Finding { load_kg: None, check: Check::HeldOut, value, note };
    match found {
        Ok(found) => [
            vec![held_out(held_out_error(subject, found), String::new())],
            predicted(subject, found),
            found_constants(subject, found),
        ]
        .concat(),
        Err(why) => vec![held_out(None, format!("goes on as built: {why}"))],
    }
}

/// Calibrates the LVDT at eleven points of the way that the load moves, turning the strings by hand from one to the next:
/// `rigctl calibrate lvdt --points`.
pub fn calibrate(subject: &Subject) -> Result<SettingValues, String> {
    let firmware = Firmware::as_built();
    let mut gauge = Pcg64Mcg::seed_from_u64(subject.seed);
    let mut points = Vec::new();
    for (load_kg, count, distance_m) in CALIBRATION {
        let rig = subject.switched_on_at(load_kg * STANDARD_GRAVITY, PI).map_err(|e| e.to_string())?;
        let mut bench = ControlBench::on(rig, firmware.boot());
        bench.ready()?;
        let (from_m, _) = mean_gap(&mut bench)?;
        for k in 0..count {
            if k > 0 {
                jog_to(&mut bench, from_m - distance_m * k as f64 / (count - 1) as f64)?;
            }
            let (shown_m, true_m) = mean_gap(&mut bench)?;
            let gap_m = true_m + gauge.random_range(-GAUGE_M..=GAUGE_M);
            points.push((points.len() + 1, Point { gap_m, sensor_m: uncalibrated(shown_m, &firmware.settings) }));
        }
    }
    let curve = lvdt_points::curve(points, &scene().rig, GAUGE_M)?;
    Ok(SettingValues { lvdt_curve: Some(curve), ..firmware.settings })
}

/// Turns the strings until the sensor shows a gap (m), which is above.
fn jog_to(bench: &mut ControlBench, gap_m: f64) -> Result<(), String> {
    bench.tick(Some(Request::Jog { twist_speed_rad_per_s: SPEED_RAD_PER_S as f32 }));
    let there = bench.until(60.0, |bench| shown_gap_m(bench).is_some_and(|shown_m| shown_m <= gap_m));
    bench.tick(Some(Request::Stop));
    let stands = bench.until(5.0, |bench| bench.control.state() != State::Moving);
    if there && stands {
        return Ok(());
    }
    Err(format!("the load does not come to a gap of {:.2} mm: {}", 1e3 * gap_m, bench.control.faults()))
}

fn shown_gap_m(bench: &ControlBench) -> Option<f64> {
    bench.telemetry()?.gap_m.map(f64::from)
}

/// Mean of the shown and of the true gap (m) over half a second, after a second for the load to stop oscillating.
fn mean_gap(bench: &mut ControlBench) -> Result<(f64, f64), String> {
    bench.run(1.0);
    let (mut shown_m, mut true_m, mut count) = (0.0, 0.0, 0.0);
    bench.watch(0.5, |bench| {
        if let Some(gap_m) = shown_gap_m(bench) {
            shown_m += gap_m;
            true_m += bench.truth().gap_m;
            count += 1.0;
        }
    });
    if count > 0.0 { Ok((shown_m / count, true_m / count)) } else { Err("the sensor shows no gap".into()) }
}

/// The recorded sweeps of a rig, reduced to equilibria, each with a name.
///
/// # Errors
/// In words, if one fails from every twist at power-up.
pub fn sweeps(subject: &Subject, firmware: &Firmware) -> Result<Vec<(String, Sweep)>, String> {
    let one = |(load_kg, after_kg): (f64, Option<f64>)| {
        let name =
            format!("{load_kg} kg{}", after_kg.map_or(String::new(), |after_kg| format!(" after {after_kg} kg")));
        let mut swept = Err(String::new());
        for turns in 0..TRIES {
            swept = sweep(subject, firmware, load_kg, after_kg, turns);
            if swept.is_ok() {
                break;
            }
        }
        let swept = swept.map_err(|why| format!("sweep at {name}: {why}"))?;
        Ok((name, swept))
    };
    let [again_kg, after_kg] = AFTER_KG;
    SWEEP_LOADS_KG.map(|load_kg| (load_kg, None)).into_iter().chain([(again_kg, Some(after_kg))]).map(one).collect()
}

/// Predicted contractions beside those of the rig: at the ends and in the middle of the scene's loads.
fn predicted(subject: &Subject, found: &Identified) -> Vec<Finding> {
    let law = found.candidate.law.name();
    let judged = found.predictions.iter().flat_map(|p| {
        let truth = subject.contraction_m(p.load_n, twist_from_turns(p.turns)).ok();
        let values = p.contraction_m.zip(p.half_width_m).zip(truth);
        let load_kg = Some(p.load_n / STANDARD_GRAVITY);
        let finding = move |check, value| Finding { load_kg, check, value, note: format!("by {law}") };
        let error = values.map(|((reported_m, half_m), true_m)| ((reported_m - true_m) / half_m, half_m / true_m));
        [
            finding(Check::PredictionCover, error.map(|(over, _)| f64::from(u8::from(over.abs() <= 1.0)))),
            finding(Check::PredictionStated, error.map(|(_, stated)| stated)),
            finding(Check::PredictionOverStated, error.map(|(over, _)| over)),
        ]
    });
    judged.collect()
}

/// The identified constants beside those of the rig, where the law is the rig's own.
fn found_constants(subject: &Subject, found: &Identified) -> Vec<Finding> {
    let (truth, scene) = (subject.constants(), scene());
    let same = found.candidate.law == Law::of(&truth);
    let modulus = truth.material.stress_coefficients_pa[0] / scene.material.stress_coefficients_pa[0];
    let judged = found.fit.estimates.iter().filter_map(|e| {
        let true_value = match Constant::named(&e.name)? {
            Constant::Modulus => modulus,
            Constant::K1 if same => truth.string.k1_per_n,
            Constant::K2 if same => truth.string.k2,
            Constant::K3 if same => truth.string.k3,
            Constant::Exponent if same => truth.string.twist_exponent?,
            _ => return None,
        };
        let covered = (e.unknown - true_value.ln()).abs() <= e.half_width_90;
        let value = Some(f64::from(u8::from(covered)));
        Some(Finding { load_kg: None, check: Check::ConstantCover, value, note: e.name.clone() })
    });
    judged.collect()
}

/// One sweep, from so many turns at power-up, by its equilibria; of rods that have just carried a heavier load, if one is given.
fn sweep(
    subject: &Subject,
    firmware: &Firmware,
    load_kg: f64,
    after_kg: Option<f64>,
    turns: u8,
) -> Result<Sweep, String> {
    let carried_kg = after_kg.unwrap_or(load_kg);
    let [load_n, carried_n] = [load_kg, carried_kg].map(|kg| kg * STANDARD_GRAVITY);
    let rig = subject.switched_on_at(carried_n, 1.0 + TAU * f64::from(turns)).map_err(|e| e.to_string())?;
    let mut bench = ControlBench::on(rig, firmware.boot());
    if after_kg.is_some() {
        bench.run(CARRIED_S);
        lay_on(&mut bench, carried_kg, load_kg)?;
        bench.run(CARRIED_S);
    }
    bench.home_under(LoadChoice::Known(load_n as f32))?;
    let homed = bench.found.ok_or("homing has no result")?;
    let after_n = after_kg.map(|_| carried_n);
    Ok(Sweep { after_n, ..swept(&mut bench, &homed, load_n, TURNS)? })
}

/// Rms error of contractions under loads between those of the sweeps, as shares of the rig's true ones; none if the law has
/// no equilibrium there.
fn held_out_error(subject: &Subject, found: &Identified) -> Option<f64> {
    let between = SWEEP_LOADS_KG.windows(2).map(|pair| (pair[0] * pair[1]).sqrt() * STANDARD_GRAVITY);
    let states = between.flat_map(|load_n| [0.5 * TURNS, HELD_OUT_TURNS].map(|turns| (load_n, turns)));
    let squares: Option<Vec<f64>> = states
        .map(|(load_n, turns)| {
            let reported_m = found.known.predict(load_n, turns).contraction_m?;
            let true_m = subject.contraction_m(load_n, twist_from_turns(turns)).ok()?;
            Some((reported_m / true_m - 1.0).powi(2))
        })
        .collect();
    let squares = squares?;
    Some((squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// The firmware for an identified scene.
fn build(found: &Identified, firmware: &Firmware) -> Result<Firmware, String> {
    let Some(fit) = &found.table else {
        return Err(found.untabled.clone().unwrap_or_else(|| "the scene asks for none".into()));
    };
    let owned = Box::leak(Box::new(fit.table.clone()));
    Ok(Firmware {
        table: Box::leak(Box::new(owned.table())),
        constants: found.scene.constants(),
        settings: firmware.settings,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rigs::subject::EFFECTS;
    use rig_plant::RigPreset;

    #[test]
    fn what_the_rods_remember_is_identified_from_the_sweep_after_the_heaviest_load() {
        let hysteresis = EFFECTS.iter().find(|(name, _)| *name == "rod hysteresis").expect("an effect");
        let rigs = [Subject::new(RigPreset::Ideal, 1), Subject::with_effect(hysteresis, RigPreset::Nominal, None, 1)];
        let [without, with] = rigs.map(|rig| commission(&rig).1.expect("identified"));
        assert_eq!([without.rod_memory.len(), with.rod_memory.len()], [1, 1]);
        let stated = [without, with].map(|found| found.scene.uncertainty.rod_memory);
        assert!(stated[0] < 0.03 && (0.1..0.4).contains(&stated[1]), "{stated:?}");
    }
}
