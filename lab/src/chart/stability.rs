//! Where each method finds the right equilibrium, and how it fails elsewhere: a row of maps for each method, a column for each rod.
//!
//! The true state is on the branch that begins at the unloaded, untwisted rig and is followed in many small steps. The
//! default method does it otherwise: it solves at the state directly, and follows the branch, in large steps, only where
//! more than one equilibrium may exist.

use super::grid::Grid;
use super::work_precision::in_words;
use super::{Inputs, Made};
use anyhow::Result;
use baseline_methods::Method;
use rig_config::Scene;
use rigctl::csv_text::below;
use rigctl::parallel::{Progress, parallel};
use rigctl::plot::{Axis, Block, Figure, INK, KeyRow, Panel, Pen, RGBColor};
use std::f64::consts::PI;
use tsa_model::rod::TipForce;
use tsa_model::{Equilibrium, Mechanism, SolveError, twist_from_turns};

/// A rod of the map: title, scene, D0 (m) and R (m); everything else is as in its scene.
pub type Rod = (&'static str, &'static str, f64, f64);

const PAPER: &str = include_str!("../../../scenes/paper-identified.toml");
const PLATEAU: &str = include_str!("../../../scenes/niti-plateau.toml");

/// From stout to slender; the second has a plateau. The map is about methods, not about the operator's scene: the same rods everywhere.
pub const RODS: [Rod; 4] = [
    ("paper's rod", PAPER, 0.032, 0.0005),
    ("flat plateau", PLATEAU, 0.040, 0.0004),
    ("slender", PAPER, 0.060, 0.0003),
    ("more slender", PAPER, 0.080, 0.0003),
];

/// The mechanism with this rod.
///
/// # Errors
/// If the scene cannot have this rod.
pub fn with_rod((_, scene, rod_span_m, rod_radius_m): Rod) -> Result<Mechanism> {
    let mut scene = Scene::from_toml_str(scene)?;
    (scene.geometry.rod_span_m, scene.geometry.rod_radius_m) = (rod_span_m, rod_radius_m);
    Ok(scene.mechanism()?)
}

const LOAD_N: [f64; 2] = [0.3, 20.0];
const TURNS: [f64; 2] = [0.0, 8.0];
/// Loads and twists of a map.
const CELLS: (usize, usize) = (16, 20);
/// Steps of load and of twist in which the truth is followed, at least.
const STEPS: usize = 64;
/// An answer further from the true state than this (m) is another equilibrium: every method's own error is far smaller.
const ANOTHER_BRANCH_M: f64 = 1e-5;
/// Around the states with only one equilibrium, visible on light and dark cells.
const SAFE: Pen = Pen { colour: INK, width: 3, dashed: false };
const UNDER: Pen = Pen { colour: RGBColor(255, 255, 255), width: 6, dashed: false };
/// An answer that takes this many times a method's usual effort is slow.
const SLOW: f64 = 5.0;

/// The outcome at one state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// The right equilibrium.
    Right,
    /// The right one, for more than `SLOW` times the method's usual effort.
    Slow,
    /// The method reports a limit of the model where there is one.
    Limit,
    /// The method reports a limit of the model where there is none.
    Refused,
    /// The iteration ends without an answer although there is an equilibrium.
    Diverged,
    /// Another equilibrium, without an error.
    WrongBranch,
    /// An answer where the branch from the unloaded state has ended.
    BeyondLimit,
}

/// Name, colour and meaning of every outcome, from good to bad.
const OUTCOMES: [(&str, RGBColor, &str); 7] = [
    ("right", RGBColor(190, 225, 245), "right branch"),
    ("slow", RGBColor(0, 114, 178), "right, but slow"),
    ("limit", RGBColor(222, 222, 222), "no equilibrium, reported"),
    ("refused", RGBColor(240, 200, 60), "refused by a limit that is not there"),
    ("diverged", RGBColor(70, 70, 70), "diverged, reported"),
    ("wrong-branch", RGBColor(213, 94, 0), "another branch, no error"),
    ("beyond-limit", RGBColor(204, 121, 167), "an answer past the end of the branch"),
];

impl Outcome {
    /// The outcome of a method's answer, given the true state.
    pub fn judge(truth: &Result<Equilibrium, SolveError>, answer: &Result<Equilibrium, SolveError>) -> Self {
        match (truth, answer) {
            // NaN must not count as right.
            (Ok(truth), Ok(e)) if (e.gap_m - truth.gap_m).abs() <= ANOTHER_BRANCH_M => Self::Right,
            (Ok(_), Ok(_)) => Self::WrongBranch,
            (Ok(_), Err(SolveError::Diverged { .. } | SolveError::NotConverged { .. })) => Self::Diverged,
            (Ok(_), Err(_)) => Self::Refused,
            (Err(_), Err(_)) => Self::Limit,
            (Err(_), Ok(_)) => Self::BeyondLimit,
        }
    }

    /// Whether this outcome is a defect of the method.
    pub fn is_failure(&self) -> bool {
        !matches!(self, Self::Right | Self::Slow | Self::Limit)
    }

    fn look(self) -> &'static (&'static str, RGBColor, &'static str) {
        &OUTCOMES[self as usize]
    }
}

/// Every method under its name, the paper's also without damping, each with the effort that gives about 1e-6 m: more effort does
/// not change which branch it finds.
pub fn methods() -> Vec<(&'static str, Method)> {
    let paper = |relaxation| Method::Paper { steps: 16, relaxation, tolerance: 1e-6 };
    let named = |method: &Method| match method {
        Method::Paper { .. } => vec![("paper, factor 1", paper(1.0)), ("paper, factor 0.5", paper(0.5))],
        Method::AdaptiveShooting { .. } => vec![(method.name(), Method::AdaptiveShooting { tolerance: 1e-6 })],
        Method::Collocation { .. } => vec![(method.name(), Method::Collocation { intervals: 32, tolerance: 1e-8 })],
        method => vec![(method.name(), *method)],
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

/// The outcomes of one method at some states, given the truths, each with its evaluations (0 where there is no answer) and the kind
/// of the error that it reports.
fn judged(
    mechanism: &Mechanism,
    method: Method,
    states: &[(f64, f64)],
    truths: &[Result<Equilibrium, SolveError>],
    progress: &Progress<'_>,
) -> Vec<(Outcome, u32, &'static str)> {
    let mut outcomes = parallel(progress, states.len(), |k| {
        let answer = method.solve(mechanism, states[k].0, states[k].1);
        let kind = answer.as_ref().err().map_or("", SolveError::kind);
        (Outcome::judge(&truths[k], &answer), answer.map_or(0, |e| e.evaluations), kind)
    });
    let mut effort: Vec<u32> = outcomes.iter().filter(|(o, ..)| *o == Outcome::Right).map(|(_, n, _)| *n).collect();
    effort.sort_unstable();
    let usual = effort.get(effort.len() / 2).copied().unwrap_or(0);
    for (outcome, evaluations, _) in &mut outcomes {
        if *outcome == Outcome::Right && f64::from(*evaluations) > SLOW * f64::from(usual) {
            *outcome = Outcome::Slow;
        }
    }
    outcomes
}

/// Whether an equilibrium is known to be the only one: |n| l²/EI < π²/4, EI the softest bending stiffness that occurs.
fn is_safe(mechanism: &Mechanism, e: &Equilibrium) -> bool {
    let rod = mechanism.rod();
    let softest = rod.section.softest(e.bending_strain * e.bending_strain);
    rod.load_number(TipForce::of(e)) * 4.0 / (PI * PI * softest) < 1.0
}

/// Judges every method on every rod and draws it.
///
/// # Errors
/// If a rod cannot be solved at all, or the drawing fails.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let (progress, methods) = (inputs.progress, methods());
    let grid = Grid::new(LOAD_N, CELLS.0, TURNS, CELLS.1);
    let states: Vec<_> = grid.states().iter().map(|(load, turns)| (*load, twist_from_turns(*turns))).collect();
    let (mut panels, mut rows, mut findings) = (vec![Vec::new(); methods.len()], Vec::new(), Vec::new());
    for rod in RODS {
        let (of, _, span_m, radius_m) = rod;
        let mechanism = with_rod(rod)?;
        let truths = parallel(progress, states.len(), |k| truth(&mechanism, states[k].0, states[k].1));
        let safe: Vec<Option<bool>> =
            truths.iter().map(|truth| truth.as_ref().ok().map(|e| is_safe(&mechanism, e))).collect();
        for (m, (name, method)) in methods.iter().enumerate() {
            let outcomes = judged(&mechanism, *method, &states, &truths, progress);
            // Free length over radius.
            let slenderness = 0.5 * (span_m - 0.006) / radius_m;
            let title = if m == 0 { format!("{of}, {slenderness:.0} radii") } else { String::new() };
            let mut panel = grid.panel(title, |k| outcomes[k].0.look().1);
            panel.items.extend([UNDER, SAFE].into_iter().flat_map(|pen| grid.edges(&safe, pen)));
            let ticks = [0.5, 2.0, 5.0, 10.0].map(|load| (load, format!("{load} N")));
            let x = if m + 1 == methods.len() { panel.x } else { panel.x.unnamed() };
            panels[m].push(Panel { x, y: Axis::log(in_words(name), LOAD_N).ticked(ticks).tight(LOAD_N), ..panel });
            let what = (of, span_m, radius_m, *name);
            rows.extend(grid.states().iter().zip(&outcomes).zip(&safe).map(|(((load, turns), found), safe)| {
                let (outcome, evaluations, kind) = *found;
                let state = (format!("{load:.5}"), format!("{turns:.5}"));
                (what, state, outcome.look().0, kind, *safe == Some(true), evaluations)
            }));
            let counts =
                OUTCOMES.iter().map(|(kind, ..)| (outcomes.iter().filter(|(o, ..)| o.look().0 == *kind).count(), kind));
            let counts =
                counts.filter(|(n, _)| *n > 0).map(|(n, kind)| format!("{n} {kind}")).collect::<Vec<_>>().join(", ");
            let failed = outcomes.iter().zip(&safe).filter(|((o, ..), safe)| **safe == Some(true) && o.is_failure());
            let failed = failed.count();
            findings.push(format!("{of:<18} {name:<18} {counts}; {failed} failures in the safe zone"));
        }
    }
    let outcomes = OUTCOMES.map(|(_, colour, meaning)| KeyRow::fill(colour, meaning));
    let figure = Figure {
        heading: "Which equilibrium each method finds, over load and twist".into(),
        rows: panels.into_iter().map(Panel::side_by_side).collect(),
        panel_size: (320, 230),
        blocks: Block::split(2, outcomes.into_iter().chain([KeyRow::line(SAFE, "below: only one equilibrium")])),
        notes: vec![format!(
            "Columns: rods by their free length over the radius. The right branch leads to the unloaded actuator; another one \
             is more than {:.0} µm away. Slow: more than {SLOW} times the method's usual effort.",
            ANOTHER_BRANCH_M * 1e6
        )],
    };
    let header = "rod,rod_span_m,rod_radius_m,method,load_n,turns,outcome,error_kind,safe_zone,evaluations";
    Made::new(&figure, below(header, rows)?, findings)
}
