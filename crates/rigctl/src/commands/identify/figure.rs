//! `identify --figure`: contraction before and after, with the measured points on it.

use crate::calibration_figure::{Computed, Sweep, draw};
use crate::failure::Failure;
use crate::identify::Identified;
use crate::identify::data::{Data, Quantity, Row};
use rig_config::Scene;
use std::f64::consts::TAU;
use tsa_model::{Mechanism, PRETWIST_RAD, twist_from_turns};

/// Points of each curve, and most marks on it.
const POINTS: usize = 41;
const MARKS: usize = 24;

/// The picture of an identification that began with `before`, as SVG.
///
/// # Errors
/// If the drawing library fails.
pub fn figure(before: &Scene, data: &Data, found: &Identified) -> Result<String, Failure> {
    let before = before.mechanism()?;
    let sweeps: Vec<Sweep> = data.runs().iter().map(|run| sweep(&before, data, run, found)).collect();
    draw(&sweeps).map_err(|e| Failure::failed(format!("the figure: {e:#}")))
}

fn sweep(before: &Mechanism, data: &Data, run: &[usize], found: &Identified) -> Sweep {
    let rows: Vec<&Row> = run.iter().map(|k| &data.rows[*k]).collect();
    let load_n = rows.first().map_or(0.0, |row| row.load_n);
    let marked = rows.iter().step_by(rows.len().div_ceil(MARKS).max(1));
    let measured: Vec<(f64, f64)> = marked.filter_map(|row| Some((turns(row), contraction_m(row, found)?))).collect();
    let most = rows.iter().map(|row| turns(row)).fold(0.0, f64::max);
    let computed = (0..POINTS).map(|k| most * k as f64 / (POINTS - 1) as f64).filter_map(|turns| {
        let after = found.known.predict(load_n, turns);
        let gap_m = |twist_rad| before.solve(load_n, twist_rad).map(|e| e.gap_m).ok();
        let before_m = gap_m(PRETWIST_RAD).zip(gap_m(twist_from_turns(turns))).map(|(from_m, to_m)| from_m - to_m);
        Some(Computed { turns, before_m, after_m: after.contraction_m?, half_width_m: after.half_width_m? })
    });
    Sweep { label: format!("{load_n} N"), measured, computed: computed.collect() }
}

fn turns(row: &Row) -> f64 {
    row.twist_rad / TAU - 0.5
}

/// The measured contraction since the half-turn pre-twist (m). Where a gap was measured, the identified law says where the
/// pre-twist is, and the fit where the sensor's zero is.
fn contraction_m(row: &Row, found: &Identified) -> Option<f64> {
    match row.quantity {
        Quantity::Contraction => Some(row.value),
        Quantity::Gap => {
            let zero_m = row.zero.map_or(0.0, |zero| found.fit.x[found.candidate.unknowns.count() + zero]);
            let (pretwist, _) = found.known.chosen.gap(row.load_n, PRETWIST_RAD).ok()?;
            let added_m = found.scene.correction.map_or(0.0, |c| c.at(row.load_n, PRETWIST_RAD).gap_m);
            Some(pretwist.value + added_m - (row.value - zero_m))
        }
        Quantity::Tr | Quantity::Span => None,
    }
}
