//! A fit without some of its rows, or with one more unknown, to first order.

use super::constants::Unknowns;
use super::data::{Data, Row};
use super::fit::{Fit, Problem};
use nalgebra::{DMatrix, DVector};

/// The same fit without some rows, to first order, by the derivatives at the fit to all of them: a law that misses little
/// changes little. Fitting anew would go to states that the model all but refuses, which takes minutes.
#[derive(Debug, Clone)]
pub struct Linear {
    /// Computed less measured of each row, in its standard deviations.
    residuals: DVector<f64>,
    /// Their derivatives by the unknowns.
    jacobian: DMatrix<f64>,
    /// What is expected of the unknowns, as information, and its pull at the fit.
    expected: (DMatrix<f64>, DVector<f64>),
    /// Standard deviation of each row (m).
    sigma_m: Vec<f64>,
}

impl Linear {
    /// About a fit; rows that the model refuses do not count.
    pub fn about(unknowns: &Unknowns, data: &Data, whole: &Fit) -> Self {
        let rows: Vec<&Row> = data.rows.iter().collect();
        let count = whole.x.len();
        let inflation = whole.noise.inflation.max(f64::MIN_POSITIVE);
        let x = DVector::from_vec(whole.x.clone());
        let problem = Problem::new(unknowns, rows, Vec::new(), x, inflation);
        let mut expected = (DMatrix::zeros(count, count), DVector::zeros(count));
        for e in &whole.expected {
            expected.0[(e.unknown, e.unknown)] = e.spread.powi(-2);
            expected.1[e.unknown] = (whole.x[e.unknown] - e.value) * e.spread.powi(-2);
        }
        let sigma_m = data.rows.iter().map(|row| row.sigma * problem.wider).collect();
        let jacobian = problem.derivatives();
        Self { residuals: problem.residuals, jacobian, expected, sigma_m }
    }

    /// Computed less measured of all rows (m), after a fit to those that are not held out. Zeros of sensors of which no
    /// row is left are free of the rest.
    pub fn without(&self, held_out: &[usize]) -> Option<Vec<f64>> {
        self.solved(held_out, &DVector::zeros(self.residuals.len())).map(|(errors, _)| errors)
    }

    /// Computed less measured of all rows (m), after a fit with one more unknown, which changes each row by `by` (m); and
    /// that unknown.
    pub fn with(&self, by: &[f64]) -> Option<(Vec<f64>, f64)> {
        let more = DVector::from_fn(by.len(), |k, _| by[k] / self.sigma_m[k]);
        self.solved(&[], &more)
    }

    fn solved(&self, held_out: &[usize], more: &DVector<f64>) -> Option<(Vec<f64>, f64)> {
        let count = self.jacobian.ncols();
        let mut jacobian = self.jacobian.clone().insert_column(count, 0.0);
        jacobian.set_column(count, more);
        let mut information = self.expected.0.clone().insert_column(count, 0.0).insert_row(count, 0.0);
        let mut pull = self.expected.1.clone().insert_row(count, 0.0);
        for k in (0..self.residuals.len()).filter(|k| !held_out.contains(k)) {
            let row = jacobian.row(k).transpose();
            information += &row * row.transpose();
            pull += row * self.residuals[k];
        }
        // What nothing tells stays where it is.
        for k in 0..=count {
            if information[(k, k)] == 0.0 {
                information[(k, k)] = 1.0;
            }
        }
        let scale: Vec<f64> = (0..=count).map(|k| information[(k, k)].sqrt()).collect();
        let scaled = DMatrix::from_fn(count + 1, count + 1, |i, j| information[(i, j)] / (scale[i] * scale[j]));
        let right = DVector::from_fn(count + 1, |k, _| pull[k] / scale[k]);
        let step = scaled.lu().solve(&right)?;
        let step = DVector::from_fn(count + 1, |k, _| -step[k] / scale[k]);
        let errors = &self.residuals + &jacobian * &step;
        Some((errors.iter().zip(&self.sigma_m).map(|(error, sigma_m)| error * sigma_m).collect(), step[count]))
    }
}
