//! Where each method finds the right equilibrium, and how it fails elsewhere.
//!
//! The true state is on the branch that begins at the unloaded, untwisted rig and is followed in many small steps. The
//! default method does it otherwise: it solves at the state directly, and follows the branch, in large steps, only where
//! more than one equilibrium may exist.

use super::grid::Grid;
use super::limits::{self, Limits};
use rigctl::parallel::{Progress, parallel};
use rival_methods::Method;
use tsa_model::{Equilibrium, Mechanism, SolveError, twist_from_turns};

/// Steps of load and of twist in which the truth is followed, at least.
const STEPS: usize = 64;
/// An answer further from the true state than this (m) is another equilibrium: every method's own error is far smaller.
pub const ANOTHER_BRANCH_M: f64 = 1e-5;
/// An answer that takes this many times a method's usual effort is slow.
pub const SLOW: f64 = 5.0;

/// The outcome at one state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// The right equilibrium.
    Right,
    /// The right one, for more than [`SLOW`] times the method's usual effort.
    Slow,
    /// Another equilibrium, without an error.
    Wrong {
        /// How far its gap is from the right one (m).
        off_m: f64,
    },
    /// The iteration ends without an answer although there is an equilibrium.
    Diverged(SolveError),
    /// The method reports a limit of the model where there is none.
    Refused(SolveError),
    /// The method reports a limit of the model where there is one.
    Limit(SolveError),
    /// An answer where the branch from the unloaded state has ended.
    BeyondLimit,
}

impl Outcome {
    /// The outcome of a method's answer, given the true state.
    pub fn judge(truth: &Result<Equilibrium, SolveError>, answer: &Result<Equilibrium, SolveError>) -> Self {
        match (truth, answer) {
            (Ok(truth), Ok(e)) => {
                let off_m = (e.gap_m - truth.gap_m).abs();
                // Not `>`: NaN must not count as right.
                if off_m <= ANOTHER_BRANCH_M { Self::Right } else { Self::Wrong { off_m } }
            }
            (Ok(_), Err(e @ (SolveError::Diverged { .. } | SolveError::NotConverged { .. }))) => Self::Diverged(*e),
            (Ok(_), Err(e)) => Self::Refused(*e),
            (Err(_), Err(e)) => Self::Limit(*e),
            (Err(_), Ok(_)) => Self::BeyondLimit,
        }
    }

    /// Its name in the data.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Slow => "slow",
            Self::Wrong { .. } => "wrong-branch",
            Self::Diverged(_) => "diverged",
            Self::Refused(_) => "refused",
            Self::Limit(_) => "limit",
            Self::BeyondLimit => "beyond-limit",
        }
    }

    /// Whether this outcome is a defect of the method.
    pub fn is_failure(&self) -> bool {
        !matches!(self, Self::Right | Self::Slow | Self::Limit(_))
    }

    /// The error's name, where there is one.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Diverged(e) | Self::Refused(e) | Self::Limit(e) => e.kind(),
            _ => "",
        }
    }
}

/// A method of the map, under its own name where one method appears twice.
#[derive(Debug, Clone, Copy)]
pub struct Named {
    /// Name.
    pub name: &'static str,
    /// Method.
    pub method: Method,
}

/// Every method, the paper's also without damping, each with the effort that gives about 1e-6 m: more effort does not
/// change which branch it finds.
pub fn methods() -> Vec<Named> {
    let paper = |relaxation| Method::Paper { steps: 16, relaxation, tolerance: 1e-6 };
    let with_effort = |method: Method| match method {
        Method::AdaptiveShooting { .. } => Method::AdaptiveShooting { tolerance: 1e-6 },
        Method::Collocation { .. } => Method::Collocation { intervals: 32, tolerance: 1e-8 },
        method => method,
    };
    let named = |method: &Method| match method {
        Method::Paper { .. } => vec![
            Named { name: "paper, factor 1", method: paper(1.0) },
            Named { name: "paper, factor 0.5", method: paper(0.5) },
        ],
        method => vec![Named { name: method.name(), method: with_effort(*method) }],
    };
    Method::ALL.iter().flat_map(named).collect()
}

/// The equilibrium on the branch from the unloaded rig, or the limit that ends the branch.
///
/// # Errors
/// As [`Mechanism::solve`].
pub fn truth(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> Result<Equilibrium, SolveError> {
    Method::Continuation { steps: STEPS }.solve(mechanism, load_n, twist_rad)
}

/// One method over one rod.
#[derive(Debug, Clone)]
pub struct MethodMap {
    /// The method.
    pub name: &'static str,
    /// In the order of [`Grid::states`].
    pub outcomes: Vec<Outcome>,
    /// Evaluations of each answer; 0 where there is none.
    pub evaluations: Vec<u32>,
}

/// One rod, every method.
#[derive(Debug, Clone)]
pub struct Map {
    /// The limits of the rod's states.
    pub limits: Limits,
    /// Whether each state is known to have one equilibrium only.
    pub safe: Vec<bool>,
    /// The methods.
    pub methods: Vec<MethodMap>,
}

/// Judges every method on every state of the grid.
pub fn map(mechanism: &Mechanism, grid: &Grid, progress: &Progress<'_>) -> Map {
    let states = grid.states();
    let at = |k: usize| (states[k].0, twist_from_turns(states[k].1));
    let truths = parallel(progress, states.len(), |k| truth(mechanism, at(k).0, at(k).1));
    let mut methods: Vec<MethodMap> = methods()
        .into_iter()
        .map(|Named { name, method }| {
            let answers = parallel(progress, states.len(), |k| method.solve(mechanism, at(k).0, at(k).1));
            let outcomes = truths.iter().zip(&answers).map(|(t, a)| Outcome::judge(t, a)).collect();
            let evaluations = answers.iter().map(|a| a.as_ref().map_or(0, |e| e.evaluations)).collect();
            MethodMap { name, outcomes, evaluations }
        })
        .collect();
    methods.iter_mut().for_each(mark_slow);
    let safe = (0..states.len()).map(|k| limits::is_safe(mechanism, at(k).0, at(k).1)).collect();
    Map { limits: Limits::new(mechanism, grid, progress), safe, methods }
}

fn mark_slow(map: &mut MethodMap) {
    let right = map.outcomes.iter().zip(&map.evaluations).filter(|(o, _)| **o == Outcome::Right);
    let mut effort: Vec<u32> = right.map(|(_, evaluations)| *evaluations).collect();
    effort.sort_unstable();
    let Some(&usual) = effort.get(effort.len() / 2) else { return };
    for (outcome, evaluations) in map.outcomes.iter_mut().zip(&map.evaluations) {
        if *outcome == Outcome::Right && f64::from(*evaluations) > SLOW * f64::from(usual) {
            *outcome = Outcome::Slow;
        }
    }
}
