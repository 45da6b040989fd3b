//! Other ways to solve the same equations, each complete, so that they can be compared and fail in their own ways.
//!
//! - `shooting`: the paper's own (its Fig. 5): a guessed clamp moment, Newton–Raphson, fixed-step Runge–Kutta, and an
//!   outer relaxation of the helix angle; and the same with an adaptive integrator of high order.
//! - `collocation`: all points of the rod at once.
//! - `continuation`: load and then twist raised from nothing.
//!
//! The first integral itself is [`crate::Mechanism::solve`]. Only it promises the right branch.

mod collocation;
mod continuation;
mod ode;
mod shooting;

use crate::error::SolveError;
use crate::helix::State;
use crate::mechanism::{Equilibrium, Mechanism};
use crate::quadrature::MAX_NODES;
use crate::scalar::Scalar;

pub use collocation::MAX_INTERVALS;

/// A method of solution with its effort.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// First integral with Gauss–Legendre quadrature and Newton in both unknowns.
    FirstIntegral {
        /// Quadrature nodes; `None` doubles them until the residual agrees.
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

    /// The same method with as many steps (nodes, Runge–Kutta steps, intervals or load steps). `None` where it has
    /// none: an adaptive integrator chooses its own.
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

    /// The same method with another tolerance. `None` where it has none: the first integral iterates to rounding.
    pub fn with_tolerance(self, tolerance: f64) -> Option<Self> {
        Some(match self {
            Self::FirstIntegral { .. } | Self::Continuation { .. } => return None,
            Self::Paper { steps, relaxation, .. } => Self::Paper { steps, relaxation, tolerance },
            #[cfg(feature = "ode")]
            Self::AdaptiveShooting { .. } => Self::AdaptiveShooting { tolerance },
            Self::Collocation { intervals, .. } => Self::Collocation { intervals, tolerance },
        })
    }
}

impl Mechanism {
    /// The equilibrium at a load (N) and a twist (rad) by another method. Its `residual` is that of the method's own
    /// discrete equations, its derivatives those of its own discrete solution.
    ///
    /// # Errors
    /// As [`Mechanism::solve`]; also [`SolveError::Diverged`] where the method fails although a solution may exist.
    pub fn solve_by(&self, method: Method, load_n: f64, twist_rad: f64) -> Result<Equilibrium, SolveError> {
        let found = match method {
            Method::FirstIntegral { points: None } => self.formal(load_n, twist_rad)?,
            Method::FirstIntegral { points: Some(points) } => self.clone().points(points).formal(load_n, twist_rad)?,
            Method::Continuation { steps } => self.continued(&State::new(load_n, twist_rad)?, steps)?,
            _ if self.is_rigid() => self.formal(load_n, twist_rad)?,
            Method::Paper { steps, relaxation, tolerance } => {
                shooting::paper(self, &State::new(load_n, twist_rad)?, steps, relaxation, tolerance)?
            }
            #[cfg(feature = "ode")]
            Method::AdaptiveShooting { tolerance } => {
                let mut evaluations = 0;
                let state = State::new(load_n, twist_rad)?;
                let mut found = self.balance(&state, None, tolerance.max(f64::PRECISION), &mut |force| {
                    shooting::adaptive(&self.rod, force, tolerance, &mut evaluations)
                })?;
                found.evaluations = evaluations;
                found
            }
            Method::Collocation { intervals, tolerance } => {
                let mut evaluations = 0;
                let state = State::new(load_n, twist_rad)?;
                let mut found = self.balance(&state, None, tolerance.max(f64::PRECISION), &mut |force| {
                    collocation::respond(&self.rod, force, intervals, tolerance, &mut evaluations)
                })?;
                found.evaluations = evaluations;
                found
            }
        };
        self.possible(found)
    }
}
