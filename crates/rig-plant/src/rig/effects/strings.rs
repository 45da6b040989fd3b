//! The real strings between the output shaft and the mechanism's surface: which twist of the model theirs is, and how far
//! they have stretched.
//!
//! Twist and radius enter the mechanism as the arc θ r alone, so strings of another radius are those of the model at the
//! twist where these have the same arc.

use super::{CREEP_TIMES_S, RUN_IN_CYCLES, TURNS_PER_CYCLE};
use crate::PlantSettings;
use crate::rig::surface::SLACK_LOAD_N;
use std::f64::consts::{PI, TAU};
use tsa_model::{Parameters, RadiusLaw};

/// Fraction of half the play over which the contact gives. Assumed.
const CONTACT: f64 = 0.02;
/// Fraction of their torque that strings with play give back when they untwist. A contact that gives is closed under a small
/// torque and opened under a greater one, which returns a little more than it took; this is less than that. Assumed.
const RETURNED: f64 = 0.98;

/// Strings that differ from those of the model.
#[derive(Clone, Debug)]
pub struct Strings {
    /// Constants of the model, whose radius model is asked.
    model: Parameters,
    play: Play,
    bedding: Bedding,
    creep: Creep,
    /// Fraction of the new strings' radius that is left.
    radius_fraction: f64,
    /// Exponent p of a factor (|θ|/π)^p on the radius beyond the half-turn pre-twist.
    exponent_shift: f64,
    /// Twist of the model that these strings have now, rad.
    pub twist_rad: f64,
    /// Slope of that twist by the shaft's, where they touch.
    slope: f64,
    contact: f64,
}

impl Strings {
    /// New strings on a mechanism, at the twist and under the load of the start.
    pub fn new(model: &Parameters, settings: &PlantSettings) -> Self {
        let twist_rad = settings.twist_at_boot_rad;
        // The law by the twist has an exponent of its own, which `PlantSettings::distort` shifts.
        let by_length = model.radius_law == RadiusLaw::LengthRatio;
        let mut strings = Self {
            model: *model,
            play: Play::new(settings.twist_play_rad, twist_rad),
            bedding: Bedding::new(settings.string_bedding, twist_rad),
            creep: Creep::new(settings.string_creep, 0.5 / model.stiffness_n_per_m),
            radius_fraction: 1.0,
            exponent_shift: if by_length { settings.twist_exponent_shift } else { 0.0 },
            twist_rad: 0.0,
            slope: 1.0,
            contact: 1.0,
        };
        strings.turn(twist_rad, settings.load_n);
        strings
    }

    /// Takes the shaft to a twist (rad), with a pull (N) on the strings.
    pub fn turn(&mut self, shaft_rad: f64, pull_n: f64) {
        let own_rad = self.play.step(shaft_rad);
        self.radius_fraction = self.bedding.step(own_rad);
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
        let factor = self.radius_fraction * (twist / PI).max(1.0).powf(shift);
        if factor == 1.0 || twist == 0.0 {
            return (own_rad, 1.0);
        }
        // The part of the radius by the length does not depend on the twist, so that any length will do.
        let radius = |twist: f64| self.model.radius(pull_n.max(SLACK_LOAD_N), twist, 1.0, 1.0);
        let here = radius(twist);
        let (arc, slope) = (factor * twist * here.radius_m, factor * (here.arc_by_twist + shift * here.radius_m));
        // Newton's method, in two steps: the arc is nearly proportional to the twist.
        let mut model = factor * twist;
        for _ in 0..2 {
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

/// Play between an input and an output, in the unit of both: the output follows the input at a distance of at most half the
/// play. What pulls at the output reaches the input only where the two touch, at either end of the play. If it did in
/// between, where the output stands, it would do work on the input for nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Play {
    half_width: f64,
    output: f64,
}

impl Play {
    /// Play of a whole width, its output in the middle at `at`.
    pub fn new(width: f64, at: f64) -> Self {
        Self { half_width: 0.5 * width, output: at }
    }

    /// Takes the input to a new value and returns the output.
    pub fn step(&mut self, input: f64) -> f64 {
        self.output = self.output.clamp(input - self.half_width, input + self.half_width);
        self.output
    }

    /// Fraction of a pull at the output that reaches the input: 1 at the ends of the play, 0 between them. It rises over a
    /// share of half the play, as a contact that gives: its rise at one end takes what its rise at the other gives.
    pub fn contact(&self, input: f64) -> f64 {
        if self.half_width <= 0.0 {
            return 1.0;
        }
        let open = 1.0 - (input - self.output).abs() / self.half_width;
        (1.0 - open / CONTACT).clamp(0.0, 1.0)
    }
}

/// Run-in of new strings: the fraction of their radius that is left falls over the first cycles of twisting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bedding {
    /// Fraction of the radius that is lost in the end.
    fraction: f64,
    turned_rad: f64,
    last_rad: f64,
}

impl Bedding {
    /// New strings, twisted to an angle (rad), that lose a fraction of their radius in the end.
    pub fn new(fraction: f64, twist_rad: f64) -> Self {
        Self { fraction, turned_rad: 0.0, last_rad: twist_rad }
    }

    /// Takes the twist (rad) to a new value and returns the radius as a fraction of the new one.
    pub fn step(&mut self, twist_rad: f64) -> f64 {
        self.turned_rad += (twist_rad - self.last_rad).abs();
        self.last_rad = twist_rad;
        let cycles = self.turned_rad / (TURNS_PER_CYCLE * TAU);
        1.0 + self.fraction * (-cycles / RUN_IN_CYCLES).exp_m1()
    }
}

/// Stretch of the strings beyond the elastic one: Kelvin elements in series with it. A string under the load F is longer by
/// F/2K at once. Each element adds its fraction of that with its own time: τ dx/dt = c F − x. A spring and a dashpot beside each
/// other store or lose what the load does to them and create nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Creep {
    /// Compliance of each element, m/N.
    compliance: f64,
    stretch_m: [f64; CREEP_TIMES_S.len()],
}

impl Creep {
    /// Elements that in the end add `fraction` of the elastic compliance 1/2K (m/N), and have added nothing yet.
    pub fn new(fraction: f64, elastic_m_per_n: f64) -> Self {
        Self {
            compliance: fraction * elastic_m_per_n / CREEP_TIMES_S.len() as f64,
            stretch_m: [0.0; CREEP_TIMES_S.len()],
        }
    }

    /// One step of `h` seconds under a load (N); exact for a load that stays. Returns the stretch, m.
    pub fn step(&mut self, h: f64, load_n: f64) -> f64 {
        for (stretch, time_s) in self.stretch_m.iter_mut().zip(CREEP_TIMES_S) {
            *stretch += (self.compliance * load_n - *stretch) * -(-h / time_s).exp_m1();
        }
        self.stretch_m()
    }

    /// The stretch now, m.
    pub fn stretch_m(&self) -> f64 {
        self.stretch_m.iter().sum()
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

    const IDEAL: fn() -> PlantSettings =
        || PlantSettings { twist_at_boot_rad: 0.0, load_n: 5.0, ..PlantSettings::default() };

    fn strings(name: &str, settings: &PlantSettings) -> Strings {
        Strings::new(&model(name), settings)
    }

    #[test]
    fn strings_without_sizes_are_those_of_the_model() {
        let mut strings = strings("default", &IDEAL());
        for shaft in [4.0, -30.0, 12.3] {
            strings.turn(shaft, 5.0);
            strings.stretch(1e-3, 10.0);
            assert_eq!((strings.twist_rad, strings.torque_nm(0.1), strings.stretch_m()), (shaft, 0.1, 0.0));
        }
    }

    #[test]
    fn thinner_strings_have_their_arc_at_a_smaller_twist_of_the_model() {
        let mut strings = strings("default", &PlantSettings { string_bedding: 0.05, ..IDEAL() });
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
        let strings = strings("paper-printed", &PlantSettings { twist_exponent_shift: 0.05, ..IDEAL() });
        assert_eq!(strings.model_twist(3.0, 5.0), (3.0, 1.0));
        let (twist, slope) = strings.model_twist(15.0 * PI, 5.0);
        assert!((twist / (15.0 * PI) - 15f64.powf(0.05)).abs() < 1e-12, "{twist}");
        let (near, _) = strings.model_twist(15.0 * PI + 1e-6, 5.0);
        assert!(((near - twist) / 1e-6 - slope).abs() < 1e-6);
    }

    #[test]
    fn a_pull_reaches_the_input_at_the_ends_only_and_gives_no_work_in_a_loop() {
        let mut play = Play::new(0.2, 0.0);
        // Once round a loop of the input against a pull of -1: the work, and how far it went without the pull.
        let mut round = || {
            let (mut work, mut last, mut free) = (0.0, 0.0, 0.0);
            for k in 0..=40_000 {
                let input = f64::from(if k <= 20_000 { k } else { 40_000 - k }) * 1e-4;
                let before = play.contact(last);
                play.step(input);
                let after = play.contact(input);
                free += if k > 10_000 && after == 0.0 { 1e-4 } else { 0.0 };
                work += 0.5 * (before + after) * (input - last);
                last = input;
            }
            (work, free)
        };
        // The first way up starts in the middle of the play; a second loop is closed.
        let (_, free) = round();
        assert!((free - 0.2 * (1.0 - CONTACT)).abs() < 1e-3, "{free} of 0.2 without a pull");
        let (work, _) = round();
        assert!(work.abs() < 1e-6, "{work}");
    }

    #[test]
    fn the_radius_falls_over_twenty_cycles_and_never_rises() {
        let mut bedding = Bedding::new(0.05, 0.0);
        let cycle = |bedding: &mut Bedding| {
            bedding.step(7.5 * TAU);
            bedding.step(0.0)
        };
        let first = cycle(&mut bedding);
        assert!((first - (1.0 - 0.05 * (1.0 - (-0.05f64).exp()))).abs() < 1e-12, "{first}");
        let mut last = first;
        for _ in 1..20 {
            let now = cycle(&mut bedding);
            assert!(now < last);
            last = now;
        }
        assert!((last - (1.0 - 0.05 * (1.0 - (-1f64).exp()))).abs() < 1e-12, "{last}");
        assert!((0..1000).map(|_| cycle(&mut bedding)).last().unwrap() > 0.95 - 1e-9);
    }

    #[test]
    fn it_takes_its_times_and_reaches_its_share() {
        let (load_n, elastic) = (5.0, 1.0 / (2.0 * 1370.0));
        let mut creep = Creep::new(0.3, elastic);
        let mut at = |seconds: u32| {
            (0..seconds * 100).for_each(|_| {
                creep.step(0.01, load_n);
            });
            creep.stretch_m() / (0.1 * elastic * load_n)
        };
        let expected = |t: f64| CREEP_TIMES_S.iter().map(|time| 1.0 - (-t / time).exp()).sum::<f64>();
        assert!((at(3) - expected(3.0)).abs() < 1e-9);
        assert!((at(57) - expected(60.0)).abs() < 1e-9);
        assert!((at(20_000) - 3.0).abs() < 1e-4, "a third each");
    }

    #[test]
    fn a_released_string_gives_back_less_than_was_put_in() {
        let mut creep = Creep::new(0.3, 4e-4);
        let (mut energy_j, mut last_m) = (0.0, 0.0);
        for k in 0..400_000u32 {
            let load_n = if k < 20_000 { 10.0 } else { 2.0 };
            let now_m = creep.step(0.01, load_n);
            energy_j += load_n * (now_m - last_m);
            last_m = now_m;
        }
        // What stays stored under 2 N is c F²/2 for each element.
        let stored = 0.5 * 0.3 * 4e-4 * 4.0;
        assert!(energy_j > stored, "{energy_j} J put in, {stored} J stored");
    }
}
