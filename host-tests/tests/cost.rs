//! Instructions on the emulated board for each way of knowing the mechanism, all in one image (`src/bin/cost.rs`).

use host_tests::{root, scene};
use rig_emulator::machine::{Config, Machine};
use rig_emulator::rig::Rig;
use rig_emulator::rig::settings::PlantSettings;
use tsa_table::effort::lookup_instructions;

/// Symbol, what it is, and the peer whose lookup is predicted.
const WAYS: [(&str, &str, &str); 19] = [
    ("cost_lookup", "table: gap and gradient", "TABLE"),
    ("cost_inverse_load", "table: load from twist and gap", ""),
    ("cost_inverse_twist", "table: twist from load and gap", ""),
    ("cost_arc_short", "mixed form, few ranges", "ARC_SHORT"),
    ("cost_arc_long", "mixed form, many ranges", "ARC_LONG"),
    ("cost_series", "Chebyshev series in F^(-1/2)", "SERIES"),
    ("cost_series_log", "Chebyshev series in ln F", "SERIES_LOG"),
    ("cost_series_ratio", "Chebyshev series in F/(F + b)", "SERIES_RATIO"),
    ("cost_hermite", "bicubic Hermite grid", "HERMITE"),
    ("cost_bilinear", "bilinear grid", "BILINEAR"),
    ("cost_interpn", "interpn, cubic, gap only", ""),
    ("cost_rigid", "rigid rods, f64", ""),
    ("cost_beam_column", "beam-column, f64", ""),
    ("cost_pseudo_rigid", "pseudo-rigid body, f64", ""),
    ("cost_elastica", "elastica, f64", ""),
    ("cost_inextensible", "inextensible, f64", ""),
    ("cost_full", "full solver, f64", ""),
    ("cost_full_single", "full solver, f32", ""),
    ("cost_collocation", "collocation with 16 intervals, f64", ""),
];

#[test]
fn no_way_of_knowing_the_mechanism_becomes_dearer() {
    let path = root().join("target/firmware/tsa-cost.elf");
    let elf = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}; `cargo xtask cost` builds it", path.display()));
    let rig = Rig::new(scene(), PlantSettings::default(), 1).unwrap();
    let mut machine = Machine::new(&elf, rig, Config::default()).unwrap();
    for (symbol, ..) in WAYS {
        assert!(machine.watch_function(symbol), "the image has no {symbol}");
    }
    let mut lines = Vec::new();
    for second in 1..600 {
        machine.run_until(f64::from(second)).unwrap();
        lines.extend(machine.defmt_lines());
        if lines.last().is_some_and(|l| l.message.contains("done")) {
            break;
        }
    }
    assert_eq!(lines.len(), 31, "30 states and the end: {lines:?}");
    println!(
        "{:<38} {:>12} {:>12} {:>12} {:>7} numbers",
        "instructions on the emulated board", "mean", "most", "predicted", "bytes"
    );
    let fit = tsa_table::fit::fit(scene()).unwrap();
    let peers = tsa_table::fit::peers(&fit);
    for (symbol, what, peer) in WAYS {
        let cost = machine.watched(symbol).unwrap();
        assert_eq!(cost.count, 30, "{symbol}");
        print!("{what:<38} {:>12.0} {:>12}", cost.instructions_mean, cost.instructions_max);
        let table = match peers.iter().find(|(name, _)| *name == peer) {
            Some((_, c)) => Some(&c.table),
            None => (peer == "TABLE").then_some(&fit.table),
        };
        let Some(table) = table else {
            println!();
            continue;
        };
        let predicted = f64::from(lookup_instructions(&table.table()));
        println!("{predicted:>12} {:>7} {}", table.table().form.bytes(), table.numbers.size());
        let off = predicted / cost.instructions_max as f64 - 1.0;
        assert!(off.abs() < 0.06, "{symbol}: {predicted} predicted, {} counted", cost.instructions_max);
    }
    let most = |symbol: &str| machine.watched(symbol).unwrap().instructions_max;
    for (symbol, limit) in [("cost_lookup", 250), ("cost_inverse_load", 1500), ("cost_inverse_twist", 1500)] {
        assert!(most(symbol) <= limit, "{symbol}: {}", most(symbol));
    }
}

/// Bytes that a bilinear grid in F^(-1/2) and twist needs for the scene's contraction, by doubling.
#[test]
fn a_bilinear_grid_of_equal_accuracy_is_hundreds_of_times_larger() {
    let mechanism = scene().mechanism().unwrap();
    let (envelope, accuracy) = scene().table_demand().unwrap();
    let [u0, u1] = [envelope.load_n[1], envelope.load_n[0]].map(|f| f.powf(-0.5));
    let [t0, t1] = [std::f64::consts::PI, envelope.twist_rad()[1]];
    let gap =
        |u: f64, t: f64| mechanism.solve(u.powi(-2).clamp(envelope.load_n[0], envelope.load_n[1]), t).unwrap().gap_m;
    let mut cells = 16;
    let bytes = loop {
        let (h, k) = ((u1 - u0) / f64::from(cells), (t1 - t0) / f64::from(2 * cells));
        // A cell's worst is near its middle; 12 x 24 of them show the grid's.
        let mut worst = 0f64;
        for i in 0..12 {
            for j in 0..24 {
                let (u, t) = (u0 + h * f64::from(i * cells / 12), t0 + k * f64::from(j * cells / 12));
                let mean = |t: f64| 0.5 * (gap(u, t) + gap(u + h, t));
                let error = |t: f64, estimate: f64| estimate - gap(u + 0.5 * h, t);
                let contraction = error(t + 0.5 * k, 0.5 * (mean(t) + mean(t + k))) - error(t0, mean(t0));
                worst = worst.max(contraction.abs());
            }
        }
        let bytes = 4 * (cells + 1) * (2 * cells + 1);
        println!("bilinear, {}x{} nodes, {bytes} bytes: contraction within {worst:.1e} m", cells + 1, 2 * cells + 1);
        if worst <= accuracy.contraction_m {
            break bytes;
        }
        cells *= 2;
    };
    let table = tsa_table::fit::fit(scene()).unwrap().table;
    assert!(bytes as usize > 100 * table.table().form.bytes());
}
