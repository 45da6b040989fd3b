//! Tables of real scenes against the full solver, through the code that the board runs.

use rig_config::Scene;
use rig_config::TableError;
use std::sync::OnceLock;
use tsa_model::twist_from_turns;
use tsa_table::InverseError;
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
    println!("{:?}", fit.certificate);
    let e = &fit.certificate.errors;
    assert!(e.contraction_max_m <= 5e-6 && e.tr_max <= 2e-3);
    assert!(fit.certificate.points >= 20_000 && fit.certificate.monotone);
    let table = fit.table.table();
    assert!(table.series.bytes() <= 512, "{} bytes", table.series.bytes());
    assert!(table.is_intact());
    let c = &fit.certificate;
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
    let (e, table) = (&fit.certificate.errors, fit.table.table());
    println!(
        "{}, {} bytes, {} instructions, contraction {:.2e} m, TR {:.2e}",
        fit.table.numbers.size(),
        table.series.bytes(),
        lookup_instructions(&table.series),
        e.contraction_max_m,
        e.tr_max
    );
    assert!(e.contraction_max_m <= 5e-6 && e.tr_max <= 2e-3 && fit.certificate.monotone);
    assert!(table.series.bytes() <= 1280, "{} bytes", table.series.bytes());
}

#[test]
fn a_flipped_bit_is_found() {
    let fit = default_fit();
    let mut broken = fit.table.clone();
    broken.metadata.load_max_n += 1.0;
    assert!(!broken.table().is_intact());
    let mut broken = fit.table.clone();
    let coefficient = &mut broken.numbers.coefficients[3];
    *coefficient = f32::from_bits(coefficient.to_bits() ^ 1);
    assert!(!broken.table().is_intact());
}

#[test]
fn the_inverse_agrees_with_the_lookup() {
    let table = default_fit().table.table();
    let m = table.metadata;
    for i in 0..40 {
        for j in 0..40 {
            let load = m.load_min_n * (m.load_max_n / m.load_min_n).powf(i as f32 / 39.0);
            let twist = m.twist_min_rad + (m.twist_max_rad - m.twist_min_rad) * j as f32 / 39.0;
            let load = load.clamp(m.load_min_n, m.load_max_n);
            let gap = table.look_up(load, twist).unwrap().gap_m;
            let found = table.twist_from_gap(load, gap).unwrap();
            let back = table.look_up(load, found).unwrap().gap_m;
            assert!((back - gap).abs() < 1e-6, "load {load} twist {twist}: {back} {gap}");
        }
    }
}

#[test]
fn outside_the_envelope_is_refused_by_name() {
    let table = default_fit().table.table();
    let m = table.metadata;
    assert_eq!(table.look_up(0.7, 10.0).unwrap_err().parameter, "load_n");
    assert_eq!(table.look_up(18.1, 10.0).unwrap_err().parameter, "load_n");
    assert_eq!(table.look_up(f32::NAN, 10.0).unwrap_err().parameter, "load_n");
    assert_eq!(table.look_up(1.0, 3.0).unwrap_err().parameter, "twist_rad");
    assert_eq!(table.look_up(1.0, 51.0).unwrap_err().parameter, "twist_rad");
    assert_eq!(table.look_up(1.0, f32::INFINITY).unwrap_err().parameter, "twist_rad");
    // On the edge, up to rounding, is inside.
    assert!(table.look_up(0.8, twist_from_turns(7.5) as f32).is_ok());
    assert!(table.look_up(18.0, m.twist_min_rad).is_ok());
    assert!(matches!(table.twist_from_gap(5.0, 0.2), Err(InverseError::Gap { .. })));
    assert!(matches!(table.twist_from_gap(5.0, f32::NAN), Err(InverseError::Gap { .. })));
    assert!(matches!(table.twist_from_gap(f32::NAN, 0.05), Err(InverseError::Load(e)) if e.parameter == "load_n"));
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
    for (least_n, most_turns, kind) in [(0.8, 10.0, "no-equilibrium"), (5.0, 12.0, "overtwist")] {
        s.envelope = Some(rig_config::Envelope { load_n: [least_n, 18.0], turns: [0.0, most_turns] });
        let TableError::Fit(FitError::Envelope { load_n, turns, source }) = s.fit_table().unwrap_err() else {
            panic!("not refused")
        };
        assert_eq!(source.kind(), kind);
        assert!(load_n < 4.0 * least_n && turns > 8.0, "{load_n} N, {turns} turns");
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

#[test]
fn every_candidate_agrees_with_its_own_gradient() {
    for c in &default_fit().candidates {
        let table = c.table.table();
        for (load, twist) in [(0.9f32, 5.0f32), (4.0, 20.0), (13.0, 44.0)] {
            let p = table.look_up(load, twist).unwrap();
            let (df, dt) = (0.02 * load, 0.1);
            let by_load = (table.look_up(load + df, twist).unwrap().gap_m
                - table.look_up(load - df, twist).unwrap().gap_m)
                / (2.0 * df);
            let by_twist = (table.look_up(load, twist + dt).unwrap().gap_m
                - table.look_up(load, twist - dt).unwrap().gap_m)
                / (2.0 * dt);
            let name = c.table.numbers.size();
            // Between two ranges the gap jumps, by less than the error of the table.
            let jump_m = c.errors.contraction_max_m as f32;
            for (gradient, difference, step) in
                [(p.dgap_dload_m_per_n, by_load, df), (p.dgap_dtwist_m_per_rad, by_twist, dt)]
            {
                let off = (gradient - difference).abs();
                assert!(off < 0.01 * gradient.abs() + jump_m / (2.0 * step), "{name} {load} {twist}: {off}");
            }
        }
    }
}
