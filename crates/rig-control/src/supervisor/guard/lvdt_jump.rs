//! A step of the LVDT that no load makes: the sensor, its core or its conditioner has shifted.
//!
//! A load on elastic strings swings. Even the lightest on strings at the half-turn pre-twist takes at least 30 ms for half of its
//! oscillation, after which friction can stop it. If it moves a millimetre within 20 ms, it also moves before or after that. A gap that goes on as
//! before, steps, and goes on as before is the sensor's doing.
//! A smaller or slower shift looks like another load (`load-unknown`).

/// Minimum step (m) within [`STEP_TICKS`]: farther than any motor moves the load in a tick.
pub(super) const JUMP_M: f32 = 1.0e-3;
/// Blocks of samples are 6 ms long: a step within one is spread over two ticks at most. As many ticks without a reading may lie
/// between, because the block in which the step falls is too noisy to be a position.
pub(super) const STEP_TICKS: usize = 2;
/// Ticks before and after the step in which the gap must go on evenly, as a motor moves it.
const CALM_TICKS: usize = 3;
/// The step is at least this many times the way in the calm ticks, both less what an even motion does: all of it, because an
/// oscillation about its turning point comes back to where it was. Half an oscillation of 30 ms has less.
const CLEAR_FACTOR: f32 = 5.0;

/// The last gaps.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LvdtJump {
    /// Oldest first (m).
    gaps_m: [f32; 2 * CALM_TICKS + STEP_TICKS + 1],
    count: usize,
    missing: usize,
}

impl LvdtJump {
    /// One tick's gap (m), if there is one; whether it stepped [`CALM_TICKS`] ago.
    pub(super) fn step(&mut self, gap_m: Option<f32>) -> bool {
        let Some(gap_m) = gap_m else {
            self.missing = self.missing.saturating_add(1);
            if self.missing > STEP_TICKS {
                self.count = 0;
            }
            return false;
        };
        self.missing = 0;
        self.gaps_m.rotate_left(1);
        let all = self.gaps_m.len();
        self.gaps_m[all - 1] = gap_m;
        self.count = (self.count + 1).min(all);
        let (before, after) = (&self.gaps_m[..=CALM_TICKS], &self.gaps_m[CALM_TICKS + STEP_TICKS..]);
        let moves_m = || before.windows(2).chain(after.windows(2)).map(|pair| pair[1] - pair[0]);
        let even_m = moves_m().sum::<f32>() / (2 * CALM_TICKS) as f32;
        let uneven_m: f32 = moves_m().map(|m| (m - even_m).abs()).sum();
        let step_m = (after[0] - before[CALM_TICKS] - STEP_TICKS as f32 * even_m).abs();
        let jumped = self.count == all && step_m > JUMP_M.max(CLEAR_FACTOR * uneven_m);
        if jumped {
            self.count = 0;
        }
        jumped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks at which a gap over time (tick to m) shows a jump.
    fn jumps(gap: impl Fn(f32) -> f32) -> usize {
        let mut jump = LvdtJump::default();
        (0..400u16).filter(|k| jump.step(Some(gap(f32::from(*k))))).count()
    }

    #[test]
    fn a_step_of_the_sensor_is_seen_at_rest_and_in_motion() {
        for step_m in [-5e-3, -1.2e-3, 1.2e-3, 5e-3] {
            assert_eq!(jumps(|k| 0.08 + if k >= 100.0 { step_m } else { 0.0 }), 1, "{step_m}");
            // Spread over two blocks, in a move of 20 mm/s.
            let ramp = |k: f32| ((k - 99.4) / 1.2).clamp(0.0, 1.0);
            assert_eq!(jumps(|k| 0.08 - 0.2e-3 * k + 5.0 * step_m * ramp(k)), 1, "{step_m} in motion");
        }
        assert_eq!(jumps(|k| 0.08 + if k >= 100.0 { 0.9e-3 } else { 0.0 }), 0, "too small to tell");
    }

    #[test]
    fn a_load_that_steps_swings_or_falls_is_none() {
        // Every swing from heavy loads on twisted strings to light ones on untwisted strings, hardly damped, from a step of the
        // load by 5 mm at any time between two ticks.
        for frequency in 15..=125u16 {
            for begin in [100.0, 100.25, 100.5, 100.75] {
                let oscillation = |k: f32| {
                    let t = ((k - begin) * 0.01).max(0.0);
                    0.08 + 5e-3 * (1.0 - (-1.5 * t).exp() * (f32::from(frequency) * t).cos())
                };
                assert_eq!(jumps(oscillation), 0, "{frequency} rad/s");
            }
        }
        // A load that has become lighter at once, and that friction stops after half an oscillation of 30 ms or more.
        for (half_ms, begin) in (30..=60u8).flat_map(|half_ms| (0..20u8).map(move |begin| (half_ms, begin))) {
            let (half, begin) = (0.1 * f32::from(half_ms), 100.0 + 0.05 * f32::from(begin));
            let stopped =
                |k: f32| 0.08 - 2e-3 * (1.0 - (core::f32::consts::PI * ((k - begin) / half).clamp(0.0, 1.0)).cos());
            assert_eq!(jumps(stopped), 0, "{half_ms} ms");
        }
        // A fall to the stop, 5 cm lower.
        let fall = |k: f32| {
            let t = ((k - 100.0) * 0.01).max(0.0);
            0.08 + (4.9 * t * t).min(0.05)
        };
        assert_eq!(jumps(fall), 0);
        let mut jump = LvdtJump::default();
        (0..20).for_each(|_| assert!(!jump.step(Some(0.08))));
        (0..3).for_each(|_| assert!(!jump.step(None)));
        (0..20).for_each(|_| assert!(!jump.step(Some(0.12)), "what came before a gap in the readings says nothing"));
        // The block of the step itself is too noisy to be read.
        assert!(!jump.step(None));
        assert_eq!((0..20).filter(|_| jump.step(Some(0.08))).count(), 1);
    }
}
