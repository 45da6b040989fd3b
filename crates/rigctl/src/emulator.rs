//! The `rig-emulator` process: requests and answers as JSON objects, one a line.
//!
//! A program of its own, so that nothing of its licence reaches this tool, and a crash of either leaves the other whole.

use crate::record::Truth;
use crate::transport::SimOptions;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Why the emulated board does not do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// A file that it needs is not there.
    #[error("{what} is not at {}: build it with `{how}`", path.display())]
    Missing {
        /// What.
        what: &'static str,
        /// Where it should be.
        path: PathBuf,
        /// How to make it.
        how: &'static str,
    },
    /// The process does not start.
    #[error("could not start {}: {source}", path.display())]
    Start {
        /// The program.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The process went away.
    #[error("the emulator ended by itself{}", status.as_ref().map(|s| format!(" ({s})")).unwrap_or_default())]
    Ended {
        /// How.
        status: Option<std::process::ExitStatus>,
    },
    /// It answered something else.
    #[error("the emulator's answer makes no sense: {0}")]
    Answer(String),
    /// It refused or stopped, and said why.
    #[error("emulated board ({kind}): {message}")]
    Refused {
        /// Short name of the reason.
        kind: String,
        /// The reason.
        message: String,
    },
}

#[derive(Serialize)]
#[serde(tag = "op", rename_all = "kebab-case")]
enum Ask<'a> {
    Run { until_s: f64, uart: String },
    Plant { key: &'a str, value: String },
    Fault { name: &'a str, on: bool },
    PowerCycle,
    Stats,
    Quit,
}

/// What happened in a stretch of emulated time.
#[derive(Debug, Deserialize)]
pub struct Ran {
    /// Emulated time now (s).
    pub t_s: f64,
    /// Bytes that the board sent to the host.
    #[serde(deserialize_with = "from_hex")]
    pub uart: Vec<u8>,
    /// The plant, every millisecond.
    #[serde(default)]
    pub truth: Vec<Truth>,
}

/// Figures of the whole run.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
pub struct Stats {
    /// Instructions per control tick, mean.
    pub instructions_per_tick_mean: Option<f64>,
    /// Instructions per control tick, greatest.
    pub instructions_per_tick_max: Option<f64>,
    /// Share of time in which the core does not sleep.
    pub core_busy: Option<f64>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Answer<T> {
    Error { error: Refusal },
    Good(T),
}

#[derive(Deserialize)]
struct Refusal {
    kind: String,
    message: String,
}

/// A running emulator.
pub struct Emulator {
    child: Child,
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
}

impl Emulator {
    /// Starts the program that stands beside this one.
    ///
    /// # Errors
    /// [`EmulatorError`] if it or the firmware is not there, or does not start.
    pub fn start(options: &SimOptions) -> Result<Self, EmulatorError> {
        let path = beside("rig-emulator");
        if !path.is_file() {
            return Err(EmulatorError::Missing { what: "the emulator", path, how: "cargo xtask build" });
        }
        if !options.firmware.is_file() {
            let path = options.firmware.clone();
            return Err(EmulatorError::Missing { what: "the firmware", path, how: "cargo xtask firmware" });
        }
        let mut command = Command::new(&path);
        command.arg("--elf").arg(&options.firmware).arg("--scene").arg(&options.scene);
        command.arg("--seed").arg(options.seed.to_string());
        for setting in &options.plant {
            // One word, so that a negative value is not taken for an option.
            command.arg(format!("--plant={}={}", setting.key, setting.value));
        }
        let failed = |source| EmulatorError::Start { path: path.clone(), source };
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().map_err(failed)?;
        match (child.stdin.take(), child.stdout.take()) {
            (Some(stdin), Some(stdout)) => Ok(Self { child, stdin, stdout: BufReader::new(stdout) }),
            _ => Err(EmulatorError::Ended { status: None }),
        }
    }

    /// Delivers bytes to the board's UART and runs until `until_s`.
    ///
    /// # Errors
    /// [`EmulatorError`] if the board stops.
    pub fn run(&mut self, until_s: f64, bytes: &[u8]) -> Result<Ran, EmulatorError> {
        self.ask(&Ask::Run { until_s, uart: to_hex(bytes) })
    }

    /// Changes the plant.
    ///
    /// # Errors
    /// [`EmulatorError::Refused`] if it cannot change so.
    pub fn plant(&mut self, key: &str, value: f64) -> Result<(), EmulatorError> {
        self.ask(&Ask::Plant { key, value: value.to_string() }).map(|_: serde_json::Value| ())
    }

    /// Begins or ends a fault.
    ///
    /// # Errors
    /// [`EmulatorError::Refused`] if there is no such fault.
    pub fn fault(&mut self, name: &str, on: bool) -> Result<(), EmulatorError> {
        self.ask(&Ask::Fault { name, on }).map(|_: serde_json::Value| ())
    }

    /// Takes the board's power away for a moment.
    ///
    /// # Errors
    /// [`EmulatorError`] if the emulator has gone.
    pub fn power_cycle(&mut self) -> Result<(), EmulatorError> {
        self.ask(&Ask::PowerCycle).map(|_: serde_json::Value| ())
    }

    /// Figures of the run so far.
    ///
    /// # Errors
    /// [`EmulatorError`] if the emulator has gone.
    pub fn stats(&mut self) -> Result<Stats, EmulatorError> {
        self.ask(&Ask::Stats)
    }

    fn ask<T: DeserializeOwned>(&mut self, ask: &Ask<'_>) -> Result<T, EmulatorError> {
        let mut line = serde_json::to_string(ask).map_err(|e| EmulatorError::Answer(e.to_string()))?;
        line.push('\n');
        if self.stdin.write_all(line.as_bytes()).and_then(|()| self.stdin.flush()).is_err() {
            // It may have said why before it went.
            return Err(self.last_words());
        }
        let mut answer = String::new();
        match self.stdout.read_line(&mut answer) {
            Ok(count) if count > 0 => parse(&answer),
            _ => Err(self.ended()),
        }
    }

    fn last_words(&mut self) -> EmulatorError {
        let mut answer = String::new();
        match self.stdout.read_line(&mut answer).map(|_| parse::<serde_json::Value>(&answer)) {
            Ok(Err(refused @ EmulatorError::Refused { .. })) => refused,
            _ => self.ended(),
        }
    }

    fn ended(&mut self) -> EmulatorError {
        EmulatorError::Ended { status: self.child.wait().ok() }
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        let asked = serde_json::to_string(&Ask::Quit).map(|line| writeln!(self.stdin, "{line}"));
        if !matches!(asked, Ok(Ok(()))) {
            let _ = self.child.kill();
        }
        let _ = self.child.wait();
    }
}

fn parse<T: DeserializeOwned>(line: &str) -> Result<T, EmulatorError> {
    match serde_json::from_str(line) {
        Ok(Answer::Good(answer)) => Ok(answer),
        Ok(Answer::Error { error: Refusal { kind, message } }) => Err(EmulatorError::Refused { kind, message }),
        Err(e) => Err(EmulatorError::Answer(format!("{e} in `{}`", line.trim().chars().take(200).collect::<String>()))),
    }
}

/// A program or folder beside this program.
pub fn beside(name: &str) -> PathBuf {
    let mut path = std::env::current_exe().unwrap_or_default();
    path.set_file_name(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    path
}

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

fn from_hex<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
    let text = String::deserialize(deserializer)?;
    let digit = |d: u8| char::from(d).to_digit(16).and_then(|d| u8::try_from(d).ok());
    let (pairs, rest) = text.as_bytes().as_chunks::<2>();
    let bytes: Option<Vec<u8>> = pairs.iter().map(|[high, low]| Some(digit(*high)? << 4 | digit(*low)?)).collect();
    bytes.filter(|_| rest.is_empty()).ok_or_else(|| serde::de::Error::custom("`uart` is not hexadecimal"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers() {
        let ran: Ran = parse(r#"{"t_s":0.01,"uart":"00ff1a","truth":[],"log":[]}"#).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(ran.uart, [0x00, 0xff, 0x1a]);
        let refused = parse::<Ran>(r#"{"error":{"kind":"unclocked","message":"GPIOB"}}"#).expect_err("an error");
        assert_eq!(refused.to_string(), "emulated board (unclocked): GPIOB");
        for bad in ["", "{}", r#"{"t_s":0,"uart":"0"}"#, r#"{"t_s":0,"uart":"zz"}"#, r#"{"t_s":0,"uart":"é"}"#] {
            assert!(matches!(parse::<Ran>(bad), Err(EmulatorError::Answer(_))), "{bad}");
        }
        assert_eq!(to_hex(&[0, 0xff, 0x1a]), "00ff1a");
    }

    #[test]
    fn questions() {
        let text = |ask| serde_json::to_string(&ask).unwrap_or_default();
        assert_eq!(text(Ask::PowerCycle), r#"{"op":"power-cycle"}"#);
        assert_eq!(text(Ask::Run { until_s: 0.5, uart: "00".into() }), r#"{"op":"run","until_s":0.5,"uart":"00"}"#);
    }
}
