//! The live view on a pseudo-terminal, with the emulated board.
#![cfg(unix)]

use crate::common::root;
use nix::pty::{OpenptyResult, Winsize, openpty};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::fs::File;
use std::io::{Read, Write};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Longest wait for what a rig does within seconds: on a busy machine time passes slower.
const PATIENCE: Duration = Duration::from_secs(120);

/// `rigctl monitor` behind a terminal of 40 lines by 120 columns.
struct Terminal {
    child: Child,
    keyboard: File,
    screen: Arc<Mutex<vt100::Parser>>,
}

impl Terminal {
    fn new() -> Self {
        let size = Winsize { ws_row: 40, ws_col: 120, ws_xpixel: 0, ws_ypixel: 0 };
        let OpenptyResult { master, slave } = openpty(&size, None).expect("a pseudo-terminal");
        let slave = File::from(slave);
        let child = Command::new(env!("CARGO_BIN_EXE_rigctl"))
            .args(["monitor", "--rig", "ideal"])
            .current_dir(root())
            .stdin(slave.try_clone().expect("a copy"))
            .stdout(slave)
            .stderr(Stdio::null())
            .spawn()
            .expect("rigctl");
        let keyboard = File::from(master);
        let screen = Arc::new(Mutex::new(vt100::Parser::new(40, 120, 0)));
        let (mut output, shown) = (keyboard.try_clone().expect("a copy"), Arc::clone(&screen));
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(count @ 1..) = output.read(&mut buffer) {
                shown.lock().expect("the screen").process(&buffer[..count]);
            }
        });
        Self { child, keyboard, screen }
    }

    fn text(&self) -> String {
        self.screen.lock().expect("the screen").screen().contents()
    }

    fn press(&mut self, keys: &[u8]) {
        self.keyboard.write_all(keys).expect("a key");
    }

    /// Waits until the screen is as it should be.
    fn until(&mut self, what: &str, shown: impl Fn(&str) -> bool) {
        let end = Instant::now() + PATIENCE;
        while !shown(&self.text()) {
            assert!(Instant::now() < end, "{what}:\n{}", self.text());
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The word behind `state`.
fn state(screen: &str) -> Option<&str> {
    let line = screen.lines().find(|line| line.contains("state "))?;
    line.split_whitespace().skip_while(|word| !word.ends_with("state")).nth(1)
}

/// More keys at once than a terminal is read at a time.
#[test]
fn a_stop_behind_thousands_of_keys_stops() {
    let mut terminal = Terminal::new();
    terminal.until("the board starts", |screen| state(screen) == Some("unhomed"));
    terminal.press(b"h");
    terminal.until("it homes", |screen| state(screen) == Some("homing"));
    // All of them are there when the tool looks for the first time.
    let tool = Pid::from_raw(i32::try_from(terminal.child.id()).expect("a process"));
    kill(tool, Signal::SIGSTOP).expect("it runs");
    terminal.press(&[b"+".repeat(3000), b" ".to_vec()].concat());
    kill(tool, Signal::SIGCONT).expect("it is there");
    terminal.until("it stops", |screen| screen.contains("you: stop") && state(screen) == Some("unhomed"));
    terminal.press(b"\x1b[200~hymh\x1b[201~");
    terminal.until("it takes no pasted keys", |screen| screen.contains("pasted text"));
    assert_eq!(state(&terminal.text()), Some("unhomed"), "{}", terminal.text());
}

#[test]
fn it_jogs_refuses_homes_and_stops_before_it_leaves() {
    let mut terminal = Terminal::new();
    terminal.until("the board starts", |screen| state(screen) == Some("unhomed"));
    assert!(terminal.text().contains("h home") && terminal.text().contains("shown when homed"), "{}", terminal.text());
    terminal.press(b"\x1b[A");
    terminal.until("a step needs a position", |screen| screen.contains("home first"));
    terminal.press(b"m8\r");
    terminal.until("the board refuses a move before homing", |screen| {
        screen.contains("you: move 0.008") && screen.contains("refused")
    });
    terminal.press(b"\x1b[C");
    terminal.until("it jogs", |screen| state(screen) == Some("moving"));
    // Nobody presses the key any more.
    terminal.until("the jog ends by itself", |screen| state(screen) == Some("unhomed"));
    terminal.press(b"h");
    terminal.until("it homes", |screen| state(screen) == Some("homing"));
    terminal.press(b"q");
    terminal.until("it stops first", |screen| screen.contains("stopping the motion") || !screen.contains("homing"));
    let end = Instant::now() + PATIENCE;
    let ended = loop {
        if let Some(ended) = terminal.child.try_wait().expect("a child") {
            break ended;
        }
        assert!(Instant::now() < end, "it does not leave:\n{}", terminal.text());
        std::thread::sleep(Duration::from_millis(20));
    };
    assert!(ended.success(), "{}", terminal.text());
}
