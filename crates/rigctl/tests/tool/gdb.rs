//! A debugger on the emulated board that the tool starts: it leaves the run as it is, nothing is left when the tool has gone, and
//! what cannot be is refused. `emulator/tests/chip/gdb.rs` has what a debugger can do.

use crate::common::{error_of, lines, rigctl, root};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

const RUN: [&str; 4] = ["sim", "--json", "--seconds", "4"];

/// The tool with an emulated board that waits for a debugger, which is connected.
fn waiting() -> (Child, TcpStream) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_rigctl"))
        .args(RUN)
        .args(["--gdb", "127.0.0.1:0", "--gdb-wait", "--rig", "ideal"])
        .current_dir(root())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("rigctl runs");
    let mut said = String::new();
    // The rest of it is little, and fits a pipe.
    let mut errors = BufReader::new(child.stderr.take().expect("a pipe"));
    // Which board it is, then where.
    for _ in 0..2 {
        said.clear();
        errors.read_line(&mut said).expect("it says both");
    }
    child.stderr = Some(errors.into_inner());
    let address = said.trim().strip_prefix("gdb: listening at ").unwrap_or_else(|| panic!("{said}"));
    let debugger = TcpStream::connect(address).expect("somebody listens");
    debugger.set_read_timeout(Some(Duration::from_secs(120))).expect("a socket");
    (child, debugger)
}

/// Sends a packet and waits for its answer.
fn ask(mut debugger: &TcpStream, packet: &str) -> String {
    debugger.write_all(packet.as_bytes()).expect("sent");
    let mut said = String::new();
    while !said.contains('#') {
        let mut byte = [0];
        debugger.read_exact(&mut byte).unwrap_or_else(|e| panic!("{e} after `{said}` to {packet}"));
        // Acknowledgements go before an answer, and its sum before the next one.
        if byte == *b"$" || !said.is_empty() {
            said.push(byte[0].into());
        }
    }
    debugger.write_all(b"+").expect("sent");
    said
}

/// What a run has printed, without how fast this machine was.
fn printed(output: &Output) -> Vec<serde_json::Value> {
    let mut values = lines(output);
    for value in &mut values {
        if let Some(factor) = value.pointer_mut("/summary/realtime_factor") {
            *factor = serde_json::Value::Null;
        }
    }
    values
}

#[test]
fn a_debugger_that_looks_and_leaves_leaves_the_run_as_it_is() {
    let plain = rigctl(&RUN);
    assert!(plain.status.success(), "{}", error_of(&plain));
    let (child, debugger) = waiting();
    for (packet, answers) in [("$?#3f", ["$S", "$T"]), ("$s#73", ["$S", "$T"]), ("$D#44", ["$OK"; 2])] {
        let said = ask(&debugger, packet);
        assert!(answers.iter().any(|answer| said.starts_with(answer)), "{said} to {packet}");
    }
    let debugged = child.wait_with_output().expect("it ends");
    assert!(debugged.status.success(), "{}", error_of(&debugged));
    assert!(error_of(&debugged).contains("gdb: detached"), "{}", error_of(&debugged));
    let (plain, debugged) = (printed(&plain), printed(&debugged));
    assert!(plain.len() > 300 && plain == debugged, "{} and {} lines", plain.len(), debugged.len());
}

#[test]
fn a_tool_that_is_killed_takes_the_board_along_though_a_debugger_holds_it() {
    let (mut child, mut debugger) = waiting();
    ask(&debugger, "$?#3f");
    child.kill().expect("it ran");
    child.wait().expect("it has ended");
    // The emulator was the tool's child, and its end is the connection's.
    let ended = debugger.read_to_end(&mut Vec::new());
    assert!(ended.as_ref().map_or_else(|e| e.kind() == std::io::ErrorKind::ConnectionReset, |_| true), "{ended:?}");
    let mut said = String::new();
    child.stderr.take().expect("a pipe").read_to_string(&mut said).expect("the emulator has closed it");
    assert!(said.contains("the host that the board ran for has gone"), "{said}");
}

#[test]
fn what_cannot_be_is_refused() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = taken.local_addr().expect("an address").to_string();
    for (arguments, code, named) in [
        (&["status", "--gdb", &address][..], 1, address.as_str()),
        (&["status", "--gdb", "nonsense"], 1, "nonsense"),
        (&["status", "--gdb-wait"], 2, "--gdb"),
        (&["status", "--port", "/dev/no-such-port", "--gdb", &address], 2, "--gdb"),
    ] {
        let refused = rigctl(arguments);
        assert_eq!(refused.status.code(), Some(code), "{arguments:?}: {}", error_of(&refused));
        assert!(error_of(&refused).contains(named), "{arguments:?}: {}", error_of(&refused));
    }
}
