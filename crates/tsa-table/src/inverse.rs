//! Inverses of the table, in a bounded number of steps.
//!
//! The gap rises with the load and falls with the twist over the whole envelope (the certificate checks it), so both
//! inverses are single roots: Newton inside a bracket that only shrinks.

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

impl Table<'_> {
    /// The load at which the mechanism, twisted by `twist_rad`, has the gap `gap_m` (model.md section 4): the rods and
    /// strings as the rig's own load cell.
    ///
    /// # Errors
    /// [`InverseError`] naming what is outside.
    pub fn load_from_gap(&self, twist_rad: f32, gap_m: f32) -> Result<LoadFromGap, InverseError> {
        let m = &self.metadata;
        let (mut low, mut high) = (m.load_min_n, m.load_max_n);
        let (at_low, at_high) = (self.look_up(low, twist_rad)?, self.look_up(high, twist_rad)?);
        let slack = 2.0 * m.contraction_error_m;
        if !(gap_m >= at_low.gap_m - slack && gap_m <= at_high.gap_m + slack) {
            return Err(InverseError::Gap { gap_m, min_m: at_low.gap_m, max_m: at_high.gap_m });
        }
        let twist_rad = twist_rad.clamp(m.twist_min_rad, m.twist_max_rad);
        // Softening with 1/F: the root lies nearer to the light end than a straight line says.
        let mut load_n = libm::sqrtf(low * high);
        let mut point = self.evaluate(load_n, twist_rad);
        for _ in 0..MAX_STEPS {
            let error = point.gap_m - gap_m;
            if error > 0.0 {
                high = load_n
            } else {
                low = load_n
            }
            // Newton in 1/F, in which the gap is closest to a straight line at light loads.
            let step = error / (point.dgap_dload_m_per_n * load_n);
            let newton = load_n / (1.0 + step);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            let moved = (next - load_n).abs();
            load_n = next;
            point = self.evaluate(load_n, twist_rad);
            if moved <= 1e-6 * load_n {
                break;
            }
        }
        Ok(LoadFromGap { load_n, point })
    }

    /// The twist at which the mechanism under `load_n` has the gap `gap_m` (rad).
    ///
    /// # Errors
    /// [`InverseError`] naming what is outside.
    pub fn twist_from_gap(&self, load_n: f32, gap_m: f32) -> Result<f32, InverseError> {
        let m = &self.metadata;
        let (mut low, mut high) = (m.twist_min_rad, m.twist_max_rad);
        let (at_low, at_high) = (self.look_up(load_n, low)?, self.look_up(load_n, high)?);
        let slack = 2.0 * m.contraction_error_m;
        if !(gap_m <= at_low.gap_m + slack && gap_m >= at_high.gap_m - slack) {
            return Err(InverseError::Gap { gap_m, min_m: at_high.gap_m, max_m: at_low.gap_m });
        }
        let load_n = load_n.clamp(m.load_min_n, m.load_max_n);
        let share = (at_low.gap_m - gap_m) / (at_low.gap_m - at_high.gap_m);
        let mut twist_rad = low + (high - low) * libm::sqrtf(share.clamp(0.0, 1.0));
        for _ in 0..MAX_STEPS {
            let point = self.evaluate(load_n, twist_rad);
            let error = point.gap_m - gap_m;
            if error > 0.0 {
                low = twist_rad
            } else {
                high = twist_rad
            }
            let newton = twist_rad - error / point.dgap_dtwist_m_per_rad;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            let moved = (next - twist_rad).abs();
            twist_rad = next;
            if moved <= 2e-7 * (high.abs() + 1.0) {
                break;
            }
        }
        Ok(twist_rad)
    }
}
