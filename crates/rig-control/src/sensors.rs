//! Readings: each with its time and its validity, never a bare number.

use crate::constants::RigConstants;
use rig_link::messages::Fault;
pub use rmds405::{DriveReading, SupplyReading};

/// A block of LVDT samples, as the ADC's DMA delivers them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LvdtBlock {
    /// When the block was complete (µs since boot).
    pub t_us: u64,
    /// Mean code.
    pub mean_code: f32,
    /// Variance of the codes.
    pub variance: f32,
}

impl LvdtBlock {
    /// Mean and variance of a block of raw 12-bit codes; `None` if it is empty.
    pub fn from_codes(t_us: u64, codes: &[u16]) -> Option<Self> {
        let n = codes.len() as u32;
        if n == 0 {
            return None;
        }
        // In integers, exactly: the variance must be 0 for a frozen signal and for no other.
        let (mut sum, mut squares) = (0u64, 0u64);
        for code in codes {
            sum += u64::from(*code);
            squares += u64::from(*code) * u64::from(*code);
        }
        let spread = squares * u64::from(n) - sum * sum;
        let n = n as f32;
        Some(Self { t_us, mean_code: sum as f32 / n, variance: spread as f32 / (n * n) })
    }

    /// Whether the rms noise of its samples is above a limit (codes).
    pub fn is_noisier_than(&self, limit_codes: f32) -> bool {
        self.variance > limit_codes * limit_codes
    }
}

/// The LVDT's reading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum LvdtReading {
    /// No block yet.
    #[default]
    NotYet,
    /// Gap between the clamps by the LVDT.
    Valid {
        /// When (µs since boot).
        t_us: u64,
        /// Gap (m).
        gap_m: f32,
    },
    /// The signal is not a position.
    Invalid(Fault),
}

impl LvdtReading {
    /// The gap (m), if it is one.
    pub fn gap_m(self) -> Option<f32> {
        match self {
            Self::Valid { gap_m, .. } => Some(gap_m),
            Self::NotYet | Self::Invalid(_) => None,
        }
    }
}

/// One code of the converter on the default LVDT (m).
pub const LVDT_COUNT_M: f32 = 50e-6;
/// Codes at each end of the 12-bit range that are no position, 1 % of it: at the lower end, where a pull-down takes an open
/// lead (docs/reference/hardware.md 2.2), a wire is taken for broken; at the upper end the signal is taken for shorted to
/// the supply.
const END_CODES: f32 = 41.0;
/// Rms noise (codes) above which the signal is not trusted: 0.8 mm, 15 times a healthy one.
const NOISE_LIMIT: f32 = 15.0;
/// Blocks without any noise after which the signal is taken for frozen: 0.3 s, as each tick reads one.
const FROZEN_BLOCKS: u32 = 30;
/// Age (µs) past which a reading counts as missing: five of the 10 ms periods in which the drive reports (crates/rmds405/README.md
/// 2.6), and nine blocks of the LVDT.
pub(crate) const OLD_US: u64 = 55_000;

/// Age of a block's mean at the end of the block (s): half the block (256 samples in 6 ms) and the sensor's own first-order
/// delay at 200 Hz (docs/reference/hardware.md 2.2, assumed).
pub const GAP_DELAY_S: f32 = 3.8e-3;

/// Watches the LVDT's health and converts its codes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lvdt {
    frozen_blocks: u32,
    last_t_us: u64,
}

impl Lvdt {
    /// The reading now, from the newest block.
    pub fn read(&mut self, now_us: u64, block: Option<LvdtBlock>, rig: &RigConstants) -> LvdtReading {
        let Some(block) = block else {
            return if now_us > 20 * OLD_US { LvdtReading::Invalid(Fault::LvdtStalled) } else { LvdtReading::NotYet };
        };
        if block.t_us != self.last_t_us {
            self.last_t_us = block.t_us;
            self.frozen_blocks = if block.variance == 0.0 { self.frozen_blocks.saturating_add(1) } else { 0 };
        }
        if !(block.mean_code.is_finite() && block.variance.is_finite()) {
            LvdtReading::Invalid(Fault::NotFinite)
        } else if now_us.saturating_sub(block.t_us) > OLD_US {
            LvdtReading::Invalid(Fault::LvdtStalled)
        } else if block.mean_code < END_CODES {
            LvdtReading::Invalid(Fault::LvdtOpen)
        } else if block.mean_code > 4095.0 - END_CODES {
            LvdtReading::Invalid(Fault::LvdtShort)
        } else if block.is_noisier_than(NOISE_LIMIT) {
            LvdtReading::Invalid(Fault::LvdtNoisy)
        } else if self.frozen_blocks >= FROZEN_BLOCKS {
            LvdtReading::Invalid(Fault::LvdtFrozen)
        } else {
            LvdtReading::Valid { t_us: block.t_us, gap_m: rig.lvdt_gap_m(block.mean_code) }
        }
    }
}

/// Extends the timer's 16-bit count. At 12 000 rpm half a wrap takes 40 ms (src/README.md 3), so call every 10 ms.
#[derive(Clone, Copy, Debug, Default)]
pub struct EncoderCount {
    last: u16,
    total: i64,
}

impl EncoderCount {
    /// Starts at zero wherever the timer stands.
    pub const fn new(raw: u16) -> Self {
        Self { last: raw, total: 0 }
    }

    /// The count since the start.
    pub fn update(&mut self, raw: u16) -> i64 {
        self.total += i64::from(raw.wrapping_sub(self.last) as i16);
        self.last = raw;
        self.total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::tests::RIG;

    fn block(t_us: u64, mean_code: f32, variance: f32) -> Option<LvdtBlock> {
        Some(LvdtBlock { t_us, mean_code, variance })
    }

    #[test]
    fn a_block_is_averaged_exactly() {
        let b = LvdtBlock::from_codes(7, &[1, 2, 3, 4]).unwrap();
        assert_eq!((b.mean_code, b.variance, b.t_us), (2.5, 1.25, 7));
        assert_eq!(LvdtBlock::from_codes(0, &[4095; 256]).unwrap().variance, 0.0);
        assert_eq!(LvdtBlock::from_codes(0, &[]), None);
    }

    #[test]
    fn each_lvdt_fault_fires_and_its_near_miss_does_not() {
        let read = |mean: f32, variance: f32| Lvdt::default().read(1000, block(1000, mean, variance), &RIG);
        assert_eq!(read(40.0, 1.0), LvdtReading::Invalid(Fault::LvdtOpen));
        assert!(matches!(read(42.0, 1.0), LvdtReading::Valid { .. }));
        assert_eq!(read(4055.0, 1.0), LvdtReading::Invalid(Fault::LvdtShort));
        assert!(matches!(read(4053.0, 1.0), LvdtReading::Valid { .. }));
        assert_eq!(read(2000.0, 300.0), LvdtReading::Invalid(Fault::LvdtNoisy));
        assert_eq!(read(f32::NAN, 1.0), LvdtReading::Invalid(Fault::NotFinite));
        assert_eq!(read(2000.0, f32::INFINITY), LvdtReading::Invalid(Fault::NotFinite));
        assert!(matches!(read(2000.0, 150.0), LvdtReading::Valid { .. }));
        // The limits themselves are healthy.
        for (mean, variance) in [(END_CODES, 1.0), (4095.0 - END_CODES, 1.0), (2000.0, NOISE_LIMIT * NOISE_LIMIT)] {
            assert!(matches!(read(mean, variance), LvdtReading::Valid { .. }), "{mean} {variance}");
        }
        let LvdtReading::Valid { gap_m, .. } = read(2000.0, 1.0) else { panic!() };
        assert!((gap_m - RIG.lvdt_gap_m(2000.0)).abs() < 1e-9);
    }

    #[test]
    fn a_frozen_signal_is_one_without_any_noise() {
        let mut lvdt = Lvdt::default();
        for k in 1..=60u64 {
            let reading = lvdt.read(k * 6000, block(k * 6000, 2000.0, 0.0), &RIG);
            assert_eq!(matches!(reading, LvdtReading::Invalid(Fault::LvdtFrozen)), k >= 30, "block {k}");
        }
        // One live block and it counts again; asking twice about one block counts it once.
        assert!(matches!(lvdt.read(400_000, block(400_000, 2000.0, 0.01), &RIG), LvdtReading::Valid { .. }));
        for _ in 0..100 {
            assert!(matches!(lvdt.read(406_000, block(406_000, 2000.0, 0.0), &RIG), LvdtReading::Valid { .. }));
        }
    }

    #[test]
    fn a_stalled_adc_is_found_by_age() {
        let mut lvdt = Lvdt::default();
        assert_eq!(lvdt.read(1000, None, &RIG), LvdtReading::NotYet);
        assert_eq!(lvdt.read(2_000_000, None, &RIG), LvdtReading::Invalid(Fault::LvdtStalled));
        assert_eq!(lvdt.read(20 * OLD_US, None, &RIG), LvdtReading::NotYet);
        assert!(matches!(lvdt.read(12_000 + OLD_US, block(12_000, 2000.0, 1.0), &RIG), LvdtReading::Valid { .. }));
        assert!(matches!(lvdt.read(60_000, block(12_000, 2000.0, 1.0), &RIG), LvdtReading::Valid { .. }));
        assert_eq!(lvdt.read(70_000, block(12_000, 2000.0, 1.0), &RIG), LvdtReading::Invalid(Fault::LvdtStalled));
    }

    #[test]
    fn the_encoder_count_wraps_both_ways() {
        let mut count = EncoderCount::new(65_000);
        assert_eq!(count.update(65_500), 500);
        assert_eq!(count.update(100), 636);
        assert_eq!(count.update(65_400), 400);
        assert_eq!(count.update(65_400), 400);
        let mut total = 400;
        let mut raw = 65_400u16;
        for _ in 0..1000 {
            raw = raw.wrapping_sub(8000);
            total -= 8000;
            assert_eq!(count.update(raw), total);
        }
    }
}
