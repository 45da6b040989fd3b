//! `solve`: equilibria, by any method and tier of the model.

use crate::batch::{self, At, Query};
use crate::failure::{Failure, Refused};
use crate::options::Global;
use crate::options::values::{AUTO, METHODS, methods, tiers, tolerance};
use crate::output::Output;
use crate::units::{MM, MM_PER_N, MNM, N, NUMBER, PERCENT, RAD, RAD_PER_MM, UM};
use clap::Args;
use rig_config::Scene;
use serde::Serialize;
use tsa_model::{Equilibrium, Mechanism, PRETWIST_RAD, SolveError, Tier, TierError, twist_from_turns};

/// Lengths are shown to a tenth of a micrometre: the model is exact, and who wants more digits takes `--json`.
pub(super) const EXACT_M: f64 = 1e-6;
/// At zero twist the gap has its maximum: no motion of the load for a small turn.
const TR_INFINITE: &str = "tr-infinite";

/// Solve one equilibrium by the full model, or one for each row of a file
///
/// Example: `rigctl solve --load 0.5kg --turns 3`
#[derive(Debug, Args)]
pub struct Solve {
    /// Where.
    #[command(flatten)]
    pub at: At,
    /// How.
    #[command(flatten)]
    pub how: How,
}

impl Solve {
    /// Whether it asks for what only the laboratory has.
    pub fn is_of_the_laboratory(&self) -> bool {
        self.how.method != METHODS[0] || self.how.steps.is_some() || self.how.tolerance.is_some()
    }
}

/// Method of solution and tier of the model.
#[derive(Debug, Clone, Args)]
pub struct How {
    /// Method of solution
    #[arg(long, default_value = "first-integral", value_parser = methods())]
    pub method: String,
    /// Steps of the method: quadrature nodes, Runge–Kutta steps, intervals, load steps [default: about 1e-9 m]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub steps: Option<u32>,
    /// Tolerance of the method's iteration, or of its integrator
    #[arg(long, value_name = "X", value_parser = tolerance)]
    pub tolerance: Option<f64>,
    /// Tier of the model; `auto` takes the cheapest that meets the scene's accuracy
    #[arg(long, default_value = "full", value_parser = tiers())]
    pub tier: String,
}

/// One equilibrium. Keys as the columns of the reference file.
#[derive(Debug, Clone, Serialize)]
pub struct Solution {
    /// Load (N).
    pub load_n: f64,
    /// Turns past the half-turn pre-twist.
    pub turns: f64,
    /// Helix angle (rad).
    pub alpha_rad: f64,
    /// Distance between the strings' attachments (m).
    #[serde(rename = "X_m")]
    pub x_m: f64,
    /// Distance between the rods' tips (m).
    #[serde(rename = "D_m")]
    pub d_m: f64,
    /// Deflection of a rod (m).
    pub w_m: f64,
    /// Radius of the twisted pair (m).
    pub r_m: f64,
    /// Tension of one string (N).
    pub tension_n: f64,
    /// Bending strain at the clamp.
    pub bending_strain: f64,
    /// Gap between the clamps (m).
    pub gap_m: f64,
    /// How far the load sinks for each newton more (m/N).
    pub dgap_dload_m_per_n: f64,
    /// Torque on the strings that conserves energy (N m); none where a lighter load has no equilibrium at this twist.
    pub torque_nm: Option<f64>,
    /// Contraction since the half-turn pre-twist at this load (m).
    pub contraction_m: f64,
    /// How far the load hangs below the free mechanism at the half-turn pre-twist (m).
    pub load_sag_m: f64,
    /// Transmission ratio (rad/m); none at zero twist, where it is infinite.
    pub tr_rad_per_m: Option<f64>,
    /// Method of solution.
    pub method: &'static str,
    /// Tier of the model.
    pub tier: &'static str,
    /// The tier's own estimate of its error; 0 for the full tier.
    pub tier_error: TierError,
    /// What it took.
    pub effort: Effort,
    /// What to take it with.
    pub warnings: Vec<&'static str>,
}

/// What a solution took.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Effort {
    /// Steps of the outermost iteration.
    pub iterations: u32,
    /// Evaluations of a section or a right-hand side.
    pub evaluations: u32,
    /// Largest scaled residual of the method's equations.
    pub residual: f64,
}

/// The equilibrium of a mechanism at a load (N) and a twist (rad), by a method.
pub type Solver<'a> = &'a dyn Fn(&Mechanism, f64, f64) -> Result<Equilibrium, SolveError>;

/// How to solve: with the full model, or by a tier.
#[derive(Clone, Copy)]
pub enum Way<'a> {
    /// The full model by a method, with its name.
    By(&'static str, Solver<'a>),
    /// A tier.
    At(Tier),
    /// The cheapest tier that is this accurate.
    Within(TierError),
}

impl Way<'_> {
    /// What the command line asks for.
    ///
    /// # Errors
    /// If the options contradict each other, or the scene says nothing about accuracy.
    pub fn new(how: &How, scene: &Scene) -> Result<Self, Failure> {
        // The command line has checked the name; other methods are the laboratory's.
        let usage = |text: String| Failure::Usage(text);
        if how.tier == Tier::Full.name() {
            return Ok(Self::By(METHODS[0], &Mechanism::solve));
        }
        if how.tier == AUTO {
            let Some(accuracy) = scene.accuracy else {
                return Err(Failure::failed("--tier auto: the scene has no [accuracy] to meet"));
            };
            return Ok(Self::Within(TierError {
                contraction_m: accuracy.contraction_m,
                tr_relative: accuracy.tr_relative,
            }));
        }
        Ok(Self::At(Tier::named(&how.tier).ok_or_else(|| usage(format!("tier {} is unknown", how.tier)))?))
    }

    fn solve(self, mechanism: &Mechanism, query: Query) -> Result<(Equilibrium, f64, Tier, TierError), SolveError> {
        let twist = twist_from_turns(query.turns);
        let tiered = match self {
            Self::By(_, solve) => {
                let start = solve(mechanism, query.load_n, PRETWIST_RAD)?;
                let e = solve(mechanism, query.load_n, twist)?;
                return Ok((e, start.gap_m, Tier::Full, TierError::default()));
            }
            Self::At(tier) => mechanism.solve_tier(tier, query.load_n, twist)?,
            Self::Within(wanted) => mechanism.solve_auto(query.load_n, twist, wanted)?,
        };
        Ok((tiered.equilibrium, tiered.start_gap_m, tiered.tier, tiered.error))
    }

    fn method(self) -> &'static str {
        match self {
            Self::By(name, _) => name,
            Self::At(_) | Self::Within(_) => METHODS[0],
        }
    }
}

/// Solves at one load and number of turns.
///
/// # Errors
/// The limit of the model that stopped it.
pub fn solve(mechanism: &Mechanism, way: Way<'_>, query: Query) -> Result<Solution, SolveError> {
    let (e, start_gap_m, tier, error) = way.solve(mechanism, query)?;
    let mut warnings: Vec<&str> = e.warnings.names().collect();
    let tr = e.finite_tr_rad_per_m();
    if tr.is_none() {
        warnings.push(TR_INFINITE);
    }
    Ok(Solution {
        load_n: query.load_n,
        turns: query.turns,
        alpha_rad: e.alpha_rad,
        x_m: e.x_m,
        d_m: e.d_m,
        w_m: e.w_m,
        r_m: e.r_m,
        tension_n: e.tension_n,
        bending_strain: e.bending_strain,
        gap_m: e.gap_m,
        dgap_dload_m_per_n: e.dgap_dload_m_per_n,
        torque_nm: mechanism.conservative_torque_nm(query.load_n, twist_from_turns(query.turns)).ok(),
        contraction_m: start_gap_m - e.gap_m,
        load_sag_m: start_gap_m - mechanism.start_length_m(),
        tr_rad_per_m: tr,
        method: way.method(),
        tier: tier.name(),
        tier_error: error,
        effort: Effort { iterations: e.iterations, evaluations: e.evaluations, residual: e.residual },
        warnings,
    })
}

/// Runs the command.
///
/// # Errors
/// If the scene or the batch file is bad, or the one point cannot be solved.
pub fn run(global: &Global, Solve { at, how }: &Solve, output: &mut Output) -> Result<(), Failure> {
    let scene = global.scene()?;
    answer(at, &scene, Way::new(how, &scene)?, output)
}

/// Solves one way and prints it.
///
/// # Errors
/// If the scene or the batch file is bad, or the one point cannot be solved.
pub fn answer(at: &At, scene: &Scene, way: Way<'_>, output: &mut Output) -> Result<(), Failure> {
    let mechanism = scene.mechanism()?;
    let Some(query) = at.one() else {
        let heading = format!(
            "{:>10} {:>8} {:>12} {:>14} {:>12} {:>12} {:>14}  warnings",
            "load N", "turns", "helix rad", "contraction mm", "deflection mm", "TR rad/mm", "tier"
        );
        let line = |s: &Solution| {
            format!(
                "{:>10} {:>8} {:>12} {:>14} {:>12} {:>12} {:>14}  {}",
                NUMBER.exact(s.load_n),
                NUMBER.exact(s.turns),
                RAD.number(s.alpha_rad, EXACT_M),
                MM.number(s.contraction_m, EXACT_M),
                MM.number(s.load_sag_m, EXACT_M),
                RAD_PER_MM.number(tr(s), None::<f64>),
                s.tier,
                s.warnings.join(", ")
            )
        };
        let solve = |query| solve(&mechanism, way, query).map_err(Refused::from);
        return batch::answer(at, output, &heading, solve, line);
    };
    let s = solve(&mechanism, way, query)?;
    output.object(&s)?;
    let mm = |m: f64| MM.rounded(m, EXACT_M);
    output.named([
        ("load", N.exact(s.load_n)),
        ("turns", NUMBER.exact(s.turns) + " past the half-turn pre-twist"),
        ("helix angle", RAD.show(s.alpha_rad)),
        ("X, attachments", mm(s.x_m)),
        ("D, rod tips", mm(s.d_m)),
        ("rod deflection", mm(s.w_m)),
        ("string radius", mm(s.r_m)),
        ("string tension", N.show(s.tension_n)),
        ("bending strain", PERCENT.show(s.bending_strain)),
        ("gap", mm(s.gap_m)),
        ("gap per load", MM_PER_N.show(s.dgap_dload_m_per_n)),
        ("torque", MNM.show(s.torque_nm)),
        ("contraction", mm(s.contraction_m)),
        ("static deflection", mm(s.load_sag_m)),
        ("TR", RAD_PER_MM.show(tr(&s))),
        ("warnings", s.warnings.join(", ")),
    ])?;
    output.line(why(way, &s))?;
    Ok(())
}

/// Which method and tier, and why, in a sentence.
fn why(way: Way<'_>, s: &Solution) -> String {
    let Effort { iterations, evaluations, residual } = s.effort;
    let spent = format!("{iterations} iterations, {evaluations} evaluations, residual {}", NUMBER.show(residual));
    let TierError { contraction_m, tr_relative } = s.tier_error;
    let own = format!("its own estimate: {}, TR {}", UM.error(contraction_m), PERCENT.error(tr_relative));
    match way {
        Way::By(..) => format!("full model by {}: {spent}", s.method),
        Way::At(_) => format!("tier {} ({own}): {spent}", s.tier),
        Way::Within(wanted) => format!(
            "tier {}, the cheapest within {} and TR {} ({own}): {spent}",
            s.tier,
            UM.exact(wanted.contraction_m),
            PERCENT.exact(wanted.tr_relative)
        ),
    }
}

/// TR (rad/m), infinite at zero twist.
fn tr(s: &Solution) -> f64 {
    s.tr_rad_per_m.unwrap_or(f64::INFINITY)
}
