//! The load on its rail, hung from the mechanism.
//!
//! `m G'' = W - S(θ, G) - c G' - β k(θ, G) G' - friction`, with the gap G growing as the load sinks, S the force that
//! the mechanism carries at (θ, G) and k = ∂S/∂G. S is that of the surface with the rods' additional force
//! ([`Rods`]), θ the twist that the strings really have, and a slow stretch adds to the gap ([`Strings`]). β stands for the damping within string and rods. It is assumed: 2 ms
//! gives a damping ratio of roughly 0.1 at 15 Hz.
//!
//! One step is the implicit mid-point rule on the linearised force, which neither feeds nor eats the energy of an
//! oscillation at any stiffness, with friction as a set-valued force: what sticks does not creep.

use super::effects::rods::{RodForce, Rods};
use super::effects::stribeck::{Stribeck, coulomb_n};
use super::effects::strings::Strings;
use super::outside::measured::TwoWays;
use super::surface::{Pull, Surface};
use crate::PlantSettings;
use crate::units::STANDARD_GRAVITY;

/// Damping within string and rods in proportion to stiffness, s. Assumed.
pub const STRUCTURAL_DAMPING_S: f64 = 2e-3;
/// Torque by twist past the point where the strings lie side by side, N m/rad. Assumed: stalls any small motor.
pub const HARD_STOP_NM_PER_RAD: f64 = 2.0;
/// The wall's maximum torque, N m: several times what the default motor can hold.
pub const HARD_STOP_MAX_NM: f64 = 5.0;
/// Minimum stiffness that a step is computed with, as a fraction of the surface's own.
const MIN_STIFFNESS: f64 = 0.2;
/// By how much the string slips through its clamp in the fault `string-slip`, m.
pub const SLIP_M: f64 = 3e-3;

/// State of the load.
#[derive(Clone, Debug)]
pub struct BuiltIn {
    /// What acts on it: load, friction, damping and temperature may change at any time.
    pub settings: PlantSettings,
    /// The interpolant in use.
    pub surface: Surface,
    strings: Strings,
    /// Stress of the rods beyond their law, where there may be any.
    pub rods: Option<Rods>,
    /// Measured gaps that differ by the way of the twist, and what they add now, m.
    pub two_ways: Option<TwoWays>,
    distance_m: f64,
    friction: Stribeck,
    /// Ends of the rail, as gaps, m. The load stops there without a bounce.
    stops_m: [f64; 2],
    /// Gap, m.
    pub gap_m: f64,
    /// Speed of the gap, m/s; positive sinks.
    pub speed_m_per_s: f64,
    /// What the surface carries, without the rods' additional force.
    law: Pull,
    rod_force: RodForce,
    broken: bool,
    slipped_m: f64,
}

impl BuiltIn {
    /// Hanging at rest under a weight.
    pub fn new(
        surface: Surface,
        stops_m: [f64; 2],
        strings: Strings,
        rods: Option<Rods>,
        settings: &PlantSettings,
    ) -> Self {
        let mut plant = Self {
            settings: settings.clone(),
            surface,
            strings,
            rods,
            two_ways: None,
            distance_m: 0.0,
            friction: Stribeck::default(),
            stops_m,
            gap_m: 0.0,
            speed_m_per_s: 0.0,
            law: Pull::default(),
            rod_force: RodForce::default(),
            broken: false,
            slipped_m: 0.0,
        };
        let twist_rad = plant.strings.twist_rad;
        let law_n = plant.law_under(twist_rad);
        plant.gap_m = plant.surface.gap(twist_rad, law_n).gap_m.clamp(stops_m[0], stops_m[1]);
        plant.law = plant.surface.pull(twist_rad, plant.gap_m, law_n);
        plant.look_at_rods();
        plant
    }

    /// What the mechanism does to the load now, N.
    pub fn pull_n(&self) -> f64 {
        self.law.force_n + self.rod_force.force_n
    }

    /// The gap at which the load would hang at a twist of the strings (rad) if it went there now, m.
    pub fn gap_at(&self, twist_rad: f64) -> f64 {
        let (twist_rad, _) = self.strings.model_twist(twist_rad, self.settings.load_n);
        self.surface.gap(twist_rad, self.law_under(twist_rad)).gap_m + self.strings.stretch_m()
    }

    /// What the surface carries when the load hangs at a twist (rad), N.
    fn law_under(&self, twist_rad: f64) -> f64 {
        let PlantSettings { load_n: weight_n, temperature_k, .. } = self.settings;
        self.rods.as_ref().map_or(weight_n, |rods| rods.law_under(weight_n, twist_rad, temperature_k))
    }

    fn look_at_rods(&mut self) {
        let Pull { force_n, stiffness_n_per_m, .. } = self.law;
        if let Some(rods) = &mut self.rods
            && !self.broken
        {
            self.rod_force = rods.step(force_n, stiffness_n_per_m, self.strings.twist_rad, self.settings.temperature_k);
        }
    }

    /// Torque of the string on the output shaft, N m, which untwists. That of the mechanism conserves energy
    /// ([`Surface::torque_nm`]); what the rods add by their memory acts through ∂G/∂θ. Past the last twist a wall is added, which
    /// depends on the true load.
    pub fn torque_nm(&self) -> f64 {
        if self.broken || self.pull_n() <= 0.0 {
            return 0.0;
        }
        let twist_rad = self.strings.twist_rad;
        let over = twist_rad.abs() - self.surface.hard_stop_rad(self.law.force_n.max(self.settings.load_n));
        let hard_stop = (HARD_STOP_NM_PER_RAD * over).clamp(0.0, HARD_STOP_MAX_NM).copysign(twist_rad);
        let by_rods_nm = self.rod_force.force_n * self.law.by_twist_m_per_rad;
        let mechanism_nm = self.surface.torque_nm(twist_rad, self.law.force_n);
        self.strings.torque_nm(mechanism_nm + by_rods_nm - hard_stop)
    }

    /// The string breaks: no pull and no torque from now on.
    pub fn break_string(&mut self) {
        self.broken = true;
        self.law = Pull::default();
        self.rod_force = RodForce::default();
    }

    /// The string slips through its clamp by [`SLIP_M`].
    pub fn slip(&mut self) {
        self.slipped_m += SLIP_M;
    }

    /// One step of `h` seconds with the output shaft at `shaft_rad`.
    pub fn step(&mut self, h: f64, shaft_rad: f64) {
        self.strings.turn(shaft_rad, self.pull_n());
        let pull_n = self.pull_n();
        if let Some(two_ways) = &mut self.two_ways {
            self.distance_m = two_ways.shift_m(self.strings.twist_rad, pull_n);
        }
        self.law = self.law_at(self.gap_m);
        self.look_at_rods();
        let mass = self.settings.load_n / STANDARD_GRAVITY;
        let law_stiffness = self.law.stiffness_n_per_m;
        // The law's first order in the additional stress must not turn the mechanism's stiffness around.
        let k = (law_stiffness + self.rod_force.stiffness_n_per_m).max(MIN_STIFFNESS * law_stiffness);
        let inertia = 2.0 * mass / h;
        // The mean speed over the step; friction may reduce it to zero.
        let push = inertia * self.speed_m_per_s + self.settings.load_n - self.pull_n();
        let resistance = inertia + self.settings.damping_n_s_per_m + STRUCTURAL_DAMPING_S * k + 0.5 * h * k;
        let mean = self.friction.mean_speed(h, push, resistance, self.speed_m_per_s, &self.settings);
        self.strings.stretch(h, self.pull_n());
        let end = 2.0 * mean - self.speed_m_per_s;
        self.gap_m += h * mean;
        // A reversal within the step means that the load stood still on the way: it stays there if friction can hold
        // it.
        let turned = mean == 0.0 || end * mean < 0.0;
        self.speed_m_per_s = end;
        if turned && coulomb_n(&self.settings) > 0.0 {
            self.speed_m_per_s = 0.0;
        }
        let [upper, lower] = self.stops_m;
        if self.gap_m < upper || self.gap_m > lower {
            self.gap_m = self.gap_m.clamp(upper, lower);
            self.speed_m_per_s = 0.0;
        }
    }

    fn law_at(&self, gap_m: f64) -> Pull {
        if self.broken {
            return Pull::default();
        }
        let gap_m = gap_m - self.slipped_m - self.strings.stretch_m() - self.distance_m;
        self.surface.pull(self.strings.twist_rad, gap_m, self.law.force_n)
    }
}
