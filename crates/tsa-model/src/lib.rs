//! Physics of the load-adaptive twisted-string actuator, in f64.
//!
//! A motor twists two strings held apart by two superelastic rods; the load bends the rods and so changes the
//! transmission ratio. Equation numbers are those of Xu, Dong and Wang, "Design and Modeling of a Simple-Structured
//! Continuously Variable Transmission … for Twisted String Actuator", with its misprints mended.
//!
//! - [`material`]: the stress–strain polynomial (eq. 12).
//! - [`section`]: a round section in tension and bending (eqs 16, 17) and its inversion along the rod.
//! - [`rod`]: the cantilever that half a rod is (eqs 13–24), by its first integral.
//! - [`string`]: radius, stretch and helix of the strings (eqs 1–9).
//! - [`mechanism`]: both together (eqs 25–29): [`Mechanism::solve`] is the way in.
//! - [`methods`]: other ways to solve the same equations, to compare with.
//! - [`tiers`]: cheaper models of the rod that know about how wrong they are.
//! - [`scalar`]: f64, or numbers with their derivatives: `Mechanism<Dual<N>>` tells how results depend on constants.
//!
//! Builds without `std` (on `libm`), so that the board can run the same solver.

#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

pub mod error;
mod helix;
pub mod material;
pub mod mechanism;
pub mod methods;
pub mod parameters;
mod quadrature;
pub mod rod;
pub mod scalar;
pub mod section;
pub mod string;
pub mod tiers;

pub use error::{ParameterError, SolveError, Warnings};
pub use material::Material;
pub use mechanism::{Equilibrium, Mechanism};
pub use methods::Method;
pub use parameters::{Geometry, Parameters};
pub use string::{RadiusLaw, StringParameters};
pub use tiers::{Tier, TierError, Tiered};

/// Twist at the half-turn pre-twist, from which motor turns are counted (rad).
pub const PRETWIST_RAD: f64 = core::f64::consts::PI;

/// Twist of the strings after `turns` motor turns past the half-turn pre-twist (rad).
pub fn twist_from_turns(turns: f64) -> f64 {
    PRETWIST_RAD + core::f64::consts::TAU * turns
}
