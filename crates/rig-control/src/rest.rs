//! A load at its target: whether it stands, which error stiction does not let the loop reduce, and when it is left alone.
//!
//! A load that breaks loose from stiction jumps by J = 2 (Fs − Fc)/k, and J cannot be made smaller by waiting. An error below
//! half of a jump is therefore left alone: after another jump it would be no smaller. J is known from homing where the load
//! stuck and slipped there, and is seen at rest: what it moves from one stand to another, past its target, without its strings having
//! turned for it, is a jump.

use crate::homing::NINETY_PERCENT;
use crate::load_state::LoadState;
use crate::observer::SETTLED_TICKS;

/// Ticks in which a load has not left its place, after which it stands. Its speed is not asked: the observer expects a load
/// that sticks to go along with its strings.
const STILL_TICKS: u16 = 8;
/// Ways past the target after which a load is taken to go back and forth.
const WAYS_PAST: u8 = 4;

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
    /// Error (m) where it last stood, and the twist (rad) until then.
    stood: Option<[f32; 2]>,
    /// How far it jumps (m), as seen at rest.
    jump_m: Option<f32>,
    /// Ways past the target since it was given or the load was left alone.
    ways_past: u8,
}

impl Rest {
    /// Error (m) below which a load at rest is left alone: half a jump, because stiction does not let the loop reduce it, where homing
    /// saw jumps so long (m); and what is noise, with a noise of the gap in one tick (m, rms).
    pub fn left_alone_m(&self, noise_m: f32, jump_m: f32) -> f32 {
        (NINETY_PERCENT * noise_m).max(0.5 * self.jump_m.unwrap_or(jump_m))
    }

    /// One tick; `done` when the set-point is at its target, and the error (m) of the load there.
    pub fn step(&mut self, done: bool, error_m: f32, load: &LoadState<'_>) -> Standing {
        let noise_m = load.gap_noise_m;
        let near_m = self.left_alone_m(noise_m, load.jump_m);
        let recent_m = 0.5 * (error_m + core::mem::replace(&mut self.last_m, error_m));
        let still = self.ticks == 0 || (recent_m - self.error_m).abs() < load.moved_m();
        if done && !still && self.left_alone && recent_m.abs() < near_m {
            // It has moved within what is left alone, or noise looks so.
            (self.ticks, self.error_m) = (1, recent_m);
            return Standing::LeftAlone;
        }
        if !(done && still) {
            // Stiction of one and a half times the friction makes a jump of friction over stiffness: what is farther has another cause.
            let longest_jump_m = load.observation.friction_n * load.observation.point.dgap_dload_m_per_n;
            if !done || error_m.abs() > longest_jump_m {
                (self.stood, self.ways_past) = (None, 0);
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
        if !stood {
            self.see_way(load);
        }
        self.stood = Some([self.error_m, load.twist_rad]);
        self.left_alone = self.error_m.abs() < near_m;
        if self.left_alone {
            self.ways_past = 0;
            Standing::LeftAlone
        } else {
            Standing::Beside(self.error_m)
        }
    }

    /// The load stands again. A load without stiction swings at most twice as far as its strings have turned; what it has risen
    /// more than that, it has jumped, if that took it past the target. Short of the target, its jumps are no longer than this way.
    /// After some ways past the target the whole way counts as a jump, whatever made it so long, or the load would go back and
    /// forth for ever.
    fn see_way(&mut self, load: &LoadState<'_>) {
        let Some([before_m, before_rad]) = self.stood else { return };
        let rise_m = before_m - self.error_m;
        let turned_m = (load.twist_rad - before_rad) / load.observation.point.tr_rad_per_m();
        let jump_m = ((rise_m - 2.0 * turned_m) * libm::copysignf(1.0, rise_m)).clamp(0.0, rise_m.abs());
        if rise_m.abs() < load.moved_m() {
            return;
        }
        let past = self.error_m * before_m < 0.0;
        self.ways_past = self.ways_past.saturating_add(past.into());
        self.jump_m = if past && self.ways_past >= WAYS_PAST {
            Some(rise_m.abs())
        } else if past {
            Some(jump_m)
        } else {
            self.jump_m.map(|m| m.min(rise_m.abs()))
        };
    }
}
