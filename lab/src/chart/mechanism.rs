//! The mechanism under a light and a heavy load, drawn to scale.

use super::{Inputs, Made};
use anyhow::Result;
use rig_config::Scene;
use rig_plant::units::STANDARD_GRAVITY as STANDARD_GRAVITY_M_PER_S2;
use rigctl::outline::{Outline, Point, outline};
use std::fmt::Write as _;
use tsa_model::{PRETWIST_RAD, twist_from_turns};

/// Loads (kg), and turns past the half-turn pre-twist.
const LOADS_KG: [f64; 2] = [0.1, 1.5];
const TURNS: f64 = 4.0;
/// Scale of the drawing (px per metre), its left margin, the height of one load's row and the space for its text (px).
const SCALE: f64 = 6500.0;
const LEFT: f64 = 70.0;
const ROW: f64 = 300.0;
const TEXT: f64 = 54.0;

/// Draws the mechanism to scale under both loads, each above its own outline at the pre-twist.
///
/// # Errors
/// If the mechanism has no equilibrium there.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let (svg, csv) = drawing(inputs.scene, LOADS_KG, TURNS)?;
    let said = format!("to scale, {} and {} kg, {TURNS} turns after the pre-twist", LOADS_KG[0], LOADS_KG[1]);
    Ok(Made { svg: Some(svg), csv, findings: vec![said], ..Made::default() })
}

/// The SVG of two loads (kg) after the given number of turns of the strings past the pre-twist, and its numbers as CSV, SI units.
fn drawing(scene: &Scene, loads_kg: [f64; 2], turns: f64) -> Result<(String, String)> {
    let mechanism = scene.mechanism()?;
    let longest_m = mechanism.solve(loads_kg[1] * STANDARD_GRAVITY_M_PER_S2, PRETWIST_RAD)?.gap_m;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0} {:.0}\" font-family=\"sans-serif\" \
         font-size=\"14\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        2.0 * LEFT + 60.0 + SCALE * longest_m,
        2.0 * ROW + 20.0
    );
    let mut csv = "load_kg,turns,gap_m,x_m,d_m,r_m,w_m,tr_rad_per_m\n".to_owned();
    for (row, load_kg) in loads_kg.into_iter().enumerate() {
        let at = |turns| mechanism.solve(load_kg * STANDARD_GRAVITY_M_PER_S2, twist_from_turns(turns));
        let (before, after) = (at(0.0)?, at(turns)?);
        for (turns, e) in [(0.0, &before), (turns, &after)] {
            let tr = e.tr_rad_per_m();
            writeln!(csv, "{load_kg},{turns},{},{},{},{},{},{tr}", e.gap_m, e.x_m, e.d_m, e.r_m, e.w_m)?;
        }
        let top = ROW * row as f64;
        let contraction_mm = 1e3 * (before.gap_m - after.gap_m);
        writeln!(
            svg,
            "<text x=\"{LEFT}\" y=\"{:.0}\"><tspan font-weight=\"bold\">{load_kg} kg</tspan>: {turns} turns of the strings \
             shorten the gap by {contraction_mm:.1} mm; one more millimetre takes {:.2} rad.</text>",
            top + 28.0,
            1e-3 * after.tr_rad_per_m(),
        )?;
        let axis = top + TEXT + 0.5 * (ROW - TEXT);
        draw(&mut svg, scene, &outline(scene, &mechanism, &before)?, axis, ["#bbbbbb", "#bbbbbb"])?;
        draw(&mut svg, scene, &outline(scene, &mechanism, &after)?, axis, ["#1f4e79", "#c55a11"])?;
        // The load's arrow, and the names of the parts.
        let (right, middle) = (LEFT + SCALE * after.gap_m, LEFT + 0.5 * SCALE * after.gap_m);
        let arrow = format!("M{:.1} {axis:.1} h34 m-9 -6 l9 6 l-9 6", right + 8.0);
        writeln!(svg, "<path d=\"{arrow}\" stroke=\"#1f4e79\" stroke-width=\"2\" fill=\"none\"/>")?;
        for (x, y, text) in [
            (8.0, 5.0, "motor"),
            (right + 12.0, 24.0, "load"),
            (LEFT + 22.0, 5.0, "rod"),
            (middle - 22.0, 32.0, "strings"),
        ] {
            writeln!(svg, "<text x=\"{x:.0}\" y=\"{:.0}\" fill=\"#555555\">{text}</text>", axis + y)?;
        }
    }
    svg += "</svg>\n";
    Ok((svg, csv))
}

/// One equilibrium in the colours of rods and strings: the left clamp stands still, the right clamp carries the load.
fn draw(svg: &mut String, scene: &Scene, outline: &Outline, axis_px: f64, [rod, string]: [&str; 2]) -> Result<()> {
    let geometry = &scene.geometry;
    let at = |[along_m, across_m]: Point| (LEFT + SCALE * along_m, axis_px + SCALE * across_m);
    let rod_px = (2.0 * geometry.rod_radius_m * SCALE).max(2.0);
    let half_clamp_m = 0.5 * geometry.clamp_width_m;
    let clamps = [0.0, outline.gap_m].map(|clamp_m| vec![[clamp_m, -half_clamp_m], [clamp_m, half_clamp_m]]);
    let lines = clamps.iter().map(|line| (line, rod, 10.0)).chain(outline.rods.iter().map(|line| (line, rod, rod_px)));
    for (points, colour, width_px) in lines.chain(outline.strings.iter().map(|line| (line, string, 2.0))) {
        let points: String = points.iter().map(|p| at(*p)).map(|(x, y)| format!("{x:.1},{y:.1} ")).collect();
        writeln!(
            svg,
            "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width_px:.1}\" points=\"{points}\"/>"
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_loads_are_drawn_and_one_past_the_model_is_refused() {
        let scene = Scene::from_toml_str(include_str!("../../../scenes/default.toml")).unwrap();
        let (svg, _) = drawing(&scene, [0.1, 1.5], 5.0).unwrap();
        assert!(svg.contains("0.1 kg") && svg.contains("1.5 kg"));
        // Two clamps, two rods of two halves and two strings, at two twists under two loads.
        assert_eq!(svg.matches("<polyline").count(), 2 * 2 * (2 + 4 + 2));
        assert!(!svg.contains("NaN"));
        let refused = drawing(&scene, [0.001, 1.5], 5.0).unwrap_err();
        assert!(refused.downcast_ref::<tsa_model::SolveError>().is_some(), "{refused}");
    }
}
