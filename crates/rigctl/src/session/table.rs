//! A table that the board makes itself, for other constants than it was built with.

use super::client::Session;
use super::interrupt;
use crate::failure::Failure;
use rig_config::Scene;
use rig_link::messages::{Constants, Correction, EventKind, Request, TableRefusal};

/// What to do where the board cannot make the table itself.
const FLASH: &str = "build and flash for this scene, `TSA_SCENE=FILE cargo xtask flash` (docs/calibration.md 3)";
/// Longest wait for the board's table (s): seconds for most constants, a minute where states must be followed from the
/// unloaded one.
pub(super) const WAIT_S: f64 = 120.0;

/// The scene's constants as they go over the link.
pub fn constants(scene: &Scene) -> Constants {
    let (g, s) = (&scene.geometry, &scene.string);
    Constants {
        uncertainty: scene.uncertainty.of_table().numbers(),
        scene_hash: scene.hash(),
        geometry_m: [g.string_length_m, g.rod_span_m, g.clamp_width_m, g.rod_radius_m],
        string: s.constants(),
        twist_exponent: s.twist_exponent,
        stress_coefficients_pa: scene.material.stress_coefficients_pa,
        correction: scene.correction.map(|c| Correction {
            load_n: c.load_n.map(|load_n| load_n as f32),
            turns: c.turns.map(|turns| turns as f32),
            coefficients_m: c.coefficients_m.map(|row| row.map(|coefficient| coefficient as f32)),
        }),
    }
}

/// A table that the board has made.
#[derive(Clone, Copy, Debug)]
pub struct Rebuilt {
    /// Largest error of the contraction (m).
    pub contraction_error_m: f32,
    /// Largest relative error of TR.
    pub tr_relative_error: f32,
    /// Equilibria that were solved.
    pub states: u32,
    /// Time that the board took (s).
    pub duration_s: f64,
    /// Whether it is in flash.
    pub kept: bool,
}

/// Checks that the board can make a table for a scene: only its constants may differ, not its rig or what is demanded.
///
/// # Errors
/// Naming the tables of the scene file that differ, after `scene_name`.
pub fn check(session: &Session, scene: &Scene, scene_name: &str) -> Result<(), Failure> {
    let id = session.require_identity()?;
    for (theirs, ours, what) in
        [(id.rig_hash, scene.rig_hash(), "[rig]"), (id.demand_hash, scene.demand_hash(), "[envelope] or [accuracy]")]
    {
        if theirs != ours {
            return Err(Failure::failed(format!(
                "{scene_name}: {what} is not what the board was built with, and only [geometry], [string], [material] and \
                 [correction] can be sent: {FLASH}"
            )));
        }
    }
    Ok(())
}

/// Sends the constants and waits for the table.
///
/// # Errors
/// The board's refusal in words.
pub fn rebuild(session: &mut Session, scene: &Scene) -> Result<Rebuilt, Failure> {
    session.wait_ready()?;
    // Once it is sent the board may begin, whether its reply arrives or not.
    session.request(&Request::Rebuild(constants(scene))).map_err(|failure| interrupted(session, failure))?;
    let end_s = session.now_s() + WAIT_S;
    while session.now_s() < end_s {
        session.step().map_err(|failure| interrupted(session, failure))?;
        for (_, kind) in session.take_events() {
            match kind {
                EventKind::TableRebuilt { contraction_error_m, tr_relative_error, states, took_us, kept } => {
                    let duration_s = took_us as f64 * 1e-6;
                    return Ok(Rebuilt { contraction_error_m, tr_relative_error, states, duration_s, kept });
                }
                EventKind::TableRefused { reason, load_n_or_error_m: a, twist_rad_or_error: b } => {
                    return Err(Failure::failed(refusal(reason, a, b)));
                }
                _ => {}
            }
        }
    }
    Err(Failure::failed(format!("no table from the board within {WAIT_S} s")))
}

/// A failure while the board makes its table: on a real board an interrupt of the tool does not end that.
fn interrupted(session: &mut Session, failure: Failure) -> Failure {
    match failure.message() {
        Some(message) if interrupt::wanted() && session.emulated().is_none() => Failure::failed(format!(
            "{message}; it goes on with its table, and uses and keeps it if it is good: `status` says in a minute which one it \
             has"
        )),
        _ => failure,
    }
}

/// A refusal in words; the two numbers mean load (N) and twist (rad) for the model, errors (m, relative) for the accuracy.
fn refusal(reason: TableRefusal, a: f32, b: f32) -> String {
    match reason {
        TableRefusal::Model => {
            format!("the envelope reaches past a limit of the model at {a} N and {b} rad; the old table stays")
        }
        TableRefusal::Accuracy => format!(
            "the table's form reaches {:.2} um and {:.3} % of TR, not the scene's accuracy; the old table stays: {FLASH}",
            a * 1e6,
            b * 100.0
        ),
        reason => format!("the board cannot make this table: {reason}; the old one stays"),
    }
}
