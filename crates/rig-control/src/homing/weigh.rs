//! The load and the LVDT's offset, from how the gap shrinks with twist: G(θ, F) + offset, both unknown, fitted by
//! Gauss–Newton to a sweep up and a sweep down, a few table lookups each tick.

use rig_link::messages::HomingFailure;
use tsa_table::Table;

/// Bins over the sweep.
const BINS: usize = 32;
/// Table lookups in one tick.
const LOOKUPS_PER_TICK: usize = 3;
/// Gauss–Newton steps.
const STEPS: u8 = 8;

/// Rms misfit (m) beyond which what was weighed is not this mechanism.
const LARGEST_MISFIT_M: f32 = 0.2e-3;

#[derive(Clone, Copy, Debug, Default)]
struct Bin {
    twist_sum: f32,
    gap_sum: f32,
    count: u16,
}

/// Sums of one Gauss–Newton step over the bins seen so far: residual r and sensitivity d = ∂G/∂F.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: f32,
    r: f32,
    d: f32,
    dd: f32,
    dr: f32,
    rr: f32,
}

/// The weighing.
#[derive(Clone, Debug)]
pub(super) struct Weigh {
    bins: [[Bin; BINS]; 2],
    pass: usize,
    load_n: f32,
    offset_m: f32,
    steps: u8,
    at: usize,
    sums: Sums,
}

impl Weigh {
    pub(super) fn new() -> Self {
        Self {
            bins: [[Bin::default(); BINS]; 2],
            pass: 0,
            load_n: 0.0,
            offset_m: 0.0,
            steps: 0,
            at: 0,
            sums: Sums::default(),
        }
    }

    pub(super) fn pass(&self) -> usize {
        self.pass
    }

    /// `share` of the sweep travelled, 0 to 1.
    pub(super) fn record(&mut self, share: f32, twist_rad: f32, gap_m: f32) {
        if let (true, Some(bins)) = ((0.0..=1.0).contains(&share), self.bins.get_mut(self.pass)) {
            let bin = &mut bins[((share * BINS as f32) as usize).min(BINS - 1)];
            bin.twist_sum += twist_rad;
            bin.gap_sum += gap_m;
            bin.count = bin.count.saturating_add(1);
        }
    }

    /// Ends a sweep; true after the second.
    pub(super) fn end_pass(&mut self) -> bool {
        self.pass += 1;
        self.pass >= 2
    }

    /// Begins at the middle of the table's range (geometrically): Gauss–Newton takes it from anywhere.
    pub(super) fn begin_fit(&mut self, table: &Table<'_>) {
        let m = &table.metadata;
        self.load_n = libm::sqrtf(m.load_min_n * m.load_max_n);
        self.steps = 0;
        self.at = 0;
        self.sums = Sums::default();
    }

    /// A bin's mean over both directions: twist and gap, each direction counting the same so that friction cancels.
    fn mean(&self, i: usize) -> Option<(f32, f32)> {
        let [up, down] = [&self.bins[0][i], &self.bins[1][i]];
        if up.count == 0 || down.count == 0 {
            return None;
        }
        let half = |sum: fn(&Bin) -> f32| 0.5 * (sum(up) / f32::from(up.count) + sum(down) / f32::from(down.count));
        Some((half(|b| b.twist_sum), half(|b| b.gap_sum)))
    }

    /// Works on; load (N) and offset (m) when finished.
    pub(super) fn fit_some(&mut self, table: &Table<'_>) -> Result<Option<(f32, f32)>, HomingFailure> {
        let m = &table.metadata;
        if self.steps >= STEPS {
            return Ok(Some((self.load_n, self.offset_m)));
        }
        for _ in 0..LOOKUPS_PER_TICK {
            if self.at < BINS {
                if let Some((twist, gap)) = self.mean(self.at) {
                    let p = table.point_inside(self.load_n, twist);
                    let (r, d) = (gap - p.gap_m, p.dgap_dload_m_per_n);
                    let s = &mut self.sums;
                    s.n += 1.0;
                    s.r += r;
                    s.d += d;
                    s.dd += d * d;
                    s.dr += d * r;
                    s.rr += r * r;
                }
                self.at += 1;
                continue;
            }
            let s = core::mem::take(&mut self.sums);
            self.at = 0;
            self.steps += 1;
            if s.n < 0.5 * BINS as f32 {
                return Err(HomingFailure::PoorFit);
            }
            let (mean_r, mean_d) = (s.r / s.n, s.d / s.n);
            let (var_d, cov) = (s.dd / s.n - mean_d * mean_d, s.dr / s.n - mean_d * mean_r);
            let step = cov / var_d.max(f32::MIN_POSITIVE);
            if !step.is_finite() {
                return Err(HomingFailure::PoorFit);
            }
            if self.steps == STEPS {
                let misfit = libm::sqrtf((s.rr / s.n - mean_r * mean_r).max(0.0));
                if misfit > LARGEST_MISFIT_M {
                    return Err(HomingFailure::PoorFit);
                }
            }
            let wanted = self.load_n + step.clamp(-0.6 * self.load_n, 1.5 * self.load_n);
            if self.steps == STEPS && !(0.9 * m.load_min_n..=1.1 * m.load_max_n).contains(&wanted) {
                return Err(HomingFailure::LoadOutOfRange);
            }
            let load_n = wanted.clamp(m.load_min_n, m.load_max_n);
            self.offset_m = mean_r - mean_d * (load_n - self.load_n);
            self.load_n = load_n;
            return Ok(None);
        }
        Ok(None)
    }
}
