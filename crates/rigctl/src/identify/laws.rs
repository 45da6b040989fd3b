//! The radius laws that compete, simplest first, and where a fit of each begins.

use super::constants::{Constant, Unknowns};
use rig_config::Scene;
use tsa_model::RadiusLaw;

/// A law by which the radius of the twisted pair grows (docs/explanation/model.md section 6).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Law {
    /// With the length alone: eq. 6 as printed.
    LengthRatio,
    /// With the length, and with the logarithm of the twist.
    LengthRatioK4,
    /// With a power of the twist.
    TwistPower,
}

impl Unknowns {
    /// What is fitted to recorded sweeps unless the operator says otherwise: the radius model, the rods' curve by `material`,
    /// and where the gap's zero is `known` the string's length and its stiffness, which creep lowers.
    pub fn usual(law: Law, material: Constant, known: bool) -> Self {
        let radius = [Constant::K1, Constant::K2, Constant::K3].into_iter().chain(law.own());
        let constants = radius.chain([material]);
        // The gap without its zero tells nothing of a stretch that is the same at every twist.
        let with_zero = [Constant::Stiffness, Constant::StringLength].into_iter().filter(|_| known);
        let constants = constants.chain(with_zero).collect();
        Self { constants, expected: known }
    }
}

/// Names on the command line and in the answer. A law that is added here takes part.
pub const LAWS: [(Law, &str); 3] =
    [(Law::LengthRatio, "length-ratio"), (Law::LengthRatioK4, "length-ratio-k4"), (Law::TwistPower, "twist-power")];

/// Twist, in half turns, at which a law begins with the radius of the scene's own: the middle of a usual sweep.
const MIDDLE: f64 = 8.0;
/// Exponent that a fit starts from when the scene has none.
const EXPONENT: f64 = 0.4;
/// k4 that a fit starts from when the scene has none.
pub const K4: f64 = 0.1;
/// Minimum k2 and k3 that a fit starts from, so that their logarithms have a meaning.
const MIN: f64 = 0.01;

impl Law {
    /// By its name.
    pub fn named(name: &str) -> Option<Self> {
        LAWS.iter().find(|(_, known)| *known == name).map(|(law, _)| *law)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        LAWS.iter().find(|(law, _)| *law == self).map_or("", |(_, name)| name)
    }

    /// The one of a scene.
    pub fn of(scene: &Scene) -> Self {
        match scene.string.radius_law {
            RadiusLaw::LengthRatio if scene.string.k4 > 0.0 => Self::LengthRatioK4,
            RadiusLaw::LengthRatio => Self::LengthRatio,
            RadiusLaw::TwistPower => Self::TwistPower,
        }
    }

    /// The constants that only this law has.
    pub fn own(self) -> Option<Constant> {
        match self {
            Self::LengthRatio => None,
            Self::LengthRatioK4 => Some(Constant::K4),
            Self::TwistPower => Some(Constant::Exponent),
        }
    }

    /// The scene with this law, which has the radius of the scene's own law in the middle of a sweep, and grows there as
    /// fast where the law has a constant for that.
    #[must_use]
    pub fn start(self, scene: &Scene) -> Scene {
        if self == Self::of(scene) {
            return scene.clone();
        }
        let mut scene = scene.clone();
        let string = &mut scene.string;
        // What the radius has besides 1/(k1 F), over r0, where the length is X0, and its slope by the twist's logarithm.
        let (middle, slope) = match string.twist_exponent {
            Some(p) => (string.k2 + string.k3 * MIDDLE.powf(p), string.k3 * p * MIDDLE.powf(p)),
            None => (string.k2 + string.k3 + string.k4 * MIDDLE.ln(), string.k4),
        };
        string.k4 = 0.0;
        match self {
            Self::LengthRatio => {
                (string.radius_law, string.twist_exponent) = (RadiusLaw::LengthRatio, None);
                string.k2 = middle - string.k3;
            }
            Self::LengthRatioK4 => {
                (string.radius_law, string.twist_exponent) = (RadiusLaw::LengthRatio, None);
                // k2 and k3 stay where they are allowed to.
                string.k4 = if slope > 0.0 { slope } else { K4 }.min((middle - 2.0 * MIN) / MIDDLE.ln());
                string.k3 = string.k3.min(middle - string.k4 * MIDDLE.ln() - MIN);
                string.k2 = middle - string.k3 - string.k4 * MIDDLE.ln();
            }
            Self::TwistPower => {
                (string.radius_law, string.twist_exponent) = (RadiusLaw::TwistPower, Some(EXPONENT));
                let growth = MIDDLE.powf(EXPONENT);
                string.k3 = if slope > 0.0 { slope / (EXPONENT * growth) } else { string.k3 / growth }.max(MIN);
                string.k2 = (middle - string.k3 * growth).max(MIN);
            }
        }
        scene
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tsa_model::Parameters;

    #[test]
    fn every_law_begins_with_the_radius_of_the_scenes_own() {
        for name in ["default", "paper-printed", "paper-identified"] {
            let path = format!("{}/../../scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"));
            let scene = Scene::load(path).expect("a scene");
            let radius = |scene: &Scene| {
                let p = Parameters::new(&scene.geometry, &scene.string, &scene.material).expect("constants");
                p.radius(5.0, MIDDLE * std::f64::consts::PI, 0.09, 0.09).radius_m
            };
            for (law, text) in LAWS {
                let start = law.start(&scene);
                start.validate().expect("a scene");
                assert_eq!((Law::of(&start), Law::named(text), law.name()), (law, Some(law), text));
                assert!((radius(&start) / radius(&scene) - 1.0).abs() < 1e-12, "{name}: {text}");
            }
        }
    }
}
