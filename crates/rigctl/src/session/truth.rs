//! What was true in an emulated rig at the time of a message. Nothing on a real rig.

use rig_plant::Truth;
use std::collections::VecDeque;

/// Records (of 1 ms) that are kept to be paired with telemetry.
const RECORDS: usize = 500;

/// The newest records, and the true gap where the position is zero.
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
