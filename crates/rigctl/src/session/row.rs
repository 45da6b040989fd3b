//! What passes between host and board. A line of telemetry is the board's report, and on an emulated rig the truth at the same
//! time.

use crate::output::at;
use crate::units::{MM, N, RAD_PER_MM, RPM, TURNS_OF_RAD, Value};
use rig_link::{EventKind, Fault, HomingFailure, Limit, Request, State, Telemetry};
use rig_plant::Truth;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::f64::consts::TAU;

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

/// An end of the range of loads that a table covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RangeEnd {
    /// The lightest load: the true one is at most that.
    Low,
    /// The heaviest load: the true one is at least that.
    High,
}

impl RangeEnd {
    /// The end of a table's range of loads (N) that an estimate stands at, if it stands at one.
    pub fn of(load_n: f32, [min_n, max_n]: [f32; 2]) -> Option<Self> {
        match load_n {
            n if n >= max_n => Some(Self::High),
            n if n <= min_n => Some(Self::Low),
            _ => None,
        }
    }

    /// Its name in JSON and logs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::High => "high",
        }
    }
}

/// A load (N) with its error; at the end of the table's range as a bound, because the load may be beyond it.
pub fn load_text(load_n: impl Value, load_error_n: impl Value, end: Option<RangeEnd>) -> String {
    match end {
        Some(RangeEnd::Low) => format!("at most {} (end of the table's range)", N.show(load_n)),
        Some(RangeEnd::High) => format!("at least {} (end of the table's range)", N.show(load_n)),
        None => N.within(load_n, load_error_n),
    }
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
    /// The end of the table's range that `load_n` stands at: the true load may be beyond it.
    pub load_at_range_end: Option<RangeEnd>,
    /// The same of `position_m`.
    pub position_error_m: Option<f32>,
    /// Transmission ratio at this twist and load.
    pub tr_rad_per_m: Option<f32>,
    /// Motor current as the drive reports it; `None` while the drive is silent.
    pub drive_current_a: Option<f32>,
    /// Speed of the motor shaft as the drive reports it.
    pub drive_speed_rad_per_s: Option<f32>,
    /// Gap by the LVDT, homed or not.
    pub gap_m: Option<f32>,
    /// Rotation of the strings since boot by the own encoder; older logs do not have it.
    pub encoder_rad: Option<f32>,
    /// Supply of the drive.
    pub supply_v: Option<f32>,
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

/// A number of the board's, which sends NaN for what it does not know.
fn known(number: f32) -> Option<f32> {
    (!number.is_nan()).then_some(number)
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
            load_at_range_end: None,
            position_error_m: telemetry.position_error_m,
            tr_rad_per_m: telemetry.tr_rad_per_m,
            drive_current_a: known(telemetry.drive_current_a),
            drive_speed_rad_per_s: known(telemetry.drive_speed_rad_per_s),
            gap_m: telemetry.gap_m,
            encoder_rad: Some(telemetry.shaft_rad),
            supply_v: telemetry.supply_v,
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
        let known = || {
            format!(
                "position {:>17}{}  set-point {:>9}  load {:>15}  TR {:>12}",
                MM.within(self.position_m, self.position_error_m),
                truth.unwrap_or_default(),
                MM.show(self.setpoint_m),
                load_text(self.load_n, self.load_error_n, self.load_at_range_end),
                RAD_PER_MM.show(self.tr_rad_per_m),
            )
        };
        // Before and during a homing: what the sensors say.
        let sensed = || {
            let motor = RPM.rounded(self.drive_speed_rad_per_s, 10.0 * TAU / 60.0);
            let [gap, turns] = [MM.show(self.gap_m), TURNS_OF_RAD.rounded(self.encoder_rad, 0.01 * TAU)];
            format!("gap {gap:>10}  strings since power-on {turns:>12}  motor {motor:>9}")
        };
        format!(
            "{}  {:8} {}{}{}{}",
            at(self.t_s),
            self.state,
            if self.position_m.is_some() || self.load_n.is_some() { known() } else { sensed() },
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
    /// The true gap (m) when the rig was homed; none where the position is not known.
    pub home_gap_m: Option<f64>,
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::telemetry;

    #[test]
    fn a_load_at_the_end_of_the_range_is_a_bound() {
        let ends = [0.75, 0.76, 17.99, 18.0].map(|n| RangeEnd::of(n, [0.75, 18.0]));
        assert_eq!(ends, [Some(RangeEnd::Low), None, None, Some(RangeEnd::High)]);
        let heavy = Telemetry { load_n: Some(18.0), load_error_n: Some(2.0), ..telemetry(0) };
        let row = Row { load_at_range_end: ends[3], ..Row::new(0.0, &heavy, None, None) };
        assert!(row.text().contains("load at least 18.00 N (end of the table's range)"), "{}", row.text());
        assert_eq!(serde_json::to_value(&row).expect("JSON")["load_at_range_end"], RangeEnd::High.name());
    }

    #[test]
    fn a_row_has_the_raw_signals() {
        let raw = Telemetry { gap_m: Some(0.09), shaft_rad: -1.5, supply_v: Some(24.0), ..telemetry(0) };
        let row = Row::new(0.0, &raw, None, None);
        let text = row.text();
        assert!(text.contains("90.00 mm") && text.contains("-0.239 turns") && !text.contains("unknown"), "{text}");
        let row = serde_json::to_value(row).expect("JSON");
        assert_eq!((&row["encoder_rad"], &row["supply_v"]), (&(-1.5).into(), &24.0.into()));
        assert!(row["gap_m"].as_f64().is_some_and(|gap_m| (gap_m - 0.09).abs() < 1e-6), "{row}");
        assert!(row["load_at_range_end"].is_null());
    }
}
