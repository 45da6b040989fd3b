//! The LVDT with its conditioner and divider: gap to 12-bit code (docs/reference/hardware.md 2.2; everything about the
//! sensor is assumed).

use std::f64::consts::TAU;

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

use super::effects::LVDT_GAIN_PER_K;
use crate::PlantSettings;
use rig_config::RigConfig;

/// Noise that the `lvdt-noisy` fault adds, m rms: a loose core.
const FAULT_NOISE_M: f64 = 2e-3;

/// Correlation time of the noise inside the band, s: five times a block of 6 ms.
const DRIFT_S: f64 = 0.03;
/// Bandwidth of the sensor (first order, -3 dB), rad/s. Assumed: DC types have 100 to 500 Hz (docs/reference/hardware.md 2.2).
const BANDWIDTH_RAD_PER_S: f64 = TAU * 200.0;
/// Frequency of the mains, whose hum the long leads pick up (Hz).
const MAINS_HZ: f64 = 50.0;

/// What can be wrong with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LvdtFaults {
    /// Lead open: the divider's pull-down holds 0 V.
    pub open: bool,
    /// Shorted to the supply: full scale.
    pub short: bool,
    /// Much noise.
    pub noisy: bool,
    /// The same code indefinitely.
    pub frozen: bool,
    /// Its output is reversed: mirrored about the middle of its range.
    pub reversed: bool,
}

/// The sensor.
#[derive(Clone, Debug)]
pub struct Lvdt {
    stroke_m: f64,
    volts: [f64; 2],
    gap_at_zero_m: f64,
    reference_v: f64,
    gain: f64,
    filtered_m: f64,
    /// What the converter shows without noise, and its noise, as fractions of its range.
    shown: f64,
    noise: f64,
    /// Noise inside the band, for a size of 1.
    drift: f64,
    drift_noise: Pcg64Mcg,
    /// Phase of the curve over the stroke, rad.
    curve_phase_rad: f64,
    last_code: u16,
    /// Active faults.
    pub faults: LvdtFaults,
}

impl Lvdt {
    /// Settled at a gap. The seed is that of the curve's phase and of the noise inside the band.
    pub fn new(parameters: &RigConfig, settings: &PlantSettings, gap_m: f64, seed: u64) -> Self {
        let mut drift_noise = Pcg64Mcg::seed_from_u64(seed);
        let curve_phase_rad = TAU * f64::from(drift_noise.next_u32()) / f64::from(u32::MAX);
        let mut lvdt = Self {
            drift: 0.0,
            drift_noise,
            curve_phase_rad,
            stroke_m: parameters.lvdt_stroke_m,
            volts: [parameters.lvdt_volts_at_zero, parameters.lvdt_volts_at_stroke],
            gap_at_zero_m: parameters.lvdt_gap_at_zero_m,
            reference_v: parameters.adc_reference_v,
            gain: 1.0 + settings.lvdt_gain_error,
            filtered_m: gap_m,
            shown: 0.0,
            noise: 0.0,
            last_code: 0,
            faults: LvdtFaults::default(),
        };
        lvdt.show(0.0, settings);
        lvdt
    }

    /// One step of `h` seconds to `t_s`; exact for a gap that stays where it is.
    pub fn step(&mut self, h: f64, t_s: f64, gap_m: f64, settings: &PlantSettings) {
        self.filtered_m += (gap_m - self.filtered_m) * -(-h * BANDWIDTH_RAD_PER_S).exp_m1();
        if settings.lvdt_noise_inband_m > 0.0 {
            self.drift = drifted(self.drift, h, &mut self.drift_noise);
        }
        self.show(t_s, settings);
    }

    /// What all samples until the next step have in common: the gap with the sensor's curve, offset, hum and drift, and the
    /// converter's error, which goes once up and down over its range (`adc_inl` codes at a quarter and at three quarters).
    fn show(&mut self, t_s: f64, settings: &PlantSettings) {
        let hum_m = settings.hum_m * (TAU * MAINS_HZ * t_s).sin();
        let drift_m = settings.lvdt_noise_inband_m * self.drift;
        let errors_m = settings.lvdt_offset_m + hum_m + self.curve_m(self.filtered_m, settings) + drift_m;
        let gain = self.gain * (1.0 + LVDT_GAIN_PER_K * settings.temperature_k) / self.stroke_m;
        let fraction = (self.filtered_m + errors_m - self.gap_at_zero_m) * gain;
        let fraction = if self.faults.reversed { 1.0 - fraction } else { fraction };
        let span = self.volts[1] - self.volts[0];
        let fraction = (self.volts[0] + fraction * span) / self.reference_v;
        self.shown = fraction + settings.adc_inl / CODES * (TAU * fraction).sin();
        let fault_noise_m = if self.faults.noisy { FAULT_NOISE_M } else { 0.0 };
        self.noise = settings.lvdt_noise_m.hypot(fault_noise_m) * gain * span / self.reference_v;
    }

    /// What its curve adds at a gap, m: one sine over the stroke.
    fn curve_m(&self, gap_m: f64, settings: &PlantSettings) -> f64 {
        if settings.lvdt_nonlinearity == 0.0 {
            return 0.0;
        }
        let fraction = (gap_m - self.gap_at_zero_m) / self.stroke_m;
        settings.lvdt_nonlinearity * self.stroke_m * (TAU * fraction + self.curve_phase_rad).sin()
    }

    /// One sample, with noise.
    pub fn sample(&mut self, noise: &mut Pcg64Mcg) -> u16 {
        // Drawn for each sample, also during a fault: a fault does not change the noise that follows it.
        let normal: f64 = StandardNormal.sample(noise);
        let code = volts_to_code(self.shown + normal * self.noise, 1.0);
        match self.faults {
            LvdtFaults { open: true, .. } => 0,
            LvdtFaults { short: true, .. } => 4095,
            LvdtFaults { frozen: true, .. } => self.last_code,
            _ => {
                self.last_code = code;
                code
            }
        }
    }
}

/// Codes of a 12-bit converter.
const CODES: f64 = 4096.0;

/// The code of a 12-bit converter for a voltage.
pub fn volts_to_code(volts: f64, reference_v: f64) -> u16 {
    // Rounded down: what is negative becomes 0 first.
    (volts / reference_v * CODES).clamp(0.0, 4095.0) as u16
}

/// Noise of the LVDT inside its band, `h` seconds later: it wanders slower than a block of samples, so that averaging leaves it. A
/// first-order random signal (Ornstein–Uhlenbeck) with an rms of 1.
fn drifted(drift: f64, h: f64, noise: &mut Pcg64Mcg) -> f64 {
    let keep = (-h / DRIFT_S).exp();
    let normal: f64 = StandardNormal.sample(noise);
    keep * drift + (1.0 - keep * keep).sqrt() * normal
}

#[cfg(test)]
mod tests {
    use rand_pcg::rand_core::SeedableRng;

    use super::*;

    fn lvdt(settings: &PlantSettings) -> (Lvdt, Pcg64Mcg) {
        (Lvdt::new(&RigConfig::default(), settings, 0.1, 1), Pcg64Mcg::seed_from_u64(1))
    }

    #[test]
    fn noise_has_the_stated_size_and_no_bias() {
        let settings = PlantSettings { lvdt_noise_m: 500e-6, ..PlantSettings::default() };
        let (mut lvdt, mut noise) = lvdt(&settings);
        let metres = |code: u16| (f64::from(code) + 0.5) / 4096.0 * 3.3 / 3.0 * 0.2;
        let samples: Vec<f64> = (0..20_000).map(|_| metres(lvdt.sample(&mut noise))).collect();
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        let rms = (samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / samples.len() as f64).sqrt();
        assert!((mean - 0.1).abs() < 15e-6, "{mean}");
        assert!((rms - 500e-6).abs() < 15e-6, "{rms}");
    }

    #[test]
    fn hum_is_a_sine_of_50_hz_about_the_gap() {
        let settings = PlantSettings { lvdt_noise_m: 0.0, hum_m: 1e-3, ..PlantSettings::default() };
        let (mut lvdt, mut noise) = lvdt(&settings);
        let code_m = 0.2 / 3.0 * 3.3 / 4096.0;
        let middle = 0.1 / code_m;
        for k in 0..40 {
            let t_s = f64::from(k) * 1e-3;
            let wanted = middle + 1e-3 / code_m * (TAU * 50.0 * t_s).sin();
            lvdt.step(2.5e-4, t_s, 0.1, &settings);
            let code = f64::from(lvdt.sample(&mut noise));
            assert!((code + 0.5 - wanted).abs() <= 0.501, "{code} at {t_s}, not {wanted}");
        }
    }

    #[test]
    fn the_converters_error_goes_up_and_down_over_its_range() {
        let settings = PlantSettings { lvdt_noise_m: 0.0, adc_inl: 3.0, ..PlantSettings::default() };
        let (mut lvdt, mut noise) = lvdt(&settings);
        for (fraction, codes) in [(0.0, 0.0), (0.25, 3.0), (0.5, 0.0), (0.75, -3.0), (1.0 / 12.0, 1.5)] {
            // Slightly more, so that the edge of a code is passed.
            lvdt.filtered_m = (fraction + 1e-5) * 3.3 / 3.0 * 0.2;
            lvdt.step(2.5e-4, 0.0, lvdt.filtered_m, &settings);
            let code = f64::from(lvdt.sample(&mut noise));
            assert_eq!(code, (fraction * 4096.0 + 0.05 + codes).floor(), "at {fraction}");
        }
    }

    #[test]
    fn its_curve_is_one_sine_over_the_stroke_with_a_phase_from_the_seed() {
        let settings = PlantSettings { lvdt_nonlinearity: 0.005, ..PlantSettings::default() };
        let curve = |seed: u64| {
            let lvdt = Lvdt::new(&RigConfig::default(), &settings, 0.1, seed);
            (0..=200).map(|k| lvdt.curve_m(1e-3 * f64::from(k), &settings)).collect::<Vec<_>>()
        };
        let errors = curve(1);
        assert_eq!(errors, curve(1));
        assert_ne!(errors, curve(2));
        let max = errors.iter().fold(0.0f64, |max, e| max.max(e.abs()));
        assert!((max / 1e-3 - 1.0).abs() < 1e-3, "{max}: half a per cent of 200 mm");
        // A sine over the stroke: half a stroke away it is the opposite, and twice it falls through zero.
        assert!((0..=100).all(|k| (errors[k] + errors[k + 100]).abs() < 1e-12));
        assert_eq!(errors.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count(), 2);
    }

    #[test]
    fn warmth_changes_the_gain_and_noise_inside_the_band_stays() {
        let warm = PlantSettings { lvdt_noise_m: 0.0, temperature_k: 10.0, ..PlantSettings::default() };
        let (mut lvdt, mut noise) = lvdt(&warm);
        let code = f64::from(lvdt.sample(&mut noise)) + 0.5;
        let wanted = 0.1 * 1.002 / 0.2 * 3.0 / 3.3 * 4096.0;
        assert!((code - wanted).abs() <= 0.501, "{code} and {wanted}");
        let noisy = PlantSettings { lvdt_noise_m: 0.0, lvdt_noise_inband_m: 1e-3, ..PlantSettings::default() };
        let (mut lvdt, _) = self::lvdt(&noisy);
        let before = lvdt.shown;
        lvdt.step(2.5e-4, 0.0, 0.1, &noisy);
        let wanted = 1e-3 * lvdt.drift / 0.2 * 3.0 / 3.3;
        assert!(wanted != 0.0 && (lvdt.shown - before - wanted).abs() < 1e-12, "{} and {wanted}", lvdt.shown - before);
    }

    #[test]
    fn bandwidth() {
        let settings = PlantSettings { lvdt_noise_m: 0.0, ..PlantSettings::default() };
        let (mut lvdt, _) = lvdt(&settings);
        for _ in 0..4 {
            lvdt.step(2.5e-4, 0.0, 0.11, &settings);
        }
        let expected = 0.11 - 0.01 * (-TAU * 200.0 * 1e-3_f64).exp();
        assert!((lvdt.filtered_m - expected).abs() < 1e-12);
    }

    #[test]
    fn faults() {
        let settings = PlantSettings::default();
        let (mut lvdt, mut noise) = lvdt(&settings);
        lvdt.sample(&mut noise);
        lvdt.faults.frozen = true;
        let frozen = lvdt.sample(&mut noise);
        assert!((0..100).all(|_| lvdt.sample(&mut noise) == frozen));
        lvdt.faults.open = true;
        assert_eq!(lvdt.sample(&mut noise), 0);
        lvdt.faults = LvdtFaults { short: true, ..LvdtFaults::default() };
        assert_eq!(lvdt.sample(&mut noise), 4095);
        assert_eq!(volts_to_code(-1.0, 3.3), 0);
        assert_eq!(volts_to_code(9.0, 3.3), 4095);
    }

    #[test]
    fn it_has_its_size_after_averaging_a_block_and_its_time() {
        let (mut drift, mut noise) = (0.0, Pcg64Mcg::seed_from_u64(1));
        let mut step = || {
            drift = drifted(drift, 2.5e-4, &mut noise);
            drift
        };
        let blocks: Vec<f64> = (0..60_000).map(|_| (0..24).map(|_| step()).sum::<f64>() / 24.0).collect();
        let rms = (blocks.iter().map(|b| b * b).sum::<f64>() / blocks.len() as f64).sqrt();
        assert!((rms - 0.97).abs() < 0.02, "{rms}");
        // Five blocks later the correlation is e^-1.
        let correlation = blocks.windows(6).map(|w| w[0] * w[5]).sum::<f64>() / blocks.len() as f64 / (rms * rms);
        assert!((correlation - (-1f64).exp()).abs() < 0.05, "{correlation}");
    }
}
