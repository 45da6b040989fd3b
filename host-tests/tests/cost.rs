//! Instructions on the emulated board for each way to evaluate the mechanism, all in one image
//! (`lab/cost-image`).

use host_tests::{root, scene};
use rig_emulator::machine::{Config, Machine};
use rig_plant::PlantSettings;
use rig_plant::rig::EmulatedRig;
use table_forms::considered::peers;
use tsa_table::instruction_model::lookup_instructions;

/// The quantity that a way computes, and the kind of its error.
#[derive(Clone, Copy, PartialEq)]
enum Answer {
    /// The gap (m).
    Gap,
    /// The twist from load and gap (relative).
    Twist,
    /// The square root of the load (relative).
    Root,
}
use Answer::{Gap, Root, Twist};

/// Symbol, description, computed quantity, and the table whose lookup is predicted, in the order of the board's
/// results: first in f32, then in f64.
const WAYS: [(&str, &str, Answer, &str); 22] = [
    ("cost_lookup", "table: gap and gradient", Gap, "TABLE"),
    ("cost_inverse_twist", "table: twist from load and gap", Twist, ""),
    ("cost_arc_few", "table with few ranges", Gap, "ARC_FEW"),
    ("cost_arc_many", "table with many ranges", Gap, "ARC_MANY"),
    ("cost_series", "Chebyshev series in F^(-1/2)", Gap, "SERIES"),
    ("cost_series_log", "Chebyshev series in ln F", Gap, "SERIES_LOG"),
    ("cost_series_ratio", "Chebyshev series in F/(F + b)", Gap, "SERIES_RATIO"),
    ("cost_hermite", "bicubic Hermite grid", Gap, "HERMITE"),
    ("cost_bilinear", "bilinear grid", Gap, "BILINEAR"),
    ("cost_interpn", "interpn, cubic, gap only", Gap, ""),
    ("cost_sqrt_micromath", "square root by micromath", Root, ""),
    ("cost_sqrt_libm", "square root by libm", Root, ""),
    ("cost_sqrt_fpu", "square root by the FPU", Root, ""),
    ("cost_rigid", "rigid rods, f64", Gap, ""),
    ("cost_beam_column", "beam-column, f64", Gap, ""),
    ("cost_pseudo_rigid", "pseudo-rigid body, f64", Gap, ""),
    ("cost_elastica", "elastica, f64", Gap, ""),
    ("cost_inextensible", "inextensible, f64", Gap, ""),
    ("cost_full", "full solver, f64", Gap, ""),
    ("cost_continuation", "continuation, f64", Gap, ""),
    ("cost_collocation", "collocation with 16 intervals, f64", Gap, ""),
    ("cost_paper", "the paper's, 8 steps, factor 1, f64", Gap, ""),
];
/// Called for few states only.
const FEW: [&str; 2] = ["cost_collocation", "cost_paper"];
/// Only in the image that `cargo xtask cost` builds.
const INTERPN: &str = "cost_interpn";

/// Load, twist and the results of all ways at one state, as the board printed them.
struct State {
    load_n: f64,
    twist_rad: f64,
    answers: Vec<f64>,
}

impl State {
    fn read(line: &str) -> Self {
        let mut words = line.split([' ', ',', '[', ']']).filter(|word| !word.is_empty());
        // They are f32 on the board; their shortest decimals are other numbers in f64.
        let mut single = || f64::from(words.next().unwrap().parse::<f32>().unwrap());
        let (load_n, twist_rad) = (single(), single());
        let numbers = words.map(|word| word.parse::<f64>().unwrap_or_else(|e| panic!("{word}: {e} in {line}")));
        Self { load_n, twist_rad, answers: numbers.collect() }
    }
}

/// Largest error of a way over the states at which it was called; the board prints NaN for the others.
fn worst(states: &[State], way: usize, answer: Answer) -> f64 {
    let mechanism = scene().mechanism().unwrap();
    let error = |s: &State| {
        let found = s.answers[way];
        match answer {
            Gap => (found - mechanism.solve(s.load_n, s.twist_rad).unwrap().gap_m).abs(),
            Twist => (found / s.twist_rad - 1.0).abs(),
            Root => (found / s.load_n.sqrt() - 1.0).abs(),
        }
    };
    states.iter().map(error).filter(|e| !e.is_nan()).fold(0.0, f64::max)
}

#[test]
fn no_way_to_evaluate_the_mechanism_becomes_slower() {
    let path = root().join("target/firmware/tsa-cost.elf");
    let elf = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}; `cargo xtask cost` builds it", path.display()));
    let rig = EmulatedRig::new(scene(), PlantSettings::default(), 1).unwrap();
    let mut machine = Machine::new(&elf, rig, Config::default()).unwrap();
    for (symbol, ..) in WAYS {
        assert!(machine.watch_function(symbol) || symbol == INTERPN, "the image has no {symbol}");
    }
    let mut lines = Vec::new();
    for second in 1..1200 {
        machine.run_until(f64::from(second)).unwrap();
        lines.extend(machine.defmt_lines().into_iter().map(|line| line.message));
        if lines.last().is_some_and(|l| l.starts_with("done")) {
            break;
        }
    }
    assert_eq!(lines.len(), 31, "30 states and the end: {lines:?}");
    let interpn_bytes: usize = lines[30].trim_start_matches("done ").parse().unwrap();
    let states: Vec<State> = lines[..30].iter().map(|l| State::read(l)).collect();
    assert!(states.iter().all(|s| s.answers.len() == WAYS.len()));
    println!(
        "{:<38} {:>12} {:>12} {:>12} {:>7} {:>9} numbers",
        "instructions on the emulated board", "mean", "most", "predicted", "bytes", "error"
    );
    let fit = scene().fit_table().unwrap();
    let peers = peers(&scene().mechanism().unwrap(), &scene().table_spec().unwrap(), &fit).unwrap();
    let mut csv = String::from("symbol,name,instructions_mean,instructions_max,bytes,error,error_of,states\n");
    for (way, (symbol, what, answer, peer)) in WAYS.into_iter().enumerate() {
        let Some(cost) = machine.watched(symbol) else { continue };
        assert!(cost.count == if FEW.contains(&symbol) { 3 } else { 30 }, "{symbol}: {}", cost.count);
        let error = worst(&states, way, answer);
        let chosen = &fit.table.numbers;
        // Size in words, bytes, predicted instructions.
        let table = match peers.iter().find(|(name, _)| *name == peer) {
            Some((_, c)) => Some((c.size.clone(), c.bytes, c.instructions)),
            None => (peer == "TABLE").then(|| (chosen.size(), chosen.bytes(), lookup_instructions(&chosen.series()))),
        };
        let mut bytes = table.as_ref().map(|t| t.1);
        if symbol == INTERPN {
            bytes = Some(interpn_bytes);
        }
        let predicted = table.as_ref().map(|t| t.2);
        let shown = |n: Option<usize>| n.map_or(String::new(), |n| n.to_string());
        println!(
            "{what:<38} {:>12.0} {:>12} {:>12} {:>7} {error:>9.1e} {}",
            cost.instructions_mean,
            cost.instructions_max,
            shown(predicted.map(|n| n as usize)),
            shown(bytes),
            table.map_or(String::new(), |t| t.0)
        );
        let of = match answer {
            Gap => "gap_m",
            Twist => "twist_relative",
            Root => "root_relative",
        };
        csv += &format!(
            "{symbol},\"{what}\",{:.1},{},{},{error:.3e},{of},{}\n",
            cost.instructions_mean,
            cost.instructions_max,
            shown(bytes),
            cost.count
        );
        if let Some(predicted) = predicted {
            let off = f64::from(predicted) / cost.instructions_max as f64 - 1.0;
            // The compiler treats a baseline form differently with each map of the load.
            let max = if peer == "TABLE" || peer.starts_with("ARC") { 0.06 } else { 0.15 };
            assert!(off.abs() < max, "{symbol}: {predicted} predicted, {} counted", cost.instructions_max);
        }
        // The limits follow from the models: the cheap tiers are wrong by centimetres, micromath's root by some
        // percent.
        let limit = match (answer, symbol) {
            (Gap, "cost_rigid" | "cost_beam_column" | "cost_pseudo_rigid") => 0.03,
            (Gap, "cost_full" | "cost_continuation") => 1e-12,
            (Gap, "cost_bilinear") => 1e-3,
            (Gap, _) => 2e-5,
            (Root, "cost_sqrt_micromath") => 0.07,
            (Root, _) => 1e-7,
            (Twist, _) => 1e-4,
        };
        assert!(error <= limit, "{symbol}: {error}");
    }
    let folder = root().join("out");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("cost.csv"), csv).unwrap();
    let max = |symbol: &str| machine.watched(symbol).unwrap().instructions_max;
    for (symbol, limit) in [("cost_lookup", 260), ("cost_inverse_twist", 1500)] {
        assert!(max(symbol) <= limit, "{symbol}: {}", max(symbol));
    }
}
