//! The mechanism under a light and a heavy load, drawn to scale.

use super::Made;
use super::mechanism_drawing::mechanism_figure;
use crate::csv;
use anyhow::Result;
use rig_config::Scene;
use rig_plant::units::STANDARD_GRAVITY as STANDARD_GRAVITY_M_PER_S2;
use serde::Serialize;
use tsa_model::twist_from_turns;

/// Loads (kg), and turns past the half-turn pre-twist.
const LOADS_KG: [f64; 2] = [0.1, 1.5];
const TURNS: f64 = 4.0;

/// A state of the drawing. SI units.
#[derive(Serialize)]
struct State {
    load_kg: f64,
    turns: f64,
    gap_m: f64,
    x_m: f64,
    d_m: f64,
    r_m: f64,
    w_m: f64,
    tr_rad_per_m: f64,
}

/// Draws the mechanism to scale, with the numbers of the drawing as data.
///
/// # Errors
/// If the mechanism has no equilibrium there.
pub fn make(scene: &Scene) -> Result<Made> {
    let mechanism = scene.mechanism()?;
    let mut states = Vec::new();
    for load_kg in LOADS_KG {
        for turns in [0.0, TURNS] {
            let e = mechanism.solve(load_kg * STANDARD_GRAVITY_M_PER_S2, twist_from_turns(turns))?;
            let tr_rad_per_m = e.tr_rad_per_m();
            states.push(State {
                load_kg,
                turns,
                gap_m: e.gap_m,
                x_m: e.x_m,
                d_m: e.d_m,
                r_m: e.r_m,
                w_m: e.w_m,
                tr_rad_per_m,
            });
        }
    }
    let said = format!("to scale, {} and {} kg, {TURNS} turns after the pre-twist", LOADS_KG[0], LOADS_KG[1]);
    let svg = Some(mechanism_figure(scene, LOADS_KG, TURNS)?);
    Ok(Made { name: "mechanism", svg, csv: csv(states)?, findings: vec![said], left_out: Vec::new() })
}
