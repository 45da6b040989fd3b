//! What the way up and the way down differ by: the loop of each sweep, and the friction that would make it.

use super::data::{Data, Quantity};
use super::predict::Fitted;
use serde::Serialize;
use tsa_model::Mechanism;

/// The loop of one sweep.
#[derive(Debug, Clone, Serialize)]
pub struct Loop {
    /// File.
    pub sweep: String,
    /// Load (N).
    pub load_n: f64,
    /// Half the width of the loop, mean over the sweep (m): down lies so far above the mean, and up below.
    pub half_width_m: f64,
    /// The friction that would make it (N): the half-width over how far the gap goes with the load.
    pub friction_n: Option<f64>,
}

/// The loops of all sweeps that were recorded both ways.
pub fn loops(data: &Data, fitted: &Fitted) -> Vec<Loop> {
    let mechanism = Mechanism::of(fitted.unknowns.parameters(&fitted.base, &fitted.x, ""));
    let one = |run: Vec<usize>| {
        let rows: Vec<_> = run.iter().map(|k| &data.rows[*k]).collect();
        let halves: Vec<f64> = rows.iter().filter_map(|row| row.half_difference_m).collect();
        let both = rows.first().filter(|row| row.quantity == Quantity::Gap && !halves.is_empty())?;
        let by_load = |row: &&&super::data::Row| {
            let e = mechanism.formal(row.load_n, row.twist_rad).ok()?;
            Some(row.half_difference_m? / e.dgap_dload_m_per_n.value.abs())
        };
        let friction: Vec<f64> = rows.iter().filter_map(|row| by_load(&row)).collect();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        Some(Loop {
            sweep: data.file_of(run[0]).to_owned(),
            load_n: both.load_n,
            half_width_m: mean(&halves),
            friction_n: (!friction.is_empty()).then(|| mean(&friction)),
        })
    };
    data.runs().into_iter().filter_map(one).collect()
}
