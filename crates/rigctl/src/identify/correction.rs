//! The measured correction: what the chosen law misses of the rig's gap, as a smooth surface over load and twist.
//!
//! What is held out decides whether there is one, and of how many terms: law and surface are fitted without a block of
//! twist of one sweep, which both then predict. The surface with the least error that a table can hold is taken if the law
//! alone predicts worse by more than the noise of that comparison. (The laws compete on blocks of all sweeps together, which
//! tell how a law goes on beyond its data. A surface does not go on there.)

use super::compete::{BLOCKS, worse};
use super::data::Data;
use super::fit::Fit;
use super::linear::Linear;
use crate::plot::extent;
use crate::statistics::{Noise, rms};
use crate::units::UM;
use nalgebra::{DMatrix, DVector};
use rig_config::Scene;
use serde::Serialize;
use tsa_model::correction::TERMS;
use tsa_model::{Correction, PRETWIST_RAD, twist_from_turns};
use tsa_table::fit::Fit as Table;

/// A surface whose weakest combination of terms is this much weaker than the strongest is not determined.
const WEAKEST: f64 = 1e-2;
/// By how much of their range the data may fall short of the ends of the envelope's turns and still count up to there: the
/// motor starts and stops within a sweep, so that its first and last turn part have no rows.
const SHORT: f64 = 0.1;
/// Steps of a coefficient in a metre: nanometres, which f32 on the way to the board keeps.
const DIGITS_PER_M: f64 = 1e9;

/// A fitted surface.
#[derive(Debug, Clone)]
pub struct Surface {
    /// The correction.
    pub correction: Correction,
    /// Terms in the load and in the twist.
    order: [usize; 2],
    /// Covariance of the coefficients of these terms (m2), by the errors of the rows.
    covariance: DMatrix<f64>,
    /// What law and correction miss of all rows, mean square, as a fraction of what the law alone misses.
    pub fraction: f64,
}

impl Surface {
    /// What the surface adds to a contraction (m), the variance of that (m2), and by how much of its full size it is there
    /// at least: 1 where it was measured, 0 far outside.
    pub fn contraction(&self, load_n: f64, turns: f64) -> (f64, f64, f64) {
        let terms = terms(self.order);
        let [(start_m, start, near), (end_m, end, far)] = [PRETWIST_RAD, twist_from_turns(turns)].map(|twist_rad| {
            let ([loads, _], [twists, _]) = self.correction.basis(load_n, twist_rad);
            let basis = DVector::from_iterator(terms.len(), terms.iter().map(|[i, j]| loads[*i] * twists[*j]));
            (self.correction.at(load_n, twist_rad).gap_m, basis, loads[0] * twists[0])
        });
        let by = start - end;
        (start_m - end_m, by.dot(&(&self.covariance * &by)), near.min(far))
    }
}

/// What a correction does for the sweeps.
#[derive(Debug, Clone, Serialize)]
pub struct Corrected {
    /// Terms in the load and in the twist.
    pub order: [usize; 2],
    /// What law and correction miss of all rows, rms (m).
    pub rms_m: f64,
    /// What the law alone misses of held-out rows, rms (m).
    pub held_out_without_m: f64,
    /// What law and correction miss of them, rms (m).
    pub held_out_m: f64,
    /// The surface.
    #[serde(skip)]
    pub surface: Surface,
    /// The scene with it.
    #[serde(skip)]
    pub scene: Scene,
    /// The table of that scene, if it says what a table has to cover.
    #[serde(skip)]
    pub table: Option<Table>,
}

/// The correction of a law that does not hold; `fit` is the law's to all rows, `scene` the identified one without it, and
/// `by_load_m` how far a contraction goes with a relative change of the load (m).
///
/// # Errors
/// Why there is none, in words.
pub fn corrected(scene: &Scene, data: &Data, fit: &Fit, by_load_m: f64) -> Result<Corrected, String> {
    let undetermined = || "the sweeps do not determine one".to_owned();
    if data.zeros > 0 {
        return Err("the zero of the LVDT is not known for every sweep".into());
    }
    let linear = Linear::about(data, fit);
    let folds: Vec<Vec<usize>> = data.runs().iter().flat_map(|run| blocks(run)).collect();
    let laws: Option<Vec<Vec<f64>>> = folds.iter().map(|fold| linear.without(fold)).collect();
    let laws = laws.ok_or_else(undetermined)?;
    let held_out = |predict: &dyn Fn(usize) -> Option<Vec<f64>>| {
        let mut errors = vec![0.0; data.rows.len()];
        for (n, fold) in folds.iter().enumerate() {
            let all = predict(n)?;
            fold.iter().for_each(|k| errors[*k] = all[*k]);
        }
        Some(errors)
    };
    let alone = held_out(&|n| Some(laws[n].clone())).ok_or_else(undetermined)?;
    let of_order = |order| {
        let predict = |n: usize| {
            let rest: Vec<usize> = (0..data.rows.len()).filter(|k| !folds[n].contains(k)).collect();
            Some(left(&surface(scene, data, &laws[n], &rest, order)?.correction, data, &laws[n]))
        };
        Some((order, held_out(&predict)?))
    };
    let mut candidates: Vec<([usize; 2], Vec<f64>)> = orders(data).into_iter().filter_map(of_order).collect();
    candidates.sort_by(|a, b| rms(&a.1).total_cmp(&rms(&b.1)));
    let (_, best) = candidates.first().ok_or_else(undetermined)?;
    let mut why = format!(
        "the best one does not predict what is held out better than the law alone by more than chance ({} instead of {})",
        UM.show(rms(best)),
        UM.show(rms(&alone))
    );
    let helps = |errors: &[f64]| worse(&data.in_deviations(&alone), &data.in_deviations(errors), &data.runs());
    let errors = linear.without(&[]).ok_or_else(undetermined)?;
    let all: Vec<usize> = (0..data.rows.len()).collect();
    for (order, predicted) in candidates.iter().filter(|(_, errors)| helps(errors)) {
        let surface = surface(scene, data, &errors, &all, *order).ok_or_else(undetermined)?;
        surface.correction.validate().map_err(|e| e.to_string())?;
        let rms_m = rms(&left(&surface.correction, data, &errors));
        let mut with = Scene { correction: Some(surface.correction), ..scene.clone() };
        if fit.unknowns.expected {
            with.uncertainty.gap_zero_m = super::zero_error_m(rms_m);
            with.uncertainty.load_shape = super::shape_error(rms(predicted), by_load_m);
        }
        let asked = with.envelope.is_some() && with.accuracy.is_some();
        // The gap with it may not be monotone, or bend too much.
        let table = match asked.then(|| with.fit_table()).transpose() {
            Ok(table) => table,
            Err(e) => {
                why = format!("no table of the scene could have it: {e}");
                continue;
            }
        };
        let (held_out_without_m, held_out_m) = (rms(&alone), rms(predicted));
        return Ok(Corrected { order: *order, rms_m, held_out_without_m, held_out_m, surface, scene: with, table });
    }
    Err(why)
}

/// Blocks of twist of one sweep.
fn blocks(run: &[usize]) -> impl Iterator<Item = Vec<usize>> {
    run.chunks(run.len().div_ceil(BLOCKS).max(1)).map(<[_]>::to_vec)
}

/// What a surface leaves of a law's errors (computed less measured, m).
fn left(surface: &Correction, data: &Data, errors: &[f64]) -> Vec<f64> {
    let rows = data.rows.iter().zip(errors);
    rows.map(|(row, error)| error + surface.at(row.load_n, row.twist_rad.abs()).gap_m).collect()
}

/// Numbers of terms in load and twist: two loads do not show whether something between them is different.
fn orders(data: &Data) -> Vec<[usize; 2]> {
    let mut loads: Vec<f64> = data.rows.iter().map(|row| row.load_n).collect();
    loads.sort_by(f64::total_cmp);
    loads.dedup();
    let max = if loads.len() < TERMS { 1 } else { TERMS };
    (1..=max).flat_map(|of_load| (1..=TERMS).map(move |of_twist| [of_load, of_twist])).collect()
}

fn terms([of_load, of_twist]: [usize; 2]) -> Vec<[usize; 2]> {
    (0..of_load).flat_map(|i| (0..of_twist).map(move |j| [i, j])).collect()
}

/// The surface of an order through what a law misses of some rows (computed less measured of each row, m), by least squares
/// in standard deviations; `None` if these rows do not determine it.
fn surface(scene: &Scene, data: &Data, errors: &[f64], rows: &[usize], order: [usize; 2]) -> Option<Surface> {
    let [mut low, mut high] = extent(rows.iter().map(|k| data.rows[*k].twist_rad.abs() / std::f64::consts::TAU - 0.5));
    if let Some([first, last]) = scene.envelope.map(|envelope| envelope.turns) {
        let near = SHORT * (high - low);
        low = if low - first < near { low.min(first) } else { low };
        high = if last - high < near { high.max(last) } else { high };
    }
    let mut correction = Correction {
        load_n: extent(rows.iter().map(|k| data.rows[*k].load_n)),
        turns: [low, high],
        coefficients_m: [[0.0; TERMS]; TERMS],
    };
    let terms = terms(order);
    // Of a sweep of one equilibrium nothing is left when a block is held out.
    if rows.len() <= terms.len() {
        return None;
    }
    let matrix = DMatrix::from_fn(rows.len(), terms.len(), |n, t| {
        let row = &data.rows[rows[n]];
        let ([loads, _], [twists, _]) = correction.basis(row.load_n, row.twist_rad.abs());
        loads[terms[t][0]] * twists[terms[t][1]] / row.sigma
    });
    let right = DVector::from_iterator(rows.len(), rows.iter().map(|k| -errors[*k] / data.rows[*k].sigma));
    let svd = matrix.clone().svd(true, true);
    if svd.singular_values.min() < WEAKEST * svd.singular_values.max() {
        return None;
    }
    let solved = svd.solve(&right, 0.0).ok()?;
    for ([i, j], c) in terms.iter().zip(solved.iter()) {
        correction.coefficients_m[*i][*j] = (c * DIGITS_PER_M).round() / DIGITS_PER_M;
    }
    let rest = left(&correction, data, errors);
    let noise = Noise::of(&data.by_run(&data.in_deviations(&rest)), terms.len() as f64);
    let covariance = (matrix.transpose() * matrix).try_inverse()? * noise.inflation;
    let fraction = (rms(&rest) / rms(errors)).powi(2);
    Some(Surface { correction, order, covariance, fraction })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::compete::Candidate;
    use crate::identify::laws::Law;
    use crate::log::sweep::{Stop, Sweep};
    use std::f64::consts::PI;

    fn scene() -> Scene {
        Scene::from_toml_str(include_str!("../../../../scenes/default.toml")).expect("a scene")
    }

    /// How far the gap of a rig is from the default scene's (m), as no radius model has it: what it is short of in the middle
    /// of the way it has back at its end, and more so under a heavy load.
    fn outside_m(load_n: f64, turns: f64) -> f64 {
        -0.4e-3 * (PI * turns / 7.5).sin() * (1.0 + 0.4 * (load_n / 5.0).ln())
    }

    /// What sweeps at these loads give of a rig with so much of [`outside_m`] and a noise of 20 um.
    fn found(loads_n: &[f64], fraction: f64) -> Result<Corrected, String> {
        let scene = scene();
        let mechanism = scene.mechanism().expect("a mechanism");
        let mut data = Data::default();
        for (n, load_n) in loads_n.iter().copied().enumerate() {
            let stop = |k: usize| {
                let turns = 0.3 + 0.2 * k as f64;
                let twist_rad = twist_from_turns(turns);
                let noise_m = 20e-6 * (1.7 * ((k * k + 7 * k * (n + 1)) as f64)).sin();
                let gap_m =
                    mechanism.solve(load_n, twist_rad).expect("solved").gap_m + fraction * outside_m(load_n, turns);
                Stop { twist_rad, position_m: 0.1 - gap_m + noise_m, half_difference_m: 0.0 }
            };
            let sweep = Sweep { load_n, after_n: None, zero_gap_m: Some(0.1), stops: (0..36).map(stop).collect() };
            data.add_sweep(&format!("{load_n} N"), mechanism.parameters(), &sweep);
        }
        let candidates = Candidate::all(&scene, Some(Law::LengthRatioK4), true);
        let candidate = candidates.first().expect("a candidate");
        let fit = candidate.fit(&data).expect("a fit");
        let start = candidate.start().expect("constants");
        let identified = candidate.unknowns.scene(&candidate.scene, &start, &fit.x);
        corrected(&identified, &data.based_on(&start), &fit, 2e-3)
    }

    #[test]
    fn what_no_law_has_is_corrected_also_at_loads_between() {
        let found = found(&[2.0, 7.0, 15.0], 1.0).expect("a correction");
        assert!(found.held_out_m < 0.7 * found.held_out_without_m && found.rms_m < 60e-6, "{found:?}");
        assert!(found.table.is_some());
        let law = Scene { correction: None, ..found.scene.clone() };
        let [before, after] = [&law, &found.scene].map(|scene| {
            let (told, truth) =
                (scene.mechanism().expect("a mechanism"), self::scene().mechanism().expect("a mechanism"));
            let missed_m = |load_n: f64, turns: f64| {
                let gap_m = |m: &tsa_model::Mechanism| m.solve(load_n, twist_from_turns(turns)).expect("solved").gap_m;
                gap_m(&told) - gap_m(&truth) - outside_m(load_n, turns)
            };
            let errors = [4.0, 11.0].into_iter().flat_map(|load_n| (1..15).map(move |k| (load_n, 0.5 * f64::from(k))));
            rms(&errors.map(|(load_n, turns)| missed_m(load_n, 0.3) - missed_m(load_n, turns)).collect::<Vec<_>>())
        });
        assert!(after < 0.7 * before, "{before} {after}");
        // Inside it is there in full, with an error of its own; far outside there is nothing of it.
        let (added_m, variance_m2, size) = found.surface.contraction(5.0, 3.75);
        assert!(added_m != 0.0 && size == 1.0 && variance_m2 > 0.0 && variance_m2.sqrt() < 100e-6, "{variance_m2}");
        assert_eq!(found.surface.contraction(150.0, 3.75), (0.0, 0.0, 0.0));
        assert!(found.surface.fraction < 0.3, "{}", found.surface.fraction);
    }

    #[test]
    fn what_a_law_misses_by_noise_alone_is_not_corrected() {
        let why = found(&[2.0, 7.0, 15.0], 0.0).map(|found| found.order).expect_err("noise");
        assert!(why.contains("better than the law alone"), "{why}");
    }

    #[test]
    fn fewer_than_three_loads_tell_of_the_twist_alone() {
        let stop = |k: u32| Stop { twist_rad: 4.0 + f64::from(k), position_m: 0.0, half_difference_m: 0.0 };
        let sweep = |load_n| Sweep { load_n, after_n: None, zero_gap_m: Some(0.1), stops: (0..40).map(stop).collect() };
        let base = *scene().mechanism().expect("a mechanism").parameters();
        let mut data = Data::default();
        for (load_n, max) in [(5.0, 1), (9.0, 1), (2.0, 3)] {
            data.add_sweep("a sweep", &base, &sweep(load_n));
            assert_eq!(orders(&data).iter().map(|order| order[0]).max(), Some(max), "{load_n}");
        }
        // A line along the twist of the first sweep, and nothing of how it goes on with the load.
        let errors: Vec<f64> = (0..data.rows.len()).map(|k| -1e-6 * k as f64).collect();
        let rows: Vec<usize> = (0..40).collect();
        let line = surface(&scene(), &data, &errors, &rows, [1, 2]).expect("a line");
        assert!((line.correction.at(5.0, 24.0).gap_m - 20e-6).abs() < 1e-8);
        assert!(surface(&scene(), &data, &errors, &rows, [2, 2]).is_none(), "one load says nothing of others");
        assert!(surface(&scene(), &data, &errors, &[], [1, 1]).is_none(), "no row says nothing at all");
    }
}
