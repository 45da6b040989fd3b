//! The real serial path: the tool on one end of a pseudo-terminal, the emulated board on the other, in real time.
#![cfg(unix)]

mod board;

use board::{PATIENCE, on_a_board, patient, rigctl};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rig_link::State;
use rigctl::log::Log;
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/default.toml");
/// A script for the tool, which its test removes.
fn script(name: &str, text: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("rigctl-{name}-{}.script", std::process::id()));
    std::fs::write(&path, text).expect("written");
    path
}

fn interrupts(tool: u32) {
    kill(Pid::from_raw(i32::try_from(tool).expect("a process")), Signal::SIGINT).expect("it runs");
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// The last line that was printed, as JSON.
fn last_line(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    serde_json::from_str(text.lines().last().unwrap_or_default()).unwrap_or_else(|e| panic!("{e}: {}", said(output)))
}

#[test]
fn a_board_on_a_serial_line_is_greeted_homed_and_moved() {
    on_a_board(|board| {
        let status = board.rigctl(&["--scene", SCENE, "status"]);
        assert!(status.status.success(), "{}", said(&status));
        let refused = board.rigctl(&["--scene", SCENE, "move", "--to", "3mm"]);
        assert_eq!(refused.status.code(), Some(1), "{}", said(&refused));
        assert!(said(&refused).contains("not homed"), "{}", said(&refused));
        let (homed, took_s) = board.timed(&["--scene", SCENE, "home"]);
        assert!(homed.status.success(), "{}", said(&homed));
        // The board has run for longer than the tool, whose clock is another one.
        let reported_s = last_line(&homed)["duration_s"].as_f64().expect("a duration");
        assert!((took_s - 5.0..took_s).contains(&reported_s), "{reported_s} s of {took_s} s");
        let moved = board.rigctl(&["--scene", SCENE, "move", "--to", "3mm", "--speed", "2mm/s"]);
        assert!(moved.status.success(), "{}", said(&moved));
        let last = last_line(&moved);
        let error = last["error_m"].as_f64().unwrap_or_else(|| panic!("no error in {last}"));
        assert!(error.abs() < 50e-6, "{last}");
        None
    });
}

#[test]
fn an_interrupted_tool_stops_the_board_and_ends_its_log() {
    on_a_board(|board| {
        let script = script("interrupted", "0.5 jog 1rad/s\n60 end\n");
        let log = script.with_extension("csv");
        let [log_text, script_text] = [&log, &script].map(|path| path.to_str().expect("a path"));
        let tool = board.turning(&["record", "--out", log_text, "--script", script_text]);
        interrupts(tool.id());
        let ended = board.end_of(tool);
        assert!(ended.status.code() == Some(1) && said(&ended).contains("interrupted"), "{}", said(&ended));
        let whole = Log::load(&log).expect("a log").whole().expect("its end is there");
        assert!(whole.header.get("broken_off").is_some_and(|why| why.contains("interrupted")));
        assert!(whole.rows.iter().any(|row| row.state == State::Moving), "it turned");
        let status = board.rigctl(&["--scene", SCENE, "status"]);
        let text = String::from_utf8_lossy(&status.stdout).into_owned();
        let status: Value = serde_json::from_str(text.trim()).unwrap_or_else(|e| panic!("{e}: {text}"));
        let telemetry = &status["telemetry"];
        assert!(telemetry["state"] == "unhomed" && telemetry["fault"].is_null(), "{telemetry}");
        for path in [log, script] {
            std::fs::remove_file(path).expect("was there");
        }
        Some(board)
    });
}

#[test]
fn a_board_of_another_scene_is_refused_until_it_is_sent_the_table() {
    on_a_board(|board| {
        let scene = std::env::temp_dir().join(format!("rigctl-sent-table-{}.toml", std::process::id()));
        let default = std::fs::read_to_string(SCENE).expect("the default scene");
        assert!(default.contains("\nk2 = 0.127\n"));
        std::fs::write(&scene, default.replace("\nk2 = 0.127\n", "\nk2 = 0.13\n")).expect("written");
        board.met.store(true, Ordering::Relaxed);
        let run = |arguments: &[&str]| {
            let mut tool = rigctl();
            tool.args(["--port", &board.device, "--scene"]).arg(&scene).args(arguments).output().expect("rigctl runs")
        };
        let refused = run(&["config", "set", "speed-max", "3mm/s"]);
        assert!(refused.status.code() == Some(1) && said(&refused).contains("another scene"), "{}", said(&refused));
        let sent = run(&["table", "--board"]);
        assert!(sent.status.success(), "{}", said(&sent));
        let taken = run(&["config", "set", "speed-max", "3mm/s"]);
        assert!(taken.status.success(), "{}", said(&taken));
        board.met.store(false, Ordering::Relaxed);
        std::fs::remove_file(scene).expect("was there");
        None
    });
}

#[test]
fn a_board_that_vanishes_in_mid_motion_is_told() {
    on_a_board(|board| {
        let before = board.now();
        // The pseudo-terminal lives as long as anybody has its other end, and a child of this process would have it.
        let mut tool = patient(Command::new("bash"));
        let closed =
            "for fd in /proc/self/fd/*; do fd=${fd##*/}; ((fd > 2)) && eval \"exec $fd>&-\"; done; exec \"$@\"";
        tool.args(["-c", closed, "bash", env!("CARGO_BIN_EXE_rigctl")]);
        tool.args(["--port", &board.device, "--scene", SCENE, "jog", "--speed", "1", "--seconds", "600"]);
        board.met.store(true, Ordering::Relaxed);
        let mut child = tool.stderr(Stdio::piped()).spawn().expect("rigctl runs");
        board.wait("a turn", |truth| (truth.twist_rad - before.twist_rad).abs() > 0.5);
        // The cable is pulled.
        drop(board);
        let end = Instant::now() + PATIENCE;
        while child.try_wait().expect("a child").is_none() {
            assert!(Instant::now() < end, "it goes on without a board: {:?}", child.kill());
            std::thread::sleep(Duration::from_millis(5));
        }
        let ended = child.wait_with_output().expect("its output");
        assert!(ended.status.code() == Some(1) && said(&ended).contains("serial port"), "{}", said(&ended));
        None
    });
}

#[test]
fn a_board_that_falls_silent_on_an_open_line_ends_every_command_with_an_error() {
    on_a_board(|board| {
        let script = script("silent", "0.5 jog 1rad/s\n600 end\n");
        let log = script.with_extension("csv");
        let [log_text, script_text] = [&log, &script].map(|path| path.to_str().expect("a path"));
        let record = ["record", "--out", log_text, "--script", script_text];
        for (arguments, to_board) in [
            (&["jog", "--speed", "1", "--seconds", "600"][..], false),
            (&["jog", "--speed=-1", "--seconds", "600"], true),
            (&record, false),
        ] {
            let tool = board.turning(arguments);
            board.breaks(true, to_board);
            let ended = board.end_of(tool);
            let said = String::from_utf8_lossy(&ended.stderr).into_owned();
            let words = said.contains("the board went silent") && said.contains("did NOT acknowledge the stop");
            assert!(ended.status.code() == Some(1) && words, "{arguments:?}: {said}");
            // Where it still hears it was stopped, and else it has stopped by itself.
            board.stands();
            board.breaks(false, false);
            let status = board.rigctl(&["--scene", SCENE, "status"]);
            let fault = last_line(&status)["telemetry"]["fault"].clone();
            // A machine that keeps the tool from running for 0.4 s lets the board stop by itself in either case.
            assert!(fault == "host-silent" || !to_board && fault.is_null(), "{arguments:?}: {fault}");
            assert!(fault.is_null() || board.rigctl(&["--scene", SCENE, "clear"]).status.success());
        }
        let whole = Log::load(&log).expect("a log").whole().expect("its end is there");
        assert!(whole.header.get("broken_off").is_some_and(|why| why.contains("silent")), "{:?}", whole.header);
        for path in [log, script] {
            std::fs::remove_file(path).expect("was there");
        }
        Some(board)
    });
}

#[test]
fn a_board_that_is_reset_in_mid_motion_ends_the_command_and_leaves_a_log_that_can_be_read() {
    on_a_board(|board| {
        let tool = board.turning(&["jog", "--speed", "1", "--seconds", "600"]);
        board.power_cycle();
        let ended = board.end_of(tool);
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(ended.status.code() == Some(1) && said.contains("the board was reset"), "{said}");
        // Its clock began again, while that of the tool's port had begun later than the board's: rows go on all the same.
        let script = script("reset", "5 jog 1rad/s\n20 end\n");
        let log = script.with_extension("csv");
        let [log_text, script_text] = [&log, &script].map(|path| path.to_str().expect("a path"));
        let tool = board.turning(&["record", "--out", log_text, "--script", script_text]);
        board.power_cycle();
        let ended = board.end_of(tool);
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        Log::load(&log).expect("a log").whole().expect("its end is there");
        for path in [log, script] {
            std::fs::remove_file(path).expect("was there");
        }
        Some(board)
    });
}

#[test]
fn a_script_that_ends_while_the_rig_moves_stops_it() {
    on_a_board(|board| {
        let script = script("ends", "0.5 jog 1rad/s\n3 end\n");
        let played = board.rigctl(&["--scene", SCENE, "play", script.to_str().expect("a path")]);
        let words = said(&played).contains("the script ended while the rig moved: stopped");
        assert!(played.status.success() && words, "{}", said(&played));
        board.stands();
        let status = last_line(&board.rigctl(&["--scene", SCENE, "status"]));
        assert!(status["telemetry"]["fault"].is_null(), "{status}");
        std::fs::remove_file(script).expect("was there");
        Some(board)
    });
}

/// What goes to standard error may fail, the command may not.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_standard_error_does_not_keep_a_stop_from_the_board() {
    on_a_board(|board| {
        board.met.store(true, Ordering::Relaxed);
        let mut tool = rigctl();
        tool.args(["--scene", SCENE, "stop"]).env("RIGCTL_PORT", &board.device);
        let full = std::fs::File::options().write(true).open("/dev/full").expect("Linux has it");
        let ended = tool.stderr(full).output().expect("rigctl runs");
        board.met.store(false, Ordering::Relaxed);
        assert_eq!(ended.status.code(), Some(0), "{}", said(&ended));
        Some(board)
    });
}

#[test]
fn an_interrupt_says_whether_the_stop_has_arrived() {
    on_a_board(|board| {
        let tool = board.turning(&["jog", "--speed", "1", "--seconds", "600"]);
        board.breaks(true, true);
        interrupts(tool.id());
        let ended = board.end_of(tool);
        let said = said(&ended);
        assert!(ended.status.code() == Some(1) && said.contains("did NOT acknowledge the stop"), "{said}");
        assert!(!said.contains("was stopped"), "{said}");
        None
    });
}

#[test]
fn a_reader_that_stops_to_read_does_not_keep_the_tool_from_its_heartbeats() {
    on_a_board(|board| {
        let before = board.now();
        let script = script("slow", "600 end\n");
        let mut tool = rigctl();
        tool.args(["--json", "--port", &board.device, "--scene", SCENE, "play"]).arg(&script);
        board.met.store(true, Ordering::Relaxed);
        // Nobody reads: a pipe of 64 KiB is full after some 200 rows, 2 s.
        let mut child = tool.stdout(Stdio::piped()).spawn().expect("rigctl runs");
        // Without heartbeats the board's time stands still.
        board.wait("the time of 800 rows", |truth| truth.t_s > before.t_s + 8.0);
        child.kill().expect("killed");
        child.wait().expect("ended");
        std::fs::remove_file(script).expect("was there");
        Some(board)
    });
}

/// A client of a server on this socket, as soon as there is one.
fn client(socket: &Path) -> UnixStream {
    let end = Instant::now() + PATIENCE;
    loop {
        match UnixStream::connect(socket) {
            Ok(client) => return client,
            Err(e) => assert!(Instant::now() < end, "{}: {e}", socket.display()),
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn clients_of_a_server_are_told_that_the_board_is_silent_and_that_it_is_back() {
    on_a_board(|board| {
        let before = board.now();
        let socket = std::env::temp_dir().join(format!("rigctl-silent-{}.sock", std::process::id()));
        let mut tool = rigctl();
        tool.args(["--port", &board.device, "--scene", SCENE, "serve", "--listen"]).arg(&socket);
        board.met.store(true, Ordering::Relaxed);
        let server = tool.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("rigctl runs");
        let mut client = client(&socket);
        client.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        let mut lines = BufReader::new(client.try_clone().expect("a handle")).lines();
        let mut next = |what: &str, is: &dyn Fn(&Value) -> bool| {
            lines
                .by_ref()
                .map(|line| serde_json::from_str::<Value>(&line.expect("a line")).expect("JSON"))
                .find(|line| is(line))
                .unwrap_or_else(|| panic!("the connection ended before {what}"))
        };
        let mut send = |line: &str| client.write_all(format!("{line}\n").as_bytes()).expect("sent");
        send("{\"id\":1,\"do\":\"jog\",\"speed_rad_per_s\":1.0}");
        board.wait("a turn", |truth| (truth.twist_rad - before.twist_rad).abs() > 1.0);
        board.breaks(true, false);
        next("the news", &|line| line["event"]["kind"] == "board-silent");
        let end = next("the jog's end", &|line| line["id"] == 1);
        assert_eq!(end["error"]["kind"], "board-silent");
        send("{\"id\":2,\"do\":\"status\"}");
        assert_eq!(next("an answer", &|line| line["id"] == 2)["done"]["state"], "silent");
        send("{\"id\":3,\"do\":\"jog\",\"speed_rad_per_s\":1.0}");
        assert_eq!(next("an answer", &|line| line["id"] == 3)["error"]["kind"], "board-silent");
        // The board still hears, and was stopped.
        board.stands();
        board.breaks(false, false);
        next("the news", &|line| line["event"]["kind"] == "board-heard");
        send("{\"id\":4,\"do\":\"status\"}");
        let status = next("an answer", &|line| line["id"] == 4)["done"].clone();
        // It was silent for more than three of its seconds.
        assert!(
            status["state"] == "unhomed" && status["lost_rows"].as_u64().is_some_and(|rows| rows > 300),
            "{status}"
        );
        // A server whose last stop is not acknowledged has not ended well.
        board.breaks(true, true);
        interrupts(server.id());
        let ended = board.end_of(server);
        assert!(ended.status.code() == Some(1) && said(&ended).contains("did NOT acknowledge"), "{}", said(&ended));
        None
    });
}

#[test]
fn a_board_whose_server_dies_in_mid_motion_stops_by_itself() {
    on_a_board(|board| {
        let before = board.now();
        let socket = std::env::temp_dir().join(format!("rigctl-serial-{}.sock", std::process::id()));
        let mut tool = rigctl();
        tool.args(["--port", &board.device, "--scene", SCENE, "serve", "--listen"]).arg(&socket);
        board.met.store(true, Ordering::Relaxed);
        let mut server = tool.stdout(Stdio::null()).spawn().expect("rigctl runs");
        let mut client = client(&socket);
        client.write_all(b"{\"do\":\"jog\",\"speed_rad_per_s\":1.0}\n").expect("sent");
        board.wait("a turn", |truth| (truth.twist_rad - before.twist_rad).abs() > 1.0);
        server.kill().expect("killed");
        server.wait().expect("ended");
        board.met.store(false, Ordering::Relaxed);
        // Half a second of silence, and a ramp.
        board.stands();
        std::fs::remove_file(socket).expect("the dead server left it");
        None
    });
}

#[test]
fn a_device_that_is_none_is_named() {
    let tool = rigctl().args(["--port", "/dev/no-such-rig", "status"]).output();
    let output = tool.expect("rigctl runs");
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("/dev/no-such-rig"), "{}", said(&output));
    // What only an emulated rig has is not silently passed over.
    let mut tool = rigctl();
    tool.args(["--port", "/dev/no-such-rig", "--plant", "load=1kg", "status"]);
    let output = tool.output().expect("rigctl runs");
    assert!(output.status.code() == Some(2) && said(&output).contains("--plant"), "{}", said(&output));
}
