//! How a command fails, and with which exit code.

use crate::output::ReaderGone;
use rig_config::{SceneError, TableError};
use rig_link::HomingFailure;
use serde::Serialize;
use tsa_model::SolveError;

/// A refusal or failure of a kind that programs compare, as `--json` prints it and `serve` answers it
/// (`crates/rigctl/serve.md`).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[error("{message}")]
pub struct Refused {
    /// Short stable name.
    pub kind: &'static str,
    /// In words.
    pub message: String,
}

impl Refused {
    /// Of this kind.
    pub fn new(kind: &'static str, message: impl Into<String>) -> Self {
        Self { kind, message: message.into() }
    }
}

impl From<SolveError> for Refused {
    fn from(error: SolveError) -> Self {
        Self::new(error.kind(), error.to_string())
    }
}

/// A homing that failed, by the name that `docs/reference/faults.md` explains.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("homing failed: {0} (docs/reference/faults.md, \"Homing that fails\")")]
pub struct HomingFailed(pub HomingFailure);

/// Why a conversation with a board was broken off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// By the operator.
    Interrupted,
    /// No telemetry came any more, on a line that is still open.
    Silent,
    /// Its clock went back: it has started again, and forgotten everything.
    Reset,
}

/// The conversation with a board was broken off, and the board was asked to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrokenOff {
    /// Why.
    pub why: Why,
    /// The board has acknowledged the stop.
    pub stopped: bool,
}

impl std::error::Error for BrokenOff {}

impl std::fmt::Display for BrokenOff {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let why = match self.why {
            Why::Interrupted => "interrupted",
            Why::Silent => "the board went silent, no telemetry came for half a second",
            Why::Reset => "the board was reset: its position is lost, and a load may have dropped",
        };
        let end = if self.stopped {
            "the board was stopped"
        } else {
            "the board did NOT acknowledge the stop, and the rig may still move: press the emergency stop, then check the \
             board's supply and cable (docs/reference/faults.md, \"A silent board\")"
        };
        write!(f, "{why}: {end}")
    }
}

fn is_missing(error: &SceneError) -> bool {
    match error {
        SceneError::InFile { what, .. } => is_missing(what),
        SceneError::Read(e) => e.kind() == std::io::ErrorKind::NotFound,
        _ => false,
    }
}

/// A failed command.
#[derive(Debug)]
pub enum Failure {
    /// Wrong usage: exit code 2.
    Usage(String),
    /// Refused or failed: exit code 1.
    Failed(anyhow::Error),
    /// Failed, and already reported: exit code 1.
    Reported,
}

impl Failure {
    /// A refusal or failure in words.
    pub fn failed(message: impl Into<String>) -> Self {
        Self::Failed(anyhow::Error::msg(message.into()))
    }

    /// The same of a kind that programs compare.
    pub fn of_kind(kind: &'static str, message: impl Into<String>) -> Self {
        Self::Failed(Refused::new(kind, message).into())
    }

    /// A short stable name of what happened, as the errors of `serve` have it, or `failed`.
    pub fn kind(&self) -> &'static str {
        let error = match self {
            Self::Usage(_) => return "bad-request",
            Self::Reported => return "failed",
            Self::Failed(error) => error,
        };
        if let Some(Refused { kind, .. }) = error.downcast_ref() {
            kind
        } else if let Some(BrokenOff { why, .. }) = error.downcast_ref() {
            match why {
                Why::Interrupted => "stopped",
                Why::Silent => "board-silent",
                Why::Reset => "board-reset",
            }
        } else if error.is::<HomingFailed>() {
            "homing-failed"
        } else if let Some(scene) = error.downcast_ref::<SceneError>() {
            if is_missing(scene) { "no-file" } else { "scene" }
        } else if error.is::<TableError>() {
            "scene"
        } else {
            "failed"
        }
    }

    /// As an error of a program on the library: `.map_err(Failure::into_error)?`.
    pub fn into_error(self) -> anyhow::Error {
        match self {
            Self::Usage(message) => anyhow::Error::msg(message),
            Self::Failed(error) => error,
            Self::Reported => anyhow::Error::msg("failed, and already reported"),
        }
    }

    /// The message with its causes.
    pub fn message(&self) -> Option<String> {
        match self {
            Self::Usage(message) => Some(message.clone()),
            Self::Failed(error) => {
                let mut text = String::new();
                // Some errors name their causes in their own message.
                for cause in error.chain().map(ToString::to_string) {
                    match text.as_str() {
                        "" => text = cause,
                        message if message.contains(cause.trim()) => {}
                        _ => text += &format!(": {cause}"),
                    }
                }
                Some(text)
            }
            Self::Reported => None,
        }
    }

    /// The object that `--json` prints besides the message: why a homing failed.
    pub fn object(&self) -> Option<serde_json::Value> {
        let Self::Failed(error) = self else { return None };
        let HomingFailed(why) = error.downcast_ref()?;
        let error = Refused::new("homing-failed", error.to_string());
        Some(serde_json::json!({ "error": error, "homing_failure": why.name() }))
    }

    /// Why and how the conversation with the board was broken off, if it was.
    pub fn broken_off(&self) -> Option<BrokenOff> {
        let Self::Failed(error) = self else { return None };
        error.downcast_ref().copied()
    }

    /// Whether the reader of our standard output has gone, as opposed to a serial line.
    pub fn is_reader_gone(&self) -> bool {
        let Self::Failed(error) = self else { return false };
        error.downcast_ref::<std::io::Error>().and_then(std::io::Error::get_ref).is_some_and(|e| e.is::<ReaderGone>())
    }
}

impl<E: Into<anyhow::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Output;
    use anyhow::Context;
    use std::io::{Error, ErrorKind, Write};

    struct Gone(fn() -> Error);

    impl Write for Gone {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err((self.0)())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    /// The failure of a command whose output fails like this.
    fn failed(how: fn() -> Error) -> Failure {
        Output::new(false, Box::new(Gone(how))).line("x").expect_err("it fails").into()
    }

    #[test]
    fn a_lost_serial_line_is_not_a_reader_that_has_gone() {
        assert!(failed(|| Error::new(ErrorKind::BrokenPipe, ReaderGone)).is_reader_gone());
        assert!(!failed(|| ErrorKind::StorageFull.into()).is_reader_gone());
        let line: Result<(), Error> = Err(ErrorKind::BrokenPipe.into());
        let lost: Failure = line.context("reading from the serial port").expect_err("it fails").into();
        assert!(!lost.is_reader_gone());
        assert_eq!(lost.message().as_deref(), Some("reading from the serial port: broken pipe"));
    }

    #[test]
    fn a_failure_has_a_kind_that_programs_compare() {
        let missing = rig_config::Scene::load("no-such.toml").expect_err("no such file");
        let wrong = rig_config::Scene::from_toml_str("x = 1").expect_err("no scene");
        let silent = BrokenOff { why: Why::Silent, stopped: false };
        for (failure, kind) in [
            (Failure::Usage("x".into()), "bad-request"),
            (Failure::failed("x"), "failed"),
            (Failure::of_kind("refused", "x"), "refused"),
            (silent.into(), "board-silent"),
            (missing.into(), "no-file"),
            (wrong.into(), "scene"),
        ] {
            assert_eq!(failure.kind(), kind);
        }
    }

    #[test]
    fn a_cause_that_an_error_names_itself_is_not_repeated() {
        let scene = rig_config::Scene::load("no-such.toml").expect_err("no such file");
        let message = Failure::from(scene).message().unwrap_or_default();
        assert_eq!(message.matches("os error 2").count(), 1, "{message}");
        assert!(message.contains("no-such.toml"), "{message}");
    }
}
