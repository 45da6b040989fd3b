//! What is watched in every tick, and which fault it raises. Limits are wide enough for a healthy rig's worst tick and
//! narrow enough that a hand can still get away.

use super::{EventKind, HOST_SILENT_US, Inputs, Motion, Rig, State, ticks};
use crate::sensors::{DriveReading, LvdtReading};
use rig_link::messages::Fault;

/// Age (µs) at which the drive's reports count as missing: five of its 10 ms periods (hardware.md 2.6).
const DRIVE_SILENT_US: u64 = 55_000;
/// Ticks that an LVDT reading may be missing while it is needed.
const LVDT_TICKS: u16 = 8;
/// Most that own encoder and drive may differ (counts), at rest and for each count per second of speed, once the report
/// has been brought forward by its age (hardware.md 6.3): what is left is the bus, both tasks, and the drive's coarse
/// speed. A slipped motor turn, 4096 counts, must show.
const DISAGREE_COUNTS: i64 = 1500;
const DISAGREE_S: f32 = 0.012;
const DISAGREE_TICKS: u16 = ticks(8);
/// A drive position this near to zero after having been this far away has been reset (counts).
const RESET_NEAR: i32 = 400;
const RESET_FAR: i32 = 8000;
/// How far the shaft may stay behind its set-point (rad, and seconds of its speed), and for how long.
const LAG_RAD: f32 = 0.8;
const LAG_S: f32 = 0.25;
const LAG_TICKS: u16 = ticks(30);
/// How far the load may stay behind its set-point (m), and for how long.
const FOLLOW_M: f32 = 2e-3;
const FOLLOW_TICKS: u16 = ticks(50);
/// Fall of the gap's rise in one tick (m) that no motor makes: the load has dropped.
const DROP_M: f32 = 5e-3;

/// Counters of what has to last before it is a fault.
#[derive(Clone, Copy, Debug)]
pub(super) struct Checks {
    lvdt_ticks: u16,
    disagree_ticks: u16,
    lag_ticks: u16,
    follow_ticks: u16,
    last_drive_qc: Option<i32>,
    last_gap_m: Option<f32>,
}

impl Checks {
    pub(super) const fn new() -> Self {
        Self { lvdt_ticks: 0, disagree_ticks: 0, lag_ticks: 0, follow_ticks: 0, last_drive_qc: None, last_gap_m: None }
    }

    /// Faults after which the twist is not known any more, or the drive must be started anew.
    pub(super) fn loses_position(fault: Fault) -> bool {
        matches!(
            fault,
            Fault::DriveSilent
                | Fault::DriveReset
                | Fault::DriveStall
                | Fault::DriveStartUp
                | Fault::CanBusOff
                | Fault::EncoderStuck
                | Fault::EncoderJump
                | Fault::EncoderDisagrees
                | Fault::StringBreak
                | Fault::WatchdogReset
                | Fault::UnexpectedReset
                | Fault::Panicked
        )
    }
}

/// Counts `bad` in a row; true when it has lasted `limit` ticks.
fn lasts(counter: &mut u16, bad: bool, limit: u16) -> bool {
    *counter = if bad { counter.saturating_add(1) } else { 0 };
    *counter >= limit
}

impl Rig<'_> {
    pub(super) fn watch(
        &mut self,
        inputs: &Inputs,
        lvdt: LvdtReading,
        shaft_rad: f32,
        events: &mut heapless::Vec<EventKind, 4>,
    ) {
        if inputs.estop_open && self.state != State::EStop {
            self.state = State::EStop;
            self.fault = None;
            self.homed = None;
            let _ = events.push(EventKind::EStopOpened);
        }
        if let LvdtReading::Valid { gap_m, .. } = lvdt
            && let Some(homed) = self.homed
        {
            self.last_position_m = homed.reference_gap_m - gap_m;
        }
        if matches!(self.state, State::Fault | State::EStop) {
            return;
        }
        if let Some(fault) = self.find_fault(inputs, lvdt, shaft_rad) {
            self.raise(fault, shaft_rad, events);
        }
    }

    fn find_fault(&mut self, inputs: &Inputs, lvdt: LvdtReading, shaft_rad: f32) -> Option<Fault> {
        let moving = matches!(self.state, State::Moving | State::Homing);
        let started = self.state != State::Boot;
        if let Some(fault) = self.drive_fault(inputs, started) {
            return Some(fault);
        }
        // Before the sensor's own checks: a falling load blurs its block, and "noisy" would hide why.
        if let Some(block) = inputs.lvdt {
            let gap_m = self.constants.lvdt_gap_at_code_zero_m + self.constants.lvdt_metres_per_code * block.mean_code;
            let dropped = self.checks.last_gap_m.is_some_and(|last| gap_m - last > DROP_M);
            self.checks.last_gap_m = Some(gap_m);
            let real = !matches!(lvdt, LvdtReading::Invalid(Fault::LvdtOpen | Fault::LvdtShort));
            if dropped && started && real {
                return Some(Fault::StringBreak);
            }
        }
        let lvdt_bad = !matches!(lvdt, LvdtReading::Valid { .. });
        if lasts(&mut self.checks.lvdt_ticks, lvdt_bad && started, LVDT_TICKS) {
            return Some(match lvdt {
                LvdtReading::Invalid(fault) => fault,
                _ => Fault::LvdtStalled,
            });
        }
        let host_silent = match inputs.host_heard_us {
            Some(heard_us) => inputs.now_us.saturating_sub(heard_us) > HOST_SILENT_US,
            None => true,
        };
        if moving && host_silent {
            return Some(Fault::HostSilent);
        }
        let behind = (self.shaft.position - shaft_rad).abs() > LAG_RAD + LAG_S * self.shaft.speed.abs();
        if lasts(&mut self.checks.lag_ticks, behind && started, LAG_TICKS) {
            return Some(Fault::FollowingError);
        }
        let planned =
            matches!(self.state, State::Moving | State::Holding) && matches!(self.motion, Motion::Load { .. });
        let off = planned && (self.planner.set_point_m() - self.last_position_m).abs() > FOLLOW_M;
        if lasts(&mut self.checks.follow_ticks, off, FOLLOW_TICKS) {
            return Some(Fault::FollowingError);
        }
        self.adaptation.disagrees().then_some(Fault::ModelResidual)
    }

    fn drive_fault(&mut self, inputs: &Inputs, started: bool) -> Option<Fault> {
        match inputs.drive {
            DriveReading::Failed => return Some(Fault::DriveStartUp),
            DriveReading::Starting if started => return Some(Fault::DriveReset),
            DriveReading::Starting => return None,
            DriveReading::Reports { .. } => {}
        }
        let DriveReading::Reports { t_us, position_qc, speed_rpm, .. } = inputs.drive else { return None };
        if inputs.drive_stalled {
            return Some(Fault::DriveStall);
        }
        if started && inputs.now_us.saturating_sub(t_us) > DRIVE_SILENT_US {
            return Some(Fault::DriveSilent);
        }
        let far_before = self.checks.last_drive_qc.is_some_and(|last| last.saturating_abs() > RESET_FAR);
        self.checks.last_drive_qc = Some(position_qc);
        if started && far_before && position_qc.saturating_abs() < RESET_NEAR {
            return Some(Fault::DriveReset);
        }
        if let (true, Some(offset)) = (started, self.drive_offset) {
            let counts_per_s = f32::from(speed_rpm) / 60.0 * core::f32::consts::TAU / self.constants.gear_ratio
                * self.constants.counts_per_rad;
            let age_s = inputs.now_us.saturating_sub(t_us) as f32 * 1e-6;
            let drive_now = i64::from(position_qc) + (counts_per_s * age_s) as i64;
            let apart = (inputs.encoder_counts - offset - drive_now).abs();
            let allowed = DISAGREE_COUNTS + (DISAGREE_S * counts_per_s.abs()) as i64;
            if lasts(&mut self.checks.disagree_ticks, apart > allowed, DISAGREE_TICKS) {
                return Some(Fault::EncoderDisagrees);
            }
        }
        None
    }
}
