//! Random faults at random times from power-on, with random requests between them: the motor never turns the strings much farther than
//! it was told to, whatever fails first. The drive keeps its last target, and its loops run after what its own encoder input counts.

use host_tests::rigs::subject::Subject;
use host_tests::{ControlBench, booted, constants};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rig_control::DriveCommand;
use rig_link::messages::{Request, State};
use rig_plant::units::STANDARD_GRAVITY;
use rig_plant::{RigFault, RigPreset};
use std::collections::VecDeque;

/// Ticks of a scenario, and those over which what the motor turns is compared with what it was told.
const TICKS: u64 = 6000;
const WINDOW: usize = 150;
/// How much farther the motor may turn the strings (rad); and by how much in a fault that has lasted for half a second.
const BEYOND_RAD: f64 = 5.0;
const IN_FAULT_RAD: f64 = 1.0;
/// Largest step of the drive's target in one tick that is motion (rad), and how far a voltage turns the strings in one.
const STEP_RAD: f64 = 0.6;
const VOLTAGE_STEP_RAD: f64 = 0.02;
/// Wires that are wrong from power-on or never.
const WIRING: [RigFault; 5] = [
    RigFault::MotorSwapped,
    RigFault::DriveEncoderSwapped,
    RigFault::EncoderSwapped,
    RigFault::LvdtSwapped,
    RigFault::DriveLines,
];

/// A fault with the ticks in which it begins and ends.
fn random_fault(random: &mut Pcg64Mcg) -> (u64, u64, RigFault) {
    let fault = RigFault::ALL[random.random_range(0..RigFault::ALL.len())];
    if WIRING.contains(&fault) {
        return (0, TICKS, fault);
    }
    let from = random.random_range(0..TICKS - 1000);
    let lasts = if random.random_bool(0.3) { TICKS } else { (5.0 * 400f64.powf(random.random())) as u64 };
    (from, from + lasts, fault)
}

fn random_request(random: &mut Pcg64Mcg, state: State) -> Request {
    match (state, random.random_range(0..10)) {
        (State::Fault, 0..8) => Request::Clear,
        (State::Unhomed, 0..7) | (_, 7) => Request::HOME,
        (_, 0..6) => super::go(random.random_range(0.0..0.013), random.random_range(0.0005..0.008)),
        (_, 6) => Request::Stop,
        (_, 8) => Request::Jog { twist_speed_rad_per_s: random.random_range(-3.0..3.0) },
        _ => Request::Clear,
    }
}

/// How far the targets of the drive have moved so far (rad).
#[derive(Default)]
struct Told {
    way_rad: f64,
    last_qc: Option<i32>,
}

impl Told {
    fn add(&mut self, command: DriveCommand) {
        let target_qc = if let DriveCommand::Follow { position_qc, .. } = command { Some(position_qc) } else { None };
        if let Some((now, then)) = target_qc.zip(self.last_qc) {
            let step_rad = (f64::from(now.wrapping_sub(then)) / f64::from(constants().counts_per_rad)).abs();
            self.way_rad += if step_rad < STEP_RAD { step_rad } else { 0.0 };
        }
        if matches!(command, DriveCommand::Voltage { pwm } if pwm != 0) {
            self.way_rad += VOLTAGE_STEP_RAD;
        }
        self.last_qc = target_qc;
    }
}

/// How much farther than it was told the motor has turned the strings, and how far in a fault (rad), and what failed.
fn scenario(seed: u64) -> ([f64; 2], String) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let kind = [RigPreset::Nominal, RigPreset::Hard][random.random_range(0..2)];
    let load_n = 0.15 * 10f64.powf(random.random()) * STANDARD_GRAVITY;
    let mut d = ControlBench::on(Subject::new(kind, seed).switched_on(load_n).expect("a rig"), booted());
    let faults: Vec<_> = (0..random.random_range(1..4)).map(|_| random_fault(&mut random)).collect();
    let mut asks = random.random_range(150..500);
    let (mut told, mut window) = (Told::default(), VecDeque::new());
    let (mut faulty_ticks, mut in_fault_from_rad) = (0, 0.0);
    let mut worst_rad = [0f64; 2];
    for tick in 0..TICKS {
        for (from, to, fault) in &faults {
            if tick == *from || tick == *to {
                d.rig.set_fault(*fault, tick == *from);
            }
        }
        let request = (tick == asks).then(|| {
            let state = d.control.state();
            let long = state == State::Homing || random.random_bool(0.5);
            asks += if long { random.random_range(100..1500) } else { random.random_range(1..100) };
            random_request(&mut random, state)
        });
        told.add(d.tick(request).drive);
        let driven_rad = d.truth().driven_rad;
        window.push_back(driven_rad - told.way_rad);
        if window.len() > WINDOW {
            window.pop_front();
        }
        worst_rad[0] = worst_rad[0].max(driven_rad - told.way_rad - window[0]);
        faulty_ticks = if d.control.state() == State::Fault { faulty_ticks + 1 } else { 0 };
        if faulty_ticks <= 50 {
            in_fault_from_rad = driven_rad;
        }
        worst_rad[1] = worst_rad[1].max(driven_rad - in_fault_from_rad);
    }
    (worst_rad, format!("{kind} rig {seed}, {load_n:.1} N: {faults:?}"))
}

#[test]
fn whatever_fails_the_motor_turns_the_strings_hardly_farther_than_it_is_told() {
    let seeds: Vec<u64> = (1..=60).collect();
    for (worst_rad, what) in host_tests::study::each(rigctl::parallel::cores(), &seeds, |seed| scenario(*seed)) {
        let [beyond_rad, in_fault_rad] = worst_rad;
        assert!(beyond_rad < BEYOND_RAD && in_fault_rad < IN_FAULT_RAD, "{worst_rad:?} rad: {what}");
    }
}
