//! A debugger on the emulated board, over the remote protocol itself: what it does leaves the run as it is, and nothing
//! is left when it or the tool has gone.

mod common;
#[path = "common/gdb.rs"]
mod gdb;

use common::{error_of, lines, rigctl, root};
use gdb::Gdb;
use object::{Object, ObjectSymbol};
use std::io::{BufRead, BufReader, Read};
use std::net::TcpListener;
use std::process::{Child, Command, Output, Stdio};

const RUN: [&str; 4] = ["sim", "--json", "--seconds", "4"];

/// The tool with an emulated board that waits for a debugger, and where.
fn waiting() -> (Child, String) {
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
    let address = said.trim().strip_prefix("gdb: listening at ").unwrap_or_else(|| panic!("{said}")).to_owned();
    (child, address)
}

/// Address of the firmware's tick.
fn control_tick() -> u32 {
    let elf = std::fs::read(root().join("target/firmware/tsa-firmware.elf")).expect("the firmware");
    let file = object::File::parse(&*elf).expect("an ELF");
    let tick = file.symbols().find(|symbol| symbol.name() == Ok("control_tick"));
    tick.expect("the firmware has it").address() as u32 & !1
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
fn a_debugger_in_the_tick_leaves_the_run_as_it_is() {
    let plain = rigctl(&RUN);
    assert!(plain.status.success(), "{}", error_of(&plain));
    let (child, address) = waiting();
    let tick = control_tick();
    let mut gdb = Gdb::connect(&address);
    assert!(gdb.ask("?").starts_with(['S', 'T']));
    assert_eq!(gdb.ask(&format!("Z0,{tick:x},2")), "OK");
    for _ in 0..20 {
        assert!(gdb.ask("c").contains("swbreak"));
        assert_eq!(gdb.pc(), tick);
        assert!(gdb.ask("s").starts_with(['S', 'T']));
        assert_ne!(gdb.pc(), tick);
    }
    assert_eq!(gdb.ask(&format!("z0,{tick:x},2")), "OK");
    gdb.send("c");
    gdb.interrupt();
    assert!(gdb.answer().contains("02"), "SIGINT");
    assert_eq!(gdb.ask("D"), "OK");
    let debugged = child.wait_with_output().expect("it ends");
    assert!(debugged.status.success(), "{}", error_of(&debugged));
    assert!(error_of(&debugged).contains("gdb: detached"), "{}", error_of(&debugged));
    let (plain, debugged) = (printed(&plain), printed(&debugged));
    assert!(plain.len() > 300 && plain == debugged, "{} and {} lines", plain.len(), debugged.len());
}

#[test]
fn a_tool_that_is_killed_takes_the_board_along_though_a_debugger_holds_it() {
    let (mut child, address) = waiting();
    let mut gdb = Gdb::connect(&address);
    assert_eq!(gdb.pc() & !0x7_FFFF, 0x0800_0000);
    child.kill().expect("it ran");
    child.wait().expect("it has ended");
    // The emulator was the tool's child, and its end is the connection's.
    assert!(gdb.has_ended());
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
