//! `sim` and `play`: a script and the telemetry of it, on the emulated board or on a real one. What only an emulator can
//! do to a rig the operator of a real one is asked to do by hand.

use super::config;
use super::operate::{connect, is_sim, same_scene, sim_options};
use crate::cli::Global;
use crate::failure::Failure;
use crate::log::write::event;
use crate::output::Output;
use crate::script::{Action, Event, Script, ScriptFault};
use crate::session::client::STEP_S;
use crate::session::sim::Sim;
use crate::session::{Session, interrupt};
use rig_link::Request;
use serde_json::json;
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// People get a line every this many seconds; `--json` prints every telemetry message.
const HUMAN_INTERVAL_S: f64 = 0.25;

/// `sim`: the emulated board, whatever the port.
///
/// # Errors
/// If the script is wrong, or the emulated board stopped.
pub fn run(global: &Global, script: Option<&Path>, seconds: f64, output: &mut Output) -> Result<(), Failure> {
    let script = match script {
        Some(path) => read(path)?.0,
        None if seconds > 0.0 && seconds.is_finite() => Script::idle(seconds),
        None => return Err(Failure::Usage(format!("--seconds {seconds}: must be above 0"))),
    };
    super::rig_scene(global)?;
    interrupt::watch();
    let mut session = Session::new(Box::new(Sim::start(&sim_options(global)?)?));
    play_through(global, &mut session, &script, output)
}

/// `play`: whatever is at the port.
///
/// # Errors
/// If the script is wrong, nobody answers, or the port fails.
pub fn play(global: &Global, script: &Path, output: &mut Output) -> Result<(), Failure> {
    if is_sim(global) {
        return run(global, Some(script), 0.0, output);
    }
    let (script, _) = read(script)?;
    play_through(global, &mut connect(global)?, &script, output)
}

/// A script file, and its text.
///
/// # Errors
/// Naming file and line.
pub fn read(path: &Path) -> Result<(Script, String), Failure> {
    let wrong = |what: String| Failure::failed(format!("script {}: {what}", path.display()));
    let text = rig_scene::files::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
    Ok((Script::parse(&text).map_err(|e| wrong(e.to_string()))?, text))
}

fn play_through(global: &Global, session: &mut Session, script: &Script, output: &mut Output) -> Result<(), Failure> {
    let (seed, mut looked) = (global.seed, false);
    let started = Instant::now();
    let mut next_line_s = 0.0;
    let mut told = None;
    let refused = play_events(session, script, seed, |session, said| {
        said.iter().for_each(|line| eprintln!("{line}"));
        // An emulated board may be what is tried with another scene; not without a word.
        if session.identity().is_some() && !std::mem::replace(&mut looked, true) {
            let told = same_scene(global, session).err().and_then(|failure| failure.message());
            told.iter().for_each(|line| eprintln!("{line}"));
        }
        for row in session.take_rows() {
            output.object(&row)?;
            if !output.json() && row.t_s >= next_line_s {
                output.line(row.text())?;
                next_line_s = row.t_s + HUMAN_INTERVAL_S;
            }
        }
        for (t_s, kind) in session.take_events() {
            output.line(format!("{t_s:8.2} s  event {}", event(&kind)))?;
        }
        // Nothing is known of them between a start of the board and its first report.
        let known = session.known_settings().copied();
        if let (true, Some(report)) = (known != told, known) {
            output.line(format!(
                "{:8.2} s  settings {} {}",
                session.now_s(),
                config::all(&report.values),
                report.kept
            ))?;
        }
        told = known;
        for line in session.take_log() {
            output.line(format!("           log {line}"))?;
        }
        Ok(ControlFlow::Continue(()))
    })?;
    let wall_s = started.elapsed().as_secs_f64();
    let emulated_s = session.now_s();
    let settings = session.known_settings().map(|report| config::all(&report.values));
    // A real board's instructions are not counted.
    let Some(emulated) = session.emulated() else { return none_refused(refused) };
    let stats = emulated.stats()?;
    output.object(&json!({"summary": {
        "instructions_per_tick_mean": stats.instructions_per_tick_mean,
        "instructions_per_tick_max": stats.instructions_per_tick_max,
        "core_busy": stats.core_busy,
        "plant_tier": stats.plant_tier,
        "realtime_factor": emulated_s / wall_s,
        "seed": seed,
        "settings": settings,
        "stack_high_water_bytes": stats.stack_high_water_bytes,
    }}))?;
    output.line(format!(
        "{emulated_s:.2} s emulated in {wall_s:.2} s; control tick {:.0} instructions mean, {:.0} at most; core busy {:.2} %; \
         stack {} bytes; seed {seed}; the plant by the {} model, the cheapest that the scene needs",
        stats.instructions_per_tick_mean,
        stats.instructions_per_tick_max,
        stats.core_busy * 100.0,
        stats.stack_high_water_bytes,
        stats.plant_tier,
    ))?;
    none_refused(refused)
}

/// The end of a script: it has failed if a command of it was refused.
fn none_refused(refused: usize) -> Result<(), Failure> {
    match refused {
        0 => Ok(()),
        1 => Err(Failure::failed("1 command of the script was refused")),
        count => Err(Failure::failed(format!("{count} commands of the script were refused"))),
    }
}

/// Plays a script to its end, or until `each` breaks off: called after every step, with what there is to be told of it,
/// refusals and what has to be done by hand. How many commands were refused. A `home` waits until the board has started.
///
/// # Errors
/// If the port fails, an event cannot happen, which is looked at before the first one does, or `each` fails.
pub fn play_events(
    session: &mut Session,
    script: &Script,
    seed: u64,
    mut each: impl FnMut(&mut Session, Vec<String>) -> Result<ControlFlow<()>, Failure>,
) -> Result<usize, Failure> {
    if session.emulated().is_some() {
        for event in &script.events {
            if let Action::Plant(change) = event.action {
                change.check_running().map_err(|error| at_line(event, error.into()))?;
            }
        }
    }
    // Without a greeting the board moves nothing.
    session.greet_at_boot();
    let mut refused = 0;
    let mut waiting: Option<&Event> = None;
    let mut events = script.events.iter().peekable();
    let mut asked: HashMap<u16, usize> = HashMap::new();
    while session.now_s() < script.end_s - 0.5 * STEP_S {
        let mut said = Vec::new();
        while let Some(event) = events.next_if(|e| e.t_s <= session.now_s() + 1e-9) {
            match event.action {
                Action::Command(Request::Home) if session.starts() => {
                    said.push(format!("script line {}: home waits until the board has started", event.line));
                    waiting = Some(event);
                    continue;
                }
                Action::Command(Request::Stop) => waiting = None,
                _ => {}
            }
            said.extend(happen(event, session, &mut asked, seed)?);
        }
        if let Some(event) = waiting.take_if(|_| !session.starts()) {
            said.extend(happen(event, session, &mut asked, seed)?);
        }
        session.step()?;
        for (number, result) in session.take_replies() {
            if let Err(refusal) = result {
                let who = asked.get(&number).map_or(String::new(), |line| format!("script line {line}: "));
                refused += usize::from(!who.is_empty());
                said.push(format!("{who}refused: {refusal}"));
            }
        }
        match each(session, said) {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(())) => break,
            Err(failure) => {
                // Nobody is there any more to see what moves; why is more telling than whether this, too, failed.
                let _ = session.stop();
                return Err(failure);
            }
        }
    }
    if let Some(event) = waiting {
        let never =
            vec![format!("script line {}: refused: the board did not start before the script's end", event.line)];
        refused += 1;
        // Whether to break off makes no difference at the end.
        let _ = each(session, never)?;
    }
    Ok(refused)
}

/// A failure with the line of the script that it is about.
fn at_line(event: &Event, failure: Failure) -> Failure {
    match failure.message() {
        Some(message) => Failure::failed(format!("script line {}: {message}", event.line)),
        None => failure,
    }
}

/// Lets an event happen, or says what the operator has to do for it.
fn happen(
    event: &Event,
    session: &mut Session,
    asked: &mut HashMap<u16, usize>,
    seed: u64,
) -> Result<Option<String>, Failure> {
    let at_line = |failure: Failure| at_line(event, failure);
    let by_hand = |what: String| Ok(Some(format!("script line {}: now by hand: {what}", event.line)));
    match &event.action {
        Action::Command(request) => {
            let number = session.post(request)?;
            asked.insert(number, event.line);
        }
        Action::Plant(change) => match session.emulated() {
            Some(emulated) => emulated.plant(*change).map_err(at_line)?,
            None => return by_hand(format!("{} = {} (SI units)", change.key, change.value)),
        },
        Action::Fault { fault: ScriptFault::Emulated(fault), on } => match session.emulated() {
            Some(emulated) => emulated.fault(*fault, *on).map_err(at_line)?,
            None => {
                return by_hand(format!("fault {} {}", fault.name(), if *on { "begins" } else { "ends" }));
            }
        },
        Action::Fault { fault: ScriptFault::HostSilent, on } => session.set_heartbeat(!on),
        Action::Fault { fault: ScriptFault::LinkNoise, on } => session.set_link_noise(on.then_some(seed)),
        Action::Fault { fault: ScriptFault::PowerCycle, .. } => {
            if !session.power_cycle().map_err(at_line)? {
                return by_hand("switch the board off and on".into());
            }
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::port::{Port, Received};
    use rig_link::Decoder;
    use std::cell::RefCell;
    use std::rc::Rc;

    /// A port without an emulator behind it.
    #[derive(Default)]
    struct Wire {
        now_s: f64,
        sent: Rc<RefCell<Vec<u8>>>,
    }

    impl Port for Wire {
        fn pass(&mut self, bytes: &[u8], seconds: f64) -> Result<Received, Failure> {
            self.sent.borrow_mut().extend(bytes);
            self.now_s += seconds;
            Ok(Received::default())
        }

        fn now_s(&self) -> f64 {
            self.now_s
        }
    }

    #[test]
    fn when_nobody_can_be_told_any_more_the_board_is_stopped() {
        let wire = Wire::default();
        let sent = Rc::clone(&wire.sent);
        let mut session = Session::new(Box::new(wire));
        let played = play_events(&mut session, &Script::idle(10.0), 1, |_, _| Err(Failure::failed("no reader")));
        assert!(played.is_err_and(|e| e.message().as_deref() == Some("no reader")));
        let mut decoder = Decoder::<Request>::new();
        let requests: Vec<Request> =
            sent.borrow().iter().filter_map(|b| decoder.push(*b)?.ok()).map(|frame| frame.body).collect();
        assert!(requests.contains(&Request::Stop), "{requests:?}");
    }

    #[test]
    fn on_a_real_rig_the_operator_is_asked_for_what_the_tool_cannot_do() {
        let text = "0 plant load=0.5kg\n1 home\n2 fault lvdt-open\n3 fault lvdt-open off\n4 fault host-silent\n\
                    5 fault power-cycle\n6 end";
        let script = Script::parse(text).unwrap_or_else(|e| panic!("{e}"));
        let mut session = Session::new(Box::new(Wire::default()));
        let mut asked = HashMap::new();
        let mut told = |event| happen(event, &mut session, &mut asked, 1).unwrap_or_else(|_| panic!("{event:?}"));
        let told: Vec<Option<String>> = script.events.iter().map(&mut told).collect();
        for (event, said) in [(0, "load = 4.9"), (2, "lvdt-open begins"), (3, "lvdt-open ends"), (5, "off and on")] {
            let line = told[event].as_ref().unwrap_or_else(|| panic!("event {event}"));
            assert!(line.contains(said) && line.contains(&format!("line {}", event + 1)), "{line}");
        }
        assert_eq!((&told[1], &told[4]), (&None, &None), "these the tool does itself");
        assert_eq!(asked.into_values().collect::<Vec<_>>(), [2]);
    }
}
