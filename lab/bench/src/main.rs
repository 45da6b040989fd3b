//! The cost of an equilibrium: `cargo xtask bench` runs this program beside an independent solver and under callgrind.
//!
//! It uses one thread. A state at which a method fails is counted, and its time included.

mod grid;
mod timing;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};
use grid::{Grid, PUBLISHED};
use rig_config::Scene;
use rival_methods::Method;
use serde::Serialize;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use timing::Cost;
use tsa_model::rod::TipForce;
use tsa_model::{Mechanism, Tier};

#[derive(Parser)]
#[command(about = "Cost of an equilibrium of the model", version)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Time per equilibrium over the published range, and of every method and tier on a coarse grid of the first scene
    Time {
        /// Scene files
        #[arg(required = true)]
        scenes: Vec<PathBuf>,
        /// Passes over each grid, of which the median counts
        #[arg(long, default_value_t = 25)]
        repeats: usize,
    },
    /// Solve a coarse grid several times and print the number of states: the difference of two runs under an
    /// instruction counter is the cost of the additional states
    Kernel {
        /// Scene file
        scene: PathBuf,
        /// Passes
        passes: usize,
    },
    /// Rods for an independent solver: constants, tip forces, and the tip displacements found here
    States {
        /// Scene file
        scene: PathBuf,
    },
}

/// What [`Task::Time`] prints.
#[derive(Serialize)]
struct Times {
    grid: Grid,
    coarse: Grid,
    repeats: usize,
    scenes: Vec<Named>,
    methods: Vec<Named>,
    /// A tier also estimates its error, for which it solves the half-turn pre-twist as well.
    tiers: Vec<Named>,
}

/// A cost and whose it is.
#[derive(Serialize)]
struct Named {
    name: String,
    #[serde(flatten)]
    cost: Cost,
}

/// What [`Task::States`] prints. SI units.
#[derive(Serialize)]
struct Rods {
    length_m: f64,
    radius_m: f64,
    stress_coefficients_pa: [f64; 5],
    /// Median time of the equilibrium of one of these states (µs).
    us_per_equilibrium: f64,
    /// Median time of one of these rods alone, without the helix around it (µs).
    us_per_rod: f64,
    states: Vec<RodState>,
}

/// One rod of [`Rods`].
#[derive(Clone, Copy, Serialize)]
struct RodState {
    load_n: f64,
    twist_rad: f64,
    inward_n: f64,
    sideways_n: f64,
    u_m: f64,
    w_m: f64,
}

fn main() -> Result<()> {
    match Arguments::parse().task {
        Task::Time { scenes, repeats } => print(&times(&scenes, repeats)?),
        Task::Kernel { scene, passes } => kernel(&scene, passes),
        Task::States { scene } => print(&rods(&scene)?),
    }
}

fn print(found: &impl Serialize) -> Result<()> {
    println!("{}", serde_json::to_string_pretty(found)?);
    Ok(())
}

fn mechanism(scene: &Path) -> Result<Mechanism> {
    let in_file = || format!("{}", scene.display());
    Scene::load(scene).with_context(in_file)?.mechanism().with_context(in_file)
}

fn times(scenes: &[PathBuf], repeats: usize) -> Result<Times> {
    let (grid, coarse) = (PUBLISHED, PUBLISHED.with(8, 16));
    let mut found = Times { grid, coarse, repeats, scenes: Vec::new(), methods: Vec::new(), tiers: Vec::new() };
    for path in scenes {
        let mechanism = mechanism(path)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let cost = timing::cost(&grid, repeats, |load, twist| mechanism.solve(load, twist));
        found.scenes.push(Named { name, cost });
    }
    let first = mechanism(&scenes[0])?;
    for &method in Method::ALL {
        let cost = timing::cost(&coarse, repeats, |load, twist| method.solve(&first, load, twist));
        found.methods.push(Named { name: method.name().to_owned(), cost });
    }
    for tier in Tier::ALL {
        let cost = timing::cost(&coarse, repeats, |load, twist| {
            first.solve_tier(tier, load, twist).map(|tiered| tiered.equilibrium)
        });
        found.tiers.push(Named { name: tier.name().to_owned(), cost });
    }
    Ok(found)
}

fn kernel(scene: &Path, passes: usize) -> Result<()> {
    let mechanism = mechanism(scene)?;
    let states = PUBLISHED.with(8, 8).states();
    for _ in 0..passes {
        for &(load, twist) in &states {
            black_box(mechanism.solve(black_box(load), black_box(twist))?);
        }
    }
    println!("{}", passes * states.len());
    Ok(())
}

fn rods(scene: &Path) -> Result<Rods> {
    let mechanism = mechanism(scene)?;
    let parameters = mechanism.parameters();
    // From nearly straight to bent as far as anything published, at little and much helix angle.
    let states = PUBLISHED.with(4, 3).states();
    let states = states.into_iter().map(|(load_n, twist_rad)| {
        let e = mechanism.solve(load_n, twist_rad)?;
        let sideways_n = 0.5 * load_n;
        let inward_n = sideways_n * e.alpha_rad.tan();
        Ok(RodState { load_n, twist_rad, inward_n, sideways_n, u_m: e.u_m, w_m: e.w_m })
    });
    let states = states.collect::<Result<Vec<_>>>()?;
    let rod = mechanism.rod();
    Ok(Rods {
        length_m: parameters.free_length_m(),
        radius_m: parameters.rod_radius_m,
        stress_coefficients_pa: parameters.stress_coefficients_pa,
        us_per_equilibrium: timing::typical_us(&states, |s| {
            let _ = black_box(mechanism.solve(s.load_n, s.twist_rad));
        }),
        us_per_rod: timing::typical_us(&states, |s| {
            let _ = black_box(rod.respond(TipForce { inward_n: s.inward_n, sideways_n: s.sideways_n }));
        }),
        states,
    })
}
