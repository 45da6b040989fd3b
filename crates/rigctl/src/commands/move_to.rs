//! `move`: brings the load to a position.

use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use crate::session::{homing, motion};
use rig_link::LoadChoice;

/// Runs the command: position (m), speed (m/s). An emulated board is homed first.
///
/// # Errors
/// The board's refusal or failure in words.
pub fn run(global: &Global, to: f64, speed: f64, load: LoadChoice, output: &mut Output) -> Result<(), Failure> {
    let mut session = global.target()?.connect()?;
    if global.is_emulated() {
        eprintln!("the emulated board starts afresh and is not homed: homing first");
        output.line(homing::home(&mut session, load, |_| {})?.text())?;
    }
    let r = motion::move_to(&mut session, to, speed, load, |_| {})?;
    output.object(&r)?;
    output.line(format!("target        {:9.4} mm", r.target_m * 1e3))?;
    let position_error = r.position_error_m.map_or(String::new(), |e| format!(" ± {:.4} mm", e * 1e3));
    output.line(format!(
        "measured      {:9.4} mm{position_error}   error {:+.1} um",
        r.position_m * 1e3,
        r.error_m * 1e6
    ))?;
    if let Some(error) = r.true_error_m {
        output.line(format!("true (emulated rig)         error {:+.1} um", error * 1e6))?;
    }
    let load_error = r.load_error_n.map_or(String::new(), |e| format!(" ± {e:.3} N"));
    output.line(format!("load          {:9.3} N{load_error}", r.load_n))?;
    output.line(format!(
        "TR            {:9.3} -> {:.3} rad/mm",
        r.tr_start_rad_per_m * 1e-3,
        r.tr_end_rad_per_m * 1e-3
    ))?;
    output.line(format!("turns         {:9.3}", r.turns))?;
    output.line(format!("time          {:9.2} s", r.duration_s))?;
    Ok(())
}
