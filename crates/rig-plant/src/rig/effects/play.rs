//! The play operator: the output follows the input at a distance of at most half the play.
//!
//! What pulls at the output reaches the input only where the two touch, at either end of the play. If it did in between,
//! where the output stands, it would do work on the input for nothing.

/// Share of half the play over which the contact gives. Assumed.
const CONTACT: f64 = 0.02;

/// Play between an input and an output, in the unit of both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Play {
    half_width: f64,
    output: f64,
}

impl Play {
    /// Play of a whole width, its output in the middle at `at`.
    pub fn new(width: f64, at: f64) -> Self {
        Self { half_width: 0.5 * width, output: at }
    }

    /// Takes the input to a new value and returns the output.
    pub fn step(&mut self, input: f64) -> f64 {
        self.output = self.output.clamp(input - self.half_width, input + self.half_width);
        self.output
    }

    /// Share of a pull at the output that reaches the input: 1 at the ends of the play, 0 between them. It rises over
    /// A share of half the play, as a contact that gives: its rise at one end takes what its rise at the other gives.
    pub fn contact(&self, input: f64) -> f64 {
        if self.half_width <= 0.0 {
            return 1.0;
        }
        let open = 1.0 - (input - self.output).abs() / self.half_width;
        (1.0 - open / CONTACT).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sweep_up_and_down_shows_a_loop_of_its_width() {
        let mut play = Play::new(0.2, 0.0);
        let up = (0..=100).map(|k| play.step(f64::from(k) * 0.01)).last().unwrap();
        assert!((up - 0.9).abs() < 1e-12, "{up}");
        assert!((play.step(0.85) - 0.9).abs() < 1e-12, "within the play the output stands");
        let half_way_down = play.step(0.5);
        assert!((half_way_down - 0.6).abs() < 1e-12, "{half_way_down}: 0.2 above the way up");
    }

    #[test]
    fn a_pull_reaches_the_input_at_the_ends_only_and_gives_no_work_in_a_loop() {
        let mut play = Play::new(0.2, 0.0);
        let (mut work, mut last, mut shares) = (0.0, 0.0, Vec::new());
        // From one end of the play's loop back to it, against a pull of -1.
        for k in 0..=40_000 {
            let input = f64::from(if k <= 20_000 { k } else { 40_000 - k }) * 1e-4;
            let before = play.contact(last);
            play.step(input);
            if k > 10_000 {
                shares.push(play.contact(input));
            }
            work += 0.5 * (before + play.contact(input)) * (input - last);
            last = input;
        }
        let standing = shares.iter().filter(|share| **share == 0.0).count() as f64 * 1e-4;
        assert!((standing - 0.2 * (1.0 - CONTACT)).abs() < 1e-3, "{standing} of 0.2 without a pull");
        // The first way up starts in the middle of the play; a second loop is closed.
        let first = work;
        for k in 0..=40_000 {
            let input = f64::from(if k <= 20_000 { k } else { 40_000 - k }) * 1e-4;
            let before = play.contact(last);
            play.step(input);
            work += 0.5 * (before + play.contact(input)) * (input - last);
            last = input;
        }
        assert!((work - first).abs() < 1e-6, "{}", work - first);
    }

    #[test]
    fn without_a_width_the_output_is_the_input() {
        let mut play = Play::new(0.0, 3.0);
        assert_eq!([1.0, -2.0, 0.5].map(|input| play.step(input)), [1.0, -2.0, 0.5]);
    }
}
