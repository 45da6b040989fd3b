//! A mechanism and load in a program of their own (`--plant-program`), spoken to by lines.
//!
//! | line to the program | its answer |
//! |---|---|
//! | `start 1 STEP_S TWIST_RAD SEED` | `ok` |
//! | `set KEY VALUE` | `ok`, `unknown` or `error TEXT` |
//! | `step TWIST_RAD` | `GAP_M TORQUE_NM PULL_N` |
//! | `quit` | the program ends |
//!
//! Numbers are separated by blanks and in SI units; the torque acts on the output shaft and is positive towards more twist.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Version of the lines.
const VERSION: u32 = 1;
/// How long an answer may take.
pub const PATIENCE: Duration = Duration::from_secs(10);
/// Longest answer (bytes): three numbers have some tens. A longer one is cut.
const LONGEST: u64 = 4096;
/// Lines that a program may be ahead of the questions; then it has to wait.
const AHEAD: usize = 16;
/// Maximum gap (m), torque (N m) and pull (N) that are taken for a rig's.
const MAX_M: f64 = 10.0;
const MAX_NM: f64 = 100.0;
const MAX_N: f64 = 1e5;
/// What a step's answer is.
const WANTED: &str = "three numbers: gap (at most 10 m), torque (100 N m), pull (100000 N)";
/// How long a program that was told to quit may take before it is killed.
const FAREWELL: Duration = Duration::from_secs(1);

/// Why a plant program cannot go on. Each names the program and the line that it was given.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("plant program `{program}`: {what}")]
pub struct ProgramError {
    /// As it was given.
    pub program: String,
    /// What went wrong.
    pub what: ProgramFailure,
}

/// What a plant program did.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProgramFailure {
    /// There is no word in the command line.
    #[error("the command is empty")]
    Empty,
    /// It could not be started.
    #[error("it cannot be started: {0}")]
    Start(String),
    /// It ended, or closed its output.
    #[error("it ended instead of answering `{line}`")]
    Died {
        /// The line that it was given.
        line: String,
    },
    /// It did not answer in time.
    #[error("it did not answer `{line}` within {} s", patience.as_secs())]
    Silent {
        /// The line that it was given.
        line: String,
        /// How long was waited.
        patience: Duration,
    },
    /// Its answer is not what the line asks for.
    #[error("it answered `{line}` with `{answer}`, not with {wanted}")]
    Answer {
        /// The line that it was given.
        line: String,
        /// What it said, cut off after 80 characters.
        answer: String,
        /// What it should have said.
        wanted: &'static str,
    },
    /// Its rig was copied.
    #[error("it belongs to another rig")]
    Copied,
    /// It refused a plant key.
    #[error("plant key `{key}`: {text}")]
    Key {
        /// The key.
        key: String,
        /// What the program said about it.
        text: String,
    },
}

/// What a program answers to a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Gap between the clamps, m.
    pub gap_m: f64,
    /// Torque on the output shaft, N m, positive towards more twist.
    pub torque_nm: f64,
    /// Pull of the strings on the load, N.
    pub pull_n: f64,
}

/// A running program that answers each line with one. Dropped, its input ends, and it is killed if it does not end.
#[derive(Debug)]
pub struct Program {
    name: String,
    child: Child,
    /// None when it has ended.
    input: Option<ChildStdin>,
    /// In a mutex only because a rig is shared between threads that look at it.
    lines: Mutex<Receiver<String>>,
}

impl Program {
    /// Starts `command`: a program and its arguments, separated by blanks.
    ///
    /// # Errors
    /// [`ProgramError`]: it cannot be started.
    pub fn start(command: &str) -> Result<Self, ProgramError> {
        let fail = |what| ProgramError { program: command.to_owned(), what };
        let mut words = command.split_whitespace();
        let program = words.next().ok_or_else(|| fail(ProgramFailure::Empty))?;
        let mut process = Command::new(program);
        process.args(words).stdin(Stdio::piped()).stdout(Stdio::piped());
        ends_with_us(&mut process);
        let mut child = process.spawn().map_err(|e| fail(ProgramFailure::Start(e.to_string())))?;
        let (input, Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(fail(ProgramFailure::Start("it has no standard output".to_owned())));
        };
        let (sender, lines) = sync_channel(AHEAD);
        // Ends with the program's output, or when nobody listens any more.
        std::thread::spawn(move || {
            let mut output = BufReader::new(output);
            loop {
                let mut line = String::new();
                let read = output.by_ref().take(LONGEST).read_line(&mut line);
                if !matches!(read, Ok(1..)) || sender.send(line).is_err() {
                    return;
                }
            }
        });
        Ok(Self { name: command.to_owned(), child, input, lines: Mutex::new(lines) })
    }

    /// Its answer to a line, for which it is given so much time.
    ///
    /// # Errors
    /// [`ProgramError`]: it does not answer.
    pub fn ask(&mut self, line: &str, patience: Duration) -> Result<String, ProgramError> {
        // A program that has ended shows by its missing answer, too.
        let sent = self.tell(line);
        let lines = self.lines.get_mut().unwrap_or_else(PoisonError::into_inner);
        let answer = lines.recv_timeout(patience);
        let line = line.to_owned();
        match (sent, answer) {
            (_, Ok(answer)) => Ok(answer),
            (Ok(()), Err(RecvTimeoutError::Timeout)) => Err(self.fail(ProgramFailure::Silent { line, patience })),
            _ => Err(self.fail(ProgramFailure::Died { line })),
        }
    }

    fn tell(&mut self, line: &str) -> std::io::Result<()> {
        let Some(input) = &mut self.input else { return Ok(()) };
        input.write_all(format!("{line}\n").as_bytes()).and_then(|()| input.flush())
    }

    fn fail(&self, what: ProgramFailure) -> ProgramError {
        ProgramError { program: self.name.clone(), what }
    }

    /// That its answer to a line is not what was wanted.
    pub fn wrong(&self, line: &str, answer: &str, wanted: &'static str) -> ProgramError {
        let answer = answer.trim_end().chars().take(80).collect();
        self.fail(ProgramFailure::Answer { line: line.to_owned(), answer, wanted })
    }
}

/// A running plant program. Dropped, it is told to quit, and killed if it does not.
#[derive(Debug)]
pub struct PlantProgram {
    program: Program,
    patience: Duration,
}

impl PlantProgram {
    /// Starts `command` (a program and its arguments, separated by blanks) for steps of `step_s` seconds from a twist (rad);
    /// an answer may take as long as `patience`.
    ///
    /// # Errors
    /// [`ProgramError`]: it cannot be started, or does not answer `ok`.
    pub fn start(
        command: &str,
        step_s: f64,
        twist_rad: f64,
        seed: u64,
        patience: Duration,
    ) -> Result<Self, ProgramError> {
        let mut program = Self { program: Program::start(command)?, patience };
        let line = format!("start {VERSION} {step_s} {twist_rad} {seed}");
        match program.ask(&line)?.trim() {
            "ok" => Ok(program),
            answer => Err(program.program.wrong(&line, answer, "`ok`")),
        }
    }

    /// Gives it a plant key (SI value).
    ///
    /// # Errors
    /// [`ProgramError`]: it does not know the key, refuses the value, or does not answer.
    pub fn set(&mut self, key: &str, value: f64) -> Result<(), ProgramError> {
        if self.offer(key, value)? { Ok(()) } else { Err(self.refused(key, "it does not know this key")) }
    }

    /// As [`PlantProgram::set`] for a key that it need not know; returns whether it does.
    ///
    /// # Errors
    /// [`ProgramError`]: it refuses the value, or does not answer.
    pub fn offer(&mut self, key: &str, value: f64) -> Result<bool, ProgramError> {
        let line = format!("set {key} {value}");
        let answer = self.ask(&line)?;
        match answer.trim().split_once(' ').unwrap_or((answer.trim(), "")) {
            ("ok", "") => Ok(true),
            ("unknown", "") => Ok(false),
            ("error", text) => Err(self.refused(key, text)),
            _ => Err(self.program.wrong(&line, &answer, "`ok`, `unknown` or `error TEXT`")),
        }
    }

    /// One step with the output shaft at a twist (rad).
    ///
    /// # Errors
    /// [`ProgramError`]: it does not answer, or not with three numbers that a rig can have.
    pub fn step(&mut self, twist_rad: f64) -> Result<Answer, ProgramError> {
        let line = format!("step {twist_rad}");
        let answer = self.ask(&line)?;
        let numbers: Option<Vec<f64>> = answer.split_whitespace().map(|word| word.parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[gap_m, torque_nm, pull_n])
                if gap_m.abs() <= MAX_M && torque_nm.abs() <= MAX_NM && pull_n.abs() <= MAX_N =>
            {
                Ok(Answer { gap_m, torque_nm, pull_n })
            }
            _ => Err(self.program.wrong(&line, &answer, WANTED)),
        }
    }

    /// What a copy of its rig has instead of it.
    pub fn copied(&self) -> ProgramError {
        self.program.fail(ProgramFailure::Copied)
    }

    fn ask(&mut self, line: &str) -> Result<String, ProgramError> {
        self.program.ask(line, self.patience)
    }

    fn refused(&self, key: &str, text: &str) -> ProgramError {
        self.program.fail(ProgramFailure::Key { key: key.to_owned(), text: text.to_owned() })
    }
}

/// Whoever ends this process without a word (the host tool does) also ends the plant program. Elsewhere than on Linux the
/// program sees the end of its input.
#[allow(unsafe_code, reason = "the standard library has no call for it")]
fn ends_with_us(process: &mut Command) {
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::process::CommandExt;
        // SAFETY: between fork and exec only this one system call is made, which needs no memory and takes no lock.
        unsafe {
            process.pre_exec(|| match libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) {
                0 => Ok(()),
                _ => Err(std::io::Error::last_os_error()),
            });
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = process;
}

impl Drop for PlantProgram {
    fn drop(&mut self) {
        let _ = self.program.tell("quit");
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.input = None;
        let begun = std::time::Instant::now();
        while begun.elapsed() < FAREWELL {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// A shell script as a plant program, in a file of its own that is removed in the end.
    struct Script {
        file: std::path::PathBuf,
        command: String,
    }

    impl Drop for Script {
        fn drop(&mut self) {
            let _ = std::fs::remove_file(&self.file);
        }
    }

    fn script(name: &str, body: &str) -> Script {
        let file = std::env::temp_dir().join(format!("plant-program-{}-{name}.sh", std::process::id()));
        std::fs::write(&file, body).unwrap();
        Script { command: format!("sh {}", file.display()), file }
    }

    fn start(command: &str) -> Result<PlantProgram, ProgramError> {
        PlantProgram::start(command, 1e-3, 1.0, 7, Duration::from_secs(60))
    }

    const GOOD: &str = r#"while read -r word a b c d; do
        case $word in
            start) echo ok ;;
            set) case $a in load) echo ok ;; heavy) echo error too heavy for me ;; *) echo unknown ;; esac ;;
            step) echo "0.1 -0.001 $a" ;;
            quit) exit 0 ;;
        esac
    done"#;

    #[test]
    fn a_good_program_is_started_set_and_stepped_and_refuses_keys_by_their_names() {
        let mut program = start(&script("good", GOOD).command).unwrap();
        program.set("load", 4.9).unwrap();
        assert_eq!(program.step(2.5).unwrap(), Answer { gap_m: 0.1, torque_nm: -0.001, pull_n: 2.5 });
        let unknown = program.set("weight", 1.0).unwrap_err().to_string();
        assert!(unknown.contains("`weight`") && unknown.contains("does not know"), "{unknown}");
        let refused = program.set("heavy", 1.0).unwrap_err().to_string();
        assert!(refused.contains("`heavy`") && refused.contains("too heavy for me"), "{refused}");
        assert!(program.step(1.0).is_ok(), "it goes on");
    }

    #[test]
    fn programs_that_die_lie_stall_or_answer_nonsense_are_named_with_the_line() {
        for (name, body, said) in [
            ("dies", "read -r line; echo ok; read -r line; exit 3", "ended instead of answering `step 1`"),
            ("stalls", "read -r line; echo ok; read -r line; read -r line", "did not answer `step 1`"),
            ("words", "while read -r line; do echo ok; done", "answered `step 1` with `ok`"),
            ("nan", "read -r line; echo ok; while read -r line; do echo nan 1 2; done", "`nan 1 2`"),
            ("two", "read -r line; echo ok; while read -r line; do echo 1 2; done", "`1 2`"),
            ("huge", "read -r line; echo ok; while read -r line; do echo 0.1 1e300 5; done", "`0.1 1e300 5`"),
            ("binary", "read -r line; echo ok; while read -r line; do printf '\\377\\n'; done", "instead of answering"),
            ("four", "read -r line; echo ok; while read -r line; do echo 1 2 3 4; done", "`1 2 3 4`"),
        ] {
            let script = script(name, body);
            let mut program = start(&script.command).unwrap();
            if name == "stalls" {
                program.patience = Duration::from_millis(300);
            }
            let error = program.step(1.0).unwrap_err().to_string();
            assert!(error.contains(said) && error.contains(&script.command), "{name}: {error}");
        }
    }

    #[test]
    fn a_program_that_prints_without_end_takes_no_more_memory() {
        let long = script("long", "read -r line; echo ok; read -r line; while :; do printf 0.1; done");
        let error = start(&long.command).unwrap().step(1.0).unwrap_err().to_string();
        assert!(error.contains("answered `step 1` with `0.10.10.1"), "{error}");
        let mut ahead = start(&script("ahead", "while :; do echo ok; done").command).unwrap();
        std::thread::sleep(Duration::from_millis(200));
        ahead.program.child.kill().and_then(|()| ahead.program.child.wait()).unwrap();
        // What the pipe holds (64 KiB of three bytes each), and what is read ahead.
        let kept = ahead.program.lines.get_mut().unwrap().iter().count();
        assert!(kept < 25_000, "{kept} lines wait");
    }

    #[test]
    fn one_that_cannot_be_started_or_does_not_begin_is_named() {
        for (command, said) in [
            ("", "the command is empty"),
            ("no-such-program-anywhere", "cannot be started"),
            ("true", "ended instead of answering `start 1"),
            (
                &script("version", "read -r line; echo version 2 only").command,
                "answered `start 1 0.001 1 7` with `version 2 only`",
            ),
        ] {
            let error = start(command).unwrap_err().to_string();
            assert!(error.contains(said), "{command}: {error}");
        }
    }

    #[test]
    fn nothing_is_left_running() {
        let deaf = script("deaf", "trap '' TERM; echo ok; while :; do sleep 0.1; done");
        let mut program = start(&deaf.command).unwrap();
        let id = program.program.child.id();
        assert!(matches!(program.program.child.try_wait(), Ok(None)));
        drop(program);
        assert!(!std::path::Path::new(&format!("/proc/{id}")).exists() || !cfg!(target_os = "linux"));
    }
}
