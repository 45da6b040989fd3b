//! Whether the load hangs still.

use crate::observer::SETTLED_TICKS;
use crate::sensors::LVDT_COUNT_M;

/// Minimum and maximum gap (m) since some ticks; `None` before the first one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quiet {
    ticks: u16,
    range_m: Option<[f32; 2]>,
}

impl Quiet {
    /// Takes the smoothed gap (m) of a tick; whether the load is quiet.
    pub(super) fn step(&mut self, gap_m: f32) -> bool {
        let [low_m, high_m] = self.range_m.unwrap_or([gap_m; 2]);
        let [low_m, high_m] = [low_m.min(gap_m), high_m.max(gap_m)];
        // Within two counts over an oscillation. The noise of one reading would be larger than what is left of it by smoothing.
        if high_m - low_m > 2.0 * LVDT_COUNT_M {
            *self = Self::default();
            return false;
        }
        (self.ticks, self.range_m) = (self.ticks + 1, Some([low_m, high_m]));
        self.ticks > SETTLED_TICKS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Time (s) until a gap is quiet, smoothed as homing does.
    fn quiet_after_s(gap: impl Fn(f32) -> f32) -> Option<f32> {
        let (mut quiet, mut smooth_m) = (Quiet::default(), gap(0.0));
        (1..1000u16).map(|k| 0.01 * f32::from(k)).find(|t| {
            smooth_m += crate::homing::SMOOTHING * (gap(*t) - smooth_m);
            quiet.step(smooth_m)
        })
    }

    #[test]
    fn noise_is_no_oscillation() {
        // Three incommensurable frequencies far above any oscillation: 45 um rms, 190 um from peak to peak.
        let noise = |t: f32| 37e-6 * ((191.0 * t).sin() + (233.0 * t).sin() + (307.0 * t).sin());
        assert!(quiet_after_s(|t| 0.1 + noise(t)).is_some_and(|s| s < 0.5));
    }

    #[test]
    fn a_swing_is_waited_for() {
        for frequency in [8.0f32, 20.0, 60.0] {
            let oscillation = |t: f32| 0.1 + 0.3e-3 * (-0.5 * t).exp() * (frequency * t).cos();
            let seconds = quiet_after_s(oscillation).expect("it calms down");
            let left_m = 0.3e-3 * (-0.5 * seconds).exp();
            assert!(left_m < 0.15e-3 && seconds > 1.0, "{frequency} rad/s: {seconds} s, {left_m} m");
        }
        assert_eq!(quiet_after_s(|t| 0.1 + 0.3e-3 * (20.0 * t).cos()), None);
    }
}
