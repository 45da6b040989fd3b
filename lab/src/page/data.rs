//! What the page's script computes with: the solver's constants, the table's errors, the recorded move.

use rig_config::{Accuracy, Envelope, Scene};
use rigctl::session::row::Row;
use serde::Serialize;
use std::f64::consts::TAU;
use tsa_model::{Mechanism, PRETWIST_RAD, twist_from_turns};
use tsa_table::Table;

/// States of the map of the table's error: turns, and loads in equal ratios.
const MAP: [usize; 2] = [61, 31];
/// Maximum rows of a recorded move in a page.
const MAX_ROWS: usize = 600;

/// Everything, in the form of the script.
#[derive(Debug, Serialize)]
pub struct Data {
    /// In the order of `Page::set_constants` in `web/src/page.rs`; null where a scene has none.
    constants: Vec<f64>,
    envelope: Option<Envelope>,
    accuracy: Option<Accuracy>,
    table: Option<TableErrors>,
    moved: Option<Move>,
}

/// Errors of the table against the full model, a row for each load.
#[derive(Debug, Serialize)]
struct TableErrors {
    loads_n: Vec<f64>,
    turns: Vec<f64>,
    contraction_nm: Vec<Option<i64>>,
    tr_ppm: Vec<Option<i64>>,
}

/// A recorded move as columns.
#[derive(Debug, Default, Serialize)]
pub struct Move {
    /// What was recorded, in words.
    pub what: String,
    t_s: Vec<f64>,
    turns: Vec<Option<f64>>,
    load_n: Vec<Option<f64>>,
    position_m: Vec<Option<f64>>,
    setpoint_m: Vec<Option<f64>>,
}

impl Data {
    /// Of a scene, its mechanism and its table, if it has one.
    pub fn new(scene: &Scene, mechanism: &Mechanism, table: Option<&Table<'_>>, moved: Option<Move>) -> Self {
        Self {
            constants: constants(scene),
            envelope: scene.envelope,
            accuracy: scene.accuracy,
            table: scene.envelope.zip(table).map(|(envelope, table)| TableErrors::new(mechanism, table, envelope)),
            moved,
        }
    }
}

fn constants(scene: &Scene) -> Vec<f64> {
    let (g, s) = (&scene.geometry, &scene.string);
    let mut all = vec![g.string_length_m, g.rod_span_m, g.clamp_width_m, g.rod_radius_m];
    all.extend(s.constants());
    all.push(s.twist_exponent.unwrap_or(f64::NAN));
    all.extend(scene.material.stress_coefficients_pa);
    match &scene.correction {
        None => all.push(0.0),
        Some(c) => {
            all.push(1.0);
            all.extend(c.load_n.iter().chain(&c.turns).chain(c.coefficients_m.as_flattened()));
        }
    }
    all
}

impl TableErrors {
    fn new(mechanism: &Mechanism, table: &Table<'_>, envelope: Envelope) -> Self {
        let fraction = |k: usize, count: usize| k as f64 / (count - 1) as f64;
        let [low, high] = envelope.turns;
        let turns: Vec<f64> = (0..MAP[0]).map(|k| low + (high - low) * fraction(k, MAP[0])).collect();
        let [low, high] = envelope.load_n;
        let loads_n: Vec<f64> = (0..MAP[1]).map(|k| low * (high / low).powf(fraction(k, MAP[1]))).collect();
        let mut errors = Self { contraction_nm: Vec::new(), tr_ppm: Vec::new(), loads_n, turns };
        for load_n in &errors.loads_n {
            let start_gap_m = mechanism.solve(*load_n, PRETWIST_RAD).map(|e| e.gap_m).ok();
            for turns in &errors.turns {
                let error = start_gap_m.and_then(|start| error_at(mechanism, table, start, *load_n, *turns));
                errors.contraction_nm.push(error.map(|[contraction, _]| (contraction * 1e9).round() as i64));
                errors.tr_ppm.push(error.map(|[_, tr]| (tr * 1e6).round() as i64));
            }
        }
        errors
    }
}

/// Error of the contraction (m) and of TR (relative), where both model and table answer.
fn error_at(mechanism: &Mechanism, table: &Table<'_>, start_gap_m: f64, load_n: f64, turns: f64) -> Option<[f64; 2]> {
    let twist = twist_from_turns(turns);
    let e = mechanism.solve(load_n, twist).ok()?;
    let (load, twist) = (load_n as f32, twist as f32);
    let contraction_m = f64::from(table.contraction_m(load, twist).ok()?);
    let tr = f64::from(table.look_up(load, twist).ok()?.tr_rad_per_m());
    Some([contraction_m - (start_gap_m - e.gap_m), tr / e.tr_rad_per_m() - 1.0])
}

impl Move {
    /// Every Nth of the rows of telemetry, and the last; the truth of an emulated rig takes the place of what the board estimates.
    pub fn new(what: String, rows: &[Row]) -> Self {
        let every = rows.len().div_ceil(MAX_ROWS).max(1);
        let mut columns = Self { what, ..Self::default() };
        let rounded = |value: Option<f64>, unit: f64| value.map(|v| (v / unit).round() * unit);
        for (_, row) in rows.iter().enumerate().filter(|(k, _)| k % every == 0 || k + 1 == rows.len()) {
            let twist_rad = row.true_twist_rad.or(row.twist_rad.map(f64::from));
            columns.t_s.push(((row.t_s - rows[0].t_s) * 1e3).round() * 1e-3);
            columns.turns.push(rounded(twist_rad.map(|t| (t - PRETWIST_RAD) / TAU), 1e-5));
            columns.load_n.push(rounded(row.true_load_n.or(row.load_n.map(f64::from)), 1e-4));
            columns.position_m.push(rounded(row.position_m.map(f64::from), 1e-7));
            columns.setpoint_m.push(rounded(row.setpoint_m.map(f64::from), 1e-7));
        }
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_record_is_thinned_and_keeps_its_ends() {
        let row = |k: u16| {
            let (t_s, twist_rad) = (7.0 + 0.01 * f64::from(k), twist_from_turns(0.001 * f64::from(k)));
            serde_json::from_value(serde_json::json!({ "t_s": t_s, "state": "ready", "true_twist_rad": twist_rad }))
        };
        let rows = (0..2501).map(row).collect::<Result<Vec<Row>, _>>().unwrap();
        let columns = Move::new(String::new(), &rows);
        assert!(columns.t_s.len() <= MAX_ROWS + 1, "{}", columns.t_s.len());
        assert_eq!((columns.t_s[0], columns.t_s.last().copied()), (0.0, Some(25.0)));
        let last = columns.turns.last().copied().flatten().expect("turns");
        assert!((last - 2.5).abs() < 1e-9 && columns.load_n.iter().all(Option::is_none));
    }

    #[test]
    fn the_map_has_the_tables_errors_and_they_are_within_its_certificate() {
        let scene = Scene::from_toml_str(include_str!("../../../scenes/default.toml")).expect("the scene");
        let fit = scene.fit_table().expect("a table");
        let data = Data::new(&scene, &scene.mechanism().expect("a mechanism"), Some(&fit.table.table()), None);
        let errors = data.table.expect("errors");
        assert_eq!(errors.contraction_nm.len(), MAP[0] * MAP[1]);
        let largest = errors.contraction_nm.iter().map(|e| e.expect("inside the envelope").abs()).max();
        let limit = (fit.error_bounds.errors.contraction_max_m * 1e9).ceil() as i64;
        assert!(largest.is_some_and(|largest| largest > 0 && largest <= limit + 1), "{largest:?} {limit}");
        assert_eq!(data.constants.len(), 17);
        assert!(data.constants[10].is_nan(), "no exponent under this law");
    }
}
