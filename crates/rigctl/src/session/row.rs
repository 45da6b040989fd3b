//! What passes between host and board. A line of telemetry is the board's report, and on an emulated rig the truth at the same
//! time.

use crate::output::at;
use crate::units::{MM, N, RAD_PER_MM};
use rig_link::{EventKind, Fault, HomingFailure, Limit, Request, State, Telemetry};
use rig_plant::Truth;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Records of the truth (of 1 ms) that are kept to be paired with telemetry.
const RECORDS: usize = 500;

/// One thing that passed.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// The host sent a request, after the telemetry of this time (s).
    Request(f64, Request),
    /// The board reported an event of this time (s).
    Event(f64, EventKind),
    /// Telemetry.
    Row(Row),
}

/// Keys and order of the host tool's contract, in JSON and as the columns of a log. SI units; `None` is null, or an empty cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Time (s): emulated time, or since the port was opened.
    pub t_s: f64,
    /// State of the rig.
    pub state: State,
    /// The most severe of the faults that stopped it.
    pub fault: Option<Fault>,
    /// All faults, separated by blanks; none without a fault.
    pub faults: Option<String>,
    /// The limit that holds the move back.
    pub limit: Option<Limit>,
    /// Why the estimates are not to be relied on, separated by blanks; none without a doubt.
    pub doubts: Option<String>,
    /// Target of the move.
    pub target_m: Option<f32>,
    /// The planner's set-point.
    pub setpoint_m: Option<f32>,
    /// Position measured by the LVDT.
    pub position_m: Option<f32>,
    /// Twist of the strings.
    pub twist_rad: Option<f32>,
    /// Estimated load.
    pub load_n: Option<f32>,
    /// Half the width of the interval around `load_n` that holds the true load in 90 of 100 cases.
    pub load_error_n: Option<f32>,
    /// The same of `position_m`.
    pub position_error_m: Option<f32>,
    /// Transmission ratio at this twist and load.
    pub tr_rad_per_m: Option<f32>,
    /// Motor current as the drive reports it.
    #[serde(default)]
    pub drive_current_a: f32,
    /// Speed of the motor shaft as the drive reports it.
    #[serde(default)]
    pub drive_speed_rad_per_s: f32,
    /// Time until the set-point is at its target.
    pub time_left_s: Option<f32>,
    /// Learned scale of the twist.
    pub twist_scale: Option<f32>,
    /// Why the last homing failed, until the next one begins or the board restarts.
    pub homing_failure: Option<HomingFailure>,
    /// The same position, of the plant's true gap.
    pub true_position_m: Option<f64>,
    /// True twist.
    pub true_twist_rad: Option<f64>,
    /// True load.
    pub true_load_n: Option<f64>,
    /// True tension of one string.
    pub string_tension_n: Option<f64>,
}

impl Row {
    /// Puts telemetry and truth side by side. `home_gap_m` is the true gap when the rig was homed.
    pub fn new(t_s: f64, telemetry: &Telemetry, truth: Option<&Truth>, home_gap_m: Option<f64>) -> Self {
        Self {
            t_s,
            state: telemetry.state,
            fault: telemetry.fault,
            faults: telemetry.fault.map(|_| telemetry.faults.to_string()),
            limit: telemetry.limit,
            doubts: (!telemetry.doubts.is_empty()).then(|| telemetry.doubts.to_string()),
            target_m: telemetry.target_m,
            setpoint_m: telemetry.setpoint_m,
            position_m: telemetry.position_m,
            twist_rad: telemetry.twist_rad,
            load_n: telemetry.load_n,
            load_error_n: telemetry.load_error_n,
            position_error_m: telemetry.position_error_m,
            tr_rad_per_m: telemetry.tr_rad_per_m,
            drive_current_a: telemetry.drive_current_a,
            drive_speed_rad_per_s: telemetry.drive_speed_rad_per_s,
            time_left_s: telemetry.time_left_s,
            twist_scale: telemetry.twist_scale,
            homing_failure: None,
            true_position_m: home_gap_m.zip(truth).map(|(home, t)| home - t.gap_m),
            true_twist_rad: truth.map(|t| t.twist_rad),
            true_load_n: truth.map(|t| t.load_n),
            string_tension_n: truth.map(|t| t.string_tension_n),
        }
    }

    /// A line for people.
    pub fn text(&self) -> String {
        let truth = self.true_position_m.map(|m| format!(" (true {})", MM.rounded(m, self.position_error_m)));
        format!(
            "{}  {:8} position {:>17}{}  set-point {:>9}  load {:>15}  TR {:>12}{}{}{}",
            at(self.t_s),
            self.state,
            MM.within(self.position_m, self.position_error_m),
            truth.unwrap_or_default(),
            MM.show(self.setpoint_m),
            N.within(self.load_n, self.load_error_n),
            RAD_PER_MM.show(self.tr_rad_per_m),
            self.faults.as_ref().map_or(String::new(), |f| format!("  FAULT {f}")),
            self.limit.map_or(String::new(), |l| format!("  limit {l}")),
            self.doubts.as_ref().map_or(String::new(), |d| format!("  doubt {d}")),
        )
    }
}

/// What was true in an emulated rig, newest last, and the true gap where the position is zero.
#[derive(Default)]
pub struct TruthRecords {
    records: VecDeque<Truth>,
    home_gap_m: Option<f64>,
}

impl TruthRecords {
    /// Takes new records.
    pub fn extend(&mut self, records: Vec<Truth>) {
        self.records.extend(records);
        while self.records.len() > RECORDS {
            self.records.pop_front();
        }
    }

    /// The newest record.
    pub fn newest(&self) -> Option<&Truth> {
        self.records.back()
    }

    /// The record nearest to a time (s).
    pub fn at(&self, t_s: f64) -> Option<Truth> {
        let distance = |t: &&Truth| (t.t_s - t_s).abs();
        self.records.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
    }

    /// The rig was homed at this time (s).
    pub fn homed(&mut self, t_s: f64) {
        self.home_gap_m = self.at(t_s).map(|t| t.gap_m);
    }

    /// The board was reset: its position is not known any more.
    pub fn restarted(&mut self) {
        self.home_gap_m = None;
    }

    /// The true gap (m) when the rig was homed.
    pub fn home_gap_m(&self) -> Option<f64> {
        self.home_gap_m
    }
}
