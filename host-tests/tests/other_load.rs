//! Rigs whose constants are not those of their scene, moved under another load than they were homed under.

use host_tests::ControlBench;
use host_tests::load_changes::homed_under;
use host_tests::rigs::subject::Subject;
use rig_control::limits::SPEED_MAX_M_PER_S;
use rig_link::messages::LoadChoice;
use rig_plant::RigPreset;

/// Hangs another load on slowly, as somebody does by hand.
fn hang_by_hand(bench: &mut ControlBench, loads_kg: impl Iterator<Item = f64>) {
    for load_kg in loads_kg {
        bench.rig.set_plant("load", &format!("{load_kg}kg")).expect("a plant key");
        bench.run(0.05);
    }
    bench.run(1.0);
}

/// The scale of the twist that homing found under 0.3 kg does not fit under 1.4 kg. On these rigs the firmware took that for a string
/// that had slipped, and stopped.
#[test]
fn a_load_much_heavier_than_the_homed_one_is_no_fault() {
    for seed in [73, 87] {
        let mut bench = homed_under(&Subject::new(RigPreset::Nominal, seed), 0.3).expect("it can be homed");
        hang_by_hand(&mut bench, (31..=140).map(|k| 0.01 * f64::from(k)));
        for (target_mm, speed_m_per_s) in
            [(2.0f32, 0.004), (5.0, SPEED_MAX_M_PER_S), (3.0, 0.004), (5.0, 0.004), (1.0, 0.004)]
        {
            bench
                .move_to(1e-3 * target_mm, speed_m_per_s, LoadChoice::Auto)
                .unwrap_or_else(|e| panic!("seed {seed}, {target_mm} mm: {e}"));
            bench.run(0.5);
        }
    }
}
