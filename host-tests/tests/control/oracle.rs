//! Random scenarios with an oracle: what the board believes holds within twice its stated error unless it says that it doubts,
//! nothing turns by the motor's torque while a fault is latched, and no fault is raised without a cause.
//! `TSA_SCENARIOS=FIRST+COUNT` tries others, and `TSA_DONE=1` prints what was done.

use super::go;
use host_tests::ControlBench;
use host_tests::rigs::subject::Subject;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rig_link::messages::{Doubts, Fault, Request, State};
use rig_plant::units::STANDARD_GRAVITY;
use rig_plant::{RigFault, RigPreset, Truth};

/// Steps of a scenario after its homing.
const STEPS: u32 = 10;
/// How long a belief may be wrong (s) after the load has changed, and how long it may be wrong at all.
const CHANGED_S: f64 = 5.0;
const WRONG_S: f64 = 1.0;
/// How far the shaft may still turn by the motor's torque (rad) once a fault has been latched for half a second.
const TURNED_RAD: f64 = 0.3;
/// How far the load must truly be behind its set-point (m) for that to be a fault, at some time in the last second.
const BEHIND_M: f64 = 2e-3;
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
    /// When the load was last [`BEHIND_M`] from its set-point (s): a light load that friction holds is.
    behind_s: f64,
    /// Stated error of the load when it was last known (N).
    load_error_n: f64,
    /// The load was changed and has not been moved since: friction hides a change of up to twice its size.
    changed_at_rest: bool,
    /// Somebody changed the load while it was homed: the change looks like friction, until the next homing.
    homed_changing: bool,
    /// A string that has slipped looks like another load, also to a homing (docs/explanation/how-it-works.md).
    has_slipped: bool,
    /// When the latched fault was raised (s), and how far the motor had driven half a second later (rad).
    fault: Option<(f64, Option<f64>)>,
    told: Vec<String>,
    done: Vec<String>,
}

impl Scenario {
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
        self.changed_at_rest &= telemetry.state != State::Moving;
        let friction_n = self.bench.control.homed().map_or(0.0, |homed| f64::from(homed.found.friction_n));
        let hidden_n = if self.changed_at_rest { 2.0 * friction_n } else { 0.0 };
        let beliefs =
            [("load", load, truth.load_n, hidden_n), ("position", position, self.bench.true_position_m(), 0.0)];
        for (k, (what, said, is, hidden)) in beliefs.into_iter().enumerate() {
            let wrong = said
                .filter(|_| at_work && quiet)
                .filter(|(value, error)| (f64::from(*value) - is).abs() > 2.0 * f64::from(*error) + hidden);
            let since_s = match wrong {
                Some(_) => *self.wrong_s[k].get_or_insert(now_s),
                None => {
                    self.wrong_s[k] = None;
                    continue;
                }
            };
            if now_s - since_s > WRONG_S {
                self.wrong_s[k] = Some(f64::INFINITY);
                self.told.push(format!("{now_s:.1} s: {what} {:?} for {is:.5} in {}", wrong, telemetry.state));
            }
        }
        let behind = |set_point_m: f32| (self.bench.true_position_m() - f64::from(set_point_m)).abs() > BEHIND_M;
        if telemetry.setpoint_m.is_some_and(behind) {
            self.behind_s = now_s;
        }
        self.load_error_n = telemetry.load_error_n.map_or(self.load_error_n, f64::from);
        self.look_at_fault(now_s, &truth, quiet);
    }

    /// Whether the rig as it is, and not what was done to it in the last seconds, is the cause of a fault.
    fn has_cause(&self, fault: Option<Fault>, now_s: f64, load_n: f64) -> bool {
        match fault {
            Some(Fault::FollowingError) => now_s - self.behind_s < WRONG_S,
            Some(Fault::LoadRange) => {
                let range_n = self.bench.control.load_range_n().map(f64::from);
                range_n.iter().any(|end_n| (load_n - end_n).abs() < 2.0 * self.load_error_n)
            }
            Some(Fault::ModelResidual) => self.homed_changing,
            _ => false,
        }
    }

    fn look_at_fault(&mut self, now_s: f64, truth: &Truth, quiet: bool) {
        let driven_rad = truth.driven_rad;
        if self.bench.control.state() != State::Fault {
            self.fault = None;
            return;
        }
        let fault = self.bench.control.fault();
        if self.fault.is_none() && quiet && !self.has_slipped && !self.has_cause(fault, now_s, truth.load_n) {
            self.told.push(format!("{now_s:.1} s: {:?} without a cause", self.bench.control.fault()));
        }
        let (since_s, from_rad) = *self.fault.get_or_insert((now_s, None));
        match from_rad {
            None if now_s - since_s > 0.5 => self.fault = Some((since_s, Some(driven_rad))),
            Some(from_rad) if driven_rad - from_rad > TURNED_RAD => {
                self.told.push(format!("{now_s:.1} s: the motor turned in {:?}", self.bench.control.fault()));
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
            self.changed_at_rest = true;
            self.run(0.05);
        }
    }

    fn move_somewhere(&mut self, random: &mut Pcg64Mcg) {
        let target_m = random.random_range(0.0..0.013f32);
        self.tick(Some(go(target_m, random.random_range(0.0005..0.008f32))));
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
        let begun_s = self.bench.time_s();
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
                self.done.push(format!("{fault:?}"));
                self.run(3.0);
            }
            7 => {
                // A homing under which somebody changes the load.
                self.begin_homing();
                self.run(random.random_range(0.0..30.0));
                if random.random_bool(0.5) {
                    self.homed_changing = self.bench.control.state() == State::Homing;
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
        self.done.push(format!("{begun_s:.1}: kind {kind}, {:.3} kg, {}", self.load_kg, self.bench.control.state()));
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

/// What the oracle says of the scenario of a seed, and what was done.
fn scenario(seed: u64) -> (Vec<String>, Vec<String>) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let kind = [RigPreset::Nominal, RigPreset::Hard][random.random_range(0..2)];
    let load_kg = 0.15 * 10f64.powf(random.random_range(0.0..1.0f64));
    let rig = Subject::new(kind, seed).switched_on(load_kg * STANDARD_GRAVITY).expect("a rig");
    let mut scenario = Scenario {
        bench: ControlBench::on(rig, host_tests::booted()),
        load_kg,
        disturbed_s: 0.0,
        wrong_s: [None; 2],
        behind_s: f64::NEG_INFINITY,
        load_error_n: 0.0,
        changed_at_rest: false,
        homed_changing: false,
        has_slipped: false,
        fault: None,
        told: Vec::new(),
        done: vec![format!("{kind} rig {seed}, {:.2} N", load_kg * STANDARD_GRAVITY)],
    };
    scenario.run(2.5);
    scenario.begin_homing();
    scenario.end_homing();
    for _ in 0..STEPS {
        scenario.step(&mut random);
    }
    (scenario.told, scenario.done)
}

#[test]
fn what_is_believed_holds_and_nothing_turns_in_a_fault_whatever_happens() {
    let (first, count) = match std::env::var("TSA_SCENARIOS") {
        Ok(range) => {
            let (first, count) = range.split_once('+').expect("FIRST+COUNT");
            (first.parse().expect("a seed"), count.parse().expect("a number"))
        }
        Err(_) => (1, 20),
    };
    let seeds: Vec<u64> = (first..first + count).collect();
    let found = host_tests::study::each(rigctl::parallel::cores(), &seeds, |seed| (*seed, scenario(*seed)));
    let wrong: Vec<_> = found.iter().filter(|(_, (told, _))| !told.is_empty()).collect();
    if std::env::var_os("TSA_DONE").is_some() {
        found.iter().for_each(|(seed, (_, done))| println!("{seed}: {done:?}"));
    }
    for (seed, (told, done)) in &wrong {
        println!("seed {seed}: {told:#?}\n after {done:#?}");
    }
    assert!(wrong.is_empty(), "{} of {count} scenarios", wrong.len());
}
