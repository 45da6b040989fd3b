//! The drive's reading of the motor's current: I' = q round((I + offset + noise) / q).

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// How the drive's current reading is wrong, A.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurrentReading {
    /// Offset.
    pub offset_a: f64,
    /// Noise of one reading, rms.
    pub noise_a: f64,
    /// Quantum; 0 for none.
    pub quantum_a: f64,
}

impl CurrentReading {
    /// What the drive reports of a current, A. Draws one number of the noise, whatever its size.
    pub fn read(&self, current_a: f64, noise: &mut Pcg64Mcg) -> f64 {
        let normal: f64 = StandardNormal.sample(noise);
        let shown_a = current_a + self.offset_a + self.noise_a * normal;
        if self.quantum_a > 0.0 { self.quantum_a * (shown_a / self.quantum_a).round() } else { shown_a }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_pcg::rand_core::SeedableRng;

    #[test]
    fn the_readings_lie_on_the_quantum_about_the_offset() {
        let reading = CurrentReading { offset_a: 5e-3, noise_a: 10e-3, quantum_a: 10e-3 };
        let mut noise = Pcg64Mcg::seed_from_u64(1);
        let readings: Vec<f64> = (0..20_000).map(|_| reading.read(0.0123, &mut noise)).collect();
        assert!(readings.iter().all(|r| ((r / 10e-3).round() - r / 10e-3).abs() < 1e-9));
        let mean = readings.iter().sum::<f64>() / readings.len() as f64;
        let rms = (readings.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / readings.len() as f64).sqrt();
        assert!((mean - 0.0173).abs() < 3e-4, "{mean}");
        // Sheppard: the quantum adds q²/12.
        assert!((rms - (1e-4f64 + 1e-4 / 12.0).sqrt()).abs() < 3e-4, "{rms}");
    }

    #[test]
    fn an_exact_reading_is_the_current_and_draws_the_same_numbers() {
        let (mut one, mut other) = (Pcg64Mcg::seed_from_u64(1), Pcg64Mcg::seed_from_u64(1));
        assert_eq!(CurrentReading::default().read(0.123, &mut one), 0.123);
        CurrentReading { noise_a: 1.0, ..CurrentReading::default() }.read(0.123, &mut other);
        assert_eq!(one, other);
    }
}
