//! `rigctl identify`: known constants found again, the paper's numbers, and what is refused.

use crate::common::{desktop as rigctl, error_of as said, file, folder, root};
use rand::{RngExt, SeedableRng};
use rig_config::Scene;
use rigctl::identify::compete::Candidate;
use rigctl::identify::data::Data;
use rigctl::identify::identify;
use rigctl::identify::laws::Law;
use rigctl::log::sweep::{Stop, Sweep};
use serde_json::Value;
use std::process::Output;
use tsa_model::{Material, Parameters, twist_from_turns};

fn object(output: &Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A rig whose constants differ from the default scene's.
fn truth() -> Scene {
    let mut scene = Scene::load(root().join("scenes/default.toml")).unwrap();
    scene.string.k1_per_n *= 1.15;
    scene.string.k2 *= 0.9;
    scene.string.k3 *= 1.1;
    scene.string.k4 *= 1.06;
    scene.material.stress_coefficients_pa = scene.material.stress_coefficients_pa.map(|a| 0.87 * a);
    scene
}

/// A sweep of the truth: 31 stops up, from an unknown zero, with noise.
fn sweep(scene: &Scene, load_n: f64, turns: f64, zero_m: f64, noise_m: f64) -> String {
    let m = scene.mechanism().unwrap();
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(load_n.to_bits());
    let mut text = "# a comment\nload_n,turns,gap_m\n".to_owned();
    for k in 0..=30 {
        let t = turns * f64::from(k) / 30.0;
        // Twelve uniform numbers have the variance of one normal one.
        let normal: f64 = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let gap = m.solve(load_n, twist_from_turns(t)).unwrap().gap_m + zero_m + noise_m * normal;
        text += &format!("{load_n},{t},{gap:.12}\n");
    }
    text
}

fn sweeps(name: &str, loads: &[f64], turns: f64, noise_m: f64) -> Vec<String> {
    let folder = folder(name);
    let files = loads.iter().enumerate().map(|(k, load)| {
        let path = folder.join(format!("sweep-{k}.csv"));
        std::fs::write(&path, sweep(&truth(), *load, turns, 0.01 + 0.002 * k as f64, noise_m)).unwrap();
        path.to_str().unwrap().to_owned()
    });
    files.collect()
}

/// The unknowns that a fit from the default scene has to find.
fn expected() -> [(&'static str, f64); 5] {
    let (t, d) = (truth(), Scene::load(root().join("scenes/default.toml")).unwrap());
    let modulus = t.material.stress_coefficients_pa[0] / d.material.stress_coefficients_pa[0];
    [
        ("k1", t.string.k1_per_n.ln()),
        ("k2", t.string.k2.ln()),
        ("k3", t.string.k3.ln()),
        ("k4", t.string.k4.ln()),
        ("modulus", modulus.ln()),
    ]
}

fn estimate(fit: &Value, name: &str) -> (f64, f64) {
    let found = fit["estimates"].as_array().unwrap().iter().find(|e| e["name"] == name).unwrap();
    (found["unknown"].as_f64().unwrap(), found["standard_error"].as_f64().unwrap())
}

#[test]
fn known_constants_are_found_again_from_sweeps_with_unknown_zeros() {
    let files = sweeps("exact", &[0.9, 1.2, 2.0, 5.0, 10.0, 15.0], 7.5, 0.0);
    let scene = file("identified.toml");
    let mut arguments = vec!["--json", "identify", "--law", "length-ratio-k4", "--out", scene.to_str().unwrap()];
    arguments.extend(files.iter().map(String::as_str));
    let fit = object(&rigctl(&arguments));
    for (name, truth) in expected() {
        let (found, _) = estimate(&fit, name);
        assert!((found - truth).abs() < 1e-6, "{name}: {found} against {truth}");
    }
    for (k, zero) in (1..=6).zip([0.01, 0.012, 0.014, 0.016, 0.018, 0.02]) {
        assert!((estimate(&fit, &format!("zero of sweep {k}")).0 - zero).abs() < 1e-9);
    }
    assert!(fit["held_out"]["count"].as_u64().unwrap() > 30);
    assert!(fit["held_out"]["worst"].as_f64().unwrap() < 1e-6);
    assert_eq!((&fit["chosen"]["law"], &fit["law_holds"]), (&"length-ratio-k4".into(), &true.into()));
    // The file that was written is a scene, and the rig's.
    let written = Scene::load(&scene).unwrap();
    assert!((written.string.k3 - truth().string.k3).abs() < 1e-8);
    assert_eq!(written.envelope, truth().envelope);
    assert!(std::fs::read_to_string(&scene).unwrap().starts_with("# Identified by rigctl"));
}

#[test]
fn the_power_of_the_twist_is_found_again_from_sweeps() {
    let scene = "scenes/paper-identified.toml";
    let mut truth = Scene::load(root().join(scene)).unwrap();
    truth.string.twist_exponent = truth.string.twist_exponent.map(|exponent| 1.06 * exponent);
    truth.string.k2 *= 0.9;
    let folder = folder("power");
    let written = [1.0, 2.0, 5.0, 10.0, 15.0].map(|load: f64| {
        let path = folder.join(format!("{load}.csv")).to_str().unwrap().to_owned();
        std::fs::write(&path, sweep(&truth, load, 7.0, 0.01, 0.0)).unwrap();
        path
    });
    let arguments = ["--json", "--scene", scene, "identify", "--law", "twist-power"]
        .into_iter()
        .chain(written.iter().map(String::as_str));
    let fit = object(&rigctl(&arguments.collect::<Vec<_>>()));
    let string = &truth.string;
    let exponent = string.twist_exponent.unwrap();
    for (name, value) in
        [("k1", string.k1_per_n), ("k2", string.k2), ("k3", string.k3), ("p", exponent), ("modulus", 1.0)]
    {
        let (found, _) = estimate(&fit, name);
        assert!((found - value.ln()).abs() < 1e-6, "{name}: {}", found.exp());
    }
}

#[test]
fn noise_moves_the_constants_by_what_the_standard_errors_say() {
    let files = sweeps("noise", &[0.9, 1.2, 2.0, 5.0, 10.0, 15.0], 7.5, 20e-6);
    let mut arguments = vec!["--json", "identify", "--law", "length-ratio-k4"];
    arguments.extend(files.iter().map(String::as_str));
    let fit = object(&rigctl(&arguments));
    for (name, truth) in expected() {
        let (found, error) = estimate(&fit, name);
        assert!(error > 1e-5 && error < 0.2, "{name}: standard error {error}");
        assert!((found - truth).abs() < 3.0 * error, "{name}: {found} against {truth}, standard error {error}");
    }
    // Values with their bounds are those of the scene, not their logarithms.
    let scene = &fit["scene"];
    for (name, place) in [("k2", "/string/k2"), ("modulus", "/material/stress_coefficients_pa/0")] {
        let estimates = fit["estimates"].as_array().unwrap();
        let estimate = estimates.iter().find(|e| e["name"] == name).unwrap_or_else(|| panic!("{name}: {estimates:?}"));
        let [value, low, high, half] =
            ["value", "low", "high", "half_width_90"].map(|key| estimate[key].as_f64().unwrap());
        let in_scene = scene.pointer(place).and_then(Value::as_f64).unwrap();
        assert!((value / in_scene - 1.0).abs() < 1e-12, "{name}: {value} against {in_scene}");
        assert!(
            low < value && value < high && ((high / low).ln() / (2.0 * half) - 1.0).abs() < 1e-9,
            "{name}: {estimate}"
        );
    }
    for (part, max) in [("fitted", 28e-6), ("held_out", 60e-6)] {
        let rms = fit[part]["rms"].as_f64().unwrap();
        assert!((14e-6..max).contains(&rms), "{part}: {rms}");
    }
}

#[test]
fn what_the_data_cannot_tell_is_refused_by_name() {
    // One load: 1/(k1 F) + k2 is one number.
    let files = sweeps("one-load", &[2.0], 7.5, 0.0);
    let output = rigctl(&["identify", "--fit", "k1,k2", &files[0]]);
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("k1") && said(&output).contains("k2"), "{}", said(&output));
    // The nearest good case: one of them.
    assert!(rigctl(&["identify", "--fit", "k2", &files[0]]).status.success());
    // A constant that the law does not have.
    let output = rigctl(&["identify", "--fit", "k2,p", "--law", "length-ratio", &files[0]]);
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("twist_exponent"), "{}", said(&output));
}

#[test]
fn a_fitted_curve_never_falls() {
    let truth = {
        let mut s = Scene::load(root().join("scenes/default.toml")).unwrap();
        s.material = Material { stress_coefficients_pa: [2.4e10, 0.0, -4e12, 0.0, 8e14] };
        s
    };
    let folder = folder("curve");
    let mut arguments = vec!["--json".to_owned(), "identify".into(), "--fit".into(), "odd-curve".into()];
    for load in [2.0, 6.0, 10.0, 14.0, 17.0] {
        let path = folder.join(format!("{load}.csv"));
        std::fs::write(&path, sweep(&truth, load, 7.5, 0.003, 0.0)).unwrap();
        arguments.push(path.to_str().unwrap().into());
    }
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let fit = object(&rigctl(&arguments));
    let a: Vec<f64> = fit["scene"]["material"]["stress_coefficients_pa"]
        .as_array()
        .unwrap()
        .iter()
        .map(|a| a.as_f64().unwrap())
        .collect();
    for (found, true_a) in a.iter().zip(truth.material.stress_coefficients_pa) {
        assert!((found - true_a).abs() <= 1e-3 * true_a.abs(), "{a:?}");
    }
    for k in 0..=100 {
        let strain = 0.12 * f64::from(k) / 100.0;
        let tangent = a[0] + 3.0 * a[2] * strain.powi(2) + 5.0 * a[4] * strain.powi(4);
        assert!(tangent > 0.0, "{strain}: {tangent}");
    }
}

#[test]
fn wrong_units_and_signs_are_named_with_their_file() {
    const GRAVITY: f64 = 9.80665;
    // The gap at the half-turn pre-twist is where contraction begins.
    let mechanism = truth().mechanism().unwrap();
    let zeros = HUNG.map(|load| mechanism.solve(load, twist_from_turns(0.0)).unwrap().gap_m);
    let (gap, contraction) = ("gap_m", "contraction_m");
    for (what, length, load_factor, length_factor, named) in [
        ("kg", gap, 1.0 / GRAVITY, 1.0, "load_n taken as kg"),
        ("kg", contraction, 1.0 / GRAVITY, -1.0, "load_n taken as kg"),
        ("g", gap, 1e3 / GRAVITY, 1.0, "load_n taken as g"),
        ("mm", contraction, 1.0, -1e3, "is it in mm?"),
        ("mm", gap, 1.0, 1e3, "is it in mm?"),
        ("sign", contraction, 1.0, 1.0, "is its sign wrong, or is it a gap"),
        ("sign", gap, 1.0, -1.0, "is its sign wrong, or is it a contraction"),
    ] {
        let change = |k: usize, _, gap: f64| (load_factor * HUNG[k], length_factor * (gap - zeros[k]));
        let output = identified("units", length, 0.0, &[], change);
        let said = said(&output);
        assert!(output.status.code() == Some(1) && said.contains("hung-"), "{what} {length}: {said}");
        assert!(said.contains(named), "{what} {length}: {said}");
    }
    for (length, sign) in [(gap, 1.0), (contraction, -1.0)] {
        let files = hung("well", length, 0.0, |k, _, gap| (HUNG[k], sign * (gap - zeros[k])));
        let scene = Scene::load(root().join("scenes/default.toml")).unwrap();
        let data = rigctl::identify::data::sweeps(&scene, &files, false).unwrap_or_else(|e| panic!("{e:?}"));
        let hints = rigctl::identify::plausible::checked(&data, &scene).expect(length);
        assert!(hints.is_empty(), "{length}: {hints:?}");
    }
}

#[test]
fn bad_files_rows_and_options_are_named() {
    let folder = folder("bad");
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let columns = write("columns.csv", "load_n,turns\n1,2\n");
    let nothing = write("nothing.csv", "load_n,turns,gap_m\nx,1,0.1\n");
    let good = sweeps("good", &[1.0, 5.0, 15.0], 7.5, 0.0);
    let mixed = write("mixed.csv", &(sweep(&truth(), 2.0, 7.5, 0.0, 0.0) + "2,zwei,0.08\n0,1,0.1\n2,1\n"));
    for (arguments, code, named) in [
        (vec!["identify", "--fit", "k2", columns.as_str()], 1, "gap_m"),
        (vec!["identify", "--fit", "k2", nothing.as_str()], 1, "load_n `x`"),
        (vec!["identify", "--fit", "k2", "no-such-file.csv"], 1, "no-such-file.csv"),
        (vec!["identify"], 2, "sweeps"),
        (vec!["identify", "--fit", "k9", good[0].as_str()], 2, "k9"),
        (vec!["identify", "--fit", "k1,k1", good[0].as_str()], 2, "twice"),
        (vec!["identify", "--fit", "modulus,curve", good[0].as_str()], 2, "curve"),
        (vec!["identify", "--law", "guess", good[0].as_str()], 2, "length-ratio"),
        (vec!["identify", "--hold-out", "often", good[0].as_str()], 2, "--published"),
    ] {
        let output = rigctl(&arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", said(&output));
        assert!(said(&output).contains(named), "{arguments:?}: {}", said(&output));
    }
    // Bad rows are named and passed over; the rest is fitted.
    let mut arguments = vec!["--json", "identify", "--fit", "k2", mixed.as_str()];
    arguments.extend(good.iter().map(String::as_str));
    let output = rigctl(&arguments);
    let fit = object(&output);
    assert_eq!(fit["bad_rows"].as_array().unwrap().len(), 3);
    for named in ["zwei", "slack", "mixed.csv:34"] {
        assert!(said(&output).contains(named), "{named}: {}", said(&output));
    }
}

/// Loads (N) of some sweeps.
const HUNG: [f64; 5] = [1.0, 2.0, 5.0, 10.0, 15.0];

/// Files of loads and lengths under these loads, each row changed first: number of the sweep, turns and gap to load and length.
fn hung(name: &str, length: &str, noise_m: f64, change: impl Fn(usize, f64, f64) -> (f64, f64)) -> Vec<String> {
    let folder = folder(name);
    let write = |(k, load): (usize, &f64)| {
        let path = folder.join(format!("hung-{load}.csv"));
        let numbered = sweep(&truth(), *load, 7.5, 0.0, noise_m);
        let rows = numbered.lines().skip(2).map(|line| {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            let (load, value) = change(k, cells[1], cells[2]);
            format!("{load},{},{value}\n", cells[1])
        });
        std::fs::write(&path, format!("load_n,turns,{length}\n{}", rows.collect::<String>())).unwrap();
        path.to_str().unwrap().to_owned()
    };
    HUNG.iter().enumerate().map(write).collect()
}

/// Identifies such files.
fn identified(
    name: &str,
    length: &str,
    noise_m: f64,
    more: &[&str],
    change: impl Fn(usize, f64, f64) -> (f64, f64),
) -> Output {
    let files = hung(name, length, noise_m, change);
    let files = files.iter().map(String::as_str).collect::<Vec<_>>();
    rigctl(&[&["--json", "identify"], more, &files].concat())
}

#[test]
fn the_simplest_law_that_predicts_what_is_held_out_is_chosen() {
    let figure = file("chosen.svg");
    let more = ["--next", "--figure", figure.to_str().unwrap()];
    let fit = object(&identified("chosen", "gap_m", 5e-6, &more, |k, _, gap| (HUNG[k], gap)));
    // Every second of 31 points of 5 sweeps on both panels, and one in the key; a mark is a circle with a rim.
    let svg = std::fs::read_to_string(figure).unwrap();
    assert_eq!(svg.matches("<circle").count(), 2 * (2 * 5 * 16 + 1));
    for text in ["1 N", "15 N", "before and after", "stated error", "Difference"] {
        assert!(svg.contains(text), "{text}");
    }
    let candidates = fit["candidates"].as_array().unwrap();
    assert_eq!(candidates.len(), 6);
    let of = |law: &str, material: &str| {
        candidates.iter().find(|c| c["law"] == law && c["material"] == material).unwrap_or_else(|| panic!("{law}"))
    };
    assert_eq!(of("length-ratio", "modulus")["verdict"], "worse");
    assert_eq!(of("length-ratio-k4", "modulus")["verdict"], "chosen");
    assert_eq!(fit["chosen"]["law"], "length-ratio-k4");
    assert!(fit["scene"]["string"]["k4"].as_f64() > Some(0.05));
    assert_eq!(fit["law_holds"], true);
    // The truth at 7.5 turns, within what is stated.
    let mechanism = truth().mechanism().unwrap();
    let predictions = fit["predictions"].as_array().unwrap();
    assert_eq!(predictions.len(), 3);
    for p in predictions {
        let number = |key: &str| p[key].as_f64().unwrap_or_else(|| panic!("{key}: {p}"));
        let gap = |turns| mechanism.formal(number("load_n"), twist_from_turns(turns)).unwrap().gap_m;
        let error = number("contraction_m") - (gap(0.0) - gap(number("turns")));
        assert!(error.abs() < 2.0 * number("half_width_m") && number("half_width_m") < 2e-3, "{p}: {error}");
    }
    let next = &fit["next"];
    assert!(next["largest_half_width_m"].as_f64() >= next["floor_m"].as_f64(), "{next}");
    // One law by its name.
    let fit = object(&identified("one-law", "gap_m", 5e-6, &["--law", "length-ratio"], |k, _, gap| (HUNG[k], gap)));
    assert_eq!((&fit["chosen"]["law"], &fit["law_holds"]), (&"length-ratio".into(), &false.into()));
    assert!(fit["residual"]["excess_m"].as_f64().unwrap() > 50e-6, "{}", fit["residual"]);
}

#[test]
fn a_sweep_in_which_a_string_slipped_is_named() {
    let slips = |k: usize, turns: f64, gap: f64| (HUNG[k], if k == 2 && turns > 4.0 { gap + 2e-3 } else { gap });
    let output = identified("slip", "gap_m", 5e-6, &[], slips);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("slip") && said(&output).contains("hung-5"), "{}", said(&output));
    // The way down hangs higher by friction, at almost the same turns as the way up.
    let both_ways = |name: &str, slipped: bool| {
        let change = |k: usize, turns: f64, gap: f64| if slipped { slips(k, turns, gap) } else { (HUNG[k], gap) };
        let files = hung(name, "gap_m", 5e-6, change);
        for file in &files {
            let text = std::fs::read_to_string(file).unwrap();
            let down = text.lines().skip(1).map(|line| {
                let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
                format!("{},{},{}\n", cells[0], cells[1] + 1e-3, cells[2] - 0.2e-3)
            });
            std::fs::write(file, text.clone() + &down.collect::<String>()).unwrap();
        }
        let files: Vec<&str> = files.iter().map(String::as_str).collect();
        rigctl(&[&["--json", "identify", "--law", "length-ratio-k4"], &files[..]].concat())
    };
    let output = both_ways("both-ways", false);
    assert!(output.status.success(), "{}", said(&output));
    let output = both_ways("both-ways-slipped", true);
    assert!(output.status.code() == Some(1) && said(&output).contains("slip"), "{}", said(&output));
}

/// Sweeps as `rigctl sweep` records them, of a known zero, each changed first: its load (N), and its gap (m) at a number of
/// turns. The answer is the error's words.
fn refused(change: impl Fn(usize, f64, f64) -> (f64, f64)) -> Result<(), String> {
    let scene = Scene::load(root().join("scenes/default.toml")).unwrap();
    let base = Parameters::new(&scene.geometry, &scene.string, &scene.material).unwrap();
    let rig = truth().mechanism().unwrap();
    let mut data = Data::default();
    for (k, load) in HUNG.into_iter().enumerate() {
        let mut load_n = load;
        let mut stops = Vec::new();
        for turns in (0..=10).map(|stop| 0.7 * f64::from(stop)) {
            let twist_rad = twist_from_turns(turns);
            let changed = change(k, turns, rig.solve(load, twist_rad).unwrap().gap_m);
            load_n = if changed.0 > 0.0 { changed.0 } else { load };
            stops.push(Stop { twist_rad, position_m: -changed.1, half_difference_m: 10e-6 });
        }
        data.add_sweep(&format!("hung-{load}"), &base, &Sweep { load_n, after_n: None, zero_gap_m: Some(0.0), stops });
    }
    // A table is not what this is about.
    let scene = Scene { accuracy: None, ..scene };
    // Which law is enough is not what this is about either: the rig's own, with one material, makes it quick.
    let candidates = Candidate::all(&scene, Some(Law::LengthRatioK4), data.knows_its_zero());
    identify(&scene, &data, &candidates[..1]).map(|_| ()).map_err(|e| e.to_string())
}

/// A heavier load has left 10 % of a load of 2 N in the rods; one of a load that was not swept before shows nothing.
#[test]
fn what_rods_remember_is_measured_by_a_sweep_before_and_one_after_a_heavier_load() {
    let scene = Scene { accuracy: None, ..Scene::load(root().join("scenes/default.toml")).unwrap() };
    let base = Parameters::new(&scene.geometry, &scene.string, &scene.material).unwrap();
    let rig = truth().mechanism().unwrap();
    let sweep = |load_n: f64, seems_n: f64, after_n: Option<f64>| {
        let stop = |k: i32| {
            let twist_rad = twist_from_turns(0.7 * f64::from(k));
            let position_m = -rig.solve(seems_n, twist_rad).unwrap().gap_m;
            Stop { twist_rad, position_m, half_difference_m: 10e-6 }
        };
        Sweep { load_n, after_n, zero_gap_m: Some(0.0), stops: (0..=10).map(stop).collect() }
    };
    let mut data = Data::default();
    HUNG.into_iter().for_each(|load_n| data.add_sweep(&format!("hung-{load_n}"), &base, &sweep(load_n, load_n, None)));
    data.after.push(("after".into(), sweep(HUNG[1], 1.1 * HUNG[1], Some(15.0))));
    let candidates = Candidate::all(&scene, Some(Law::LengthRatioK4), data.knows_its_zero());
    let found = identify(&scene, &data, &candidates[..1]).unwrap();
    let memory = &found.rod_memory[0];
    assert!((memory.fraction - 0.1).abs() < 0.01, "{memory:?}");
    let stated = found.scene.uncertainty.rod_memory;
    assert!((stated - memory.fraction * (HUNG[1] / 7.0).exp()).abs() < 1e-4, "{stated}");
    data.after.push(("light".into(), sweep(HUNG[1], 1.1 * HUNG[1], Some(HUNG[1] + 0.5))));
    let why = identify(&scene, &data, &candidates[..1]).map(|_| ()).unwrap_err().to_string();
    assert!(why.contains("light") && why.contains("too little"), "{why}");
    data.after.pop();
    data.after.push(("lonely".into(), sweep(3.3, 3.4, Some(15.0))));
    let why = identify(&scene, &data, &candidates[..1]).map(|_| ()).unwrap_err().to_string();
    assert!(why.contains("lonely") && why.contains("without --after"), "{why}");
}

#[test]
fn sweeps_that_do_not_belong_together_are_named() {
    let mistyped = refused(|k, _, gap| (if k == 3 { 14.0 } else { 0.0 }, gap)).unwrap_err();
    assert!(mistyped.contains("hung-10:") && mistyped.contains("what hung there"), "{mistyped}");
    let steeper = refused(|k, turns, gap| (0.0, if k == 2 { gap - 4e-5 * turns * turns } else { gap })).unwrap_err();
    assert!(steeper.contains("hung-5:"), "{steeper}");
    // The loads of the lightest and the heaviest sweep are swapped: no law is near.
    let swapped = [HUNG[4], 0.0, 0.0, 0.0, HUNG[0]];
    let swapped = refused(|k, _, gap| (swapped[k], gap)).unwrap_err();
    assert!(swapped.contains("the loads of the sweeps"), "{swapped}");
    assert_eq!(refused(|_, _, gap| (0.0, gap)), Ok(()));
}

/// What would overwrite the new scene, count the same measurement twice or take the board's estimates for weighed loads.
#[test]
fn files_that_cannot_be_meant_are_refused_by_name() {
    let files = sweeps("meant", &[2.0, 5.0, 10.0], 7.0, 5e-6);
    let scene = file("meant/new.toml");
    let here = format!("{}/./new.toml", scene.parent().unwrap().display());
    let estimates = file("meant/estimates.csv");
    std::fs::write(&estimates, "load_n,twist_rad,gap_m,load_error_n\n2,10,0.09,0.3\n").unwrap();
    let copy = file("meant/copy.csv");
    std::fs::copy(&files[1], &copy).unwrap();
    let with = |more: &[&str]| {
        let given: Vec<&str> = files.iter().map(String::as_str).chain(more.iter().copied()).collect();
        rigctl(&[&["identify"][..], &given].concat())
    };
    let scene = scene.to_str().unwrap();
    for (more, code, named) in [
        (&["--out", scene, "--figure", &here][..], 2, "--figure"),
        (&[files[0].as_str()], 2, "given twice"),
        (&[copy.to_str().unwrap()], 2, "is a copy of"),
        (&[estimates.to_str().unwrap()], 1, "estimates"),
    ] {
        let output = with(more);
        assert_eq!(output.status.code(), Some(code), "{more:?}: {}", said(&output));
        assert!(said(&output).contains(named), "{more:?}: {}", said(&output));
    }
    assert!(!std::path::Path::new(scene).exists());
}
