//! Tables of real scenes against the full solver, through the code that the board runs.

use rig_config::Scene;
use rig_config::TableError;
use std::sync::OnceLock;
use tsa_model::twist_from_turns;
use tsa_table::fit::{Fit, FitError};
use tsa_table::instruction_model::{LOOKUP_INSTRUCTIONS, lookup_instructions};

fn scene() -> Scene {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/default.toml");
    Scene::load(root).unwrap()
}

fn default_fit() -> &'static Fit {
    static FIT: OnceLock<Fit> = OnceLock::new();
    FIT.get_or_init(|| scene().fit_table().unwrap())
}

#[test]
fn the_default_table_meets_its_scene_in_few_bytes() {
    let fit = default_fit();
    for c in &fit.candidates {
        println!(
            "{:5} {:28} {} B, contraction {:.2e} (rms {:.1e}) m, TR {:.2e} (rms {:.1e})",
            c.passes,
            c.table.numbers.size(),
            c.table.numbers.bytes(),
            c.errors.contraction_max_m,
            c.errors.contraction_rms_m,
            c.errors.tr_max,
            c.errors.tr_rms
        );
    }
    println!("{:?}", fit.error_bounds);
    let e = &fit.error_bounds.errors;
    assert!(e.contraction_max_m <= 5e-6 && e.tr_max <= 2e-3);
    assert!(fit.error_bounds.points >= 20_000 && fit.error_bounds.monotone);
    let table = fit.table.table();
    assert!(table.series.bytes() <= 512, "{} bytes", table.series.bytes());
    assert!(table.is_intact());
    let c = &fit.error_bounds;
    let rounding = c.rounding;
    // Gap and gradient differ only by the jumps between ranges and by rounding.
    assert!(c.closure_m > 0.0 && c.closure_m <= c.errors.contraction_max_m, "{}", c.closure_m);
    assert!(rounding.arithmetic_m > 1e-9 && rounding.arithmetic_m < 2e-7 && rounding.tr_arithmetic < 1e-5);
    assert!(lookup_instructions(&table.series) <= LOOKUP_INSTRUCTIONS);
    assert!(table.metadata.contraction_error_m > 0.0 && table.metadata.tr_relative_error > 0.0);
}

/// A rod that hardly resists on its plateau needs several ranges of the load.
#[test]
fn the_plateau_rod_gets_a_table_of_the_same_accuracy() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/niti-plateau.toml");
    let fit = Scene::load(root).unwrap().fit_table().unwrap();
    let (e, table) = (&fit.error_bounds.errors, fit.table.table());
    println!(
        "{}, {} bytes, {} instructions, contraction {:.2e} m, TR {:.2e}",
        fit.table.numbers.size(),
        table.series.bytes(),
        lookup_instructions(&table.series),
        e.contraction_max_m,
        e.tr_max
    );
    assert!(e.contraction_max_m <= 5e-6 && e.tr_max <= 2e-3 && fit.error_bounds.monotone);
    assert!(table.series.bytes() <= 1280, "{} bytes", table.series.bytes());
}

#[test]
fn tighter_accuracy_makes_a_larger_table_and_looser_a_smaller_one() {
    let bytes = |contraction_m: f64, tr_relative: f64| {
        let mut s = scene();
        s.accuracy = Some(rig_config::Accuracy { contraction_m, tr_relative });
        s.fit_table().unwrap().table.numbers.bytes()
    };
    let (tight, middle, loose) = (bytes(2e-6, 8e-4), bytes(5e-6, 2e-3), bytes(1e-4, 2e-2));
    let rough = bytes(1e-3, 0.2);
    println!("{tight} {middle} {loose} {rough} bytes");
    assert!(tight > middle && middle > loose && loose > rough);
}

#[test]
fn an_envelope_past_a_limit_names_the_limit_and_the_first_point() {
    let mut s = scene();
    let mechanism = s.mechanism().unwrap();
    // Under a light load the helix angle runs away before the strings lie side by side.
    for (min_n, max_turns, kind) in [(0.8, 10.0, "no-equilibrium"), (5.0, 12.0, "overtwist")] {
        s.envelope = Some(rig_config::Envelope { load_n: [min_n, 18.0], turns: [0.0, max_turns] });
        let TableError::Fit(FitError::Envelope { load_n, turns, source }) = s.fit_table().unwrap_err() else {
            panic!("not refused")
        };
        assert_eq!(source.kind(), kind);
        assert!(load_n < 4.0 * min_n && turns > 8.0, "{load_n} N, {turns} turns");
        let solved = |turns| mechanism.solve(load_n, twist_from_turns(turns)).map_err(|e| e.kind());
        assert_eq!(solved(turns).unwrap_err(), kind);
        assert!(solved(0.7 * turns).is_ok());
    }
    s.accuracy = Some(rig_config::Accuracy { contraction_m: 1e-12, tr_relative: 1e-3 });
    s.envelope = scene().envelope;
    let Err(TableError::Fit(FitError::Accuracy { best, .. })) = s.fit_table() else { panic!("not refused") };
    // The most accurate table that can be fitted, limited by f32.
    let reached: f64 = best.split(' ').next().unwrap().parse().unwrap();
    assert!(reached < 1e-6, "{best}");
}
