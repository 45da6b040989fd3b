//! Rigs as real ones are: which plant keys differ from their defaults, and by how much, drawn from a seed.
//!
//! Each key draws from a stream of its own, so that a key that is added later does not change the others.

use crate::plant::{Draw, PlantChange, PlantKey, PlantSettings};
use serde::Serialize;
use std::fmt;

/// A kind of rig.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RigPreset {
    /// The rig of its own model: every plant key has its default.
    Ideal,
    /// A well-made rig.
    #[default]
    Nominal,
    /// The worst rig in ten.
    Hard,
}

/// Minimum fraction of a size that is never absent.
const MIN_FRACTION: f64 = 0.3;

impl Draw {
    /// The value for a size, from a number that is uniform in 0..1.
    fn value(self, size: f64, uniform: f64) -> f64 {
        let either = size * (2.0 * uniform - 1.0);
        let present = size * (MIN_FRACTION + (1.0 - MIN_FRACTION) * uniform);
        match self {
            Self::Either => either,
            Self::Present => present,
            Self::ScaleEither => 1.0 + either,
            Self::ScaleAbove => 1.0 + present,
            Self::ScaleBelow => 1.0 - present,
        }
    }

    /// Root mean square of what it draws for a size, from 0 or from 1.
    fn rms(self, size: f64) -> f64 {
        let min = match self {
            Self::Either | Self::ScaleEither => 0.0,
            Self::Present | Self::ScaleAbove | Self::ScaleBelow => MIN_FRACTION,
        };
        // The mean square of an even distribution from least to 1.
        size * ((1.0 - min * min * min) / (3.0 * (1.0 - min))).sqrt()
    }
}

impl RigPreset {
    /// Every preset.
    pub const ALL: [Self; 3] = [Self::Ideal, Self::Nominal, Self::Hard];

    /// The name as an operator types it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::Nominal => "nominal",
            Self::Hard => "hard",
        }
    }

    /// How a key is drawn, and its size on rigs of this kind; `None` where it has its default.
    fn size(self, key: PlantKey) -> Option<(Draw, f64)> {
        let (draw, nominal, hard) = *key.drawn()?;
        match self {
            Self::Ideal => None,
            Self::Nominal => Some((draw, nominal)),
            Self::Hard => Some((draw, hard)),
        }
    }

    /// One key as large as its column allows, or `factor` times that, as far as a rig can have it; none for keys that are the
    /// same in every rig. A negative factor is the other sign where a key has two.
    pub fn extreme(self, key: PlantKey, factor: f64) -> Option<PlantChange> {
        let (draw, size) = self.size(key)?;
        let value = match draw {
            Draw::Either => factor * size,
            Draw::Present => factor.abs() * size,
            Draw::ScaleEither => 1.0 + factor * size,
            Draw::ScaleAbove => 1.0 + factor.abs() * size,
            // A fraction of what is left, which never ends below nothing.
            Draw::ScaleBelow => (1.0 - size).powf(factor.abs()),
        };
        let [min, max] = key.range();
        Some(PlantChange { key, value: value.clamp(min, max) })
    }

    /// Root mean square of what the rigs of this kind have in a key, or differ by from 1 where it scales or divides something;
    /// 0 for keys that are the same in every rig. SI units.
    pub fn rms(self, key: PlantKey) -> f64 {
        self.size(key).map_or(0.0, |(draw, size)| draw.rms(size))
    }

    /// The plant keys of the rig that a seed names, in a fixed order; none for the ideal rig.
    pub fn changes(self, seed: u64) -> Vec<PlantChange> {
        let change = |&key: &PlantKey| {
            let (draw, size) = self.size(key)?;
            Some(PlantChange { key, value: draw.value(size, uniform(seed, key.name())) })
        };
        PlantKey::ALL.iter().filter_map(change).collect()
    }
}

impl PlantSettings {
    /// The rig of a preset that a seed names.
    pub fn preset(preset: RigPreset, seed: u64) -> Self {
        let mut settings = Self::default();
        preset.changes(seed).into_iter().for_each(|change| settings.put(change));
        settings
    }
}

impl fmt::Display for RigPreset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// There is no such preset.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no rig; rigs: ideal, nominal, hard")]
pub struct UnknownPreset(pub String);

impl std::str::FromStr for RigPreset {
    type Err = UnknownPreset;

    fn from_str(text: &str) -> Result<Self, UnknownPreset> {
        Self::ALL.into_iter().find(|preset| preset.name() == text).ok_or_else(|| UnknownPreset(text.to_owned()))
    }
}

/// A number in 0..1 that depends on a seed and a name: the first of the stream that both begin (splitmix64; the name by
/// the hash FNV-1a).
pub(crate) fn uniform(seed: u64, name: &str) -> f64 {
    let hash = name
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    // The top 53 bits are those of a double.
    (mix(mix(seed) ^ hash) >> 11) as f64 / (1u64 << 53) as f64
}

/// A normally distributed number, with a standard deviation of 1, that depends on a seed and a name (Box and Muller's method).
pub(crate) fn normal(seed: u64, name: &str) -> f64 {
    let angle = std::f64::consts::TAU * uniform(seed, &format!("{name} angle"));
    (-2.0 * (1.0 - uniform(seed, name)).ln()).sqrt() * angle.cos()
}

/// One step of splitmix64.
fn mix(state: u64) -> u64 {
    let z = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn() -> impl Iterator<Item = (PlantKey, Draw, f64, f64)> {
        PlantKey::ALL.iter().filter_map(|&key| key.drawn().map(|&(draw, nominal, hard)| (key, draw, nominal, hard)))
    }

    fn column(preset: RigPreset, key: PlantKey) -> Vec<f64> {
        let of = |seed| preset.changes(seed).into_iter().find(|change| change.key == key).unwrap().value;
        (0..200).map(of).collect()
    }

    #[test]
    fn every_value_lies_in_its_column_and_fills_it() {
        for (preset, hard) in [(RigPreset::Nominal, false), (RigPreset::Hard, true)] {
            for (key, draw, nominal, worst) in drawn() {
                let size = if hard { worst } else { nominal };
                let (low, high) = match draw {
                    Draw::Either => (-size, size),
                    Draw::Present => (0.3 * size, size),
                    Draw::ScaleEither => (1.0 - size, 1.0 + size),
                    Draw::ScaleAbove => (1.0 + 0.3 * size, 1.0 + size),
                    Draw::ScaleBelow => (1.0 - size, 1.0 - 0.3 * size),
                };
                let values = column(preset, key);
                let (min, max) = values.iter().fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
                let width = high - low;
                assert!(min >= low - 1e-12 && max <= high + 1e-12, "{key}: {min} to {max}");
                assert!(min < low + 0.1 * width && max > high - 0.1 * width, "{key}: {min} to {max}");
                let mean = values.iter().sum::<f64>() / 200.0;
                assert!((mean - 0.5 * (low + high)).abs() < 0.1 * width, "{key}: mean {mean}");
            }
        }
    }

    #[test]
    fn the_root_mean_square_is_that_of_the_rigs() {
        for (key, draw, ..) in drawn() {
            let from = f64::from(u8::from(matches!(draw, Draw::ScaleEither | Draw::ScaleAbove | Draw::ScaleBelow)));
            let squares: f64 = column(RigPreset::Hard, key).iter().map(|value| (value - from).powi(2)).sum();
            let rms = (squares / 200.0).sqrt();
            assert!((RigPreset::Hard.rms(key) / rms - 1.0).abs() < 0.15, "{key}: {rms}");
            assert_eq!(RigPreset::Ideal.rms(key), 0.0);
        }
        assert_eq!(RigPreset::Hard.rms(PlantKey::Load), 0.0);
    }

    #[test]
    fn a_seed_names_one_rig() {
        assert!(RigPreset::Ideal.changes(1).is_empty());
        assert_eq!(RigPreset::Hard.changes(7), RigPreset::Hard.changes(7));
        let (one, other) = (RigPreset::Hard.changes(7), RigPreset::Hard.changes(8));
        assert!(one.iter().zip(&other).all(|(a, b)| a.key == b.key && a.value != b.value));
        assert!(RigPreset::ALL.iter().flat_map(|p| p.changes(3)).all(|change| change.check().is_ok()));
    }

    #[test]
    fn a_key_by_itself_is_as_large_as_its_column() {
        let value = |key, factor| RigPreset::Nominal.extreme(key, factor).map(|change| change.value);
        assert_eq!(value(PlantKey::CurrentOffset, -2.0), Some(-10e-3));
        assert_eq!(value(PlantKey::Friction, -2.0), Some(0.3), "no sign");
        assert_eq!(value(PlantKey::GearEfficiency, 2.0), Some(0.5625));
        assert_eq!(value(PlantKey::TorqueConstantScale, -1.0), Some(0.95));
        assert_eq!(value(PlantKey::TwistPlay, 1e3), Some(PlantKey::TwistPlay.range()[1]));
        assert_eq!(value(PlantKey::Load, 1.0), None);
        assert_eq!(RigPreset::Ideal.extreme(PlantKey::Friction, 1.0), None);
        assert!(drawn().all(|(key, ..)| RigPreset::Hard.extreme(key, 8.0).is_some_and(|c| c.check().is_ok())));
    }

    #[test]
    fn one_key_says_nothing_about_another() {
        let (a, b) = (
            column(RigPreset::Hard, PlantKey::CurrentOffset),
            column(RigPreset::Hard, PlantKey::MotorFrictionAsymmetry),
        );
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        let spread = |x: &[f64]| x.iter().map(|v| (v - mean(x)).powi(2)).sum::<f64>().sqrt();
        let product: f64 = a.iter().zip(&b).map(|(x, y)| (x - mean(&a)) * (y - mean(&b))).sum();
        assert!((product / spread(&a) / spread(&b)).abs() < 0.2, "three standard deviations of 200 pairs");
    }

    #[test]
    fn names_come_back_and_others_are_refused_with_all_three() {
        for preset in RigPreset::ALL {
            assert_eq!(preset.to_string().parse(), Ok(preset));
        }
        let error = "real".parse::<RigPreset>().unwrap_err().to_string();
        assert_eq!(error, "`real` is no rig; rigs: ideal, nominal, hard");
    }
}
