//! One boot of a rig under one load: homing, rest, following, load steps, more moves.

use super::commission::Firmware;
use super::floor::{Check, Finding};
use super::subject::Subject;
use crate::ControlBench;
use crate::compare::play::Record;
use crate::compare::score::{Score, Summary};
use rig_control::TICK_S;
use rig_link::messages::{LoadChoice, Request, State};
use rig_plant::units::STANDARD_GRAVITY;

/// Where the load rests and is changed (m), how fast it goes there (m/s), and how long it rests (s).
const REST_M: f32 = 0.008;
const SPEED_M_PER_S: f32 = 0.002;
const REST_S: f64 = 60.0;
/// Ticks over which the measured position is averaged at rest, as `rigctl move` does it.
const AVERAGED: usize = 30;
/// A reversal of the strings counts from this size (rad).
pub const REVERSAL_RAD: f64 = 0.02;
/// Between which places the load follows, up and down (m).
const FOLLOW_M: [f32; 2] = [0.004, 0.012];
/// When after a step of the load its value is asked for (s).
const TOLD_S: f64 = 5.0;
/// The moves at the end (m).
const MOVES_M: [f32; 5] = [0.002, 0.013, 0.005, 0.011, 0.001];
/// How long a load is watched after a fault (s), and how long `clear` is tried (s).
const WATCHED_S: f64 = 3.0;
const CLEARED_S: f64 = 5.0;

/// What is asked of every boot, for rigs that do not get so far.
const ASKED: [Check; 8] = [
    Check::Zero,
    Check::LoadHomed,
    Check::LoadStep,
    Check::RestMeasured,
    Check::Hunting,
    Check::RestTrue,
    Check::FollowRms,
    Check::FollowMax,
];

/// The findings where nothing could be tried, and why.
fn nothing(load_kg: f64, why: &str) -> Vec<Finding> {
    let none = |check| Finding { load_kg: Some(load_kg), check, value: None, note: why.to_owned() };
    ASKED.map(none).to_vec()
}

struct Trial {
    load_kg: f64,
    bench: ControlBench,
    findings: Vec<Finding>,
    moves: u32,
    /// Faults without a cause.
    faults: Vec<String>,
}

/// Tries one boot; `other_kg` is the load that it is changed to. Returns what was found, and the two moves of following if
/// they could be made.
pub fn boot(
    subject: &Subject,
    firmware: &Firmware,
    load_kg: f64,
    other_kg: f64,
) -> (Vec<Finding>, Option<Vec<Record>>) {
    let rig = match subject.switched_on(load_kg * STANDARD_GRAVITY) {
        Ok(rig) => rig,
        Err(why) => return (nothing(load_kg, &why.to_string()), None),
    };
    let bench = ControlBench::on(rig, firmware.boot());
    let mut trial = Trial { load_kg, bench, findings: Vec::new(), moves: 0, faults: Vec::new() };
    let records = trial.run(other_kg);
    (trial.findings, records)
}

impl Trial {
    fn found(&mut self, check: Check, value: impl Into<Option<f64>>, note: &str) {
        self.findings.push(Finding { load_kg: Some(self.load_kg), check, value: value.into(), note: note.into() });
    }

    fn run(&mut self, other_kg: f64) -> Option<Vec<Record>> {
        if let Err(why) = self.bench.home() {
            self.found(Check::Zero, None, &why);
            let rest = nothing(self.load_kg, "not homed");
            self.findings.extend(rest.into_iter().filter(|finding| finding.check != Check::Zero));
            return None;
        }
        self.homed();
        self.part(&[Check::RestMeasured, Check::Hunting, Check::RestTrue], Self::rest);
        let records = self.part(&[Check::FollowRms, Check::FollowMax], Self::follow);
        self.step_load(other_kg);
        // One that fails is a fault, or is not counted.
        for target_m in MOVES_M {
            let _ = self.go(target_m);
        }
        self.stated("last move");
        let faults = self.faults.join("; ");
        self.found(Check::Faults, self.faults.len() as f64, &faults);
        self.found(Check::Moves, f64::from(self.moves), "");
        records
    }

    /// Does a part of the trial. What it should have found has no value where it fails.
    fn part<T>(&mut self, checks: &[Check], part: impl FnOnce(&mut Self) -> Result<T, String>) -> Option<T> {
        let done = part(self);
        if let Err(why) = &done {
            checks.iter().for_each(|check| self.found(*check, None, why));
        }
        done.ok()
    }

    fn homed(&mut self) {
        let told = self.bench.telemetry().and_then(|t| t.twist_rad);
        let zero_error = told.map(|told| f64::from(told) - self.bench.truth().twist_rad.abs());
        self.found(Check::Zero, zero_error, "");
        // The tick that ended homing shows no load yet.
        self.bench.run(5.0 * f64::from(TICK_S));
        self.load(Check::LoadHomed, "homing");
    }

    /// The load as told now.
    fn load(&mut self, check: Check, when: &str) {
        let true_n = self.bench.truth().load_n;
        let told = self.bench.telemetry().and_then(|t| t.load_n);
        let error_n = told.map(|reported_n| f64::from(reported_n) - true_n);
        let why = if error_n.is_none() { format!("{when}: no load is told") } else { when.to_owned() };
        self.found(check, error_n.map(|error_n| error_n / true_n), &why);
        self.stated(when);
    }

    /// Whether the errors that the board states now cover the true ones.
    fn stated(&mut self, when: &str) {
        let Some(t) = self.bench.telemetry() else { return };
        let true_n = self.bench.truth().load_n;
        if let (Some(reported_n), Some(stated_n)) = (t.load_n, t.load_error_n) {
            let (error_n, stated_n) = ((f64::from(reported_n) - true_n).abs(), f64::from(stated_n));
            self.found(Check::LoadCover, f64::from(u8::from(error_n <= stated_n)), when);
            self.found(Check::Certain, error_n / stated_n, when);
        }
        if let (Some(reported_m), Some(stated_m)) = (t.position_m, t.position_error_m) {
            let error_m = (f64::from(reported_m) - self.bench.true_position_m()).abs();
            self.found(Check::PositionCover, f64::from(u8::from(error_m <= f64::from(stated_m))), when);
        }
    }

    /// Waits until nothing moves; in words how the motion ended if not at its target. A fault is counted, cleared, and the
    /// rig is homed again if it has to be.
    fn end(&mut self, what: &str) -> Result<(), String> {
        self.bench.until(60.0, |bench| bench.control.state() != State::Moving);
        match self.bench.control.state() {
            State::Holding => Ok(()),
            State::Fault => Err(self.fault(what)),
            state => Err(format!("{what}: ends as {state}")),
        }
    }

    /// Counts a fault that has no cause, and goes on; in words what it was.
    fn fault(&mut self, what: &str) -> String {
        let why = format!("{what}: {}", self.bench.control.faults());
        self.faults.push(why.clone());
        let sank_m = self.recover();
        self.found(Check::Sank, sank_m, &why);
        why
    }

    /// Watches the load, clears the faults, and homes again if that has to be; how far the load sank meanwhile (m).
    fn recover(&mut self) -> f64 {
        let gap_m = self.bench.truth().gap_m;
        let mut sank_m = 0.0f64;
        self.bench.watch(WATCHED_S, |bench| sank_m = sank_m.max(bench.truth().gap_m - gap_m));
        let end_s = self.bench.time_s() + CLEARED_S;
        while self.bench.control.state() == State::Fault && self.bench.time_s() < end_s {
            self.bench.tick(Some(Request::Clear));
            self.bench.run(0.1);
        }
        if self.bench.control.state() == State::Unhomed {
            // If that fails the next move is refused, which is what its checks then say.
            let _ = self.bench.home();
        }
        sank_m
    }

    fn begin(&mut self, target_m: f32) -> Result<(), String> {
        let request = Request::Move { target_m, speed_m_per_s: SPEED_M_PER_S, load: LoadChoice::Auto };
        self.bench.ask(request).map_err(|why| format!("move to {:.0} mm: {why}", target_m * 1e3))?;
        self.moves += 1;
        Ok(())
    }

    fn go(&mut self, target_m: f32) -> Result<(), String> {
        self.begin(target_m)?;
        self.end(&format!("move to {:.0} mm", target_m * 1e3))
    }

    fn rest(&mut self) -> Result<(), String> {
        self.go(REST_M)?;
        let target_m = f64::from(REST_M);
        let (mut measured_m, mut twists) = (Vec::new(), Vec::new());
        let mut truly_m = 0.0f64;
        let left = self.bench.until(REST_S, |bench| {
            if let Some(t) = bench.telemetry() {
                measured_m.extend(t.position_m.map(|position_m| f64::from(position_m) - target_m));
                twists.extend(t.twist_rad.map(f64::from));
            }
            truly_m = truly_m.max((bench.true_position_m() - target_m).abs());
            bench.control.state() != State::Holding
        });
        if left {
            return Err(match self.bench.control.state() {
                State::Fault => self.fault("at rest"),
                state => format!("at rest: ends as {state}"),
            });
        }
        let averaged = measured_m.chunks_exact(AVERAGED).map(|some| some.iter().sum::<f64>() / AVERAGED as f64);
        self.found(Check::RestMeasured, averaged.map(f64::abs).fold(0.0, f64::max), "");
        self.found(Check::RestTrue, truly_m, "");
        self.found(Check::Hunting, reversals(&twists, REVERSAL_RAD) as f64, "");
        self.stated("rest");
        Ok(())
    }

    /// Up and down at the speed of every move.
    fn follow(&mut self) -> Result<Vec<Record>, String> {
        let [low_m, high_m] = FOLLOW_M;
        self.go(low_m)?;
        let records = vec![self.recorded(high_m)?, self.recorded(low_m)?];
        let summary = Summary::new(&records.iter().map(Score::new).collect::<Vec<_>>());
        self.found(Check::FollowRms, summary.rms_m, "");
        self.found(Check::FollowMax, summary.max_m, "");
        Ok(records)
    }

    /// A move with its set-points and true positions.
    fn recorded(&mut self, target_m: f32) -> Result<Record, String> {
        let from_m = self.bench.true_position_m();
        self.begin(target_m)?;
        let mut record = Record { ends_m: [from_m, target_m.into()], ..Record::default() };
        self.bench.until(60.0, |bench| {
            if let Some(set_point_m) = bench.telemetry().and_then(|t| t.setpoint_m) {
                record.set_points_m.push(set_point_m);
                record.positions_m.push(bench.true_position_m());
            }
            bench.control.state() != State::Moving
        });
        self.end(&format!("following to {:.0} mm", target_m * 1e3))?;
        Ok(record)
    }

    /// Another load is hung on, then the first again.
    fn step_load(&mut self, other_kg: f64) {
        let ready = self.go(REST_M);
        let (first_kg, ways) = (self.load_kg, [(other_kg, "there"), (self.load_kg, "back")]);
        for (load_kg, way) in ways {
            self.part(&[Check::LoadStep], |trial| {
                ready.clone()?;
                let load_n = load_kg * STANDARD_GRAVITY;
                trial.bench.rig.set_plant("load", &load_n.to_string()).map_err(|e| e.to_string())?;
                trial.load_kg = load_kg;
                trial.bench.run(TOLD_S);
                trial.load(Check::LoadStep, &format!("step {way}, to {load_kg} kg"));
                // The load has moved by itself, so a fault has a cause: held and told is what is asked.
                if trial.bench.control.state() == State::Fault {
                    trial.recover();
                }
                Ok(())
            });
        }
        self.load_kg = first_kg;
    }
}

/// How often a twist turns back by at least `size`.
fn reversals(twists: &[f64], size: f64) -> usize {
    let Some(first) = twists.first() else { return 0 };
    let (mut turning_point, mut way, mut count) = (*first, 0.0, 0);
    for twist in twists {
        let moved = twist - turning_point;
        if way == 0.0 || moved * way >= 0.0 {
            // Still the same way, or the first way that is long enough to be one.
            if way != 0.0 || moved.abs() >= size {
                (turning_point, way) = (*twist, moved.signum());
            }
        } else if moved.abs() >= size {
            (turning_point, way, count) = (*twist, -way, count + 1);
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::reversals;

    #[test]
    fn reversals_count_from_their_size() {
        let wave =
            |amplitude: f64| (0..1000).map(move |k| amplitude * (f64::from(k) * 0.01 * std::f64::consts::TAU).sin());
        let count = |amplitude: f64| reversals(&wave(amplitude).collect::<Vec<_>>(), 0.02);
        assert_eq!(count(0.009), 0, "18 mrad from end to end");
        // Ten waves: the first quarter is a way, then twenty reversals.
        assert_eq!(count(0.05), 20);
        assert_eq!(reversals(&[0.0, 1.0, 2.0, 3.0], 0.02), 0, "one way");
        assert_eq!(reversals(&[], 0.02), 0);
    }
}
