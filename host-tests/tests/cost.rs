//! Instructions on the emulated board for each way of knowing the mechanism, all in one image (`src/bin/cost.rs`).

use host_tests::{root, scene};
use rig_emulator::machine::{Config, Machine};
use rig_emulator::rig::Rig;
use rig_emulator::rig::settings::PlantSettings;

/// Symbol, and what it is.
const WAYS: [(&str, &str); 13] = [
    ("cost_lookup", "table: gap and gradient"),
    ("cost_inverse_load", "table: load from twist and gap"),
    ("cost_inverse_twist", "table: twist from load and gap"),
    ("cost_series", "plain Chebyshev series"),
    ("cost_hermite", "bicubic Hermite grid"),
    ("cost_bilinear", "bilinear grid"),
    ("cost_rigid", "rigid rods, f64"),
    ("cost_beam_column", "beam-column, f64"),
    ("cost_pseudo_rigid", "pseudo-rigid body, f64"),
    ("cost_elastica", "elastica, f64"),
    ("cost_inextensible", "inextensible, f64"),
    ("cost_full", "full solver, f64"),
    ("cost_collocation", "collocation with 16 intervals, f64"),
];

#[test]
fn no_way_of_knowing_the_mechanism_becomes_dearer() {
    let path = root().join("target/firmware/tsa-cost.elf");
    let elf = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}; `cargo xtask cost` builds it", path.display()));
    let rig = Rig::new(scene(), PlantSettings::default(), 1).unwrap();
    let mut machine = Machine::new(&elf, rig, Config::default()).unwrap();
    for (symbol, _) in WAYS {
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
    println!("{:<38} {:>12} {:>12}", "instructions on the emulated board", "mean", "most");
    for (symbol, what) in WAYS {
        let cost = machine.watched(symbol).unwrap();
        assert_eq!(cost.count, 30, "{symbol}");
        println!("{what:<38} {:>12.0} {:>12}", cost.instructions_mean, cost.instructions_max);
    }
    // What was measured, and a twentieth: nothing may become dearer unnoticed. Wanted are 250 and 1500.
    let most = |symbol: &str| machine.watched(symbol).unwrap().instructions_max;
    for (symbol, limit) in [("cost_lookup", 800), ("cost_inverse_load", 14_700), ("cost_inverse_twist", 19_100)] {
        assert!(most(symbol) <= limit, "{symbol}: {}", most(symbol));
    }
}
