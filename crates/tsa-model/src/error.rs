//! Why a parameter is refused, why a solve stops, and the warnings that a solution carries.

use core::fmt;

/// A parameter that cannot describe a real mechanism.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{parameter} = {value}: {reason}")]
pub struct ParameterError {
    /// Key of the parameter in a scene file, for example `geometry.rod_radius_m`.
    pub parameter: &'static str,
    /// The value that was refused.
    pub value: f64,
    /// The requirement.
    pub reason: &'static str,
}

/// Refuses a value that is not good.
///
/// # Errors
/// [`ParameterError`] with these parts.
pub fn require(good: bool, parameter: &'static str, value: f64, reason: &'static str) -> Result<(), ParameterError> {
    if good { Ok(()) } else { Err(ParameterError { parameter, value, reason }) }
}

/// Refuses the first value that is not above 0 and finite.
///
/// # Errors
/// [`ParameterError`] naming that value's key.
pub fn positive(values: &[(&'static str, f64)]) -> Result<(), ParameterError> {
    let good = |value: f64| value > 0.0 && value.is_finite();
    values
        .iter()
        .try_for_each(|&(parameter, value)| require(good(value), parameter, value, "must be above 0 and finite"))
}

/// The limit of the model that stopped a solve (docs/explanation/model.md section 5).
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// The load or the twist is NaN or infinite.
    #[error("{parameter} = {value} is not a finite number")]
    NotFinite {
        /// `load` or `twist`.
        parameter: &'static str,
        /// The value.
        value: f64,
    },
    /// A slack string has no law: the radius 1/(k1 F) grows without bound as the load vanishes (eq. 6).
    #[error("load {load_n} N: a slack string has no law, the load must be above {minimum_n} N")]
    Slack {
        /// The requested load (N).
        load_n: f64,
        /// The least load that is solved (N).
        minimum_n: f64,
    },
    /// The strings would have to be shorter than the two helices laid side by side: X < r0 |θ|/π.
    #[error("overtwist: {length_m:.6} m between the rods, but {needed_m:.6} m of string lie side by side")]
    Overtwist {
        /// Distance between the attachments at the formal equilibrium (m).
        length_m: f64,
        /// Minimum distance that two strings of diameter r0 allow (m).
        needed_m: f64,
    },
    /// No helix angle balances strings and rods.
    #[error("no equilibrium at load {load_n:.4} N and twist {twist_rad:.3} rad: reduce the turns or raise the load")]
    NoEquilibrium {
        /// Load (N).
        load_n: f64,
        /// Twist (rad).
        twist_rad: f64,
    },
    /// The section's tangent vanished: flat or falling stress–strain curve.
    #[error("section tangent vanishes at a bending strain of {bending_strain:.5}: stress–strain curve flat or falling")]
    SectionSingular {
        /// Bending strain κR where it happened.
        bending_strain: f64,
    },
    /// A strain far outside the range to which the fifth-order polynomial of eq. 12 was fitted.
    #[error("strain {strain:.4} at the clamp is outside the range of the stress–strain fit (|ε| ≤ {limit})")]
    StrainRange {
        /// Largest fibre strain.
        strain: f64,
        /// The limit.
        limit: f64,
    },
    /// The section's law is too close to flat somewhere along the rod for the quadrature's most nodes.
    #[error(
        "{nodes} nodes do not resolve the rod at load {load_n:.4} N: half as many miss its length by {missed:.1e} of it"
    )]
    Unresolved {
        /// Load (N).
        load_n: f64,
        /// Nodes tried.
        nodes: usize,
        /// Relative error of the rod's length with half as many nodes.
        missed: f64,
    },
    /// The branch of equilibria that starts at the unloaded state folds back before the twist is reached.
    #[error("the branch from the unloaded state folds back at {twist_rad:.3} rad under {load_n:.4} N")]
    Fold {
        /// Load (N).
        load_n: f64,
        /// Twist that is reached (rad).
        twist_rad: f64,
    },
    /// The state is outside the range of a cheaper tier.
    #[error("tier {tier} needs {limit}")]
    TierRange {
        /// The tier.
        tier: &'static str,
        /// The condition that is not met.
        limit: &'static str,
    },
    /// A method failed where another may succeed.
    #[error("{stage} does not converge")]
    Diverged {
        /// The stage that failed.
        stage: &'static str,
    },
    /// The iteration did not reach its tolerance.
    #[error("no convergence at load {load_n:.4} N and twist {twist_rad:.3} rad: residual {residual:.1e}")]
    NotConverged {
        /// Load (N).
        load_n: f64,
        /// Twist (rad).
        twist_rad: f64,
        /// Largest scaled residual left.
        residual: f64,
    },
}

impl SolveError {
    /// Short stable name of the limit, for messages that machines read.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::NotFinite { .. } => "not-finite",
            Self::Slack { .. } => "slack",
            Self::Overtwist { .. } => "overtwist",
            Self::NoEquilibrium { .. } => "no-equilibrium",
            Self::SectionSingular { .. } => "section-singular",
            Self::StrainRange { .. } => "strain-range",
            Self::Unresolved { .. } => "unresolved",
            Self::Fold { .. } => "fold",
            Self::TierRange { .. } => "tier-range",
            Self::Diverged { .. } => "diverged",
            Self::NotConverged { .. } => "not-converged",
        }
    }
}

/// A set of named warnings about a solution.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Warnings(u8);

impl Warnings {
    /// Load below 0.5 N, where the fitted radius model has no support.
    pub const LIGHT_LOAD: Self = Self(1);
    /// A fibre strain above 8 %, the range of the fit of eq. 12.
    pub const STRAIN_RANGE: Self = Self(2);
    /// |n| l²/EI ≥ π²/4 with the softest bending stiffness that occurs: more than one equilibrium may exist; the one
    /// connected to zero load is returned.
    pub const NOT_UNIQUE: Self = Self(4);
    /// |θ| < π: the strings do not touch yet; the paper says nothing there (docs/explanation/model.md section 5).
    pub const OPEN_STRINGS: Self = Self(8);

    /// X < r0 |θ|/π: two strings laid side by side would be longer. Only from [`crate::Mechanism::formal`].
    pub const OVERTWIST: Self = Self(16);

    const NAMES: [(Self, &'static str); 5] = [
        (Self::LIGHT_LOAD, "light-load"),
        (Self::STRAIN_RANGE, "strain-range"),
        (Self::NOT_UNIQUE, "not-unique"),
        (Self::OPEN_STRINGS, "open-strings"),
        (Self::OVERTWIST, "overtwist"),
    ];

    /// Adds a warning.
    pub fn add(&mut self, warning: Self) {
        self.0 |= warning.0;
    }

    /// Whether `warning` is among them.
    pub fn contains(self, warning: Self) -> bool {
        self.0 & warning.0 == warning.0
    }

    /// Whether the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Their names.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(w, _)| self.contains(*w)).map(|(_, name)| name)
    }
}

impl fmt::Debug for Warnings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.names()).finish()
    }
}
