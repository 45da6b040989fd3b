//! How long a move will take, before it has begun.
//!
//! Where the motor limits the speed, the speed follows TR along the way, which no closed formula gives. The way is
//! divided into pieces; TR at the middle of each piece gives its speed limit and the twist at its end.

use crate::RigConstants;
use crate::limits::Limits;
use crate::load_state::LoadState;
use crate::planner::Planner;
use tsa_table::Point;

/// Pieces of the way.
const PIECES: u8 = 16;

/// Time (s) until the planner's set-point is at its target, at a speed (m/s) at most.
pub fn time_to_target_s(planner: &Planner, asked_m_per_s: f32, load: &LoadState<'_>, rig: &RigConstants) -> f32 {
    let way_m = planner.target_m() - planner.set_point_m();
    let direction = libm::copysignf(1.0, way_m);
    let piece_m = way_m.abs() / f32::from(PIECES);
    // What the strings pull on the way: they carry friction upwards, and friction carries the load downwards.
    let load_n = load.observation.load_n + direction * load.observation.friction_n;
    let limits = |point: &Point| Limits::for_motor(asked_m_per_s, point, load_n, rig).0;
    let mut twist_rad = load.twist_rad;
    let mut point = load.observation.point;
    let first = limits(&point);
    let mut cruise_s = 0.0;
    for _ in 0..PIECES {
        let middle_rad = twist_rad + direction * 0.5 * piece_m * point.tr_rad_per_m();
        point = load.mechanism.at(load_n, middle_rad);
        twist_rad += direction * piece_m * point.tr_rad_per_m();
        cruise_s += piece_m / limits(&point).speed;
    }
    first.duration_from_s(direction * planner.speed_m_per_s(), way_m.abs(), cruise_s, &limits(&point))
}
