//! The emulator's control channel: one JSON value on each line, one [`Answer`] to each [`Request`].
//!
//! Emulated time stands still between two requests, so a session is exactly repeatable. The emulator ends when its
//! standard input does.

use crate::{Fault, PlantChange, Truth};
use serde::{Deserialize, Serialize};

/// What the host asks of the emulator. Enums are tagged from outside (`{"run":{..}}`): serde buffers the contents of an
/// internally tagged enum, and then loses numbers where another crate turns on serde_json's arbitrary precision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Request {
    /// Lets emulated time pass; answered by [`Answer::Run`].
    Run {
        /// Emulated time to stop at (s since power-up).
        until_s: f64,
        /// Bytes for the board's host link, which arrive from now on.
        #[serde(default)]
        uart: Vec<u8>,
    },
    /// Changes the plant.
    Plant(PlantChange),
    /// Begins or ends a fault.
    Fault {
        /// Which.
        fault: Fault,
        /// Whether it begins.
        on: bool,
    },
    /// Takes the board's supply away for a moment.
    PowerCycle,
    /// What the firmware cost so far; answered by [`Answer::Stats`].
    Stats,
}

/// What the emulator answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Answer {
    /// It is done.
    Done,
    /// What happened meanwhile.
    Run(Run),
    /// What the firmware cost.
    Stats(Stats),
    /// It is refused, or the run ended with an error.
    Error {
        /// What is at fault, in one word: `request`, `fault`, `plant`, or for a run `strict`, `memory`, `panic`,
        /// `machine`.
        kind: String,
        /// What is wrong, in words.
        message: String,
    },
}

/// What happened during a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Emulated time at its end (s since power-up).
    pub t_s: f64,
    /// Bytes that the board sent on its host link.
    pub uart: Vec<u8>,
    /// What really happened, every 1 ms.
    pub truth: Vec<Truth>,
    /// Lines of the firmware's own log.
    pub log: Vec<String>,
}

/// What the firmware cost on the emulated board.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stats {
    /// Mean instructions of a control tick.
    pub instructions_per_tick_mean: f64,
    /// Maximum instructions of a control tick.
    pub instructions_per_tick_max: f64,
    /// Name of the model that the emulated mechanism runs on.
    pub plant_tier: String,
    /// Fraction of the time in which the core was not asleep.
    pub core_busy: f64,
    /// Maximum bytes on the stack.
    pub stack_high_water_bytes: u64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ChipFault, PlantKey, RigFault};

    #[test]
    fn requests_are_written_as_documented_and_come_back() {
        for (request, text) in [
            (
                Request::Run { until_s: 0.1 + 0.2, uart: vec![0, 255] },
                r#"{"run":{"until_s":0.30000000000000004,"uart":[0,255]}}"#,
            ),
            (Request::Plant(PlantChange { key: PlantKey::Load, value: 4.9 }), r#"{"plant":"load=4.9"}"#),
            (
                Request::Fault { fault: Fault::Rig(RigFault::LvdtOpen), on: true },
                r#"{"fault":{"fault":"lvdt-open","on":true}}"#,
            ),
            (
                Request::Fault { fault: Fault::Chip(ChipFault::NoHse), on: false },
                r#"{"fault":{"fault":"no-hse","on":false}}"#,
            ),
            (Request::PowerCycle, r#""power-cycle""#),
            (Request::Stats, r#""stats""#),
        ] {
            assert_eq!(serde_json::to_string(&request).unwrap(), text);
            assert_eq!(serde_json::from_str::<Request>(text).unwrap(), request);
        }
    }

    #[test]
    fn what_is_no_request_is_refused_with_its_reason() {
        for (text, named) in [
            (r#""dance""#, "power-cycle"),
            (r#"{"run":{}}"#, "until_s"),
            (r#"{"run":{"until_s":1.5,"uarts":[]}}"#, "uarts"),
            (r#"{"plant":"weight=1"}"#, "weight"),
            (r#"{"fault":{"fault":"rust","on":true}}"#, "can-silent"),
            ("17", "expected"),
            ("", "EOF"),
        ] {
            let message = serde_json::from_str::<Request>(text).expect_err(text).to_string();
            assert!(message.contains(named), "{text}: {message}");
        }
    }
}
