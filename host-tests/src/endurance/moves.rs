//! Random moves under random loads with incidents between them.

use super::injected_event::{FREQUENT, INJECTED_EVENTS, InjectedEvent, Run};
use crate::board::Bench;
use crate::rigs::subject::Subject;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rig_link::messages::{EventKind, Limit, Request, State};
use rig_plant::RigPreset;
use std::collections::BTreeMap;

/// Error at rest (m) past which a move has not arrived, beside what stiction leaves and how well the board knows its place: the
/// board must say so.
const ARRIVED_M: f64 = 60e-6;
/// How far what the board says may be from what is (m), over its stated error: LVDT noise and the last oscillation of strings and rods
/// come to it, and the stated error holds in nine of ten cases.
const ESTIMATE_M: f64 = 40e-6;
const ESTIMATE_STATED: f64 = 2.0;

/// The numbers of a run, with lengths in micrometres. Everything on the emulated board.
pub type Numbers = BTreeMap<String, f64>;

/// Of several runs together the maximum or the least of these, and of the means that over all moves; of all others the sum.
const MAX: [&str; 5] = [
    "largest_error_at_rest_um",
    "largest_error_there_um",
    "belief_and_truth_apart_um",
    "longest_tick_instructions",
    "stack_bytes",
];
const MIN: &str = "telemetry_per_s";
const MEANS: [&str; 2] = ["mean_error_first_tenth_um", "mean_error_last_tenth_um"];

/// Two runs on two rigs.
pub fn both(mut one: Numbers, other: &Numbers) -> Numbers {
    let fraction = other["moves"] / (one["moves"] + other["moves"]).max(1.0);
    for (name, a) in &mut one {
        let (before, b) = (*a, other[name]);
        *a = match name.as_str() {
            MIN => before.min(b),
            name if MAX.contains(&name) => before.max(b),
            name if MEANS.contains(&name) => before + fraction * (b - before),
            _ => before + b,
        };
    }
    one
}

/// Where moves came to rest.
#[derive(Default)]
struct Rests {
    /// True errors of those that arrived (m).
    errors_m: Vec<f64>,
    /// How many ended where the strings' travel does, all of them announced, and how far from the target (m).
    short: (u32, f64),
    /// How many were away from their target half a second later and had not said so.
    unannounced: u32,
    /// Largest difference of what the board believed and what was, of any move (m).
    estimate_max_m: f64,
}

/// So many moves on the rig that a kind and a seed name; every third meets an incident, and the rig goes on after it. Halfway its
/// constants are identified again.
///
/// # Panics
/// Where something does not go on as it should: with what, and at which move.
pub fn moves(count: u32, rig: RigPreset, seed: u64) -> Numbers {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let changes: Vec<(&str, String)> = rig.changes(seed).iter().map(|c| (c.key.name(), c.value.to_string())).collect();
    let mut keys: Vec<(&str, &str)> = changes.iter().map(|(key, value)| (*key, value.as_str())).collect();
    keys.push(("load", "0.5kg"));
    let mut board = Bench::new(&keys, seed);
    let (mut made, mut without_cause, mut rests) = (0, 0, Rests::default());
    let mut injected_events = BTreeMap::<InjectedEvent, u32>::new();
    board.home();
    let mut run = Run {
        board: &mut board,
        random: &mut random,
        homings: 1,
        restarts: 0,
        load_faults: 0,
        load_kg: 0.5,
        scene: crate::scene().clone(),
        subject: Subject::new(rig, seed),
    };
    while made < count {
        if made == count / 2 && !injected_events.contains_key(&InjectedEvent::Identify) {
            run.take(InjectedEvent::Identify);
            injected_events.insert(InjectedEvent::Identify, 1);
        }
        let load_kg = run.random.random_range(0.3..1.5);
        run.lay_on(load_kg);
        let frequent = injected_events.iter().filter(|(kind, _)| **kind != InjectedEvent::Identify);
        let happens = made % 3 == 2 && frequent.map(|(_, count)| count).sum::<u32>() <= made / 3;
        let injected_event = happens.then(|| INJECTED_EVENTS[..FREQUENT].choose(run.random).expect("eight").0);
        let under_way = [InjectedEvent::FaultUnderWay, InjectedEvent::PowerCycleUnderWay];
        if let Some(injected_event) = injected_event.filter(|injected_event| !under_way.contains(injected_event)) {
            run.take(injected_event);
            *injected_events.entry(injected_event).or_default() += 1;
        }
        let target_m = 0.001 + 0.009 * run.random.random::<f32>();
        let fastest = run.random.random_bool(0.2);
        let speed_m_per_s = if fastest { f32::INFINITY } else { run.random.random_range(0.001..0.006) };
        let target_m = run.begin_move(target_m, speed_m_per_s);
        if let Some(injected_event) = injected_event.filter(|injected_event| under_way.contains(injected_event)) {
            run.board.run(0.4);
            if run.is_turning() {
                run.take(injected_event);
                *injected_events.entry(injected_event).or_default() += 1;
                continue;
            }
        }
        let ended = |b: &Bench| matches!(b.state(), State::Holding | State::Fault);
        let what = format!("{rig} rig {seed}, move {made} under {} kg", run.load_kg);
        assert!(run.board.until(40.0, ended), "{what}: {:?}", run.board.last);
        if run.board.state() == State::Fault {
            eprintln!("{what}: {:?}", run.board.last);
            without_cause += 1;
            assert!(without_cause <= count, "a rig on which every move ends in a fault");
            run.go_on();
            continue;
        }
        run.board.run(0.5);
        rest(run.board, target_m, &what, &mut rests);
        made += 1;
    }
    let Run { homings, load_faults, restarts, .. } = run;
    let stats = board.machine.stats();
    eprintln!("the longest tick: {:?}", board.longest_tick);
    let errors_m = &rests.errors_m;
    let tenth = errors_m.len().div_ceil(10);
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len().max(1) as f64;
    let worst_m = errors_m.iter().map(|m| m.abs()).fold(0.0, f64::max);
    let seconds = board.machine.now_s();
    let of = |kind: InjectedEvent| f64::from(injected_events.get(&kind).copied().unwrap_or(0));
    let numbers = [
        ("moves", made.into()),
        ("incidents", injected_events.values().sum::<u32>().into()),
        ("faults", of(InjectedEvent::FaultUnderWay) + of(InjectedEvent::DriveReset)),
        ("faults_by_the_load", load_faults.into()),
        ("faults_without_cause", without_cause.into()),
        ("homings", homings.into()),
        ("emulated_s", seconds),
        // Their difference is drift.
        ("mean_error_first_tenth_um", 1e6 * mean(&errors_m[..tenth])),
        ("mean_error_last_tenth_um", 1e6 * mean(&errors_m[errors_m.len() - tenth..])),
        ("largest_error_at_rest_um", 1e6 * worst_m),
        ("ended_with_the_travel", rests.short.0.into()),
        ("largest_error_there_um", 1e6 * rests.short.1),
        ("unannounced", rests.unannounced.into()),
        ("belief_and_truth_apart_um", 1e6 * rests.estimate_max_m),
        // Those of starts and of writes to flash among them.
        ("ticks_missing", seconds / 0.01 - stats.tick.count as f64),
        ("longest_tick_instructions", board.longest_tick.instructions as f64),
        ("stack_bytes", stats.stack_high_water_bytes as f64),
        // Those that nobody has caused.
        ("resets", stats.resets.len().abs_diff(restarts as usize) as f64),
        // 100 are sent.
        ("telemetry_per_s", board.frames as f64 / seconds),
    ];
    let kinds = INJECTED_EVENTS.map(|(kind, name)| (name.replace(' ', "_"), of(kind)));
    numbers.into_iter().map(|(name, value)| (name.to_owned(), value)).chain(kinds).collect()
}

/// What a move came to: at its target, or where the strings' travel ends and announced as such.
fn rest(b: &mut Bench, target_m: f32, what: &str, rests: &mut Rests) {
    b.ask(&Request::ReadSensors).expect("never refused");
    b.step();
    let left_m = f64::from(b.sensors.and_then(|s| s.rest_tolerance_m).expect("it holds"));
    let error_m = b.true_position_m() - f64::from(target_m);
    let last = b.last.expect("telemetry");
    let said = last.position_m.expect("homed, with a gap");
    let stated_m = f64::from(last.position_error_m.expect("homed"));
    let estimate_m = (f64::from(said - target_m) - error_m).abs();
    assert!(
        estimate_m < ESTIMATE_M + ESTIMATE_STATED * stated_m,
        "{what}: {error_m} m off, {estimate_m} m believed, {stated_m} m stated"
    );
    rests.estimate_max_m = rests.estimate_max_m.max(estimate_m);
    if error_m.abs() < ARRIVED_M + left_m + stated_m {
        rests.errors_m.push(error_m);
        return;
    }
    let announced = b.events.iter().rev().find_map(|event| match event {
        EventKind::MoveDone { error_m } => Some(f64::from(*error_m)),
        _ => None,
    });
    let at_end = last.limit == Some(Limit::Travel);
    let told = announced.is_some_and(|said_m| (said_m - error_m).abs() < ESTIMATE_M + ESTIMATE_STATED * stated_m);
    if at_end && told {
        rests.short = (rests.short.0 + 1, rests.short.1.max(error_m.abs()));
    } else {
        eprintln!("{what}: {error_m} m off, unannounced: {last:?}");
        rests.unannounced += 1;
    }
}
