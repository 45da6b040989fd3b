//! The mechanism the other way round: the load that a gap needs, and the twist that it needs. The gap grows with the load and falls
//! with the twist.

use crate::finite;
use std::f64::consts::{PI, TAU};
use tsa_model::mechanism::MINIMUM_LOAD_N;
use tsa_model::{Mechanism, SolveError, twist_from_turns};

/// Load at which the search begins (N), the largest one, the factor between two of them, and the smallest relative step before a
/// limit of the model.
const LOAD_START_N: f64 = 2.0;
const LOAD_MAX_N: f64 = 1e4;
const LOAD_FACTOR: f64 = 2.0;
const LOAD_STEP_MIN: f64 = 1e-4;
/// Step of the search for a twist (rad), the smallest one before a limit of the model, and the largest twist.
const TWIST_STEP_RAD: f64 = PI;
const TWIST_STEP_MIN_RAD: f64 = 1e-4;
const TWIST_MAX_RAD: f64 = 1e3;
/// Distance from the wanted gap that is good enough (m), and the most steps towards it.
const GAP_TOLERANCE_M: f64 = 1e-13;
const STEPS: u32 = 100;

/// Where a gap is reached that rises along `x` from `low` to `high`: Newton's method, and half the bracket where that leaves it.
fn root(
    [mut low, mut high]: [f64; 2],
    gap_m: f64,
    solve: impl Fn(f64) -> Result<(f64, f64), SolveError>,
) -> Result<f64, String> {
    let mut x = 0.5 * (low + high);
    for _ in 0..STEPS {
        let (found_m, slope) = solve(x).map_err(|e| e.to_string())?;
        let error_m = found_m - gap_m;
        if error_m > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let next = x - error_m / slope;
        let next = if next > low && next < high { next } else { 0.5 * (low + high) };
        if error_m.abs() < GAP_TOLERANCE_M || next == x {
            return Ok(x);
        }
        x = next;
    }
    Ok(x)
}

/// The load (N) under which a gap (m) is held at turns past the half-turn pre-twist.
pub(crate) fn force(mechanism: &Mechanism, gap_m: f64, turns: f64) -> Result<f64, String> {
    finite("gap_m", gap_m)?;
    finite("turns", turns)?;
    let twist_rad = twist_from_turns(turns);
    let solve = |load_n: f64| mechanism.solve(load_n, twist_rad);
    // From any load with an equilibrium towards the gap.
    let (mut here_n, mut here_m) = std::iter::successors(Some(LOAD_START_N), |load_n| Some(load_n * LOAD_FACTOR))
        .take_while(|load_n| *load_n <= LOAD_MAX_N)
        .find_map(|load_n| Some((load_n, solve(load_n).ok()?.gap_m)))
        .ok_or_else(|| format!("no load is held at {turns} turns"))?;
    let rises = here_m < gap_m;
    let mut factor = if rises { LOAD_FACTOR } else { LOAD_FACTOR.recip() };
    loop {
        let next_n = (here_n * factor).clamp(MINIMUM_LOAD_N, LOAD_MAX_N);
        match solve(next_n) {
            Ok(found) if (found.gap_m >= gap_m) == rises || found.gap_m == gap_m => {
                let at = |load_n: f64| solve(load_n).map(|e| (e.gap_m, e.dgap_dload_m_per_n));
                return root([here_n.min(next_n), here_n.max(next_n)], gap_m, at);
            }
            Ok(found) if next_n != here_n => (here_n, here_m) = (next_n, found.gap_m),
            Err(_) if factor.ln().abs() > LOAD_STEP_MIN => factor = factor.sqrt(),
            ended => {
                let bound = if rises { "most" } else { "least" };
                let why = ended.err().map_or_else(String::new, |e| format!(": {e}"));
                return Err(format!(
                    "gap_m {gap_m}: at {turns} turns it is at {bound} {here_m:.6} m, under {here_n:.3} N{why}"
                ));
            }
        }
    }
}

/// The turns past the half-turn pre-twist, from zero twist up, that hold a gap (m) under a load (N).
pub(crate) fn twist(mechanism: &Mechanism, load_n: f64, gap_m: f64) -> Result<f64, String> {
    finite("load_n", load_n)?;
    finite("gap_m", gap_m)?;
    let solve = |twist_rad: f64| mechanism.solve(load_n, twist_rad);
    let turns = |twist_rad: f64| (twist_rad - PI) / TAU;
    let (mut low, mut step) = (0.0, TWIST_STEP_RAD);
    let mut lowest = solve(low).map_err(|e| e.to_string())?;
    if gap_m > lowest.gap_m {
        return Err(format!("gap_m {gap_m}: under {load_n} N it is at most {:.6} m", lowest.gap_m));
    }
    while low < TWIST_MAX_RAD {
        match solve(low + step) {
            Ok(found) if found.gap_m <= gap_m => {
                let at = |twist_rad: f64| solve(-twist_rad).map(|e| (e.gap_m, -e.dgap_dtwist_m_per_rad));
                return root([-low - step, -low], gap_m, at).map(|twist_rad| turns(-twist_rad));
            }
            Ok(found) => (low, lowest) = (low + step, found),
            Err(e) if step < TWIST_STEP_MIN_RAD => {
                let why = format!("under {load_n} N it is at least {:.6} m, at {:.3} turns", lowest.gap_m, turns(low));
                return Err(format!("gap_m {gap_m}: {why}: {e}"));
            }
            Err(_) => step *= 0.5,
        }
    }
    Err(format!("gap_m {gap_m}: no twist up to {} turns holds it under {load_n} N", turns(TWIST_MAX_RAD)))
}
