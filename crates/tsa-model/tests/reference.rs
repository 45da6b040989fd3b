//! Every row and column of the reference equilibria, each computed there by two independent methods.

use rig_config::Scene;
use std::collections::HashMap;
use tsa_model::twist_from_turns;

fn root() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

#[test]
fn agrees_with_every_row_and_column() {
    let mut reader = csv::Reader::from_path(root().join("host-tests/reference/equilibria.csv")).unwrap();
    let mut rows = 0;
    let mut worst: HashMap<String, f64> = HashMap::new();
    for row in reader.deserialize() {
        let row: HashMap<String, String> = row.unwrap();
        let number = |key: &str| row[key].parse::<f64>().unwrap();
        let scene = Scene::load(root().join("scenes").join(format!("{}.toml", row["scene"]))).unwrap();
        let mechanism = scene.mechanism().unwrap();
        let (load, turns) = (number("load_n"), number("turns"));
        let e = mechanism.solve(load, twist_from_turns(turns)).unwrap();
        let start = mechanism.solve(load, twist_from_turns(0.0)).unwrap();
        let computed = [
            ("alpha_rad", e.alpha_rad),
            ("X_m", e.x_m),
            ("D_m", e.d_m),
            ("w_m", e.w_m),
            ("r_m", e.r_m),
            ("tension_n", e.tension_n),
            ("bending_strain", e.bending_strain),
            ("contraction_m", start.gap_m - e.gap_m),
            ("load_sag_m", start.gap_m - mechanism.start_length_m()),
            ("tr_rad_per_m", e.tr_rad_per_m()),
        ];
        for (key, value) in computed {
            let reference = number(key);
            // Printed to 12 digits; a contraction of exactly 0 at no turns has no relative error.
            let error = (value - reference).abs() / reference.abs().max(1e-6);
            let limit = if key == "tr_rad_per_m" { 1e-5 } else { 1e-7 };
            assert!(error < limit, "{} {load} N {turns} turns: {key} {value} against {reference}", row["scene"]);
            let w = worst.entry(key.to_string()).or_default();
            *w = w.max(error);
        }
        rows += 1;
    }
    assert_eq!(rows, 80);
    println!("worst relative error per column: {worst:?}");
}
