//! How well streamed set-points are followed.

use host_tests::load_changes;
use host_tests::rigs::subject::Subject;
use rig_link::messages::{EventKind, LoadChoice};
use rig_plant::RigPreset;
use rigctl::trajectory::Trajectory;

/// A rig of its own model, homed under a load (kg), at a position (m).
fn at(load_kg: f64, position_m: f32) -> host_tests::ControlBench {
    let mut bench = load_changes::homed_under(&Subject::new(RigPreset::Ideal, 5), load_kg).unwrap();
    bench.move_to(position_m, 0.003, LoadChoice::Auto).unwrap();
    bench.events.clear();
    bench
}

#[test]
fn courses_of_the_scenarios_are_followed() {
    for (name, load_kg, allowed_m) in
        [("sine", 0.5, 80e-6), ("sine", 1.2, 80e-6), ("chirp", 0.5, 80e-6), ("hand", 0.5, 150e-6)]
    {
        let trajectory = Trajectory::load(&host_tests::root().join(format!("scenarios/{name}.csv")));
        let trajectory = trajectory.unwrap_or_else(|e| panic!("{:?}", e.message()));
        let mut bench = at(load_kg, trajectory.start_m() as f32);
        let mut points = trajectory.set_points().peekable();
        let ticks = (100.0 * trajectory.duration_s()) as u32;
        let mut square = 0.0;
        for k in 0..ticks {
            let t_s = 0.01 * f64::from(k);
            let due = points.next_if(|(at_s, _)| *at_s <= t_s + 1e-9).map(|(_, request)| request);
            let reply = bench.tick(due).reply;
            assert!(!matches!(reply, Some(Err(_))), "{reply:?}");
            square += (bench.true_position_m() - trajectory.at(t_s + 0.01).0).powi(2);
        }
        let rms_m = (square / f64::from(ticks)).sqrt();
        println!("{name} under {load_kg} kg: {:.0} um rms", rms_m * 1e6);
        assert!(rms_m < allowed_m, "{name} under {load_kg} kg: {rms_m} m");
        assert!(!bench.events.iter().any(|(_, kind)| matches!(kind, EventKind::StreamEnded(_))), "{:?}", bench.events);
    }
}
