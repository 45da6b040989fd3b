//! Scenes whose values do not fit each other are refused with their keys and numbers; scenes just inside the limits
//! pass.

use rig_config::{Scene, SceneError};
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes")
}

/// The default scene with some keys changed.
fn changed(changes: &[(&str, &str)]) -> Result<Scene, SceneError> {
    let mut text = std::fs::read_to_string(folder().join("default.toml")).unwrap();
    for (key, value) in changes {
        let line =
            text.lines().find(|line| line.starts_with(&format!("{key} = "))).expect("a key of the default scene");
        text = text.replace(line, &format!("{key} = {value}"));
    }
    Scene::from_toml_str(&text)
}

/// Its unusual values, or why it is impossible.
fn checked(changes: &[(&str, &str)]) -> Result<Vec<String>, String> {
    let unusual = changed(changes).and_then(|scene| scene.check_rig()).map_err(|error| error.to_string())?;
    Ok(unusual.iter().map(ToString::to_string).collect())
}

#[test]
fn every_scene_in_the_folder_is_a_rig_without_a_warning() {
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        let warnings = Scene::load(&path).and_then(|scene| scene.check_rig());
        assert!(warnings.as_ref().is_ok_and(Vec::is_empty), "{}: {warnings:?}", path.display());
    }
}

/// The changes, the keys and numbers that the refusal must name, and changes just inside the limit, which pass.
const CASES: &str = "
rod_radius_m = 0.5 | geometry.rod_radius_m; 500 mm; 32 mm; metres | rod_radius_m = 0.0006
diameter_m = 1.5 | string.diameter_m; 1500 mm; 32 mm; metres | diameter_m = 0.0016
stiffness_n_per_m = 1.37 | string.stiffness_n_per_m; 6569 mm; 97 mm; N/m | stiffness_n_per_m = 1000.0
supply_voltage_v = 5.0 | rig.supply_voltage_v; 5 V; 10 to 58 V | supply_voltage_v = 10.0; motor_speed_max_rad_per_s = 430.0
supply_voltage_v = 60.0 | rig.supply_voltage_v; 60 V; 10 to 58 V | supply_voltage_v = 58.0
supply_divider = 1.0 | rig.supply_divider; 28.8 V; 5 V; divide by 6 | supply_divider = 6.0
adc_reference_v = 5.0 | rig.adc_reference_v; 5 V; 1.8 to 3.6 V | adc_reference_v = 3.0
lvdt_volts_at_stroke = 5.0 | rig.lvdt_volts_at_stroke; 5 V; 3.3 V | lvdt_volts_at_stroke = 3.3
# Within the reference, and still more than the pin bears.
lvdt_volts_at_stroke = 3.5; adc_reference_v = 3.6 | rig.lvdt_volts_at_stroke; 3.5 V; bears 3.3 V | lvdt_volts_at_stroke = 3.3; adc_reference_v = 3.6
lvdt_volts_at_zero = 4.0; lvdt_volts_at_stroke = 0.0 | rig.lvdt_volts_at_zero; 4 V; 3.3 V | lvdt_volts_at_zero = 3.0; lvdt_volts_at_stroke = 0.0
lvdt_stroke_m = 0.001 | rig.lvdt_stroke_m; envelope.load_n; mm to 1 mm; zero twist; metres | lvdt_stroke_m = 0.15
lvdt_stroke_m = 200.0 | rig.lvdt_stroke_m; 200000 mm; 0.25 mm; metres | lvdt_stroke_m = 0.9; lvdt_gap_at_zero_m = -0.1
lvdt_gap_at_zero_m = 0.5 | rig.lvdt_gap_at_zero_m; 49.7 mm; 700 mm | lvdt_gap_at_zero_m = 0.02
# The whole stroke would do, but 99 % of the ADC's range count as a short.
lvdt_stroke_m = 0.111; lvdt_volts_at_stroke = 3.3 | rig.lvdt_volts_at_stroke; zero twist | lvdt_stroke_m = 0.12; lvdt_volts_at_stroke = 3.3
motor_torque_constant_nm_per_a = 22.9 | rig.motor_torque_constant_nm_per_a; rig.supply_voltage_v; 24 V; N m/A | motor_torque_constant_nm_per_a = 0.0229
motor_torque_constant_nm_per_a = 1e-4 | rig.motor_torque_constant_nm_per_a; envelope.load_n; 0.5 A | motor_torque_constant_nm_per_a = 0.005
drive_current_limit_a = 0.001 | rig.drive_current_limit_a; 0.001 A; 18 N | drive_current_limit_a = 0.1
motor_resistance_ohm = 1e6 | rig.motor_resistance_ohm; 19.2 V | motor_resistance_ohm = 600.0
rotor_inertia_kg_m2 = 1.2 | rig.rotor_inertia_kg_m2; kg m² | rotor_inertia_kg_m2 = 9e-7
motor_speed_max_rad_per_s = 0.001 | rig.motor_speed_max_rad_per_s; rig.gear_ratio; homing from 7.5 turns; 42 s | motor_speed_max_rad_per_s = 285.0
motor_speed_max_rad_per_s = 260.0 | rig.motor_speed_max_rad_per_s; 2483 rpm; 42 s | motor_speed_max_rad_per_s = 300.0
turns = [0.0, 8.0]; load_n = [10.0, 11.0]; gear_ratio = [248, 1] | envelope.turns; homing from 8 turns; 42 s | turns = [0.0, 7.0]; load_n = [10.0, 11.0]; gear_ratio = [230, 1]
encoder_lines = 1 | rig.encoder_lines; 15000 rpm; 9998 rpm; accuracy.contraction_m | encoder_lines = 16
encoder_lines = 16384 | rig.encoder_lines; 32767 | encoder_lines = 4096
# Open strings, which homing passes, pull back with more torque than those of the last turn.
gear_ratio = [3, 1] | rig.gear_ratio; envelope.load_n; -0.25 turns; 3:1; 0.5 A | gear_ratio = [5, 1]
gear_ratio = [1, 62] | rig.gear_ratio; 1:62 | gear_ratio = [103, 1]
gear_ratio = [690, 1] | rig.gear_ratio; 690:1; 42 s | gear_ratio = [200, 1]
";

fn changes(text: &str) -> Vec<(&str, &str)> {
    text.split("; ").map(|change| change.trim().split_once(" = ").expect("key = value")).collect()
}

#[test]
fn values_that_do_not_fit_are_refused_with_keys_and_numbers_and_those_just_inside_the_limits_pass() {
    for case in CASES.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let [impossible, named, possible] = case.split(" | ").collect::<Vec<_>>()[..] else { panic!("{case}") };
        let refused = checked(&changes(impossible)).expect_err(&format!("{impossible} passes"));
        for named in named.split("; ") {
            assert!(refused.contains(named), "{impossible} does not name {named}: {refused}");
        }
        let passed = checked(&changes(possible));
        assert!(passed.is_ok(), "{possible}: {passed:?}");
    }
}

/// Reading the file is enough to be refused, so that no firmware is built and no board is spoken to.
#[test]
fn values_that_could_damage_hardware_are_refused_on_reading() {
    for changes in [
        &[("supply_divider", "1.0")][..],
        &[("supply_voltage_v", "5.0")],
        &[("adc_reference_v", "5.0")],
        &[("lvdt_volts_at_stroke", "3.31")],
        &[("lvdt_volts_at_stroke", "3.5"), ("adc_reference_v", "3.6")],
    ] {
        assert!(matches!(changed(changes), Err(SceneError::Impossible(_))), "{changes:?}");
    }
}

#[test]
fn all_values_that_do_not_fit_are_reported_together() {
    let refused = checked(&[("encoder_lines", "1"), ("motor_resistance_ohm", "1e6")]).unwrap_err();
    assert!(refused.contains("rig.encoder_lines") && refused.contains("rig.motor_resistance_ohm"), "{refused}");
}

#[test]
fn an_unusual_value_is_a_warning() {
    for (changes, named) in [
        (&[("rod_span_m", "0.010")][..], "geometry.rod_span_m"),
        (&[("supply_divider", "2000.0")], "rig.supply_divider"),
        (&[("lvdt_gap_at_zero_m", "0.044")], "rig.lvdt_gap_at_zero_m"),
        (&[("drive_current_limit_a", "0.033")], "rig.drive_current_limit_a"),
        (&[("rotor_inertia_kg_m2", "2e-6")], "rig.rotor_inertia_kg_m2"),
    ] {
        let unusual = checked(changes);
        assert!(
            unusual.as_ref().is_ok_and(|all| all.iter().any(|why| why.contains(named))),
            "{changes:?}: {unusual:?}"
        );
    }
}

#[test]
fn an_envelope_past_the_model_is_named() {
    let refused = checked(&[("turns", "[0.0, 40.0]")]).unwrap_err();
    assert!(refused.contains("envelope.turns") && refused.contains("40 turns"), "{refused}");
}

/// A solve does not use the motor, and a scene without an envelope demands nothing of it.
#[test]
fn without_an_envelope_the_checks_that_need_one_are_skipped() {
    let mut scene = changed(&[("drive_current_limit_a", "0.001"), ("rotor_inertia_kg_m2", "1e-12")]).unwrap();
    assert!(scene.check_rig().is_err());
    scene.envelope = None;
    assert_eq!(scene.check_rig().unwrap(), []);
}
