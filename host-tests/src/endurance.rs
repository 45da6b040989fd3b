//! Long runs on the emulated board: random moves under random loads with faults between them, and random bytes at both
//! doors. What is looked for is what only time shows: drift, missed ticks, a stack that grows, a message lost.

use crate::board::{Bench, LongestTick};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rig_emulator::board::{CanFrame, Stimulus};
use rig_link::messages::{EventKind, Limit, LoadChoice, Refusal, Request, State};
use sim_link::RigFault as Fault;
use std::fmt;

/// Faults that come while a load moves. All can be cleared; some lose the twist.
const FAULTS: [Fault; 7] = [
    Fault::CanSilent,
    Fault::DriveStall,
    Fault::EncoderStuck,
    Fault::LvdtOpen,
    Fault::LvdtNoisy,
    Fault::LvdtFrozen,
    Fault::Estop,
];

/// True error at rest (m) past which a move has not arrived: the board must say so.
const ARRIVED_M: f64 = 60e-6;
/// How far what the board says may be from what is (m): LVDT noise and the strings' and rods' last swing.
const BELIEF_M: f64 = 40e-6;

/// A move that came to rest away from its target.
#[derive(Clone, Copy, Debug, Default)]
pub struct Miss {
    /// Its number.
    pub number: u32,
    /// True error at rest (m).
    pub error_m: f64,
    /// What the board took it for (m).
    pub believed_m: f64,
}

impl fmt::Display for Miss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [error_um, believed_um] = [self.error_m, self.believed_m].map(|e| e * 1e6);
        write!(f, "{error_um:+.1} um at move {}, the board believing {believed_um:+.1} um", self.number)
    }
}

/// What a run of moves came to. Everything on the emulated board.
#[derive(Clone, Debug, Default)]
pub struct Endurance {
    /// Moves that arrived.
    pub moves: u32,
    /// Faults put in, latched, cleared and gone on from.
    pub faults: u32,
    /// Faults that a change of the load made by itself.
    pub load_faults: u32,
    /// Homings.
    pub homings: u32,
    /// Emulated time (s).
    pub seconds: f64,
    /// True error at rest of the first and the last tenth of the moves, mean (m): their difference is drift.
    pub error_first_last_m: [f64; 2],
    /// Largest true error at rest of a move that arrived.
    pub worst: Miss,
    /// Moves that ended where the strings' travel does, all of them announced, and the farthest from its target.
    pub short: (u32, Miss),
    /// Moves that were away from their target half a second later and had not said so, and the farthest.
    pub unannounced: (u32, Miss),
    /// Largest difference of what the board believed and what was, of any move (m).
    pub belief_max_m: f64,
    /// Control ticks that are missing.
    pub ticks_missing: f64,
    /// The longest tick.
    pub longest_tick: LongestTick,
    /// Deepest stack (bytes).
    pub stack_bytes: u64,
    /// Resets of the board.
    pub resets: usize,
    /// Telemetry frames of the last move that came (100 a second are sent).
    pub telemetry_per_s: f64,
}

impl fmt::Display for Endurance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [first, last] = self.error_first_last_m.map(|e| e * 1e6);
        write!(
            f,
            "{} moves, {} faults, {} more by the load, {} homings in {:.0} s of emulated time: error at rest {first:+.1} um in the first tenth, \
             {last:+.1} um in the last, at most {}; {} moves ended with the strings' travel, announced, at most {}; {} away unannounced, at most {}; belief \
             and truth at most {:.1} um apart; {:.0} ticks missing, the longest {}; stack {} bytes; {} resets; {:.1} \
             telemetry frames a second",
            self.moves,
            self.faults,
            self.load_faults,
            self.homings,
            self.seconds,
            self.worst,
            self.short.0,
            self.short.1,
            self.unannounced.0,
            self.unannounced.1,
            self.belief_max_m * 1e6,
            self.ticks_missing,
            self.longest_tick,
            self.stack_bytes,
            self.resets,
            self.telemetry_per_s
        )
    }
}

impl Endurance {
    /// The same as a JSON object; lengths in micrometres.
    pub fn json(&self) -> String {
        let [first, last] = self.error_first_last_m;
        serde_json::json!({
            "moves": self.moves,
            "faults": self.faults,
            "faults_by_the_load": self.load_faults,
            "homings": self.homings,
            "emulated_s": self.seconds,
            "mean_error_first_tenth_um": first * 1e6,
            "mean_error_last_tenth_um": last * 1e6,
            "largest_error_at_rest_um": self.worst.error_m.abs() * 1e6,
            "ended_with_the_travel": self.short.0,
            "largest_error_there_um": self.short.1.error_m.abs() * 1e6,
            "unannounced": self.unannounced.0,
            "belief_and_truth_apart_um": self.belief_max_m * 1e6,
            "ticks_missing": self.ticks_missing,
            "longest_tick_instructions": self.longest_tick.instructions,
            "stack_bytes": self.stack_bytes,
            "resets": self.resets,
            "telemetry_per_s": self.telemetry_per_s,
        })
        .to_string()
    }
}

/// Speed of the motor from which the shaft turns (rad/s), and time for which it must go on turning (s): a shaft that stands
/// shows no fault of its own.
const TURNS_RAD_PER_S: f32 = 1.0;
const TURNS_S: f32 = 0.5;

/// So many moves; every sixth meets a fault on its way, and after it the rig is cleared, homed if it must be, and goes on.
///
/// # Panics
/// Where something does not go on as it should: with what, and at which move.
pub fn moves(count: u32, seed: u64) -> Endurance {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let mut b = Bench::new(&[("load", "0.5kg")], seed);
    let (mut result, mut errors, mut hanging_kg) = (Endurance::default(), Vec::new(), 0.5);
    b.home();
    result.homings += 1;
    while result.moves < count {
        // Laid on by hand, 2 N a second: all at once it would be a broken string, or a load that runs away.
        let load = random.random_range(0.3..1.5);
        while f64::abs(load - hanging_kg) > 1e-9 {
            hanging_kg += f64::clamp(load - hanging_kg, -0.01, 0.01);
            b.machine.board_mut().set_plant("load", &format!("{hanging_kg}kg")).expect("a plant key");
            b.run(0.05);
        }
        b.run(1.0);
        // A load laid on faster than it can be held leaves its place: that is a fault of its own.
        if b.state() == State::Fault {
            result.load_faults += 1;
            go_on(&mut b, &mut result);
        }
        let mut target_m = 0.001 + 0.009 * random.random::<f32>();
        let speed_m_per_s = 0.001 + 0.003 * random.random::<f32>();
        let started = b.machine.now_s();
        let number = result.moves;
        let mut go = |target_m| b.ask(&Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto });
        // A load heavier than at homing hangs lower and cannot come up as far, a lighter one not down as far.
        let first = go(target_m);
        if let Err(Refusal::OutOfRange { min, max, .. }) = first {
            target_m = min + 0.8 * (max - min);
        }
        if let Err(e) = go(target_m) {
            let truth = b.machine.board().truth();
            panic!("move {number} to {target_m} m under {load} kg: {e}, after {first:?}; {:?}; {truth:?}", b.last);
        }
        let due = number % 6 == 5 && result.faults < number.div_ceil(6) + 1;
        b.run(if due { 0.4 } else { 0.0 });
        let turns = b.last.is_some_and(|t| {
            t.drive_speed_rad_per_s.abs() > TURNS_RAD_PER_S && t.time_left_s.is_some_and(|left_s| left_s > TURNS_S)
        });
        if due && b.state() == State::Moving && turns {
            let fault = *FAULTS.choose(&mut random).expect("seven");
            result.faults += 1;
            recover(&mut b, fault, &mut result);
            continue;
        }
        assert!(b.until(25.0, |b| b.state() == State::Holding), "move {number} under {load} kg: {:?}", b.last);
        b.run(0.5);
        rest(&b, number, target_m, &mut result, &mut errors);
        result.telemetry_per_s = b.frames as f64 / (b.machine.now_s()).max(1.0);
        assert!(b.machine.now_s() > started);
        result.moves += 1;
    }
    let stats = b.machine.stats();
    let tenth = errors.len().div_ceil(10);
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    result.error_first_last_m = [mean(&errors[..tenth]), mean(&errors[errors.len() - tenth..])];
    result.seconds = b.machine.now_s();
    result.ticks_missing = result.seconds / 0.01 - stats.tick.count as f64;
    result.longest_tick = b.longest_tick.clone();
    result.stack_bytes = stats.stack_high_water_bytes as u64;
    result.resets = stats.resets.len();
    result
}

/// Tenths of a second within which a shaft that was stopped stands.
const STANDS_WITHIN: u32 = 30;

/// What a move came to: at its target, or where the strings' travel ends and announced as such.
fn rest(b: &Bench, number: u32, target_m: f32, result: &mut Endurance, errors: &mut Vec<f64>) {
    let error_m = b.true_position_m() - f64::from(target_m);
    let said = b.last.and_then(|t| t.position_m).expect("homed, with a gap");
    let miss = Miss { number, error_m, believed_m: f64::from(said - target_m) };
    let belief_m = (miss.believed_m - error_m).abs();
    assert!(belief_m < BELIEF_M, "{miss}");
    result.belief_max_m = result.belief_max_m.max(belief_m);
    let farther = |than: &Miss| if error_m.abs() > than.error_m.abs() { miss } else { *than };
    if error_m.abs() < ARRIVED_M {
        result.worst = farther(&result.worst);
        errors.push(error_m);
        return;
    }
    let announced = b.events.iter().rev().find_map(|event| match event {
        EventKind::MoveDone { error_m } => Some(f64::from(*error_m)),
        _ => None,
    });
    let at_end = b.last.and_then(|t| t.limit) == Some(Limit::Travel);
    let told = announced.is_some_and(|said_m| (said_m - error_m).abs() < BELIEF_M);
    let list = if at_end && told { &mut result.short } else { &mut result.unannounced };
    *list = (list.0 + 1, farther(&list.1));
}

/// A fault on the way: the rig latches it, nothing moves, it is cleared, and homed again if the twist was lost.
fn recover(b: &mut Bench, fault: Fault, result: &mut Endurance) {
    b.machine.board_mut().set_fault(fault, true);
    assert!(b.until(4.0, |b| matches!(b.state(), State::Fault | State::EStop)), "{fault:?} not seen: {:?}", b.last);
    b.run(0.5);
    b.machine.board_mut().set_fault(fault, false);
    b.run(0.5);
    assert!(matches!(b.state(), State::Fault | State::EStop), "{fault:?} cleared itself");
    go_on(b, result);
}

/// Clears, and homes if the twist was lost.
fn go_on(b: &mut Bench, result: &mut Endurance) {
    let fault = b.last.and_then(|t| t.fault);
    // The shaft may still come to rest at its hold; `clear` is refused until then.
    let cleared = (0..STANDS_WITHIN).any(|_| {
        b.run(0.1);
        b.ask(&Request::Clear).is_ok()
    });
    assert!(cleared, "{fault:?} cannot be cleared at move {}: {:?}", result.moves, b.events.last());
    let idle = |b: &Bench| matches!(b.state(), State::Unhomed | State::Ready | State::Holding);
    assert!(b.until(10.0, idle), "after {fault:?}: {:?}", b.last);
    if b.state() == State::Unhomed {
        let (began_s, truth) = (b.machine.now_s(), b.machine.board().truth());
        let what = format!("after {fault:?} at move {}, homed from {began_s:.2} s on, {truth:?}", result.moves);
        b.ask(&Request::HOME).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert!(b.until(60.0, |b| b.state() != State::Homing), "homing did not end {what}");
        assert_eq!(b.state(), State::Ready, "{what}, until {:.2} s: {:?}", b.machine.now_s(), b.events.last());
        result.homings += 1;
    }
}

/// What random bytes came to.
#[derive(Clone, Debug, Default)]
pub struct Noise {
    /// Bytes on the host link and in frames on the bus.
    pub bytes: [u64; 2],
    /// Good requests among them, all of them answered.
    pub requests: u32,
    /// Largest true twist that the noise made (rad).
    pub moved_rad: f64,
    /// Emulated time (s).
    pub seconds: f64,
}

impl fmt::Display for Noise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [link, bus] = self.bytes;
        write!(
            f,
            "{link} random bytes on the link and {bus} on the bus in {:.0} s of emulated time: {} good requests all \
             answered, twist moved by {:.4} rad, no reset",
            self.seconds, self.requests, self.moved_rad
        )
    }
}

impl Noise {
    /// The same as a JSON object.
    pub fn json(&self) -> String {
        let [link, bus] = self.bytes;
        serde_json::json!({
            "random_bytes_on_the_link": link,
            "random_bytes_on_the_bus": bus,
            "good_requests_all_answered": self.requests,
            "moved_rad": self.moved_rad,
        })
        .to_string()
    }
}

/// Random bytes, so many on the link and as many in frames on the bus, while the homed rig holds.
///
/// # Panics
/// At a reset, a movement, or a good request without its answer.
pub fn noise(bytes: u64, seed: u64) -> Noise {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let mut b = Bench::new(&[], seed);
    b.home();
    let before = b.machine.board().truth().twist_rad;
    let mut result = Noise::default();
    // In bursts of what 10 ms of either line can carry.
    while result.bytes[0] < bytes {
        let mut burst: Vec<u8> = (0..100).map(|_| random.random()).collect();
        // A burst ends with the delimiter, as any line that was quiet once does.
        burst.push(0);
        result.bytes[0] += burst.len() as u64;
        b.raw(burst);
        for _ in 0..14 {
            // Never the drive's own reports: those are not noise but lies, and a fault finds them.
            let id = loop {
                let id = random.random_range(0..0x800);
                if !(0x18..0x20).contains(&id) {
                    break id;
                }
            };
            let (dlc, data) = (random.random_range(0..=8), random.random());
            let frame = CanFrame { id, extended: random.random_bool(0.2), remote: random.random_bool(0.1), dlc, data };
            b.machine.send(Stimulus::Can(frame));
            result.bytes[1] += u64::from(dlc);
        }
        b.step();
        if result.bytes[0] % 5_000 < 101 {
            b.ask(&Request::Status).unwrap_or_else(|e| panic!("a good request was refused: {e}"));
            result.requests += 1;
        }
    }
    b.run(0.2);
    let stats = b.machine.stats();
    assert!(stats.resets.is_empty(), "{:?}", stats.resets);
    assert!(matches!(b.state(), State::Ready | State::Holding), "{:?}", b.last);
    result.moved_rad = (b.machine.board().truth().twist_rad - before).abs();
    assert!(result.moved_rad < 0.05, "moved by {} rad", result.moved_rad);
    result.seconds = b.machine.now_s();
    result
}
