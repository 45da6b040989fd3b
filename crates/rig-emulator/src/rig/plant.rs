//! The load on its rail, hung from the mechanism.
//!
//! `m G'' = W - S(θ, G) - c G' - β k(θ, G) G' - Coulomb`, with the gap G growing as the load sinks, S the force that
//! the mechanism carries at (θ, G) and k = ∂S/∂G. β stands for the damping within string and rods. It is assumed: 2 ms
//! gives a damping ratio of roughly 0.1 at 15 Hz.
//!
//! One step is the implicit mid-point rule on the linearised force, which neither feeds nor eats the energy of an
//! oscillation at any stiffness, with friction as a set-valued force: what sticks does not creep.

use super::surface::{Pull, Surface};
use sim_link::units::STANDARD_GRAVITY;

/// Damping within string and rods in proportion to stiffness, s. Assumed.
pub const STRUCTURAL_DAMPING_S: f64 = 2e-3;
/// Torque by twist past the point where the strings lie side by side, N m/rad. Assumed: stalls any small motor.
pub const WALL_NM_PER_RAD: f64 = 2.0;
/// The wall's greatest torque, N m: several times what the default motor can hold.
pub const WALL_MAX_NM: f64 = 5.0;
/// By how much the string slips through its clamp in the fault `string-slip`, m.
pub const SLIP_M: f64 = 3e-3;

/// State of the load.
#[derive(Clone, Debug)]
pub struct Plant {
    surface: Surface,
    /// Ends of the rail, as gaps, m. The load stops there without a bounce.
    pub stops_m: [f64; 2],
    /// Gap, m.
    pub gap_m: f64,
    /// Speed of the gap, m/s; positive sinks.
    pub speed_m_per_s: f64,
    pull: Pull,
    twist_rad: f64,
    broken: bool,
    slipped_m: f64,
}

/// What acts on the load besides the mechanism.
#[derive(Clone, Copy, Debug)]
pub struct Rail {
    /// Weight, N; the inertia is weight / g.
    pub weight_n: f64,
    /// Coulomb friction, N.
    pub friction_n: f64,
    /// Viscous damping, N s/m.
    pub damping_n_s_per_m: f64,
}

impl Plant {
    /// Hanging at rest at a twist under a weight.
    pub fn new(surface: Surface, stops_m: [f64; 2], twist_rad: f64, weight_n: f64) -> Self {
        let gap_m = surface.gap(twist_rad, weight_n).gap_m.clamp(stops_m[0], stops_m[1]);
        let pull = surface.pull(twist_rad, gap_m, weight_n);
        Self { surface, stops_m, gap_m, speed_m_per_s: 0.0, pull, twist_rad, broken: false, slipped_m: 0.0 }
    }

    /// The interpolant in use.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// What the mechanism does to the load now.
    pub fn pull(&self) -> Pull {
        self.pull
    }

    /// Torque of the string on the output shaft, N m. Lossless: S dG = τ dθ at constant load, so τ = S ∂G/∂θ, which
    /// untwists. Past the last twist a wall is added, which depends on the true load.
    pub fn torque_nm(&self, rail: &Rail) -> f64 {
        if self.broken || self.pull.force_n <= 0.0 {
            return 0.0;
        }
        let over = self.twist_rad.abs() - self.surface.wall_rad(self.pull.force_n.max(rail.weight_n));
        let wall = (WALL_NM_PER_RAD * over).clamp(0.0, WALL_MAX_NM).copysign(self.twist_rad);
        self.pull.force_n * self.pull.by_twist_m_per_rad - wall
    }

    /// The string breaks: no pull and no torque from now on.
    pub fn break_string(&mut self) {
        self.broken = true;
        self.pull = Pull::default();
    }

    /// The string slips through its clamp by [`SLIP_M`].
    pub fn slip(&mut self) {
        self.slipped_m += SLIP_M;
    }

    /// One step of `h` seconds with the string at `twist_rad`.
    pub fn step(&mut self, h: f64, twist_rad: f64, rail: &Rail) {
        self.twist_rad = twist_rad;
        self.pull = self.pull_at(self.gap_m);
        let mass = rail.weight_n / STANDARD_GRAVITY;
        let k = self.pull.stiffness_n_per_m;
        let inertia = 2.0 * mass / h;
        // The mean speed over the step; friction may reduce it to zero.
        let push = inertia * self.speed_m_per_s + rail.weight_n - self.pull.force_n;
        let free = (push.abs() - rail.friction_n).max(0.0).copysign(push);
        let mean = free / (inertia + rail.damping_n_s_per_m + STRUCTURAL_DAMPING_S * k + 0.5 * h * k);
        let end = 2.0 * mean - self.speed_m_per_s;
        self.gap_m += h * mean;
        // A reversal within the step means that the load stood still on the way: it stays there if friction can hold
        // it.
        let turned = mean == 0.0 || end * mean < 0.0;
        self.speed_m_per_s = end;
        if turned && rail.friction_n > 0.0 {
            self.speed_m_per_s = 0.0;
        }
        let [upper, lower] = self.stops_m;
        if self.gap_m < upper || self.gap_m > lower {
            self.gap_m = self.gap_m.clamp(upper, lower);
            self.speed_m_per_s = 0.0;
        }
    }

    fn pull_at(&self, gap_m: f64) -> Pull {
        if self.broken {
            return Pull::default();
        }
        self.surface.pull(self.twist_rad, gap_m - self.slipped_m, self.pull.force_n)
    }
}
