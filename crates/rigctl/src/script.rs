//! Scripts for a rig: one event a line, `<seconds since boot> <event>`, `#` starts a comment.

use crate::failure::Failure;
use crate::request;
use crate::trajectory::Trajectory;
use crate::units::{self, Quantity};
use rig_link::Request;
use rig_plant::{Fault, PlantChange, PlantError};
use std::path::Path;

/// Time for the load to come to rest after the last set-point of a stream, before it is stopped (s): shorter than the board goes
/// on without another one.
const STREAM_REST_S: f64 = 0.1;

const EVENTS: &str = "home [load=auto|L], move P [speed=V|max] [load=auto|L], track FILE, jog V, check-direction, stop, hold, clear, status, config set NAME VALUE, \
                      plant KEY=VALUE, fault NAME [off], end";

/// The events and faults of a script, for the help of the commands that play one.
pub fn help() -> String {
    format!("Events of a script (`#` starts a comment): {EVENTS}\nFaults: {}", fault_names())
}

/// A fault that a script can cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScriptFault {
    /// In the emulated board or rig.
    Emulated(Fault),
    /// This tool stops its heartbeat.
    HostSilent,
    /// This tool sends random bytes between its frames.
    LinkNoise,
    /// The board loses its power for a moment.
    PowerCycle,
}

/// Faults of the link between host and board, and of the board's power.
const OWN_FAULTS: [(&str, ScriptFault); 3] = [
    ("host-silent", ScriptFault::HostSilent),
    ("link-noise", ScriptFault::LinkNoise),
    ("power-cycle", ScriptFault::PowerCycle),
];

/// What happens.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// A command to the board.
    Command(Request),
    /// A change of the plant.
    Plant(PlantChange),
    /// A fault begins or ends.
    Fault {
        /// Which.
        fault: ScriptFault,
        /// Whether it begins.
        on: bool,
    },
}

/// One event of a script.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Line in the file, from 1.
    pub line: usize,
    /// When (s since boot).
    pub t_s: f64,
    /// What.
    pub action: Action,
}

/// A checked script.
#[derive(Debug, Clone, PartialEq)]
pub struct Script {
    /// Events in order of time.
    pub events: Vec<Event>,
    /// When it ends (s since boot).
    pub end_s: f64,
}

impl Script {
    /// A script without events.
    pub fn idle(end_s: f64) -> Self {
        Self { events: Vec::new(), end_s }
    }

    /// Reads a script file, and returns its text as well.
    ///
    /// # Errors
    /// Naming file and line.
    pub fn load(path: &Path) -> Result<(Self, String), Failure> {
        let wrong = |what: String| Failure::failed(format!("script {}: {what}", path.display()));
        let text = rig_config::files::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok((Self::parse_in(folder, &text).map_err(wrong)?, text))
    }

    /// Reads a script that needs no other file.
    ///
    /// # Errors
    /// In words, naming the line.
    pub fn parse(text: &str) -> Result<Self, String> {
        Self::parse_in(Path::new(""), text)
    }

    /// Reads a script whose courses (`track FILE`) lie in a folder.
    ///
    /// # Errors
    /// In words, naming the line.
    pub fn parse_in(folder: &Path, text: &str) -> Result<Self, String> {
        let mut events: Vec<Event> = Vec::new();
        let mut previous_s = 0.0;
        let mut end_s = None;
        // Editors put a byte-order mark in front.
        for (line, content) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            let fail = |message: String| format!("line {line}: {message}");
            let words: Vec<&str> =
                content.split_once('#').map_or(content, |(before, _)| before).split_whitespace().collect();
            let Some((time, event)) = words.split_first() else { continue };
            if end_s.is_some() {
                return Err(fail("comes after `end`".into()));
            }
            let t_s = units::parse("time", Quantity::Time, time).map_err(|e| fail(e.to_string()))?;
            if t_s < previous_s {
                return Err(fail(format!("time {t_s} s lies before {previous_s} s: events must be in order")));
            }
            previous_s = t_s;
            match event {
                [] => return Err(fail("has a time but no event".into())),
                ["end"] => end_s = Some(t_s),
                ["track", file] => {
                    let trajectory = Trajectory::load(&folder.join(file));
                    let trajectory = trajectory.map_err(|e| fail(e.message().unwrap_or_default()))?;
                    let points = trajectory.set_points().map(|(at_s, point)| (t_s + at_s, point));
                    let stop = (t_s + trajectory.duration_s() + STREAM_REST_S, Request::Stop);
                    events.extend(points.chain([stop]).map(|(t_s, request)| Event {
                        line,
                        t_s,
                        action: Action::Command(request),
                    }));
                }
                words => events.push(Event { line, t_s, action: action(words).map_err(fail)? }),
            }
        }
        // A stream goes on while later lines happen.
        events.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        let last = text.lines().count().max(1);
        let end_s = end_s.ok_or_else(|| format!("line {last}: no `<seconds> end` follows"))?;
        Ok(Self { events, end_s })
    }
}

fn action(words: &[&str]) -> Result<Action, String> {
    if let Some(request) = request::from_words(words) {
        return request.map(Action::Command);
    }
    Ok(match words {
        ["plant", change] => {
            let change: PlantChange = change.parse().map_err(|e: PlantError| e.to_string())?;
            change.check_running().map_err(|e| e.to_string())?;
            Action::Plant(change)
        }
        ["fault", name] => Action::Fault { fault: fault(name)?, on: true },
        ["fault", name, "off"] => match fault(name)? {
            ScriptFault::PowerCycle => return Err("fault power-cycle ends by itself".into()),
            fault => Action::Fault { fault, on: false },
        },
        words => {
            return Err(format!("no event `{}`; events: {EVENTS}", words.join(" ")));
        }
    })
}

fn fault(name: &str) -> Result<ScriptFault, String> {
    let own = OWN_FAULTS.into_iter().find(|(n, _)| *n == name).map(|(_, fault)| fault);
    let emulated = || name.parse().ok().map(ScriptFault::Emulated);
    own.or_else(emulated).ok_or_else(|| format!("no fault `{name}`; faults: {}", fault_names()))
}

fn fault_names() -> String {
    Fault::all().map(Fault::name).chain(OWN_FAULTS.map(|(name, _)| name)).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use rig_link::LoadChoice;

    #[test]
    fn a_script() {
        let script = Script::parse(
            "\u{feff}# warm up\n0.5 home\n\n30 move 12mm speed=1mm/s load=0.5kg # up\n31 plant load=1.2kg\n\
             32 fault drive-stall\n33 fault drive-stall off\n33 fault power-cycle\n34.5 end\n",
        )
        .unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(script.end_s, 34.5);
        assert_eq!(script.events.len(), 6);
        assert_eq!(script.events[0], Event { line: 2, t_s: 0.5, action: Action::Command(Request::HOME) });
        let Action::Command(Request::Move { target_m, speed_m_per_s, load }) = script.events[1].action else {
            panic!("{:?}", script.events[1])
        };
        assert_eq!((target_m, speed_m_per_s), (0.012, 0.001));
        assert_eq!(load, LoadChoice::Known(4.903_325));
        assert_eq!(script.events[5].action, Action::Fault { fault: ScriptFault::PowerCycle, on: true });
    }

    #[test]
    fn errors_name_line_and_thing() {
        for (text, line, named) in [
            ("", 1, "end"),
            ("1 home\n", 1, "end"),
            ("1 home\n0.5 stop\n2 end", 2, "order"),
            ("1 homme\n2 end", 1, "homme"),
            ("x home\n2 end", 1, "time"),
            ("nan home\n2 end", 1, "time"),
            ("-1 home\n2 end", 1, "order"),
            ("1\n2 end", 1, "no event"),
            ("\n1 move 5kg\n2 end", 2, "move"),
            ("1 move 5mm speed=2\n2 move 5mm sped=1\n3 end", 2, "sped"),
            ("1 move 5mm load=x\n2 end", 1, "auto"),
            ("1 home load=5mm\n2 end", 1, "load"),
            ("1 home 0.5kg\n2 end", 1, "load=auto|L"),
            ("1 home load=1kg load=2kg\n2 end", 1, "load is given twice"),
            ("1 move 5mm speed=2mm/s speed=3mm/s\n2 end", 1, "speed is given twice"),
            ("1 plant weight=5\n2 end", 1, "weight"),
            ("1 plant load=250N\n2 end", 1, "load"),
            ("1 plant twist_at_boot=5\n2 end", 1, "twist_at_boot"),
            ("1 fault fire\n2 end", 1, "fire"),
            ("1 config set lvdt-gian 1\n2 end", 1, "lvdt-gain"),
            ("1 config set lvdt-offset 1kg\n2 end", 1, "lvdt-offset"),
            ("1 config get\n2 end", 1, "config set NAME VALUE"),
            ("1 fault power-cycle off\n2 end", 1, "power-cycle"),
            ("1 end\n2 home", 2, "after"),
        ] {
            let error = Script::parse(text).expect_err(text);
            assert!(error.starts_with(&format!("line {line}: ")) && error.contains(named), "{text}: {error}");
        }
    }
}
