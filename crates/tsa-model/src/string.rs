//! The strings' constants (eqs 5, 6) and the law by which their radius grows.

use crate::error::{ParameterError, positive, require};

/// Minimum load that is solved (N): below it 1/(k1 F) alone would make the string thicker than it is long (eq. 6).
pub const MINIMUM_LOAD_N: f64 = 0.05;

/// How the radius of the twisted pair grows with twist (eq. 6 and docs/explanation/model.md section 6).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(rename_all = "kebab-case"))]
pub enum RadiusLaw {
    /// g = √(X0/X): eq. 6 as printed, and k4 ln(|θ|/π) beside it.
    #[default]
    LengthRatio,
    /// g = (|θ|/π)^p: the growth that the published sweeps ask for.
    TwistPower,
}

/// One string, and how a pair of them twists.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(deny_unknown_fields))]
pub struct StringParameters {
    /// Diameter without load r0 (m).
    pub diameter_m: f64,
    /// Stiffness K of one string (N/m).
    pub stiffness_n_per_m: f64,
    /// k1 (1/N), eq. 6.
    pub k1_per_n: f64,
    /// k2, eq. 6.
    pub k2: f64,
    /// k3, eq. 6.
    pub k3: f64,
    /// k4: growth of the radius with the logarithm of the twist, only with [`RadiusLaw::LengthRatio`]; 0 is eq. 6 as
    /// printed.
    #[cfg_attr(feature = "std", serde(default, skip_serializing_if = "is_zero"))]
    pub k4: f64,
    /// Growth of the radius with twist.
    #[cfg_attr(feature = "std", serde(default))]
    pub radius_law: RadiusLaw,
    /// Exponent p of [`RadiusLaw::TwistPower`].
    #[cfg_attr(feature = "std", serde(default, skip_serializing_if = "Option::is_none"))]
    pub twist_exponent: Option<f64>,
}

#[cfg(feature = "std")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl StringParameters {
    /// r0 (m), K (N/m), k1 (1/N), k2, k3 and k4.
    pub fn constants(&self) -> [f64; 6] {
        [self.diameter_m, self.stiffness_n_per_m, self.k1_per_n, self.k2, self.k3, self.k4]
    }

    /// Checks signs and finiteness.
    pub fn validate(&self) -> Result<(), ParameterError> {
        positive(&[
            ("string.diameter_m", self.diameter_m),
            ("string.stiffness_n_per_m", self.stiffness_n_per_m),
            ("string.k1_per_n", self.k1_per_n),
        ])?;
        for (parameter, value) in [("string.k2", self.k2), ("string.k3", self.k3), ("string.k4", self.k4)] {
            require(value >= 0.0 && value.is_finite(), parameter, value, "must be at least 0 and finite")?;
        }
        let by_power = self.radius_law == RadiusLaw::TwistPower;
        require(!by_power || self.k4 == 0.0, "string.k4", self.k4, "only with radius_law = \"length-ratio\"")?;
        let (good, reason) = match self.twist_exponent {
            p if by_power => (
                p.is_some_and(|p| (0.0..=2.0).contains(&p)),
                "radius_law \"twist-power\" needs an exponent from 0 to 2",
            ),
            p => (p.is_none(), "only with radius_law = \"twist-power\""),
        };
        require(good, "string.twist_exponent", self.twist_exponent.unwrap_or(f64::NAN), reason)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRING: StringParameters = StringParameters {
        diameter_m: 0.0007,
        stiffness_n_per_m: 2e4,
        k1_per_n: 0.8,
        k2: 0.4,
        k3: 0.3,
        k4: 0.1,
        radius_law: RadiusLaw::LengthRatio,
        twist_exponent: None,
    };

    #[test]
    fn a_constant_that_is_negative_or_not_finite_is_refused_by_its_name() {
        assert_eq!(STRING.validate(), Ok(()));
        const NAMES: [&str; 6] =
            ["string.diameter_m", "string.stiffness_n_per_m", "string.k1_per_n", "string.k2", "string.k3", "string.k4"];
        for (k, name) in NAMES.into_iter().enumerate() {
            let with = |value| {
                let mut s = STRING;
                let fields =
                    [&mut s.diameter_m, &mut s.stiffness_n_per_m, &mut s.k1_per_n, &mut s.k2, &mut s.k3, &mut s.k4];
                *fields[k] = value;
                s.validate().map_err(|refused| refused.parameter)
            };
            assert!([-1.0, f64::INFINITY, f64::NAN].into_iter().all(|bad| with(bad) == Err(name)), "{name}");
            // A string without thickness or stiffness is none; a law without one of its terms is a law.
            assert_eq!(with(0.0), if k < 3 { Err(name) } else { Ok(()) });
        }
    }
}
