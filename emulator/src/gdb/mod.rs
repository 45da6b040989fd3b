//! A GDB looks into the running firmware, over TCP.
//!
//! The machine runs until a client connects and speaks the protocol. Then it stops, and emulated time with it, until
//! the client lets it continue. When the client leaves, by `detach`, by accident or because it speaks another protocol,
//! all breakpoints are removed and the machine runs on. There is one client at a time.

mod target;

use crate::machine::{Debugger, Machine, Pause};
use anyhow::{Context, Result};
use gdbstub::common::Signal;
use gdbstub::conn::Connection;
use gdbstub::stub::state_machine::GdbStubStateMachine;
use gdbstub::stub::{DisconnectReason, GdbStubBuilder, SingleThreadStopReason};
use rig_plant::board::Board;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How often a wait for the debugger checks whether the host is still there.
const LOOK: Duration = Duration::from_millis(50);
/// How long a debugger may leave what it is sent unread.
const WRITE: Duration = Duration::from_secs(5);

/// Waits for debuggers, and serves one at a time.
pub struct Server<B: Board + 'static> {
    listener: TcpListener,
    client: Client<B>,
    /// The machine does not start without a debugger.
    wait: bool,
    /// The host that the machine runs for has gone.
    host_gone: Arc<AtomicBool>,
}

/// gdbstub's state, with its connection.
type Stub<B> = GdbStubStateMachine<'static, Machine<B>, Wire>;

enum Client<B: Board + 'static> {
    None,
    /// Connected, and silent so far: the machine does not stop for that.
    Silent(TcpStream),
    Session(Stub<B>, TcpStream),
}

/// Why a session is over, in words.
struct Over(String);

impl<B: Board + 'static> Server<B> {
    /// Listens at `address`; port 0 is any that is free.
    ///
    /// # Errors
    /// If it cannot, naming the address.
    pub fn bind(address: &str, wait: bool, host_gone: Arc<AtomicBool>) -> Result<Self> {
        let listener = TcpListener::bind(address).with_context(|| format!("--gdb {address}"))?;
        listener.set_nonblocking(true).with_context(|| format!("--gdb {address}"))?;
        Ok(Self { listener, client: Client::None, wait, host_gone })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// The operating system's.
    pub fn address(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    fn host_gone(&self) -> bool {
        self.host_gone.load(Ordering::Relaxed)
    }

    /// Accepts a client, and begins a session with one that has sent its first byte.
    fn meet(&mut self, machine: &mut Machine<B>) -> Result<(), Over> {
        if matches!(self.client, Client::None)
            && let Ok((stream, _)) = self.listener.accept()
        {
            let ready = stream.set_nodelay(true).and_then(|()| stream.set_write_timeout(Some(WRITE)));
            ready.and_then(|()| stream.set_nonblocking(true)).map_err(|e| Over(e.to_string()))?;
            self.client = Client::Silent(stream);
        }
        let Client::Silent(stream) = &self.client else { return Ok(()) };
        let mut first = [0];
        match stream.peek(&mut first) {
            Err(e) if e.kind() == ErrorKind::WouldBlock => return Ok(()),
            // A packet, or the acknowledgement that gdb greets with.
            Ok(1) if matches!(first, [b'$' | b'+']) => {}
            Ok(1) => return Err(Over("what connected does not speak gdb's protocol".into())),
            Ok(_) => return Err(Over("it went away".into())),
            Err(e) => return Err(Over(e.to_string())),
        }
        let Client::Silent(stream) = std::mem::replace(&mut self.client, Client::None) else { return Ok(()) };
        self.client = begin(machine, stream).map_err(|e| Over(format!("{e:#}")))?;
        self.wait = false;
        eprintln!("gdb: attached, the board stands");
        Ok(())
    }

    /// Between two slices: handles a new client, or new bytes of the present one.
    fn between(&mut self, machine: &mut Machine<B>) -> Result<(), Over> {
        while let Err(over) = self.meet(machine) {
            self.end(machine, &over);
        }
        while self.wait && !self.host_gone() {
            std::thread::sleep(LOOK);
            if let Err(over) = self.meet(machine) {
                self.end(machine, &over);
            }
        }
        if let Client::Session(GdbStubStateMachine::Running(_), stream) = &mut self.client {
            let quick = |on| stream.set_nonblocking(on).map_err(|e| Over(e.to_string()));
            quick(true)?;
            let mut bytes = [0; 256];
            let read = (&*stream).read(&mut bytes);
            quick(false)?;
            self.take(machine, read, &bytes)?;
        }
        self.hold(machine)
    }

    /// Does what the debugger requests until it lets the core continue.
    fn hold(&mut self, machine: &mut Machine<B>) -> Result<(), Over> {
        while let Client::Session(GdbStubStateMachine::Idle(_), stream) = &mut self.client {
            let mut bytes = [0; 256];
            let read = stream.read(&mut bytes);
            self.take(machine, read, &bytes)?;
            if self.host_gone() {
                return Err(Over("the host that the board ran for has gone".into()));
            }
        }
        Ok(())
    }

    fn take(&mut self, machine: &mut Machine<B>, read: std::io::Result<usize>, bytes: &[u8]) -> Result<(), Over> {
        match read {
            Ok(0) => Err(Over("it closed the connection".into())),
            Ok(count) => bytes[..count].iter().try_for_each(|&byte| self.feed(machine, byte)),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {
                Ok(())
            }
            Err(e) => Err(Over(e.to_string())),
        }
    }

    fn feed(&mut self, machine: &mut Machine<B>, byte: u8) -> Result<(), Over> {
        self.step(|stub| match stub {
            GdbStubStateMachine::Idle(idle) => idle.incoming_data(machine, byte),
            GdbStubStateMachine::Running(running) => running.incoming_data(machine, byte),
            other => Ok(other),
        })?;
        self.step(|stub| match stub {
            GdbStubStateMachine::CtrlCInterrupt(asked) => {
                asked.interrupt_handled(machine, Some(SingleThreadStopReason::Signal(Signal::SIGINT)))
            }
            other => Ok(other),
        })
    }

    fn stop(&mut self, machine: &mut Machine<B>, reason: SingleThreadStopReason<u32>) -> Result<(), Over> {
        self.stopped(machine, reason)?;
        self.hold(machine)
    }

    /// Tells the debugger why the core has stopped.
    fn stopped(&mut self, machine: &mut Machine<B>, reason: SingleThreadStopReason<u32>) -> Result<(), Over> {
        self.step(|stub| match stub {
            GdbStubStateMachine::Running(running) => running.report_stop(machine, reason),
            other => Ok(other),
        })
    }

    fn step(&mut self, next: impl FnOnce(Stub<B>) -> Result<Stub<B>, StubError>) -> Result<(), Over> {
        let Client::Session(stub, stream) = std::mem::replace(&mut self.client, Client::None) else { return Ok(()) };
        match next(stub).map_err(|e| Over(e.to_string()))? {
            GdbStubStateMachine::Disconnected(over) => Err(Over(
                match over.get_reason() {
                    DisconnectReason::Disconnect => "detached",
                    DisconnectReason::Kill => "left by `kill`, which only detaches here",
                    DisconnectReason::TargetExited(_) | DisconnectReason::TargetTerminated(_) => {
                        "the firmware has failed"
                    }
                }
                .into(),
            )),
            stub => {
                self.client = Client::Session(stub, stream);
                Ok(())
            }
        }
    }

    fn end(&mut self, machine: &mut Machine<B>, over: &Over) {
        self.client = Client::None;
        // A hook that cannot be removed is an error of unicorn, which the next run reports.
        let _ = machine.cpu_mut().let_go();
        let rest = if self.wait { "still waiting" } else { "the board runs on without breakpoints" };
        eprintln!("gdb: {}: {rest}", over.0);
    }
}

type StubError = gdbstub::stub::GdbStubError<unicorn_engine::uc_error, std::io::Error>;

/// Begins a session.
fn begin<B: Board + 'static>(machine: &mut Machine<B>, stream: TcpStream) -> Result<Client<B>> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(LOOK))?;
    let wire = Wire { stream: stream.try_clone()?, unsent: Vec::new() };
    let stub = GdbStubBuilder::new(wire).build()?.run_state_machine(machine)?;
    Ok(Client::Session(stub, stream))
}

impl<B: Board + 'static> Debugger<B> for Server<B> {
    fn pause(&mut self, machine: &mut Machine<B>, why: Pause) {
        let held = match why {
            Pause::Slice => self.between(machine),
            Pause::Breakpoint => self.stop(machine, SingleThreadStopReason::SwBreak(())),
            Pause::Step => self.stop(machine, SingleThreadStopReason::DoneStep),
            // The debugger may look at the core, which does not go on.
            Pause::Failed => self
                .stop(machine, SingleThreadStopReason::Signal(Signal::SIGSEGV))
                .and_then(|()| self.stopped(machine, SingleThreadStopReason::Terminated(Signal::SIGSEGV))),
        };
        if let Err(over) = held {
            self.end(machine, &over);
        }
    }
}

/// Sends what gdbstub writes byte by byte in one piece.
struct Wire {
    stream: TcpStream,
    unsent: Vec<u8>,
}

impl Connection for Wire {
    type Error = std::io::Error;

    fn write(&mut self, byte: u8) -> std::io::Result<()> {
        self.unsent.push(byte);
        Ok(())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Write::write_all(&mut self.stream, &std::mem::take(&mut self.unsent))
    }
}
