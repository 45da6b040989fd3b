//! Other methods for the equations of [`tsa_model`], each complete, so that speed, accuracy and failures can be
//! compared.
//!
//! - `shooting`: the paper's own (its Fig. 5): a guessed clamp moment, Newton–Raphson, fixed-step Runge–Kutta, and an
//!   outer relaxation of the helix angle.
//! - `adaptive` (feature `ode`): shooting with an adaptive integrator of high order.
//! - `collocation`: all points of the rod at once.
//! - `ode`: the differential equations that these integrate.
//!
//! The first integral and the continuation are [`tsa_model`]'s own; only these guarantee the right branch.
//!
//! Builds without `std`, so that the cost of a method can be measured on the board.

#![cfg_attr(not(feature = "ode"), no_std)]
#![forbid(unsafe_code)]

#[cfg(feature = "ode")]
mod adaptive;
mod collocation;
mod ode;
mod shooting;

use tsa_model::helix::State;
use tsa_model::quadrature::MAX_NODES;
use tsa_model::scalar::PRECISION;
use tsa_model::{Equilibrium, Mechanism, SolveError};

pub use collocation::MAX_INTERVALS;

/// A method of solution with its effort.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// First integral with Gauss–Legendre quadrature and Newton in both unknowns.
    FirstIntegral {
        /// Quadrature nodes; `None` doubles them until the residual is small enough.
        points: Option<usize>,
    },
    /// The paper's (section 4.1 and Fig. 5): shooting along the rod with Newton–Raphson and classical Runge–Kutta of
    /// fixed steps, inside a relaxation of the helix angle: α ← α + ω (atan(H/X) − α).
    Paper {
        /// Runge–Kutta steps along half a rod.
        steps: usize,
        /// Relaxation factor ω; the paper names none, 0.5 is assumed.
        relaxation: f64,
        /// Change of the helix angle (rad) and relative change of the clamp moment at which it stops.
        tolerance: f64,
    },
    /// Shooting with an adaptive integrator (DOP853 of the crate `differential-equations`); Newton on eq. 25.
    #[cfg(feature = "ode")]
    AdaptiveShooting {
        /// Relative and absolute tolerance of the integrator.
        tolerance: f64,
    },
    /// Three-point Lobatto collocation (fourth order) on equal intervals; Newton on eq. 25.
    Collocation {
        /// Intervals along half a rod, 1 to [`MAX_INTERVALS`].
        intervals: usize,
        /// Relative change of the solution at which Newton stops.
        tolerance: f64,
    },
    /// First integral, with Newton followed from the unloaded and untwisted state: load in steps, then twist.
    Continuation {
        /// Steps of each; made smaller where Newton does not follow.
        steps: usize,
    },
}

impl Method {
    /// Every method with the effort that gives about 1e-9 m on the paper's rig.
    pub const ALL: &'static [Self] = &[
        Self::FirstIntegral { points: None },
        Self::Paper { steps: 100, relaxation: 0.5, tolerance: 1e-10 },
        #[cfg(feature = "ode")]
        Self::AdaptiveShooting { tolerance: 1e-10 },
        Self::Collocation { intervals: 64, tolerance: 1e-10 },
        Self::Continuation { steps: 8 },
    ];

    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::FirstIntegral { .. } => "first-integral",
            Self::Paper { .. } => "paper",
            #[cfg(feature = "ode")]
            Self::AdaptiveShooting { .. } => "adaptive-shooting",
            Self::Collocation { .. } => "collocation",
            Self::Continuation { .. } => "continuation",
        }
    }

    /// The method of that name with its default effort.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|m| m.name() == name)
    }

    /// The same method with this number of steps (nodes, Runge–Kutta steps, intervals or load steps). `None` for an
    /// adaptive integrator, which chooses its own.
    pub fn with_steps(self, steps: usize) -> Option<Self> {
        Some(match self {
            Self::FirstIntegral { .. } => Self::FirstIntegral { points: Some(steps.clamp(1, MAX_NODES)) },
            Self::Paper { relaxation, tolerance, .. } => Self::Paper { steps: steps.max(1), relaxation, tolerance },
            #[cfg(feature = "ode")]
            Self::AdaptiveShooting { .. } => return None,
            Self::Collocation { tolerance, .. } => {
                Self::Collocation { intervals: steps.clamp(1, MAX_INTERVALS), tolerance }
            }
            Self::Continuation { .. } => Self::Continuation { steps: steps.max(1) },
        })
    }

    /// The same method with another tolerance. `None` for the first integral, which iterates to rounding.
    pub fn with_tolerance(self, tolerance: f64) -> Option<Self> {
        Some(match self {
            Self::FirstIntegral { .. } | Self::Continuation { .. } => return None,
            Self::Paper { steps, relaxation, .. } => Self::Paper { steps, relaxation, tolerance },
            #[cfg(feature = "ode")]
            Self::AdaptiveShooting { .. } => Self::AdaptiveShooting { tolerance },
            Self::Collocation { intervals, .. } => Self::Collocation { intervals, tolerance },
        })
    }

    /// The equilibrium at a load (N) and a twist (rad). Its `residual` is that of the method's own discrete equations,
    /// its derivatives those of its own discrete solution.
    ///
    /// # Errors
    /// As [`Mechanism::solve`]; also [`SolveError::Diverged`] where the method fails although a solution may exist.
    pub fn solve(self, mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> Result<Equilibrium, SolveError> {
        let m = mechanism;
        let state = || State::new(load_n, twist_rad);
        let mut evaluations = 0;
        let found = match self {
            Self::FirstIntegral { points: None } => m.formal(load_n, twist_rad)?,
            Self::FirstIntegral { points: Some(points) } => m.clone().with_points(points).formal(load_n, twist_rad)?,
            Self::Continuation { steps } => m.continued(&state()?, steps)?,
            _ if m.is_rigid() => m.formal(load_n, twist_rad)?,
            Self::Paper { steps, relaxation, tolerance } => {
                shooting::paper(m, &state()?, steps, relaxation, tolerance)?
            }
            #[cfg(feature = "ode")]
            Self::AdaptiveShooting { tolerance } => {
                let mut rod = |force| adaptive::respond(m.rod(), force, tolerance, &mut evaluations);
                let found = m.balance(&state()?, None, tolerance.max(PRECISION), &mut rod)?;
                Equilibrium { evaluations, ..found }
            }
            Self::Collocation { intervals, tolerance } => {
                let mut rod = |force| collocation::respond(m.rod(), force, intervals, tolerance, &mut evaluations);
                let found = m.balance(&state()?, None, tolerance.max(PRECISION), &mut rod)?;
                Equilibrium { evaluations, ..found }
            }
        };
        m.possible(found)
    }
}
