//! What is watched in every tick, and which fault it raises. Limits are wide enough for a healthy rig's worst tick and
//! narrow enough that a hand can still get away.

use super::drive_checks::DriveChecks;
use super::fault_policy::Response;
use super::lvdt_jump::LvdtJump;
use super::{EventKind, Events, HOST_SILENT_US, Inputs, Motion, Rig, STANDING_RPM, State, ticks};
use crate::observer::Observation;
use crate::sensors::{DriveReading, LvdtReading};
use crate::{TICK_US, angle_rad, seconds, whole_counts};
use rig_link::messages::Fault;

/// Ticks that an LVDT reading may be missing while it is needed, and while starting.
const LVDT_TICKS: u16 = 8;
const LVDT_BOOT_TICKS: u16 = ticks(200);
/// How far the shaft may stay behind its set-point (rad, and seconds of its speed), and for how long.
const LAG_RAD: f32 = 0.8;
const LAG_S: f32 = 0.25;
const LAG_TICKS: u16 = ticks(30);
/// How far a held shaft may be from where it is held (rad), and for how long: ten times what a shaft overshoots that is
/// stopped from a fast move of the emulated rig.
const NOT_HELD_RAD: f32 = 0.8;
const NOT_HELD_TICKS: u16 = ticks(10);
/// How long the shaft must stand before anything is cleared.
pub(super) const STILL_TICKS: u16 = ticks(20);
/// How far the load may stay behind its set-point (m), and for how long.
const FOLLOW_M: f32 = 2e-3;
const FOLLOW_TICKS: u16 = ticks(50);
/// Fall of the load (m) since the last good reading, and in each of so many ticks, that no motor makes: it has dropped. A
/// sensor that shifts steps in one or two ticks.
const DROP_M: f32 = 5e-3;
const DROP_IN_A_TICK_M: f32 = 1e-3;
const DROP_TICKS: u16 = 3;
/// Rms noise (codes) of a block in which a load falls at up to 2 m/s; one in which a wire breaks has far more.
const FALLING_NOISE: f32 = 60.0;
/// A tick this long (µs) after the one before is late; one this long after is a fault by itself: the encoder's 16 bits
/// could wrap unseen at full speed, and the drive has stood at an old target.
const LATE_US: u64 = TICK_US + TICK_US / 2;
const LATE_AT_ONCE_US: u64 = 6 * TICK_US;
/// Late ticks leak away one in 25, and five in a second are a fault.
const LATE_COST: u16 = ticks(25);
const LATE_MOST: u16 = 4 * LATE_COST;
/// Ticks that a limit switch must be open: its contacts bounce.
const SWITCH_TICKS: u16 = ticks(2);
/// How far the load may go on towards a switch that is open after a `clear` (m), and the strings past their range (rad).
const PAST_SWITCH_M: f32 = 0.3e-3;
const PAST_TWIST_RAD: f32 = 0.3;
/// How long the load estimate may want to leave the table at its heavy end and at its light end, where nothing breaks.
const HEAVY_TICKS: u16 = ticks(30);
const LIGHT_TICKS: u16 = ticks(200);

/// Counters of what has to last before it is a fault, and what was seen last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Checks {
    pub(super) drive: DriveChecks,
    /// Time between this tick and the one before (µs).
    pub(super) apart_us: u64,
    last_tick_us: Option<u64>,
    /// Time since the newest late tick (µs).
    since_late_us: u64,
    late_bucket: u16,
    lvdt_ticks: u16,
    lag_ticks: u16,
    follow_ticks: u16,
    away_ticks: u16,
    range_ticks: u16,
    /// How long the shaft has stood, by the own encoder and by the drive.
    pub(super) still_ticks: u16,
    last_own: Option<i64>,
    /// Own counts in this tick.
    pub(super) moved: i64,
    last_gap_m: Option<f32>,
    /// The newest block's gap, however noisy.
    last_block_m: Option<f32>,
    drop_ticks: u16,
    lvdt_jump: LvdtJump,
    /// How long the upper and the lower switch have been open.
    switch_ticks: [u16; 2],
    /// The gap past which an open switch is a fault again, while it was cleared open (m).
    switch_gap_m: [Option<f32>; 2],
    /// The twist past which it is out of range again, while it was cleared outside (rad).
    twist_past_rad: f32,
}

impl Checks {
    pub(super) fn new() -> Self {
        Self {
            drive: DriveChecks::default(),
            apart_us: TICK_US,
            last_tick_us: None,
            since_late_us: u64::MAX,
            late_bucket: 0,
            lvdt_ticks: 0,
            lag_ticks: 0,
            follow_ticks: 0,
            away_ticks: 0,
            range_ticks: 0,
            still_ticks: 0,
            last_own: None,
            moved: 0,
            last_gap_m: None,
            last_block_m: None,
            drop_ticks: 0,
            lvdt_jump: LvdtJump::new(),
            switch_ticks: [0; 2],
            switch_gap_m: [None; 2],
            twist_past_rad: 0.0,
        }
    }

    /// After a `clear`. What still stands open or outside is known, and only the way back is free.
    pub(super) fn cleared(inputs: &Inputs, gap_m: Option<f32>, twist_rad: Option<f32>) -> Self {
        let open = |open: bool, past_m: f32| gap_m.filter(|_| open).map(|gap_m| gap_m + past_m);
        Self {
            switch_gap_m: [open(inputs.upper_limit_open, -PAST_SWITCH_M), open(inputs.lower_limit_open, PAST_SWITCH_M)],
            twist_past_rad: twist_rad.map_or(0.0, |twist_rad| twist_rad.abs() + PAST_TWIST_RAD),
            ..Self::new()
        }
    }

    /// Gaps and twists are about to be told in other numbers. A switch that was cleared open stays so.
    pub(super) fn forget_places(&mut self) {
        let [upper, lower] = self.switch_gap_m;
        // The first gap in the new numbers is within these.
        let switch_gap_m = [upper.map(|_| f32::NEG_INFINITY), lower.map(|_| f32::INFINITY)];
        let Self { drive, apart_us, last_tick_us, since_late_us, late_bucket, switch_ticks, .. } = *self;
        *self = Self {
            drive,
            apart_us,
            last_tick_us,
            since_late_us,
            late_bucket,
            switch_ticks,
            switch_gap_m,
            ..Self::new()
        };
    }

    /// The next tick is not late, however long it takes to come.
    pub(super) fn pause(&mut self) {
        self.last_tick_us = None;
    }

    /// Where the drive last said it is (its own counts).
    pub(super) fn drive_counts(&self) -> Option<i64> {
        self.drive.last_drive_qc.map(i64::from)
    }

    /// Whether ticks come so late that it is a fault; counts those that are late.
    fn late(&mut self, now_us: u64, late_ticks: &mut u32) -> bool {
        self.apart_us = self.last_tick_us.replace(now_us).map_or(TICK_US, |last| now_us.saturating_sub(last));
        self.since_late_us = self.since_late_us.saturating_add(self.apart_us);
        if self.apart_us > LATE_US {
            self.since_late_us = 0;
            *late_ticks = late_ticks.saturating_add(1);
            self.late_bucket = self.late_bucket.saturating_add(LATE_COST);
        } else {
            self.late_bucket = self.late_bucket.saturating_sub(1);
        }
        self.apart_us > LATE_AT_ONCE_US || self.late_bucket > LATE_MOST
    }

    /// Whether ticks were missing so lately that drive and sensors may not have been heard since.
    pub(super) fn ticks_missed_lately(&self) -> bool {
        self.since_late_us <= LATE_AT_ONCE_US
    }

    /// Whether an end of the rail has been reached, or passed after a `clear`.
    fn at_switch(&mut self, inputs: &Inputs, gap_m: Option<f32>) -> bool {
        let mut hit = false;
        let switches = [(inputs.upper_limit_open, 1.0f32), (inputs.lower_limit_open, -1.0)];
        for (((open, away), ticks), past_m) in
            switches.into_iter().zip(&mut self.switch_ticks).zip(&mut self.switch_gap_m)
        {
            let stays_open = lasts(ticks, open, SWITCH_TICKS);
            if !open {
                *past_m = None;
            }
            hit |= match (past_m.as_mut(), gap_m) {
                (None, _) => stays_open,
                // No gap to judge by: its loss is a fault of its own.
                (Some(_), None) => false,
                (Some(past_m), Some(gap_m)) => {
                    // The bound follows on the way back.
                    let bound = gap_m - away * PAST_SWITCH_M;
                    if away * (bound - *past_m) > 0.0 {
                        *past_m = bound;
                    }
                    away * (gap_m - *past_m) < 0.0
                }
            };
        }
        hit
    }

    /// Whether a twist (rad) is farther out than `most_rad`, or than where it was cleared.
    fn outside(&mut self, twist_rad: f32, most_rad: f32) -> bool {
        let out = twist_rad.abs();
        let past_rad = (most_rad + PAST_TWIST_RAD).max(self.twist_past_rad);
        self.twist_past_rad = self.twist_past_rad.min(out + PAST_TWIST_RAD);
        out > past_rad
    }
}

/// Counts `bad` in a row; true when it has lasted `limit` ticks.
pub(super) fn lasts(counter: &mut u16, bad: bool, limit: u16) -> bool {
    *counter = if bad { counter.saturating_add(1) } else { 0 };
    *counter >= limit
}

/// Time of a tick (s), at least the usual one.
pub(super) fn tick_seconds(apart_us: u64) -> f32 {
    seconds(apart_us.max(TICK_US))
}

impl Rig<'_> {
    pub(super) fn watch(&mut self, inputs: &Inputs, lvdt: LvdtReading, shaft_rad: f32, events: &mut Events) {
        self.watch_estop(inputs, events);
        if let LvdtReading::Valid { gap_m, .. } = lvdt
            && let Some(homed) = self.homed
        {
            self.last_position_m = homed.reference_gap_m - gap_m;
        }
        let late = self.checks.late(inputs.now_us, &mut self.late_ticks);
        self.watch_shaft(inputs);
        if self.state == State::EStop {
            return;
        }
        let mut found = self.drive_faults(inputs);
        for (fault, is_found) in [
            (Fault::TickLate, late && self.state != State::Boot),
            (Fault::NotFinite, !shaft_rad.is_finite()),
            (Fault::NotHeld, self.not_held(inputs, shaft_rad)),
            (Fault::LimitSwitch, self.checks.at_switch(inputs, lvdt.gap_m()) && self.matched),
            (Fault::HostSilent, self.host_is_silent(inputs)),
            (Fault::TwistRange, self.twist_is_outside(shaft_rad)),
            (Fault::FollowingError, self.follows_badly(shaft_rad)),
            (Fault::ModelResidual, self.state != State::Fault && self.adaptation.disagrees()),
        ] {
            if is_found {
                found.insert(fault);
            }
        }
        self.gap_faults(inputs, lvdt).into_iter().flatten().for_each(|fault| found.insert(fault));
        self.latch(found, shaft_rad, events);
    }

    fn watch_estop(&mut self, inputs: &Inputs, events: &mut Events) {
        self.estop_closes = false;
        if inputs.estop_open && self.state != State::EStop {
            self.state = State::EStop;
            self.homed = None;
            self.estop_closed = false;
            let _ = events.push(EventKind::EStopOpened);
        } else if self.state == State::EStop && self.estop_closed == inputs.estop_open {
            self.estop_closed = !inputs.estop_open;
            self.estop_closes = self.estop_closed;
            let _ = events.push(if inputs.estop_open { EventKind::EStopOpened } else { EventKind::EStopClosed });
        }
    }

    /// Whether the shaft stands, by the own encoder and, where the drive reports, by the drive as well.
    fn watch_shaft(&mut self, inputs: &Inputs) {
        let own = inputs.encoder_counts;
        self.checks.moved = self.checks.last_own.replace(own).map_or(0, |last| own - last);
        let c = &self.constants;
        let standing = f32::from(STANDING_RPM) / 60.0 * core::f32::consts::TAU / c.gear_ratio * c.counts_per_rad.abs();
        let own_turns = self.checks.moved.abs() > whole_counts(standing * tick_seconds(self.checks.apart_us));
        let drive_turns = matches!(inputs.drive,
            DriveReading::Reports { speed_rpm, t_us, .. }
                if speed_rpm.unsigned_abs() > STANDING_RPM && !super::drive_checks::is_silent(inputs.now_us, t_us));
        let still_ticks = self.checks.still_ticks.saturating_add(1);
        self.checks.still_ticks = if own_turns || drive_turns { 0 } else { still_ticks };
    }

    /// Held by a fault, the shaft has gone away all the same.
    fn not_held(&mut self, inputs: &Inputs, shaft_rad: f32) -> bool {
        let told_to_hold =
            matches!(self.latched.response(), Some(Response::Hold | Response::HoldByDrive | Response::HoldIfHeard))
                && self.matched;
        let seen_rad = match (self.own_encoder_is_wrong(), inputs.drive, self.drive_offset) {
            (false, ..) => Some(shaft_rad),
            (true, DriveReading::Reports { position_qc, .. }, Some(offset)) => {
                Some(angle_rad(i64::from(position_qc) + offset, self.constants.counts_per_rad))
            }
            (true, ..) => None,
        };
        let away = seen_rad.is_some_and(|seen_rad| (seen_rad - self.shaft.position).abs() > NOT_HELD_RAD);
        lasts(&mut self.checks.away_ticks, told_to_hold && away, NOT_HELD_TICKS)
    }

    fn host_is_silent(&self, inputs: &Inputs) -> bool {
        let heard_us = inputs.host_heard_us;
        let silent = heard_us.is_none_or(|heard_us| inputs.now_us.saturating_sub(heard_us) > HOST_SILENT_US);
        silent && matches!(self.state, State::Moving | State::Homing)
    }

    fn twist_is_outside(&mut self, shaft_rad: f32) -> bool {
        let Some(homed) = self.homed.filter(|_| self.state != State::Homing) else { return false };
        self.checks.outside(shaft_rad - homed.zero_rad, self.table.metadata.twist_max_rad)
    }

    /// Shaft or load stay behind their set-points.
    fn follows_badly(&mut self, shaft_rad: f32) -> bool {
        let follows = self.matched && self.state != State::Fault;
        let behind = (self.shaft.position - shaft_rad).abs() > LAG_RAD + LAG_S * self.shaft.speed.abs();
        let shaft = lasts(&mut self.checks.lag_ticks, behind && follows, LAG_TICKS);
        let planned =
            matches!(self.state, State::Moving | State::Holding) && matches!(self.motion, Motion::Load { .. });
        let off = planned && (self.planner.set_point_m() - self.last_position_m).abs() > FOLLOW_M;
        lasts(&mut self.checks.follow_ticks, off, FOLLOW_TICKS) || shaft
    }

    /// What the gap tells of the strings, and of the sensor itself.
    fn gap_faults(&mut self, inputs: &Inputs, lvdt: LvdtReading) -> [Option<Fault>; 3] {
        let mut broken = false;
        if let Some(block) = inputs.lvdt {
            let gap_m = self.constants.lvdt_gap_at_code_zero_m + self.constants.lvdt_metres_per_code * block.mean_code;
            let falls = self.checks.last_block_m.replace(gap_m).is_some_and(|last| gap_m - last > DROP_IN_A_TICK_M);
            let dropped = lasts(&mut self.checks.drop_ticks, falls, DROP_TICKS)
                && self.checks.last_gap_m.is_some_and(|last| gap_m - last > DROP_M);
            // A falling load blurs its block; a broken wire blurs it far more.
            let real = !matches!(lvdt, LvdtReading::Invalid(Fault::LvdtOpen | Fault::LvdtShort));
            broken = dropped && self.matched && real && !block.is_noisier_than(FALLING_NOISE);
            self.checks.last_gap_m = lvdt.gap_m().or(self.checks.last_gap_m);
        }
        let jumped = self.checks.lvdt_jump.step(lvdt.gap_m()) && self.matched;
        [
            broken.then_some(Fault::StringBreak),
            jumped.then_some(Fault::LvdtJump),
            self.lvdt_fault(inputs, lvdt, self.matched),
        ]
    }

    fn lvdt_fault(&mut self, inputs: &Inputs, lvdt: LvdtReading, started: bool) -> Option<Fault> {
        let bad = !matches!(lvdt, LvdtReading::Valid { .. });
        // Without this a rig whose sensor is not plugged in would wait for it without a word.
        let waits = matches!(inputs.drive, DriveReading::Reports { .. });
        let limit = if started { LVDT_TICKS } else { LVDT_BOOT_TICKS };
        lasts(&mut self.checks.lvdt_ticks, bad && (started || waits), limit).then_some(match lvdt {
            LvdtReading::Invalid(fault) => fault,
            _ => Fault::LvdtStalled,
        })
    }

    /// The load is beyond what the table, and so the mechanism, was made for.
    pub(super) fn load_out_of_range(&mut self, seen: Option<&Observation>) -> bool {
        let m = &self.table.metadata;
        // Only while the strings are turned by it: at rest weights are changed.
        let used = matches!(self.state, State::Moving | State::Holding) && matches!(self.motion, Motion::Load { .. });
        let heavy = self.observer.load_n() > 0.5 * (m.load_min_n + m.load_max_n);
        let at_end = used && seen.is_some_and(|seen| seen.at_range_end);
        lasts(&mut self.checks.range_ticks, at_end, if heavy { HEAVY_TICKS } else { LIGHT_TICKS })
    }
}
