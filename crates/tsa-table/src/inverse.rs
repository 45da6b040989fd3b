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
        /// Least gap under this load (m).
        min_m: f32,
        /// Greatest gap under this load (m).
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
