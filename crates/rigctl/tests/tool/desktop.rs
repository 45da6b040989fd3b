//! `solve`, `lookup` and `table` as a user runs them, against the reference equilibria.

use crate::common::{desktop as rigctl, file, lines as objects, root};
use serde_json::Value;

/// Rows of the reference as (scene, columns).
fn reference() -> Vec<(String, Vec<(String, f64)>)> {
    let text = std::fs::read_to_string(root().join("host-tests/reference/equilibria.csv")).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let columns =
                header[1..].iter().zip(&cells[1..]).map(|(h, c)| (h.to_string(), c.parse().unwrap())).collect();
            (cells[0].to_string(), columns)
        })
        .collect()
}

#[test]
fn solve_agrees_with_the_reference_and_has_its_keys() {
    for (scene, columns) in reference().into_iter().step_by(7) {
        let (load, turns) = (columns[0].1.to_string(), columns[1].1.to_string());
        let scene = format!("scenes/{scene}.toml");
        let output = rigctl(&["--json", "--scene", &scene, "solve", "--load", &load, "--turns", &turns]);
        let [object] = &objects(&output)[..] else { panic!("{output:?}") };
        for (key, value) in &columns {
            let computed = object[key].as_f64().unwrap_or_else(|| panic!("{key} in {object}"));
            assert!((computed - value).abs() <= 1e-5 * value.abs().max(1e-6), "{key}: {computed} against {value}");
        }
        assert_eq!(object["method"], "first-integral");
        assert_eq!(object["tier"], "full");
        assert!(object["warnings"].is_array() && object["effort"]["evaluations"].as_u64().unwrap() > 0);
        assert_eq!(object["tier_error"]["contraction_m"], 0.0);
        assert_eq!(object.as_object().unwrap().len(), columns.len() + 8);
        let number = |key: &str| object[key].as_f64().unwrap_or_else(|| panic!("{key} in {object}"));
        // The gap is that between the attachments, X, and both rods' deflections.
        assert!((number("gap_m") - number("X_m") - 2.0 * number("w_m")).abs() < 1e-3, "{object}");
        assert!(number("dgap_dload_m_per_n") > 0.0, "{object}");
        // Far twisted, a light load has no equilibrium, and so no energy is known.
        assert!(object["torque_nm"].as_f64().map_or(number("turns") > 4.0, |torque_nm| torque_nm >= 0.0), "{object}");
    }
}

#[test]
fn batches_go_on_after_a_bad_row() {
    let batch = file("batch.csv");
    std::fs::write(&batch, "load_n,turns\n4.9,1\n0,1\nx,2\n4.9,400\n4.9,2\n").unwrap();
    let path = batch.to_str().unwrap();
    let solved = objects(&rigctl(&["--json", "solve", "--batch", path]));
    let looked = objects(&rigctl(&["--json", "lookup", "--batch", path]));
    let kinds = |rows: &[Value]| rows.iter().map(|r| r["error"]["kind"].as_str().unwrap_or("ok").to_owned()).collect();
    let (solved_kinds, looked_kinds): (Vec<String>, Vec<String>) = (kinds(&solved), kinds(&looked));
    assert_eq!([&solved_kinds[..3], &solved_kinds[4..]].concat(), ["ok", "slack", "bad-row", "ok"], "{solved:?}");
    assert_ne!(solved_kinds[3], "ok");
    assert_eq!(looked_kinds, ["ok", "out-of-range", "bad-row", "out-of-range", "ok"]);
    // The table answers as the solver does, within its accuracy.
    let (table, full) = (&looked[0]["contraction_m"], &solved[0]["contraction_m"]);
    assert!((table.as_f64().unwrap() - full.as_f64().unwrap()).abs() < 5e-6);
}

#[test]
fn refusals_have_codes_and_names() {
    for (arguments, code, named) in [
        (&["solve", "--load", "5", "--turns", "1", "--method", "magic"][..], 2, "first-integral"),
        (&["solve", "--load", "5", "--turns", "1", "--tier", "9"], 2, "full"),
        (&["solve", "--load", "5mm", "--turns", "1"], 2, "load"),
        (&["solve", "--load", "5"], 2, "--turns"),
        // Options that contradict each other.
        (&["solve", "--load", "1", "--turns", "1", "--method", "guess"], 2, "guess"),
        (&["solve", "--load", "1", "--turns", "1", "--tier", "cheap"], 2, "cheap"),
        (&["solve", "--load", "1", "--turns", "1", "--method", "adaptive-shooting", "--steps", "5"], 2, "--steps"),
        (
            &["solve", "--load", "1", "--turns", "1", "--method", "continuation", "--tolerance", "1e-6"],
            2,
            "--tolerance",
        ),
        (&["solve", "--load", "1", "--turns", "1", "--method", "paper", "--tolerance", "2"], 2, "tolerance"),
        (&["solve", "--load", "1", "--turns", "1", "--tier", "rigid", "--method", "paper"], 2, "--tier"),
        (&["solve", "--load", "1", "--turns", "1", "--steps", "0"], 2, "steps"),
        (&["solve", "--load", "0", "--turns", "1"], 1, "load"),
        (&["lookup", "--load", "40N", "--turns", "1"], 1, "load_n"),
        (&["lookup", "--load", "5N", "--turns", "9"], 1, "turns 9"),
        (&["--scene", "missing.toml", "table"], 1, "missing.toml"),
    ] {
        let output = rigctl(arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(named), "{arguments:?}: {said}");
        assert!(output.stdout.is_empty());
    }
    // Without effect, and said so.
    let solved = rigctl(&["solve", "--load", "1", "--turns", "1", "--plant", "load=1kg"]);
    assert!(solved.status.success() && String::from_utf8_lossy(&solved.stderr).contains("--plant has no effect"));
}

#[test]
fn tr_is_null_at_zero_twist() {
    let [object] = &objects(&rigctl(&["--json", "solve", "--load", "0.5kg", "--turns", "-0.5"]))[..] else { panic!() };
    assert!(object["tr_rad_per_m"].is_null());
    assert!(object["warnings"].as_array().unwrap().iter().any(|w| w == "tr-infinite"), "{object}");
}

#[test]
fn table_says_what_and_why() {
    let [object] = &objects(&rigctl(&["--json", "table"]))[..] else { panic!() };
    assert!(object["bytes"].as_u64().unwrap() <= 4096);
    assert!(object["points"].as_u64().unwrap() >= 20_000);
    assert!(object["errors"]["contraction_max_m"].as_f64().unwrap() <= 5e-6);
    assert!(object["errors"]["tr_max_relative"].as_f64().unwrap() <= 2e-3);
    assert!(object["candidates"].as_array().unwrap().len() > 2);
}

#[test]
fn methods_agree_and_tiers_say_how_wrong_they_are() {
    let solve = |more: &[&str]| {
        let args = [&["--json", "solve", "--load", "0.5kg", "--turns", "3"], more].concat();
        objects(&rigctl(&args)).remove(0)
    };
    let contraction = |o: &Value| o["contraction_m"].as_f64().unwrap();
    let full = contraction(&solve(&[]));
    // The laboratory's methods, with their options: `lab/methods` compares all of them.
    let by = solve(&["--method", "collocation"]);
    assert!(by["method"] == "collocation" && (contraction(&by) - full).abs() < 1e-9, "{by}");
    let coarse = (contraction(&solve(&["--method", "collocation", "--steps", "2"])) - full).abs();
    assert!(coarse > 1e-9 && coarse < 1e-4, "{coarse}");
    for tier in ["rigid", "beam-column", "pseudo-rigid", "elastica", "inextensible", "full"] {
        let at = solve(&["--tier", tier]);
        assert_eq!(at["tier"], tier);
        let error = at["tier_error"]["contraction_m"].as_f64().unwrap();
        assert!((contraction(&at) - full).abs() <= error, "{at}");
    }
    let auto = solve(&["--tier", "auto"]);
    assert_ne!(auto["tier"], "full");
    assert!((contraction(&auto) - full).abs() <= 5e-6, "{auto}");
}
