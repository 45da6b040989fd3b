//! The twist at which the gap has a given value, in a bounded number of steps.
//!
//! The gap falls with the twist over the whole range (the certificate checks it), so there is at most one solution:
//! inverse interpolation inside a bracket that only shrinks.

use crate::table::{OutOfRange, Table};

/// Lookups after which the search stops, whatever it has reached.
pub const MAX_STEPS: u32 = 24;

/// Why there is no such twist.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InverseError {
    /// The table does not cover the load.
    #[error(transparent)]
    Load(#[from] OutOfRange),
    /// The gap does not occur under this load.
    #[error("gap {gap_m} m does not occur in the envelope, which has {min_m} to {max_m} m there")]
    Gap {
        /// The gap (m).
        gap_m: f32,
        /// Minimum gap under this load (m).
        min_m: f32,
        /// Maximum gap under this load (m).
        max_m: f32,
    },
}

/// One lookup of the search: the twist, the gap there, and ∂θ/∂G.
#[derive(Clone, Copy)]
struct Trial {
    twist_rad: f32,
    gap_m: f32,
    slope: f32,
}

/// The search for the twist at which the gap is `gap_m`: inverse cubic interpolation through the last two trials and
/// their slopes (Newton's method from the first), inside a bracket that only shrinks.
struct Search {
    gap_m: f32,
    tolerance_m: f32,
    low: f32,
    high: f32,
    /// Whether each end of the bracket is still that of the range, where no lookup has been made.
    untried: [bool; 2],
    last: Option<Trial>,
}

impl Search {
    /// The twist to try after `trial`; `None` if `trial` is the solution or the bracket has no number left inside.
    #[inline]
    fn after(&mut self, trial: Trial) -> Option<f32> {
        let error = trial.gap_m - self.gap_m;
        // NaN fails this comparison and ends in the bracket below.
        if error.abs() <= self.tolerance_m {
            return None;
        }
        if error > 0.0 {
            (self.low, self.untried[0]) = (trial.twist_rad, false);
        } else {
            (self.high, self.untried[1]) = (trial.twist_rad, false);
        }
        let mut next = trial.twist_rad - error * trial.slope;
        if let Some(last) = self.last {
            let h = last.gap_m - trial.gap_m;
            let secant = (last.twist_rad - trial.twist_rad) / h;
            let cubic = (trial.slope + last.slope - 2.0 * secant) / h;
            // The cubic through both trials, evaluated −error away from this one; the last one is h away.
            next += error * error * ((secant - trial.slope) - cubic * (error + h)) / h;
        }
        self.last = Some(trial);
        // Outside the bracket: its end, if that has not been tried, else the middle.
        if !(next > self.low && next < self.high) {
            next = if next <= self.low && self.untried[0] {
                self.low
            } else if next >= self.high && self.untried[1] {
                self.high
            } else {
                0.5 * (self.low + self.high)
            };
        }
        (next != trial.twist_rad).then_some(next)
    }
}

impl Table<'_> {
    /// The twist at which the mechanism under `load_n` has the gap `gap_m` (rad).
    ///
    /// # Errors
    /// [`InverseError`] naming what is outside.
    pub fn twist_from_gap(&self, load_n: f32, gap_m: f32) -> Result<f32, InverseError> {
        let m = &self.metadata;
        let load_n = self.load_inside(load_n)?;
        let at = |twist_rad| self.series.evaluate(load_n, twist_rad);
        // Far below the certificate's error, above the resolution of f32.
        let resolved = 4.0 * f32::EPSILON * gap_m;
        let wanted = m.contraction_error_m * (1.0 / 32.0);
        let mut search = Search {
            gap_m,
            tolerance_m: if wanted > resolved { wanted } else { resolved },
            low: m.twist_min_rad,
            high: m.twist_max_rad,
            untried: [true, true],
            last: None,
        };
        let mut twist_rad = m.twist_min_rad + 0.6 * (m.twist_max_rad - m.twist_min_rad);
        let mut point = at(twist_rad);
        for _ in 0..MAX_STEPS {
            let trial = Trial { twist_rad, gap_m: point.gap_m, slope: 1.0 / point.dgap_dtwist_m_per_rad };
            let Some(next) = search.after(trial) else { break };
            twist_rad = next;
            point = at(twist_rad);
        }
        // At an end of the range the gap may still be outside; NaN fails this comparison too.
        if (point.gap_m - gap_m).abs() <= 2.0 * m.contraction_error_m {
            return Ok(twist_rad);
        }
        Err(InverseError::Gap { gap_m, min_m: at(m.twist_max_rad).gap_m, max_m: at(m.twist_min_rad).gap_m })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::example::{COEFFICIENTS, METADATA, PATCHES};
    use std::cell::Cell;

    fn table() -> Table<'static> {
        let metadata = crate::Metadata { twist_max_rad: 80.0, ..METADATA };
        Table { metadata, ..crate::table::example::table(&PATCHES, &COEFFICIENTS) }
    }

    /// Lookups of the search for a gap, and where it ends.
    fn search(gap: impl Fn(f32) -> [f32; 2], gap_m: f32, [low, high]: [f32; 2]) -> (u32, f32) {
        let mut search = Search { gap_m, tolerance_m: 1e-7, low, high, untried: [true, true], last: None };
        let mut twist_rad = low + 0.6 * (high - low);
        let tried = Cell::new(0);
        while tried.get() < 100 {
            tried.set(tried.get() + 1);
            let [at, by_twist] = gap(twist_rad);
            let Some(next) = search.after(Trial { twist_rad, gap_m: at, slope: 1.0 / by_twist }) else { break };
            assert!((low..=high).contains(&next), "{next} is outside the range");
            twist_rad = next;
        }
        (tried.get(), twist_rad)
    }

    #[test]
    fn every_gap_of_the_range_is_found_within_a_fraction_of_the_table_s_error() {
        let t = table();
        for i in 0..=15 {
            for j in 0..=60 {
                let (load_n, twist_rad) = (1.0 + i as f32, 3.0 + 77.0 * j as f32 / 60.0);
                let point = t.look_up(load_n, twist_rad).unwrap();
                let found = t.twist_from_gap(load_n, point.gap_m).unwrap();
                let off_m = (found - twist_rad) * point.dgap_dtwist_m_per_rad;
                assert!(off_m.abs() < 5e-7, "{off_m:e} m at {load_n} N, {twist_rad} rad");
            }
        }
    }

    #[test]
    fn a_step_out_of_the_bracket_goes_to_its_untried_end_and_then_to_its_middle() {
        let search = |gap_m, untried| Search { gap_m, tolerance_m: 1e-7, low: 0.0, high: 40.0, untried, last: None };
        let trial = |twist_rad, gap_m, slope| Trial { twist_rad, gap_m, slope };
        let mut above = search(0.2, [true, true]);
        assert_eq!(above.after(trial(24.0, 0.076, -1e3)), Some(0.0));
        assert_eq!(above.after(trial(0.0, 0.1, -1e3)), None, "it is no better there");
        assert_eq!(search(0.01, [true, true]).after(trial(24.0, 0.076, -1e3)), Some(40.0));
        // The bracket is what the trial left of the range.
        assert_eq!(search(0.05, [false, false]).after(trial(10.0, 0.09, -1e6)), Some(25.0));
        assert_eq!(search(0.09, [false, false]).after(trial(10.0, 0.05, -1e6)), Some(5.0));
        // A step that meets a tried end exactly would find there what is known already.
        assert_eq!(search(0.5, [false, false]).after(trial(8.0, 0.25, -32.0)), Some(4.0));
        assert_eq!(search(0.25, [false, false]).after(trial(32.0, 0.5, -32.0)), Some(36.0));
        assert_eq!(search(0.05, [true, true]).after(trial(10.0, f32::NAN, -1e3)), Some(5.0), "NaN counts as too small");
        assert_eq!(search(0.05, [true, true]).after(trial(10.0, 0.05, -1e3)), None, "found");
    }

    #[test]
    fn the_search_ends_in_few_lookups() {
        // A cubic through two trials is exact here: Newton's step, the cubic's, and the one that meets the tolerance.
        let cubic = |gap: f32| 20.0 - 300.0 * gap - 900.0 * gap * gap * gap;
        let by_gap = |gap: f32| -300.0 - 2700.0 * gap * gap;
        // The gap at a twist, by bisection in f64.
        let gap_at = |twist: f32| {
            let (mut low, mut high) = (-0.1f64, 0.1f64);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                let at = 20.0 - 300.0 * middle - 900.0 * middle.powi(3);
                if at > f64::from(twist) { low = middle } else { high = middle }
            }
            low as f32
        };
        for wanted_m in [-0.05f32, -0.01, 0.02, 0.05] {
            let (tried, found) = search(|twist| [gap_at(twist), 1.0 / by_gap(gap_at(twist))], wanted_m, [0.0, 40.0]);
            assert!((found - cubic(wanted_m)).abs() < 1e-4, "{wanted_m} m: {found} rad");
            assert!(tried <= 3, "{tried} lookups for {wanted_m} m");
        }
        // At the ends of the range, which are tried themselves.
        let line = |twist: f32| [0.1 - 1e-3 * twist, -1e-3];
        for (gap_m, end) in [(0.1, 0.0), (0.06, 40.0)] {
            let (tried, found) = search(line, gap_m, [0.0, 40.0]);
            assert!(tried == 2 && (found - end).abs() < 1e-4, "{gap_m} m: {found} rad after {tried}");
        }
        // Beyond them it ends at the end.
        for (gap_m, end) in [(0.2, 0.0), (0.01, 40.0)] {
            let (tried, found) = search(line, gap_m, [0.0, 40.0]);
            assert!(tried <= 30 && (found - end).abs() < 1e-4, "{gap_m} m: {found} rad after {tried}");
        }
        // A slope that is wrong by far, as that of a broken table, costs steps, but the bracket closes.
        let wrong = |twist: f32| [0.1 - 1e-3 * twist, -1e-7];
        let (tried, found) = search(wrong, 0.09, [0.0, 40.0]);
        assert!(tried < 40 && (found - 10.0).abs() < 1e-2, "{found} rad after {tried}");
    }

    #[test]
    fn a_gap_that_does_not_occur_is_refused_with_those_that_do() {
        let t = table();
        let [min, max] = [80.0, 3.0].map(|twist| t.look_up(5.0, twist).unwrap().gap_m);
        let error_m = t.metadata.contraction_error_m;
        for gap_m in [min - 3.0 * error_m, max + 3.0 * error_m, 0.0, f32::NAN] {
            let Err(InverseError::Gap { min_m, max_m, .. }) = t.twist_from_gap(5.0, gap_m) else { panic!("{gap_m}") };
            assert_eq!([min_m, max_m], [min, max]);
        }
        // As far as the table may be wrong, the end of the range is the answer.
        for (gap_m, end) in [(min - 1.5 * error_m, 80.0), (max + 1.5 * error_m, 3.0)] {
            assert!((t.twist_from_gap(5.0, gap_m).unwrap() - end).abs() < 1e-3);
        }
        assert!(matches!(t.twist_from_gap(0.5, min), Err(InverseError::Load(_))));
    }
}
