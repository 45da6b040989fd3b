//! Plays a script on whatever is at the port. What only an emulated rig can do, the operator of a real one is asked to do
//! by hand.

use crate::failure::Failure;
use crate::output::at;
use crate::request;
use crate::script::{Action, Event, Script, ScriptFault};
use crate::session::{STEP_S, Session};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use rig_link::{Refusal, Request, State};
use std::collections::{HashMap, VecDeque};
use std::ops::ControlFlow;

/// Maximum random bytes between the frames of one step.
const NOISE_BYTES: u32 = 40;

/// Plays a script to its end, or until `each` breaks off, and returns how many commands were refused. `each` is called
/// after every step with the messages for the operator: refusals, and what has to be done by hand. A command waits until
/// the board has started, but for `stop`, which also cancels the commands that wait. A real board that falls silent ends
/// the script; an emulated one does so for a fault of the script, and starts again. A real rig that still moves at the end is
/// stopped.
///
/// # Errors
/// If the port fails, the board is silent, an event is impossible, or `each` fails.
pub fn play(
    session: &mut Session,
    script: &Script,
    seed: u64,
    mut each: impl FnMut(&mut Session, Vec<String>) -> Result<ControlFlow<()>, Failure>,
) -> Result<usize, Failure> {
    if session.emulated().is_some() {
        session.bears_silence = true;
    }
    // A board that was not greeted moves nothing.
    session.greets = true;
    session.bears_reset = true;
    let mut player = Player { seed, ..Player::default() };
    let mut events = script.events.iter().peekable();
    while session.now_s() < script.end_s - 0.5 * STEP_S {
        let mut messages = Vec::new();
        while let Some(event) = events.next_if(|e| e.t_s <= session.now_s() + 1e-9) {
            if player.must_wait(event, session) {
                messages.push(format!("script line {}: {} waits until the board has started", event.line, name(event)));
                player.waiting.push_back(event);
            } else {
                messages.extend(player.perform(event, session)?);
            }
        }
        while let Some(event) = player.waiting.pop_front_if(|_| !session.is_starting()) {
            messages.extend(player.perform(event, session)?);
        }
        if let Some(noise) = &mut player.noise {
            session.link.send_ahead(&noise_bytes(noise));
        }
        session.step()?;
        messages.extend(player.silence(session));
        messages.extend(player.take_refusals(session));
        match each(session, messages) {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(())) => break,
            Err(failure) => {
                // Nobody watches the motion any more. The first failure tells more than that of the stop.
                let _ = session.stop();
                return Err(failure);
            }
        }
    }
    if session.silent_s().is_some() {
        return Err(Failure::failed("the board is silent: whether the rig stands still is not known"));
    }
    if session.telemetry().is_some_and(|t| matches!(t.state, State::Homing | State::Moving)) {
        let ended = "the script ended while the rig moved";
        let how = if session.emulated().is_some() {
            "the emulated board ends with it"
        } else if session.stop()? {
            "stopped"
        } else {
            return Err(Failure::failed(format!("{ended}, and the board did NOT acknowledge the stop")));
        };
        let _ = each(session, vec![format!("{ended}: {how}")])?;
    }
    let never = |event: &&Event| {
        format!("script line {}: refused: the board did not start before the script's end", event.line)
    };
    let never: Vec<String> = player.waiting.iter().map(never).collect();
    if !never.is_empty() {
        player.refused += never.len();
        // Whether to break off makes no difference at the end.
        let _ = each(session, never)?;
    }
    Ok(player.refused)
}

/// The end of a script: it has failed if a command of it was refused.
///
/// # Errors
/// With the number of refused commands.
pub fn check_refused(refused: usize) -> Result<(), Failure> {
    match refused {
        0 => Ok(()),
        1 => Err(Failure::failed("1 command of the script was refused")),
        count => Err(Failure::failed(format!("{count} commands of the script were refused"))),
    }
}

/// What a script that is being played has to remember.
#[derive(Default)]
struct Player<'a> {
    seed: u64,
    /// Commands that wait until the board has started.
    waiting: VecDeque<&'a Event>,
    /// Line of the script by the number of the request.
    sent: HashMap<u16, usize>,
    /// Line of the course whose set-points are sent, and of the one that a stop has ended.
    course: Option<usize>,
    ended: Option<usize>,
    /// Noise on the host link, while it is on.
    noise: Option<Pcg64Mcg>,
    silent: bool,
    refused: usize,
}

impl Player<'_> {
    /// Whether the board would refuse this command only because it is starting.
    fn must_wait(&mut self, event: &Event, session: &Session) -> bool {
        match &event.action {
            Action::Command(Request::Stop) => {
                self.waiting.clear();
                false
            }
            Action::Command(request) => request::text(request).is_some() && session.is_starting(),
            _ => false,
        }
    }

    /// Performs an event, or returns what the operator has to do for it.
    fn perform(&mut self, event: &Event, session: &mut Session) -> Result<Option<String>, Failure> {
        let at_line = |failure: Failure| at_line(event, failure);
        let by_hand = |what: String| Ok(Some(format!("script line {}: now by hand: {what}", event.line)));
        match &event.action {
            // The rest of a course that was stopped.
            Action::Command(Request::Track { .. }) if self.ended == Some(event.line) => {}
            Action::Command(request) => {
                match request {
                    Request::Track { .. } => self.course = Some(event.line),
                    Request::Stop => self.ended = self.course,
                    _ => {}
                }
                let number = session.post(request)?;
                self.sent.insert(number, event.line);
            }
            Action::Plant(change) => match session.emulated() {
                Some(emulated) => emulated.plant(*change).map_err(at_line)?,
                None => return by_hand(format!("{} = {} (SI units)", change.key, change.value)),
            },
            Action::Fault { fault: ScriptFault::Emulated(fault), on } => match session.emulated() {
                Some(emulated) => emulated.fault(*fault, *on).map_err(at_line)?,
                None => return by_hand(format!("fault {} {}", fault.name(), if *on { "begins" } else { "ends" })),
            },
            Action::Fault { fault: ScriptFault::HostSilent, on } => session.link.set_heartbeat(!on),
            Action::Fault { fault: ScriptFault::LinkNoise, on } => {
                self.noise = on.then(|| Pcg64Mcg::seed_from_u64(self.seed));
            }
            Action::Fault { fault: ScriptFault::PowerCycle, .. } => {
                if !session.power_cycle().map_err(at_line)? {
                    return by_hand("switch the board off and on".into());
                }
            }
        }
        Ok(None)
    }

    /// What to say when the board falls silent, or is heard again.
    fn silence(&mut self, session: &Session) -> Option<String> {
        let silent = session.silent_s().is_some();
        if std::mem::replace(&mut self.silent, silent) == silent {
            return None;
        }
        let t_s = at(session.now_s());
        let t_s = t_s.trim_start();
        Some(match silent {
            true => format!("{t_s}: the board is silent, no telemetry came for half a second"),
            false => format!("{t_s}: the board is heard again; {} rows were lost so far", session.lost_rows()),
        })
    }

    /// Refusals since the last step, with the lines of their commands.
    fn take_refusals(&mut self, session: &mut Session) -> Vec<String> {
        let mut messages = Vec::new();
        for (number, result) in session.take_replies() {
            if let Err(refusal) = result {
                let line = self.sent.get(&number);
                // Somebody else has stopped it.
                if refusal == Refusal::Stopped && line == self.course.as_ref() {
                    self.ended = self.course;
                }
                self.refused += usize::from(line.is_some());
                let place = line.map_or(String::new(), |line| format!("script line {line}: "));
                messages.push(format!("{place}refused: {refusal}"));
            }
        }
        messages
    }
}

/// The first word of a command.
fn name(event: &Event) -> String {
    let text = match &event.action {
        Action::Command(request) => request::text(request),
        _ => None,
    };
    text.and_then(|text| text.split_whitespace().next().map(str::to_owned)).unwrap_or_default()
}

/// A failure with the line of the script that it is about.
fn at_line(event: &Event, failure: Failure) -> Failure {
    match failure.message() {
        Some(message) => Failure::failed(format!("script line {}: {message}", event.line)),
        None => failure,
    }
}

fn noise_bytes(random: &mut Pcg64Mcg) -> Vec<u8> {
    let mut bytes = vec![0; (random.next_u32() % (NOISE_BYTES + 1)) as usize];
    random.fill_bytes(&mut bytes);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::Port;
    use rig_link::Decoder;
    use rig_plant::Run;
    use std::sync::{Arc, Mutex};

    /// A port without an emulator behind it.
    #[derive(Default)]
    struct Wire {
        now_s: f64,
        sent: Arc<Mutex<Vec<u8>>>,
    }

    impl Port for Wire {
        fn pass(&mut self, bytes: &[u8], seconds: f64) -> Result<Run, Failure> {
            self.sent.lock().expect("one thread").extend(bytes);
            self.now_s += seconds;
            Ok(Run::default())
        }

        fn now_s(&self) -> f64 {
            self.now_s
        }
    }

    #[test]
    fn the_board_is_stopped_when_the_output_fails() {
        let wire = Wire::default();
        let sent = Arc::clone(&wire.sent);
        let mut session = Session::new(Box::new(wire));
        let played = play(&mut session, &Script::idle(10.0), 1, |_, _| Err(Failure::failed("no reader")));
        assert!(played.is_err_and(|e| e.message().as_deref() == Some("no reader")));
        let mut decoder = Decoder::<Request>::new();
        let requests: Vec<Request> = sent
            .lock()
            .expect("one thread")
            .iter()
            .filter_map(|b| decoder.push(*b)?.ok())
            .map(|frame| frame.body)
            .collect();
        assert!(requests.contains(&Request::Stop), "{requests:?}");
    }

    #[test]
    fn on_a_real_rig_the_operator_is_asked_for_what_the_tool_cannot_do() {
        let text = "0 plant load=0.5kg\n1 home\n2 fault lvdt-open\n3 fault lvdt-open off\n4 fault host-silent\n\
                    5 fault power-cycle\n6 end";
        let script = Script::parse(text).unwrap_or_else(|e| panic!("{e}"));
        let mut session = Session::new(Box::new(Wire::default()));
        let mut player = Player::default();
        let mut perform = |event| player.perform(event, &mut session).unwrap_or_else(|_| panic!("{event:?}"));
        let asked: Vec<Option<String>> = script.events.iter().map(&mut perform).collect();
        for (event, named) in [(0, "load = 4.9"), (2, "lvdt-open begins"), (3, "lvdt-open ends"), (5, "off and on")] {
            let line = asked[event].as_ref().unwrap_or_else(|| panic!("event {event}"));
            assert!(line.contains(named) && line.contains(&format!("line {}", event + 1)), "{line}");
        }
        assert_eq!((&asked[1], &asked[4]), (&None, &None), "the tool does these itself");
        assert_eq!(player.sent.into_values().collect::<Vec<_>>(), [2]);
    }
}
