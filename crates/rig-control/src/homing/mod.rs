//! Homing without switches: the gap is even in the twist and has its maximum at zero (docs/explanation/model.md section 5).
//!
//! ```text
//! Quiet ── the load has stopped oscillating ──> Probe
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
pub mod load_estimate;
mod quiet;
mod rises;
mod stick_slip;
mod sweeps;

use crate::constants::TwistLimits;
use crate::mechanism::Mechanism;
use crate::observer::{SETTLED_TICKS, TRAVEL_M};
use crate::ramp::Ramp;
use crate::{RigConstants, TICK_S};
use core::f32::consts::{PI, TAU};
use load_estimate::{LoadEstimate, MIN_GAP_ERROR_M};
use quiet::Quiet;
use rig_link::messages::{HomingFailure, HomingResult, LoadChoice};
use rises::Rises;
use stick_slip::StickSlip;
use sweeps::Sweeps;
use tsa_table::Table;

/// Fraction of a new reading in the smoothed gap.
const SMOOTHING: f32 = 0.25;
/// A load that still oscillates after it has been waited for so long (s), in all, is homed all the same; the result is judged at
/// the end.
const QUIET_PATIENCE_S: f32 = 10.0;
/// Longest probe, as a fraction of the travel of the search for the maximum: 18 rad of [`SEEK_TRAVEL`]. Rail friction holds the load
/// over several radians: 0.1 N under 0.5 N highly twisted for 6 rad, and 1 N under 15 N from one side of zero twist to the other; on
/// thin strings, which have more turns, over more. Against a jammed load the whole probe adds some 8 N. A gap that does not rise over
/// so long a turn of the search is that of a jammed load.
const PROBE_FRACTION: f32 = 0.24;
/// Speed of all of it (rad/s): a faster homing fails on more hard plants.
pub const SPEED: f32 = 6.5;
/// Fraction of the motor's speed that homing uses at most: friction and the spread of the torque constant may take the rest.
pub const MOTOR_FRACTION: f32 = 0.9;
/// A shaft that is this far (rad) behind its set-point stands against fully closed strings: more than any drive lags at this
/// speed, and little enough to turn back before the drive takes it for a stall and drops the load.
const PROBE_BEHIND: f32 = 0.5;
/// Farthest from the power-up twist that the maximum is looked for (rad), unless the table has more twist ([`seek_travel`]), and
/// what the probe went astray aside.
const SEEK_TRAVEL: f32 = 12.0 * TAU;
/// Half the width of the sweeps across the maximum (rad).
pub const SWEEP_HALF: f32 = 5.0;
/// Turns past the half-turn pre-twist that the load is weighed over.
pub const LOAD_TURNS: f32 = 6.0;
/// Acceleration of all of it, and of a jog (rad/s²): so little that a load hardly swings.
pub(crate) const ACCELERATION: f32 = 25.0;
/// Longest homing (s), start-up of the drive not counted, on strings that the search for the maximum turns by [`SEEK_TRAVEL`].
const TIME_OUT_S: f32 = 42.0;

/// Half the width of the interval that holds the truth in 90 of 100 cases, over the standard error.
pub const NINETY_PERCENT: f32 = 1.645;

/// Result of a homing, as the board goes on with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homed {
    /// Shaft angle at zero twist (rad, as the encoder counts).
    pub zero_rad: f32,
    /// What the host is told.
    pub found: HomingResult,
    /// The load fits best beyond the table's range, at whose end the estimate stands.
    pub beyond_range: bool,
    /// Heaviest load that the rods remembered in the fit (N); 0 where the load was given, because then the strings' scale
    /// has taken up what they remember.
    pub heaviest_n: f32,
}

/// Inputs of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingInputs {
    /// Shaft angle by the encoder (rad).
    pub shaft_rad: f32,
    /// Shaft angle when the gap was measured, a little earlier (rad).
    pub shaft_at_gap_rad: f32,
    /// Measured gap (m).
    pub gap_m: f32,
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    Quiet(Quiet),
    Probe { start_rad: f32, gap_m: f32 },
    Seek(Seek),
    CentreRest,
    Centre,
    LoadRest,
    LoadEstimate,
    Settle { quiet: Quiet, rest: Rest },
}

/// The search for the maximum gap.
#[derive(Clone, Copy, Debug)]
struct Seek {
    start_rad: f32,
    /// Minimum gap (m); `None` once the gap has risen from it.
    low_m: Option<f32>,
    /// Maximum gap (m), and the shaft angle there (rad).
    top_m: f32,
    top_rad: f32,
    rises: Rises,
}

/// Gaps of a load at rest, from the first one.
#[derive(Clone, Copy, Debug, Default)]
struct Rest {
    first_m: f32,
    sum_m: f32,
    squares_m2: f32,
    count: f32,
}

impl Rest {
    fn add(&mut self, gap_m: f32) {
        if self.count == 0.0 {
            self.first_m = gap_m;
        }
        let from_first_m = gap_m - self.first_m;
        self.sum_m += from_first_m;
        self.squares_m2 += from_first_m * from_first_m;
        self.count += 1.0;
    }

    /// Mean and rms deviation (m).
    fn mean_and_noise_m(&self) -> (f32, f32) {
        let mean_m = self.sum_m / self.count;
        (self.first_m + mean_m, libm::sqrtf((self.squares_m2 / self.count - mean_m * mean_m).max(0.0)))
    }
}

/// One homing.
#[derive(Clone, Debug)]
pub struct Homing {
    phase: Phase,
    limits: TwistLimits,
    /// Shaft set-point (rad) and speed (rad/s).
    pub ramp: Ramp,
    /// Ticks that the set-point has rested where it was going.
    rest_ticks: u16,
    /// Gap smoothed over some 40 ms, for decisions that need no precision.
    smooth_gap_m: f32,
    /// +1 or −1: the direction in which the gap grew.
    direction: f32,
    ticks: u32,
    /// Ticks in which the load has been waited for.
    waited: u16,
    /// Across the maximum. Their angles count from where the search found it.
    centre: Sweeps<{ centre::BINS }>,
    load_estimate: LoadEstimate,
    stick_slip: StickSlip,
    zero_rad: f32,
    zero_error_rad: f32,
    lag_sum_s: f32,
    lag_count: u16,
}

/// Farthest from the power-up twist (rad) that the maximum of strings with such a maximum twist (rad) is looked for.
fn seek_travel(twist_max_rad: f32) -> f32 {
    SEEK_TRAVEL.max(twist_max_rad)
}

/// Farthest (rad) that such strings are turned to find the direction in which the gap grows.
fn probe_travel(twist_max_rad: f32) -> f32 {
    PROBE_FRACTION * seek_travel(twist_max_rad)
}

/// Longest homing (s) of strings with such a maximum twist (rad), start-up of the drive not counted. It includes a probe in the wrong
/// direction, and the way back.
pub fn time_out_s(twist_max_rad: f32) -> f32 {
    TIME_OUT_S + (1.0 + 2.0 * PROBE_FRACTION) * (seek_travel(twist_max_rad) - SEEK_TRAVEL) / SPEED
}

impl Homing {
    /// Starts from a shaft angle (rad) and a gap (m), within limits and expecting a scale of the twist. `load` is what the
    /// operator says of the load's weight, `heaviest_n` the heaviest load that the rods remember (N).
    pub fn new(
        motor: TwistLimits,
        shaft_rad: f32,
        gap_m: f32,
        twist_scale: f32,
        load: LoadChoice,
        heaviest_n: f32,
    ) -> Self {
        let speed = SPEED.min(MOTOR_FRACTION * motor.speed);
        Self {
            phase: Phase::Quiet(Quiet::default()),
            limits: TwistLimits { speed, acceleration: ACCELERATION.min(motor.acceleration) },
            ramp: Ramp::at(shaft_rad),
            rest_ticks: 0,
            smooth_gap_m: gap_m,
            direction: 1.0,
            ticks: 0,
            waited: 0,
            centre: Sweeps::NEW,
            load_estimate: LoadEstimate::new(twist_scale, load, heaviest_n),
            stick_slip: StickSlip::default(),
            zero_rad: 0.0,
            zero_error_rad: 0.0,
            lag_sum_s: 0.0,
            lag_count: 0,
        }
    }

    /// One tick; the result once the shaft stands at the half-turn pre-twist.
    ///
    /// # Errors
    /// Why it is given up.
    pub fn step(
        &mut self,
        table: &Table<'_>,
        rig: &RigConstants,
        inputs: &HomingInputs,
    ) -> Result<Option<Homed>, HomingFailure> {
        let HomingInputs { shaft_rad, shaft_at_gap_rad, gap_m } = *inputs;
        self.ticks += 1;
        let twist_max_rad = table.metadata.twist_max_rad;
        if self.ticks as f32 * TICK_S > time_out_s(twist_max_rad) {
            return Err(HomingFailure::TimeOut);
        }
        self.smooth_gap_m += SMOOTHING * (gap_m - self.smooth_gap_m);
        self.phase = match self.phase {
            Phase::Quiet(quiet) => self.wait_for_quiet(quiet),
            Phase::Probe { start_rad, gap_m } => self.probe(start_rad, gap_m, shaft_rad, twist_max_rad)?,
            Phase::Seek(seek) => self.seek(seek, shaft_rad, twist_max_rad)?,
            // From the far side, where the seek came to rest, so that nothing is travelled twice.
            Phase::CentreRest => match self.has_rested_at(self.zero_rad + self.direction * SWEEP_HALF) {
                true => Phase::Centre,
                false => Phase::CentreRest,
            },
            Phase::Centre => self.sweep_centre(shaft_at_gap_rad, gap_m)?,
            Phase::LoadRest => match self.has_rested_at(self.zero_rad + PI) {
                true => Phase::LoadEstimate,
                false => Phase::LoadRest,
            },
            Phase::LoadEstimate => self.sweep_weigh(table, rig, inputs),
            Phase::Settle { quiet, rest } => return self.settle(table, quiet, rest, gap_m),
        };
        Ok(None)
    }

    /// Runs the ramp on to `goal`; whether it rests there.
    fn turn_to(&mut self, goal: f32) -> bool {
        self.ramp.step(goal, self.limits.speed, self.limits.acceleration);
        self.ramp == Ramp::at(goal)
    }

    /// One tick of a load that is waited for; whether it is quiet, or has been waited for long enough.
    fn is_quiet(&mut self, quiet: &mut Quiet) -> bool {
        self.waited += 1;
        quiet.step(self.smooth_gap_m) || f32::from(self.waited) * TICK_S > QUIET_PATIENCE_S
    }

    /// A load that has just dropped swings for seconds, farther than the probe can tell from its own doing.
    fn wait_for_quiet(&mut self, mut quiet: Quiet) -> Phase {
        if self.is_quiet(&mut quiet) {
            Phase::Probe { start_rad: self.ramp.position, gap_m: self.smooth_gap_m }
        } else {
            Phase::Quiet(quiet)
        }
    }

    fn probe(
        &mut self,
        start_rad: f32,
        gap_m: f32,
        shaft_rad: f32,
        twist_max_rad: f32,
    ) -> Result<Phase, HomingFailure> {
        let ended = self.turn_to(start_rad + probe_travel(twist_max_rad));
        let change = self.smooth_gap_m - gap_m;
        let closed = self.ramp.position - shaft_rad > PROBE_BEHIND;
        if closed {
            // Only more twist meets such a resistance. From where the shaft is: the motor lets go at once.
            self.ramp = Ramp::at(shaft_rad);
        }
        if closed || change.abs() > TRAVEL_M || (ended && change.abs() > 0.1 * TRAVEL_M) {
            self.direction = if closed { -1.0 } else { libm::copysignf(1.0, change) };
            return Ok(Phase::Seek(Seek {
                start_rad: self.ramp.position,
                low_m: Some(self.smooth_gap_m.min(gap_m)),
                top_m: self.smooth_gap_m,
                top_rad: self.ramp.position,
                rises: Rises::default(),
            }));
        }
        if ended { Err(HomingFailure::NoPretwist) } else { Ok(Phase::Probe { start_rad, gap_m }) }
    }

    fn seek(&mut self, mut seek: Seek, shaft_rad: f32, twist_max_rad: f32) -> Result<Phase, HomingFailure> {
        let travel = seek_travel(twist_max_rad) + probe_travel(twist_max_rad);
        self.turn_to(seek.start_rad + self.direction * travel);
        // The probe may have left the motor going the other way: only what lies ahead counts.
        let ahead = (shaft_rad - seek.start_rad) * self.direction > -0.05;
        seek.low_m = seek.low_m.map(|low_m| low_m.min(self.smooth_gap_m));
        // A light load that has just torn loose from friction goes up for a while when the motor has already turned back: no fall
        // counts before the gap has risen from its least.
        let rises = seek.low_m.is_some_and(|low_m| self.smooth_gap_m - low_m > TRAVEL_M);
        if rises {
            seek.low_m = None;
        }
        if self.smooth_gap_m > seek.top_m || !ahead || rises {
            (seek.top_m, seek.top_rad) = (self.smooth_gap_m, shaft_rad);
        }
        if seek.low_m.is_none() && ahead && seek.rises.step(shaft_rad, self.smooth_gap_m) {
            return Err(HomingFailure::LvdtReversed);
        }
        let fall_m = seek.top_m - self.smooth_gap_m;
        let turned = (shaft_rad - seek.start_rad).abs();
        if seek.low_m.is_none() && fall_m > TRAVEL_M {
            self.zero_rad = seek.top_rad;
            Ok(Phase::CentreRest)
        } else if seek.low_m.is_some() && (fall_m > 10.0 * TRAVEL_M || turned > probe_travel(twist_max_rad)) {
            // This is not the way to zero twist: more of it would close the strings.
            Err(HomingFailure::NoPretwist)
        } else if turned > 0.98 * travel {
            Err(HomingFailure::TravelEnd)
        } else {
            Ok(Phase::Seek(seek))
        }
    }

    /// Runs the ramp on to `goal`; whether it has rested there for a while.
    fn has_rested_at(&mut self, goal: f32) -> bool {
        self.rest_ticks = if self.turn_to(goal) { self.rest_ticks + 1 } else { 0 };
        self.rest_ticks >= SETTLED_TICKS
    }

    fn sweep_centre(&mut self, shaft_at_gap_rad: f32, gap_m: f32) -> Result<Phase, HomingFailure> {
        // First pass away from the seek's side, second pass back.
        let side = if self.centre.pass == 0 { -self.direction } else { self.direction };
        let ended = self.turn_to(self.zero_rad + side * SWEEP_HALF);
        let from_top_rad = shaft_at_gap_rad - self.zero_rad;
        self.centre.record((from_top_rad / SWEEP_HALF + 1.0) * 0.5, from_top_rad, gap_m);
        if ended && self.centre.end_pass() {
            let (middle_rad, error_rad) = centre::middle(&self.centre)?;
            self.zero_rad += middle_rad;
            self.zero_error_rad = error_rad;
            self.rest_ticks = 0;
            return Ok(Phase::LoadRest);
        }
        Ok(Phase::Centre)
    }

    fn sweep_weigh(&mut self, table: &Table<'_>, rig: &RigConstants, inputs: &HomingInputs) -> Phase {
        let HomingInputs { shaft_rad, shaft_at_gap_rad, gap_m } = *inputs;
        let start = self.zero_rad + PI;
        let travel = (TAU * LOAD_TURNS).min(table.metadata.twist_max_rad - table.metadata.twist_min_rad);
        let ended = self.turn_to(if self.load_estimate.sweeps.pass == 0 { start + travel } else { start });
        if self.ramp.speed.abs() > 0.8 * self.limits.speed {
            self.lag_sum_s += (self.ramp.position - shaft_rad) / self.ramp.speed;
            self.lag_count += 1;
            self.stick_slip.add(gap_m);
        } else {
            self.stick_slip.turn();
        }
        self.load_estimate.sweeps.record((shaft_at_gap_rad - start) / travel, shaft_at_gap_rad - self.zero_rad, gap_m);
        if ended && self.load_estimate.sweeps.end_pass() {
            self.load_estimate.begin_fit(table, rig);
            return Phase::Settle { quiet: Quiet::default(), rest: Rest::default() };
        }
        Phase::LoadEstimate
    }

    fn settle(
        &mut self,
        table: &Table<'_>,
        mut quiet: Quiet,
        mut rest: Rest,
        gap_m: f32,
    ) -> Result<Option<Homed>, HomingFailure> {
        let fitted = self.load_estimate.fit_step(table)?;
        // A load that moves, because it still swings or because its weight is changed, is averaged anew.
        if self.is_quiet(&mut quiet) {
            rest.add(gap_m);
        } else {
            rest = Rest::default();
        }
        let averaged = rest.count > f32::from(SETTLED_TICKS);
        let Some(w) = fitted.filter(|_| averaged) else {
            self.phase = Phase::Settle { quiet, rest };
            return Ok(None);
        };
        let (reference_gap_m, noise_m) = rest.mean_and_noise_m();
        // What the converter cannot resolve may look like no noise at all.
        let gap_noise_m = noise_m.max(MIN_GAP_ERROR_M);
        // Where the load hangs after the sweeps must be where the sweeps say that it does, after a way down.
        let mechanism = Mechanism { table: *table, twist_scale: w.twist_scale, curve: w.curve };
        let there = mechanism.at(w.apparent_n - w.friction_n, PI);
        let shifted_m = (reference_gap_m - there.gap_m).abs();
        // Friction aside, swinging and creep make less than twice what counts as travel, and a string that slips in its clamp
        // makes more.
        if shifted_m > 2.0 * (TRAVEL_M + w.friction_n * there.dgap_dload_m_per_n) {
            return Err(HomingFailure::Shifted);
        }
        Ok(Some(Homed {
            zero_rad: self.zero_rad,
            beyond_range: w.beyond_range,
            heaviest_n: self.load_estimate.heaviest_n,
            found: HomingResult {
                zero_error_rad: self.zero_error_rad,
                load_n: w.load_n,
                load_error_n: NINETY_PERCENT * w.load_sigma_n,
                friction_n: w.friction_n,
                reference_gap_m,
                gap_noise_m,
                jump_m: self.stick_slip.jump_m(gap_noise_m),
                twist_scale: w.twist_scale,
                curve: w.curve,
                covariance: w.covariance,
                drive_lag_s: (self.lag_sum_s / f32::from(self.lag_count.max(1))).clamp(0.0, 0.2),
            },
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a search that has turned so far (rad) does at gaps (m) one after the other, counted from where it began, on strings with
    /// such a maximum twist (rad).
    fn seeks_on(twist_max_rad: f32, turned_rad: f32, gaps_m: &[f32]) -> Result<Phase, HomingFailure> {
        let motor = TwistLimits { speed: 2.0 * SPEED, acceleration: ACCELERATION };
        let mut homing = Homing::new(motor, 0.0, 0.1, 1.0, LoadChoice::Auto, 0.0);
        let (low_m, top_m) = (Some(0.1), 0.1);
        let mut phase = Phase::Seek(Seek { start_rad: 0.0, low_m, top_m, top_rad: 0.0, rises: Rises::default() });
        for gap_m in gaps_m {
            let Phase::Seek(seek) = phase else { panic!("it has ended before") };
            homing.smooth_gap_m = 0.1 + gap_m;
            phase = homing.seek(seek, turned_rad, twist_max_rad)?;
        }
        Ok(phase)
    }

    fn seeks(turned_rad: f32, gaps_m: &[f32]) -> Result<Phase, HomingFailure> {
        seeks_on(50.0, turned_rad, gaps_m)
    }

    #[test]
    fn the_search_ends_past_a_maximum_and_gives_up_the_wrong_way_and_at_the_end_of_its_travel() {
        // Up by more than what counts as travel, and then down by it.
        assert!(matches!(seeks(1.0, &[0.31e-3, 2e-3, 1.71e-3]), Ok(Phase::Seek(_))));
        assert!(matches!(seeks(1.0, &[0.31e-3, 2e-3, 1.69e-3]), Ok(Phase::CentreRest)));
        // A fall counts only after a rise, until it is so long that this is not the way.
        assert!(matches!(seeks(1.0, &[0.29e-3, -2e-3]), Ok(Phase::Seek(_))));
        assert_eq!(seeks(1.0, &[-2e-3, -2.99e-3]).err(), None);
        assert_eq!(seeks(1.0, &[-2e-3, -3.01e-3]).err(), Some(HomingFailure::NoPretwist));
        // A load that does not rise.
        for (twist_max_rad, probe) in [(50.0, 18.1), (150.0, 36.0)] {
            assert_eq!(seeks_on(twist_max_rad, 0.99 * probe, &[0.0]).err(), None);
            assert_eq!(seeks_on(twist_max_rad, 1.01 * probe, &[0.0]).err(), Some(HomingFailure::NoPretwist));
        }
        // One that rises all the way.
        let travel_end = Some(HomingFailure::TravelEnd);
        for (twist_max_rad, travel) in [(50.0, 75.4 + 18.1), (150.0, 150.0 + 36.0)] {
            assert_eq!(seeks_on(twist_max_rad, 0.97 * travel, &[1e-3]).err(), None);
            assert_eq!(seeks_on(twist_max_rad, 0.99 * travel, &[1e-3]).err(), travel_end);
        }
    }

    #[test]
    fn strings_of_more_turns_have_as_much_longer_to_be_homed() {
        assert_eq!(time_out_s(50.0), TIME_OUT_S);
        // 10 s longer to search, and a quarter of it there and back.
        let longer = SEEK_TRAVEL + 10.0 * SPEED;
        assert!((time_out_s(longer) - TIME_OUT_S - 14.8).abs() < 1e-3);
    }
}
