//! `solve`: equilibria by the full model.

use super::scene;
use crate::batch::{self, Query, RowError};
use crate::cli::{At, Global};
use crate::failure::Failure;
use crate::output::Output;
use serde::Serialize;
use tsa_model::{Equilibrium, Mechanism, SolveError, twist_from_turns};

/// At zero twist the gap has its maximum: no motion of the load for a small turn.
const TR_INFINITE: &str = "tr-infinite";

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
    /// What to take it with.
    pub warnings: Vec<&'static str>,
}

/// Solves at one load and number of turns.
///
/// # Errors
/// The limit of the model that stopped it.
pub fn solve(mechanism: &Mechanism, query: Query) -> Result<Solution, SolveError> {
    let e = mechanism.solve(query.load_n, twist_from_turns(query.turns))?;
    let start = mechanism.solve(query.load_n, twist_from_turns(0.0))?;
    let mut warnings: Vec<&str> = e.warnings.names().collect();
    let tr = finite_tr_rad_per_m(&e);
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
        contraction_m: start.gap_m - e.gap_m,
        load_sag_m: start.gap_m - mechanism.start_length_m(),
        tr_rad_per_m: tr,
        method: crate::cli::METHODS[0],
        tier: crate::cli::TIERS[0],
        warnings,
    })
}

/// TR (rad/m), but none at zero twist, where it is infinite.
pub fn finite_tr_rad_per_m(e: &Equilibrium) -> Option<f64> {
    // Turns are decimal and π is not, so "zero twist" is as near as rounding comes to it.
    Some(e.tr_rad_per_m()).filter(|tr| tr.is_finite() && e.twist_rad.abs() > 1e-12)
}

/// Runs the command. Method and tier were checked by the command line; there is one of each so far.
///
/// # Errors
/// If the scene or the batch file is bad, or the one point cannot be solved.
pub fn run(global: &Global, at: &At, _method: &str, _tier: &str, output: &mut Output) -> Result<(), Failure> {
    let mechanism = scene(global)?.mechanism()?;
    if let Some(path) = &at.batch {
        output.line(format!(
            "{:>10} {:>8} {:>12} {:>14} {:>12} {:>12}  warnings",
            "load N", "turns", "helix rad", "contraction mm", "sag mm", "TR rad/mm"
        ))?;
        for row in batch::read(path)? {
            let solved = row.and_then(|query| solve(&mechanism, query).map_err(|e| RowError::new(e.kind(), e)));
            match solved {
                Ok(s) => {
                    output.object(&s)?;
                    output.line(format!(
                        "{:>10.4} {:>8.3} {:>12.6} {:>14.5} {:>12.5} {:>12}  {}",
                        s.load_n,
                        s.turns,
                        s.alpha_rad,
                        s.contraction_m * 1e3,
                        s.load_sag_m * 1e3,
                        per_mm(s.tr_rad_per_m),
                        s.warnings.join(", ")
                    ))?;
                }
                Err(error) => {
                    output.object(&error)?;
                    output.line(serde_json::to_string(&error)?)?;
                }
            }
        }
        return Ok(());
    }
    let (Some(load_n), Some(turns)) = (at.load, at.turns) else {
        return Err(Failure::Usage("solve needs --load and --turns, or --batch".into()));
    };
    let s = solve(&mechanism, Query { load_n, turns })?;
    output.object(&s)?;
    for (name, value, unit) in [
        ("load", format!("{:.4}", s.load_n), "N"),
        ("turns", format!("{:.4}", s.turns), "past the half-turn pre-twist"),
        ("helix angle", format!("{:.6}", s.alpha_rad), "rad"),
        ("X, attachments", format!("{:.5}", s.x_m * 1e3), "mm"),
        ("D, rod tips", format!("{:.5}", s.d_m * 1e3), "mm"),
        ("rod deflection", format!("{:.5}", s.w_m * 1e3), "mm"),
        ("string radius", format!("{:.5}", s.r_m * 1e3), "mm"),
        ("string tension", format!("{:.4}", s.tension_n), "N"),
        ("bending strain", format!("{:.4}", s.bending_strain * 1e2), "%"),
        ("contraction", format!("{:.5}", s.contraction_m * 1e3), "mm"),
        ("sag under load", format!("{:.5}", s.load_sag_m * 1e3), "mm"),
        ("TR", per_mm(s.tr_rad_per_m), "rad/mm"),
        ("warnings", s.warnings.join(", "), ""),
    ] {
        output.line(format!("{name:<15} {value:>12} {unit}").trim_end())?;
    }
    Ok(())
}

/// TR in rad/mm for people.
fn per_mm(tr_rad_per_m: Option<f64>) -> String {
    tr_rad_per_m.map_or("infinite".into(), |tr| format!("{:.5}", tr * 1e-3))
}
