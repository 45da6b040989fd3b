//! Inverses of the table, in a bounded number of steps.
//!
//! The gap rises with the load and falls with the twist over the whole envelope (the certificate checks it), so both
//! inverses are single roots: inverse interpolation inside a bracket that only shrinks.

use crate::lookup::{OutOfRange, Point, Table};

/// Steps after which an inverse stops, whatever it has reached.
pub const MAX_STEPS: u32 = 24;

/// Why there is no inverse.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InverseError {
    /// The given load or twist is outside the table.
    #[error(transparent)]
    Given(#[from] OutOfRange),
    /// The gap does not occur in the envelope at the given load or twist.
    #[error("gap {gap_m} m does not occur in the envelope, which has {min_m} to {max_m} m there")]
    Gap {
        /// The gap (m).
        gap_m: f32,
        /// Least gap there (m).
        min_m: f32,
        /// Greatest gap there (m).
        max_m: f32,
    },
}

/// The load that explains a twist and a gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadFromGap {
    /// The load (N).
    pub load_n: f32,
    /// The table there; its ∂G/∂F says how much an error of the gap is worth in load.
    pub point: Point,
}

/// Where a search has looked: the coordinate, the gap there, and the coordinate's slope by the gap.
#[derive(Clone, Copy)]
struct Seen {
    at: f32,
    gap_m: f32,
    slope: f32,
}

/// The search for the coordinate at which the gap is `gap_m`: inverse cubic interpolation through the last two points
/// and their slopes (Newton from the first), inside a bracket that only shrinks.
struct Search {
    gap_m: f32,
    tolerance_m: f32,
    rising: bool,
    low: f32,
    high: f32,
    /// Whether an end is still that of the envelope, where the gap has not been looked at.
    fresh: [bool; 2],
    last: Option<Seen>,
}

impl Search {
    /// Where to look after `seen`; nothing if that is the place, or there is nowhere left.
    #[inline]
    fn after(&mut self, seen: Seen) -> Option<f32> {
        let error = seen.gap_m - self.gap_m;
        // Written so that NaN goes on, and finds nowhere left.
        if error.abs() <= self.tolerance_m {
            return None;
        }
        if (error > 0.0) == self.rising {
            (self.high, self.fresh[1]) = (seen.at, false);
        } else {
            (self.low, self.fresh[0]) = (seen.at, false);
        }
        let mut next = seen.at - error * seen.slope;
        if let Some(last) = self.last {
            let h = last.gap_m - seen.gap_m;
            let secant = (last.at - seen.at) / h;
            let cubic = (seen.slope + last.slope - 2.0 * secant) / h;
            // From `seen`, along −error; h is the way back to `last`.
            next += error * error * ((secant - seen.slope) - cubic * (error + h)) / h;
        }
        self.last = Some(seen);
        // Outside: the envelope's end, once; then halving.
        if !(next > self.low && next < self.high) {
            next = if next <= self.low && self.fresh[0] {
                self.low
            } else if next >= self.high && self.fresh[1] {
                self.high
            } else {
                0.5 * (self.low + self.high)
            };
        }
        (next != seen.at).then_some(next)
    }
}

impl Table<'_> {
    fn search(&self, gap_m: f32, rising: bool, low: f32, high: f32) -> Search {
        // Far below the certificate's error, above what f32 resolves.
        let resolved = 4.0 * f32::EPSILON * gap_m;
        let wanted = self.metadata.contraction_error_m * (1.0 / 32.0);
        let tolerance_m = if wanted > resolved { wanted } else { resolved };
        Search { gap_m, tolerance_m, rising, low, high, fresh: [true, true], last: None }
    }

    /// The load at which the mechanism, twisted by `twist_rad`, has the gap `gap_m` (model.md section 4): the rods and
    /// strings as the rig's own load cell.
    ///
    /// # Errors
    /// [`InverseError`] naming what is outside.
    pub fn load_from_gap(&self, twist_rad: f32, gap_m: f32) -> Result<LoadFromGap, InverseError> {
        let m = &self.metadata;
        let twist_rad = self.twist_inside(twist_rad)?;
        let mut search = self.search(gap_m, true, m.load_min_n, m.load_max_n);
        // The gap bends most at the light end.
        let mut load_n = m.load_min_n + 0.15 * (m.load_max_n - m.load_min_n);
        let mut point = self.evaluate(load_n, twist_rad);
        for _ in 0..MAX_STEPS {
            let seen = Seen { at: load_n, gap_m: point.gap_m, slope: 1.0 / point.dgap_dload_m_per_n };
            let Some(next) = search.after(seen) else { break };
            load_n = next;
            point = self.evaluate(load_n, twist_rad);
        }
        // At an end of the envelope the gap may still be outside, as NaN is everywhere.
        if (point.gap_m - gap_m).abs() <= 2.0 * m.contraction_error_m {
            return Ok(LoadFromGap { load_n, point });
        }
        let at = |load_n| self.evaluate(load_n, twist_rad).gap_m;
        Err(InverseError::Gap { gap_m, min_m: at(m.load_min_n), max_m: at(m.load_max_n) })
    }

    /// The twist at which the mechanism under `load_n` has the gap `gap_m` (rad).
    ///
    /// # Errors
    /// [`InverseError`] naming what is outside.
    pub fn twist_from_gap(&self, load_n: f32, gap_m: f32) -> Result<f32, InverseError> {
        let m = &self.metadata;
        let load_n = self.load_inside(load_n)?;
        let mut search = self.search(gap_m, false, m.twist_min_rad, m.twist_max_rad);
        let mut twist_rad = m.twist_min_rad + 0.6 * (m.twist_max_rad - m.twist_min_rad);
        let mut point = self.evaluate(load_n, twist_rad);
        for _ in 0..MAX_STEPS {
            let seen = Seen { at: twist_rad, gap_m: point.gap_m, slope: 1.0 / point.dgap_dtwist_m_per_rad };
            let Some(next) = search.after(seen) else { break };
            twist_rad = next;
            point = self.evaluate(load_n, twist_rad);
        }
        if (point.gap_m - gap_m).abs() <= 2.0 * m.contraction_error_m {
            return Ok(twist_rad);
        }
        let at = |twist_rad| self.evaluate(load_n, twist_rad).gap_m;
        Err(InverseError::Gap { gap_m, min_m: at(m.twist_max_rad), max_m: at(m.twist_min_rad) })
    }
}
