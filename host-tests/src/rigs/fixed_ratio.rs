//! The same moves on the same rig by a loop with a fixed ratio: the best of several, chosen on this very rig. It reads the
//! LVDT with the same calibration, and it is given the true zero of the twist, the true load, and the set-points that the
//! firmware made.

use super::commission::Firmware;
use super::floor::{Check, Finding};
use super::subject::Subject;
use crate::ControlBench;
use crate::compare::baseline::{self, Baseline, Law, Loop};
use crate::compare::play::Record;
use crate::compare::score::{Score, Summary};
use rig_control::TICK_S;
use rig_plant::units::STANDARD_GRAVITY;
use std::f32::consts::PI;

/// Ratios (rad/m), and gains (1/s) with corners (rad/s), of which the best are taken: around what `cargo xtask compare`
/// finds over many rigs.
const RATIOS: [f32; 4] = [2100.0, 1200.0, 1600.0, 2757.0];
const GAINS: [[f32; 2]; 3] = [[4.7, 30.0], [7.5, 21.8], [12.0, 30.0]];
/// Time to come to rest where the moves begin (s).
const SETTLED_S: f64 = 2.0;

/// Rms error of the best fixed ratio over that of the firmware, on the moves of following under every load.
pub fn compare(subject: &Subject, firmware: &Firmware, along: &[(f64, Vec<Record>)]) -> Finding {
    let finding = |value, note: String| Finding { load_kg: None, check: Check::FixedRatio, value, note };
    if along.is_empty() {
        return finding(None, "the firmware followed under no load".into());
    }
    let ours = rms_m(along.iter().flat_map(|(_, records)| records));
    let ready = |load_and_twist| baseline::at_reference(subject, firmware, load_and_twist);
    let ready: Result<Vec<_>, String> =
        along.iter().map(|(load_kg, _)| [load_kg * STANDARD_GRAVITY, f64::from(PI)]).map(ready).collect();
    let ready = match ready {
        Ok(ready) => ready,
        Err(why) => return finding(None, why),
    };
    let rms = |law: Loop| {
        let played = ready.iter().zip(along).flat_map(|(bench, (_, records))| play(bench.clone(), law, records));
        (rms_m(&played.collect::<Vec<_>>()), law)
    };
    let law = |tr: f32, [gain_per_s, corner_rad_per_s]: [f32; 2]| Loop {
        tr_rad_per_m: Some(tr),
        gain_per_s,
        corner_rad_per_s,
        breakaway_rad: 0.0,
    };
    let min = |a: &(f64, Loop), b: &(f64, Loop)| a.0.total_cmp(&b.0);
    // First the gain, then the ratio with it.
    let Some(gained) = GAINS.map(|gain| rms(law(RATIOS[0], gain))).into_iter().min_by(min) else {
        return finding(None, String::new());
    };
    let gain = [gained.1.gain_per_s, gained.1.corner_rad_per_s];
    let others = RATIOS[1..].iter().map(|tr| rms(law(*tr, gain)));
    let (theirs, law) = others.chain([gained]).min_by(min).unwrap_or(gained);
    let [tr, gain] = [law.tr_rad_per_m.unwrap_or(0.0) * 1e-3, law.gain_per_s];
    finding(Some(theirs / ours), format!("TR {tr:.2} rad/mm, gain {gain} 1/s: {:.0} µm", theirs * 1e6))
}

fn rms_m<'a>(records: impl IntoIterator<Item = &'a Record>) -> f64 {
    Summary::new(&records.into_iter().map(Score::new).collect::<Vec<_>>()).rms_m
}

/// The loop along the firmware's set-points, after a move to where these begin.
fn play(mut bench: ControlBench<Baseline>, law: Loop, along: &[Record]) -> Vec<Record> {
    bench.control.law = Law::Loop(law);
    let begin_m = along.first().and_then(|record| record.set_points_m.first()).copied().unwrap_or(0.0);
    let step_m = along.iter().flat_map(|r| r.set_points_m.windows(2)).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    let ramp = (1..).map(|k| (k as f32 * step_m).min(begin_m)).take_while(|s| *s < begin_m && step_m > 0.0);
    let rest = std::iter::repeat_n(begin_m, (SETTLED_S / f64::from(TICK_S)) as usize);
    let mut tick = |set_point_m: f32, target_m: f32| {
        baseline::follow(&mut bench, set_point_m, target_m, step_m / TICK_S);
        bench.true_position_m()
    };
    ramp.chain(rest).for_each(|set_point_m| {
        tick(set_point_m, begin_m);
    });
    let played = along.iter().map(|record| Record {
        positions_m: record.set_points_m.iter().map(|s| tick(*s, record.ends_m[1] as f32)).collect(),
        ..record.clone()
    });
    played.collect()
}
