//! Statistics of errors: their size, and how much residuals tell. Those of neighbouring rows are alike, because what a law or a
//! sensor leaves is smooth.

use serde::Serialize;

/// Errors over some rows.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Errors {
    /// Rows.
    pub count: usize,
    /// Root mean square.
    pub rms: f64,
    /// Median of the absolute values.
    pub median: f64,
    /// Maximum absolute value.
    pub worst: f64,
}

impl Errors {
    /// Of these errors.
    pub fn over(errors: impl IntoIterator<Item = f64>) -> Self {
        let mut all: Vec<f64> = errors.into_iter().map(f64::abs).collect();
        all.sort_by(f64::total_cmp);
        let Some(&worst) = all.last() else { return Self::default() };
        let rms = (all.iter().map(|e| e * e).sum::<f64>() / all.len() as f64).sqrt();
        Self { count: all.len(), rms, median: median(&mut all), worst }
    }
}

/// Root mean square; 0 of none.
pub fn rms<'a>(errors: impl IntoIterator<Item = &'a f64>) -> f64 {
    Errors::over(errors.into_iter().copied()).rms
}

/// Mean; not a number of none.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Median, of an even number the mean of the two in the middle; 0 of none.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let count = values.len();
    if count == 0 { 0.0 } else { 0.5 * (values[(count - 1) / 2] + values[count / 2]) }
}

/// What a fit leaves, in standard deviations of its rows.
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    /// How many of the residuals count as independent.
    pub effective: f64,
    /// By what the variance of each row has to be multiplied, for as many rows as there are, to count for no more than the
    /// effective number of independent ones with the size of these residuals.
    pub inflation: f64,
    /// Degrees of freedom: the effective number less the unknowns that the data had to tell.
    pub freedom: f64,
}

impl Noise {
    /// Of the residuals of rows, in standard deviations, run by run in order of twist; `told` unknowns were fitted to them.
    pub fn of(runs: &[Vec<f64>], told: f64) -> Self {
        let count: usize = runs.iter().map(Vec::len).sum();
        let squares: f64 = runs.iter().flatten().map(|r| r * r).sum();
        let effective = effective(runs);
        // Correlated residuals can be so few that nothing would be left: one degree always is.
        let freedom = (effective - told).max(1.0);
        let inflation = squares / count.max(1) as f64 * count as f64 / freedom;
        Self { effective, inflation, freedom }
    }
}

/// The effective number of independent values in runs of neighbours: their number over the sum of their autocorrelation,
/// which is taken up to where it first falls below zero (beyond that it is that of the estimate). Bartlett, "On the
/// theoretical specification and sampling properties of autocorrelated time-series" (1946).
pub fn effective(runs: &[Vec<f64>]) -> f64 {
    let count: usize = runs.iter().map(Vec::len).sum();
    let squares: f64 = runs.iter().flatten().map(|r| r * r).sum();
    if count == 0 || squares <= 0.0 {
        return count as f64;
    }
    let longest = runs.iter().map(Vec::len).max().unwrap_or(0);
    let mut sum = 1.0;
    for lag in 1..longest {
        let products: f64 = runs.iter().flat_map(|run| run.iter().zip(run.iter().skip(lag))).map(|(a, b)| a * b).sum();
        if products <= 0.0 {
            break;
        }
        sum += 2.0 * products / squares;
    }
    (count as f64 / sum).max(1.0)
}

/// Factor from a standard error to half the width of the interval that holds the truth nine times in ten: the 95 % point
/// of Student's distribution, by its expansion in the inverse degrees of freedom (Abramowitz and Stegun 26.7.5).
pub fn half_width_factor(freedom: f64) -> f64 {
    let z: f64 = 1.644_854;
    let nu = freedom.max(1.0);
    let first = (z.powi(3) + z) / 4.0;
    let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
    let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
    z + first / nu + second / nu.powi(2) + third / nu.powi(3)
}

/// Half the width of the interval that holds the truth nine times in ten, from two variances: one that was estimated with
/// so many degrees of freedom, and one that is known beforehand. Together they have more degrees of freedom than the first
/// alone (Satterthwaite, "An approximate distribution of estimates of variance components", 1946).
pub fn half_width(estimated: f64, known: f64, freedom: f64) -> f64 {
    let total = estimated + known;
    let freedom = if estimated > 0.0 { freedom.max(1.0) * (total / estimated).powi(2) } else { f64::INFINITY };
    half_width_factor(freedom) * total.max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    /// An autoregressive run of variance one, with a correlation `a` from each value to the next.
    fn run(a: f64, count: usize, seed: u64) -> Vec<f64> {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        // A uniform number of variance one.
        let mut white = move || (random.next_u32() as f64 / f64::from(u32::MAX) - 0.5) * 12f64.sqrt();
        let mut value = white();
        let mut next = || {
            value = a * value + (1.0 - a * a).sqrt() * white();
            value
        };
        (0..count).map(|_| next()).collect()
    }

    #[test]
    fn independent_values_count_fully_and_correlated_ones_by_their_autocorrelation() {
        let white = effective(&[run(0.0, 2000, 1), run(0.0, 2000, 2)]);
        assert!((3000.0..=4000.0).contains(&white), "{white}");
        // Of an autoregressive run the number is n (1 - a)/(1 + a).
        let alike = effective(&[run(0.8, 2000, 3), run(0.8, 2000, 4)]);
        assert!((300.0..600.0).contains(&alike), "{alike}");
        assert_eq!(effective(&[vec![1.0; 50]]).round(), 1.0, "one value fifty times");
        let runs = [run(0.8, 2000, 5)];
        let noise = Noise::of(&runs, 4.0);
        let squares: f64 = runs[0].iter().map(|r| r * r).sum();
        assert!((noise.inflation * noise.freedom / squares - 1.0).abs() < 1e-12);
        assert!((noise.freedom - noise.effective + 4.0).abs() < 1e-12);
    }

    #[test]
    fn half_widths_are_those_of_students_distribution_by_the_degrees_of_freedom() {
        for (freedom, tabled) in [(5.0, 2.015), (10.0, 1.812), (30.0, 1.697), (1e9, 1.645)] {
            assert!((half_width_factor(freedom) - tabled).abs() < 2e-3, "{freedom}: {}", half_width_factor(freedom));
        }
        // What is known beforehand does not widen by the fewness of the residuals; halves of one variance have four times the
        // degrees of freedom.
        for (estimated, known, wanted) in
            [(4.0, 0.0, half_width_factor(5.0)), (0.0, 4.0, 1.644_854), (2.0, 2.0, half_width_factor(20.0))]
        {
            assert!((half_width(estimated, known, 5.0) - 2.0 * wanted).abs() < 1e-12);
        }
    }
}
