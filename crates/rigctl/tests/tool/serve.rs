//! `serve` on the emulated board: one writer, many readers, and what careless or hostile clients do.
#![cfg(unix)]

use crate::common::{error_of, root};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Longest wait for what takes seconds on an idle machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// Among a server's options: the rig of the page's examples instead of the ideal one.
const NOMINAL: &str = "nominal";

/// A server on an emulated board.
struct Server {
    child: Child,
    path: PathBuf,
}

impl Server {
    fn start(name: &str, options: &[&str]) -> Self {
        let path = std::env::temp_dir().join(format!("rigctl-serve-{}-{name}", std::process::id()));
        let child = Command::new(env!("CARGO_BIN_EXE_rigctl"))
            .args(["serve", "--rig", if options.contains(&NOMINAL) { "nominal" } else { "ideal" }, "--listen"])
            .arg(&path)
            .args(options.iter().filter(|option| **option != NOMINAL))
            .current_dir(root())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("rigctl runs");
        Self { child, path }
    }

    fn client(&self) -> Client {
        let end = Instant::now() + PATIENCE;
        loop {
            match UnixStream::connect(&self.path) {
                Ok(stream) => return Client::new(stream),
                Err(e) => assert!(Instant::now() < end, "{}: {e}", self.path.display()),
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn signal(&self, name: &str) {
        let sent = Command::new("kill").args([name, &self.child.id().to_string()]).status();
        assert!(sent.is_ok_and(|status| status.success()), "kill {name}");
    }

    fn ended(&mut self) -> ExitStatus {
        let end = Instant::now() + PATIENCE;
        loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                return status;
            }
            assert!(Instant::now() < end, "the server goes on");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_file(&self.path);
    }
}

struct Client {
    input: BufReader<UnixStream>,
    output: UnixStream,
    hello: Value,
}

impl Client {
    fn new(stream: UnixStream) -> Self {
        stream.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        let output = stream.try_clone().expect("a handle");
        let mut client = Self { input: BufReader::new(stream), output, hello: Value::Null };
        client.hello = client.next().expect("a greeting");
        client
    }

    /// The next line; none at the end.
    fn next(&mut self) -> Option<Value> {
        let mut line = String::new();
        match self.input.read_line(&mut line) {
            Ok(0) => None,
            Err(e) if e.kind() == ErrorKind::ConnectionReset => None,
            Err(e) => panic!("nothing within {PATIENCE:?}: {e}"),
            Ok(_) => Some(serde_json::from_str(&line).unwrap_or_else(|e| panic!("{line}: {e}"))),
        }
    }

    /// The next line that is so.
    fn until(&mut self, what: &str, mut is: impl FnMut(&Value) -> bool) -> Value {
        let end = Instant::now() + PATIENCE;
        while let Some(line) = self.next() {
            if is(&line) {
                return line;
            }
            assert!(Instant::now() < end, "{what} not within {PATIENCE:?}");
        }
        panic!("the connection ended before {what}");
    }

    fn send(&mut self, line: &str) {
        self.output.write_all(format!("{line}\n").as_bytes()).expect("sent");
    }

    /// Sends an order and waits for its answer.
    fn ask(&mut self, order: Value) -> Value {
        self.send(&order.to_string());
        self.until(&format!("an answer to {order}"), |line| {
            line.get("id") == order.get("id") && line.get("t_s").is_none()
        })
    }

    fn row(&mut self, what: &str, mut is: impl FnMut(&Value) -> bool) -> Value {
        self.until(what, |line| line.get("t_s").is_some() && is(line))
    }

    fn event(&mut self, kind: &str) -> Value {
        self.until(kind, |line| line["event"]["kind"] == kind)["event"].clone()
    }
}

fn kind(answer: &Value) -> &str {
    answer["error"]["kind"].as_str().unwrap_or_else(|| panic!("no error: {answer}"))
}

#[test]
fn one_client_commands_and_all_see_the_rig() {
    let server = Server::start("many", &["--fast"]);
    let (mut writer, mut second, mut reader) = (server.client(), server.client(), server.client());
    let hello = &writer.hello["hello"];
    assert!(hello["protocol"] == "tsa-serve 1" && hello["port"] == "sim" && hello["rig"] == "ideal", "{hello}");
    // A refused order makes its client the writer, too.
    let refused = writer.ask(json!({"id": "a", "do": "move", "to_m": 0.005}));
    assert!(kind(&refused) == "refused" && refused["error"]["message"] == "not homed: `home` first", "{refused}");
    let taken = second.ask(json!({"id": 1, "do": "home"}));
    assert_eq!(kind(&taken), "writer-taken");
    assert_eq!(second.ask(json!({"id": 2, "do": "status"}))["done"]["writer"], "another");
    assert_eq!(kind(&second.ask(json!({"id": 3, "release": true}))), "not-writer");
    let homed = writer.ask(json!({"id": 1, "do": "home"}));
    assert!(homed["done"]["load_n"].as_f64().is_some_and(|load_n| load_n > 1.0), "{homed}");
    let moved = writer.ask(json!({"id": 2, "do": "move", "to_m": 0.004, "speed_m_per_s": 0.004}));
    assert!(moved["done"]["error_m"].as_f64().is_some_and(|error_m| error_m.abs() < 1e-4), "{moved}");
    // Readers see the same rows, with the truth of an emulated rig.
    for client in [&mut second, &mut reader] {
        client.event("homed");
        client.event("move-done");
        let row = client.row("the end", |row| row["state"] == "holding");
        assert!((row["position_m"].as_f64().expect("known") - 0.004).abs() < 1e-4, "{row}");
        assert!((row["true_position_m"].as_f64().expect("known") - 0.004).abs() < 1e-4, "{row}");
    }
    // A move that is given again takes the place of the one before; anybody may stop it.
    writer.send(&json!({"id": 3, "do": "move", "to_m": 0.012, "speed_m_per_s": 1e-4}).to_string());
    writer.row("motion", |row| row["state"] == "moving");
    writer.send(&json!({"id": 4, "do": "move", "to_m": 0.001, "speed_m_per_s": 1e-4}).to_string());
    let replaced = writer.until("the first one's end", |line| line["id"] == 3);
    assert_eq!(kind(&replaced), "replaced");
    assert_eq!(second.ask(json!({"id": 4, "do": "stop"}))["done"], json!({}));
    let stopped = writer.until("the second one's end", |line| line["id"] == 4);
    assert_eq!(kind(&stopped), "stopped");
    // At rest the pen is handed on without a word to the rig.
    writer.row("rest", |row| row["state"] == "holding");
    assert_eq!(writer.ask(json!({"id": 5, "release": true}))["done"], json!({}));
    assert!(reader.event("writer-gone")["message"].as_str().is_some_and(|text| text.ends_with("at rest")));
    let moved = second.ask(json!({"id": 5, "do": "move", "to_m": 0.002, "speed_m_per_s": 0.004}));
    assert!(moved["done"].is_object(), "{moved}");
    assert_eq!(kind(&writer.ask(json!({"id": 6, "do": "home"}))), "writer-taken");
    // A jog goes on until it is stopped.
    second.send("{\"id\":6,\"do\":\"jog\",\"speed_rad_per_s\":1.0}");
    second.row("motion", |row| row["state"] == "moving");
    second.send("{\"id\":7,\"do\":\"hold\"}");
    let jogged = second.until("the jog's end", |line| line["id"] == 6);
    assert_eq!(jogged["done"], json!({}));
    assert!(second.ask(json!({"id": 8, "do": "clear"}))["done"].is_object());
    second.row("rest", |row| row["state"] != "moving");
    the_bridge_of_the_page_moves_the_rig(&mut second);
}

#[test]
fn a_writer_that_disconnects_leaves_the_rig_at_rest() {
    // While it homes: without its owner's eyes this goes no further either. In real time, or a busy machine might see the end.
    let server = Server::start("gone-homing", &[]);
    let (mut writer, mut reader) = (server.client(), server.client());
    writer.send("{\"do\":\"home\"}");
    writer.row("homing", |row| row["state"] == "homing");
    drop(writer);
    let told = reader.event("writer-gone");
    assert!(told["message"].as_str().is_some_and(|text| text.contains("disconnected") && text.contains("was stopped")));
    reader.row("rest", |row| row["state"] != "homing");
    let server = Server::start("gone", &["--fast"]);
    let (mut writer, mut reader) = (server.client(), server.client());
    assert!(writer.ask(json!({"id": 1, "do": "home"}))["done"].is_object());
    writer.send("{\"id\":2,\"do\":\"move\",\"to_m\":0.012,\"speed_m_per_s\":0.0001}");
    writer.row("motion", |row| row["state"] == "moving");
    // It sends no more, and still reads.
    writer.output.shutdown(Shutdown::Write).expect("half closed");
    assert_eq!(kind(&writer.until("the move's end", |line| line["id"] == 2)), "stopped");
    assert!(reader.event("writer-gone")["message"].as_str().is_some_and(|text| text.contains("was stopped")));
    let rest = reader.row("rest", |row| row["state"] == "holding");
    assert!(rest["position_m"].as_f64().is_some_and(|position_m| position_m < 0.01), "{rest}");
    writer.row("more telemetry", |row| row["state"] == "holding");
    // A move that has not even been answered counts as motion.
    let mut writer = server.client();
    writer.send("{\"do\":\"move\",\"to_m\":0.012,\"speed_m_per_s\":0.0001}");
    drop(writer);
    assert!(reader.event("writer-gone")["message"].as_str().is_some_and(|text| text.contains("was stopped")));
    reader.row("rest", |row| row["state"] == "holding");
}

#[test]
fn a_slow_reader_loses_whole_lines_is_told_and_holds_nobody_up() {
    let server = Server::start("slow", &[]);
    let (mut slow, mut quick) = (server.client(), server.client());
    // More than its queue and its socket's buffer hold.
    let (mut last_s, rows) = (0.0, 1500);
    for _ in 0..rows {
        let row = quick.row("telemetry", |_| true);
        let t_s = row["t_s"].as_f64().expect("a time");
        assert!(last_s == 0.0 || (t_s - last_s - 0.01).abs() < 1e-3, "{last_s} s, then {t_s} s");
        last_s = t_s;
    }
    let (mut before_s, mut lost) = (0.0, 0.0);
    let after_s = loop {
        let line = slow.next().expect("a line");
        if let Some(count) = line.get("lost") {
            lost = count.as_f64().expect("a number");
        } else if let Some(t_s) = line.get("t_s").and_then(Value::as_f64) {
            if lost > 0.0 {
                break t_s;
            }
            assert!(t_s < last_s + 10.0, "nothing was lost");
            before_s = t_s;
        }
    };
    println!("{lost} lines lost between {before_s} s and {after_s} s");
    assert!(lost > 10.0 && ((after_s - before_s) * 100.0 - lost - 1.0).abs() < 0.5, "{before_s}, {lost}, {after_s}");
}

#[test]
fn lines_that_mean_nothing_are_answered_by_name_and_harm_nothing() {
    let server = Server::start("nonsense", &["--fast"]);
    let (mut client, mut other) = (server.client(), server.client());
    for (line, named) in [("hello", "not JSON"), ("", "not JSON"), ("{\"do\":\"jog\"}", "speed_rad_per_s")] {
        client.send(line);
        let answer = client.until(named, |line| line.get("error").is_some());
        assert_eq!(kind(&answer), "bad-request");
        assert!(answer["error"]["message"].as_str().is_some_and(|text| text.contains(named)), "{line}: {answer}");
    }
    client.output.write_all(b"{\"do\":\"\xff\"}\n\0\n").expect("sent");
    for _ in 0..2 {
        assert_eq!(kind(&client.until("an error", |line| line.get("error").is_some())), "bad-request");
    }
    // A line of 10 MB, which the server does not keep.
    let mut sink = client.output.try_clone().expect("a handle");
    let sender = std::thread::spawn(move || {
        let piece = vec![b'x'; 100_000];
        (0..100).for_each(|_| sink.write_all(&piece).expect("sent"));
        sink.write_all(b"\n").expect("sent");
    });
    assert_eq!(kind(&client.until("an error", |line| line.get("error").is_some())), "too-long");
    sender.join().expect("sent");
    // None of this made it the writer, and the connection goes on.
    let status = client.ask(json!({"id": 1, "do": "status"}));
    assert_eq!(status["done"]["writer"], Value::Null);
    let jog = other.ask(json!({"id": 1, "do": "jog", "speed_rad_per_s": 99.0}));
    assert!(
        kind(&jog) == "refused" && jog["error"]["message"].as_str().is_some_and(|text| text.contains("99")),
        "{jog}"
    );
    // A client that floods the server and reads nothing is disconnected; the other one goes on.
    let mut flood = server.client();
    flood.output.set_write_timeout(Some(PATIENCE)).expect("a time-out");
    let end = Instant::now() + PATIENCE;
    while flood.output.write_all(b"{\"do\":\"status\"}\n").is_ok() {
        assert!(Instant::now() < end, "never disconnected");
    }
    assert!(other.ask(json!({"id": 2, "do": "status"}))["done"].is_object());
}

#[test]
fn an_interrupt_stops_the_rig_and_removes_the_socket() {
    for name in ["-INT", "-TERM"] {
        let mut server = Server::start(&format!("interrupt{name}"), &[]);
        let (mut writer, mut reader) = (server.client(), server.client());
        writer.send("{\"id\":1,\"do\":\"home\"}");
        writer.row("homing", |row| row["state"] == "homing");
        server.signal(name);
        assert_eq!(kind(&writer.until("an end", |line| line["id"] == 1)), "ended");
        let told = reader.event("server-ended");
        assert_eq!(told["message"], "interrupted: the board was stopped");
        assert!(reader.next().is_none(), "nothing after it");
        assert_eq!(server.ended().code(), Some(0));
        assert!(!server.path.exists(), "{name}");
    }
}

/// The text of the page's fenced blocks of this language.
fn blocks(language: &str) -> Vec<String> {
    let page = std::fs::read_to_string(root().join("docs/how-to/integrate.md")).expect("the page");
    let fence = format!("```{language}\n");
    page.split(&fence).skip(1).filter_map(|rest| Some(rest.split_once("\n```")?.0.to_owned())).collect()
}

/// Whether a line has the form that the page shows. Numbers differ from run to run, and so do texts with digits.
fn is_like(shown: &Value, heard: &Value) -> bool {
    match (shown, heard) {
        (Value::Object(shown), Value::Object(heard)) => {
            shown.len() == heard.len()
                && shown.iter().all(|(key, value)| heard.get(key).is_some_and(|other| is_like(value, other)))
        }
        (Value::Number(_), Value::Number(_)) => true,
        (Value::String(shown), Value::String(heard)) => shown == heard || shown.contains(|c: char| c.is_ascii_digit()),
        (shown, heard) => shown == heard,
    }
}

#[test]
fn the_conversation_of_the_page_is_what_is_said() {
    let server = Server::start("page", &["--fast", NOMINAL]);
    let mut client = server.client();
    let page = &blocks("text")[0];
    for line in page.lines() {
        match line.split_at(2) {
            ("> ", order) => client.send(order),
            ("< ", answer) => {
                let shown: Value = serde_json::from_str(answer).unwrap_or_else(|e| panic!("{answer}: {e}"));
                let heard = match shown.get("hello") {
                    Some(_) => client.hello.clone(),
                    None => client.until(answer, |line| line.get("t_s").is_none()),
                };
                assert!(is_like(&shown, &heard), "the page shows {shown}, and there is {heard}");
            }
            _ => panic!("what is {line}?"),
        }
    }
    assert!(page.lines().count() > 10);
}

/// By what it sends and reads, from a homed rig at rest on.
fn the_bridge_of_the_page_moves_the_rig(client: &mut Client) {
    let source = std::fs::read_to_string(root().join("examples/ros2_control/rig_system.cpp")).expect("the bridge");
    let sent: Vec<&str> = source.split("R\"(").skip(1).filter_map(|rest| Some(rest.split_once(")\"")?.0)).collect();
    let [stop, order] = sent[..] else { panic!("{sent:?}") };
    let gear_ratio = client.hello["hello"]["gear_ratio"].as_f64().expect("a number");
    // From where it hangs up by 4 mm, with a set-point for each row of telemetry.
    let (mut distance_m, mut before, mut target_m): (f64, Option<(f64, f64)>, f64) = (0.0, None, 0.0);
    let start_m =
        client.row("a position", |row| row["position_m"].is_number())["position_m"].as_f64().expect("a number");
    loop {
        let row = client.row("telemetry", |_| true);
        let number = |key: &str| row[key].as_f64().unwrap_or_else(|| panic!("{key}: {row}"));
        assert!(row["fault"].is_null() && number("load_n") > 0.0, "{row}");
        // The velocity as the bridge takes it is that of the position.
        let velocity = number("drive_speed_rad_per_s") / gear_ratio / number("tr_rad_per_m");
        let dt_s = before.map_or(0.0, |(t_s, _)| number("t_s") - t_s);
        distance_m += before.map_or(0.0, |(_, last)| 0.5 * (velocity + last)) * dt_s;
        before = Some((number("t_s"), velocity));
        let risen_m = number("position_m") - start_m;
        if risen_m > 3.9e-3 {
            println!("{distance_m} m by the velocity, {risen_m} m by the sensor");
            assert!((distance_m / risen_m - 1.0).abs() < 0.1, "{distance_m} m: {row}");
            break;
        }
        let speed = if target_m < 4e-3 { 2e-3 } else { 0.0 };
        target_m = (target_m + speed * dt_s).min(4e-3);
        let given = [start_m + target_m, speed].map(|number| format!("{number:.7}"));
        client.send(&order.replacen("%.7f", &given[0], 1).replacen("%.7f", &given[1], 1));
    }
    client.send(stop);
    client.row("rest", |row| row["state"] == "holding");
    let status = client.ask(json!({"id": 2, "do": "status"}));
    assert!(status["done"]["state"] == "holding" && status["done"]["writer"] == "you", "{status}");
}

/// Where [`connects_as_another_user`] connects.
const SOCKET: &str = "RIGCTL_TEST_SOCKET";

/// Not a test: a part of the next one, run as another user.
#[test]
#[ignore = "a part of another test"]
fn connects_as_another_user() {
    let path = std::env::var(SOCKET).expect("the other test sets it");
    let mut line = String::new();
    let said = UnixStream::connect(path).and_then(|stream| BufReader::new(stream).read_line(&mut line));
    println!("said {said:?} {line}");
}

#[test]
fn another_user_is_refused_even_where_the_file_is_open() {
    use std::os::unix::fs::PermissionsExt;
    use std::os::unix::process::CommandExt;
    let server = Server::start("user", &["--fast"]);
    let mut own = server.client();
    // The file alone keeps others out; then the question who connects does.
    for (mode, named) in [(0o600, "PermissionDenied"), (0o666, "not-owner")] {
        std::fs::set_permissions(&server.path, std::fs::Permissions::from_mode(mode)).expect("ours");
        let mut other = Command::new(std::env::current_exe().expect("this test"));
        other
            .args(["--exact", "serve::connects_as_another_user", "--ignored", "--nocapture"])
            .env(SOCKET, &server.path);
        // Only root may become another user, and that user must be able to run this file.
        let Ok(output) = other.uid(65_534).gid(65_534).output() else {
            println!("not tested: this user cannot become another one");
            return;
        };
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains(named), "{said}{}", error_of(&output));
    }
    assert!(own.next().is_some());
}
