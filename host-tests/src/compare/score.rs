//! What a record is worth: tracking, settling, overshoot, energy.

use super::play::Record;
use rig_control::TICK_S;
use std::ops::Range;

/// How near the target counts as settled (m), where the sensor allows it.
pub const SETTLED_M: f64 = 50e-6;
/// How long it must have stayed there at the end of what was recorded (ticks).
const STAYED: usize = 50;

/// One move's figures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Score {
    /// The move was made. All else is 0 where it was not, and it has not settled.
    pub made: bool,
    /// Largest error until the set-point arrives (m).
    pub max_m: f64,
    /// Sum of its squares (m²), and of how many ticks.
    pub squares_m2: f64,
    /// Ticks of travel.
    pub ticks: usize,
    /// From the end of the set-point's travel until the load stays near the target (s); `None` if it does not before the
    /// next move.
    pub settling_s: Option<f64>,
    /// Farthest past the target in the direction of travel, until the next move (m).
    pub overshoot_m: f64,
    /// Electrical energy of the motor, until the next move (J).
    pub energy_j: f64,
}

impl Score {
    /// Of one move, settled within [`SETTLED_M`].
    pub fn new(record: &Record) -> Self {
        Self::within(record, SETTLED_M)
    }

    /// Of one move, settled within another distance (m).
    pub fn within(record: &Record, settled_m: f64) -> Self {
        let [from_m, target_m] = record.ends_m;
        let arrives = record.set_points_m.iter().rposition(|s| (f64::from(*s) - target_m).abs() > 1e-9);
        // Where the set-point itself does not arrive nothing can settle.
        let travel = arrives.map_or(0, |last| last + 2).min(record.set_points_m.len());
        // A set-point that waits for the load to come free does not make the mean smaller.
        let waits = record.set_points_m.iter().position(|s| *s != record.set_points_m[0]).unwrap_or(0);
        let waits = waits.saturating_sub(1).min(travel);
        let errors = |ticks: Range<usize>| {
            let both = record.set_points_m[ticks.clone()].iter().zip(&record.positions_m[ticks]);
            both.map(|(s, p)| (f64::from(*s) - p).abs())
        };
        let max_m = errors(0..travel).fold(0.0, f64::max);
        let squares_m2 = errors(waits..travel).map(|e| e * e).sum();
        let off = |p: &f64| (p - target_m).abs() > settled_m;
        let settled = record.positions_m.iter().rposition(off).map_or(0, |last| last + 1);
        let stays = settled + STAYED <= record.positions_m.len() && travel < record.positions_m.len();
        let way = (target_m - from_m).signum();
        Self {
            made: true,
            max_m,
            squares_m2,
            ticks: travel - waits,
            settling_s: stays.then(|| settled.saturating_sub(travel) as f64 * f64::from(TICK_S)),
            overshoot_m: record.positions_m.iter().map(|p| (p - target_m) * way).fold(0.0, f64::max),
            energy_j: record.energy_j,
        }
    }
}

/// The figures of many moves together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// How many.
    pub moves: usize,
    /// How many of them were not made: their controller had failed.
    pub not_made: usize,
    /// Largest tracking error (m).
    pub max_m: f64,
    /// Root mean square of the tracking error over all ticks of all moves (m).
    pub rms_m: f64,
    /// Fraction of all moves that settled.
    pub settled: f64,
    /// Largest overshoot (m).
    pub overshoot_m: f64,
    /// Mean energy of a move that was made (J).
    pub energy_j: f64,
}

impl Summary {
    /// Of these moves.
    pub fn new<'a>(scores: impl IntoIterator<Item = &'a Score>) -> Self {
        let scores: Vec<&Score> = scores.into_iter().collect();
        if scores.is_empty() {
            return Self::default();
        }
        let max = |value: fn(&Score) -> f64| scores.iter().map(|s| value(s)).fold(0.0, f64::max);
        let sum = |value: fn(&Score) -> f64| scores.iter().map(|s| value(s)).sum::<f64>();
        let made = scores.iter().filter(|s| s.made).count();
        Self {
            moves: scores.len(),
            not_made: scores.len() - made,
            max_m: max(|s| s.max_m),
            rms_m: (sum(|s| s.squares_m2) / sum(|s| s.ticks as f64).max(1.0)).sqrt(),
            settled: scores.iter().filter(|s| s.settling_s.is_some()).count() as f64 / scores.len() as f64,
            overshoot_m: max(|s| s.overshoot_m),
            energy_j: sum(|s| s.energy_j) / made.max(1) as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A set-point that travels 1 mm in 100 ticks and a load that is behind it by `behind_m`, then goes past by `past_m`
    /// and comes back after the given number of ticks.
    fn record(behind_m: f64, past_m: f64, back_after: usize) -> Record {
        let set_points_m: Vec<f32> = (1..=400).map(|k| (k as f32 * 1e-5).min(1e-3)).collect();
        let position = |k: usize| match k {
            0..99 => f64::from(set_points_m[k]) - behind_m,
            k if k < 100 + back_after => 1e-3 + past_m,
            _ => 1e-3,
        };
        let positions_m = (0..400).map(position).collect();
        Record { ends_m: [0.0, 1e-3], set_points_m, positions_m, ..Record::default() }
    }

    #[test]
    fn figures_of_a_known_move() {
        let score = Score::new(&record(2e-4, 8e-5, 60));
        assert!((score.max_m - 2e-4).abs() < 1e-9);
        assert_eq!(score.ticks, 100);
        assert!((score.overshoot_m - 8e-5).abs() < 1e-12);
        assert!((score.settling_s.unwrap() - 0.6).abs() < 1e-6);
        // 99 ticks behind, one past.
        let rms = ((99.0 * 4e-8 + 6.4e-9) / 100.0f64).sqrt();
        assert!((Summary::new([&score]).rms_m - rms).abs() < 1e-10);
        assert_eq!(Score::new(&record(0.0, 4e-5, 60)).settling_s, Some(0.0), "never out of the band");
        assert_eq!(Score::new(&record(0.0, 8e-5, 290)).settling_s, None, "too late to be sure");
    }

    #[test]
    fn a_set_point_that_does_not_arrive_does_not_settle() {
        let mut r = record(0.0, 0.0, 0);
        r.set_points_m = vec![5e-4; 400];
        let score = Score::new(&r);
        assert_eq!((score.settling_s, score.ticks), (None, 400));
    }

    #[test]
    fn a_wider_band_is_reached_sooner() {
        let record = record(0.0, 8e-5, 60);
        assert_eq!(Score::within(&record, 1e-4).settling_s, Some(0.0));
        assert!(Score::within(&record, 7e-5).settling_s.unwrap() > 0.5);
    }

    #[test]
    fn a_move_that_was_not_made_counts_against_its_controller_but_has_no_error() {
        let made =
            Score { made: true, settling_s: Some(0.1), squares_m2: 4e-8, ticks: 1, energy_j: 2.0, ..Score::default() };
        let summary = Summary::new(&[made, Score::default()]);
        assert_eq!((summary.moves, summary.not_made, summary.settled), (2, 1, 0.5));
        assert!((summary.rms_m - 2e-4).abs() < 1e-12);
        assert_eq!(summary.energy_j, 2.0, "the mean of what was spent");
    }
}
