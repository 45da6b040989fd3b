//! How well streamed set-points are followed.

use host_tests::rigs::subject::Subject;
use host_tests::{ControlBench, load_changes};
use rig_link::messages::{EventKind, Limit, LoadChoice, Request};
use rig_plant::RigPreset;
use rigctl::trajectory::Trajectory;

/// A rig of its own model, homed under a load (kg), at a position (m).
fn at(load_kg: f64, position_m: f32) -> ControlBench {
    on(RigPreset::Ideal, load_kg, position_m)
}

/// The same on another kind of rig.
fn on(rig: RigPreset, load_kg: f64, position_m: f32) -> ControlBench {
    let mut bench = load_changes::homed_under(&Subject::new(rig, 5), load_kg).unwrap();
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

/// Fraction of the time in which a small sine (0.2 mm) at a frequency (Hz) under 1.2 kg shows that friction limits it, and the
/// range of the load's motion (m).
fn small_sine(rig: RigPreset, frequency_hz: f32) -> (f64, f64) {
    let mut bench = on(rig, 1.2, 0.008);
    let (mut limited, mut range_m, ticks) = (0, [f64::INFINITY, f64::NEG_INFINITY], 600u16);
    for k in 0..ticks {
        let phase = std::f32::consts::TAU * frequency_hz * 0.01 * f32::from(k);
        let request = (k % 2 == 0).then(|| Request::Track {
            position_m: 0.008 + 0.2e-3 * phase.sin(),
            speed_m_per_s: 0.2e-3 * std::f32::consts::TAU * frequency_hz * phase.cos(),
            for_s: 0.1,
        });
        limited += u16::from(bench.tick(request).telemetry.limit == Some(Limit::Friction));
        let position_m = bench.true_position_m();
        if k > ticks / 2 {
            range_m = [range_m[0].min(position_m), range_m[1].max(position_m)];
        }
    }
    (f64::from(limited) / f64::from(ticks), range_m[1] - range_m[0])
}

#[test]
fn a_sine_that_is_too_small_and_fast_for_the_rails_friction_says_so() {
    for frequency_hz in [0.4, 0.8, 1.25, 2.0] {
        for rig in [RigPreset::Ideal, RigPreset::Nominal, RigPreset::Hard] {
            let (limited, range_m) = small_sine(rig, frequency_hz);
            println!("{rig}, {frequency_hz} Hz: {:.0} um, limited {limited:.2} of the time", 1e6 * range_m);
            let follows = (0.3e-3..0.8e-3).contains(&range_m) && limited < 0.5;
            assert!(follows || limited > 0.5, "{rig}, {frequency_hz} Hz: {range_m} m, {limited}");
            assert!(follows || rig != RigPreset::Ideal);
        }
    }
}
