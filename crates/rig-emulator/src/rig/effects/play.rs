//! The play operator: the output follows the input at a distance of at most half the play.

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
    fn without_a_width_the_output_is_the_input() {
        let mut play = Play::new(0.0, 3.0);
        assert_eq!([1.0, -2.0, 0.5].map(|input| play.step(input)), [1.0, -2.0, 0.5]);
    }
}
