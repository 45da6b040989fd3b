//! A log through the controller again: [`rig_control::Controller::step`], tick by tick, fed with what was recorded.
//!
//! Telemetry does not hold everything that a tick sees. A homing itself cannot be replayed, because the raw shaft is
//! not in the log. After it, the shaft follows from the twist, and the replay starts from the result of the
//! homing, which the log holds as an event. A homing whose record lacks a value, as in older logs, is not replayed. The
//! drive's lag is found from the log, as the delay at which the twist follows the commands best. Everything else that a
//! tick sees is taken for healthy: a replay ends where the recorded rig stopped by a fault.

use crate::log::{Log, Mark};
use crate::session::row::Row;
use crate::statistics::Errors;
use crate::units::{MM, RAD};
use rig_config::Scene;
use rig_control::homing::Homed;
use rig_control::{Controller, DriveCommand, DriveReading, Inputs, LvdtBlock, RigConstants, TICK_S, TICK_US, settings};
use rig_link::{HomingResult, LoadChoice, Request, Setting, SettingValues, State};
use serde::Serialize;
use std::f32::consts::PI;
use tsa_table::Table;

/// Age of the gap at its tick (µs): blocks of 6 ms against ticks of 10 ms make it 0 to 6 ms.
const BLOCK_AGE_US: u64 = 3000;
/// Standing ticks in which the controller finds drive and sensor well.
const BOOT_TICKS: u64 = 60;
/// Ticks that may be missing in a row before a replay ends; they are filled in straight.
const FILLED: u32 = 10;
/// Rows in which a request shows.
const SHOWS_ROWS: usize = 10;
/// What no rig reports: farther off the counts would not fit their numbers.
const TWIST_MAX_RAD: f32 = 1000.0;
const POSITION_MAX_M: f32 = 10.0;
/// Longest lag of the drive that is looked for (quarters of a tick).
const LAG_QUARTERS: u32 = 40;
/// What twist speeds are taken over (ticks): in a single one they are the drive's own ripple.
const SPEED_TICKS: usize = 10;

/// Load (share), set-point (m, beyond those of the neighbouring ticks) and twist speed (rad/s) by which recorded and
/// replayed have parted. The drive's own loop follows a steep command by up to 0.8 rad/s otherwise than a mere delay
/// would, and a load that comes to rest can be seen to stand a few ticks earlier or later: 1.05 rad/s on the emulated board.
pub const PARTED: (f64, f64, f64) = (0.01, 10e-6, 1.5);

/// Largest and rms difference, replayed less recorded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Difference {
    /// Largest.
    pub largest: f64,
    /// Root of the mean square.
    pub rms: f64,
}

impl Difference {
    fn of(differences: impl Iterator<Item = f64>) -> Self {
        let all = Errors::over(differences);
        Self { largest: all.worst, rms: all.rms }
    }
}

/// Where recorded and replayed part first.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Divergence {
    /// Time (s).
    pub t_s: f64,
    /// What of: `load_n`, `setpoint_m`, `twist_speed_rad_per_s`, `fault`.
    pub what: String,
    /// Recorded, replayed (SI units); none for a fault.
    pub values: Option<[f64; 2]>,
}

/// One stretch, from a homing to what ended it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stretch {
    /// First time (s).
    pub from_s: f64,
    /// Last time (s).
    pub to_s: f64,
    /// Ticks replayed.
    pub ticks: usize,
    /// Of these missing in the log, and filled in.
    pub filled: usize,
    /// What ended it.
    pub ended_by: String,
    /// The drive's lag, at which twist and command agree best (s).
    pub drive_lag_s: f64,
    /// Of the load estimate (N).
    pub load_n: Difference,
    /// Of its stated error (N).
    pub load_error_n: Difference,
    /// Of the stated error of the position (m).
    pub position_error_m: Difference,
    /// Of the set-point (m).
    pub setpoint_m: Difference,
    /// Of the twist speed: commanded in the replay, turned in the log (rad/s).
    pub twist_speed_rad_per_s: Difference,
    /// Where they part.
    pub parted: Option<Divergence>,
}

/// A tick of the log, and what is asked in it.
#[derive(Clone, Copy)]
struct Tick<'a> {
    row: &'a Row,
    twist_rad: f32,
    gap_m: f32,
    request: Option<Request>,
}

/// What the controller made of a tick, and where it wants the shaft (rad).
struct Answer {
    row: Row,
    shaft_rad: Option<f64>,
}

/// Who replays: the scene's constants, the settings that the log's head tells, and the table.
struct Board<'a> {
    scene: RigConstants,
    settings: SettingValues,
    /// As the settings correct them.
    constants: RigConstants,
    table: &'a Table<'a>,
}

/// Replays every stretch after a homing.
///
/// # Errors
/// If there is no homing with anything after it, or a setting in the head is none.
pub fn replay(log: &Log, scene: &Scene, table: &Table<'_>) -> Result<Vec<Stretch>, String> {
    let scene = scene.constants();
    let (settings, _) = log.settings(&settings::defaults(&scene))?;
    let board = Board { scene, settings, constants: settings::apply(&settings, &scene), table };
    let mut stretches = Vec::new();
    for (k, mark) in log.marks.iter().enumerate() {
        stretches.extend(stretch(log, k, &mark.mark, &board));
    }
    if stretches.is_empty() {
        return Err("has nothing that can be replayed: no homing with telemetry after it".into());
    }
    Ok(stretches)
}

fn stretch(log: &Log, at: usize, mark: &Mark, board: &Board<'_>) -> Option<Stretch> {
    let Mark::Homed(found) = *mark else { return None };
    let (ticks, filled, ended_by) = ticks(log, at, found.reference_gap_m - board.settings.get(Setting::PositionZero));
    let first = ticks.first()?;
    // A log's zero twist is where its twist is zero. Without lag a command is the shaft's set-point itself.
    let homed = Homed {
        zero_rad: 0.0,
        beyond_range: false,
        heaviest_n: heaviest_n(log, at, board.settings.get(Setting::HeaviestLoad)),
        found: HomingResult { drive_lag_s: 0.0, ..found },
    };
    let answers = answers(&ticks, &homed, board);
    let rms = |lag: f64| speeds(&ticks, &answers, lag).0.rms;
    let lag = (0..=LAG_QUARTERS).map(|k| 0.25 * f64::from(k)).min_by(|a, b| rms(*a).total_cmp(&rms(*b)))?;
    let (twist_speed, parted_speed) = speeds(&ticks, &answers, lag);
    Some(Stretch {
        from_s: first.row.t_s,
        to_s: ticks.last()?.row.t_s,
        ticks: ticks.len(),
        filled,
        ended_by,
        drive_lag_s: lag * f64::from(TICK_S),
        load_n: difference(&ticks, &answers, |row| row.load_n),
        load_error_n: difference(&ticks, &answers, |row| row.load_error_n),
        position_error_m: difference(&ticks, &answers, |row| row.position_error_m),
        setpoint_m: difference(&ticks, &answers, |row| row.setpoint_m),
        twist_speed_rad_per_s: twist_speed,
        parted: divergence(&ticks, &answers, parted_speed),
    })
}

/// The heaviest load before a homing (N), by the board's settings and by the log, as far as the board made use of it: not where the
/// load was given.
fn heaviest_n(log: &Log, homed: usize, kept_n: f32) -> f32 {
    let asked = log.marks[..homed].iter().rev().find_map(|m| match m.mark {
        Mark::Request(Request::Home { load }) => Some(load),
        _ => None,
    });
    match asked {
        Some(LoadChoice::Known(_)) => 0.0,
        _ => log.rows[..log.marks[homed].row].iter().filter_map(|row| row.load_n).fold(kept_n, f32::max),
    }
}

/// The ticks after a homing, how many of them are filled in, and what ended them. An older log does not have the gap, which follows
/// from that at position 0 (m).
fn ticks(log: &Log, mark: usize, zero_gap_m: f32) -> (Vec<Tick<'_>>, usize, String) {
    // The tick that ended the homing does not know TR yet.
    let known = |r: &Row| r.twist_rad.is_some() && r.tr_rad_per_m.is_some();
    let start = log.marks[mark].row;
    let start = start + log.rows[start..].iter().take_while(|r| !known(r)).count();
    // A request shows in the first row in which state or target change after it. A jog that is stopped shows only when it
    // has ended: it is taken to have been as late as the one before.
    let mut late = 1;
    let mut asked: Vec<(usize, Request)> = Vec::new();
    for m in &log.marks[mark..] {
        let Mark::Request(request) = m.mark else { continue };
        let stops = request == Request::Stop;
        let seen = |k: usize| log.rows.get(k).map(|r| (r.state, r.target_m.map(f32::to_bits)));
        let before = m.row.checked_sub(1).and_then(seen);
        let jogged = stops && before.is_some_and(|(state, target)| state == State::Moving && target.is_none());
        let shows = (m.row..m.row + SHOWS_ROWS).find(|k| !jogged && seen(*k) != before);
        late = shows.map_or(late, |k| k - m.row);
        asked.push((m.row + late, request));
    }
    let mut ticks: Vec<Tick<'_>> = Vec::new();
    let (mut filled, mut ended_by) = (0, "the log's end".to_owned());
    for (k, row) in log.rows.iter().enumerate().skip(start) {
        let (Some(twist_rad), Some(position_m)) = (row.twist_rad, row.position_m) else {
            ended_by = format!("{} without twist or position", row.state);
            break;
        };
        if !matches!(row.state, State::Ready | State::Moving | State::Holding) {
            ended_by = row.state.to_string();
            break;
        }
        if twist_rad.abs() > TWIST_MAX_RAD || position_m.abs() > POSITION_MAX_M {
            ended_by =
                format!("twist {} or position {}, which no actuator has", RAD.show(twist_rad), MM.show(position_m));
            break;
        }
        let request = asked.iter().find(|(shows, _)| *shows == k).map(|(_, request)| *request);
        let tick = Tick { row, twist_rad, gap_m: row.gap_m.unwrap_or(zero_gap_m - position_m), request };
        if let Some(last) = ticks.last().copied() {
            let missing = ((row.t_s - last.row.t_s) / f64::from(TICK_S)).round() as u32;
            if missing > FILLED + 1 {
                ended_by = format!("{missing} ticks that are not in the log");
                break;
            }
            for n in 1..missing {
                let part = n as f32 / missing as f32;
                let between = |a: f32, b: f32| a + part * (b - a);
                ticks.push(Tick {
                    twist_rad: between(last.twist_rad, tick.twist_rad),
                    gap_m: between(last.gap_m, tick.gap_m),
                    request: None,
                    ..last
                });
                filled += 1;
            }
        }
        ticks.push(tick);
    }
    (ticks, filled, ended_by)
}

fn answers(ticks: &[Tick<'_>], homed: &Homed, board: &Board<'_>) -> Vec<Answer> {
    let constants = &board.constants;
    let mut rig = Controller::new(board.table, board.scene, None);
    rig.set_up(&board.settings);
    let mut now_us = 1_000_000;
    let mut step = |rig: &mut Controller, twist_rad: f32, gap_m: f32, row: &Row, request: Option<Request>| {
        now_us += TICK_US;
        let encoder_counts = (f64::from(twist_rad) * f64::from(constants.counts_per_rad)).round() as i64;
        let rpm = f64::from(row.drive_speed_rad_per_s.unwrap_or(0.0)) * 60.0 / std::f64::consts::TAU;
        let inputs = Inputs {
            now_us,
            encoder_counts,
            lvdt: Some(LvdtBlock {
                t_us: now_us - BLOCK_AGE_US,
                mean_code: constants.lvdt_mean_code(gap_m),
                // Any that is healthy.
                variance: 1.0,
            }),
            drive: DriveReading::Reports {
                t_us: now_us,
                position_qc: encoder_counts as i32,
                speed_rpm: rpm.round() as i16,
                current_ma: (f64::from(row.drive_current_a.unwrap_or(0.0)) * 1e3).round() as i16,
            },
            drive_stalled: false,
            bus_off: false,
            supply: None,
            upper_limit_open: false,
            lower_limit_open: false,
            estop_open: false,
            host_heard_us: Some(now_us),
            request,
        };
        let outputs = rig.step(&inputs);
        (outputs.drive, outputs.telemetry)
    };
    let Some(first) = ticks.first() else { return Vec::new() };
    let standing = Row { drive_speed_rad_per_s: Some(0.0), ..first.row.clone() };
    for _ in 0..BOOT_TICKS {
        step(&mut rig, PI, first.gap_m, &standing, None);
    }
    rig.resume(*homed);
    let answer = |tick: &Tick<'_>| {
        let (drive, telemetry) = step(&mut rig, tick.twist_rad, tick.gap_m, tick.row, tick.request);
        let shaft_rad = match drive {
            DriveCommand::Follow { position_qc, .. } => {
                Some(f64::from(position_qc) / f64::from(constants.counts_per_rad))
            }
            _ => None,
        };
        Answer { row: Row::new(tick.row.t_s, &telemetry, None, None), shaft_rad }
    };
    ticks.iter().map(answer).collect()
}

/// Difference of one value over the ticks in which both are known.
fn difference(ticks: &[Tick<'_>], answers: &[Answer], value: impl Fn(&Row) -> Option<f32>) -> Difference {
    let pairs = ticks.iter().zip(answers);
    Difference::of(pairs.filter_map(|(tick, answer)| {
        let (replayed, recorded) = value(&answer.row).zip(value(tick.row))?;
        Some(f64::from(replayed) - f64::from(recorded))
    }))
}

/// Twist speed, commanded `lag` ticks before against turned, each over [`SPEED_TICKS`]; and the first tick in which they
/// have parted, with both.
fn speeds(ticks: &[Tick<'_>], answers: &[Answer], lag: f64) -> (Difference, Option<(usize, [f64; 2])>) {
    let told_at = |k: usize| {
        let at = k as f64 - lag;
        let before = answers.get(at.floor() as usize).filter(|_| at >= 0.0)?.shaft_rad?;
        let after = answers.get(at.ceil() as usize)?.shaft_rad?;
        Some(before + (at - at.floor()) * (after - before))
    };
    let per_s = |way: f64| way / (SPEED_TICKS as f64 * f64::from(TICK_S));
    let both: Vec<(usize, [f64; 2])> = (SPEED_TICKS..ticks.len())
        .filter_map(|k| {
            let turned = f64::from(ticks[k].twist_rad) - f64::from(ticks[k - SPEED_TICKS].twist_rad);
            Some((k, [per_s(turned), per_s(told_at(k)? - told_at(k - SPEED_TICKS)?)]))
        })
        .collect();
    let parted = both.iter().find(|(_, [turned, told])| (told - turned).abs() > PARTED.2).copied();
    (Difference::of(both.iter().map(|(_, [turned, told])| told - turned)), parted)
}

fn divergence(ticks: &[Tick<'_>], answers: &[Answer], speed: Option<(usize, [f64; 2])>) -> Option<Divergence> {
    for (k, (tick, answer)) in ticks.iter().zip(answers).enumerate() {
        let part = |what: &str, values| Some(Divergence { t_s: tick.row.t_s, what: what.into(), values });
        let both = |value: fn(&Row) -> Option<f32>| {
            let (recorded, replayed) = value(tick.row).zip(value(&answer.row))?;
            Some([f64::from(recorded), f64::from(replayed)])
        };
        if let Some(fault) = answer.row.fault {
            return part(&format!("fault {fault}"), None);
        }
        if let Some(both) = both(|row| row.load_n).filter(|[a, b]| (a - b).abs() > PARTED.0 * a.abs()) {
            return part("load_n", Some(both));
        }
        // Rounding can end the friction compensation of a move a tick earlier or later, and the set-point follows.
        let near = &ticks[k.saturating_sub(1)..ticks.len().min(k + 2)];
        let near = near.iter().filter_map(|t| t.row.setpoint_m.map(f64::from));
        let [low, high] = near.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], m| [l.min(m), h.max(m)]);
        let apart = |[_, replayed]: &[f64; 2]| (low - replayed).max(replayed - high) > PARTED.1;
        if let Some(both) = both(|row| row.setpoint_m).filter(apart) {
            return part("setpoint_m", Some(both));
        }
        if let Some((_, both)) = speed.filter(|(at, _)| *at == k) {
            return part("twist_speed_rad_per_s", Some(both));
        }
    }
    None
}
