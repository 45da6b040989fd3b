//! The drive's supply rail. While the relay is closed the supply holds it; while it is open a motor that brakes charges the
//! rail's capacitor, and the drive lives on it.
//!
//! Assumed: the capacitor, what the drive itself takes, and that the supply absorbs what the motor gives back while it is
//! connected.

/// Capacitance of the drive's input, F.
const CAPACITANCE_F: f64 = 470e-6;
/// What the drive takes without motor current, W.
const DRIVE_W: f64 = 1.0;
/// Voltage at which the clamp at the drive takes all that comes, V (docs/how-to/build.md).
const CLAMP_V: f64 = 36.0;
/// Above this the drive is destroyed, V (docs/reference/hardware.md 1).
pub const DESTROYED_V: f64 = 58.0;

/// The rail.
#[derive(Clone, Copy, Debug)]
pub struct Rail {
    volts: f64,
    destroyed: bool,
    /// A clamp is fitted.
    pub clamped: bool,
}

impl Rail {
    /// At a voltage, with a clamp.
    pub fn at(volts: f64) -> Self {
        Self { volts, destroyed: false, clamped: true }
    }

    /// `h` seconds in which the motor takes so much power (W; negative: it gives power back). `supply_v` is that of a supply which
    /// is connected.
    pub fn step(&mut self, h: f64, supply_v: Option<f64>, motor_w: f64) {
        self.volts = supply_v.unwrap_or_else(|| {
            let energy_j = 0.5 * CAPACITANCE_F * self.volts * self.volts - h * (motor_w + DRIVE_W);
            let volts = (2.0 * energy_j.max(0.0) / CAPACITANCE_F).sqrt();
            if self.clamped { volts.min(CLAMP_V) } else { volts }
        });
        self.destroyed |= self.volts > DESTROYED_V;
    }

    /// Voltage, V.
    pub fn volts(&self) -> f64 {
        self.volts
    }

    /// Whether it was once above [`DESTROYED_V`].
    pub fn has_destroyed(&self) -> bool {
        self.destroyed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_energy_that_the_motor_gives_back_is_in_the_capacitor() {
        let mut rail = Rail { clamped: false, ..Rail::at(24.0) };
        // 0.3 J in 10 ms, of which the drive takes 10 mJ.
        (0..40).for_each(|_| rail.step(2.5e-4, None, -30.0));
        let expected = (24.0f64.powi(2) + 2.0 * 0.29 / CAPACITANCE_F).sqrt();
        assert!((rail.volts() - expected).abs() < 1e-9 && !rail.has_destroyed(), "{}", rail.volts());
        (0..400).for_each(|_| rail.step(2.5e-4, None, -30.0));
        assert!(rail.has_destroyed());
        let mut clamped = Rail::at(24.0);
        (0..440).for_each(|_| clamped.step(2.5e-4, None, -30.0));
        assert!(clamped.volts() == CLAMP_V && !clamped.has_destroyed());
        clamped.step(2.5e-4, Some(24.0), -30.0);
        assert_eq!(clamped.volts(), 24.0);
    }

    #[test]
    fn without_a_supply_the_drive_lives_on_the_capacitor_for_a_tenth_of_a_second() {
        let mut rail = Rail::at(24.0);
        let steps = (0..).take_while(|_| {
            rail.step(2.5e-4, None, 0.0);
            rail.volts() > super::super::drive::MIN_SUPPLY_V
        });
        let lives_s = 2.5e-4 * steps.count() as f64;
        assert!((lives_s - 0.5 * CAPACITANCE_F * (576.0 - 100.0) / DRIVE_W).abs() < 1e-3, "{lives_s} s");
    }
}
