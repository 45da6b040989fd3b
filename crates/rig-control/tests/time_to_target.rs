//! The time that is told for a move, against the planner tick by tick.

mod common;

use common::{constants, hanging};
use rig_control::TICK_S;
use rig_control::limits::Limits;
use rig_control::planner::Planner;
use rig_control::time_to_target::time_to_target_s;

const LOAD_N: f32 = 5.0;

#[test]
fn the_time_to_the_target_is_that_of_the_plan_step_by_step() {
    let rig = constants();
    for (from_rad, way_m, asked) in [(4.0, 0.012, 0.002), (4.0, 0.012, 0.02), (40.0, -0.008, 0.02), (30.0, 5e-4, 0.01)]
    {
        let load = hanging(LOAD_N, 0.0, from_rad);
        let mut planner = Planner::at(0.0);
        planner.go_to(way_m);
        let expected_s = time_to_target_s(&planner, asked, &load, &rig);
        let (mut twist_rad, mut ticks, mut last_m) = (from_rad, 0u16, 0.0);
        while !planner.is_at_rest() {
            let point = load.mechanism.at(LOAD_N, twist_rad);
            let set_point = planner.step(&Limits::for_motor(asked, &point, LOAD_N, &rig).0);
            twist_rad += (set_point.position_m - last_m) * point.tr_rad_per_m();
            last_m = set_point.position_m;
            ticks += 1;
        }
        let took_s = f32::from(ticks) * TICK_S;
        println!("{way_m} m at {asked} m/s: {expected_s:.3} s expected, {took_s:.3} s taken");
        assert!((expected_s - took_s).abs() < 0.05 + 0.02 * took_s, "{expected_s} s expected, {took_s} s taken");
    }
}
