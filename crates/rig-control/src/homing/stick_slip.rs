//! How far the load jumps when it breaks loose from stiction, from a motion at a steady speed.
//!
//! Over a time that is shorter than the load stands between two jumps, its way is mostly nothing and sometimes a whole jump
//! J. With the mean way m in that time, jumps come with the probability m/J, so that the mean square of the way is J m. Of a smooth motion it is m².

/// Ticks over which the way is taken.
const TICKS: usize = 10;
/// Mean ways that a smooth motion, whose speed varies, may seem to jump by at most.
const SMOOTH: f32 = 1.75;

/// Ways of the gap during a motion.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StickSlip {
    last_m: [f32; TICKS],
    seen: usize,
    count: f32,
    sum_m: f32,
    squares_m2: f32,
}

impl StickSlip {
    /// One tick's gap (m).
    pub(super) fn add(&mut self, gap_m: f32) {
        let place = self.seen % TICKS;
        if self.seen >= TICKS {
            let distance_m = (gap_m - self.last_m[place]).abs();
            self.count += 1.0;
            self.sum_m += distance_m;
            self.squares_m2 += distance_m * distance_m;
        }
        self.last_m[place] = gap_m;
        self.seen += 1;
    }

    /// Begins another motion.
    pub(super) fn turn(&mut self) {
        self.seen = 0;
    }

    /// The jump (m), at least, under a noise of the gap (m, rms) in each tick; 0 where the load slides smoothly.
    pub(super) fn jump_m(&self, noise_m: f32) -> f32 {
        let mean_m = self.sum_m / self.count.max(1.0);
        let squares_m2 = self.squares_m2 / self.count.max(1.0) - 2.0 * noise_m * noise_m;
        let jump_m = squares_m2 / mean_m;
        if jump_m > SMOOTH * mean_m { jump_m } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gaps of a load that rises by 2 mm/s.
    fn jump_of(gap: impl Fn(f32) -> f32) -> f32 {
        let mut motion = StickSlip::default();
        (0..1000u16).for_each(|k| motion.add(gap(0.01 * f32::from(k))));
        motion.turn();
        (0..1000u16).for_each(|k| motion.add(-gap(0.01 * f32::from(k))));
        motion.jump_m(0.0)
    }

    #[test]
    fn a_load_that_stands_and_jumps_shows_its_jump() {
        for jump_m in [0.5e-3f32, 1e-3] {
            let found_m = jump_of(|t| jump_m * (2e-3 * t / jump_m).floor());
            assert!((found_m / jump_m - 1.0).abs() < 0.15, "{found_m} of {jump_m}");
        }
    }

    #[test]
    fn the_noise_of_both_ends_of_a_way_is_no_jump() {
        let mut motion = StickSlip::default();
        (0..2000u16).for_each(|k| motion.add(0.5e-3 * libm::floorf(0.04 * f32::from(k))));
        // 2 n² over the mean way, which is 0.2 mm in ten ticks.
        let taken_m = motion.jump_m(0.0) - motion.jump_m(0.1e-3);
        assert!((taken_m / (2e-8 / 0.2e-3) - 1.0).abs() < 0.05, "{taken_m}");
    }

    #[test]
    fn a_smooth_motion_has_none() {
        assert_eq!(jump_of(|t| 2e-3 * t), 0.0);
        assert_eq!(jump_of(|t| 2e-3 * t + 1e-4 * (0.5 * t).sin()), 0.0);
        assert_eq!(StickSlip::default().jump_m(1e-5), 0.0);
    }
}
