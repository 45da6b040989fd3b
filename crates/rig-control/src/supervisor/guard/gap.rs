//! The gap: what it shows of the strings, and of the LVDT itself.

use super::super::{Controller, Inputs, lasts};
use super::lvdt_jump::{JUMP_M, LvdtJump, STEP_TICKS};
use super::{BRIEF_TICKS, LONG_TICKS};
use crate::sensors::{DriveReading, LvdtReading};
use rig_link::messages::Fault;

/// Rms noise (codes) of a block in which a load falls at up to 2 m/s; one in which a wire breaks has far more.
const FALLING_NOISE: f32 = 60.0;

/// What the gap's checks remember.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GapChecks {
    missing_ticks: u16,
    /// Last valid gap (m).
    last_gap_m: Option<f32>,
    /// The newest block's gap, however noisy (m).
    last_block_m: Option<f32>,
    drop_ticks: u16,
    jump: LvdtJump,
}

impl GapChecks {
    pub(super) fn faults(&mut self, rig: &Controller, inputs: &Inputs) -> [Option<Fault>; 3] {
        let started = rig.sensing.drive_zero.is_matched();
        let broken = self.dropped(rig, inputs) && started;
        let jumped = self.jump.step(rig.sensing.readings.lvdt.gap_m()) && started;
        [broken.then_some(Fault::StringBreak), jumped.then_some(Fault::LvdtJump), self.missing(rig, inputs, started)]
    }

    /// The load has dropped, so a string is broken: it has fallen farther than any motor moves it ([`JUMP_M`]) in more ticks than a
    /// sensor that shifts steps in ([`STEP_TICKS`]), and five times as far since the last good reading.
    fn dropped(&mut self, rig: &Controller, inputs: &Inputs) -> bool {
        let Some(block) = inputs.lvdt else { return false };
        let lvdt = rig.sensing.readings.lvdt;
        let gap_m = rig.constants.lvdt_gap_m(block.mean_code);
        let falls = self.last_block_m.replace(gap_m).is_some_and(|last| gap_m - last > JUMP_M);
        let long = lasts(&mut self.drop_ticks, falls, STEP_TICKS as u16 + 1);
        let dropped = long && self.last_gap_m.is_some_and(|last| gap_m - last > 5.0 * JUMP_M);
        self.last_gap_m = lvdt.gap_m().or(self.last_gap_m);
        // A falling load blurs its block; a broken wire blurs it far more.
        let real = !matches!(lvdt, LvdtReading::Invalid(Fault::LvdtOpen | Fault::LvdtShort));
        dropped && real && !block.is_noisier_than(FALLING_NOISE)
    }

    /// The LVDT gives no valid reading.
    fn missing(&mut self, rig: &Controller, inputs: &Inputs, started: bool) -> Option<Fault> {
        let lvdt = rig.sensing.readings.lvdt;
        let bad = !matches!(lvdt, LvdtReading::Valid { .. });
        // Without this a rig whose sensor is not plugged in would wait for it without a word.
        let waits = matches!(inputs.drive, DriveReading::Reports { .. });
        let limit = if started { BRIEF_TICKS } else { LONG_TICKS };
        lasts(&mut self.missing_ticks, bad && (started || waits), limit).then_some(match lvdt {
            LvdtReading::Invalid(fault) => fault,
            LvdtReading::Valid { .. } | LvdtReading::NotYet => Fault::LvdtStalled,
        })
    }
}
