//! Load, string radius and the LVDT's zero, each with its error, from how the gap shrinks with twist.
//!
//! The gap's curve over the twist alone cannot tell a heavier load from a thinner string or from another zero of the
//! LVDT. So the fit has three sources, each weighted by its own error: the curve, by the residual that it leaves on this very
//! rig and by what the scene's mechanism may miss; what the scene says of string radius and LVDT, by the scene's uncertainty;
//! and the operator's weight, if one was given.
//! The motor's current is no source: on emulated plants of every kind the estimate is as good without it. Two errors that no
//! rig is without are unknowns of the fit, or they would be taken for another load: a slope of the LVDT, and a radius that grows
//! faster or slower with the twist than the table's. Friction is half of what the ways up and down differ by. One Gauss–Newton
//! step is taken in each tick. The inverse of the last step's matrix is the covariance of the result.

use super::sweeps::{Bin, Sweeps};
use crate::RigConstants;
use crate::hysteresis::{MEMORY_ERROR, RodMemory};
use crate::least_squares::Cholesky;
use crate::mechanism::{Mechanism, bounded_scale};
use crate::sensors::LVDT_COUNT_M;
use rig_link::gap_curve::{GapCurve, TERMS};
use rig_link::messages::{HomingFailure, LoadChoice};
use tsa_table::{Point, Table, Uncertainty};

/// Bins over the sweep.
pub const BINS: usize = 32;
/// Bins at each end that are left out: the motor changes speed there, and the load sticks until the strings have taken
/// up friction the other way round.
pub const END_BINS: usize = 4;
/// Gauss–Newton steps.
pub const STEPS: u8 = 10;
/// Minimum error of a bin's gap and minimum noise of the gap in one tick (m): a tenth of the converter's code, which averaging
/// over a moving load resolves.
pub const MIN_GAP_ERROR_M: f32 = 0.1 * LVDT_COUNT_M;
/// Residual (m, rms) that a rig of the scene's kind may leave: the radius laws of docs/explanation/model.md 6 differ by less.
pub const LAW_GAP_ERROR_M: f32 = 0.2e-3;
/// Maximum sum of squares of what the fit finds, each as a multiple of its standard error by the scene; under a given load the square
/// of what that load is off by. Beyond it, the rig contradicts its scene or that weight, and the load is unknown. Of a hundred nominal
/// rigs whose radius and LVDT are off as the scene says, one is beyond it.
const MAX_SURPRISE: f32 = 7.0;
/// Standard error of a weight that the operator gives, as a fraction of it.
const GIVEN_ERROR: f32 = 0.005;
/// Maximum change in a step of the logarithm of the load, and of that of the scale.
const LARGEST_STEP: [f32; 2] = [0.7, 0.05];
/// Millimetres in a metre: the fit counts gaps in millimetres, so that its matrix is well scaled in f32.
const MM: f32 = 1e3;

/// A bin's means over both directions, each counting the same so that friction cancels, and half the differences up
/// less down.
#[derive(Clone, Copy, Debug)]
struct Pair {
    twist_rad: f32,
    gap_m: f32,
    half_twist_rad: f32,
    half_gap_m: f32,
}

/// Unknowns of the fit. Their order in its matrix: logarithm of the load, logarithm of the scale, offset (mm), error of the
/// LVDT's slope, growth of the radius.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Unknowns {
    load_n: f32,
    twist_scale: f32,
    /// Measured less modelled gap (m).
    offset_m: f32,
    /// By how much the LVDT shows a change of the gap too large, as a fraction of it.
    slope: f32,
    /// Exponent of the twist by which the radius grows faster than the table's.
    growth: f32,
}

/// Number of unknowns.
pub const UNKNOWNS: usize = 5;

/// Result of a weighing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Weighed {
    /// The load that fits the table's mechanism best (N), and the one that hangs on rods that remember a heavier one.
    pub apparent_n: f32,
    pub load_n: f32,
    /// The load fits best beyond the table's range, at whose end `apparent_n` stands.
    pub beyond_range: bool,
    /// Standard error of the load (N).
    pub load_sigma_n: f32,
    pub twist_scale: f32,
    pub friction_n: f32,
    pub curve: GapCurve,
    /// As in the homing's result ([`rig_link::messages::HomingResult`]).
    pub covariance: [f32; 6],
}

/// The weighing.
#[derive(Clone, Debug)]
pub(super) struct LoadEstimate {
    pub(super) sweeps: Sweeps<BINS>,
    unknowns: Unknowns,
    friction_n: f32,
    given: LoadChoice,
    /// Heaviest load that the rods remember (N); 0 under a given load, where the scale takes up what they do.
    pub(super) heaviest_n: f32,
    /// Mean gap of the sweep (m), and the standard errors of the LVDT's zero (m) and slope.
    middle_m: f32,
    zero_error_m: f32,
    slope_error: f32,
    /// By how much the scene's mechanism may miss the gaps of this sweep (m, rms).
    law_error_m: f32,
    /// Scale of the twist that is expected: the table's, or that of these strings before.
    expected_scale: f32,
    steps: u8,
}

impl LoadEstimate {
    /// Before the first sweep, expecting a scale of the twist, and the weight that the operator gives; with rods that
    /// remember a load (N).
    pub(super) fn new(expected_scale: f32, given: LoadChoice, heaviest_n: f32) -> Self {
        Self {
            sweeps: Sweeps::NEW,
            unknowns: Unknowns { load_n: 0.0, twist_scale: expected_scale, offset_m: 0.0, slope: 0.0, growth: 0.0 },
            middle_m: 0.0,
            zero_error_m: 0.0,
            slope_error: 0.0,
            law_error_m: 0.0,
            friction_n: 0.0,
            given,
            heaviest_n: if given == LoadChoice::Auto { heaviest_n } else { 0.0 },
            expected_scale,
            steps: 0,
        }
    }

    /// Begins in the (geometric) middle of the table's range.
    pub(super) fn begin_fit(&mut self, table: &Table<'_>, rig: &RigConstants) {
        let m = &table.metadata;
        self.zero_error_m = libm::hypotf(m.uncertainty.gap_zero_m, rig.lvdt_reading_error_m());
        // A weight of the fit: that of a sensor without an error would be infinite.
        self.slope_error = rig.lvdt_slope_error().max(1e-6);
        let (sum_m, count) = self.pairs().fold((0.0, 0.0f32), |(sum_m, count), pair| (sum_m + pair.gap_m, count + 1.0));
        self.middle_m = sum_m / count.max(1.0);
        let middle_n = libm::sqrtf(m.load_min_n * m.load_max_n);
        self.law_error_m = self.missed_by_law_m(table, middle_n);
        self.unknowns.load_n = match self.given {
            LoadChoice::Known(given_n) => given_n.clamp(m.load_min_n, m.load_max_n),
            LoadChoice::Auto => middle_n,
        };
    }

    /// By how much the mechanism may miss the gaps of the sweep (m, rms): by how much a load (N) that is wrong by `load_shape`
    /// changes them, about the mean of that change. It is nearly linear over the sweep; its rms is then 1/√12 of the difference
    /// between the ends.
    fn missed_by_law_m(&self, table: &Table<'_>, load_n: f32) -> f32 {
        let mechanism = self.mechanism(*table);
        let by_load_m = |pair: Option<Pair>| {
            pair.map_or(0.0, |pair| load_n * mechanism.at(load_n, pair.twist_rad).dgap_dload_m_per_n)
        };
        let [first_m, last_m] = [self.pairs().next(), self.pairs().last()].map(by_load_m);
        table.metadata.uncertainty.load_shape * (last_m - first_m).abs() / libm::sqrtf(12.0)
    }

    fn pair(&self, i: usize) -> Option<Pair> {
        let [up, down] = [&self.sweeps.bins[0][i], &self.sweeps.bins[1][i]];
        if up.count == 0 || down.count == 0 {
            return None;
        }
        let (n_up, n_down) = (f32::from(up.count), f32::from(down.count));
        let half = |sum: fn(&Bin) -> f32, sign: f32| 0.5 * (sum(up) / n_up + sign * sum(down) / n_down);
        Some(Pair {
            twist_rad: half(|b| b.angle_sum, 1.0),
            gap_m: half(|b| b.gap_sum, 1.0),
            half_twist_rad: half(|b| b.angle_sum, -1.0),
            half_gap_m: half(|b| b.gap_sum, -1.0),
        })
    }

    fn pairs(&self) -> impl Iterator<Item = Pair> + '_ {
        (END_BINS..BINS - END_BINS).filter_map(|i| self.pair(i))
    }

    /// One Gauss–Newton step, two lookups for each bin; the result when all steps are done.
    ///
    /// # Errors
    /// [`HomingFailure::PoorFit`] or [`HomingFailure::LoadOutOfRange`].
    pub(super) fn fit_step(&mut self, table: &Table<'_>) -> Result<Option<Weighed>, HomingFailure> {
        self.steps = (self.steps + 1).min(STEPS);
        let m = &table.metadata;
        let uncertainty = &m.uncertainty;
        let Unknowns { load_n, twist_scale, offset_m, slope, growth } = self.unknowns;
        // Sums over the bins: residual r (mm), and its derivatives by the unknowns.
        let mut n = 0.0;
        let mut squares = 0.0;
        let mut matrix = [[0.0f32; UNKNOWNS]; UNKNOWNS];
        let mut right = [0.0f32; UNKNOWNS];
        let (mut half_sum, mut half_squares) = (0.0f32, 0.0f32);
        let mechanism = self.mechanism(*table);
        for pair in self.pairs() {
            let [up, down] = self.modelled(&mechanism, &pair);
            let beside = MM * (pair.gap_m - 0.5 * (up.gap_m + down.gap_m));
            let by_load = 0.5 * (up.dgap_dload_m_per_n + down.dgap_dload_m_per_n);
            let by_twist = 0.5 * (up.dgap_dtwist_m_per_rad + down.dgap_dtwist_m_per_rad);
            let by_scale = MM * by_twist * pair.twist_rad;
            let by_growth = by_scale * libm::logf(pair.twist_rad / core::f32::consts::PI);
            let j = [MM * load_n * by_load, by_scale, 1.0, MM * (pair.gap_m - self.middle_m), by_growth];
            let r = beside - slope * j[3] - growth * j[4];
            n += 1.0;
            squares += r * r;
            for a in 0..UNKNOWNS {
                right[a] += j[a] * r;
                for b in 0..=a {
                    matrix[a][b] += j[a] * j[b];
                }
            }
            half_sum += by_load * (pair.half_gap_m - 0.5 * (up.gap_m - down.gap_m));
            half_squares += by_load * by_load;
        }
        if n < 0.5 * (BINS - 2 * END_BINS) as f32 {
            return Err(HomingFailure::PoorFit);
        }
        let scale_by_growth = matrix[4][1] / matrix[1][1].max(f32::MIN_POSITIVE);
        let residual_mm = libm::sqrtf(squares / n);
        let gap_error_mm = libm::hypotf(residual_mm, MM * self.law_error_m).max(MM * MIN_GAP_ERROR_M);
        let weight = 1.0 / (gap_error_mm * gap_error_mm);
        right.iter_mut().chain(matrix.iter_mut().flatten()).for_each(|x| *x *= weight);
        let mut add = |unknown: usize, by: f32, missing: f32, sigma: f32| {
            let information = by / (sigma * sigma);
            matrix[unknown][unknown] += information * by;
            right[unknown] += information * missing;
        };
        add(1, 1.0, (self.expected_scale - twist_scale) / twist_scale, uncertainty.twist_scale);
        add(2, 1.0, -MM * offset_m, MM * self.zero_error_m);
        add(3, 1.0, -slope, self.slope_error);
        add(4, 1.0, -growth, uncertainty.twist_scale);
        if let LoadChoice::Known(given_n) = self.given {
            add(0, load_n, given_n - load_n, GIVEN_ERROR * given_n);
        }
        let decomposed = Cholesky::new(matrix).ok_or(HomingFailure::PoorFit)?;
        let step = decomposed.solve(right);
        if !step.iter().all(|x| x.is_finite()) {
            return Err(HomingFailure::PoorFit);
        }
        // The table ends at its minimum and maximum load; the step tells how far beyond them the load is.
        let wanted_n = load_n * libm::expf(step[0].clamp(-LARGEST_STEP[0], LARGEST_STEP[0]));
        if self.steps == STEPS {
            let covariance = decomposed.inverse();
            return self.result(table, wanted_n, &covariance, scale_by_growth, 1e-3 * residual_mm).map(Some);
        }
        let scale_step = step[1].clamp(-LARGEST_STEP[1], LARGEST_STEP[1]);
        self.unknowns = Unknowns {
            load_n: wanted_n.clamp(m.load_min_n, m.load_max_n),
            twist_scale: bounded_scale(twist_scale * (1.0 + scale_step)),
            offset_m: offset_m + 1e-3 * step[2],
            slope: slope + step[3],
            growth: growth + step[4],
        };
        let friction_n = self.friction_n + half_sum / half_squares.max(f32::MIN_POSITIVE);
        self.friction_n = friction_n.clamp(0.0, 0.4 * self.unknowns.load_n);
        Ok(None)
    }

    /// The table with the present scale, and its zero where the present offset is.
    fn mechanism<'t>(&self, table: Table<'t>) -> Mechanism<'t> {
        let Unknowns { twist_scale, offset_m, .. } = self.unknowns;
        Mechanism { table, twist_scale, curve: GapCurve::constant(offset_m) }
    }

    /// The points of a mechanism at which the gaps of a pair were measured, up and down.
    ///
    /// The way up pulls friction more than the load, the way down as much less. The gap is far from straight in the load when
    /// that is light, so each is asked for by itself.
    fn modelled(&self, mechanism: &Mechanism<'_>, pair: &Pair) -> [Point; 2] {
        let Unknowns { load_n, .. } = self.unknowns;
        [
            mechanism.at(load_n + self.friction_n, pair.twist_rad + pair.half_twist_rad),
            below(mechanism, load_n - self.friction_n, pair.twist_rad - pair.half_twist_rad),
        ]
    }

    /// By how much a given load (N) differs from the load that the sweeps show without it: the square of the difference of their
    /// logarithms over its variance. The given load is a reading with an information a. The fit with it differs from it by ε, and its
    /// load has the variance C. Without it the variance would be C' = C/(1 − a C), and the difference ε (1 + a C').
    fn contradiction(&self, given_n: f32, variance: f32, uncertainty: &Uncertainty) -> f32 {
        let off = self.unknowns.load_n / given_n - 1.0;
        let weight = self.unknowns.load_n / (GIVEN_ERROR * given_n);
        let information = weight * weight;
        let without = variance / (1.0 - information * variance).max(f32::EPSILON);
        let off = off * (1.0 + information * without);
        // The radius law and what the rods remember are no unknowns of the fit.
        let [law, memory] = [uncertainty.load_shape, uncertainty.rod_memory];
        off * off / (without + law * law + memory * memory)
    }

    /// What the last step says: with the covariance of the unknowns, by how much the logarithm of the scale must change to make
    /// good, over the sweep, for a growth that is left out, and the rms gap that the fit leaves (m).
    fn result(
        &self,
        table: &Table<'_>,
        wanted_n: f32,
        covariance: &[[f32; UNKNOWNS]; UNKNOWNS],
        scale_by_growth: f32,
        residual_m: f32,
    ) -> Result<Weighed, HomingFailure> {
        let m = &table.metadata;
        let uncertainty = &m.uncertainty;
        let Unknowns { load_n, twist_scale, offset_m, slope, growth } = self.unknowns;
        let beyond_range = !(m.load_min_n..=m.load_max_n).contains(&wanted_n);
        // Ten times what the laws that fit the paper's numbers differ by: neither strings nor LVDT are of the scene's kind.
        if residual_m > 10.0 * LAW_GAP_ERROR_M {
            return Err(if beyond_range { HomingFailure::LoadOutOfRange } else { HomingFailure::PoorFit });
        }
        let surprise = match self.given {
            // How far radius, LVDT and residual are from what the scene says.
            LoadChoice::Auto => [
                (twist_scale - self.expected_scale) / (uncertainty.twist_scale * self.expected_scale),
                offset_m / self.zero_error_m,
                slope / self.slope_error,
                growth / uncertainty.twist_scale,
                residual_m / LAW_GAP_ERROR_M,
            ]
            .iter()
            .map(|x| x * x)
            .sum::<f32>(),
            LoadChoice::Known(given_n) => self.contradiction(given_n, covariance[0][0], uncertainty),
        };
        // The scale takes up an error of the radius, but neither an error of how the radius depends on the load nor what the
        // rods remember; under a given load it takes up both.
        let shape = if self.given == LoadChoice::Auto { uncertainty.load_shape } else { 0.0 };
        let memory = RodMemory { light: uncertainty.rod_memory, heaviest_n: self.heaviest_n };
        let apparent_n = load_n;
        let load_n = memory.load_n(apparent_n);
        let by_memory = MEMORY_ERROR * memory.excess(load_n);
        let variance = shape * shape + by_memory * by_memory;
        let load_sigma_n = load_n * libm::sqrtf(covariance[0][0] + variance);
        // Surely outside, whatever the error is.
        let margin_n = super::NINETY_PERCENT * load_sigma_n;
        if wanted_n + margin_n < 0.9 * m.load_min_n || wanted_n - margin_n > 1.1 * m.load_max_n {
            return Err(HomingFailure::LoadOutOfRange);
        }
        let unknown = surprise > MAX_SURPRISE;
        // After homing there is one scale: that which does over the sweep what scale and growth do together.
        let twist_scale = bounded_scale(twist_scale * (1.0 + scale_by_growth * growth));
        let mechanism = Mechanism { table: *table, twist_scale, curve: GapCurve::constant(offset_m) };
        let rest: heapless::Vec<(f32, f32), BINS> = self
            .pairs()
            .map(|pair| {
                let [up, down] = self.modelled(&mechanism, &pair);
                (pair.twist_rad, pair.gap_m - 0.5 * (up.gap_m + down.gap_m))
            })
            .collect();
        // Of that scale with each unknown of the fit, and with itself.
        let of_scale = |unknown: usize| covariance[unknown][1] + scale_by_growth * covariance[4][unknown];
        let scale = of_scale(1) + scale_by_growth * of_scale(4);
        // The fit counts the slope from the middle of the gaps, and gaps in millimetres.
        let middle_m = self.middle_m;
        let [constant, constant_slope, slope] = [1e-6 * covariance[2][2], 1e-3 * covariance[3][2], covariance[3][3]];
        Ok(Weighed {
            apparent_n,
            load_n,
            beyond_range,
            load_sigma_n: if unknown { load_n } else { load_sigma_n },
            twist_scale,
            friction_n: self.friction_n,
            curve: curve(&rest, offset_m).ok_or(HomingFailure::PoorFit)?,
            covariance: [
                scale,
                1e-3 * of_scale(2) - middle_m * of_scale(3),
                constant - middle_m * (2.0 * constant_slope - middle_m * slope),
                of_scale(3),
                constant_slope - middle_m * slope,
                slope,
            ],
        })
    }
}

/// The curve through what the fit leaves at each twist (rad, m), on top of its offset (m).
fn curve(rest: &[(f32, f32)], offset_m: f32) -> Option<GapCurve> {
    let (first_rad, last_rad) = (rest.first()?.0, rest.last()?.0);
    let (middle_rad, half_rad) = (0.5 * (first_rad + last_rad), 0.5 * (last_rad - first_rad));
    if half_rad <= 0.0 {
        return None;
    }
    let (mut matrix, mut right) = ([[0.0f32; TERMS]; TERMS], [0.0f32; TERMS]);
    for (twist_rad, left_m) in rest {
        let place = (twist_rad - middle_rad) / half_rad;
        let powers = [1.0, place, place * place, place * place * place];
        for a in 0..TERMS {
            right[a] += powers[a] * left_m;
            for b in 0..=a {
                matrix[a][b] += powers[a] * powers[b];
            }
        }
    }
    let mut coefficients_m = Cholesky::new(matrix)?.solve(right);
    coefficients_m[0] += offset_m;
    Some(GapCurve { middle_rad, half_rad, coefficients_m })
}

/// As [`Mechanism::at`], continued below the table's least load in 1/F, as the strings' radius goes
/// (docs/explanation/model.md 2): the lightest load less friction is there.
fn below(mechanism: &Mechanism<'_>, load_n: f32, twist_rad: f32) -> Point {
    let min_n = mechanism.table.metadata.load_min_n;
    let mut point = mechanism.at(load_n.max(min_n), twist_rad);
    if load_n < min_n {
        let fraction = min_n / load_n.max(0.1 * min_n);
        point.gap_m += point.dgap_dload_m_per_n * min_n * (1.0 - fraction);
        point.dgap_dload_m_per_n *= fraction * fraction;
    }
    point
}

#[cfg(test)]
pub(crate) mod tests;
