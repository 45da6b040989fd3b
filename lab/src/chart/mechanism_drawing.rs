//! A drawing of the mechanism to scale: rods and strings under a light and a heavy load.

use anyhow::Result;
use rig_config::Scene;
use rig_plant::units::STANDARD_GRAVITY as GRAVITY;
use rigctl::outline::{Outline, Point, outline};
use std::fmt::Write as _;
use tsa_model::{Equilibrium, PRETWIST_RAD, twist_from_turns};

/// Scale of the drawing (px per metre).
const SCALE: f64 = 6500.0;
/// Margins, height of one load's row and the space for its text (px).
const LEFT: f64 = 70.0;
const ROW: f64 = 300.0;
const TEXT: f64 = 54.0;

/// Draws the mechanism of a scene under two loads (kg) after so many motor turns past the half-turn pre-twist, each
/// above its own outline at the pre-twist. Returns SVG text.
///
/// # Errors
/// If the scene describes no mechanism, or it has no equilibrium there.
pub fn mechanism_figure(scene: &Scene, loads_kg: [f64; 2], turns: f64) -> Result<String> {
    let mechanism = scene.mechanism()?;
    let longest = mechanism.solve(loads_kg[1] * GRAVITY, PRETWIST_RAD)?.gap_m;
    let (width, height) = (2.0 * LEFT + 60.0 + SCALE * longest, 2.0 * ROW + 20.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" \
         font-size=\"14\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for (row, load_kg) in loads_kg.into_iter().enumerate() {
        let load_n = load_kg * GRAVITY;
        let before = mechanism.solve(load_n, PRETWIST_RAD)?;
        let after = mechanism.solve(load_n, twist_from_turns(turns))?;
        let top = ROW * row as f64;
        let _ = writeln!(
            svg,
            "<text x=\"{LEFT}\" y=\"{:.0}\"><tspan font-weight=\"bold\">{load_kg} kg</tspan>: {turns} turns of the strings \
             shorten the gap by {:.1} mm; one more millimetre takes {:.2} rad.</text>",
            top + 28.0,
            1e3 * (before.gap_m - after.gap_m),
            1e-3 * after.tr_rad_per_m(),
        );
        let axis = top + TEXT + 0.5 * (ROW - TEXT);
        draw(&mut svg, scene, &outline(scene, &mechanism, &before)?, axis, "#bbbbbb", "#bbbbbb");
        draw(&mut svg, scene, &outline(scene, &mechanism, &after)?, axis, "#1f4e79", "#c55a11");
        label(&mut svg, &after, axis);
    }
    svg += "</svg>\n";
    Ok(svg)
}

/// One equilibrium: the left clamp stands still, the right clamp carries the load.
fn draw(svg: &mut String, scene: &Scene, outline: &Outline, axis_px: f64, rod_colour: &str, string_colour: &str) {
    let at = |along_m: f64, across_m: f64| (LEFT + SCALE * along_m, axis_px + SCALE * across_m);
    let geometry = &scene.geometry;
    let rod_px = (2.0 * geometry.rod_radius_m * SCALE).max(2.0);
    let half_clamp_m = 0.5 * geometry.clamp_width_m;
    let drawn = |points: &[Point]| points.iter().map(|[along, across]| at(*along, *across)).collect::<Vec<_>>();
    for (k, clamp_m) in [0.0, outline.gap_m].into_iter().enumerate() {
        for rod in &outline.rods[2 * k..2 * k + 2] {
            polyline(svg, drawn(rod), rod_colour, rod_px);
        }
        let (x, y) = at(clamp_m, -half_clamp_m);
        let _ = writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{y:.1}\" width=\"10\" height=\"{:.1}\" fill=\"{rod_colour}\"/>",
            x - 5.0,
            2.0 * half_clamp_m * SCALE
        );
    }
    for string in &outline.strings {
        polyline(svg, drawn(string), string_colour, 2.0);
    }
}

/// Names the parts, and shows the load as an arrow.
fn label(svg: &mut String, state: &Equilibrium, axis_px: f64) {
    let right = LEFT + SCALE * state.gap_m;
    let middle = LEFT + 0.5 * SCALE * state.gap_m;
    let _ = writeln!(
        svg,
        "<path d=\"M{:.1} {axis_px:.1} h34 m-9 -6 l9 6 l-9 6\" stroke=\"#1f4e79\" stroke-width=\"2\" fill=\"none\"/>",
        right + 8.0
    );
    for (x, y, text) in [
        (8.0, axis_px + 5.0, "motor"),
        (right + 12.0, axis_px + 24.0, "load"),
        (LEFT + 22.0, axis_px + 5.0, "rod"),
        (middle - 22.0, axis_px + 32.0, "strings"),
    ] {
        let _ = writeln!(svg, "<text x=\"{x:.0}\" y=\"{y:.0}\" fill=\"#555555\">{text}</text>");
    }
}

fn polyline(svg: &mut String, points: impl IntoIterator<Item = (f64, f64)>, colour: &str, width_px: f64) {
    let _ = write!(svg, "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width_px:.1}\" points=\"");
    points.into_iter().for_each(|(x, y)| {
        let _ = write!(svg, "{x:.1},{y:.1} ");
    });
    *svg += "\"/>\n";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_loads_are_drawn_and_one_past_the_model_is_refused() {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/default.toml");
        let scene = Scene::load(file).expect("the default scene is good");
        let svg = mechanism_figure(&scene, [0.1, 1.5], 5.0).unwrap();
        assert!(svg.contains("0.1 kg") && svg.contains("1.5 kg"));
        // Two rods of two halves and two strings, at two twists under two loads.
        assert_eq!(svg.matches("<polyline").count(), 2 * 2 * (4 + 2));
        assert!(!svg.contains("NaN"));
        let refused = mechanism_figure(&scene, [0.001, 1.5], 5.0).unwrap_err();
        assert!(refused.downcast_ref::<tsa_model::SolveError>().is_some(), "{refused}");
    }
}
