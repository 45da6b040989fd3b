//! Talking with the board: requests and replies, the heartbeat, and everything that the board tells unasked.

use crate::record::{Recorder, Row};
use crate::transport::{Transport, TransportError};
use rig_link::{
    Accepted, Decoder, EventKind, HEARTBEAT_PERIOD_MS, Identity, MAX_FRAME, Message, PROTOCOL_HASH, Refusal, Request,
    encode,
};
use std::collections::VecDeque;

/// Length of one step (s): the board's telemetry period.
pub const STEP_S: f64 = 1e-3 * rig_link::TELEMETRY_PERIOD_MS as f64;

/// How long the board may take to answer a request (s).
const REPLY_TIMEOUT_S: f64 = 1.0;

/// How long the board may take to start (s); the drive alone takes half a second.
const BOOT_TIMEOUT_S: f64 = 5.0;

/// What reaches the caller.
#[derive(Debug, Clone, PartialEq)]
pub enum Happening {
    /// Telemetry.
    Row(Box<Row>),
    /// Something ended or went wrong.
    Event {
        /// Time since boot (s).
        t_s: f64,
        /// What.
        kind: EventKind,
    },
    /// The answer to a request.
    Reply {
        /// The request's sequence number.
        to: u16,
        /// Taken, or why not.
        result: Result<Accepted, Refusal>,
    },
    /// The board says who it is.
    Identity(Box<Identity>),
    /// The board started again by itself.
    Rebooted,
}

/// Why a conversation failed.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The way to the board is broken.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The board refuses.
    #[error("refused: {0}")]
    Refused(#[from] Refusal),
    /// The board says nothing at all.
    #[error("no telemetry within {BOOT_TIMEOUT_S} s ({damaged} damaged frames): is this the board's port, and is its \
             firmware of this version?")]
    Silent {
        /// Frames that were no message of this protocol.
        damaged: u32,
    },
    /// A request was not answered.
    #[error("no reply to `{request}` within {REPLY_TIMEOUT_S} s")]
    NoReply {
        /// Which.
        request: &'static str,
    },
    /// The message did not fit a frame.
    #[error("cannot send: {0}")]
    Encode(#[from] rig_link::EncodeError),
}

/// A conversation with one board.
pub struct Session {
    transport: Box<dyn Transport>,
    decoder: Decoder<Message>,
    recorder: Recorder,
    sequence: u16,
    outgoing: Vec<u8>,
    next_heartbeat_s: f64,
    /// Whether the heartbeat is kept up; a script may silence it.
    pub heartbeat: bool,
    /// Random bytes between our frames, if a script asks for them.
    pub noise: Option<Noise>,
    last_t_us: u64,
    waiting: VecDeque<Happening>,
}

impl Session {
    /// Over this transport; nothing is sent yet.
    pub fn new(transport: Box<dyn Transport>) -> Self {
        Self {
            transport,
            decoder: Decoder::new(),
            recorder: Recorder::default(),
            sequence: 0,
            outgoing: Vec::new(),
            next_heartbeat_s: 0.0,
            heartbeat: true,
            noise: None,
            last_t_us: 0,
            waiting: VecDeque::new(),
        }
    }

    /// The way to the board.
    pub fn transport(&mut self) -> &mut dyn Transport {
        &mut *self.transport
    }

    /// Time of the transport (s).
    pub fn now_s(&self) -> f64 {
        self.transport.now_s()
    }

    /// Tells the recorder that the board has just lost and regained its power.
    pub fn power_cycled(&mut self) {
        self.last_t_us = 0;
        self.recorder.booted(self.transport.now_s());
    }

    /// Queues a request for the next step and returns its number.
    ///
    /// # Errors
    /// If it does not fit a frame.
    pub fn send(&mut self, request: &Request) -> Result<u16, SessionError> {
        let number = self.sequence;
        let mut buffer = [0; MAX_FRAME];
        self.outgoing.extend_from_slice(encode(number, request, &mut buffer)?);
        self.sequence = self.sequence.wrapping_add(1);
        Ok(number)
    }

    /// Lets one telemetry period pass and returns what the board said in it.
    ///
    /// # Errors
    /// If the way to the board is broken.
    pub fn step(&mut self) -> Result<Vec<Happening>, SessionError> {
        self.step_until(self.transport.now_s() + STEP_S)
    }

    /// As [`Session::step`], to a given time.
    ///
    /// # Errors
    /// If the way to the board is broken.
    pub fn step_until(&mut self, until_s: f64) -> Result<Vec<Happening>, SessionError> {
        let now_s = self.transport.now_s();
        if self.heartbeat && now_s >= self.next_heartbeat_s {
            self.send(&Request::Heartbeat)?;
            self.next_heartbeat_s = now_s + 1e-3 * f64::from(HEARTBEAT_PERIOD_MS);
        }
        if let Some(noise) = &mut self.noise {
            // In front of our frames, so that they must survive it.
            self.outgoing.splice(0..0, noise.burst());
        }
        let mut received = Vec::new();
        let outgoing = std::mem::take(&mut self.outgoing);
        self.transport.pass(until_s, &outgoing, &mut received)?;
        self.recorder.add_truth(self.transport.take_truth());
        let mut happenings: Vec<Happening> = self.waiting.drain(..).collect();
        for byte in received {
            if let Some(Ok(frame)) = self.decoder.push(byte) {
                self.digest(frame.body, &mut happenings);
            }
        }
        Ok(happenings)
    }

    fn digest(&mut self, message: Message, happenings: &mut Vec<Happening>) {
        match message {
            Message::Reply { to, result } => happenings.push(Happening::Reply { to, result }),
            Message::Identity(identity) => happenings.push(Happening::Identity(Box::new(identity))),
            Message::Telemetry(telemetry) => {
                if telemetry.t_us < self.last_t_us {
                    let boot_s = self.transport.now_s() - telemetry.t_us as f64 / 1e6;
                    self.recorder.booted(boot_s.max(0.0));
                    happenings.push(Happening::Rebooted);
                }
                self.last_t_us = telemetry.t_us;
                happenings.push(Happening::Row(Box::new(self.recorder.row(&telemetry))));
            }
            Message::Event { t_us, kind } => {
                if matches!(kind, EventKind::Homed { .. }) {
                    self.recorder.homed(t_us);
                }
                happenings.push(Happening::Event { t_s: self.recorder.time_s(t_us), kind });
            }
        }
    }

    /// Sends a request and waits for its reply. What else happens meanwhile comes out of the next step.
    ///
    /// # Errors
    /// [`SessionError::Refused`] with the board's reason, or no reply.
    pub fn request(&mut self, request: &Request) -> Result<Accepted, SessionError> {
        let number = self.send(request)?;
        let give_up_s = self.now_s() + REPLY_TIMEOUT_S;
        let mut others = VecDeque::new();
        let result = loop {
            if self.now_s() > give_up_s {
                break Err(SessionError::NoReply { request: name(request) });
            }
            let mut reply = None;
            for happening in self.step()? {
                match happening {
                    Happening::Reply { to, result } if to == number => reply = Some(result),
                    other => others.push_back(other),
                }
            }
            if let Some(result) = reply {
                break Ok(result?);
            }
        };
        self.waiting = others;
        result
    }

    /// Waits for the board to speak, and makes sure that both sides mean the same by their messages.
    ///
    /// # Errors
    /// If the board is silent or of another protocol.
    pub fn connect(&mut self) -> Result<Identity, SessionError> {
        let give_up_s = self.now_s() + BOOT_TIMEOUT_S;
        while !self.step()?.iter().any(|h| matches!(h, Happening::Row(_))) {
            if self.now_s() > give_up_s {
                return Err(SessionError::Silent { damaged: self.decoder.errors() });
            }
        }
        self.introduce(&Request::Hello { protocol_hash: PROTOCOL_HASH })
    }

    /// Asks for the board's identity once more.
    ///
    /// # Errors
    /// As [`Session::request`].
    pub fn identity(&mut self) -> Result<Identity, SessionError> {
        self.introduce(&Request::Status)
    }

    fn introduce(&mut self, request: &Request) -> Result<Identity, SessionError> {
        self.request(request)?;
        let give_up_s = self.now_s() + REPLY_TIMEOUT_S;
        let mut others = VecDeque::new();
        let mut identity = None;
        while identity.is_none() {
            if self.now_s() > give_up_s {
                return Err(SessionError::NoReply { request: name(request) });
            }
            for happening in self.step()? {
                match happening {
                    Happening::Identity(found) => identity = Some(*found),
                    other => others.push_back(other),
                }
            }
        }
        self.waiting = others;
        match identity {
            Some(identity) if identity.protocol_hash == PROTOCOL_HASH => Ok(identity),
            Some(identity) => Err(Refusal::ProtocolMismatch { board: identity.protocol_hash }.into()),
            None => Err(SessionError::NoReply { request: name(request) }),
        }
    }
}

/// A request's name, as the command line has it.
pub const fn name(request: &Request) -> &'static str {
    match request {
        Request::Hello { .. } => "hello",
        Request::Heartbeat => "heartbeat",
        Request::Home => "home",
        Request::Move { .. } => "move",
        Request::Jog { .. } => "jog",
        Request::Stop => "stop",
        Request::Hold => "hold",
        Request::Clear => "clear",
        Request::Status => "status",
    }
}

/// Random bytes, the same for the same seed (splitmix64, Steele et al. 2014).
#[derive(Debug, Clone)]
pub struct Noise(u64);

impl Noise {
    /// Most bytes in one burst.
    const LONGEST: u64 = 24;

    /// From a seed.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn burst(&mut self) -> Vec<u8> {
        let length = self.next() % (Self::LONGEST + 1);
        (0..length).map(|_| self.next().to_le_bytes()[0]).collect()
    }
}
