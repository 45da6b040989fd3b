//! Whether a move is possible: one decision for the board, which asks it of a homed rig, and for a plan without a board.

use crate::mechanism::{Mechanism, OUTSIDE_RAD};
use crate::observer::TRAVEL_M;
use rig_link::messages::{LoadChoice, Parameter, Refusal, Setting, SettingValues};
use tsa_table::Metadata;

/// Minimum speed that can be asked of the load (m/s).
pub const SPEED_MIN_M_PER_S: f32 = 1e-5;
/// A move that is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveRequest {
    /// Wanted position (m).
    pub target_m: f32,
    /// Speed of the load on the way (m/s); infinite is as fast as it goes.
    pub speed_m_per_s: f32,
    /// Where the load's weight comes from.
    pub load: LoadChoice,
}

impl MoveRequest {
    /// The same with an infinite speed replaced by the maximum one that the settings allow.
    #[must_use]
    pub fn with_speed_max(self, settings: &SettingValues) -> Self {
        let fastest = self.speed_m_per_s == f32::INFINITY;
        Self { speed_m_per_s: if fastest { settings.get(Setting::SpeedMax) } else { self.speed_m_per_s }, ..self }
    }
}

/// Where a move would start, and what is known there.
#[derive(Clone, Copy, Debug)]
pub struct MoveStart<'a> {
    /// The table, with these strings' scale of the twist.
    pub mechanism: Mechanism<'a>,
    /// Load with which the table's mechanism is evaluated (N), as the observer shows it.
    pub mechanism_load_n: f32,
    /// Coulomb friction of the rail (N).
    pub friction_n: f32,
    /// Twist (rad).
    pub twist_rad: f32,
    /// Position (m).
    pub position_m: f32,
    /// Gap at position zero as the table counts it (m): measured, less the LVDT's offset.
    pub zero_gap_m: f32,
    /// The settings in use.
    pub settings: &'a SettingValues,
}

/// A parameter within its limits.
///
/// # Errors
/// [`Refusal::NotFinite`] or [`Refusal::OutOfRange`], naming it.
pub(crate) fn in_range(parameter: Parameter, given: f32, min: f32, max: f32) -> Result<f32, Refusal> {
    if !given.is_finite() {
        Err(Refusal::NotFinite { parameter })
    } else if (min..=max).contains(&given) {
        Ok(given)
    } else {
        Err(Refusal::OutOfRange { parameter, min, max, given })
    }
}

/// The operator's own load (N), if one is given.
///
/// # Errors
/// As [`in_range`], where the table does not cover it.
pub(crate) fn check_load(load: LoadChoice, table: &Metadata) -> Result<Option<f32>, Refusal> {
    match load {
        LoadChoice::Auto => Ok(None),
        LoadChoice::Known(load_n) => in_range(Parameter::Load, load_n, table.load_min_n, table.load_max_n).map(Some),
    }
}

impl MoveStart<'_> {
    /// Whether this move is possible from here.
    ///
    /// # Errors
    /// The refusal, naming the parameter and its limits.
    pub fn check(&self, request: &MoveRequest) -> Result<(), Refusal> {
        let table = &self.mechanism.table.metadata;
        // From outside only a jog leads back: a planned move would jump to the end of the range.
        let (twist_min_rad, twist_max_rad) = (table.twist_min_rad - OUTSIDE_RAD, table.twist_max_rad + OUTSIDE_RAD);
        in_range(Parameter::Twist, self.twist_rad, twist_min_rad, twist_max_rad)?;
        let load_n = check_load(request.load, table)?.unwrap_or(self.mechanism_load_n);
        let speed_max_m_per_s = self.settings.get(Setting::SpeedMax);
        in_range(Parameter::Speed, request.speed_m_per_s, SPEED_MIN_M_PER_S, speed_max_m_per_s)?;
        let [lowest_m, highest_m] = self.travel_m(load_n);
        let target_m = request.target_m;
        // Only the end that lies ahead counts. A load may hang a little lower than its estimate says, so targets a little below the
        // lower end are attempted; the refusal names the end that is certain.
        let possible = if target_m > self.position_m {
            target_m <= highest_m
        } else {
            target_m >= (lowest_m - TRAVEL_M).max(self.pretwist_m())
        };
        if possible {
            return Ok(());
        }
        Err(if target_m.is_finite() {
            // A load that hangs beyond an end, and not only by noise, can be brought back from where it hangs.
            let beyond = |past_m: f32, end_m: f32| if past_m > TRAVEL_M { self.position_m } else { end_m };
            let min = beyond(lowest_m - self.position_m, lowest_m);
            let max = beyond(self.position_m - highest_m, highest_m).max(min);
            Refusal::OutOfRange { parameter: Parameter::Target, min, max, given: target_m }
        } else {
            Refusal::NotFinite { parameter: Parameter::Target }
        })
    }

    /// How far down and up the strings can bring this load (m). A lighter one than at homing hangs higher at the half-turn
    /// pre-twist and cannot come down to it.
    fn travel_m(&self, load_n: f32) -> [f32; 2] {
        let position_m = |pull_n: f32, twist_rad: f32| self.zero_gap_m - self.mechanism.at(pull_n, twist_rad).gap_m;
        let lowest_m = position_m(load_n, self.mechanism.table.metadata.twist_min_rad);
        let highest_m = position_m(load_n + self.friction_n, self.mechanism.twist_max_rad());
        [lowest_m.max(self.pretwist_m()), highest_m]
    }

    /// Position of the load at homing, at the half-turn pre-twist (m): no load is let down farther.
    fn pretwist_m(&self) -> f32 {
        // Subtract from zero: negating 0.0 would print as -0.
        0.0 - self.settings.get(Setting::PositionZero)
    }
}
