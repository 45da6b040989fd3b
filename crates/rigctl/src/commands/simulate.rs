//! `sim`: the firmware's ELF on the emulated board, a script, telemetry.

use super::operate::sim_options;
use crate::cli::Global;
use crate::failure::Failure;
use crate::output::Output;
use crate::script::{Action, Event, Script, ScriptFault};
use crate::session::Session;
use crate::session::client::STEP_S;
use crate::session::sim::Sim;
use serde_json::json;
use std::collections::HashMap;
use std::path::Path;
use std::time::Instant;

/// People get a line every this many seconds; `--json` prints every telemetry message.
const HUMAN_INTERVAL_S: f64 = 0.25;

/// Runs the command.
///
/// # Errors
/// If the script is wrong, or the emulated board stopped.
pub fn run(global: &Global, script: Option<&Path>, seconds: f64, output: &mut Output) -> Result<(), Failure> {
    let script = match script {
        Some(path) => {
            let text = std::fs::read_to_string(path)
                .map_err(|e| Failure::failed(format!("script {}: {e}", path.display())))?;
            Script::parse(&text).map_err(|e| Failure::failed(format!("script {}: {e}", path.display())))?
        }
        None if seconds > 0.0 && seconds.is_finite() => Script::idle(seconds),
        None => return Err(Failure::Usage(format!("--seconds {seconds}: must be above 0"))),
    };
    let started = Instant::now();
    let mut session = Session::new(Box::new(Sim::start(&sim_options(global))?));
    // Without a greeting the board moves nothing.
    session.greet_at_boot();
    let mut events = script.events.iter().peekable();
    let mut asked: HashMap<u16, usize> = HashMap::new();
    let mut next_line_s = 0.0;
    while session.now_s() < script.end_s - 0.5 * STEP_S {
        while let Some(event) = events.next_if(|e| e.t_s <= session.now_s() + 1e-9) {
            play(event, &mut session, &mut asked, global.seed)?;
        }
        session.step()?;
        for row in session.take_rows() {
            output.object(&row)?;
            if !output.json() && row.t_s >= next_line_s {
                output.line(row.text())?;
                next_line_s = row.t_s + HUMAN_INTERVAL_S;
            }
        }
        for (t_s, kind) in session.take_events() {
            output.line(format!("{t_s:8.2} s  event {kind:?}"))?;
        }
        for (number, result) in session.take_replies() {
            if let (Some(line), Err(refusal)) = (asked.get(&number), result) {
                eprintln!("script line {line}: refused: {refusal}");
            }
        }
        for line in session.take_log() {
            output.line(format!("           log {line}"))?;
        }
    }
    let wall_s = started.elapsed().as_secs_f64();
    let emulated_s = session.now_s();
    let Some(emulated) = session.emulated() else {
        return Err(Failure::failed("not an emulated board"));
    };
    let stats = emulated.stats()?;
    output.object(&json!({"summary": {
        "instructions_per_tick_mean": stats.instructions_per_tick_mean,
        "instructions_per_tick_max": stats.instructions_per_tick_max,
        "core_busy": stats.core_busy,
        "realtime_factor": emulated_s / wall_s,
        "seed": global.seed,
        "stack_high_water_bytes": stats.stack_high_water_bytes,
    }}))?;
    output.line(format!(
        "{emulated_s:.2} s emulated in {wall_s:.2} s; control tick {:.0} instructions mean, {:.0} at most; core busy {:.2} %; \
         stack {} bytes; seed {}",
        stats.instructions_per_tick_mean,
        stats.instructions_per_tick_max,
        stats.core_busy * 100.0,
        stats.stack_high_water_bytes,
        global.seed
    ))?;
    Ok(())
}

fn play(event: &Event, session: &mut Session, asked: &mut HashMap<u16, usize>, seed: u64) -> Result<(), Failure> {
    let not_emulated = || Failure::failed("not an emulated board");
    let at_line = |failure: Failure| match failure.message() {
        Some(message) => Failure::failed(format!("script line {}: {message}", event.line)),
        None => failure,
    };
    match &event.action {
        Action::Command(request) => {
            let number = session.post(request)?;
            asked.insert(number, event.line);
        }
        Action::Plant(setting) => {
            session.emulated().ok_or_else(not_emulated)?.plant(setting).map_err(at_line)?;
        }
        Action::Fault { fault: ScriptFault::Rig(name), on } => {
            session.emulated().ok_or_else(not_emulated)?.fault(name, *on).map_err(at_line)?;
        }
        Action::Fault { fault: ScriptFault::HostSilent, on } => session.set_heartbeat(!on),
        Action::Fault { fault: ScriptFault::LinkNoise, on } => session.set_link_noise(on.then_some(seed)),
        Action::Fault { fault: ScriptFault::PowerCycle, .. } => {
            session.emulated().ok_or_else(not_emulated)?.power_cycle().map_err(at_line)?;
        }
    }
    Ok(())
}
