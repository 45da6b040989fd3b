//! The least squares, and what the data can tell of the unknowns.

use super::constants::{Constant, MAX, Number, Unknowns};
use super::data::{Data, Quantity, Row};
use super::hysteresis::{Loop, load_fraction, loops, slopes};
use crate::statistics::{Errors, Noise, half_width};
use crate::units::{NUMBER, PERCENT};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned};
use serde::Serialize;
use tsa_model::scalar::Scalar;
use tsa_model::{Mechanism, PRETWIST_RAD, Parameters, SolveError};

/// A constant counts as determined by the data if its standard error is below this fraction of it.
pub const WORST_STANDARD_ERROR: f64 = 0.5;
/// Directions of the scaled problem that are this much weaker than the strongest are not determined.
const WEAKEST: f64 = 1e-5;
/// By what the rows' variances are multiplied in the first of two passes, where the scene's values are expected: until it
/// is known what the law misses, it must not lead the constants far away.
const FIRST_INFLATION: f64 = 100.0;
/// Residual of a state that the model refuses, in standard deviations: no solution is worse than any.
const REFUSED: f64 = 10.0;

/// Why there is no fit.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// A starting value, too many constants, or fewer numbers than unknowns.
    #[error("{0}")]
    Start(String),
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
    /// The sweeps do not belong together, or something happened in one.
    #[error("{0}")]
    Apart(String),
    /// The optimiser did not end at a minimum.
    #[error("the fit did not converge ({0}): begin from a nearer scene (--scene), or fit fewer constants (--fit)")]
    NotConverged(String),
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
    /// Its value (SI units; of the modulus a1, in Pa): what a logarithm stands for.
    pub value: f64,
    /// Where the interval begins that holds the true value nine times in ten.
    pub low: f64,
    /// Where it ends.
    pub high: f64,
    /// The unknown as fitted: a logarithm, for a positive constant; its value stands in the scene.
    pub unknown: f64,
    /// Its standard error: of a positive constant, relative.
    pub standard_error: f64,
    /// Half the width of the interval that holds the truth nine times in ten, likewise.
    pub half_width_90: f64,
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
    /// How many of the residuals count as independent.
    pub effective_rows: f64,
    /// What was fitted, and from which constants.
    #[serde(skip)]
    pub unknowns: Unknowns,
    /// The constants where it started.
    #[serde(skip)]
    pub base: Parameters,
    /// The values of the unknowns.
    #[serde(skip)]
    pub x: Vec<f64>,
    /// Their covariance, with correlated residuals counted.
    #[serde(skip)]
    pub covariance: DMatrix<f64>,
    /// The part of it that was estimated from the residuals; the rest is what is known of sweeps beforehand.
    #[serde(skip)]
    pub estimated: DMatrix<f64>,
    /// What the fit leaves.
    #[serde(skip)]
    pub noise: Noise,
    /// What was expected of the unknowns.
    #[serde(skip)]
    pub expected: Vec<Expected>,
    /// Loops between the way up and the way down.
    pub loops: Vec<Loop>,
}

/// What is expected of an unknown before anything is measured.
#[derive(Debug, Clone, Copy)]
pub struct Expected {
    /// Which.
    pub unknown: usize,
    /// Its value.
    pub value: f64,
    /// Standard deviation about it.
    pub spread: f64,
}

/// The least-squares problem.
pub(super) struct Problem<'a> {
    unknowns: &'a Unknowns,
    rows: Vec<&'a Row>,
    expected: Vec<Expected>,
    /// Factor of the rows' standard deviations.
    pub(super) wider: f64,
    x: DVector<f64>,
    pub(super) residuals: DVector<f64>,
    /// Rows that the model refused at the start.
    refused: Vec<bool>,
    /// The rows are of recorded sweeps.
    recorded: bool,
}

/// The row's number with its derivatives by the constants.
fn predict(unknowns: &Unknowns, row: &Row, x: &[f64]) -> Result<Number, SolveError> {
    number(Mechanism::of(unknowns.put(&row.base, x, &row.fixed, Number::parameter)), row)
}

/// The row's number alone.
fn value(unknowns: &Unknowns, row: &Row, x: &[f64]) -> Result<f64, SolveError> {
    number(Mechanism::of(unknowns.put(&row.base, x, &row.fixed, |value, _| value)), row)
}

fn number<T: Scalar>(m: Mechanism<T>, row: &Row) -> Result<T, SolveError> {
    let e = m.formal(row.load_n, row.twist_rad)?;
    Ok(match row.quantity {
        Quantity::Gap => e.gap_m,
        Quantity::Contraction => m.formal(row.load_n, PRETWIST_RAD)?.gap_m - e.gap_m,
        Quantity::Tr => e.tr_rad_per_m(),
        Quantity::Span => e.d_m,
    })
}

impl<'a> Problem<'a> {
    pub(super) fn new(
        unknowns: &'a Unknowns,
        rows: Vec<&'a Row>,
        expected: Vec<Expected>,
        x: DVector<f64>,
        inflation: f64,
    ) -> Self {
        let n = rows.len() + expected.len();
        let wider = inflation.sqrt();
        let recorded = rows.iter().any(|row| row.sigma != row.value);
        let (residuals, refused) = (DVector::zeros(n), vec![false; rows.len()]);
        let mut problem = Self { unknowns, rows, expected, wider, x, residuals, refused, recorded };
        let computed: Vec<Option<f64>> =
            problem.rows.iter().map(|row| value(unknowns, row, problem.x.as_slice()).ok()).collect();
        problem.refused = computed.iter().map(Option::is_none).collect();
        problem.evaluate(|k, _| computed[k]);
        problem
    }

    /// The residuals of computed rows. Only states that the model solved at the start are computed: to refuse one takes as
    /// long as to solve a thousand. For the same reason a step that leads to a refused state is not computed any further.
    fn evaluate(&mut self, compute: impl Fn(usize, &[f64]) -> Option<f64>) {
        let count = self.unknowns.count();
        let mut left = false;
        for (k, row) in self.rows.iter().enumerate() {
            let asked = !(left || self.refused[k]);
            let Some(computed) = asked.then(|| compute(k, self.x.as_slice())).flatten() else {
                left |= asked;
                self.residuals[k] = REFUSED * if row.zero.is_some() { 100.0 } else { 1.0 };
                continue;
            };
            let zero = row.zero.map_or(0.0, |zero| self.x[count + zero]);
            self.residuals[k] = (computed + zero - row.value) / (row.sigma * self.wider);
        }
        for (k, e) in self.expected.iter().enumerate() {
            self.residuals[self.rows.len() + k] = (self.x[e.unknown] - e.value) / e.spread;
        }
    }

    /// Their derivatives.
    pub(super) fn derivatives(&self) -> DMatrix<f64> {
        let count = self.unknowns.count();
        let mut jacobian = DMatrix::zeros(self.residuals.len(), self.x.len());
        for (k, row) in self.rows.iter().enumerate().filter(|(k, _)| !self.refused[*k]) {
            let Ok(computed) = predict(self.unknowns, row, self.x.as_slice()) else { continue };
            let sigma = row.sigma * self.wider;
            for j in 0..count {
                jacobian[(k, j)] = computed.by[j] / sigma;
            }
            if let Some(zero) = row.zero {
                jacobian[(k, count + zero)] = 1.0 / sigma;
            }
        }
        for (k, e) in self.expected.iter().enumerate() {
            jacobian[(self.rows.len() + k, e.unknown)] = 1.0 / e.spread;
        }
        jacobian
    }

    /// The minimum, and how many evaluations it took; with what the optimiser says where it is not at one.
    fn minimised(self) -> (Self, usize, Result<(), String>) {
        let method = LevenbergMarquardt::new();
        // Sweeps leave residuals that no constants take away: the last digits of the fit mean nothing there, and where the
        // model nearly refuses each of them costs seconds. A law that does not describe the sweeps may never come to a
        // minimum: it is judged by what it predicts from where it is.
        let method = if self.recorded { method.with_tol(1e-8).with_patience(20) } else { method.with_patience(200) };
        let (problem, report) = method.minimize(self);
        let enough = report.termination.was_successful() || problem.recorded;
        let end = if enough { Ok(()) } else { Err(format!("{:?}", report.termination)) };
        (problem, report.number_of_evaluations, end)
    }

    /// The inverse of the information, with the rows' variances multiplied.
    fn covariance(&self, jacobian: &DMatrix<f64>, inflation: f64) -> Option<DMatrix<f64>> {
        let mut weighted = jacobian.clone();
        let by = self.wider / inflation.sqrt();
        weighted.rows_mut(0, self.rows.len()).iter_mut().for_each(|x| *x *= by);
        let norms = scale(&mut weighted);
        let inverse = (weighted.transpose() * &weighted).try_inverse()?;
        Some(DMatrix::from_fn(norms.len(), norms.len(), |i, j| inverse[(i, j)] / (norms[i] * norms[j])))
    }

    /// A covariance with what each sweep has of its own as a whole: the rows' change with the load moves the unknowns by the
    /// weights that the fit gives them (the covariance between blocks of rows that a sandwich estimate has in its middle).
    fn with_sweeps(
        &self,
        covariance: DMatrix<f64>,
        jacobian: &DMatrix<f64>,
        inflation: f64,
        loops: &[Loop],
        data: &Data,
        runs: &[Vec<usize>],
    ) -> DMatrix<f64> {
        if loops.is_empty() {
            return covariance;
        }
        let slopes = slopes(self.unknowns, data, self.x.as_slice());
        let mut all = covariance.clone();
        // Rows and Jacobian have the inflation of this problem, the covariance another.
        let by = self.wider.powi(2) / inflation.max(f64::MIN_POSITIVE);
        for run in runs {
            let mut pull = DVector::zeros(self.x.len());
            for k in run.iter().filter(|k| slopes[**k].is_finite()) {
                let row = &data.rows[*k];
                let change = load_fraction(loops, row.load_n) * row.load_n * slopes[*k] / (row.sigma * self.wider);
                pull += jacobian.row(*k).transpose() * (change * by);
            }
            let moved = &covariance * pull;
            all += &moved * moved.transpose();
        }
        all
    }

    /// What the residuals of the rows say, in their own standard deviations, run by run.
    fn noise(&self, jacobian: &DMatrix<f64>, runs: &[Vec<usize>]) -> Noise {
        let residuals: Vec<Vec<f64>> =
            runs.iter().map(|run| run.iter().map(|k| self.residuals[*k] * self.wider).collect()).collect();
        let unknowns = self.x.len() as f64;
        let mut noise = Noise::of(&residuals, unknowns);
        // What is expected tells some of the unknowns, the rows the rest.
        for _ in 0..3 {
            let Some(covariance) = self.covariance(jacobian, noise.inflation.max(1e-12)) else { break };
            let expected: f64 =
                self.expected.iter().map(|e| covariance[(e.unknown, e.unknown)] / e.spread.powi(2)).sum();
            noise = Noise::of(&residuals, unknowns - expected);
        }
        noise
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.x.copy_from(x);
        let (unknowns, rows) = (self.unknowns, self.rows.clone());
        self.evaluate(|k, x| value(unknowns, rows[k], x).ok());
    }
    fn params(&self) -> DVector<f64> {
        self.x.clone()
    }
    fn residuals(&self) -> Option<DVector<f64>> {
        Some(self.residuals.clone())
    }
    fn jacobian(&self) -> Option<DMatrix<f64>> {
        Some(self.derivatives())
    }
}

/// Where the unknowns begin, the zeros of gap sensors last, and their names.
fn begin(unknowns: &Unknowns, start: &Parameters, data: &Data) -> Result<(Vec<f64>, Vec<String>), IdentifyError> {
    let mut x: Vec<f64> = Vec::new();
    for constant in &unknowns.constants {
        x.extend(constant.start(start).map_err(IdentifyError::Start)?);
    }
    if x.len() > MAX {
        return Err(IdentifyError::Start(format!("--fit: {} unknowns, at most {MAX}", x.len())));
    }
    let mut labels = unknowns.labels();
    for zero in 0..data.zeros {
        // A first guess of each sensor's zero: what the model's gap misses on average.
        let of_zero = data.rows.iter().filter(|r| r.zero == Some(zero));
        let misses: Vec<f64> = of_zero.filter_map(|r| Some(r.value - value(unknowns, r, &x).ok()?)).collect();
        x.push(misses.iter().sum::<f64>() / misses.len().max(1) as f64);
        labels.push(format!("zero of sweep {}", zero + 1));
    }
    Ok((x, labels))
}

/// Fits the unknowns to the data; the values that are expected of them beforehand are shifted each by so many of its standard
/// deviations, which is none unless it is said.
///
/// # Errors
/// [`IdentifyError`]: what the data cannot tell is refused by name.
pub fn fit(unknowns: &Unknowns, start: &Parameters, data: &Data, shifts: &[f64]) -> Result<Fit, IdentifyError> {
    let (x, labels) = begin(unknowns, start, data)?;
    let spreads = unknowns.constants.iter().flat_map(|c| vec![c.spread(); c.unknowns()]).enumerate();
    let expected: Vec<Expected> = spreads
        .filter(|_| unknowns.expected)
        .filter_map(|(unknown, spread)| {
            let (spread, shift) = (spread?, shifts.get(unknown).copied().unwrap_or(0.0));
            Some(Expected { unknown, value: x[unknown] + shift * spread, spread })
        })
        .collect();
    let used: Vec<usize> = (0..data.rows.len()).filter(|k| !data.rows[*k].held_out).collect();
    let rows = used.iter().map(|k| &data.rows[*k]).collect();
    let first = if unknowns.expected { FIRST_INFLATION } else { 1.0 };
    let problem = Problem::new(unknowns, rows, expected, DVector::from_vec(x), first);
    let (n, m) = (problem.residuals.len(), problem.x.len());
    if n <= m {
        return Err(IdentifyError::Start(format!("{n} numbers cannot tell {m} unknowns: {}", labels.join(", "))));
    }
    // Constants that the data leave open at the start stay open to the end, and would lead the fit astray.
    determined(&problem.derivatives(), &labels)?;
    let (mut problem, mut evaluations, end) = problem.minimised();
    end.map_err(IdentifyError::NotConverged)?;
    // Numbers that are not of a sweep have no neighbours.
    let runs: Vec<Vec<usize>> =
        if data.files.is_empty() { (0..used.len()).map(|k| vec![k]).collect() } else { data.runs() };
    let mut jacobian = problem.derivatives();
    let mut noise = problem.noise(&jacobian, &runs);
    if unknowns.expected {
        // What is expected counts beside the rows for what they are worth.
        let Problem { rows, expected, x, .. } = problem;
        let again = Problem::new(unknowns, rows, expected, x, noise.inflation.max(1.0));
        let (again, more, _) = again.minimised();
        (problem, evaluations) = (again, evaluations + more);
        jacobian = problem.derivatives();
        noise = problem.noise(&jacobian, &runs);
    }
    determined(&jacobian, &labels)?;
    let lost = || IdentifyError::NotConverged("the information has no inverse".into());
    let covariance = problem.covariance(&jacobian, noise.inflation.max(f64::MIN_POSITIVE)).ok_or_else(lost)?;
    // A sweep as a whole may have had another load than the one that hung: what friction and creep amount to.
    let loops = if unknowns.expected { loops(data, &slopes(unknowns, data, problem.x.as_slice())) } else { Vec::new() };
    let estimated = covariance.clone();
    let covariance = problem.with_sweeps(covariance, &jacobian, noise.inflation, &loops, data, &runs);
    let error = |k: usize| covariance[(k, k)].sqrt();
    let count = unknowns.count();
    let weak: Vec<&str> = (0..count).filter(|k| error(*k) > WORST_STANDARD_ERROR).map(|k| labels[k].as_str()).collect();
    if !weak.is_empty() && !unknowns.expected {
        let why = format!("standard errors above {}", PERCENT.exact(WORST_STANDARD_ERROR));
        return Err(IdentifyError::Undetermined { constants: weak.join(", "), why });
    }
    let x = problem.x.as_slice().to_vec();
    let estimate = |k: usize| {
        let half_width_90 = half_width(estimated[(k, k)], covariance[(k, k)] - estimated[(k, k)], noise.freedom);
        let [value, low, high] = [0.0, -half_width_90, half_width_90].map(|by| match Constant::named(&labels[k]) {
            Some(Constant::Modulus) => start.stress_coefficients_pa[0] * (x[k] + by).exp(),
            Some(_) => (x[k] + by).exp(),
            None => x[k] + by,
        });
        Estimate { name: labels[k].clone(), value, low, high, unknown: x[k], standard_error: error(k), half_width_90 }
    };
    let estimates = (0..m).map(estimate).collect();
    let correlation = |i: usize, j: usize| covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
    let correlations = (0..m).map(|i| (0..m).map(|j| correlation(i, j)).collect()).collect();
    let rows: Vec<Fitted> = data.rows.iter().map(|r| fitted(unknowns, r, &x)).collect();
    let over = |held_out: bool| Errors::over(rows.iter().filter(|r| r.held_out == held_out).filter_map(|r| r.error));
    let (inside, outside) = (over(false), over(true));
    let expected = problem.expected;
    Ok(Fit {
        estimates,
        correlations,
        fitted: inside,
        held_out: outside,
        rows,
        evaluations,
        effective_rows: noise.effective,
        unknowns: unknowns.clone(),
        base: *start,
        x,
        covariance,
        estimated,
        noise,
        expected,
        loops,
    })
}

fn fitted(unknowns: &Unknowns, row: &Row, x: &[f64]) -> Fitted {
    let zero = row.zero.and_then(|z| x.get(unknowns.count() + z)).copied().unwrap_or(0.0);
    let computed = value(unknowns, row, x).map(|computed| computed + zero);
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

/// Scales the columns to a norm of 1, so that constants of different sizes do not count as nearly dependent; returns what the
/// norms were.
fn scale(jacobian: &mut DMatrix<f64>) -> Vec<f64> {
    let normalised = |mut column: nalgebra::DVectorViewMut<'_, f64>| {
        let norm = column.norm();
        column /= norm;
        norm
    };
    jacobian.column_iter_mut().map(normalised).collect()
}

/// Whether every direction of the unknowns is determined.
fn determined(jacobian: &DMatrix<f64>, labels: &[String]) -> Result<(), IdentifyError> {
    let mut scaled = jacobian.clone();
    let norms = scale(&mut scaled);
    let silent: Vec<&str> =
        norms.iter().zip(labels).filter(|(n, _)| **n == 0.0).map(|(_, label)| label.as_str()).collect();
    if !silent.is_empty() {
        let why = "no number depends on it".to_owned();
        return Err(IdentifyError::Undetermined { constants: silent.join(", "), why });
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
            let ratio = NUMBER.show(strongest / s.max(1e-300));
            let why = format!("one combination of them is {ratio} times weaker than the rest");
            return Err(IdentifyError::Undetermined { constants: involved.join(", "), why });
        }
    }
    Ok(())
}
