//! Noise of the LVDT inside its band: it wanders slower than a block of samples, so that averaging leaves it.

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// Correlation time, s: five times a block of 6 ms.
const TIME_S: f64 = 0.03;

/// A first-order random signal (Ornstein–Uhlenbeck).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drift {
    normal: f64,
}

impl Drift {
    /// One step of `h` seconds; returns the signal for a size of `rms`. Draws one number, whatever the size.
    pub fn step(&mut self, h: f64, rms: f64, noise: &mut Pcg64Mcg) -> f64 {
        let keep = (-h / TIME_S).exp();
        let normal: f64 = StandardNormal.sample(noise);
        self.normal = keep * self.normal + (1.0 - keep * keep).sqrt() * normal;
        rms * self.normal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_pcg::rand_core::SeedableRng;

    #[test]
    fn it_has_its_size_after_averaging_a_block_and_its_time() {
        let (mut drift, mut noise) = (Drift::default(), Pcg64Mcg::seed_from_u64(1));
        let h = 2.5e-4;
        let blocks: Vec<f64> =
            (0..60_000).map(|_| (0..24).map(|_| drift.step(h, 20e-6, &mut noise)).sum::<f64>() / 24.0).collect();
        let rms = (blocks.iter().map(|b| b * b).sum::<f64>() / blocks.len() as f64).sqrt();
        assert!((rms / 20e-6 - 0.97).abs() < 0.02, "{rms}");
        // Five blocks later the correlation is e^-1.
        let correlation = blocks.windows(6).map(|w| w[0] * w[5]).sum::<f64>() / blocks.len() as f64 / (rms * rms);
        assert!((correlation - (-1f64).exp()).abs() < 0.05, "{correlation}");
    }
}
