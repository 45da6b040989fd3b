//! The mechanism under a light and a heavy load, drawn to scale.

use super::Made;
use super::mechanism_drawing::mechanism_figure;
use anyhow::Result;
use rig_config::Scene;
use rig_plant::units::STANDARD_GRAVITY as STANDARD_GRAVITY_M_PER_S2;
use rigctl::csv_text::csv_text;
use tsa_model::twist_from_turns;

/// Loads (kg), and turns past the half-turn pre-twist.
const LOADS_KG: [f64; 2] = [0.1, 1.5];
const TURNS: f64 = 4.0;

/// Draws the mechanism to scale, with the numbers of the drawing as data.
///
/// # Errors
/// If the mechanism has no equilibrium there.
pub fn make(scene: &Scene) -> Result<Made> {
    let mechanism = scene.mechanism()?;
    let mut rows = Vec::new();
    for load_kg in LOADS_KG {
        for turns in [0.0, TURNS] {
            let e = mechanism.solve(load_kg * STANDARD_GRAVITY_M_PER_S2, twist_from_turns(turns))?;
            let numbers = [load_kg, turns, e.gap_m, e.x_m, e.d_m, e.r_m, e.w_m, e.tr_rad_per_m()];
            rows.push(numbers.map(|n| n.to_string()).to_vec());
        }
    }
    let header = ["load_kg", "turns", "gap_m", "x_m", "d_m", "r_m", "w_m", "tr_rad_per_m"];
    Ok(Made {
        name: "mechanism",
        svg: Some(mechanism_figure(scene, LOADS_KG, TURNS)?),
        csv: csv_text(&header, rows)?,
        findings: vec![format!("to scale, {} and {} kg, {TURNS} turns after the pre-twist", LOADS_KG[0], LOADS_KG[1])],
        left_out: Vec::new(),
    })
}
