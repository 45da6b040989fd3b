//! The constants that can be fitted, and their unknowns in the fit.
//!
//! Positive constants are fitted by their logarithm, so that no step leaves the range in which the model means anything.
//! The stress–strain curve is fitted by the coefficients of its tangent written as sums of squares: no step can make it
//! fall, anywhere.

use rig_config::Scene;
use tsa_model::scalar::{Dual, Scalar};
use tsa_model::{Parameters, RadiusLaw};

/// Maximum unknowns of a fit, the zeros of gap sensors apart.
pub const MAX: usize = 10;

/// A number with its derivatives by the unknowns.
pub type Number = Dual<MAX>;

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

/// The scene-file key, the paper's symbol or a word, and the standard deviation of the logarithm about the scene's value that
/// is expected of a rig of the scene's kind: 30 % of the radius model, 15 % of the rods' curve (docs/explanation/model.md
/// 6); of the strings' stiffness 30 % (creep adds up to that fraction to their stretch, crates/rig-plant/README.md), 2 mm
/// of the string's length, and an odd curve whose tangent at a strain of 0.05 is between a half and twice that of a
/// straight line. A curve has none.
const CONSTANTS: [(Constant, &str, &str, Option<f64>); 11] = [
    (Constant::K1, "string.k1_per_n", "k1", Some(0.3)),
    (Constant::K2, "string.k2", "k2", Some(0.3)),
    (Constant::K3, "string.k3", "k3", Some(0.3)),
    (Constant::K4, "string.k4", "k4", Some(0.3)),
    (Constant::Exponent, "string.twist_exponent", "p", Some(0.3)),
    (Constant::Stiffness, "string.stiffness_n_per_m", "K", Some(0.3)),
    (Constant::RodRadius, "geometry.rod_radius_m", "R", Some(0.02)),
    (Constant::StringLength, "geometry.string_length_m", "L0", Some(0.02)),
    (Constant::Modulus, "material.modulus", "modulus", Some(0.15)),
    (Constant::OddCurve, "material.odd", "odd-curve", Some(0.5)),
    (Constant::Curve, "material.stress_coefficients_pa", "curve", None),
];

/// Strain at which the two ends of a tangent's terms count alike.
const STRAIN: f64 = 0.05;

impl Constant {
    /// By key or symbol.
    pub fn named(name: &str) -> Option<Self> {
        CONSTANTS.iter().find(|(_, key, symbol, _)| *key == name || *symbol == name).map(|(constant, ..)| *constant)
    }

    /// What `--fit` takes.
    pub fn names() -> String {
        CONSTANTS.map(|(_, _, symbol, _)| symbol).join(", ")
    }

    fn entry(self) -> (Self, &'static str, &'static str, Option<f64>) {
        // In the order of the variants.
        CONSTANTS[self as usize]
    }

    /// Key in a scene file.
    pub fn key(self) -> &'static str {
        self.entry().1
    }

    /// How it is called in a table.
    pub fn symbol(self) -> &'static str {
        self.entry().2
    }

    /// Standard deviation of the logarithm about the scene's value that is expected beforehand.
    pub fn spread(self) -> Option<f64> {
        self.entry().3
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

    /// Where a positive constant stands.
    fn place<T>(self, p: &mut Parameters<T>) -> Option<&mut T> {
        match self {
            Self::K1 => Some(&mut p.k1_per_n),
            Self::K2 => Some(&mut p.k2),
            Self::K3 => Some(&mut p.k3),
            Self::K4 => Some(&mut p.k4),
            Self::Exponent => Some(&mut p.twist_exponent),
            Self::Stiffness => Some(&mut p.stiffness_n_per_m),
            Self::RodRadius => Some(&mut p.rod_radius_m),
            Self::StringLength => Some(&mut p.string_length_m),
            Self::Modulus | Self::OddCurve | Self::Curve => None,
        }
    }

    /// Unknowns at the scene's own values.
    ///
    /// # Errors
    /// In words, if a fit cannot start there.
    pub fn start(self, p: &Parameters) -> Result<Vec<f64>, String> {
        let without = |law| Err(format!("{}: the radius law {law} has none (see --law)", self.key()));
        match (self, p.radius_law) {
            (Self::K4, RadiusLaw::TwistPower) => return without("twist-power"),
            (Self::Exponent, RadiusLaw::LengthRatio) => return without("length-ratio"),
            _ => {}
        }
        let a1 = p.stress_coefficients_pa[0];
        match self.place(&mut p.clone()) {
            Some(value) if *value > 0.0 => Ok(vec![value.ln()]),
            Some(value) => Err(format!("{}: the scene has {value}, and a fit starts above 0", self.key())),
            // σ'/a1 = (u + v z)² + w² z with z = (ε/0.05)²: every tangent that is not negative for z ≥ 0.
            None if self == Self::OddCurve => Ok(vec![a1.ln(), 0.02, 0.02]),
            // σ'/a1 = (1 + c1 x + c2 x²)² share + (1 + d1 x)² (1 − share), x = ε/0.05.
            None if self == Self::Curve => Ok(vec![a1.ln(), 0.01, 0.01, -0.01, 0.0]),
            None => Ok(vec![0.0]),
        }
    }

    /// Puts the unknowns into the constants.
    fn put<T: Scalar>(self, x: &[T], p: &mut Parameters<T>) {
        let raw = |k: usize| x.get(k).copied().unwrap_or(T::of(0.0));
        let scale = raw(0).exp_m1() + 1.0;
        if let Some(place) = self.place(p) {
            *place = scale;
        }
        match self {
            Self::Modulus => p.stress_coefficients_pa = p.stress_coefficients_pa.map(|a| a * scale),
            Self::OddCurve => {
                let (a1, v, w) = (scale, raw(1), raw(2));
                let (z, none) = (STRAIN * STRAIN, T::of(0.0));
                p.stress_coefficients_pa =
                    [a1, none, a1 * (v * 2.0 + w * w) / (3.0 * z), none, a1 * v * v / (5.0 * z * z)];
            }
            Self::Curve => {
                let (a1, c1, c2, d1) = (scale, raw(1), raw(2), raw(3));
                // A fraction between 0 and 1.
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
            _ => {}
        }
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

    /// Constants of a scene with the unknowns in their places, except what a row fixes for itself (`fixed`, by key); `number`
    /// makes the kind of number of a constant's unknown and its place.
    pub fn put<T: Scalar>(
        &self,
        base: &Parameters,
        x: &[f64],
        fixed: &str,
        number: impl Fn(f64, usize) -> T,
    ) -> Parameters<T> {
        let (mut p, mut at) = (Parameters::<T>::constant(base), 0);
        for constant in &self.constants {
            let places = at..at + constant.unknowns();
            at = places.end;
            let part: Vec<T> = places.map(|k| number(x.get(k).copied().unwrap_or(0.0), k)).collect();
            if !fixed.contains(constant.key()) {
                constant.put(&part, &mut p);
            }
        }
        p
    }

    /// The scene with the fitted constants, without a correction: it belonged to the constants before.
    pub fn scene(&self, scene: &Scene, base: &Parameters, x: &[f64]) -> Scene {
        let p = self.put(base, x, "", |value, _| value);
        let mut fitted = Scene { correction: None, ..scene.clone() };
        fitted.geometry.string_length_m = p.string_length_m;
        fitted.geometry.rod_radius_m = p.rod_radius_m;
        fitted.material.stress_coefficients_pa = p.stress_coefficients_pa;
        let string = &mut fitted.string;
        (string.stiffness_n_per_m, string.k1_per_n) = (p.stiffness_n_per_m, p.k1_per_n);
        (string.k2, string.k3, string.k4) = (p.k2, p.k3, p.k4);
        string.twist_exponent = string.twist_exponent.map(|_| p.twist_exponent);
        fitted
    }
}
