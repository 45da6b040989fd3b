//! Scene files: an error names the key.

use rig_config::{Scene, SceneError};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use tsa_model::twist_from_turns;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn default_text() -> String {
    std::fs::read_to_string(root().join("scenes/default.toml")).unwrap()
}

#[test]
fn every_scene_in_the_folder_is_good() {
    for entry in std::fs::read_dir(root().join("scenes")).unwrap() {
        let path = entry.unwrap().path();
        Scene::load(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).mechanism().unwrap();
    }
}

/// ∂T/∂F = −∂G/∂θ, or a cycle of load and twist would gain work. The paper's relation violates it. Where the material has a corner,
/// the quadrature is good to 3 %.
#[test]
fn the_torque_conserves_energy_in_every_scene() {
    let mut violated = 1.0f64;
    for entry in std::fs::read_dir(root().join("scenes")).unwrap() {
        let path = entry.unwrap().path();
        let mechanism = Scene::load(&path).unwrap().mechanism().unwrap();
        for load_n in [0.5, 1.0, 4.0, 15.0] {
            for turns in [0.5, 2.0, 4.0, 5.5] {
                let twist_rad = tsa_model::twist_from_turns(turns);
                let Ok(here) = mechanism.formal(load_n, twist_rad) else { continue };
                let step_n = 1e-3 * load_n;
                let sides = [load_n - step_n, load_n + step_n];
                let by_load = |[low, high]: [f64; 2]| (high - low) / (2.0 * step_n) / -here.dgap_dtwist_m_per_rad;
                let conservative = by_load(sides.map(|n| mechanism.conservative_torque_nm(n, twist_rad).unwrap()));
                assert!((conservative - 1.0).abs() < 0.03, "{path:?}, {load_n} N, {turns} turns: {conservative}");
                let paper = by_load(sides.map(|n| mechanism.formal(n, twist_rad).unwrap().torque_nm));
                violated = violated.min(paper);
            }
        }
    }
    assert!(violated < 0.6, "{violated}");
}

/// The words in backquotes of a text.
fn quoted(text: &str) -> BTreeSet<String> {
    text.split('`').skip(1).step_by(2).map(ToOwned::to_owned).collect()
}

#[test]
fn the_page_about_configuration_has_every_key_and_no_other() {
    let page = std::fs::read_to_string(root().join("docs/reference/config.md")).unwrap();
    // The first column of the tables of keys.
    let tables = page.split("\n## Scenes").next().unwrap().lines();
    let rows = tables.filter(|line| line.starts_with("| `")).filter_map(|line| line.split('|').nth(1));
    let written: BTreeSet<_> = rows.flat_map(quoted).collect();
    let mut known = BTreeSet::new();
    for section in ["geometry", "string", "material", "correction", "rig", "uncertainty", "envelope", "accuracy"] {
        let mut scene: toml::Table = toml::from_str(&default_text()).unwrap();
        let keys = scene.entry(section).or_insert(toml::Table::new().into()).as_table_mut().unwrap();
        keys.insert("no_such_key".into(), 1.into());
        // The refusal lists all keys.
        let refusal = Scene::from_toml_str(&toml::to_string(&scene).unwrap()).unwrap_err().to_string();
        let (_, expected) = refusal.split_once("expected ").unwrap_or_else(|| panic!("{section}: {refusal}"));
        // A key is one word; a command that the refusal names is not.
        for key in quoted(expected).into_iter().filter(|word| !word.contains(' ')) {
            let full = format!("{section}.{key}");
            known.insert(if written.contains(&full) { full } else { key });
        }
    }
    assert_eq!(written, known);
}

/// A measured correction with these ranges and first row of coefficients, before the next part of the scene.
fn correction(load_n: &str, turns: &str, row: &str) -> String {
    let rest = "[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]";
    format!("[correction]\nload_n = {load_n}\nturns = {turns}\ncoefficients_m = [{row}, {rest}]\n\n[accuracy]")
}

#[test]
fn a_correction_comes_back_and_is_in_the_gap_of_its_range_only() {
    let text = default_text();
    let corrected = correction("[2.0, 15.0]", "[0.0, 7.5]", "[0.0001, 0.0, 0.00002]");
    let scene = Scene::from_toml_str(&text.replace("[accuracy]", &corrected)).unwrap();
    assert_eq!(Scene::from_toml_str(&toml::to_string(&scene).unwrap()).unwrap(), scene);
    let plain = Scene::from_toml_str(&text).unwrap();
    assert_ne!(scene.hash(), plain.hash());
    let gap_m = |scene: &Scene, load_n| scene.mechanism().unwrap().solve(load_n, twist_from_turns(3.75)).unwrap().gap_m;
    assert!((gap_m(&scene, 5.0) - gap_m(&plain, 5.0) - 0.9e-4).abs() < 1e-12, "P0 less half of P2 in the middle");
    assert_eq!(gap_m(&scene, 0.25), gap_m(&plain, 0.25));
}

#[test]
fn errors_name_the_key() {
    let cases = [
        ("rod_radius_m = 0.0005", "", "rod_radius_m"),
        ("rod_radius_m = 0.0005", "rod_radius = 0.0005", "rod_radius"),
        ("rod_radius_m = 0.0005", "rod_radius_m = \"thick\"", "rod_radius_m"),
        ("rod_radius_m = 0.0005", "rod_radius_m = -0.0005", "geometry.rod_radius_m"),
        ("rod_radius_m = 0.0005", "rod_radius_m = nan", "geometry.rod_radius_m"),
        ("clamp_width_m = 0.006", "clamp_width_m = 0.06", "geometry.clamp_width_m"),
        ("rod_span_m = 0.032", "rod_span_m = 0.2", "geometry.rod_span_m"),
        ("string_length_m = 0.097", "string_length_m = 10.1", "geometry.string_length_m"),
        ("k4 = 0.09601", "radius_law = \"twist-power\"", "string.twist_exponent"),
        ("k4 = 0.09601", "radius_law = \"square\"", "radius_law"),
        ("k4 = 0.09601", "k4 = 0.1\nradius_law = \"twist-power\"\ntwist_exponent = 0.4", "string.k4"),
        ("k4 = 0.09601", "k4 = -0.1", "string.k4"),
        ("k1_per_n = 6.522", "k1_per_n = 0.0", "string.k1_per_n"),
        ("stress_coefficients_pa = [3.510e10,", "stress_coefficients_pa = [-1.0,", "material.stress_coefficients_pa"),
        ("load_n = [0.75, 18.0]", "load_n = [0.1, 18.0]", "envelope.load_n"),
        ("load_n = [0.75, 18.0]", "load_n = [5.0, 1.0]", "envelope.load_n"),
        ("turns = [0.0, 7.5]", "turns = [-1.0, 7.5]", "envelope.turns"),
        ("contraction_m = 5e-6", "contraction_m = 0.0", "accuracy.contraction_m"),
        ("contraction_m = 5e-6", "contraction_m = 5.0", "accuracy.contraction_m"),
        ("tr_relative = 2e-3", "tr_relative = 100.0", "accuracy.tr_relative"),
        ("gear_ratio = [62, 1]", "gear_ratio = [62, 0]", "rig.gear_ratio"),
        ("drive_number = 1", "drive_number = 0", "rig.drive_number"),
        ("drive_group = 0", "drive_group = 8", "rig.drive_group"),
        ("drive_transport = \"can\"", "drive_transport = \"rs485\"", "drive_transport"),
        ("lvdt_volts_at_stroke = 3.0", "lvdt_volts_at_stroke = 5.0", "rig.lvdt_volts_at_stroke"),
        ("motor_speed_max_rad_per_s = 1047.0", "motor_speed_max_rad_per_s = 9999.0", "rig.motor_speed_max_rad_per_s"),
        ("[material]", "[materials]", "materials"),
        ("adc_reference_v = 3.3", "adc_reference_v = 3.3\nlvdt_linearity = 0.25", "rig.lvdt_linearity"),
        ("adc_reference_v = 3.3", "adc_reference_v = 3.3\nlvdt_linearity = -1e-3", "rig.lvdt_linearity"),
        ("[accuracy]", "[uncertainty]\nradius = 6.0\n[accuracy]", "uncertainty.radius"),
        ("[accuracy]", "[uncertainty]\nrod_memory = 0.0\n[accuracy]", "uncertainty.rod_memory"),
        ("[accuracy]", "[uncertainty]\nradius = nan\n[accuracy]", "uncertainty.radius"),
        ("[accuracy]", "[uncertainty]\ngap_zero_m = -0.1\n[accuracy]", "uncertainty.gap_zero_m"),
        ("[accuracy]", "[uncertainty]\nload_shape = 0.6\n[accuracy]", "uncertainty.load_shape"),
        ("[accuracy]", "[uncertainty]\nradii = 0.1\n[accuracy]", "radii"),
        ("[accuracy]", "[correction]\nload_n = [2.0, 15.0]\n[accuracy]", "turns"),
        ("[accuracy]", &correction("[2.0, 1.0]", "[0.0, 7.5]", "[1e-5, 0.0, 0.0]"), "correction.load_n"),
        ("[accuracy]", &correction("[2.0, 15.0]", "[-0.5, 7.5]", "[1e-5, 0.0, 0.0]"), "correction.turns"),
        ("[accuracy]", &correction("[2.0, 15.0]", "[0.0, 7.5]", "[1e-5, nan, 0.0]"), "correction.coefficients_m"),
        ("[accuracy]", &correction("[2.0, 15.0]", "[0.0, 7.5]", "[6e-3, 0.0, 0.0]"), "correction.coefficients_m"),
        ("[accuracy]", &correction("[2.0, 15.0]", "[0.0, 7.5]", "[1e-5, 0.0]"), "coefficients_m"),
    ];
    for (from, to, key) in cases {
        let text = default_text();
        assert!(text.contains(from), "the default scene no longer has {from:?}");
        let error = Scene::from_toml_str(&text.replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(key), "{from:?} -> {to:?}: {error}");
    }
}

#[test]
fn a_table_needs_envelope_and_accuracy() {
    let text = default_text();
    let start = text.find("# What the table must cover").unwrap();
    let scene = Scene::from_toml_str(&text[..start]).unwrap();
    assert!(matches!(scene.table_requirement(), Err(SceneError::Missing { table: "envelope" })));
    assert!(Scene::from_toml_str(&text).unwrap().table_requirement().is_ok());
}

#[test]
fn the_hash_depends_on_values_and_not_on_comments() {
    let text = default_text();
    let hash = |t: &str| Scene::from_toml_str(t).unwrap().hash();
    assert_eq!(hash(&text), hash(&text.replace("# Assumed", "# assumed, says the author")));
    assert_ne!(hash(&text), hash(&text.replace("k2 = 0.127", "k2 = 0.1915")));
    let known = |radius: &str| text.replace("[accuracy]", &format!("[uncertainty]\nradius = {radius}\n\n[accuracy]"));
    assert_eq!(hash(&text), hash(&known("0.03")), "a default, written out");
    assert_ne!(hash(&text), hash(&known("0.01")));
}

#[test]
fn uncertainty_reaches_the_table_and_linearity_the_control_code() {
    let text = default_text();
    let scene = Scene::from_toml_str(&text).unwrap();
    let constants = scene.constants();
    let of_scale = |scene: &Scene| scene.twist_scale_error().unwrap() as f32;
    assert_eq!(scene.table_spec().unwrap().uncertainty.numbers(), [of_scale(&scene), 0.5e-3, 0.03, 0.16]);
    assert!((constants.lvdt_linearity_m - 1e-3).abs() < 1e-9, "half a percent of 200 mm");
    let text = text.replace("adc_reference_v = 3.3", "adc_reference_v = 3.3\nlvdt_linearity = 0.0025");
    let text = format!("{text}\n[uncertainty]\nradius = 0.01\ngap_zero_m = 0.0002\n");
    let scene = Scene::from_toml_str(&text).unwrap();
    let constants = scene.constants();
    let known = [of_scale(&scene), 2e-4, 0.03, 0.16];
    assert!((3.0 * known[0] / of_scale(&Scene::from_toml_str(&default_text()).unwrap()) - 1.0).abs() < 1e-6);
    assert_eq!(scene.table_spec().unwrap().uncertainty.numbers(), known);
    assert!((constants.lvdt_linearity_m - 0.5e-3).abs() < 1e-9);
}

#[test]
fn a_twist_scaled_by_its_error_has_the_gap_of_strings_thicker_by_theirs() {
    let scene = Scene::from_toml_str(&default_text()).unwrap();
    let mut thicker = scene.clone();
    thicker.string.diameter_m *= 1.0 + scene.uncertainty.radius;
    let gap_m = |scene: &Scene, twist_rad: f64| scene.mechanism().unwrap().solve(4.0, twist_rad).unwrap().gap_m;
    let twist_rad = twist_from_turns(3.75);
    let change_m = gap_m(&thicker, twist_rad) - gap_m(&scene, twist_rad);
    let scaled_m = gap_m(&scene, twist_rad * (1.0 + scene.twist_scale_error().unwrap())) - gap_m(&scene, twist_rad);
    assert!((scaled_m / change_m - 1.0).abs() < 0.02, "{scaled_m} m instead of {change_m} m");
    // The radius grows with the twist: a scale of the same size does too much.
    let too_much_m = gap_m(&scene, twist_rad * (1.0 + scene.uncertainty.radius)) - gap_m(&scene, twist_rad);
    assert!(too_much_m / change_m > 1.15, "{too_much_m} m");
}

#[test]
fn an_accuracy_that_is_not_two_numbers_is_refused_by_name() {
    let text = include_str!("../../../scenes/default.toml");
    let numbers = "[accuracy]\ncontraction_m = 5e-6\ntr_relative = 2e-3\n";
    assert!(text.contains(numbers));
    for (first, table, named) in [
        ("accuracy = \"budget\"\n", "", "`tsa-lab budget` prints"),
        ("", "[accuracy]\nbudget = \"hard\"\n", "budget"),
        ("", "[accuracy]\ncontraction_m = 5e-6\n", "tr_relative"),
        ("", "[accuracy]\ntr_relative = 5e-6\n", "contraction_m"),
        ("", "[accuracy]\ncontraction_m = -1.0\ntr_relative = 2e-3\n", "accuracy.contraction_m"),
    ] {
        let file = format!("{first}{}", text.replace(numbers, table));
        let error = rig_config::Scene::from_toml_str(&file).expect_err(table).to_string();
        assert!(error.contains(named), "{table}: {error}");
    }
}

/// Who prints an error with its sources would print the reason twice.
#[test]
fn the_error_of_a_file_has_its_reason_in_its_own_text_and_no_source() {
    let error = SceneError::Missing { table: "envelope" }.in_file("rig.toml");
    assert!(error.to_string().contains("rig.toml: scene: [envelope] is missing"), "{error}");
    assert!(std::error::Error::source(&error).is_none());
}
