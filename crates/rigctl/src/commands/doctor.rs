//! `doctor`: is the rig well, and if not, what to do.

use crate::diagnosis::{Check, check, examine};
use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use crate::session::Wanted;
use clap::Args;
use serde_json::{Value, json};

/// Diagnose board and actuator; print a fix for each failure
///
/// One line for each check, `ok` or `CHECK` with what to do; exit code 1 if any needs attention.
/// Checks versions, reset cause, last panic, scene, the table's certificate, faults, drive, supply, control ticks, link. The
/// motor stays where it is; sensors can only be judged fully with --home. A board of another scene is reported, not refused.
#[derive(Debug, Args)]
pub struct Doctor {
    /// Turn the shaft slowly by a hundredth of a turn of the strings each way: do motor and both encoders agree?
    #[arg(long)]
    turn: bool,
    /// Home, then turn the strings by a third of a turn and back: LVDT noise and range, encoder against drive
    #[arg(long)]
    home: bool,
}

/// Runs the command.
///
/// # Errors
/// If the scene cannot be read or is of a rig that cannot work, or anything is not well.
pub fn run(global: &Global, &Doctor { turn, home }: &Doctor, output: &mut Output) -> Result<(), Failure> {
    let scene = global.rig_config()?;
    if turn {
        output.line("The shaft turns by a hundredth of a turn of the strings each way.")?;
    }
    // A scene that asks for no table is the scene's fault, not the board's.
    scene.table_requirement()?;
    let checks = match global
        .target()
        .and_then(|target| target.connect(Wanted::Any))
        .and_then(|mut session| examine(&mut session, &scene, turn, home))
    {
        Ok(checks) => checks,
        Err(failure) => vec![check(
            "link",
            false,
            failure.message().unwrap_or_default(),
            format!("is the board powered, is {} its port, is tool and firmware one build?", global.port()),
        )],
    };
    let well = checks.iter().all(|c| c.ok);
    let emulated = global.is_emulated().then(|| global.emulated()).transpose()?;
    let port = emulated.as_ref().map_or(global.port(), |options| format!("sim (a fresh {options})"));
    let rig = emulated.map(|options| options.preset().name());
    output.object(&report(&checks, &global.port(), rig))?;
    output.line(format!("rigctl {} looking at {port}", env!("CARGO_PKG_VERSION")))?;
    for c in &checks {
        let advice = c.advice.as_ref().map_or(String::new(), |a| format!(": {a}"));
        output.line(format!("{:<5} {:<9} {}{advice}", if c.ok { "ok" } else { "CHECK" }, c.name, c.seen))?;
    }
    if well { Ok(()) } else { Err(Failure::Reported) }
}

/// The checks as JSON, of the board at a port; `rig` is the kind of an emulated one.
pub fn report(checks: &[Check], port: &str, rig: Option<&str>) -> Value {
    json!({"ok": checks.iter().all(|c| c.ok), "port": port, "rig": rig, "checks": checks})
}
