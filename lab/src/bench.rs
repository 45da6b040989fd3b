//! What an equilibrium costs: `cargo xtask bench` runs `tsa-lab bench` beside an independent solver and under callgrind.
//!
//! One thread. The time of a state at which the solver fails is included. Times are medians of many passes: other load on
//! the machine disturbs some of them, but not most.

use crate::chart::work::states;
use anyhow::{Context, Result};
use rig_config::Scene;
use rigctl::failure::Failure;
use rigctl::output::Output;
use serde::Serialize;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tsa_model::Mechanism;
use tsa_model::rod::TipForce;

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

/// Cost of a scene's grid.
#[derive(Serialize)]
struct Cost {
    name: String,
    states: usize,
    /// Median time of a pass (s).
    seconds: f64,
    /// The same per state (µs).
    us: f64,
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

impl Task {
    /// Runs the command.
    ///
    /// # Errors
    /// If a scene describes no mechanism, or a state of it has no equilibrium.
    pub fn run(&self, output: &mut Output) -> Result<(), Failure> {
        match self {
            Self::Time { scenes, repeats } => {
                let scenes = scenes.iter().map(|scene| cost(scene, *repeats)).collect::<Result<Vec<Cost>>>()?;
                output.line(serde_json::to_string_pretty(&serde_json::json!({ "scenes": scenes }))?)?;
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

fn cost(scene: &Path, repeats: usize) -> Result<Cost> {
    let (mechanism, states) = (mechanism(scene)?, states(64, 128));
    let seconds = median(repeats, || {
        for (load, twist) in &states {
            let _ = black_box(mechanism.solve(black_box(*load), black_box(*twist)));
        }
    });
    let name = scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Cost { name, states: states.len(), seconds, us: seconds * 1e6 / states.len() as f64 })
}

fn rods(mechanism: &Mechanism) -> Result<Rods> {
    let parameters = mechanism.parameters();
    // From nearly straight to bent as far as anything published, at little and much helix angle.
    let states = states(4, 3).into_iter().map(|(load_n, twist_rad)| {
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
        us_per_equilibrium: typical_us(&states, |s| {
            let _ = black_box(mechanism.solve(s.load_n, s.twist_rad));
        }),
        us_per_rod: typical_us(&states, |s| {
            let _ = black_box(rod.respond(TipForce { inward_n: s.inward_n, sideways_n: s.sideways_n }));
        }),
        states,
    })
}

/// Median over `states` of the time that solving one takes (µs).
fn typical_us(states: &[RodState], solve: impl Fn(RodState)) -> f64 {
    // A single solution takes little more than the clock's resolution.
    const ROUNDS: usize = 50;
    let each =
        |state: &RodState| 1e6 * median(25, || (0..ROUNDS).for_each(|_| solve(black_box(*state)))) / ROUNDS as f64;
    middle(states.iter().map(each).collect())
}

/// Median time of a pass (s).
fn median(repeats: usize, pass: impl Fn()) -> f64 {
    let mut times = Vec::with_capacity(repeats);
    let start = Instant::now();
    while times.len() < FEWEST || (times.len() < repeats && start.elapsed() < LONGEST) {
        let before = Instant::now();
        pass();
        times.push(before.elapsed().as_secs_f64());
    }
    middle(times)
}

/// The middle one of an odd number of values, the upper of the two middle ones of an even number.
fn middle(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
