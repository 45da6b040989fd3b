//! How long a move will take, before it has begun.
//!
//! Where the motor limits the speed, the speed follows TR along the way, which no closed formula gives. The way is
//! divided into pieces; TR at the middle of each piece gives its speed limit and the twist at its end.

use crate::RigConstants;
use crate::limits::Limits;
use crate::mechanism::Mechanism;
use crate::planner::Planner;

/// Pieces of the way.
const PIECES: u8 = 16;

/// Time (s) until the set-point is at its target, asked to go at a speed (m/s), under a pull (N), from a twist (rad) with
/// its TR (rad/m).
pub fn time_to_target_s(
    planner: &Planner,
    asked_m_per_s: f32,
    pull_n: f32,
    mut twist_rad: f32,
    mut tr: f32,
    mechanism: &Mechanism<'_>,
    rig: &RigConstants,
) -> f32 {
    let way_m = planner.target_m() - planner.set_point_m();
    let way = libm::copysignf(1.0, way_m);
    let dx_m = way_m.abs() / f32::from(PIECES);
    let limits = |tr: f32| Limits::for_motor(asked_m_per_s, tr, pull_n, rig).0;
    let first = limits(tr);
    let mut cruise_s = 0.0;
    for _ in 0..PIECES {
        let middle_rad = twist_rad + way * 0.5 * dx_m * tr;
        tr = mechanism.at(pull_n, middle_rad).tr_rad_per_m();
        twist_rad += way * dx_m * tr;
        cruise_s += dx_m / limits(tr).speed;
    }
    first.duration_from_s(way * planner.speed_m_per_s(), way_m.abs(), cruise_s, &limits(tr))
}
