//! The real firmware on the emulated board: the whole chain, the chip, what is in flash, the links, and every way in which the
//! drive may still hold an old target. What needs no board is in `control` and `faults`.

mod chip;
mod first_power;
mod flash;
mod links;
mod old_target;
mod settings;

use host_tests::board::Bench;
use rig_link::messages::{Fault, LoadChoice, Request, Setting, State};

/// Sectors 1 to 3 (src/flash_store.rs).
const STORE: std::ops::Range<usize> = 0x4000..0x1_0000;
const JOG: Request = Request::Jog { twist_speed_rad_per_s: 2.0 };

const fn go(target_m: f32) -> Request {
    Request::Move { target_m, speed_m_per_s: 0.002, load: LoadChoice::Auto }
}

const fn set(setting: Setting, value: f32) -> Request {
    Request::SetSetting { setting, value }
}

/// A board that has been greeted and stands.
fn standing(keys: &[(&str, &str)], seed: u64) -> Bench {
    let mut b = Bench::new(keys, seed);
    b.ready();
    b
}

fn fault(b: &Bench) -> Option<Fault> {
    b.last.and_then(|t| t.fault)
}

/// Moves the load and waits until it is held.
fn moves(b: &mut Bench, target_m: f32) {
    b.ask(&go(target_m)).unwrap();
    assert!(b.until(20.0, |b| b.state() == State::Holding), "{:?}", b.last);
}

/// A flash image as the only change, started.
fn with_flash(b: &mut Bench, image: &[u8]) {
    b.machine.set_flash_image(image).unwrap();
    b.machine.power_cycle();
    b.greet();
}

/// The board's identity, asked for again.
fn identity(b: &mut Bench) -> rig_link::messages::Identity {
    b.identity = None;
    b.ask(&Request::Status).unwrap();
    assert!(b.until(0.5, |b| b.identity.is_some()));
    b.identity.clone().unwrap()
}

/// What the board has counted.
fn counters(b: &mut Bench) -> rig_link::messages::Counters {
    b.sensors = None;
    b.ask(&Request::ReadSensors).unwrap();
    assert!(b.until(0.5, |b| b.sensors.is_some()));
    b.sensors.unwrap().counters
}

/// Bytes of Xorshift.
fn noise(state: &mut u32, count: usize) -> Vec<u8> {
    let mut next = || {
        *state ^= *state << 13;
        *state ^= *state >> 17;
        *state ^= *state << 5;
        (*state >> 24) as u8
    };
    (0..count).map(|_| next()).collect()
}
