//! Physics of the load-adaptive twisted-string actuator, in f64.
//!
//! A motor twists two strings held apart by two superelastic rods; the load bends the rods and so changes the
//! transmission ratio. Equation numbers are those of Xu, Dong and Wang, "Design and Modeling of a Simple-Structured
//! Continuously Variable Transmission … for Twisted String Actuator", with its misprints corrected.
//!
//! - [`material`]: the stress–strain polynomial (eq. 12).
//! - [`section`]: a round section in tension and bending (eqs 16, 17) and its inversion along the rod.
//! - [`rod`]: the cantilever that half a rod is (eqs 13–24), by its first integral.
//! - [`string`]: radius, stretch and helix of the strings (eqs 1–9).
//! - [`helix`]: the equation that strings and rods share (eq. 25), with derivatives.
//! - [`correction`]: what the law misses of one rig's gap, as measured.
//! - [`mechanism`]: the solver (eqs 25–29): [`Mechanism::solve`] is the entry point, [`equilibrium`] its result.
//! - `balance`, `continuation`: [`Mechanism::balance`] solves with any model of the rod, [`Mechanism::continued`]
//!   follows the solution from the unloaded state.
//! - [`tiers`]: cheaper models of the rod, each with an estimate of its error.
//! - [`quadrature`]: the rules by which the rod is integrated.
//! - [`scalar`]: f64, or numbers with derivatives: `Mechanism<Dual<N>>` gives how results depend on constants.
//!
//! Builds without `std` (on `libm`), so that the board's self-test can compare its table with the same solver.

#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

mod balance;
mod continuation;
pub mod correction;
pub mod equilibrium;
pub mod error;
pub mod helix;
pub mod material;
pub mod mechanism;
pub mod parameters;
pub mod quadrature;
pub mod rod;
pub mod scalar;
pub mod section;
pub mod string;
pub mod tiers;

pub use correction::Correction;
pub use equilibrium::Equilibrium;
pub use error::{ParameterError, SolveError, Warnings};
pub use material::Material;
pub use mechanism::Mechanism;
pub use parameters::{Geometry, Parameters};
pub use string::{RadiusLaw, StringParameters};
pub use tiers::{Tier, TierError, Tiered};

/// Twist at the half-turn pre-twist, from which motor turns are counted (rad).
pub const PRETWIST_RAD: f64 = core::f64::consts::PI;

/// Load (N) below which strings count as slack: their shortening and their torque are then proportional to the load.
pub const SLACK_LOAD_N: f64 = 0.3;
/// Where the gap falls faster with the twist than this (m/rad), the equilibrium is about to run away (docs/explanation/model.md 5): no
/// patch and no straight line follows it.
pub const STEEPEST_M_PER_RAD: f64 = 5e-3;

/// Twist of the strings after `turns` motor turns past the half-turn pre-twist (rad).
pub fn twist_from_turns(turns: f64) -> f64 {
    PRETWIST_RAD + core::f64::consts::TAU * turns
}
