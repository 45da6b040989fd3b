//! Cheaper models of the rod, each with an estimate of its error, so that the cheapest sufficient one can be chosen.
//!
//! | tier | rod | neglected |
//! |---|---|---|
//! | `rigid` | none: the plain fixed-offset actuator | all bending |
//! | `beam-column` | small rotations in closed form | large rotations, the law's curvature, stretch |
//! | `pseudo-rigid` | a stiff link on a spring | 0.5 % of the deflection, the law's curvature, stretch |
//! | `elastica` | inextensible, straight-line law, by its elliptic integrals | the law's curvature, stretch |
//! | `inextensible` | the polynomial moment–curvature law | stretch |
//! | `full` | docs/explanation/model.md section 3 | |
//!
//! A tier's estimate of its error is the first-order effect of what it neglects, times a factor that holds over every
//! scene in `scenes/` (the test `tiers` checks it against the full tier).

mod closed;

use crate::PRETWIST_RAD;
use crate::equilibrium::Equilibrium;
use crate::error::SolveError;
use crate::helix::State;
use crate::mechanism::Mechanism;
use crate::rod::{RodModel, RodResponse, TipForce};
use crate::scalar::{PRECISION, Scalar};

/// A model of the rod, from cheap to full.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Tier {
    /// Rods that do not bend.
    Rigid,
    /// Small rotations, moments on the bent rod.
    BeamColumn,
    /// A stiff link on a spring.
    PseudoRigid,
    /// Inextensible, linear.
    Elastica,
    /// Inextensible, with the polynomial moment–curvature law.
    Inextensible,
    /// Everything.
    Full,
}

/// Estimated error of a result.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "std", derive(serde::Serialize))]
pub struct TierError {
    /// Of the contraction (m).
    pub contraction_m: f64,
    /// Of the transmission ratio, relative.
    pub tr_relative: f64,
}

/// An equilibrium by a tier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tiered {
    /// The tier.
    pub tier: Tier,
    /// The equilibrium.
    pub equilibrium: Equilibrium,
    /// Gap at the half-turn pre-twist under the same load and by the same tier (m).
    pub start_gap_m: f64,
    /// The tier's own estimate of its error.
    pub error: TierError,
}

impl Tiered {
    /// Contraction since the half-turn pre-twist (m), eqs 3, 28.
    pub fn contraction_m(&self) -> f64 {
        self.start_gap_m - self.equilibrium.gap_m
    }
}

impl Tier {
    /// From cheap to full.
    pub const ALL: [Self; 6] =
        [Self::Rigid, Self::BeamColumn, Self::PseudoRigid, Self::Elastica, Self::Inextensible, Self::Full];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rigid => "rigid",
            Self::BeamColumn => "beam-column",
            Self::PseudoRigid => "pseudo-rigid",
            Self::Elastica => "elastica",
            Self::Inextensible => "inextensible",
            Self::Full => "full",
        }
    }

    /// The tier of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|t| t.name() == name)
    }
}

/// Factor on first-order estimates, so that they hold where the next order matters.
const SAFETY: f64 = 1.5;

impl Mechanism {
    /// The equilibrium at a load (N) and a twist (rad) by a tier, with the tier's estimate of its error.
    ///
    /// # Errors
    /// As [`Mechanism::solve`]; also [`SolveError::TierRange`] where the state is outside the tier's range.
    pub fn solve_tier(&self, tier: Tier, load_n: f64, twist_rad: f64) -> Result<Tiered, SolveError> {
        let start = self.at_tier(tier, load_n, PRETWIST_RAD)?;
        let here = self.at_tier(tier, load_n, twist_rad)?;
        let (equilibrium, start_gap_m) = (self.possible(here.0)?, start.0.gap_m);
        let change = start.1.change_m - here.1.change_m;
        let slope = here.1.slope;
        let error = TierError {
            contraction_m: SAFETY * change.abs() + start.1.margin_m + here.1.margin_m,
            // At zero twist both slopes vanish and the ratio is 0/0.
            tr_relative: if slope.is_finite() { SAFETY * slope.abs() + here.1.margin } else { 0.0 },
        };
        Ok(Tiered { tier, equilibrium, start_gap_m, error })
    }

    /// The equilibrium by the cheapest tier whose own estimate of its error is within `wanted`.
    ///
    /// # Errors
    /// As [`Mechanism::solve`].
    pub fn solve_auto(&self, load_n: f64, twist_rad: f64, wanted: TierError) -> Result<Tiered, SolveError> {
        for tier in Tier::ALL {
            let Ok(found) = self.solve_tier(tier, load_n, twist_rad) else { continue };
            let TierError { contraction_m, tr_relative } = found.error;
            // NaN fails both comparisons.
            if contraction_m <= wanted.contraction_m && tr_relative <= wanted.tr_relative {
                return Ok(found);
            }
        }
        self.solve_tier(Tier::Full, load_n, twist_rad)
    }

    /// The equilibrium by a tier, without the estimate of its error and without the limit of overtwist.
    ///
    /// # Errors
    /// As [`Mechanism::formal`]; also [`SolveError::TierRange`].
    pub fn formal_tier(&self, tier: Tier, load_n: f64, twist_rad: f64) -> Result<Equilibrium, SolveError> {
        match tier {
            Tier::Full => self.formal(load_n, twist_rad),
            _ if self.is_rigid() => self.formal(load_n, twist_rad),
            Tier::Elastica => self.with_model(RodModel::Elastica).formal(load_n, twist_rad),
            Tier::Inextensible => self.with_model(RodModel::Inextensible).formal(load_n, twist_rad),
            Tier::Rigid | Tier::BeamColumn | Tier::PseudoRigid => {
                let state = State::new(load_n, twist_rad)?;
                let mut evaluations = 0;
                let mut e = self.balance(&state, None, PRECISION, &mut |force| {
                    evaluations += 1;
                    self.closed(tier, force)
                })?;
                e.evaluations = evaluations;
                Ok(e)
            }
        }
    }

    /// The tier's equilibrium, and the effect of what it neglects.
    fn at_tier(&self, tier: Tier, load_n: f64, twist_rad: f64) -> Result<(Equilibrium, Corrected), SolveError> {
        let e = self.formal_tier(tier, load_n, twist_rad)?;
        if tier == Tier::Full || self.is_rigid() {
            return Ok((e, Corrected::default()));
        }
        let corrected = self.corrected(tier, &State::new(load_n, twist_rad)?, &e)?;
        Ok((e, corrected))
    }

    fn closed(&self, tier: Tier, force: TipForce) -> Result<RodResponse, SolveError> {
        match tier {
            Tier::BeamColumn => closed::beam_column(&self.rod, force),
            Tier::PseudoRigid => closed::pseudo_rigid(&self.rod, force),
            _ => Ok(RodResponse::rigid(self.rod.length_m)),
        }
    }

    /// The effect of what the tier neglects, to first order at the tier's own helix angle.
    fn corrected(&self, tier: Tier, state: &State, e: &Equilibrium) -> Result<Corrected, SolveError> {
        let helix = self.helix(state, e.alpha_rad);
        let force = state.force(helix.tan);
        // Only differences matter, so a closed form replaces the elastica's compliances.
        let (own, (with, part)) = match tier {
            Tier::Rigid => {
                let bent = closed::pseudo_rigid(&self.rod, force)?;
                (self.closed(tier, force)?, closed::bent_further(&self.rod, force, &bent, false)?)
            }
            Tier::BeamColumn => {
                let own = self.closed(tier, force)?;
                (own, closed::bent_further(&self.rod, force, &own, true)?)
            }
            Tier::PseudoRigid | Tier::Elastica => {
                let own = closed::pseudo_rigid(&self.rod, force)?;
                (own, closed::bent_further(&self.rod, force, &own, false)?)
            }
            Tier::Inextensible | Tier::Full => {
                let own = closed::pseudo_rigid(&self.rod, force)?;
                (own, (own, 0.0))
            }
        };
        let slope = helix.slope(state, with.reach.by_inward);
        let moved = 2.0 * state.span_factor * (with.reach.value - own.reach.value) / slope;
        let change_m = helix.gap_by_alpha(&own) * moved + 2.0 * (with.deflection.value - own.deflection.value);
        let before = helix.gap_derivatives(&self.parameters, state, &own).0;
        let after = self.helix(state, e.alpha_rad + moved).gap_derivatives(&self.parameters, state, &with).0;
        // A large correction makes the first order doubtful.
        let doubt = 1.0 + 5.0 * part;
        let link = if matches!(tier, Tier::Rigid | Tier::PseudoRigid) { LINK * with.deflection.value } else { 0.0 };
        let (sin, cos) = Scalar::sin_cos(2.0 / 3.0 * with.tip_angle_rad);
        let stretch = 2.0 * (helix.tan * cos + sin) * closed::stretch_m(&self.rod, force, with.tip_angle_rad);
        let margin_m = link + stretch + 2.0 * part * part * with.deflection.value;
        // A change of the span affects TR fully, but the gap only by the factor tan α, which is small on long strings.
        let steep = helix.tan.max(e.d_m / helix.x_m);
        Ok(Corrected {
            change_m: change_m * doubt,
            slope: (after / before - 1.0) * doubt,
            margin_m,
            margin: 8.0 * margin_m / (helix.tan * helix.x_m).max(e.d_m) * (1.0 / (3.0 * steep)).max(1.0),
        })
    }

    /// The same mechanism with a simpler rod.
    pub fn with_model(&self, model: RodModel) -> Self {
        let mut simpler = self.clone();
        simpler.rod.model = model;
        simpler
    }
}

/// Largest error of the pseudo-rigid body as a fraction of the deflection.
const LINK: f64 = 0.03;

/// Effect of what a tier neglects.
#[derive(Default)]
struct Corrected {
    /// Of the gap (m), and of ∂G/∂θ, relative.
    change_m: f64,
    slope: f64,
    /// Bounds on the effects whose sign is unknown: of the gap (m), and of the slope, relative.
    margin_m: f64,
    margin: f64,
}
