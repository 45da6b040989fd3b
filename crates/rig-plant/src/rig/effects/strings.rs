//! The real strings between the output shaft and the mechanism's surface: which twist of the model theirs is, and how far
//! they have stretched.
//!
//! Twist and radius enter the mechanism as the arc θ r alone, so strings of another radius are those of the model at the
//! twist where these have the same arc.

use super::bedding::Bedding;
use super::creep::Creep;
use super::play::Play;
use crate::rig::surface::SLACK_LOAD_N;
use std::f64::consts::PI;
use tsa_model::Parameters;

/// Share of their torque that strings with play give back when they untwist. A contact that gives is closed under a small
/// torque and opened under a greater one, which returns a little more than it took; this is less than that. Assumed.
const RETURNED: f64 = 0.98;

/// Strings that differ from those of the model.
#[derive(Clone, Debug)]
pub struct Strings {
    /// Constants of the model, whose radius law is asked.
    model: Parameters,
    play: Play,
    bedding: Bedding,
    creep: Creep,
    /// Share of the new strings' radius that is left.
    radius_share: f64,
    exponent_shift: f64,
    /// Twist of the model that these strings have now, rad.
    pub twist_rad: f64,
    /// Slope of that twist by the shaft's, where they touch.
    slope: f64,
    contact: f64,
}

/// What makes strings differ; zeros make those of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StringSizes {
    /// Width of the loop between the twist of the shaft and that of the strings, rad.
    pub play_rad: f64,
    /// Share of their radius that new strings lose.
    pub bedding: f64,
    /// Slow stretch as a share of the elastic stretch.
    pub creep: f64,
    /// Exponent p of a factor (|θ|/π)^p on the radius beyond the half-turn pre-twist.
    pub exponent_shift: f64,
}

impl Strings {
    /// New strings on a mechanism, twisted to an angle (rad) under a load (N).
    pub fn new(model: &Parameters, sizes: &StringSizes, twist_rad: f64, load_n: f64) -> Self {
        let mut strings = Self {
            model: *model,
            play: Play::new(sizes.play_rad, twist_rad),
            bedding: Bedding::new(sizes.bedding, twist_rad),
            creep: Creep::new(sizes.creep, 0.5 / model.stiffness_n_per_m),
            radius_share: 1.0,
            exponent_shift: sizes.exponent_shift,
            twist_rad: 0.0,
            slope: 1.0,
            contact: 1.0,
        };
        strings.turn(twist_rad, load_n);
        strings
    }

    /// Takes the shaft to a twist (rad), with a pull (N) on the strings.
    pub fn turn(&mut self, shaft_rad: f64, pull_n: f64) {
        let own_rad = self.play.step(shaft_rad);
        self.radius_share = self.bedding.step(own_rad);
        self.contact = self.play.contact(shaft_rad);
        if (shaft_rad - own_rad) * own_rad < 0.0 {
            self.contact *= RETURNED;
        }
        (self.twist_rad, self.slope) = self.model_twist(own_rad, pull_n);
    }

    /// The twist at which strings of the model have the arc that these have at a twist (rad) under a pull (N), and its
    /// slope by theirs.
    pub fn model_twist(&self, own_rad: f64, pull_n: f64) -> (f64, f64) {
        let twist = own_rad.abs();
        let shift = if twist > PI { self.exponent_shift } else { 0.0 };
        let factor = self.radius_share * (twist / PI).max(1.0).powf(shift);
        if factor == 1.0 || twist == 0.0 {
            return (own_rad, 1.0);
        }
        // The part of the radius by the length does not depend on the twist, so that any length will do.
        let radius = |twist: f64| self.model.radius(pull_n.max(SLACK_LOAD_N), twist, 1.0, 1.0);
        let here = radius(twist);
        let (arc, slope) = (factor * twist * here.radius_m, factor * (here.arc_by_twist + shift * here.radius_m));
        // Newton's method; the arc is nearly proportional to the twist.
        let mut model = factor * twist;
        for _ in 0..4 {
            let there = radius(model);
            model -= (model * there.radius_m - arc) / there.arc_by_twist;
        }
        (model.copysign(own_rad), slope / radius(model).arc_by_twist)
    }

    /// What reaches the shaft of a torque (N m) on the twist of the model.
    pub fn torque_nm(&self, model_nm: f64) -> f64 {
        model_nm * self.slope * self.contact
    }

    /// One step of `h` seconds under a pull (N).
    pub fn stretch(&mut self, h: f64, pull_n: f64) {
        self.creep.step(h, pull_n);
    }

    /// How far they have stretched slowly, m.
    pub fn stretch_m(&self) -> f64 {
        self.creep.stretch_m()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rig_config::Scene;

    fn model(name: &str) -> Parameters {
        let file = format!("{}/../../scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        *Scene::load(file).unwrap().mechanism().unwrap().parameters()
    }

    fn strings(name: &str, sizes: StringSizes) -> Strings {
        Strings::new(&model(name), &sizes, 0.0, 5.0)
    }

    #[test]
    fn strings_without_sizes_are_those_of_the_model() {
        let mut strings = strings("default", StringSizes::default());
        for shaft in [4.0, -30.0, 12.3] {
            strings.turn(shaft, 5.0);
            strings.stretch(1e-3, 10.0);
            assert_eq!((strings.twist_rad, strings.torque_nm(0.1), strings.stretch_m()), (shaft, 0.1, 0.0));
        }
    }

    #[test]
    fn thinner_strings_have_their_arc_at_a_smaller_twist_of_the_model() {
        let mut strings = strings("default", StringSizes { bedding: 0.05, ..StringSizes::default() });
        for k in 0..2_000_000 {
            strings.turn(f64::from(k % 2) * 40.0, 5.0);
        }
        strings.turn(-40.0, 5.0);
        let arc = |twist: f64| twist * model("default").radius(5.0, twist, 1.0, 1.0).radius_m;
        assert!((arc(-strings.twist_rad) / arc(40.0) - 0.95).abs() < 1e-8, "{}", strings.twist_rad);
        let (near, _) = strings.model_twist(-40.0 - 1e-5, 5.0);
        let slope = (strings.twist_rad - near) / 1e-5;
        assert!((strings.torque_nm(1.0) - slope).abs() < 1e-6, "{} and {slope}", strings.torque_nm(1.0));
    }

    #[test]
    fn an_exponent_that_is_shifted_acts_beyond_the_pre_twist() {
        let strings = strings("paper-printed", StringSizes { exponent_shift: 0.05, ..StringSizes::default() });
        assert_eq!(strings.model_twist(3.0, 5.0), (3.0, 1.0));
        let (twist, slope) = strings.model_twist(15.0 * PI, 5.0);
        assert!((twist / (15.0 * PI) - 15f64.powf(0.05)).abs() < 1e-12, "{twist}");
        let (near, _) = strings.model_twist(15.0 * PI + 1e-6, 5.0);
        assert!(((near - twist) / 1e-6 - slope).abs() < 1e-6);
    }
}
