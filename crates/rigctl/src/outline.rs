//! The mechanism to scale: rods and strings as the model computes them.

use rig_config::Scene;
use std::f64::consts::PI;
use tsa_model::rod::TipForce;
use tsa_model::{Equilibrium, Mechanism, SolveError};

/// Points along half a rod.
const ROD_POINTS: usize = 81;
/// Points of the twisted strings per turn.
const POINTS_PER_TURN: f64 = 24.0;

/// Two coordinates (m); of half a rod along the unbent rod from the clamp, and sideways towards the strings.
pub type Point = [f64; 2];

/// The lines of one equilibrium, by their points along the strings from the first clamp and across from their axis (m).
#[derive(Debug, Clone)]
pub struct Outline {
    /// Two halves of a rod at each clamp, from the clamp to the tip.
    pub rods: Vec<Vec<Point>>,
    /// The two strings.
    pub strings: [Vec<Point>; 2],
    /// Distance of the clamps (m).
    pub gap_m: f64,
}

/// The outline of an equilibrium of a scene's mechanism.
///
/// # Errors
/// [`SolveError::SectionSingular`] of a rod.
pub fn outline(scene: &Scene, mechanism: &Mechanism, state: &Equilibrium) -> Result<Outline, SolveError> {
    let path = rod_path(mechanism, state)?;
    let half_clamp_m = 0.5 * scene.geometry.clamp_width_m;
    let halves = [(0.0, 1.0), (state.gap_m, -1.0)].into_iter().flat_map(|clamp| [(clamp, -1.0), (clamp, 1.0)]);
    let rods = halves
        .map(|((clamp_m, way), side)| {
            path.iter().map(|[x, w]| [clamp_m + way * w, side * (half_clamp_m + x)]).collect()
        })
        .collect();
    // Eq. 25 unrolled: at the helix angle the strings run from the rods' tips to the axis, and there around each other.
    let slope = state.alpha_rad.tan();
    let start_m = state.w_m;
    let lead_m = 0.5 * state.d_m / slope;
    let twisted_m = state.x_m - 2.0 * lead_m;
    let steps = (state.twist_rad / (2.0 * PI) * POINTS_PER_TURN).ceil().max(2.0) as usize;
    let strings = [-1.0, 1.0].map(|side: f64| {
        let mut points = vec![[start_m, side * 0.5 * state.d_m]];
        points.extend((0..=steps).map(|k| {
            let fraction = k as f64 / steps as f64;
            [start_m + lead_m + fraction * twisted_m, side * state.r_m * (fraction * state.twist_rad).cos()]
        }));
        let end_side = side * state.twist_rad.cos().signum();
        points.push([start_m + state.x_m, end_side * 0.5 * state.d_m]);
        points
    });
    Ok(Outline { rods, strings, gap_m: state.gap_m })
}

/// The bent half of a rod, from the clamp to the tip.
fn rod_path(mechanism: &Mechanism, state: &Equilibrium) -> Result<Vec<Point>, SolveError> {
    let mut path = vec![[0.0; 2]; ROD_POINTS];
    let rod = mechanism.rod();
    rod.path(TipForce::of(state), [rod.length_m + state.u_m, state.w_m], &mut path)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tsa_model::twist_from_turns;

    fn scene() -> Scene {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/default.toml");
        Scene::load(file).expect("the default scene is good")
    }

    /// The path is integrated on its own way, so that its end checks the solver as well as the drawing.
    #[test]
    fn the_drawn_rod_ends_where_the_solver_says() {
        let scene = scene();
        let mechanism = scene.mechanism().unwrap();
        for (load_n, turns) in [(1.0, 0.0), (5.0, 3.0), (15.0, 7.0)] {
            let state = mechanism.solve(load_n, twist_from_turns(turns)).unwrap();
            let length_m = 0.5 * (scene.geometry.rod_span_m - scene.geometry.clamp_width_m);
            let [x, w] = *rod_path(&mechanism, &state).unwrap().last().unwrap();
            assert!((x - length_m - state.u_m).abs() < 1e-9, "{load_n} N: {x} m along the rod");
            assert!((w - state.w_m).abs() < 1e-9, "{load_n} N: {w} m sideways, {} m by the solver", state.w_m);
        }
    }
}
