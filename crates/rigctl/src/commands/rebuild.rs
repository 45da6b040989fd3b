//! `table --board`: the board makes its own table for the scene's constants.

use super::operate::{is_sim, meet};
use super::rig_scene;
use crate::cli::Global;
use crate::failure::Failure;
use crate::output::Output;
use crate::session::interrupt;
use rig_link::messages::{Constants, EventKind, Request, TableRefusal};
use rig_scene::Scene;
use serde_json::json;

/// Longest wait for the board's table (s): seconds for most constants, a minute where states must be followed from the unloaded one.
const WAIT_S: f64 = 120.0;

/// The scene's constants as they go over the link.
pub fn constants(scene: &Scene) -> Constants {
    let (g, s) = (&scene.geometry, &scene.string);
    Constants {
        scene_hash: scene.hash(),
        geometry_m: [g.string_length_m, g.rod_span_m, g.clamp_width_m, g.rod_radius_m],
        string: s.constants(),
        twist_exponent: s.twist_exponent,
        stress_coefficients_pa: scene.material.stress_coefficients_pa,
    }
}

/// A failure while the board makes its table, which nothing but its power ends on a real one.
fn goes_on(global: &Global, failure: Failure) -> Failure {
    match failure.message() {
        Some(message) if interrupt::wanted() && !is_sim(global) => Failure::failed(format!(
            "{message}; it goes on with its table, and uses and keeps it if it is good: `status` says in a minute which one it has"
        )),
        _ => failure,
    }
}

/// Sends the constants, waits for the table, says what became of it.
///
/// # Errors
/// The board's refusal in words.
pub fn run(global: &Global, output: &mut Output) -> Result<(), Failure> {
    let scene = rig_scene(global)?;
    // The board may be built for other constants: that is what this is for.
    let mut session = meet(global)?;
    let id = session.identity().ok_or_else(|| Failure::failed("the board did not say who it is"))?;
    for (theirs, ours, what) in
        [(id.rig_hash, scene.rig_hash(), "[rig]"), (id.demand_hash, scene.demand_hash(), "[envelope] or [accuracy]")]
    {
        if theirs != ours {
            return Err(Failure::failed(format!(
                "{}: {what} is not what the board was built with, and only [geometry], [string] and [material] can be sent: \
                 build and flash for this scene",
                global.scene.display()
            )));
        }
    }
    session.wait_ready()?;
    session.request(&Request::Rebuild(constants(&scene)))?;
    let end_s = session.now_s() + WAIT_S;
    while session.now_s() < end_s {
        session.step().map_err(|failure| goes_on(global, failure))?;
        for (_, kind) in session.take_events() {
            match kind {
                EventKind::TableRebuilt { contraction_error_m, tr_relative_error, states, took_us, kept } => {
                    let took_s = took_us as f64 * 1e-6;
                    output.object(&json!({
                        "scene_hash": format!("{:08x}", scene.hash()),
                        "contraction_error_m": contraction_error_m,
                        "tr_relative_error": tr_relative_error,
                        "states": states,
                        "duration_s": took_s,
                        "kept": kept,
                    }))?;
                    output.line(format!(
                        "table made on the board: contraction within {:.2} um, TR within {:.3} %, {states} equilibria in \
                         {took_s:.1} s; {}. Home again before the next move",
                        contraction_error_m * 1e6,
                        tr_relative_error * 100.0,
                        if kept { "kept in flash" } else { "NOT kept: it is lost with the next reset" }
                    ))?;
                    return Ok(());
                }
                EventKind::TableRefused { reason, load_n_or_error_m: a, twist_rad_or_error: b } => {
                    return Err(Failure::failed(match reason {
                        TableRefusal::Model => {
                            format!(
                                "the envelope reaches past a limit of the model at {a} N and {b} rad; the old table stays"
                            )
                        }
                        TableRefusal::Accuracy => format!(
                            "the table's form reaches {:.2} um and {:.3} % of TR, not the scene's accuracy; the old table \
                             stays. Build and flash for this scene",
                            a * 1e6,
                            b * 100.0
                        ),
                        reason => format!("the board cannot make this table: {reason}; the old one stays"),
                    }));
                }
                _ => {}
            }
        }
    }
    Err(Failure::failed(format!("no table from the board within {WAIT_S} s")))
}
