//! Random scenarios with an oracle: what the board believes holds within twice its stated error unless it says that it doubts,
//! nothing turns by the motor's torque while a fault is latched, and no fault is raised without a cause.

use crate::ControlBench;
use crate::rigs::subject::Subject;
use crate::study::{Rigs, Study, each};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rig_control::TICK_S;
use rig_control::observer::TRAVEL_M;
use rig_link::messages::{Doubts, Fault, LoadChoice, Request, State};
use rig_plant::units::STANDARD_GRAVITY;
use rig_plant::{RigFault, RigPreset, Truth};
use std::collections::BTreeMap;

/// Kinds of rigs, scenarios of each, and the first one's seed. The causes were told apart on seeds from 100 001.
const KINDS: [RigPreset; 2] = [RigPreset::Nominal, RigPreset::Hard];
const SCENARIOS: u64 = 5000;
const FIRST_SEED: u64 = 200_001;

/// Steps of a scenario after its homing.
const STEPS: u32 = 10;
/// How long a belief may be wrong (s) after the load has changed, and how long it may be wrong at all.
const CHANGED_S: f64 = 5.0;
const WRONG_S: f64 = 1.0;
/// How far the shaft may still turn by the motor's torque (rad) once a fault has been latched for half a second.
const TURNED_RAD: f64 = 0.3;
/// How far the load must truly be behind its set-point (m), the stated error of its position aside, for that to be a fault, at some
/// time in the last second.
const BEHIND_M: f64 = 2e-3;
/// Travel (m) after which a load shows what it weighs: twice that over which the board's estimate follows it.
const MOVED_M: f64 = 2.0 * TRAVEL_M as f64;
/// Faults that come and go, with how long they last (s).
const FAULTS: [(RigFault, f64); 11] = [
    (RigFault::StringSlip, 0.0),
    (RigFault::EncoderJump, 0.0),
    (RigFault::DriveStall, 0.0),
    (RigFault::DriveReset, 0.0),
    (RigFault::CanSilent, 0.5),
    (RigFault::EncoderStuck, 0.5),
    (RigFault::LvdtFrozen, 0.5),
    (RigFault::LvdtNoisy, 0.5),
    (RigFault::LvdtOpen, 0.2),
    (RigFault::LimitSwitch, 0.5),
    (RigFault::Estop, 0.5),
];

/// One scenario under way.
struct Scenario {
    bench: ControlBench,
    load_kg: f64,
    /// When a fault of the rig ended or the load changed (s).
    disturbed_s: f64,
    /// Since when load and position are believed wrongly (s), and what was said.
    wrong_s: [Option<f64>; 2],
    /// When the load was last truly [`BEHIND_M`] from its set-point (s), as one that friction holds is.
    behind_s: f64,
    /// Stated error of the load when it was last known (N).
    load_error_n: f64,
    /// Gap (m) at which the load was changed, until it has moved from there: friction hides a change of up to twice its size.
    changed_at_m: Option<f64>,
    /// Somebody changed the load while it was homed: the change looks like friction, until the next homing.
    homed_changing: bool,
    /// Its encoder lost counts while it was stuck, until the drive starts again. If they are fewer than own encoder and drive may
    /// differ by, they show later or never.
    lost_counts: bool,
    /// A string that has slipped looks like another load, also to a homing (docs/explanation/how-it-works.md).
    has_slipped: bool,
    /// When the latched fault was raised (s), and how far the motor had driven half a second later (rad).
    fault: Option<(f64, Option<f64>)>,
    found: Found,
}

/// What the oracle found in a scenario.
#[derive(Default)]
struct Found {
    /// Seconds of it, and those in which the load and the position were stated and could be judged, and were off by too much.
    seconds: f64,
    judged_s: [f64; 2],
    off_s: [f64; 2],
    /// Faults, each with its cause.
    faults: Vec<(Fault, &'static str)>,
    /// What must not be, in words.
    wrong: Vec<String>,
}

/// Whether a load may seem to be [`BEHIND_M`] from its set-point where it truly is, all in m, by the stated error of its position.
fn may_seem_behind(is_m: f64, set_point_m: f64, stated_m: f64) -> bool {
    (is_m - set_point_m).abs() > BEHIND_M - stated_m
}

/// The cause of a fault that has none.
const NO_CAUSE: &str = "no cause";

impl Scenario {
    /// On a rig that has just been switched on with a load (kg).
    fn new(kind: RigPreset, seed: u64, load_kg: f64) -> Self {
        let rig = Subject::new(kind, seed).switched_on(load_kg * STANDARD_GRAVITY).expect("a rig");
        Self {
            bench: ControlBench::on(rig, crate::booted()),
            load_kg,
            disturbed_s: 0.0,
            wrong_s: [None; 2],
            behind_s: f64::NEG_INFINITY,
            load_error_n: 0.0,
            changed_at_m: None,
            homed_changing: false,
            lost_counts: false,
            has_slipped: false,
            fault: None,
            found: Found::default(),
        }
    }

    fn tick(&mut self, request: Option<Request>) {
        self.bench.tick(request);
        let (now_s, truth) = (self.bench.time_s(), self.bench.truth());
        let telemetry = self.bench.last.as_ref().expect("a tick").telemetry;
        let quiet = now_s - self.disturbed_s > CHANGED_S;
        let at_work = matches!(telemetry.state, State::Ready | State::Moving | State::Holding);
        let load = telemetry
            .load_n
            .zip(telemetry.load_error_n)
            .filter(|_| telemetry.doubts == Doubts::NONE && !self.has_slipped && !self.homed_changing);
        let position = telemetry.position_m.zip(telemetry.position_error_m);
        self.changed_at_m = self.changed_at_m.filter(|gap_m| (truth.gap_m - gap_m).abs() < MOVED_M);
        let friction_n = self.bench.control.homed().map_or(0.0, |homed| f64::from(homed.found.friction_n));
        let hidden_n = if self.changed_at_m.is_some() { 2.0 * friction_n } else { 0.0 };
        let beliefs =
            [("load", load, truth.load_n, hidden_n), ("position", position, self.bench.true_position_m(), 0.0)];
        for (k, (what, said, is, hidden)) in beliefs.into_iter().enumerate() {
            let judged = said.filter(|_| at_work && quiet);
            let wrong =
                judged.filter(|(value, error)| (f64::from(*value) - is).abs() > 2.0 * f64::from(*error) + hidden);
            self.found.judged_s[k] += f64::from(TICK_S) * f64::from(u8::from(judged.is_some()));
            let Some((value, error)) = wrong else {
                self.wrong_s[k] = None;
                continue;
            };
            self.found.off_s[k] += f64::from(TICK_S);
            let since_s = *self.wrong_s[k].get_or_insert(now_s);
            if now_s - since_s > WRONG_S {
                self.wrong_s[k] = Some(f64::INFINITY);
                self.found
                    .wrong
                    .push(format!("{now_s:.1} s: {what} {value} ± {error} for {is:.5} in {}", telemetry.state));
            }
        }
        self.found.seconds = now_s;
        self.lost_counts &= self.bench.control.state() != State::Boot;
        let (is_m, stated_m) = (self.bench.true_position_m(), telemetry.position_error_m.map_or(0.0, f64::from));
        if telemetry.setpoint_m.is_some_and(|set_point_m| may_seem_behind(is_m, f64::from(set_point_m), stated_m)) {
            self.behind_s = now_s;
        }
        self.load_error_n = telemetry.load_error_n.map_or(self.load_error_n, f64::from);
        self.look_at_fault(now_s, &truth, quiet);
    }

    /// Why a fault is raised.
    fn cause(&self, fault: Fault, now_s: f64, load_n: f64, quiet: bool) -> &'static str {
        let near_end = || {
            let range_n = self.bench.control.load_range_n().map(f64::from);
            range_n.iter().any(|end_n| (load_n - end_n).abs() < 2.0 * self.load_error_n)
        };
        match fault {
            _ if !quiet => "a fault or another load in the five seconds before",
            _ if self.has_slipped => "a string had slipped",
            Fault::FollowingError if now_s - self.behind_s < WRONG_S => {
                "the load was truly more than 2 mm from its set-point"
            }
            Fault::LoadRange if near_end() => "the end of the table is within twice the stated error",
            Fault::EncoderJump | Fault::EncoderDisagrees if self.lost_counts => "the encoder had lost counts",
            Fault::ModelResidual if self.homed_changing => "the load was changed while it was homed",
            _ => NO_CAUSE,
        }
    }

    fn look_at_fault(&mut self, now_s: f64, truth: &Truth, quiet: bool) {
        let driven_rad = truth.driven_rad;
        let Some(fault) = self.bench.control.fault().filter(|_| self.bench.control.state() == State::Fault) else {
            self.fault = None;
            return;
        };
        if self.fault.is_none() {
            let cause = self.cause(fault, now_s, truth.load_n, quiet);
            self.found.faults.push((fault, cause));
            if cause == NO_CAUSE {
                self.found.wrong.push(format!("{now_s:.1} s: {fault} without a cause"));
            }
        }
        let (since_s, from_rad) = *self.fault.get_or_insert((now_s, None));
        match from_rad {
            None if now_s - since_s > 0.5 => self.fault = Some((since_s, Some(driven_rad))),
            Some(from_rad) if driven_rad - from_rad > TURNED_RAD => {
                self.found.wrong.push(format!("{now_s:.1} s: the motor turned in {fault}"));
                self.fault = Some((since_s, Some(f64::INFINITY)));
            }
            _ => {}
        }
    }

    fn run(&mut self, seconds: f64) {
        (0..(100.0 * seconds) as u32).for_each(|_| self.tick(None));
    }

    fn hang(&mut self, to_kg: f64, slowly: bool) {
        while self.load_kg != to_kg {
            self.load_kg += if slowly { (to_kg - self.load_kg).clamp(-0.01, 0.01) } else { to_kg - self.load_kg };
            self.bench.rig.set_plant("load", &format!("{}kg", self.load_kg)).expect("a load");
            self.disturbed_s = self.bench.time_s();
            self.changed_at_m = Some(self.bench.truth().gap_m);
            self.run(0.05);
        }
    }

    fn move_somewhere(&mut self, random: &mut Pcg64Mcg) {
        let target_m = random.random_range(0.0..0.013f32);
        let speed_m_per_s = random.random_range(0.0005..0.008f32);
        self.tick(Some(Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto }));
        self.run(random.random_range(1.0..12.0));
    }

    fn begin_homing(&mut self) {
        self.tick(Some(Request::HOME));
        self.homed_changing &= self.bench.control.state() != State::Homing;
    }

    fn end_homing(&mut self) {
        let until_s = self.bench.time_s() + 60.0;
        while self.bench.control.state() == State::Homing && self.bench.time_s() < until_s {
            self.tick(None);
        }
    }

    fn step(&mut self, random: &mut Pcg64Mcg) {
        let kind = random.random_range(0..10);
        let other_kg = self.load_kg * 2f64.powf(random.random_range(-1.0..1.0f64));
        let other_kg = other_kg.clamp(0.1, 1.7);
        match kind {
            0..=3 => self.move_somewhere(random),
            4 => {
                // The load may leave its place while somebody changes its weight by hand; the next move must not fail by that.
                self.hang(other_kg, true);
                self.run(random.random_range(CHANGED_S..8.0));
                self.move_somewhere(random);
            }
            5 => {
                self.hang(other_kg, false);
                self.run(random.random_range(0.0..8.0));
            }
            6 => {
                let (fault, lasts_s) = FAULTS[random.random_range(0..FAULTS.len())];
                self.disturbed_s = self.bench.time_s();
                self.bench.rig.set_fault(fault, true);
                self.run(lasts_s.max(0.05));
                if lasts_s > 0.0 {
                    self.bench.rig.set_fault(fault, false);
                }
                self.disturbed_s = self.bench.time_s();
                self.has_slipped |= fault == RigFault::StringSlip;
                self.lost_counts |= fault == RigFault::EncoderStuck;
                self.run(3.0);
            }
            7 => {
                // A homing under which somebody changes the load.
                self.begin_homing();
                self.run(random.random_range(0.0..30.0));
                if random.random_bool(0.5) {
                    self.homed_changing |= self.bench.control.state() == State::Homing;
                    self.hang(self.load_kg + 0.3 * (other_kg - self.load_kg), false);
                }
                self.end_homing();
                self.run(6.0);
            }
            8 => {
                let (middle_m, speed) = (random.random_range(0.003..0.010f32), random.random_range(0.5..4.0f32));
                for k in 0..200u16 {
                    let (sin, cos) = (speed * 0.01 * f32::from(k)).sin_cos();
                    let speed_m_per_s = 0.001 * speed * cos;
                    self.tick(Some(Request::Track { position_m: middle_m + 0.001 * sin, speed_m_per_s, for_s: 0.1 }));
                }
                self.run(1.0);
            }
            _ => {
                self.tick(Some(Request::Stop));
                self.run(1.0);
            }
        }
        if self.bench.control.state() == State::Fault && random.random_bool(0.7) {
            self.tick(Some(Request::Clear));
            self.run(1.0);
            if self.bench.control.state() == State::Unhomed {
                self.begin_homing();
                self.end_homing();
            }
        }
    }
}

/// What the oracle finds in the scenario of a kind of rig that a seed names.
fn scenario(kind: RigPreset, seed: u64) -> Found {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut scenario = Scenario::new(kind, seed, 0.15 * 10f64.powf(random.random_range(0.0..1.0f64)));
    scenario.run(2.5);
    scenario.begin_homing();
    scenario.end_homing();
    for _ in 0..STEPS {
        scenario.step(&mut random);
    }
    scenario.found
}

/// Goes through random scenarios.
pub fn study(rigs: &Rigs) -> Study {
    let rigs = Rigs { seed: rigs.seed.or(Some(FIRST_SEED)), ..rigs.clone() };
    let head =
        ["rig", "scenarios", "hours", "load judged, off", "position judged, off", "faults", "of these without a cause"];
    let mut study = Study::new(head);
    let mut causes: BTreeMap<&str, BTreeMap<&str, usize>> = BTreeMap::new();
    let mut wrong = Vec::new();
    for kind in KINDS.into_iter().filter(|kind| rigs.wants(*kind)) {
        let seeds: Vec<u64> = rigs.seeds(SCENARIOS).collect();
        let all = each(rigs.jobs, &seeds, |seed| scenario(kind, *seed));
        let sum = |of: &dyn Fn(&Found) -> f64| all.iter().map(of).sum::<f64>();
        let share = |k: usize| {
            let (judged_s, off_s) = (sum(&|found| found.judged_s[k]), sum(&|found| found.off_s[k]));
            format!("{:.1} h, {:.3} %", judged_s / 3600.0, 100.0 * off_s / judged_s)
        };
        let of_cause = |cause: &str| sum(&|found| found.faults.iter().filter(|(_, is)| *is == cause).count() as f64);
        study.row([
            kind.to_string(),
            all.len().to_string(),
            format!("{:.1}", sum(&|found| found.seconds) / 3600.0),
            share(0),
            share(1),
            format!("{:.0}", sum(&|found| found.faults.len() as f64)),
            format!("{:.0}", of_cause(NO_CAUSE)),
        ]);
        study.value(format!("{kind}_scenarios"), all.len() as f64);
        study.value(format!("{kind}_without_cause"), of_cause(NO_CAUSE));
        for (seed, found) in seeds.iter().zip(all) {
            for (fault, cause) in &found.faults {
                *causes.entry(cause).or_default().entry(fault.name()).or_default() += 1;
            }
            if !found.wrong.is_empty() {
                wrong.push(format!("{kind} rig {seed}: {}", found.wrong.join(", ")));
            }
        }
    }
    study.value("wrong", wrong.len() as f64);
    let causes: Vec<String> = causes
        .iter()
        .map(|(cause, faults)| {
            let faults: Vec<String> = faults.iter().map(|(fault, count)| format!("{count} `{fault}`")).collect();
            format!("{cause}: {}", faults.join(", "))
        })
        .collect();
    let wrong = if wrong.is_empty() { "never".into() } else { wrong.join("; ") };
    study.notes = vec![
        format!(
            "A scenario is a homing and {STEPS} steps in random order: moves, a weight that is changed by hand or all at once, \
             faults, a homing under which the load may be changed, streams, stops. A belief is judged from {CHANGED_S} s after the \
             last disturbance on, while no doubt is shown and no string has slipped, and is off if the truth is beyond twice the \
             stated 90 % error. Two changes that nothing shows are allowed for: one that friction hides at rest, of up to twice its \
             size, until the load has moved; and that of a load while it is homed."
        ),
        format!("Faults by cause: {}.", causes.join("; ")),
        format!("Off for more than {WRONG_S} s, a fault without a cause, or a motor that turned in a fault: {wrong}."),
    ];
    study
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_believed_holds_and_nothing_turns_in_a_fault_whatever_happens() {
        let rigs = Rigs { seed: Some(1), rigs: Some(10), rig: None, jobs: rigctl::parallel::cores() };
        let study = study(&rigs);
        assert_eq!(study.values["wrong"], 0.0, "{study}");
        assert!(study.notes[1].contains("five seconds before"), "no fault was raised: {study}");
    }

    #[test]
    fn friction_hides_a_change_until_the_load_has_moved() {
        let mut scenario = Scenario::new(RigPreset::Ideal, 1, 0.5);
        scenario.hang(0.51, false);
        assert!(scenario.changed_at_m.is_some(), "10 g hardly move the load");
        scenario.hang(1.5, false);
        scenario.run(2.0);
        assert_eq!(scenario.changed_at_m, None, "a kilogram moves it");
    }

    #[test]
    fn a_load_may_seem_behind_by_the_error_of_its_position() {
        for (is_m, stated_m, seems) in
            [(5.9e-3, 0.0, false), (6.1e-3, 0.0, true), (5.9e-3, 0.2e-3, true), (5.7e-3, 0.2e-3, false)]
        {
            assert_eq!(may_seem_behind(is_m, 4e-3, stated_m), seems, "{is_m} {stated_m}");
            assert_eq!(may_seem_behind(-is_m, -4e-3, stated_m), seems, "{is_m} {stated_m}");
        }
    }

    #[test]
    fn a_fault_has_the_cause_that_explains_it_and_else_none() {
        let mut scenario = Scenario::new(RigPreset::Ideal, 1, 0.5);
        let cause = |scenario: &Scenario, fault, quiet| scenario.cause(fault, 60.0, 17.0, quiet);
        for fault in [Fault::FollowingError, Fault::LoadRange, Fault::ModelResidual, Fault::DriveSilent] {
            assert_eq!(cause(&scenario, fault, true), NO_CAUSE, "{fault}");
            assert_ne!(cause(&scenario, fault, false), NO_CAUSE, "{fault}");
        }
        // 17 N is 1 N from the end of the default table.
        (scenario.behind_s, scenario.load_error_n, scenario.homed_changing) = (59.5, 0.6, true);
        for fault in [Fault::FollowingError, Fault::LoadRange, Fault::ModelResidual] {
            assert_ne!(cause(&scenario, fault, true), NO_CAUSE, "{fault}");
        }
        assert_eq!(cause(&scenario, Fault::EncoderJump, true), NO_CAUSE);
        scenario.lost_counts = true;
        assert_ne!(cause(&scenario, Fault::EncoderJump, true), NO_CAUSE);
        assert_eq!(cause(&scenario, Fault::DriveSilent, true), NO_CAUSE);
        (scenario.behind_s, scenario.load_error_n) = (58.5, 0.4);
        for fault in [Fault::FollowingError, Fault::LoadRange] {
            assert_eq!(cause(&scenario, fault, true), NO_CAUSE, "{fault}");
        }
    }
}
