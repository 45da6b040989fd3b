//! The constants that can be fitted, and their unknowns in the fit.
//!
//! Positive constants are fitted by their logarithm, so that no step leaves the range in which the model means anything.
//! The stress–strain curve is fitted by the coefficients of its tangent written as sums of squares: no step can make it
//! fall, anywhere.

use rig_config::Scene;
use tsa_model::scalar::{Dual, Scalar};
use tsa_model::{Parameters, RadiusLaw};

/// Most unknowns of a fit, the zeros of gap sensors apart.
pub const MOST: usize = 10;

/// A number with its derivatives by the unknowns.
pub type Number = Dual<MOST>;

/// A constant, or a curve of several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Constant {
    /// k1 (1/N).
    K1,
    /// k2.
    K2,
    /// k3.
    K3,
    /// k4.
    K4,
    /// Exponent p of the twist-power law.
    Exponent,
    /// Stiffness K of a string (N/m).
    Stiffness,
    /// Rod radius R (m).
    RodRadius,
    /// String length L0 (m).
    StringLength,
    /// All a_i by one factor.
    Modulus,
    /// a1, a3, a5 with a tangent that is nowhere negative; a2 and a4, which have no physical reason, are zero.
    OddCurve,
    /// a1 … a5 with a tangent that is nowhere negative.
    Curve,
}

/// Names, the scene-file key first, then the paper's symbol or a word.
const NAMES: [(Constant, &str, &str); 11] = [
    (Constant::K1, "string.k1_per_n", "k1"),
    (Constant::K2, "string.k2", "k2"),
    (Constant::K3, "string.k3", "k3"),
    (Constant::K4, "string.k4", "k4"),
    (Constant::Exponent, "string.twist_exponent", "p"),
    (Constant::Stiffness, "string.stiffness_n_per_m", "K"),
    (Constant::RodRadius, "geometry.rod_radius_m", "R"),
    (Constant::StringLength, "geometry.string_length_m", "L0"),
    (Constant::Modulus, "material.modulus", "modulus"),
    (Constant::OddCurve, "material.odd", "odd-curve"),
    (Constant::Curve, "material.stress_coefficients_pa", "curve"),
];

/// Strain at which the two ends of a tangent's terms count alike.
const STRAIN: f64 = 0.05;

impl Constant {
    /// By key or symbol.
    pub fn named(name: &str) -> Option<Self> {
        NAMES.iter().find(|(_, key, symbol)| *key == name || *symbol == name).map(|(constant, ..)| *constant)
    }

    /// What `--fit` takes.
    pub fn names() -> String {
        NAMES.map(|(_, _, symbol)| symbol).join(", ")
    }

    /// Key in a scene file.
    pub fn key(self) -> &'static str {
        NAMES.iter().find(|(c, ..)| *c == self).map_or("", |(_, key, _)| key)
    }

    /// How it is called in a table.
    pub fn symbol(self) -> &'static str {
        NAMES.iter().find(|(c, ..)| *c == self).map_or("", |(.., symbol)| symbol)
    }

    /// Standard deviation of the logarithm about the scene's value that is expected of a rig of the scene's kind: 30 % of
    /// the radius law, 15 % of the rods' curve (docs/model.md 6), 30 % of the
    /// strings' stiffness (creep adds up to that share to their stretch, docs/plants.md), 2 mm of the string's length, and
    /// an odd curve whose tangent at a strain of 0.05 is between a half and twice that of a straight line. A curve has none.
    pub fn spread(self) -> Option<f64> {
        match self {
            Self::K1 | Self::K2 | Self::K3 | Self::K4 | Self::Exponent | Self::Stiffness => Some(0.3),
            Self::Modulus => Some(0.15),
            Self::RodRadius | Self::StringLength => Some(0.02),
            Self::OddCurve => Some(0.5),
            Self::Curve => None,
        }
    }

    /// Whether it is a way to fit the rods' curve.
    pub fn is_material(self) -> bool {
        matches!(self, Self::Modulus | Self::OddCurve | Self::Curve)
    }

    /// Number of unknowns.
    pub fn unknowns(self) -> usize {
        match self {
            Self::OddCurve => 3,
            Self::Curve => 5,
            _ => 1,
        }
    }

    /// Unknowns at the scene's own values.
    ///
    /// # Errors
    /// In words, if a fit cannot start there.
    pub fn start(self, p: &Parameters) -> Result<Vec<f64>, String> {
        let a = p.stress_coefficients_pa;
        let positive = |value: f64| {
            if value > 0.0 {
                Ok(vec![value.ln()])
            } else {
                Err(format!("{}: the scene has {value}, and a fit starts above 0", self.key()))
            }
        };
        match self {
            Self::K1 => positive(p.k1_per_n),
            Self::K2 => positive(p.k2),
            Self::K3 => positive(p.k3),
            Self::K4 if p.radius_law == RadiusLaw::TwistPower => {
                Err("string.k4: the radius law twist-power has none (see --law)".into())
            }
            Self::K4 => positive(p.k4),
            Self::Exponent if p.radius_law == RadiusLaw::LengthRatio => {
                Err("string.twist_exponent: the radius law length-ratio has none (see --law)".into())
            }
            Self::Exponent => positive(p.twist_exponent),
            Self::Stiffness => positive(p.stiffness_n_per_m),
            Self::RodRadius => positive(p.rod_radius_m),
            Self::StringLength => positive(p.string_length_m),
            Self::Modulus => Ok(vec![0.0]),
            // σ'/a1 = (u + v z)² + w² z with z = (ε/0.05)²: every tangent that is not negative for z ≥ 0.
            Self::OddCurve => Ok(vec![a[0].ln(), 0.02, 0.02]),
            // σ'/a1 = (1 + c1 x + c2 x²)² share + (1 + d1 x)² (1 − share), x = ε/0.05.
            Self::Curve => Ok(vec![a[0].ln(), 0.01, 0.01, -0.01, 0.0]),
        }
    }

    /// Puts the unknowns into the constants.
    fn put(self, x: &[Number], p: &mut Parameters<Number>) {
        let exp = |k: usize| x.get(k).map_or(Number::of(1.0), |x| x.exp_m1() + 1.0);
        let raw = |k: usize| x.get(k).copied().unwrap_or(Number::of(0.0));
        match self {
            Self::K1 => p.k1_per_n = exp(0),
            Self::K2 => p.k2 = exp(0),
            Self::K3 => p.k3 = exp(0),
            Self::K4 => p.k4 = exp(0),
            Self::Exponent => p.twist_exponent = exp(0),
            Self::Stiffness => p.stiffness_n_per_m = exp(0),
            Self::RodRadius => p.rod_radius_m = exp(0),
            Self::StringLength => p.string_length_m = exp(0),
            Self::Modulus => p.stress_coefficients_pa = p.stress_coefficients_pa.map(|a| a * exp(0)),
            Self::OddCurve => {
                let (a1, v, w) = (exp(0), raw(1), raw(2));
                let z = STRAIN * STRAIN;
                p.stress_coefficients_pa = [
                    a1,
                    Number::of(0.0),
                    a1 * (v * 2.0 + w * w) / (3.0 * z),
                    Number::of(0.0),
                    a1 * v * v / (5.0 * z * z),
                ];
            }
            Self::Curve => {
                let (a1, c1, c2, d1) = (exp(0), raw(1), raw(2), raw(3));
                // A share between 0 and 1.
                let (sin, cos) = (raw(4) + std::f64::consts::FRAC_PI_4).sin_cos();
                let (first, second) = (sin * sin, cos * cos);
                p.stress_coefficients_pa = [
                    a1,
                    a1 * (first * c1 + second * d1) / STRAIN,
                    a1 * (first * (c1 * c1 + c2 * 2.0) + second * d1 * d1) / (3.0 * STRAIN.powi(2)),
                    a1 * first * c1 * c2 / (2.0 * STRAIN.powi(3)),
                    a1 * first * c2 * c2 / (5.0 * STRAIN.powi(4)),
                ];
            }
        }
    }
}

/// The constants without their derivatives.
pub fn values(p: &Parameters<Number>) -> Parameters {
    Parameters {
        string_length_m: p.string_length_m.value,
        rod_span_m: p.rod_span_m.value,
        clamp_width_m: p.clamp_width_m.value,
        rod_radius_m: p.rod_radius_m.value,
        diameter_m: p.diameter_m.value,
        stiffness_n_per_m: p.stiffness_n_per_m.value,
        k1_per_n: p.k1_per_n.value,
        k2: p.k2.value,
        k3: p.k3.value,
        k4: p.k4.value,
        twist_exponent: p.twist_exponent.value,
        stress_coefficients_pa: p.stress_coefficients_pa.map(|a| a.value),
        radius_law: p.radius_law,
        correction: p.correction,
    }
}

/// The unknowns of a fit, in order.
#[derive(Debug, Clone)]
pub struct Unknowns {
    /// The constants.
    pub constants: Vec<Constant>,
    /// Whether the scene's own values count, each with its [`Constant::spread`]: then data that leave a combination of
    /// constants open leave it where it was.
    pub expected: bool,
}

impl Unknowns {
    /// How many.
    pub fn count(&self) -> usize {
        self.constants.iter().map(|c| c.unknowns()).sum()
    }

    /// A name for each.
    pub fn labels(&self) -> Vec<String> {
        self.constants
            .iter()
            .flat_map(|c| match c {
                Constant::OddCurve => ["ln a1", "v", "w"].map(|part| format!("odd-curve {part}")).to_vec(),
                Constant::Curve => ["ln a1", "c1", "c2", "d1", "share"].map(|part| format!("curve {part}")).to_vec(),
                _ => vec![c.symbol().to_owned()],
            })
            .collect()
    }

    /// Constants of a scene with the unknowns in their places, except what a row fixes for itself (`fixed`, by key).
    pub fn parameters(&self, base: &Parameters, x: &[f64], fixed: &str) -> Parameters<Number> {
        let mut p = Parameters::<Number>::constant(base);
        let mut at = 0;
        for constant in &self.constants {
            let n = constant.unknowns();
            let part: Vec<Number> =
                (at..at + n).map(|k| Number::parameter(x.get(k).copied().unwrap_or(0.0), k)).collect();
            at += n;
            if !fixed.contains(constant.key()) {
                constant.put(&part, &mut p);
            }
        }
        p
    }

    /// The scene with the fitted constants, without a correction: it belonged to the constants before.
    pub fn scene(&self, scene: &Scene, base: &Parameters, x: &[f64]) -> Scene {
        let p = self.parameters(base, x, "");
        let mut fitted = scene.clone();
        fitted.geometry.string_length_m = p.string_length_m.value;
        fitted.geometry.rod_radius_m = p.rod_radius_m.value;
        fitted.string.stiffness_n_per_m = p.stiffness_n_per_m.value;
        fitted.string.k1_per_n = p.k1_per_n.value;
        (fitted.string.k2, fitted.string.k3, fitted.string.k4) = (p.k2.value, p.k3.value, p.k4.value);
        if fitted.string.twist_exponent.is_some() {
            fitted.string.twist_exponent = Some(p.twist_exponent.value);
        }
        fitted.correction = None;
        fitted.material.stress_coefficients_pa = p.stress_coefficients_pa.map(|a| a.value);
        fitted
    }
}
