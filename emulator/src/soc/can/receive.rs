//! Receive FIFOs (RM0390 section 30.7.3).

use super::filter::wide_bits;
use rig_plant::board::CanFrame;
use std::collections::VecDeque;

const DEPTH: usize = 3;

/// A frame in a FIFO.
#[derive(Clone, Copy, Debug)]
struct Received {
    frame: CanFrame,
    match_index: u8,
    time: u16,
}

/// A FIFO of three frames.
#[derive(Debug, Default)]
pub struct Fifo {
    frames: VecDeque<Received>,
    full: bool,
    overrun: bool,
}

impl Fifo {
    /// A frame has passed the filters. With `locked` (RFLM) a full FIFO keeps its oldest frames, otherwise the newest
    /// goes.
    pub fn push(&mut self, frame: CanFrame, match_index: u8, time: u16, locked: bool) {
        let received = Received { frame, match_index, time };
        if self.frames.len() == DEPTH {
            self.overrun = true;
            if !locked {
                self.frames[DEPTH - 1] = received;
            }
            return;
        }
        self.frames.push_back(received);
        self.full |= self.frames.len() == DEPTH;
    }

    /// Pending, full or overrun interrupt, by the three enable bits of IER.
    pub fn requests(&self, enables: u32) -> bool {
        (enables & 1 != 0 && !self.frames.is_empty())
            || (enables & 2 != 0 && self.full)
            || (enables & 4 != 0 && self.overrun)
    }

    /// RFxR.
    pub fn status(&self) -> u32 {
        self.frames.len() as u32 | u32::from(self.full) << 3 | u32::from(self.overrun) << 4
    }

    /// A write to RFxR.
    pub fn write_status(&mut self, value: u32) {
        // RM0390 section 30.9.4 has FULL cleared by software alone. On the chip it falls with the release of the output
        // mailbox as well: the on-device tests of the `bxcan` crate require it and pass on STM32 hardware.
        if value & 0x20 != 0 && self.frames.pop_front().is_some() {
            self.full = false;
        }
        self.full &= value & 8 == 0;
        self.overrun &= value & 0x10 == 0;
    }

    /// RIxR, RDTxR, RDLxR and RDHxR by `word`.
    pub fn mailbox(&self, word: usize) -> u32 {
        let Some(Received { frame, match_index, time }) = self.frames.front() else { return 0 };
        let bytes = |first: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| frame.data[first + i]));
        match word {
            0 => wide_bits(frame),
            1 => u32::from(frame.dlc) | u32::from(*match_index) << 8 | u32::from(*time) << 16,
            2 => bytes(0),
            _ => bytes(4),
        }
    }
}
