//! The loop between the board and its clients. It never waits for a client: each has a queue of bounded length in either
//! direction.

use super::client::{Client, Line};
use super::flights::{Flights, Landed};
use super::order::{self, Command};
use super::socket::{self, Socket};
use super::{answer, event};
use crate::failure::{BrokenOff, Failure, Refused, Why};
use crate::log::write;
use crate::session::{Session, interrupt};
use rig_link::{EventKind, Request, State};
use serde_json::{Value, json};
use std::io::Write;
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::time::{Duration, Instant};

/// Maximum clients at a time: each has two threads.
const CLIENTS: usize = 32;
/// Longest wait for the last lines to go out.
const LAST_LINES: Duration = Duration::from_millis(300);
/// What clients are told while the board is silent.
const SILENT: &str = "no telemetry came for half a second: what the rig does is not known. The board is asked to stop; press \
                      the emergency stop if the rig may move";
/// Pause after a connection that could not be accepted.
const PAUSE: Duration = Duration::from_millis(50);

/// Serves until the operator interrupts. Every client is greeted with `hello`; `paced` lets emulated time pass as real time.
///
/// # Errors
/// If the port fails, the emulated board stopped, or the board did not acknowledge the last stop.
pub fn serve(session: &mut Session, socket: &Socket, hello: &Value, paced: bool) -> Result<(), Failure> {
    // A board that is heard again is served again.
    (session.bears_silence, session.bears_reset) = (true, true);
    let (arrived, arrivals) = mpsc::sync_channel(CLIENTS);
    let listener = socket.listener()?;
    std::thread::Builder::new().spawn(move || accept(&listener, &arrived))?;
    let hello = hello.to_string().into();
    let mut server = Server {
        session,
        arrivals,
        hello,
        clients: Vec::new(),
        next_number: 1,
        writer: None,
        flights: Flights::default(),
        silent: false,
    };
    let (started, start_s) = (Instant::now(), server.session.now_s());
    let result = loop {
        if let Err(failure) = server.turn() {
            break Err(failure);
        }
        if paced {
            // Emulated time may run ahead; it may also be slower than real time, then nothing waits.
            let ahead_s = server.session.now_s() - start_s - started.elapsed().as_secs_f64();
            std::thread::sleep(Duration::from_secs_f64(ahead_s.max(0.0)));
        }
    };
    server.end(result.as_ref().err().and_then(Failure::message).unwrap_or_default());
    // The interrupt is how a server ends.
    let stopped = BrokenOff { why: Why::Interrupted, stopped: true };
    result.or_else(|failure| if failure.broken_off() == Some(stopped) { Ok(()) } else { Err(failure) })
}

/// Hands on the connections of those who may connect.
fn accept(listener: &UnixListener, arrived: &SyncSender<UnixStream>) {
    loop {
        match listener.accept() {
            Ok((stream, _)) => match socket::check_peer(&stream) {
                Ok(()) => {
                    if arrived.send(stream).is_err() {
                        return;
                    }
                }
                Err(why) => turn_away(stream, Refused::new("not-owner", why)),
            },
            // The process may have no handle left for the moment.
            Err(_) => std::thread::sleep(PAUSE),
        }
    }
}

/// Says why, and ends the connection. The line fits the empty buffer of a new socket.
fn turn_away(mut stream: UnixStream, why: Refused) {
    let _ = writeln!(stream, "{}", answer(None, Err(why)));
}

struct Server<'a> {
    session: &'a mut Session,
    arrivals: Receiver<UnixStream>,
    hello: Arc<str>,
    clients: Vec<Client>,
    next_number: u64,
    /// Number of the client that commands the rig.
    writer: Option<u64>,
    flights: Flights,
    /// The clients were told that the board is silent.
    silent: bool,
}

impl Server<'_> {
    /// One step of the board, and everything around it.
    fn turn(&mut self) -> Result<(), Failure> {
        self.welcome();
        let lines: Vec<(u64, Line)> = self
            .clients
            .iter_mut()
            .flat_map(|client| {
                let number = client.number;
                client.lines().into_iter().map(move |line| (number, line))
            })
            .collect();
        for (client, line) in lines {
            self.take(client, line)?;
        }
        self.part()?;
        self.session.step()?;
        for row in self.session.take_rows() {
            let line: Arc<str> = serde_json::to_string(&row)?.into();
            self.clients.iter_mut().for_each(|client| client.outbox.offer(&line));
        }
        self.silence();
        let now_s = self.session.now_s();
        for (number, result) in self.session.take_replies() {
            self.flights.reply(number, result, now_s);
        }
        for (t_s, kind) in self.session.take_events() {
            self.flights.event(&kind);
            let text = write::event(&kind);
            let (name, message) = text.split_once(' ').unwrap_or((&text, ""));
            // What a homing found is in its answer, and in the telemetry.
            let message = if matches!(kind, EventKind::Homed(_)) { "" } else { message };
            self.tell_all(&event(t_s, name, message));
        }
        self.flights.pass(self.session.state(), now_s, self.session.reply_s());
        self.session.take_log();
        self.answer_landed();
        Ok(())
    }

    /// Tells the clients that the board has fallen silent, or is heard again.
    fn silence(&mut self) {
        let silent = self.session.silent_s().is_some();
        if std::mem::replace(&mut self.silent, silent) == silent {
            return;
        }
        if silent {
            self.flights.end_all("board-silent", SILENT);
            self.tell_all(&event(self.session.board_s(), "board-silent", SILENT));
        } else {
            let message = format!("{} rows of telemetry were lost so far", self.session.lost_rows());
            self.tell_all(&event(self.session.board_s(), "board-heard", &message));
        }
    }

    /// Greets those who have connected.
    fn welcome(&mut self) {
        while let Ok(stream) = self.arrivals.try_recv() {
            if self.clients.len() >= CLIENTS {
                turn_away(stream, Refused::new("full", format!("{CLIENTS} clients are connected")));
                continue;
            }
            // Without a handle or thread left the connection is dropped, and its other end sees that.
            if let Ok(mut client) = Client::start(self.next_number, stream) {
                client.outbox.send(Arc::clone(&self.hello));
                self.next_number += 1;
                self.clients.push(client);
            }
        }
    }

    /// Does what a client's line says.
    fn take(&mut self, client: u64, line: Line) -> Result<(), Failure> {
        let order::Line { id, command } = match line {
            Line::Whole(bytes) => order::Line::read(&bytes),
            Line::TooLong => order::Line::too_long(),
        };
        let result = match command {
            Err(refused) => Err(refused),
            Ok(Command::Status) => Ok(self.status(client)),
            Ok(Command::Release) => self.release(client)?,
            Ok(Command::Order(request)) if self.silent && *request != Request::Stop => {
                Err(Refused::new("board-silent", SILENT))
            }
            // Whoever sees the rig go wrong may stop it.
            Ok(Command::Order(request)) if *request == Request::Stop || self.may_write(client) => {
                let number = self.session.post(&request)?;
                self.flights.start(client, id, number, *request, self.session.now_s());
                return Ok(());
            }
            Ok(Command::Order(_)) => Err(Refused::new(
                "writer-taken",
                "another client commands the rig until it releases it or disconnects; `stop`, `hold` and `status` are for \
                 everybody",
            )),
        };
        self.tell(client, &answer(id.as_ref(), result));
        Ok(())
    }

    /// Whether this client commands the rig, which it does from its first order on if nobody else does.
    fn may_write(&mut self, client: u64) -> bool {
        *self.writer.get_or_insert(client) == client
    }

    fn status(&self, client: u64) -> Value {
        let writer = self.writer.map(|writer| if writer == client { "you" } else { "another" });
        json!({
            "state": if self.silent { "silent" } else { self.session.state().name() },
            "writer": writer,
            "clients": self.clients.len(),
            "lost_rows": self.session.lost_rows(),
        })
    }

    fn release(&mut self, client: u64) -> Result<Result<Value, Refused>, Failure> {
        if self.writer != Some(client) {
            return Ok(Err(Refused::new("not-writer", "this client does not command the rig")));
        }
        self.lose_writer(client, "released the rig")?;
        Ok(Ok(json!({})))
    }

    /// Parts from the clients that have gone. A writer that sends no more is none.
    fn part(&mut self) -> Result<(), Failure> {
        let silent = self.clients.iter().find(|c| Some(c.number) == self.writer && (c.is_silent() || c.is_gone()));
        if let Some(number) = silent.map(|client| client.number) {
            self.lose_writer(number, "disconnected")?;
        }
        self.clients.retain(|client| !client.is_gone());
        Ok(())
    }

    /// The writer commands the rig no longer. A motion that nobody answers for is stopped.
    fn lose_writer(&mut self, client: u64, how: &str) -> Result<(), Failure> {
        self.writer = None;
        let moves =
            self.silent || matches!(self.session.state(), State::Moving | State::Homing) || self.flights.any_of(client);
        let message = if !moves {
            format!("the writer {how}; the rig was at rest")
        } else {
            match self.session.request(&Request::Stop) {
                Ok(_) => format!("the writer {how} while the rig moved: it was stopped"),
                Err(failure) if interrupt::wanted() => return Err(failure),
                // Then the board holds by itself, as it does when it hears nothing for half a second.
                Err(failure) => {
                    let why = failure.message().unwrap_or_default();
                    format!("the writer {how} while the rig moved: the board did not confirm the stop: {why}")
                }
            }
        };
        let t_s = self.session.board_s();
        self.tell_all(&event(t_s, "writer-gone", &message));
        Ok(())
    }

    fn answer_landed(&mut self) {
        for Landed { client, id, result } in self.flights.take() {
            // A stream of orders without ids would otherwise be answered for each one that ended well.
            let is_needed = id.is_some() || result.as_ref().is_err_and(|refused| refused.kind != "replaced");
            if is_needed {
                self.tell(client, &answer(id.as_ref(), result));
            }
        }
    }

    /// To one client, if it is still there.
    fn tell(&mut self, client: u64, line: &str) {
        if let Some(client) = self.clients.iter_mut().find(|other| other.number == client) {
            client.outbox.send(line);
        }
    }

    fn tell_all(&mut self, line: &str) {
        let line: Arc<str> = line.into();
        self.clients.iter_mut().for_each(|client| client.outbox.send(Arc::clone(&line)));
    }

    /// Says why the server ends, and gives the clients a moment to read it.
    fn end(&mut self, why: String) {
        self.flights.end_all("ended", &why);
        self.answer_landed();
        self.tell_all(&event(self.session.board_s(), "server-ended", &why));
        self.clients.iter_mut().for_each(|client| client.outbox.close());
        let end = Instant::now() + LAST_LINES;
        while Instant::now() < end && !self.clients.iter().all(Client::is_written) {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
