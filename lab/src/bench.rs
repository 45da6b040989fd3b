//! What an equilibrium costs: `cargo xtask bench` runs `tsa-lab bench` beside an independent solver and under callgrind.
//!
//! One thread. The time of a state at which the solver fails is included. Times are medians of many passes: other load on
//! the machine disturbs some of them, but not most.

use crate::chart::work_precision::states;
use anyhow::{Context, Result};
use rig_config::Scene;
use rigctl::failure::Failure;
use rigctl::output::Output;
use rigctl::statistics::median;
use serde_json::{Value, json};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tsa_model::rod::TipForce;
use tsa_model::{Equilibrium, Mechanism};

/// Longest time for one row; a slow row gets fewer passes, but at least three.
const LONGEST: Duration = Duration::from_secs(6);
const FEWEST: usize = 3;

/// `tsa-lab bench`.
#[derive(Debug, clap::Subcommand)]
pub enum Task {
    /// Time per equilibrium on a fine grid of the published range
    Time {
        /// Scene files
        #[arg(required = true)]
        scenes: Vec<PathBuf>,
        /// Passes over each grid, of which the median counts
        #[arg(long, default_value_t = 25)]
        repeats: usize,
    },
    /// A coarse grid several times, which prints the number of states: the difference of two runs under an instruction counter is
    /// the cost of the additional states
    Kernel {
        /// Scene file
        scene: PathBuf,
        /// Passes over the grid
        passes: usize,
    },
    /// Rods for an independent solver: constants, tip forces, and the tip displacements found here
    States {
        /// Scene file
        scene: PathBuf,
    },
}

impl Task {
    /// Runs the command.
    ///
    /// # Errors
    /// If a scene describes no mechanism, or a state of it has no equilibrium.
    pub fn run(&self, output: &mut Output) -> Result<(), Failure> {
        match self {
            Self::Time { scenes, repeats } => {
                let scenes = scenes.iter().map(|scene| cost(scene, *repeats)).collect::<Result<Vec<Value>>>()?;
                output.line(serde_json::to_string_pretty(&json!({ "scenes": scenes }))?)?;
            }
            Self::Kernel { scene, passes } => {
                let (mechanism, states) = (mechanism(scene)?, states(8, 8));
                for (load, twist) in (0..*passes).flat_map(|_| &states) {
                    black_box(mechanism.solve(black_box(*load), black_box(*twist))?);
                }
                output.line((passes * states.len()).to_string())?;
            }
            Self::States { scene } => output.line(serde_json::to_string_pretty(&rods(&mechanism(scene)?)?)?)?,
        }
        Ok(())
    }
}

fn mechanism(scene: &Path) -> Result<Mechanism> {
    let in_file = || format!("{}", scene.display());
    Scene::load(scene).with_context(in_file)?.mechanism().with_context(in_file)
}

/// Cost of a scene's grid: median time of a pass, and of a state of it.
fn cost(scene: &Path, repeats: usize) -> Result<Value> {
    let (mechanism, states) = (mechanism(scene)?, states(64, 128));
    let seconds = median_s(repeats, || {
        for (load, twist) in &states {
            let _ = black_box(mechanism.solve(black_box(*load), black_box(*twist)));
        }
    });
    let name = scene.file_stem().unwrap_or_default().to_string_lossy();
    let (count, us) = (states.len(), seconds * 1e6 / states.len() as f64);
    Ok(json!({ "name": name, "states": count, "seconds": seconds, "us": us }))
}

/// The rods of some states, and the median times of an equilibrium and of one rod alone, without the helix around it. SI units
/// and µs.
fn rods(mechanism: &Mechanism) -> Result<Value> {
    // From nearly straight to bent as far as anything published, at little and much helix angle.
    let solved = states(4, 3).into_iter().map(|(load, twist)| Ok((load, twist, mechanism.solve(load, twist)?)));
    let solved = solved.collect::<Result<Vec<(f64, f64, Equilibrium)>>>()?;
    let (parameters, rod) = (mechanism.parameters(), mechanism.rod());
    let us_per_equilibrium = typical_us(&solved, |(load, twist, _)| {
        let _ = black_box(mechanism.solve(*load, *twist));
    });
    let us_per_rod = typical_us(&solved, |(.., e)| {
        let _ = black_box(rod.respond(TipForce::of(e)));
    });
    let state = |(load_n, twist_rad, e): &(f64, f64, Equilibrium)| {
        let TipForce { inward_n, sideways_n } = TipForce::of(e);
        json!({
            "load_n": load_n, "twist_rad": twist_rad, "inward_n": inward_n, "sideways_n": sideways_n, "u_m": e.u_m, "w_m": e.w_m,
        })
    };
    Ok(json!({
        "length_m": parameters.free_length_m(),
        "radius_m": parameters.rod_radius_m,
        "stress_coefficients_pa": parameters.stress_coefficients_pa,
        "us_per_equilibrium": us_per_equilibrium,
        "us_per_rod": us_per_rod,
        "states": solved.iter().map(state).collect::<Vec<_>>(),
    }))
}

/// Median over states of the time that solving one takes (µs).
fn typical_us<T>(states: &[T], solve: impl Fn(&T)) -> f64 {
    // A single solution takes little more than the clock's resolution.
    const ROUNDS: usize = 50;
    let each = |state| 1e6 * median_s(25, || (0..ROUNDS).for_each(|_| solve(black_box(state)))) / ROUNDS as f64;
    median(&mut states.iter().map(each).collect::<Vec<_>>())
}

/// Median time of a pass (s).
fn median_s(repeats: usize, pass: impl Fn()) -> f64 {
    let mut times = Vec::with_capacity(repeats);
    let start = Instant::now();
    while times.len() < FEWEST || (times.len() < repeats && start.elapsed() < LONGEST) {
        let before = Instant::now();
        pass();
        times.push(before.elapsed().as_secs_f64());
    }
    median(&mut times)
}
