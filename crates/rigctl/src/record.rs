//! Telemetry as rows, each with the emulated plant's truth of the same moment.

use rig_link::Telemetry;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// What the emulated plant really does.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
pub struct Truth {
    /// Emulated time (s).
    pub t_s: f64,
    /// How far the load is up, from a point that the plant chose at boot (m).
    pub position_m: f64,
    /// Twist of the strings (rad).
    pub twist_rad: f64,
    /// Load (N).
    pub load_n: f64,
    /// Tension of one string (N).
    #[serde(alias = "tension_n")]
    pub string_tension_n: f64,
}

/// One row: what the board said, and on the emulated board what was true.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Time since boot (s).
    pub t_s: f64,
    /// What the rig is doing.
    pub state: &'static str,
    /// The latched fault.
    pub fault: Option<&'static str>,
    /// What holds it back.
    pub limit: Option<&'static str>,
    /// Where it is going (m).
    pub target_m: Option<f32>,
    /// Where the planner wants it now (m).
    pub setpoint_m: Option<f32>,
    /// Where the LVDT sees it (m).
    pub position_m: Option<f32>,
    /// Twist of the strings (rad).
    pub twist_rad: Option<f32>,
    /// Estimated load (N).
    pub load_n: Option<f32>,
    /// Transmission ratio (rad/m).
    pub tr_rad_per_m: Option<f32>,
    /// Motor current (A).
    pub drive_current_a: f32,
    /// Speed of the motor shaft (rad/s).
    pub drive_speed_rad_per_s: f32,
    /// The plant's position, from where it was when the board said that it was homed (m).
    pub true_position_m: Option<f64>,
    /// The plant's twist (rad).
    pub true_twist_rad: Option<f64>,
    /// The plant's load (N).
    pub true_load_n: Option<f64>,
    /// The plant's tension of one string (N).
    pub string_tension_n: Option<f64>,
}

/// How long truth is kept to be paired with telemetry that is still on the wire (s). Longer than any frame takes.
const KEPT_S: f64 = 1.0;

/// Pairs telemetry with truth.
#[derive(Debug, Default)]
pub struct Recorder {
    truth: VecDeque<Truth>,
    /// The plant's position when the board declared itself homed.
    homed_at_m: Option<f64>,
    /// When the board last booted (µs of emulated time): its own clock starts there.
    boot_us: u64,
}

impl Recorder {
    /// Takes what the plant did.
    pub fn add_truth(&mut self, truth: impl IntoIterator<Item = Truth>) {
        self.truth.extend(truth);
        let Some(last_s) = self.truth.back().map(|t| t.t_s) else { return };
        while self.truth.front().is_some_and(|t| t.t_s < last_s - KEPT_S) {
            self.truth.pop_front();
        }
    }

    /// The board booted at this time: its clock starts anew, and it is no longer homed.
    pub fn booted(&mut self, at_s: f64) {
        self.boot_us = (at_s * 1e6).round() as u64;
        self.homed_at_m = None;
    }

    /// The board declared itself homed at `t_us` of its own clock.
    pub fn homed(&mut self, t_us: u64) {
        self.homed_at_m = self.truth_at(t_us).map(|t| t.position_m);
    }

    /// Time since the first boot (s) of a moment on the board's clock.
    pub fn time_s(&self, t_us: u64) -> f64 {
        (self.boot_us.saturating_add(t_us)) as f64 / 1e6
    }

    /// The row for one telemetry message.
    pub fn row(&self, telemetry: &Telemetry) -> Row {
        let truth = self.truth_at(telemetry.t_us);
        Row {
            t_s: self.time_s(telemetry.t_us),
            state: telemetry.state.name(),
            fault: telemetry.fault.map(|f| f.name()),
            limit: telemetry.limit.map(|l| l.name()),
            target_m: telemetry.target_m,
            setpoint_m: telemetry.setpoint_m,
            position_m: telemetry.position_m,
            twist_rad: telemetry.twist_rad,
            load_n: telemetry.load_n,
            tr_rad_per_m: telemetry.tr_rad_per_m,
            drive_current_a: telemetry.drive_current_a,
            drive_speed_rad_per_s: telemetry.drive_speed_rad_per_s,
            true_position_m: truth.and_then(|t| Some(t.position_m - self.homed_at_m?)),
            true_twist_rad: truth.map(|t| t.twist_rad),
            true_load_n: truth.map(|t| t.load_n),
            string_tension_n: truth.map(|t| t.string_tension_n),
        }
    }

    /// The truth nearest to a moment on the board's clock.
    fn truth_at(&self, t_us: u64) -> Option<&Truth> {
        let t_s = self.time_s(t_us);
        let after = self.truth.partition_point(|t| t.t_s < t_s);
        let before = self.truth.get(after.wrapping_sub(1));
        match (before, self.truth.get(after)) {
            (Some(before), Some(after)) if t_s - before.t_s <= after.t_s - t_s => Some(before),
            (before, after) => after.or(before),
        }
    }
}

/// A table of rows as comma-separated values, with the same names and units as `--json`.
///
/// # Errors
/// If the sink fails.
pub fn write_csv<'a>(sink: impl std::io::Write, rows: impl IntoIterator<Item = &'a Row>) -> csv::Result<()> {
    let mut writer = csv::Writer::from_writer(sink);
    for row in rows {
        writer.serialize(row)?;
    }
    writer.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rig_link::{Counters, State};

    fn telemetry(t_us: u64) -> Telemetry {
        Telemetry {
            t_us,
            state: State::Ready,
            fault: None,
            limit: None,
            target_m: None,
            setpoint_m: None,
            position_m: Some(0.5),
            twist_rad: None,
            load_n: None,
            tr_rad_per_m: None,
            drive_current_a: 0.0,
            drive_speed_rad_per_s: 0.1,
            counters: Counters::default(),
        }
    }

    fn truth(ms: u32) -> Truth {
        let t_s = f64::from(ms) * 1e-3;
        Truth { t_s, position_m: 1.0 + t_s, ..Truth::default() }
    }

    #[test]
    fn rows_pair_with_the_nearest_truth_and_count_from_homing() {
        let mut recorder = Recorder::default();
        assert_eq!(recorder.row(&telemetry(1000)).true_twist_rad, None, "no truth on a real board");
        recorder.add_truth((1..=100).map(truth));
        assert_eq!(recorder.row(&telemetry(50_000)).true_position_m, None, "null before homing");
        recorder.homed(20_400);
        let position = recorder.row(&telemetry(50_400)).true_position_m.unwrap_or(f64::NAN);
        assert!((position - 0.030).abs() < 1e-12, "{position}");
        recorder.booted(0.08);
        let row = recorder.row(&telemetry(10_000));
        assert_eq!((row.t_s, row.true_position_m), (0.09, None));
    }

    #[test]
    fn json_has_short_numbers_and_csv_the_same_names() {
        let row = Recorder::default().row(&telemetry(10_000));
        let json = serde_json::to_string(&row).unwrap_or_default();
        assert!(json.starts_with(r#"{"t_s":0.01,"state":"ready","fault":null,"#), "{json}");
        assert!(json.contains(r#""drive_speed_rad_per_s":0.1,"#), "{json}");
        let mut csv = Vec::new();
        write_csv(&mut csv, [&row]).unwrap_or_else(|e| panic!("{e}"));
        let csv = String::from_utf8_lossy(&csv).into_owned();
        assert!(csv.starts_with("t_s,state,fault,limit,target_m,"), "{csv}");
        assert!(csv.lines().nth(1).is_some_and(|l| l.starts_with("0.01,ready,,,") && l.contains(",0.1,")), "{csv}");
    }
}
