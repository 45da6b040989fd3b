//! A load at its target: whether it stands, which error stiction does not let the loop reduce, and when it is left alone.
//!
//! A load that breaks loose from stiction jumps by J = 2 (Fs − Fc)/k, and J cannot be made smaller by waiting. An error below
//! half of a jump is therefore left alone: after another jump it would be no smaller. J is known from homing where the load
//! stuck and slipped there, and is seen at rest: a way that takes a resting load from one side of its target to the other is a jump.
//! What the strings have turned is not subtracted from it, because they also turn to break the load loose.

use crate::homing::NINETY_PERCENT;
use crate::load_state::LoadState;
use crate::observer::SETTLED_TICKS;
use rig_link::messages::HomingResult;

/// Ticks in which a load has not left its place, after which it stands. Its speed is not asked: the observer expects a load
/// that sticks to go along with its strings.
const STILL_TICKS: u16 = 8;

/// What a load at its target does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Standing {
    /// It moves, or is not at its target yet.
    Moves,
    /// It stands, by so much beside its target (m).
    Beside(f32),
    /// It stands, and is left alone.
    LeftAlone,
}

/// What is known of it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rest {
    /// Error since it has not left its place, averaged (m), of the last tick (m), and for how many ticks.
    error_m: f32,
    last_m: f32,
    ticks: u16,
    stands: bool,
    left_alone: bool,
    /// Error (m) where it last stood at this target.
    stood_m: Option<f32>,
    /// How far it jumps (m), as seen at this target.
    jump_m: Option<f32>,
}

impl Rest {
    /// Error (m) below which a load at rest is left alone: half a jump, because stiction does not let the loop reduce it, and what is
    /// noise. Until a jump is seen at this target, jumps are as long as homing found them.
    pub fn left_alone_m(&self, found: &HomingResult) -> f32 {
        (NINETY_PERCENT * found.gap_noise_m).max(0.5 * self.jump_m.unwrap_or(found.jump_m))
    }

    /// One tick; `done` when the set-point is at its target, and the error (m) of the load there.
    pub fn step(&mut self, done: bool, error_m: f32, load: &LoadState<'_>) -> Standing {
        let near_m = self.left_alone_m(load.found);
        let recent_m = 0.5 * (error_m + core::mem::replace(&mut self.last_m, error_m));
        let still = self.ticks == 0 || (recent_m - self.error_m).abs() < load.moved_m();
        if done && !still && self.left_alone && recent_m.abs() < near_m {
            // It has moved within what is left alone, or noise looks so.
            (self.ticks, self.error_m) = (1, recent_m);
            return Standing::LeftAlone;
        }
        if !(done && still) {
            // Stiction of one and a half times the friction makes a jump of friction over stiffness: what is farther has another cause.
            let longest_jump_m = load.found.friction_n * load.observation.point.dgap_dload_m_per_n;
            if !done || error_m.abs() > longest_jump_m {
                (self.stood_m, self.jump_m) = (None, None);
            }
            (self.ticks, self.stands, self.left_alone) = (0, false, false);
            return Standing::Moves;
        }
        self.ticks = (self.ticks + 1).min(SETTLED_TICKS);
        self.error_m += (error_m - self.error_m) / f32::from(self.ticks);
        let stood = self.stands;
        self.stands |= self.ticks >= STILL_TICKS;
        if !self.stands {
            return Standing::Moves;
        }
        if !stood
            && let Some(before_m) = self.stood_m
            && before_m * self.error_m < 0.0
        {
            self.jump_m = Some((before_m - self.error_m).abs());
        }
        self.stood_m = Some(self.error_m);
        self.left_alone = self.error_m.abs() < near_m;
        if self.left_alone { Standing::LeftAlone } else { Standing::Beside(self.error_m) }
    }
}
