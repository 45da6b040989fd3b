//! The gap: what it shows of the strings, and of the LVDT itself.

use super::super::{Controller, Inputs, lasts};
use super::lvdt_jump::{JUMP_M, LvdtJump, STEP_TICKS};
use super::{BRIEF_TICKS, LONG_TICKS};
use crate::mechanism::Mechanism;
use crate::sensors::{DriveReading, LvdtReading};
use rig_link::messages::{Fault, GapCurve};

/// Pull of a load that turns back after it was hung on suddenly, over its weight. On strings that stiffen it is more than this, and with
/// friction less.
const SUDDEN_PULL: f32 = 2.0;

impl Controller {
    /// Gap (m) below which no load of the table's range comes that hangs on whole strings: the heaviest, hung on suddenly. Before
    /// homing the strings may be untwisted, and hang lowest.
    fn lowest_gap_m(&self) -> f32 {
        let table = self.table.table();
        let load_n = SUDDEN_PULL * table.metadata.load_max_n;
        match &self.tracking {
            Some(tracking) => {
                let twist_rad = tracking.twist_rad(self.sensing.readings.shaft_at_gap_rad);
                tracking.mechanism(table).at(load_n, twist_rad).gap_m
            }
            None => Mechanism { table, twist_scale: 1.0, curve: GapCurve::constant(0.0) }.at(load_n, 0.0).gap_m,
        }
    }
}

/// What the gap's checks remember.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GapChecks {
    missing_ticks: u16,
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

    /// The load has dropped, so a string is broken: it falls farther than any motor moves it ([`JUMP_M`]) in more ticks than a sensor
    /// that shifts steps in ([`STEP_TICKS`]), and is lower than any load of the table that is hung on suddenly.
    fn dropped(&mut self, rig: &Controller, inputs: &Inputs) -> bool {
        let Some(block) = inputs.lvdt else { return false };
        let gap_m = rig.constants.lvdt_gap_m(block.mean_code);
        let falls = self.last_block_m.replace(gap_m).is_some_and(|last| gap_m - last > JUMP_M);
        let long = lasts(&mut self.drop_ticks, falls, STEP_TICKS as u16 + 1);
        // A falling load blurs its blocks, so that they are too noisy to be a position.
        let unwired = matches!(rig.sensing.readings.lvdt, LvdtReading::Invalid(Fault::LvdtOpen | Fault::LvdtShort));
        long && !unwired && gap_m > rig.lowest_gap_m()
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
