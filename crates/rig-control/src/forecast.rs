//! How long a move will take, before it has begun.
//!
//! Where the motor holds the load back the speed follows TR along the way, and no formula has that. The way is gone
//! through in a few pieces, one each tick, with the twist carried along by TR: one table lookup each.

use crate::RigConstants;
use crate::TICK_S;
use crate::limits::{Limits, PeakSearch};
use crate::mechanism::Mechanism;

/// Pieces of the way. Moves that the motor holds back then take within 5 % of what was said.
const PIECES: u8 = 4;

/// One move's time.
#[derive(Clone, Copy, Debug)]
pub struct Forecast {
    /// Sign of the way and its length (m).
    way: f32,
    distance_m: f32,
    /// Speed at its beginning, along it (m/s).
    from_m_per_s: f32,
    asked_m_per_s: f32,
    piece: u8,
    first: Option<Limits>,
    tr_rad_per_m: f32,
    twist_rad: f32,
    cruise_s: f32,
    /// Since the beginning (s).
    gone_s: f32,
    search: Option<PeakSearch>,
    total_s: Option<f32>,
}

impl Forecast {
    /// A way (m) at a speed (m/s) at most, beginning at a speed (m/s).
    pub fn new(way_m: f32, from_m_per_s: f32, asked_m_per_s: f32) -> Self {
        let way = libm::copysignf(1.0, way_m);
        Self {
            way,
            distance_m: way_m.abs(),
            from_m_per_s: way * from_m_per_s,
            asked_m_per_s,
            piece: 0,
            first: None,
            tr_rad_per_m: 0.0,
            twist_rad: 0.0,
            cruise_s: 0.0,
            gone_s: 0.0,
            search: None,
            total_s: None,
        }
    }

    /// What is left (s) once it has begun; `None` until that is worked out.
    pub fn left_s(&self) -> Option<f32> {
        self.total_s.map(|total_s| (total_s - self.gone_s).max(0.0))
    }

    /// A tick of the way has gone.
    pub fn tick(&mut self) {
        self.gone_s += TICK_S;
    }

    /// Works on under a pull (N), from a twist (rad) with its TR (rad/m). At most one table lookup.
    pub fn work(&mut self, pull_n: f32, twist_rad: f32, tr: f32, mechanism: &Mechanism<'_>, rig: &RigConstants) {
        if self.total_s.is_some() {
            return;
        }
        let Some(first) = self.first else {
            (self.twist_rad, self.tr_rad_per_m) = (twist_rad, tr);
            self.first = Some(Limits::for_motor(self.asked_m_per_s, tr, pull_n, rig).0);
            return;
        };
        if let Some(search) = &mut self.search {
            self.total_s = search.step(&first);
            return;
        }
        if self.piece == PIECES {
            let last = Limits::for_motor(self.asked_m_per_s, self.tr_rad_per_m, pull_n, rig).0;
            match first.duration_from_s(self.from_m_per_s, self.distance_m, self.cruise_s, &last) {
                Ok(total_s) => self.total_s = Some(total_s),
                Err(search) => self.search = Some(search),
            }
            return;
        }
        let dx_m = self.distance_m / f32::from(PIECES);
        let middle_rad = self.twist_rad + self.way * 0.5 * dx_m * self.tr_rad_per_m;
        self.tr_rad_per_m = mechanism.at(pull_n, middle_rad).tr_rad_per_m();
        self.twist_rad += self.way * dx_m * self.tr_rad_per_m;
        let (limits, _) = Limits::for_motor(self.asked_m_per_s, self.tr_rad_per_m, pull_n, rig);
        self.cruise_s += dx_m / limits.speed;
        self.piece += 1;
    }
}
