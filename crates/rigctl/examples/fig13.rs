//! The paper's experiment (its Fig. 13) by the library behind `rigctl`: three loads, homed, twisted 7.5 turns at 12.5 rpm.
//!
//! `cargo run --release -p rigctl --example fig13` on three emulated boards; with a device's name as its argument on a real
//! rig, under the one load that hangs there. Writes `fig13.svg` and `fig13.csv` where it is started.

use anyhow::{Context, Result};
use rig_config::Scene;
use rig_link::LoadChoice;
use rig_plant::{PlantChange, PlantKey, RigPreset};
use rigctl::failure::Failure;
use rigctl::plot::{Axis, Block, Figure, Item, KeyRow, Panel, Pen, Sample, Shape, colour};
use rigctl::session::serial::Serial;
use rigctl::session::sim::{Sim, SimOptions};
use rigctl::session::{Session, homing, motion};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::path::PathBuf;
use tsa_model::{PRETWIST_RAD, twist_from_turns};

const LOADS_KG: [f64; 3] = [0.1, 0.5, 1.5];
const TURNS: f64 = 7.5;
const SPEED_RAD_PER_S: f64 = 12.5 * TAU / 60.0;

/// Turns past the pre-twist and contraction (mm) on the way up, and the load that the rig weighed (N).
struct Sweep {
    points: Vec<(f64, f64)>,
    load_n: f64,
}

fn sweep(session: &mut Session) -> Result<Sweep, Failure> {
    session.greet()?;
    let homed = homing::home(session, LoadChoice::Auto, |_| {})?;
    session.take_rows();
    motion::turn(session, [PRETWIST_RAD, twist_from_turns(TURNS)], SPEED_RAD_PER_S, |_| Ok(()))?;
    let point = |row: rigctl::session::row::Row| {
        Some(((f64::from(row.twist_rad?) - PRETWIST_RAD) / TAU, f64::from(row.position_m?) * 1e3))
    };
    Ok(Sweep { points: session.take_rows().into_iter().filter_map(point).collect(), load_n: f64::from(homed.load_n) })
}

fn main() -> Result<()> {
    let scene_file = PathBuf::from("scenes/default.toml");
    let scene = Scene::load(&scene_file)?;
    let mut sweeps = Vec::new();
    if let Some(device) = std::env::args().nth(1) {
        let mut session = Session::new(Box::new(Serial::open(&device).map_err(Failure::into_error)?));
        sweeps.push(sweep(&mut session).map_err(Failure::into_error)?);
    } else {
        for kg in LOADS_KG {
            let plant = vec![PlantChange { key: PlantKey::Load, value: kg * rig_plant::units::STANDARD_GRAVITY }];
            let options = SimOptions { plant, rig: Some(RigPreset::Ideal), ..SimOptions::new(scene_file.clone()) };
            let mut session = Session::new(Box::new(Sim::start(&options).map_err(Failure::into_error)?));
            let swept = sweep(&mut session).map_err(Failure::into_error);
            sweeps.push(swept.with_context(|| format!("{kg} kg"))?);
        }
    }
    let mechanism = scene.mechanism()?;
    let (mut csv, mut items, mut key) = (String::from("load_n,turns,contraction_mm\n"), Vec::new(), Vec::new());
    for (k, s) in sweeps.iter().enumerate() {
        for (turns, mm) in &s.points {
            writeln!(csv, "{:.3},{turns:.4},{mm:.4}", s.load_n)?;
        }
        let gap = |turns: f64| mechanism.solve(s.load_n, PI + TAU * turns).map(|e| e.gap_m);
        let start = gap(0.0)?;
        let model: Vec<(f64, f64)> = (0..=75)
            .map(|k| f64::from(k) * 0.1)
            .map(|turns| Ok((turns, (start - gap(turns)?) * 1e3)))
            .collect::<Result<_>>()?;
        items.push(Item::Line { points: model.clone(), pen: Pen::solid(colour(k, 3)) });
        items.extend(s.points.iter().step_by(150).map(|at| Item::Mark {
            at: *at,
            shape: Shape::Circle,
            colour: colour(k, 3),
        }));
        let name = format!("{:.2} N as weighed; line: model, circles: LVDT", s.load_n);
        key.push(KeyRow::sample(Sample::Line(Pen::solid(colour(k, 3))), name));
        let (seen, solved) = (s.points.last().map_or(0.0, |p| p.1), model.last().map_or(0.0, |p| p.1));
        println!("{:6.2} N: {seen:.2} mm after {TURNS} turns, the model says {solved:.2} mm", s.load_n);
    }
    let figure = Figure {
        heading: "The paper's experiment: contraction over motor turns at 12.5 rpm".into(),
        rows: vec![vec![Panel {
            title: String::new(),
            x: Axis::linear("turns past the pre-twist", [0.0, TURNS]),
            y: Axis::linear("contraction, mm", [0.0, 45.0]),
            items,
        }]],
        panel_size: (900, 500),
        blocks: vec![Block { rows: key }],
        notes: vec!["On the emulated rig unless a device was named.".into()],
    };
    std::fs::write("fig13.svg", figure.svg()?)?;
    std::fs::write("fig13.csv", csv)?;
    println!("fig13.svg, fig13.csv");
    Ok(())
}
