//! Load, LVDT offset, string radius and rail friction, from how the gap shrinks with twist and what torque that takes.
//!
//! The shape of G(θ, F) alone cannot tell a heavier load from a thinner string: either makes the gap shrink less. Work
//! can. What the motor does over a way up and a way down, its own friction cancelling, lifts the load: τ dθ = F dG, with
//! no model in it. Gap, work and how well a scene knows its string are weighed by their errors in one Gauss–Newton fit
//! of load, twist scale and offset, one step of it each tick. Friction is half of what up and down differ by.

use crate::RigConstants;
use crate::mechanism::{Mechanism, TWIST_SCALE};
use rig_link::messages::HomingFailure;
use tsa_table::{Point, Table};

/// Bins over the sweep.
const BINS: usize = 32;
/// Bins at each end that are left out: the motor changes speed there, and the load sticks until the strings have taken
/// up friction the other way round.
const END_BINS: usize = 4;
/// Gauss–Newton steps.
const STEPS: u8 = 6;

/// Rms misfit (m) beyond which this is not the table's mechanism.
const LARGEST_MISFIT_M: f32 = 0.2e-3;
/// Errors that the fit weighs by: of the modelled gap in a bin (m), of the string's twist scale, of the mean current (A)
/// and of the motor's torque constant and gear together.
const GAP_ERROR_M: f32 = 20e-6;
const SCALE_ERROR: f32 = 0.015;
const CURRENT_ERROR_A: f32 = 20e-6;
const TORQUE_ERROR: f32 = 0.03;

#[derive(Clone, Copy, Debug)]
struct Bin {
    twist_sum: f32,
    gap_sum: f32,
    current_sum: f32,
    count: u16,
}

/// A bin's means over both directions, each counting the same so that friction cancels, and half the differences up
/// less down.
#[derive(Clone, Copy, Debug)]
struct Pair {
    twist_rad: f32,
    gap_m: f32,
    current_a: f32,
    half_twist_rad: f32,
    half_gap_m: f32,
}

/// Sums of one Gauss–Newton step over the bins: residual r, sensitivity to load d and to scale e.
#[derive(Clone, Copy, Debug)]
struct Sums {
    n: f32,
    r: f32,
    d: f32,
    e: f32,
    dd: f32,
    de: f32,
    ee: f32,
    dr: f32,
    er: f32,
    rr: f32,
    /// Half differences of the gap, projected on d.
    friction: f32,
}

/// Result of a weighing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Weighed {
    pub load_n: f32,
    pub offset_m: f32,
    pub twist_scale: f32,
    pub friction_n: f32,
}

impl Bin {
    const EMPTY: Self = Self { twist_sum: 0.0, gap_sum: 0.0, current_sum: 0.0, count: 0 };
}

impl Sums {
    const ZERO: Self =
        Self { n: 0.0, r: 0.0, d: 0.0, e: 0.0, dd: 0.0, de: 0.0, ee: 0.0, dr: 0.0, er: 0.0, rr: 0.0, friction: 0.0 };
}

/// The load by the work that the motor did (N), and the error of that.
#[derive(Clone, Copy, Debug)]
struct ByWork {
    load_n: f32,
    error_n: f32,
}

/// The weighing.
#[derive(Clone, Debug)]
pub(super) struct Weigh {
    bins: [[Bin; BINS]; 2],
    pass: usize,
    result: Weighed,
    by_work: Option<ByWork>,
    /// Scale of the twist that is expected: the table's, or that of these strings before.
    expected_scale: f32,
    steps: u8,
}

impl Weigh {
    /// Before the first sweep, expecting a scale of the twist.
    pub(super) const fn new(expected_scale: f32) -> Self {
        Self {
            bins: [[Bin::EMPTY; BINS]; 2],
            pass: 0,
            result: Weighed { load_n: 0.0, offset_m: 0.0, twist_scale: expected_scale, friction_n: 0.0 },
            by_work: None,
            expected_scale,
            steps: 0,
        }
    }

    pub(super) fn pass(&self) -> usize {
        self.pass
    }

    /// `share` of the sweep travelled, 0 to 1; the current is positive towards more twist.
    pub(super) fn record(&mut self, share: f32, twist_rad: f32, gap_m: f32, current_a: f32) {
        if let (true, Some(bins)) = ((0.0..=1.0).contains(&share), self.bins.get_mut(self.pass)) {
            let bin = &mut bins[((share * BINS as f32) as usize).min(BINS - 1)];
            bin.twist_sum += twist_rad;
            bin.gap_sum += gap_m;
            bin.current_sum += current_a;
            bin.count = bin.count.saturating_add(1);
        }
    }

    /// Ends a sweep; true after the second.
    pub(super) fn end_pass(&mut self) -> bool {
        self.pass += 1;
        self.pass >= 2
    }

    /// Begins at the load by the work, else at the (geometric) middle of the table's range.
    pub(super) fn begin_fit(&mut self, table: &Table<'_>, rig: &RigConstants) {
        let m = &table.metadata;
        self.by_work = self.work(rig);
        let middle_n = libm::sqrtf(m.load_min_n * m.load_max_n);
        self.result.load_n = self.by_work.map_or(middle_n, |w| w.load_n).clamp(m.load_min_n, m.load_max_n);
    }

    fn pair(&self, i: usize) -> Option<Pair> {
        let [up, down] = [&self.bins[0][i], &self.bins[1][i]];
        if up.count == 0 || down.count == 0 {
            return None;
        }
        let (n_up, n_down) = (f32::from(up.count), f32::from(down.count));
        let half = |sum: fn(&Bin) -> f32, sign: f32| 0.5 * (sum(up) / n_up + sign * sum(down) / n_down);
        Some(Pair {
            twist_rad: half(|b| b.twist_sum, 1.0),
            gap_m: half(|b| b.gap_sum, 1.0),
            current_a: half(|b| b.current_sum, 1.0),
            half_twist_rad: half(|b| b.twist_sum, -1.0),
            half_gap_m: half(|b| b.gap_sum, -1.0),
        })
    }

    /// F = I k gear Δθ/ΔG over the part of the sweep at constant speed.
    fn work(&self, rig: &RigConstants) -> Option<ByWork> {
        let range = END_BINS..BINS - END_BINS;
        let (first, last) = (self.pair(range.start)?, self.pair(range.end - 1)?);
        let (mut sum, mut count) = (0.0, 0.0);
        for pair in range.filter_map(|i| self.pair(i)) {
            sum += pair.current_a;
            count += 1.0;
        }
        let newton_per_ampere =
            rig.motor_torque_constant_nm_per_a * rig.gear_ratio * (last.twist_rad - first.twist_rad)
                / (first.gap_m - last.gap_m);
        let load_n = sum / count * newton_per_ampere;
        let error_n = libm::hypotf(CURRENT_ERROR_A * newton_per_ampere, TORQUE_ERROR * load_n);
        // A gap that does not shrink is for the fit to refuse.
        (load_n > 0.0 && error_n.is_finite() && newton_per_ampere > 0.0).then_some(ByWork { load_n, error_n })
    }

    /// One Gauss–Newton step, two lookups for each bin; the result when all steps are done.
    ///
    /// # Errors
    /// [`HomingFailure::PoorFit`] or [`HomingFailure::LoadOutOfRange`].
    pub(super) fn fit_step(&mut self, table: &Table<'_>) -> Result<Option<Weighed>, HomingFailure> {
        if self.steps < STEPS {
            self.steps += 1;
            let sums = self.sums(&Mechanism { table, twist_scale: self.result.twist_scale });
            self.gauss_newton(table, &sums)?;
        }
        Ok((self.steps == STEPS).then_some(self.result))
    }

    fn sums(&self, mechanism: &Mechanism<'_>) -> Sums {
        let Weighed { load_n, friction_n, .. } = self.result;
        let mut s = Sums::ZERO;
        for pair in (END_BINS..BINS - END_BINS).filter_map(|i| self.pair(i)) {
            // The way up pulls friction more than the load, the way down as much less. The gap is far from straight
            // in the load when that is light, so each is asked for by itself.
            let up = mechanism.at(load_n + friction_n, pair.twist_rad + pair.half_twist_rad);
            let down = below(mechanism, load_n - friction_n, pair.twist_rad - pair.half_twist_rad);
            let r = pair.gap_m - 0.5 * (up.gap_m + down.gap_m);
            let d = 0.5 * (up.dgap_dload_m_per_n + down.dgap_dload_m_per_n);
            let by_twist = 0.5 * (up.dgap_dtwist_m_per_rad + down.dgap_dtwist_m_per_rad);
            let e = by_twist * pair.twist_rad / mechanism.twist_scale;
            s.n += 1.0;
            s.r += r;
            s.d += d;
            s.e += e;
            s.dd += d * d;
            s.de += d * e;
            s.ee += e * e;
            s.dr += d * r;
            s.er += e * r;
            s.rr += r * r;
            s.friction += d * (pair.half_gap_m - 0.5 * (up.gap_m - down.gap_m));
        }
        s
    }

    fn gauss_newton(&mut self, table: &Table<'_>, s: &Sums) -> Result<(), HomingFailure> {
        let m = &table.metadata;
        let last = self.steps == STEPS;
        if s.n < 0.5 * (BINS - 2 * END_BINS) as f32 {
            return Err(HomingFailure::PoorFit);
        }
        let (mean_r, mean_d, mean_e) = (s.r / s.n, s.d / s.n, s.e / s.n);
        // The offset is free, so all is about the means.
        let (dd, de, ee) = (s.dd - s.n * mean_d * mean_d, s.de - s.n * mean_d * mean_e, s.ee - s.n * mean_e * mean_e);
        let (dr, er) = (s.dr - s.n * mean_d * mean_r, s.er - s.n * mean_e * mean_r);
        if last && libm::sqrtf((s.rr / s.n - mean_r * mean_r).max(0.0)) > LARGEST_MISFIT_M {
            return Err(HomingFailure::PoorFit);
        }
        let Weighed { load_n, twist_scale, .. } = self.result;
        let trust = GAP_ERROR_M * GAP_ERROR_M;
        let (mut work_weight, mut work_pull) = (0.0, 0.0);
        if let Some(work) = self.by_work {
            work_weight = trust / (work.error_n * work.error_n);
            work_pull = work_weight * (work.load_n - load_n);
        }
        let scale_weight = trust / (SCALE_ERROR * SCALE_ERROR);
        let (a, b, c) = (dd + work_weight, de, ee + scale_weight);
        let (x, y) = (dr + work_pull, er + scale_weight * (self.expected_scale - twist_scale));
        let determinant = a * c - b * b;
        let (load_step, scale_step) = ((c * x - b * y) / determinant, (a * y - b * x) / determinant);
        if !load_step.is_finite() || !scale_step.is_finite() {
            return Err(HomingFailure::PoorFit);
        }
        let wanted_n = load_n + load_step.clamp(-0.6 * load_n, 1.5 * load_n);
        if last && !(0.9 * m.load_min_n..=1.1 * m.load_max_n).contains(&wanted_n) {
            return Err(HomingFailure::LoadOutOfRange);
        }
        self.result.load_n = wanted_n.clamp(m.load_min_n, m.load_max_n);
        self.result.twist_scale = (twist_scale + scale_step.clamp(-0.05, 0.05)).clamp(TWIST_SCALE[0], TWIST_SCALE[1]);
        self.result.offset_m =
            mean_r - mean_d * (self.result.load_n - load_n) - mean_e * (self.result.twist_scale - twist_scale);
        let friction_n = self.result.friction_n + s.friction / s.dd.max(f32::MIN_POSITIVE);
        self.result.friction_n = friction_n.clamp(0.0, 0.4 * self.result.load_n);
        Ok(())
    }
}

/// As [`Mechanism::at`], continued below the table's least load in 1/F, as the strings' radius goes (model.md 2): the
/// lightest load less friction is there.
fn below(mechanism: &Mechanism<'_>, load_n: f32, twist_rad: f32) -> Point {
    let least_n = mechanism.table.metadata.load_min_n;
    let mut point = mechanism.at(load_n, twist_rad);
    if load_n < least_n {
        let share = least_n / load_n;
        point.gap_m += point.dgap_dload_m_per_n * least_n * (1.0 - share);
        point.dgap_dload_m_per_n *= share * share;
    }
    point
}
