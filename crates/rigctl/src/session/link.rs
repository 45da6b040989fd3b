//! Frames over a [`Port`]: numbered and encoded on the way out, decoded and put in order on the way in.

use super::order::Order;
use super::sim::Sim;
use crate::failure::Failure;
use rig_link::{Decoder, HEARTBEAT_PERIOD_MS, MAX_FRAME, Message, Request, encode};
use rig_plant::Run;

/// Time that passes in one exchange (s).
pub const STEP_S: f64 = 0.01;

/// A connection to the board.
pub trait Port: Send {
    /// Sends `bytes`, lets `seconds` pass, and returns what came back. On a real rig that is bytes alone.
    ///
    /// # Errors
    /// If the connection is lost, or the emulated board stopped.
    fn pass(&mut self, bytes: &[u8], seconds: f64) -> Result<Run, Failure>;

    /// Time on this connection's clock (s): emulated time, or time since it was opened.
    fn now_s(&self) -> f64;

    /// The emulated rig at its end, if it is one.
    fn emulated(&mut self) -> Option<&mut Sim> {
        None
    }
}

/// The frames of one conversation.
pub struct Link {
    port: Box<dyn Port>,
    decoder: Decoder<Message>,
    order: Order,
    sequence: u16,
    outgoing: Vec<u8>,
    exchanges: u64,
    /// What is sent every 0.1 s, so that the board hears from this tool.
    beat: Option<Request>,
}

impl Link {
    /// Over this port, with heartbeats.
    pub fn new(port: Box<dyn Port>) -> Self {
        Self {
            port,
            decoder: Decoder::new(),
            order: Order::default(),
            sequence: 0,
            outgoing: Vec::new(),
            exchanges: 0,
            beat: Some(Request::Heartbeat),
        }
    }

    /// Time on the port's clock (s).
    pub fn now_s(&self) -> f64 {
        self.port.now_s()
    }

    /// The emulated rig behind the port, if it is one.
    pub fn emulated(&mut self) -> Option<&mut Sim> {
        self.port.emulated()
    }

    /// Damaged frames so far.
    pub fn damaged_frames(&self) -> u32 {
        self.decoder.errors()
    }

    /// Frames of the board that never came, by the gaps in their numbers.
    pub fn lost_frames(&self) -> u32 {
        self.order.lost()
    }

    /// Switches the heartbeats on or off.
    pub fn set_heartbeat(&mut self, on: bool) {
        self.beat = on.then_some(Request::Heartbeat);
    }

    /// Heartbeats are stops from now on, or are none any more: a rig that nobody hears must not be kept in motion, and its
    /// board may still hear. They stay off where they were.
    pub fn beat_with_stops(&mut self, on: bool) {
        let beat = if on { Request::Stop } else { Request::Heartbeat };
        self.beat = self.beat.is_some().then_some(beat);
    }

    /// Queues a request for the next exchange and returns its number.
    ///
    /// # Errors
    /// Never for the messages that exist: each fits a frame.
    pub fn post(&mut self, request: &Request) -> Result<u16, Failure> {
        self.sequence = self.sequence.wrapping_add(1);
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(self.sequence, request, &mut buffer).map_err(|e| Failure::failed(e.to_string()))?;
        self.outgoing.extend_from_slice(frame);
        Ok(self.sequence)
    }

    /// Queues bytes that are no frame, ahead of the queued frames.
    pub fn send_ahead(&mut self, bytes: &[u8]) {
        self.outgoing.splice(0..0, bytes.iter().copied());
    }

    /// Sends everything that is queued, lets [`STEP_S`] pass, and returns the board's messages, in order, and what else came.
    ///
    /// # Errors
    /// If the port fails, or the emulated board stopped.
    pub fn exchange(&mut self) -> Result<(Vec<Message>, Run), Failure> {
        if let (Some(beat), 0) = (self.beat, self.exchanges % (u64::from(HEARTBEAT_PERIOD_MS) / 10)) {
            self.post(&beat)?;
        }
        self.exchanges += 1;
        let received = self.port.pass(&std::mem::take(&mut self.outgoing), STEP_S)?;
        let mut messages = Vec::new();
        for &byte in &received.uart {
            if let Some(Ok(frame)) = self.decoder.push(byte) {
                messages.extend(self.order.take(frame));
            }
        }
        Ok((messages, received))
    }
}
