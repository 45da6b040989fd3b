//! Two sweeps of the shaft in opposite directions, each with its readings in bins.

/// Sums over the readings in a bin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bin {
    pub angle_sum: f32,
    pub gap_sum: f32,
    pub count: u16,
}

/// The sweeps.
#[derive(Clone, Debug)]
pub(super) struct Sweeps<const BINS: usize> {
    pub bins: [[Bin; BINS]; 2],
    /// The present sweep: 0 or 1, and 2 after both.
    pub pass: usize,
}

impl<const BINS: usize> Sweeps<BINS> {
    /// Before the first sweep.
    pub(super) const NEW: Self = Self { bins: [[Bin { angle_sum: 0.0, gap_sum: 0.0, count: 0 }; BINS]; 2], pass: 0 };

    /// Adds a reading of the present sweep, with 0 to 1 of its range travelled. Readings outside the range are left out.
    pub(super) fn record(&mut self, fraction: f32, angle_rad: f32, gap_m: f32) {
        if let (true, Some(bins)) = ((0.0..=1.0).contains(&fraction), self.bins.get_mut(self.pass)) {
            let bin = &mut bins[((fraction * BINS as f32) as usize).min(BINS - 1)];
            bin.angle_sum += angle_rad;
            bin.gap_sum += gap_m;
            bin.count = bin.count.saturating_add(1);
        }
    }

    /// Ends a sweep; true after the second.
    pub(super) fn end_pass(&mut self) -> bool {
        self.pass += 1;
        self.pass >= 2
    }
}
