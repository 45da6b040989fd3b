//! The states that the budget is computed at: loads and twists of the scene's envelope, with the model's sensitivities.

use rig_config::{Scene, SceneError};
use std::f64::consts::{PI, TAU};
use tsa_model::scalar::{Dual, Scalar};
use tsa_model::{Mechanism, PRETWIST_RAD, Parameters};

/// Loads, evenly spaced in their logarithm.
const LOADS: u32 = 7;
/// Maximum distance of two twists (turns), so that 18 of them are weighed while homing; and the minimum and maximum number of
/// steps: short ways are weighed as a whole, and no scene has hundreds of turns.
const TURNS: f64 = 0.25;
const STEPS: [f64; 2] = [24.0, 400.0];

/// An equilibrium with what a change of a constant does to its gap.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    pub load_n: f64,
    pub twist_rad: f64,
    pub gap_m: f64,
    /// ∂G/∂θ (m/rad), negative.
    pub by_twist: f64,
    /// ∂G/∂F (m/N).
    pub by_load: f64,
    /// ∂G/∂a of the strings' arc a = θ r.
    pub by_arc: f64,
    /// Arc (m), and its derivative by the exponent of the radius model (m).
    pub arc_m: f64,
    pub arc_by_exponent: f64,
    /// ∂G for each Pa that the stress in the rods is greater at the clamp, to first order (m/Pa).
    pub by_stress: f64,
    /// Strain of the rods at the clamp.
    pub strain: f64,
}

impl State {
    /// Turns past the half-turn pre-twist.
    pub fn turns(&self) -> f64 {
        (self.twist_rad - PRETWIST_RAD) / TAU
    }
}

/// The states under one load, from the half-turn pre-twist to the last twist, evenly spaced.
#[derive(Clone, Debug)]
pub(super) struct Column(pub Vec<State>);

impl Column {
    /// Every column of a scene's envelope, from light to heavy.
    ///
    /// # Errors
    /// [`SceneError`]: no envelope, a constant that is wrong, or a state without an equilibrium.
    pub fn all(scene: &Scene) -> Result<Vec<Self>, SceneError> {
        let envelope = scene.covered()?;
        let [min_n, max_n] = envelope.load_n;
        let load = |k: u32| min_n * (max_n / min_n).powf(f64::from(k) / f64::from(LOADS - 1));
        let last = envelope.turns[1];
        let steps = (last / TURNS).ceil().clamp(STEPS[0], STEPS[1]) as u32;
        let turns = |k: u32| last * f64::from(k) / f64::from(steps);
        let state = solver(scene)?;
        let column = |f: u32| (0..=steps).map(|k| state(load(f), turns(k))).collect::<Result<_, _>>().map(Self);
        (0..LOADS).map(column).collect()
    }

    /// Of each state.
    pub fn each(&self, value: impl Fn(&State) -> f64) -> Vec<f64> {
        self.0.iter().map(value).collect()
    }

    /// Derivative by the twist of a quantity that is given at each state, by differences of the neighbours.
    pub fn by_twist(&self, values: &[f64]) -> Vec<f64> {
        let last = self.0.len() - 1;
        let slope = |k: usize| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(last));
            (values[b] - values[a]) / (self.0[b].twist_rad - self.0[a].twist_rad)
        };
        (0..=last).map(slope).collect()
    }

    /// How far the load comes up from the first twist to the last (m).
    pub fn travel_m(&self) -> f64 {
        self.0[0].gap_m - self.0[self.0.len() - 1].gap_m
    }
}

/// Solves the states of a scene, with derivatives by the modulus of the rods.
fn solver(scene: &Scene) -> Result<impl Fn(f64, f64) -> Result<State, SceneError>, SceneError> {
    let plain = scene.mechanism()?;
    let parameters = *plain.parameters();
    let mut by_modulus = Parameters::<Dual<1>>::constant(&parameters);
    let modulus = Dual::parameter(1.0, 0);
    by_modulus.stress_coefficients_pa = by_modulus.stress_coefficients_pa.map(|a| a * modulus);
    let (mechanism, material, start_length_m) = (Mechanism::of(by_modulus), scene.material, plain.start_length_m());
    // Other radius models are multiplied by (θ/π) to the power of the exponent's shift.
    let has_exponent = scene.string.twist_exponent.is_some();
    Ok(move |load_n, turns| {
        let twist_rad = tsa_model::twist_from_turns(turns);
        let found = mechanism.solve(load_n, twist_rad);
        let found = found.map_err(|limit| SceneError::Unsolvable { load_n, turns, limit })?;
        let radius = |p: &Parameters| p.radius(load_n, twist_rad, found.x_m.value(), start_length_m);
        let here = radius(&parameters);
        let arc_by_exponent = if has_exponent {
            const STEP: f64 = 1e-4;
            let shifted =
                |by: f64| radius(&Parameters { twist_exponent: parameters.twist_exponent + by, ..parameters }).radius_m;
            twist_rad * (shifted(STEP) - shifted(-STEP)) / (2.0 * STEP)
        } else {
            twist_rad * here.radius_m * (twist_rad / PI).ln()
        };
        let (by_twist, strain) = (found.dgap_dtwist_m_per_rad.value(), found.bending_strain.value());
        let stress_pa = material.stress_pa(strain);
        Ok(State {
            load_n,
            twist_rad,
            gap_m: found.gap_m.value(),
            by_twist,
            by_load: found.dgap_dload_m_per_n.value(),
            by_arc: by_twist / here.arc_by_twist,
            arc_m: twist_rad * here.radius_m,
            arc_by_exponent,
            // Rods that do not bend have no stress.
            by_stress: if stress_pa > 0.0 { found.gap_m.by[0] / stress_pa } else { 0.0 },
            strain,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::tests::scene;

    #[test]
    fn the_sensitivities_are_those_of_a_scene_with_other_constants() {
        // A law with an exponent.
        let identified = Scene::from_toml_str(include_str!("../../../scenes/paper-identified.toml")).unwrap();
        let scene = Scene { string: identified.string, ..scene() };
        let states = Column::all(&scene).unwrap();
        let column = &states[4].0;
        let state = &column[20];
        let gap = |change: &dyn Fn(&mut Scene)| {
            let mut other = scene.clone();
            change(&mut other);
            other.mechanism().unwrap().solve(state.load_n, state.twist_rad).unwrap().gap_m
        };
        let near = |found: f64, wanted: f64, what: &str| {
            assert!((found / wanted - 1.0).abs() < 0.01, "{what}: {found}, not {wanted}");
        };
        let exponent = gap(&|s| s.string.twist_exponent = s.string.twist_exponent.map(|p| p + 1e-3));
        near((exponent - state.gap_m) / 1e-3, state.by_arc * state.arc_by_exponent, "exponent");
        // The diameter scales the radius, and with it the arc.
        let thicker = gap(&|s| s.string.diameter_m *= 1.001);
        near((thicker - state.gap_m) / 1e-3, state.by_arc * state.arc_m, "radius");
        let stiffer =
            gap(&|s| s.material.stress_coefficients_pa = s.material.stress_coefficients_pa.map(|a| 1.001 * a));
        let stress_pa = scene.material.stress_pa(state.strain);
        near((stiffer - state.gap_m) / 1e-3, state.by_stress * stress_pa, "stress");
        let column = &states[4];
        let slope = column.by_twist(&column.each(|s| s.gap_m))[20];
        near(slope, state.by_twist, "twist");
    }
}
