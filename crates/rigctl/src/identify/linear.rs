//! A fit without some of its rows, or with one more unknown, to first order.

use super::data::Data;
use super::fit::{Fit, Problem};
use nalgebra::{DMatrix, DVector};

/// By the derivatives at the fit to all rows: a law that misses little changes little. Fitting again would go to states that the model all but refuses, which takes minutes.
#[derive(Debug, Clone)]
pub struct Linear {
    /// Computed less measured of each row, in its standard deviations.
    residuals: DVector<f64>,
    /// Their derivatives by the unknowns.
    jacobian: DMatrix<f64>,
    /// What is expected of the unknowns, as information, and its pull at the fit.
    expected: (DMatrix<f64>, DVector<f64>),
    /// Standard deviation of each row (m).
    sigma_m: DVector<f64>,
}

impl Linear {
    /// About a fit; rows that the model refuses do not count.
    pub fn about(data: &Data, whole: &Fit) -> Self {
        let count = whole.x.len();
        let inflation = whole.noise.inflation.max(f64::MIN_POSITIVE);
        let x = DVector::from_vec(whole.x.clone());
        let problem = Problem::new(&whole.unknowns, data.rows.iter().collect(), Vec::new(), x, inflation);
        let mut expected = (DMatrix::zeros(count, count), DVector::zeros(count));
        for e in &whole.expected {
            expected.0[(e.unknown, e.unknown)] = e.spread.powi(-2);
            expected.1[e.unknown] = (whole.x[e.unknown] - e.value) * e.spread.powi(-2);
        }
        let sigma_m = DVector::from_fn(data.rows.len(), |k, _| data.rows[k].sigma * problem.wider);
        Self { jacobian: problem.derivatives(), residuals: problem.residuals, expected, sigma_m }
    }

    /// Computed less measured of all rows (m), after a fit to those that are not held out. Zeros of sensors of which no
    /// row is left are free of the rest.
    pub fn without(&self, held_out: &[usize]) -> Option<Vec<f64>> {
        self.solved(held_out, &DVector::zeros(self.residuals.len())).map(|(errors, _)| errors)
    }

    /// Computed less measured of all rows (m), after a fit with one more unknown, which changes each row by `by` (m); and
    /// that unknown.
    pub fn with(&self, by: &[f64]) -> Option<(Vec<f64>, f64)> {
        self.solved(&[], &DVector::from_column_slice(by).component_div(&self.sigma_m))
    }

    fn solved(&self, held_out: &[usize], more: &DVector<f64>) -> Option<(Vec<f64>, f64)> {
        let count = self.jacobian.ncols();
        let mut jacobian = self.jacobian.clone().insert_column(count, 0.0);
        jacobian.set_column(count, more);
        let told: Vec<usize> = (0..self.residuals.len()).filter(|k| !held_out.contains(k)).collect();
        let rows = jacobian.select_rows(&told);
        let mut information =
            rows.tr_mul(&rows) + self.expected.0.clone().insert_column(count, 0.0).insert_row(count, 0.0);
        let pull = rows.tr_mul(&self.residuals.select_rows(&told)) + self.expected.1.clone().insert_row(count, 0.0);
        // What nothing tells stays where it is.
        for k in (0..=count).map(|k| (k, k)) {
            information[k] = if information[k] == 0.0 { 1.0 } else { information[k] };
        }
        let scale = information.diagonal().map(f64::sqrt);
        let scaled = information.component_div(&(&scale * scale.transpose()));
        let step = -scaled.lu().solve(&pull.component_div(&scale))?.component_div(&scale);
        let errors = (&self.residuals + &jacobian * &step).component_mul(&self.sigma_m);
        Some((errors.as_slice().to_vec(), step[count]))
    }
}
