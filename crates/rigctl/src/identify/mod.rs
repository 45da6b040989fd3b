//! Fitting a scene's constants to what was measured, with exact derivatives from the solver.
//!
//! - [`constants`]: what can be fitted, and how the fit sees it.
//! - [`data`]: recorded sweeps and the paper's numbers.
//! - [`plausible`]: numbers that no rig gives, and wrong units.
//! - here: the least squares, what the data can tell, and the errors.

pub mod constants;
pub mod data;
pub mod envelope;
pub mod plausible;

use constants::{MOST, Number, Unknowns};
use data::{Data, Quantity, Row};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned};
use rig_scene::Uncertainty;
use serde::Serialize;
use tsa_model::{Mechanism, PRETWIST_RAD, Parameters, SolveError};

/// A constant counts as determined by the data if its standard error is below this share of it.
pub const WORST_STANDARD_ERROR: f64 = 0.5;
/// Directions of the scaled problem that are this much weaker than the strongest are not determined.
const WEAKEST: f64 = 1e-5;
/// Residual of a state that the model refuses, in standard deviations: no solution is worse than any.
const REFUSED: f64 = 10.0;

/// Why there is no fit.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// A starting value, or too many constants.
    #[error("{0}")]
    Start(String),
    /// Fewer numbers than unknowns.
    #[error("{rows} numbers cannot tell {unknowns} unknowns: {labels}")]
    TooFew {
        /// Numbers fitted.
        rows: usize,
        /// Unknowns.
        unknowns: usize,
        /// Their names.
        labels: String,
    },
    /// The data leave a combination of constants open.
    #[error(
        "the data cannot tell {constants}: {why}; leave out one of them with --fit, or record other loads and turns"
    )]
    Undetermined {
        /// The constants.
        constants: String,
        /// How that shows.
        why: String,
    },
    /// The optimiser did not end at a minimum.
    #[error("the fit did not converge: {0}")]
    NotConverged(String),
}

/// Errors over some rows: relative for the paper's numbers, in metres for sweeps.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Errors {
    /// Rows.
    pub count: usize,
    /// Root mean square.
    pub rms: f64,
    /// Median of the absolute values.
    pub median: f64,
    /// Greatest absolute value.
    pub worst: f64,
}

impl Errors {
    fn over(errors: impl Iterator<Item = f64>) -> Self {
        let mut all: Vec<f64> = errors.map(f64::abs).collect();
        all.sort_by(f64::total_cmp);
        let count = all.len();
        if count == 0 {
            return Self::default();
        }
        let rms = (all.iter().map(|e| e * e).sum::<f64>() / count as f64).sqrt();
        let median = 0.5 * (all[(count - 1) / 2] + all[count / 2]);
        Self { count, rms, median, worst: all[count - 1] }
    }
}

/// Least standard errors of an identified scene: strings bed in, creep and warm up between the sweeps and later use
/// (docs/plants.md), which no sweep shows. Radius (relative), gap's zero (m), change of the load (relative).
const LEAST_RADIUS_ERROR: f64 = 0.004;
const LEAST_ZERO_ERROR_M: f64 = 50e-6;
const CHANGE_ERROR: f64 = 0.01;

/// How well a scene's constants are known after a fit to sweeps whose zero is known. What the fit leaves is smooth over a
/// sweep, not noise that averages out, so that it counts in full, and twice because the use is not the sweep.
pub fn uncertainty(fit: &Fit) -> Uncertainty {
    let left_m = 2.0 * fit.fitted.rms.max(fit.held_out.rms);
    Uncertainty {
        radius: LEAST_RADIUS_ERROR,
        gap_zero_m: left_m.hypot(LEAST_ZERO_ERROR_M).min(0.05),
        load_shape: CHANGE_ERROR,
    }
}

/// One row after the fit.
#[derive(Debug, Clone, Serialize)]
pub struct Fitted {
    /// Its name.
    pub id: String,
    /// Measured (m, rad/m).
    pub measured: f64,
    /// Computed; none where the model refuses.
    pub computed: Option<f64>,
    /// Computed less measured, over the row's unit of error.
    pub error: Option<f64>,
    /// Only predicted.
    pub held_out: bool,
    /// Why there is no number.
    pub refused: Option<String>,
}

/// One unknown after the fit.
#[derive(Debug, Clone, Serialize)]
pub struct Estimate {
    /// Its name.
    pub name: String,
    /// The unknown as fitted: a logarithm, for a positive constant; its value stands in the scene.
    pub unknown: f64,
    /// Its standard error: of a positive constant, relative.
    pub standard_error: f64,
}

/// A fit.
#[derive(Debug, Clone, Serialize)]
pub struct Fit {
    /// Unknowns, the zeros of gap sensors last.
    pub estimates: Vec<Estimate>,
    /// Their correlations.
    pub correlations: Vec<Vec<f64>>,
    /// Errors of the rows that were fitted.
    pub fitted: Errors,
    /// Errors of the rows that were only predicted.
    pub held_out: Errors,
    /// Every row.
    pub rows: Vec<Fitted>,
    /// Evaluations of the problem.
    pub evaluations: usize,
}

/// The least-squares problem.
struct Problem<'a> {
    unknowns: &'a Unknowns,
    rows: Vec<&'a Row>,
    /// Value and standard deviation that are expected of an unknown.
    expected: Vec<(usize, f64, f64)>,
    x: DVector<f64>,
    residuals: DVector<f64>,
    jacobian: DMatrix<f64>,
}

/// The row's number with its derivatives by the constants.
fn predict(unknowns: &Unknowns, row: &Row, x: &[f64]) -> Result<Number, SolveError> {
    let m = Mechanism::of(unknowns.parameters(&row.base, x, &row.fixed));
    let e = m.formal(row.load_n, row.twist_rad)?;
    Ok(match row.quantity {
        Quantity::Gap => e.gap_m,
        Quantity::Contraction => m.formal(row.load_n, PRETWIST_RAD)?.gap_m - e.gap_m,
        Quantity::Tr => e.tr_rad_per_m(),
        Quantity::Span => e.d_m,
    })
}

impl<'a> Problem<'a> {
    fn new(unknowns: &'a Unknowns, data: &'a Data, x: DVector<f64>) -> Self {
        let rows: Vec<&Row> = data.rows.iter().filter(|r| !r.held_out).collect();
        let spreads = unknowns.constants.iter().flat_map(|c| vec![c.spread(); c.unknowns()]).enumerate();
        let expected: Vec<(usize, f64, f64)> = spreads
            .filter(|_| unknowns.expected)
            .filter_map(|(unknown, spread)| Some((unknown, x[unknown], spread?)))
            .collect();
        let (n, m) = (rows.len() + expected.len(), x.len());
        let mut problem =
            Self { unknowns, rows, expected, x, residuals: DVector::zeros(n), jacobian: DMatrix::zeros(n, m) };
        problem.evaluate();
        problem
    }

    fn evaluate(&mut self) {
        let count = self.unknowns.count();
        self.jacobian.fill(0.0);
        for (k, row) in self.rows.iter().enumerate() {
            let Ok(computed) = predict(self.unknowns, row, self.x.as_slice()) else {
                self.residuals[k] = REFUSED * if row.zero.is_some() { 100.0 } else { 1.0 };
                continue;
            };
            let mut value = computed.value;
            for j in 0..count {
                self.jacobian[(k, j)] = computed.by[j] / row.sigma;
            }
            if let Some(zero) = row.zero {
                value += self.x[count + zero];
                self.jacobian[(k, count + zero)] = 1.0 / row.sigma;
            }
            self.residuals[k] = (value - row.value) / row.sigma;
        }
        for (k, (unknown, value, spread)) in self.expected.iter().enumerate() {
            self.residuals[self.rows.len() + k] = (self.x[*unknown] - value) / spread;
            self.jacobian[(self.rows.len() + k, *unknown)] = 1.0 / spread;
        }
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.x.copy_from(x);
        self.evaluate();
    }
    fn params(&self) -> DVector<f64> {
        self.x.clone()
    }
    fn residuals(&self) -> Option<DVector<f64>> {
        Some(self.residuals.clone())
    }
    fn jacobian(&self) -> Option<DMatrix<f64>> {
        Some(self.jacobian.clone())
    }
}

/// Fits the unknowns to the data; the constants as unknowns, and the fit.
///
/// # Errors
/// [`IdentifyError`]: what the data cannot tell is refused by name.
pub fn fit(unknowns: &Unknowns, start: &Parameters, data: &Data) -> Result<(Vec<f64>, Fit), IdentifyError> {
    let mut x: Vec<f64> = Vec::new();
    for constant in &unknowns.constants {
        x.extend(constant.start(start).map_err(IdentifyError::Start)?);
    }
    if x.len() > MOST {
        return Err(IdentifyError::Start(format!("--fit: {} unknowns, at most {MOST}", x.len())));
    }
    let mut labels = unknowns.labels();
    for zero in 0..data.zeros {
        // A first guess of each sensor's zero: what the model's gap misses on average.
        let misses: Vec<f64> = data
            .rows
            .iter()
            .filter(|r| r.zero == Some(zero))
            .filter_map(|r| Some(r.value - predict(unknowns, r, &x).ok()?.value))
            .collect();
        x.push(misses.iter().sum::<f64>() / misses.len().max(1) as f64);
        labels.push(format!("zero of sweep {}", zero + 1));
    }
    let problem = Problem::new(unknowns, data, DVector::from_vec(x));
    let (n, m) = problem.jacobian.shape();
    if n <= m {
        return Err(IdentifyError::TooFew { rows: n, unknowns: m, labels: labels.join(", ") });
    }
    // Constants that the data leave open at the start stay open to the end, and would lead the fit astray.
    directions(&problem.jacobian, &labels)?;
    let method = LevenbergMarquardt::new();
    // Data of a real rig leave residuals that no constants take away: the last digits of the fit mean nothing there, and
    // where the model nearly refuses each of them costs seconds.
    let method = if unknowns.expected { method.with_tol(1e-8).with_patience(20) } else { method.with_patience(200) };
    let (problem, report) = method.minimize(problem);
    let enough = report.termination.was_successful() || unknowns.expected;
    if !enough {
        return Err(IdentifyError::NotConverged(format!("{:?}", report.termination)));
    }
    let covariance = directions(&problem.jacobian, &labels)?;
    let variance = problem.residuals.norm_squared() / (n - m) as f64;
    let error = |k: usize| (covariance[(k, k)] * variance).sqrt();
    let count = unknowns.count();
    let weak: Vec<&str> = (0..count).filter(|k| error(*k) > WORST_STANDARD_ERROR).map(|k| labels[k].as_str()).collect();
    if !weak.is_empty() && !unknowns.expected {
        let why = format!("standard errors above {:.0} %", 100.0 * WORST_STANDARD_ERROR);
        return Err(IdentifyError::Undetermined { constants: weak.join(", "), why });
    }
    let x = problem.x.as_slice().to_vec();
    let estimates =
        (0..m).map(|k| Estimate { name: labels[k].clone(), unknown: x[k], standard_error: error(k) }).collect();
    let correlation = |i: usize, j: usize| covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
    let correlations = (0..m).map(|i| (0..m).map(|j| correlation(i, j)).collect()).collect();
    let rows: Vec<Fitted> = data.rows.iter().map(|r| fitted(unknowns, r, &x)).collect();
    let over = |held_out: bool| Errors::over(rows.iter().filter(|r| r.held_out == held_out).filter_map(|r| r.error));
    let (inside, outside) = (over(false), over(true));
    let fit = Fit {
        estimates,
        correlations,
        fitted: inside,
        held_out: outside,
        rows,
        evaluations: report.number_of_evaluations,
    };
    Ok((x, fit))
}

fn fitted(unknowns: &Unknowns, row: &Row, x: &[f64]) -> Fitted {
    let zero = row.zero.and_then(|z| x.get(unknowns.count() + z)).copied().unwrap_or(0.0);
    let computed = predict(unknowns, row, x).map(|c| c.value + zero);
    // Relative for the paper's numbers, whose standard deviation is the number; metres for a sweep.
    let unit = if row.sigma == row.value { row.value } else { 1.0 };
    Fitted {
        id: row.id.clone(),
        measured: row.value,
        error: computed.as_ref().ok().map(|c| (c - row.value) / unit),
        refused: computed.as_ref().err().map(ToString::to_string),
        computed: computed.ok(),
        held_out: row.held_out,
    }
}

/// The inverse of JᵀJ, if the data determine every direction of it.
fn directions(jacobian: &DMatrix<f64>, labels: &[String]) -> Result<DMatrix<f64>, IdentifyError> {
    let norms: Vec<f64> = jacobian.column_iter().map(|c| c.norm()).collect();
    let silent: Vec<&str> =
        norms.iter().zip(labels).filter(|(n, _)| **n == 0.0).map(|(_, label)| label.as_str()).collect();
    if !silent.is_empty() {
        let why = "no number depends on it".to_owned();
        return Err(IdentifyError::Undetermined { constants: silent.join(", "), why });
    }
    let mut scaled = jacobian.clone();
    for (mut column, norm) in scaled.column_iter_mut().zip(&norms) {
        column /= *norm;
    }
    let lost = || IdentifyError::NotConverged("the Jacobian has no singular values".into());
    let svd = scaled.svd(false, true);
    let v = svd.v_t.as_ref().ok_or_else(lost)?;
    let strongest = svd.singular_values.max();
    for (k, s) in svd.singular_values.iter().enumerate() {
        if s.is_nan() || *s < WEAKEST * strongest {
            let row = v.row(k);
            let largest = row.amax();
            let part = |j: usize| row[j].abs() > 0.1 * largest;
            let involved: Vec<&str> = (0..labels.len()).filter(|j| part(*j)).map(|j| labels[j].as_str()).collect();
            let why =
                format!("one combination of them is {:.0e} times weaker than the rest", strongest / s.max(1e-300));
            return Err(IdentifyError::Undetermined { constants: involved.join(", "), why });
        }
    }
    let m = labels.len();
    Ok(DMatrix::from_fn(m, m, |i, j| {
        (0..m).map(|k| v[(k, i)] * v[(k, j)] / svd.singular_values[k].powi(2)).sum::<f64>() / (norms[i] * norms[j])
    }))
}
