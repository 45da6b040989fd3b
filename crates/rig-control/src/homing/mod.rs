//! Homing without switches: the gap is even in the twist and greatest at zero (model.md section 5).
//!
//! ```text
//! Quiet ── the load has stopped swinging ──> Probe
//! Probe ── which way does the gap grow? ──> Seek ── past its maximum ──> Centre ── two sweeps across it ──> Weigh
//!                                                                          │ midpoints of equal gaps         │
//!                                                                          v                                 v
//!                                                                     zero twist              up and down 6 turns :
//!                                                                                             load, friction, radius
//!                                                                                                  │
//!                                              Done <── reference gap <── Settle at half a turn <──┘
//! ```
//! Sweeping both ways cancels what depends on the direction: rail friction, filter delay, gear backlash.

mod centre;
mod weigh;

use crate::mechanism::Mechanism;
use crate::planner::Ramp;
use crate::{RigConstants, TICK_S};
use centre::Centre;
use core::f32::consts::{PI, TAU};
use rig_link::messages::HomingFailure;
use tsa_table::Table;
use weigh::Weigh;

/// The load is quiet when its gap (m) stays within this for so long (ticks): a period of its slowest swing.
const QUIET_M: f32 = 0.1e-3;
const QUIET_TICKS: u16 = 40;
/// A load that still swings then (s) is homed all the same; what comes of it is judged at the end.
const QUIET_PATIENCE_S: f32 = 10.0;
/// Speed of the probe (rad/s).
const PROBE_SPEED: f32 = 1.5;
/// Change of the gap (m) that decides the probe: several times what rail friction can hold back.
const PROBE_CHANGE_M: f32 = 0.25e-3;
/// Longest probe (rad). Highly twisted under little load, rail friction holds the load that long: 0.1 N under 0.5 N for
/// 6 rad, 0.3 N under 1 N for 6.7 rad. Against a jammed load it adds some 3 N.
const PROBE_TRAVEL: f32 = 7.0;
/// So far (rad) behind its set-point the shaft stands against fully closed strings: more than any drive lags at the
/// probe's speed, and turned back from before the drive takes it for a stall and drops the load.
const PROBE_BEHIND: f32 = 0.5;
/// Speed towards the maximum (rad/s).
const SEEK_SPEED: f32 = 8.0;
/// Fall from the greatest gap (m) that shows that the maximum has been passed.
const SEEK_FALL_M: f32 = 0.6e-3;
/// Rise from the least gap (m) before a fall counts: a light load that has just torn loose from friction goes up for a
/// while when the motor has already turned back.
const SEEK_RISE_M: f32 = 0.15e-3;
/// Fall before such a rise (m) that shows that this is not the way to zero twist: more of it would close the strings.
const SEEK_ASTRAY_M: f32 = 3e-3;
/// Turn without such a rise (rad) that no friction explains which the probe can overcome: the load is jammed.
const SEEK_STUCK: f32 = 1.5 * PROBE_TRAVEL;
/// Farthest from the power-up twist that the maximum is looked for (rad): 12 turns, and what the probe went astray.
const SEEK_TRAVEL: f32 = 12.0 * TAU + PROBE_TRAVEL;
/// Half the width of the sweeps across the maximum (rad).
const SWEEP_HALF: f32 = 3.0;
/// Speed of these sweeps (rad/s): slow enough that the load follows without swinging.
const SWEEP_SPEED: f32 = 2.5;
/// Turns past the half-turn pre-twist that the load is weighed over.
const WEIGH_TURNS: f32 = 6.0;
/// Speeds of weighing (rad/s), at the middle of the sweep and at its ends. It varies, and alike either way, so that the
/// grain of the drive's speed and current measurement averages out: at one speed it beats with the commands' period.
const WEIGH_SPEED: [f32; 2] = [3.4, 6.2];
/// Acceleration of all of it (rad/s²).
const ACCELERATION: f32 = 25.0;
/// Rest before a sweep (s), for the load to stop swinging.
const REST_S: f32 = 0.3;
/// Rest at the pre-twist before the reference is taken, and how long it is averaged over (s).
const SETTLE_S: f32 = 0.7;
const REFERENCE_S: f32 = 0.4;
/// How far (m) the load may hang from where the sweeps say, friction aside: what swings and creeps does less, a string that
/// slips in its clamp does more.
const SHIFTED_M: f32 = 0.6e-3;
/// Longest homing (s), start-up of the drive not counted.
const TIME_OUT_S: f32 = 42.0;

/// Result of a homing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homed {
    /// Shaft angle at zero twist (rad, as the encoder counts).
    pub zero_rad: f32,
    /// Estimated error of that (rad).
    pub zero_error_rad: f32,
    /// Load (N).
    pub load_n: f32,
    /// Measured less modelled gap (m).
    pub gap_offset_m: f32,
    /// Scale of the twist, see [`crate::mechanism`].
    pub twist_scale: f32,
    /// Coulomb friction of the rail (N).
    pub friction_n: f32,
    /// Measured gap at position zero (m): the half-turn pre-twist, unless a setting says otherwise.
    pub reference_gap_m: f32,
    /// How far the shaft stays behind its set-point, in time (s): the drive's own position loop, measured.
    pub drive_lag_s: f32,
}

/// What homing sees in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Shaft angle by the encoder (rad).
    pub shaft_rad: f32,
    /// The same when the gap was measured, a little earlier (rad).
    pub shaft_then_rad: f32,
    /// Measured gap (m).
    pub gap_m: f32,
    /// Winding current that the drive reports (A).
    pub current_a: f32,
}

/// What homing wants of the motor, or how it ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// Shaft set-point (rad) and speed (rad/s).
    Turning(Ramp),
    /// Done; the shaft stands at the half-turn pre-twist.
    Done(Homed),
    /// Given up.
    Failed(HomingFailure),
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    Quiet { ticks: u16, low_m: f32, high_m: f32 },
    Probe { start_rad: f32, gap_m: f32 },
    Seek { start_rad: f32, goal_rad: f32, low_m: Option<f32>, top_m: f32, top_rad: f32 },
    CentreRest { ticks: u16 },
    Centre,
    WeighStart { ticks: u16 },
    Weigh,
    Settle { ticks: u16, sum_m: f32, count: u16 },
}

/// One homing.
#[derive(Clone, Debug)]
pub struct Homing {
    phase: Phase,
    ramp: Ramp,
    /// Gap smoothed over some 40 ms, for decisions that need no precision.
    smooth_gap_m: f32,
    /// +1 or −1: the direction in which the gap grew.
    direction: f32,
    ticks: u32,
    centre: Centre,
    weigh: Weigh,
    /// Scale of the twist that is expected.
    twist_scale: f32,
    zero_rad: f32,
    zero_error_rad: f32,
    lag_sum_s: f32,
    lag_count: u16,
}

impl Default for Homing {
    fn default() -> Self {
        Self::new()
    }
}

impl Homing {
    /// Nothing begun.
    pub const fn new() -> Self {
        Self {
            phase: Phase::Quiet { ticks: 0, low_m: 0.0, high_m: 0.0 },
            ramp: Ramp::at(0.0),
            smooth_gap_m: 0.0,
            direction: 1.0,
            ticks: 0,
            centre: Centre::new(),
            weigh: Weigh::new(),
            twist_scale: 1.0,
            zero_rad: 0.0,
            zero_error_rad: 0.0,
            lag_sum_s: 0.0,
            lag_count: 0,
        }
    }

    /// Starts from wherever the shaft is, expecting a scale of the twist. In place, and the bins are emptied when their
    /// sweep begins: a few kilobytes made anew and moved would be the longest tick of all.
    pub fn begin(&mut self, shaft_rad: f32, gap_m: f32, twist_scale: f32) {
        self.twist_scale = twist_scale;
        self.phase = Phase::Quiet { ticks: 0, low_m: gap_m, high_m: gap_m };
        self.ramp = Ramp::at(shaft_rad);
        self.smooth_gap_m = gap_m;
        self.direction = 1.0;
        self.ticks = 0;
        (self.zero_rad, self.zero_error_rad) = (0.0, 0.0);
        (self.lag_sum_s, self.lag_count) = (0.0, 0);
    }

    /// One tick.
    pub fn step(&mut self, table: &Table<'_>, rig: &RigConstants, seen: &Seen) -> Progress {
        let Seen { shaft_rad, gap_m, .. } = *seen;
        self.ticks += 1;
        if self.ticks as f32 * TICK_S > TIME_OUT_S {
            return Progress::Failed(HomingFailure::TimeOut);
        }
        self.smooth_gap_m += 0.25 * (gap_m - self.smooth_gap_m);
        let speed_limit = 0.9 * rig.twist_speed_max();
        let acceleration = ACCELERATION.min(rig.twist_acceleration_max());
        let outcome = match self.phase {
            Phase::Quiet { ticks, low_m, high_m } => {
                self.wait_for_quiet(ticks, low_m.min(gap_m), high_m.max(gap_m), gap_m);
                Ok(None)
            }
            Phase::Probe { start_rad, gap_m } => self.probe(start_rad, gap_m, shaft_rad, acceleration),
            Phase::Seek { start_rad, goal_rad, low_m, top_m, top_rad } => {
                self.seek(start_rad, goal_rad, low_m, top_m, top_rad, shaft_rad, acceleration, speed_limit)
            }
            Phase::CentreRest { ticks } => self.rest_before_centre(ticks, acceleration, speed_limit),
            Phase::Centre => self.sweep_centre(seen, acceleration),
            Phase::WeighStart { ticks } => self.rest_before_weigh(ticks, acceleration, speed_limit),
            Phase::Weigh => self.sweep_weigh(table, rig, seen, acceleration, speed_limit),
            Phase::Settle { ticks, sum_m, count } => self.settle(table, ticks, sum_m, count, gap_m, acceleration),
        };
        match outcome {
            Ok(None) => Progress::Turning(self.ramp),
            Ok(Some(homed)) => Progress::Done(homed),
            Err(failure) => Progress::Failed(failure),
        }
    }

    /// A load that has just dropped swings for seconds, farther than the probe can tell from its own doing.
    fn wait_for_quiet(&mut self, ticks: u16, low_m: f32, high_m: f32, gap_m: f32) {
        self.phase = if ticks < QUIET_TICKS {
            Phase::Quiet { ticks: ticks + 1, low_m, high_m }
        } else if high_m - low_m < QUIET_M || self.ticks as f32 * TICK_S > QUIET_PATIENCE_S {
            Phase::Probe { start_rad: self.ramp.position, gap_m: self.smooth_gap_m }
        } else {
            Phase::Quiet { ticks: 0, low_m: gap_m, high_m: gap_m }
        };
    }

    fn probe(
        &mut self,
        start_rad: f32,
        gap_m: f32,
        shaft_rad: f32,
        acceleration: f32,
    ) -> Result<Option<Homed>, HomingFailure> {
        let goal = start_rad + PROBE_TRAVEL;
        self.ramp.step(goal, PROBE_SPEED, acceleration);
        let change = self.smooth_gap_m - gap_m;
        let ended = self.ramp == Ramp::at(goal);
        let closed = self.ramp.position - shaft_rad > PROBE_BEHIND;
        if closed {
            // Only more twist meets such a resistance. From where the shaft is: the motor lets go at once.
            self.ramp = Ramp::at(shaft_rad);
        }
        if closed || change.abs() > PROBE_CHANGE_M || (ended && change.abs() > 0.1 * PROBE_CHANGE_M) {
            self.direction = if closed { -1.0 } else { libm::copysignf(1.0, change) };
            self.phase = Phase::Seek {
                start_rad: self.ramp.position,
                goal_rad: self.ramp.position + self.direction * SEEK_TRAVEL,
                low_m: Some(self.smooth_gap_m.min(gap_m)),
                top_m: self.smooth_gap_m,
                top_rad: self.ramp.position,
            };
        } else if ended {
            return Err(HomingFailure::NoPretwist);
        }
        Ok(None)
    }

    #[allow(clippy::too_many_arguments)]
    fn seek(
        &mut self,
        start_rad: f32,
        goal_rad: f32,
        mut low_m: Option<f32>,
        mut top_m: f32,
        mut top_rad: f32,
        shaft_rad: f32,
        acceleration: f32,
        speed_limit: f32,
    ) -> Result<Option<Homed>, HomingFailure> {
        self.ramp.step(goal_rad, SEEK_SPEED.min(speed_limit), acceleration);
        // The probe may have left the motor going the other way: only what lies ahead counts.
        let ahead = (shaft_rad - start_rad) * self.direction > -0.05;
        if self.smooth_gap_m > top_m || !ahead {
            (top_m, top_rad) = (self.smooth_gap_m, shaft_rad);
        }
        low_m = low_m.map(|low_m| low_m.min(self.smooth_gap_m));
        if low_m.is_some_and(|low_m| self.smooth_gap_m - low_m > SEEK_RISE_M) {
            low_m = None;
            (top_m, top_rad) = (self.smooth_gap_m, shaft_rad);
        }
        let fall_m = top_m - self.smooth_gap_m;
        let turned = (shaft_rad - start_rad).abs();
        if low_m.is_none() && fall_m > SEEK_FALL_M {
            self.zero_rad = top_rad;
            self.phase = Phase::CentreRest { ticks: 0 };
        } else if low_m.is_some() && (fall_m > SEEK_ASTRAY_M || turned > SEEK_STUCK) {
            return Err(HomingFailure::NoPretwist);
        } else if turned > 0.98 * SEEK_TRAVEL {
            return Err(HomingFailure::TravelEnd);
        } else {
            self.phase = Phase::Seek { start_rad, goal_rad, low_m, top_m, top_rad };
        }
        Ok(None)
    }

    /// Runs the ramp to `goal` and counts ticks of rest there.
    fn rest_at(&mut self, goal: f32, speed: f32, acceleration: f32, ticks: u16) -> u16 {
        self.ramp.step(goal, speed, acceleration);
        if self.ramp == Ramp::at(goal) { ticks + 1 } else { 0 }
    }

    fn rest_before_centre(
        &mut self,
        ticks: u16,
        acceleration: f32,
        speed_limit: f32,
    ) -> Result<Option<Homed>, HomingFailure> {
        // From the far side, where the seek came to rest, so that nothing is travelled twice.
        let goal = self.zero_rad + self.direction * SWEEP_HALF;
        let ticks = self.rest_at(goal, SEEK_SPEED.min(speed_limit), acceleration, ticks);
        self.phase = Phase::CentreRest { ticks };
        if f32::from(ticks) * TICK_S >= REST_S {
            self.centre.begin(self.zero_rad, SWEEP_HALF);
            self.phase = Phase::Centre;
        }
        Ok(None)
    }

    fn sweep_centre(&mut self, seen: &Seen, acceleration: f32) -> Result<Option<Homed>, HomingFailure> {
        // First pass away from the seek's side, second pass back.
        let side = if self.centre.pass() == 0 { -self.direction } else { self.direction };
        let goal = self.centre.middle_rad() + side * SWEEP_HALF;
        self.ramp.step(goal, SWEEP_SPEED, acceleration);
        self.centre.record(seen.shaft_then_rad, seen.gap_m);
        if self.ramp == Ramp::at(goal) && self.centre.end_pass() {
            (self.zero_rad, self.zero_error_rad) = self.centre.solve()?;
            self.phase = Phase::WeighStart { ticks: 0 };
        }
        Ok(None)
    }

    fn rest_before_weigh(
        &mut self,
        ticks: u16,
        acceleration: f32,
        speed_limit: f32,
    ) -> Result<Option<Homed>, HomingFailure> {
        let goal = self.zero_rad + PI;
        let ticks = self.rest_at(goal, WEIGH_SPEED[1].min(speed_limit), acceleration, ticks);
        self.phase = Phase::WeighStart { ticks };
        if f32::from(ticks) * TICK_S >= REST_S {
            self.weigh.begin();
            self.phase = Phase::Weigh;
        }
        Ok(None)
    }

    fn sweep_weigh(
        &mut self,
        table: &Table<'_>,
        rig: &RigConstants,
        seen: &Seen,
        acceleration: f32,
        speed_limit: f32,
    ) -> Result<Option<Homed>, HomingFailure> {
        let start = self.zero_rad + PI;
        let travel = (TAU * WEIGH_TURNS).min(table.metadata.twist_max_rad - table.metadata.twist_min_rad);
        let goal = if self.weigh.pass() == 0 { start + travel } else { start };
        let off_middle = ((self.ramp.position - start) / travel * 2.0 - 1.0).abs();
        let speed = WEIGH_SPEED[0] + (WEIGH_SPEED[1] - WEIGH_SPEED[0]) * off_middle;
        self.ramp.step(goal, speed.min(speed_limit), acceleration);
        if self.ramp.speed.abs() > 0.8 * speed.min(speed_limit) {
            self.lag_sum_s += (self.ramp.position - seen.shaft_rad) / self.ramp.speed;
            self.lag_count += 1;
        }
        let then = seen.shaft_then_rad;
        self.weigh.record((then - start) / travel, then - self.zero_rad, seen.gap_m, seen.current_a);
        if self.ramp == Ramp::at(goal) && self.weigh.end_pass() {
            self.weigh.begin_fit(table, rig, self.twist_scale);
            self.phase = Phase::Settle { ticks: 0, sum_m: 0.0, count: 0 };
        }
        Ok(None)
    }

    fn settle(
        &mut self,
        table: &Table<'_>,
        ticks: u16,
        mut sum_m: f32,
        mut count: u16,
        gap_m: f32,
        acceleration: f32,
    ) -> Result<Option<Homed>, HomingFailure> {
        let goal = self.zero_rad + PI;
        let ticks = self.rest_at(goal, SWEEP_SPEED, acceleration, ticks);
        let fitted = self.weigh.fit_step(table)?;
        if f32::from(ticks) * TICK_S > SETTLE_S {
            sum_m += gap_m;
            count += 1;
        }
        self.phase = Phase::Settle { ticks, sum_m, count };
        let averaged = f32::from(ticks) * TICK_S > SETTLE_S + REFERENCE_S;
        let Some(w) = fitted.filter(|_| averaged && count > 0) else { return Ok(None) };
        let reference_gap_m = sum_m / f32::from(count);
        // Where the load hangs after the sweeps must be where the sweeps say that it does, after a way down.
        let mechanism = Mechanism { table, twist_scale: w.twist_scale };
        let there = mechanism.at(w.load_n - w.friction_n, PI);
        let shifted_m = (reference_gap_m - w.offset_m - there.gap_m).abs();
        if shifted_m > SHIFTED_M + 2.0 * w.friction_n * there.dgap_dload_m_per_n {
            return Err(HomingFailure::Shifted);
        }
        Ok(Some(Homed {
            zero_rad: self.zero_rad,
            zero_error_rad: self.zero_error_rad,
            load_n: w.load_n,
            gap_offset_m: w.offset_m,
            twist_scale: w.twist_scale,
            friction_n: w.friction_n,
            reference_gap_m,
            drive_lag_s: (self.lag_sum_s / f32::from(self.lag_count.max(1))).clamp(0.0, 0.2),
        }))
    }
}
