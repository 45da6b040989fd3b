//! Whether the gap rises towards its maximum as strings that untwist make it, or ever faster as a reversed LVDT shows it.

use crate::observer::TRAVEL_M;

/// Turn (rad) over which the rise of the gap is measured, and how often in a row it must have grown, by more in all than friction can
/// hold back ([`TRAVEL_M`]), to show a reversed LVDT.
const RISE_WINDOW_RAD: f32 = 4.0;
const RISE_WINDOWS: u8 = 3;

/// How the gap rises towards its supposed maximum. It rises ever more slowly, because it is concave in the twist
/// (docs/explanation/model.md 2); with a reversed LVDT the strings are twisted further instead of untwisted, and it
/// seems to rise ever faster.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rises {
    /// Shaft angle (rad) and gap (m) where the present window began.
    from: Option<[f32; 2]>,
    /// Rise in the last window, and in the first of those that have grown since (m).
    last_m: f32,
    first_m: f32,
    /// How many windows in a row have risen more than the one before.
    growing: u8,
}

impl Rises {
    /// One tick of a gap that rises; whether it rises ever faster.
    pub(super) fn step(&mut self, shaft_rad: f32, gap_m: f32) -> bool {
        let [from_rad, from_m] = *self.from.get_or_insert([shaft_rad, gap_m]);
        if (shaft_rad - from_rad).abs() < RISE_WINDOW_RAD {
            return false;
        }
        let rise_m = gap_m - from_m;
        // The present window does not count: below the half-turn pre-twist the strings open, and the gap rises by far more.
        let reversed = self.growing >= RISE_WINDOWS && self.last_m > self.first_m + TRAVEL_M;
        self.from = Some([shaft_rad, gap_m]);
        if self.last_m > 0.0 && rise_m > self.last_m {
            self.growing += 1;
        } else {
            (self.growing, self.first_m) = (0, rise_m);
        }
        self.last_m = rise_m;
        reversed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns (rad) after which the gap is taken for that of a reversed LVDT, if it is within 40 rad.
    fn reversed_after(gap_m: fn(f32) -> f32) -> Option<f32> {
        let mut rises = Rises::default();
        (0..4000).map(|k| 0.01 * k as f32).find(|rad| rises.step(*rad, gap_m(*rad)))
    }

    #[test]
    fn a_gap_that_rises_ever_faster_is_a_reversed_sensors() {
        // Near zero twist the gap is a parabola: strings that untwist from 40 rad, and a reversed sensor from 3 rad on.
        assert_eq!(reversed_after(|rad| -6e-6 * (40.0 - rad) * (40.0 - rad)), None);
        let after = reversed_after(|rad| 6e-6 * (3.0 + rad) * (3.0 + rad)).expect("it rises ever faster");
        assert!((19.9..20.2).contains(&after), "after the fifth window of 4 rad: {after}");
        // A first stretch in which friction holds the load back is followed by even ones.
        assert_eq!(reversed_after(|rad| 3e-4 * (rad - 3.0).max(0.0)), None);
        // Thin strings raise the load so little that each window may have a step of stick-slip more or less.
        assert_eq!(reversed_after(|rad| 0.5e-6 * (3.0 + rad) * (3.0 + rad)), None);
    }

    #[test]
    fn strings_that_open_below_the_half_turn_are_no_reversed_sensor() {
        // Rises (mm) of 0.13 and 1.5 kg on two emulated hard rigs: stick-slip, then the last half turn.
        for rises_mm in [[1.83, 1.31, 1.51, 1.59, 2.06], [1.54, 0.88, 1.07, 1.14, 1.56]] {
            let mut rises = Rises::default();
            let mut gap_mm = 80.0;
            assert!(!rises.step(0.0, 1e-3 * gap_mm));
            for (k, rise_mm) in rises_mm.into_iter().enumerate() {
                gap_mm += rise_mm;
                assert!(!rises.step(4.01 * (k + 1) as f32, 1e-3 * gap_mm), "{rises_mm:?}");
            }
        }
    }
}
