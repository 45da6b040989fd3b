//! Random moves under random loads with incidents between them.

use super::incident::{Incident, Run};
use crate::board::{Bench, LongestTick};
use crate::rigs::subject::Subject;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rig_link::messages::{EventKind, Limit, Request, State};
use rig_plant::RigPreset;
use std::collections::BTreeMap;
use std::fmt;

/// Error at rest (m) past which a move has not arrived, beside what stiction leaves and how well the board knows its place: the
/// board must say so.
const ARRIVED_M: f64 = 60e-6;
/// How far what the board says may be from what is (m), over its stated error: LVDT noise and the last swing of strings and rods
/// come to it, and the stated error holds in nine of ten cases.
const BELIEF_M: f64 = 40e-6;
const BELIEF_STATED: f64 = 2.0;

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
    /// Incidents that the rig has gone on from, by kind.
    pub incidents: BTreeMap<Incident, u32>,
    /// Faults that a change of the load made by itself.
    pub load_faults: u32,
    /// Moves that ended in a fault without a cause.
    pub faults_without_cause: u32,
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
    /// Control ticks that are missing, those of starts and of writes to flash among them.
    pub ticks_missing: f64,
    /// The longest tick.
    pub longest_tick: LongestTick,
    /// Deepest stack (bytes).
    pub stack_bytes: u64,
    /// Resets of the board that nobody has caused.
    pub resets: usize,
    /// Telemetry frames of the last move that came (100 a second are sent).
    pub telemetry_per_s: f64,
}

impl fmt::Display for Endurance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [first, last] = self.error_first_last_m.map(|e| e * 1e6);
        let incidents: Vec<String> =
            self.incidents.iter().map(|(kind, count)| format!("{count} {}", kind.name())).collect();
        write!(
            f,
            "{} moves, {}, {} faults by the load, {} without a cause, {} homings in {:.0} s of emulated time: error at rest {first:+.1} um in the first tenth, \
             {last:+.1} um in the last, at most {}; {} moves ended with the strings' travel, announced, at most {}; {} away unannounced, at most {}; belief \
             and truth at most {:.1} um apart; {:.0} ticks missing, the longest {}; stack {} bytes; {} resets; {:.1} \
             telemetry frames a second",
            self.moves,
            incidents.join(", "),
            self.load_faults,
            self.faults_without_cause,
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
    /// This run and another one, on another rig.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        let farther = |a: Miss, b: Miss| if a.error_m.abs() < b.error_m.abs() { b } else { a };
        let share = f64::from(other.moves) / f64::from(self.moves + other.moves).max(1.0);
        let mean = |a: f64, b: f64| a + share * (b - a);
        for (kind, count) in other.incidents {
            *self.incidents.entry(kind).or_default() += count;
        }
        let ([first, last], [other_first, other_last]) = (self.error_first_last_m, other.error_first_last_m);
        let longer = self.longest_tick.instructions < other.longest_tick.instructions;
        Self {
            moves: self.moves + other.moves,
            incidents: self.incidents,
            load_faults: self.load_faults + other.load_faults,
            faults_without_cause: self.faults_without_cause + other.faults_without_cause,
            homings: self.homings + other.homings,
            telemetry_per_s: self.telemetry_per_s.min(other.telemetry_per_s),
            seconds: self.seconds + other.seconds,
            error_first_last_m: [mean(first, other_first), mean(last, other_last)],
            worst: farther(self.worst, other.worst),
            short: (self.short.0 + other.short.0, farther(self.short.1, other.short.1)),
            unannounced: (self.unannounced.0 + other.unannounced.0, farther(self.unannounced.1, other.unannounced.1)),
            belief_max_m: self.belief_max_m.max(other.belief_max_m),
            ticks_missing: self.ticks_missing + other.ticks_missing,
            longest_tick: if longer { other.longest_tick } else { self.longest_tick },
            stack_bytes: self.stack_bytes.max(other.stack_bytes),
            resets: self.resets + other.resets,
        }
    }

    /// The same as a JSON object; lengths in micrometres.
    pub fn json(&self) -> String {
        let [first, last] = self.error_first_last_m;
        let count = |kind: Incident| self.incidents.get(&kind).copied().unwrap_or(0);
        let mut found = serde_json::json!({
            "moves": self.moves,
            "incidents": self.incidents.values().sum::<u32>(),
            "faults": count(Incident::FaultUnderWay) + count(Incident::DriveReset),
            "faults_by_the_load": self.load_faults,
            "faults_without_cause": self.faults_without_cause,
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
        });
        for kind in Incident::FREQUENT.into_iter().chain([Incident::Identify]) {
            found[kind.name().replace(' ', "_")] = count(kind).into();
        }
        found.to_string()
    }
}

/// So many moves on the rig that a kind and a seed name; every third meets an incident, and the rig goes on after it. Halfway its
/// constants are identified anew.
///
/// # Panics
/// Where something does not go on as it should: with what, and at which move.
pub fn moves(count: u32, rig: RigPreset, seed: u64) -> Endurance {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let changes: Vec<(&str, String)> = rig.changes(seed).iter().map(|c| (c.key.name(), c.value.to_string())).collect();
    let mut keys: Vec<(&str, &str)> = changes.iter().map(|(key, value)| (*key, value.as_str())).collect();
    keys.push(("load", "0.5kg"));
    let mut board = Bench::new(&keys, seed);
    let (mut result, mut errors) = (Endurance::default(), Vec::new());
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
    while result.moves < count {
        let number = result.moves;
        if result.moves == count / 2 && !result.incidents.contains_key(&Incident::Identify) {
            run.take(Incident::Identify);
            result.incidents.insert(Incident::Identify, 1);
        }
        let load_kg = run.random.random_range(0.3..1.5);
        run.lay_on(load_kg);
        let frequent = result.incidents.iter().filter(|(kind, _)| **kind != Incident::Identify);
        let happens = number % 3 == 2 && frequent.map(|(_, count)| count).sum::<u32>() <= number / 3;
        let incident = happens.then(|| *Incident::FREQUENT.choose(run.random).expect("eight"));
        let under_way = [Incident::FaultUnderWay, Incident::PowerCycleUnderWay];
        if let Some(incident) = incident.filter(|incident| !under_way.contains(incident)) {
            run.take(incident);
            *result.incidents.entry(incident).or_default() += 1;
        }
        let target_m = 0.001 + 0.009 * run.random.random::<f32>();
        let fastest = run.random.random_bool(0.2);
        let speed_m_per_s = if fastest { f32::INFINITY } else { run.random.random_range(0.001..0.006) };
        let target_m = run.begin_move(target_m, speed_m_per_s);
        if let Some(incident) = incident.filter(|incident| under_way.contains(incident)) {
            run.board.run(0.4);
            if run.is_turning() {
                run.take(incident);
                *result.incidents.entry(incident).or_default() += 1;
                continue;
            }
        }
        let ended = |b: &Bench| matches!(b.state(), State::Holding | State::Fault);
        let what = format!("{rig} rig {seed}, move {number} under {} kg", run.load_kg);
        assert!(run.board.until(40.0, ended), "{what}: {:?}", run.board.last);
        if run.board.state() == State::Fault {
            eprintln!("{what}: {:?}", run.board.last);
            result.faults_without_cause += 1;
            assert!(result.faults_without_cause <= count, "a rig on which every move ends in a fault");
            run.go_on();
            continue;
        }
        run.board.run(0.5);
        rest(run.board, number, target_m, &mut result, &mut errors);
        result.moves += 1;
    }
    (result.homings, result.load_faults) = (run.homings, run.load_faults);
    let restarts = run.restarts;
    let stats = board.machine.stats();
    let tenth = errors.len().div_ceil(10);
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len().max(1) as f64;
    result.error_first_last_m = [mean(&errors[..tenth]), mean(&errors[errors.len() - tenth..])];
    result.seconds = board.machine.now_s();
    result.telemetry_per_s = board.frames as f64 / result.seconds;
    result.ticks_missing = result.seconds / 0.01 - stats.tick.count as f64;
    result.longest_tick = board.longest_tick.clone();
    result.stack_bytes = stats.stack_high_water_bytes as u64;
    result.resets = stats.resets.len().abs_diff(restarts as usize);
    result
}

/// What a move came to: at its target, or where the strings' travel ends and announced as such.
fn rest(b: &mut Bench, number: u32, target_m: f32, result: &mut Endurance, errors: &mut Vec<f64>) {
    b.ask(&Request::ReadSensors).expect("never refused");
    b.step();
    let left_m = f64::from(b.sensors.and_then(|s| s.rest_tolerance_m).expect("it holds"));
    let error_m = b.true_position_m() - f64::from(target_m);
    let last = b.last.expect("telemetry");
    let said = last.position_m.expect("homed, with a gap");
    let stated_m = f64::from(last.position_error_m.expect("homed"));
    let miss = Miss { number, error_m, believed_m: f64::from(said - target_m) };
    let belief_m = (miss.believed_m - error_m).abs();
    assert!(belief_m < BELIEF_M + BELIEF_STATED * stated_m, "{miss}, {:.0} um stated", stated_m * 1e6);
    result.belief_max_m = result.belief_max_m.max(belief_m);
    let farther = |than: &Miss| if error_m.abs() > than.error_m.abs() { miss } else { *than };
    if error_m.abs() < ARRIVED_M + left_m + stated_m {
        result.worst = farther(&result.worst);
        errors.push(error_m);
        return;
    }
    let announced = b.events.iter().rev().find_map(|event| match event {
        EventKind::MoveDone { error_m } => Some(f64::from(*error_m)),
        _ => None,
    });
    let at_end = last.limit == Some(Limit::Travel);
    let told = announced.is_some_and(|said_m| (said_m - error_m).abs() < BELIEF_M + BELIEF_STATED * stated_m);
    let list = if at_end && told { &mut result.short } else { &mut result.unannounced };
    *list = (list.0 + 1, farther(&list.1));
}
