//! What is checked in every tick, and the faults that are latched. Limits are wide enough for a healthy rig's worst tick,
//! and narrow enough that a hand can still get away.
//!
//! - [`timing`]: ticks that come late.
//! - [`drive`]: whether the drive answers, has restarted or has no supply; whether own encoder and drive count alike.
//! - [`shaft`]: whether the shaft stands, follows, is held, and stays within the strings' range.
//! - [`load`]: whether the load follows its set-point and is within the table's range.
//! - [`gap`] and [`lvdt_jump`]: the LVDT, and strings that break.
//! - [`switches`]: the ends of the rail.

mod drive;
mod gap;
mod load;
mod lvdt_jump;
mod shaft;
mod switches;
mod timing;

use super::fault_policy::{Latched, POLICY, UNHEARD};
use super::modes::Mode;
use super::{Controller, EventKind, Events, HOST_SILENT_US, Inputs};
use crate::sensors::OLD_US;
use drive::DriveChecks;
pub(super) use drive::{is_silent as drive_is_silent, supply, supply_off_us};
use gap::GapChecks;
use load::LoadChecks;
use rig_link::messages::{Fault, Faults, State};
use shaft::ShaftChecks;
pub(super) use shaft::{LAG_S, healthy_lag_rad};
use switches::Switches;
use timing::TickTiming;

/// How long (ticks) a finding must last to be a fault: longer than a wrong reading or a late report; than a shaft or a load needs to
/// follow; than somebody needs to hang a load on or to take it off.
const BRIEF_TICKS: u16 = 8;
pub(super) const SHORT_TICKS: u16 = 30;
pub(super) const LONG_TICKS: u16 = 300;

/// The checks with what they remember, and the latched faults.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Guard {
    pub(super) latched: Latched,
    pub(super) timing: TickTiming,
    pub(super) drive: DriveChecks,
    pub(super) shaft: ShaftChecks,
    /// When the check of the directions last turned the motor by a voltage (µs since boot).
    voltage_us: Option<u64>,
    load: LoadChecks,
    gap: GapChecks,
    switches: Switches,
}

impl Guard {
    /// All that is wrong in this tick.
    pub(super) fn check(&mut self, rig: &Controller, inputs: &Inputs) -> Faults {
        let state = rig.state();
        let late = self.timing.step(inputs.now_us);
        let tick_s = self.timing.tick_s();
        self.shaft.watch_standing(rig, inputs, tick_s);
        // With the emergency stop pressed the drive has no power: nothing else means anything.
        if state == State::EStop {
            return Faults::NONE;
        }
        let mut found = self.drive.faults(rig, inputs, self.shaft.moved_counts, tick_s);
        if matches!(&rig.mode, Mode::Proving(proving) if proving.pwm != 0) {
            self.voltage_us = Some(inputs.now_us);
        }
        // It keeps the voltage that the check of the directions turns the motor by, also if something else has ended the check since
        // its last report.
        let turns = self.voltage_us.is_some_and(|at_us| inputs.now_us.saturating_sub(at_us) < 2 * OLD_US);
        let turns_unheard = found.meets(UNHEARD) && !rig.closed_loop && turns;
        let disagrees = rig.tracking.as_ref().is_some_and(|tracking| tracking.adaptation.disagrees());
        for (fault, is_found) in [
            (Fault::TickLate, late && state != State::Boot),
            (Fault::MotorStill, self.shaft.is_unseen(rig, inputs, self.latched)),
            (Fault::NotHeld, self.shaft.not_held(rig, inputs, self.latched) || turns_unheard),
            (Fault::LimitSwitch, self.switches.reached(rig, inputs)),
            (Fault::HostSilent, host_is_silent(inputs, state)),
            (Fault::TwistRange, self.shaft.twist_is_outside(rig)),
            (Fault::FollowingError, self.shaft.lags(rig) | self.load.lags(rig)),
            (Fault::ModelResidual, disagrees && state != State::Fault),
            (Fault::LoadRange, self.load.is_out_of_range(rig)),
        ] {
            if is_found {
                found.insert(fault);
            }
        }
        self.gap.faults(rig, inputs).into_iter().flatten().for_each(|fault| found.insert(fault));
        found
    }

    /// Latches those of `found` that are new and no consequences of others; whether there were any.
    pub(super) fn latch(&mut self, found: Faults, events: &mut Events) -> bool {
        let news = self.latched.news(found, self.timing.ticks_missed_lately());
        for row in POLICY.iter().filter(|row| news.contains(row.fault)) {
            self.latched.insert(row.fault);
            let _ = events.push(EventKind::FaultRaised(row.fault));
        }
        !news.is_empty()
    }

    /// Clears the faults at rest. What is still open or outside is known: only the way back is free.
    pub(super) fn clear(&mut self, inputs: &Inputs, gap_m: Option<f32>, twist_rad: Option<f32>) {
        self.restart();
        self.switches = Switches::cleared(inputs, gap_m);
        self.shaft = ShaftChecks::cleared(twist_rad);
    }

    /// Clears the faults and begins again. The count of late ticks goes on, and a switch that was cleared open stays so: the first
    /// motion away from it starts the drive.
    pub(super) fn restart(&mut self) {
        *self = Self { timing: self.timing.restarted(), switches: self.switches, ..Self::default() };
    }

    /// Gaps and twists mean something else from now on. A switch that was cleared open stays so.
    pub(super) fn forget_places(&mut self) {
        self.shaft = ShaftChecks::default();
        self.load = LoadChecks::default();
        self.gap = GapChecks::default();
        self.switches.forget_places();
    }
}

fn host_is_silent(inputs: &Inputs, state: State) -> bool {
    let silent = inputs.host_heard_us.is_none_or(|heard_us| inputs.now_us.saturating_sub(heard_us) > HOST_SILENT_US);
    silent && matches!(state, State::Moving | State::Homing)
}
