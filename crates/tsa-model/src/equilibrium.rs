//! The equilibrium at a load and a twist.

use crate::error::Warnings;
use crate::scalar::Scalar;

/// An equilibrium and its derivatives. SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equilibrium<T = f64> {
    /// Load Fz (N).
    pub load_n: f64,
    /// Twist θ (rad).
    pub twist_rad: f64,
    /// Helix angle α (rad).
    pub alpha_rad: T,
    /// Distance X between the attachments of the two rods (m), eq. 9.
    pub x_m: T,
    /// Span D of the bent rod (m), eq. 26.
    pub d_m: T,
    /// Axial tip displacement u(l) of half a rod (m).
    pub u_m: T,
    /// Lateral tip displacement w(l) (m).
    pub w_m: T,
    /// Radius r of the twisted pair (m), eq. 6.
    pub r_m: T,
    /// String tension (N), eq. 8.
    pub tension_n: T,
    /// Tip angle φ_l (rad).
    pub tip_angle_rad: T,
    /// Bending strain κ(0) R at the clamp.
    pub bending_strain: T,
    /// Gap G = X + 2w between the two clamps (m), with the measured correction: what the LVDT sees up to an offset.
    pub gap_m: T,
    /// ∂G/∂θ at constant load (m/rad).
    pub dgap_dtwist_m_per_rad: T,
    /// ∂G/∂F at constant twist (m/N).
    pub dgap_dload_m_per_n: T,
    /// Torque on the strings by the paper's relation, F tan α (r + θ ∂r/∂θ) (N m), docs/explanation/model.md section 4.
    pub torque_nm: T,
    /// Largest scaled residual of the two equations.
    pub residual: f64,
    /// Steps of the outermost iteration.
    pub iterations: u32,
    /// Evaluations of a section or of an ODE's right-hand side, over all iterations.
    pub evaluations: u32,
    /// What to take this with.
    pub warnings: Warnings,
}

impl<T: Scalar> Equilibrium<T> {
    /// Transmission ratio TR = −1/(∂G/∂θ) (rad/m), eq. 29. Infinite at zero twist.
    pub fn tr_rad_per_m(&self) -> T {
        T::of(-1.0) / self.dgap_dtwist_m_per_rad
    }
}

impl Equilibrium {
    /// TR (rad/m), but none at zero twist, where it is infinite.
    pub fn finite_tr_rad_per_m(&self) -> Option<f64> {
        // Turns are decimal and π is not, so "zero twist" is as near as rounding comes to it.
        Some(self.tr_rad_per_m()).filter(|tr| tr.is_finite() && self.twist_rad.abs() > 1e-12)
    }
}
