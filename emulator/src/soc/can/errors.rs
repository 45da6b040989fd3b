//! Error counters and states (RM0390 section 30.7.6, ISO 11898-1 section 12.1.4).

/// Last error code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Lec {
    /// No node acknowledged.
    Acknowledge = 3,
    /// A recessive bit read back as dominant.
    BitRecessive = 4,
}

const WARNING: u16 = 96;
const PASSIVE: u16 = 127;
const BUS_OFF: u16 = 255;

/// TEC, REC and what follows from them.
#[derive(Debug, Default)]
pub struct Errors {
    transmit: u16,
    receive: u16,
    lec: u32,
    off: bool,
    interrupt: bool,
    /// ESR when the interrupt flag was last computed.
    seen: u32,
    /// An error code came since then.
    fresh: bool,
}

impl Errors {
    /// An own frame was acknowledged.
    pub fn transmitted(&mut self) {
        self.transmit = self.transmit.saturating_sub(1);
        self.lec = 0;
        self.seen &= self.esr();
    }

    /// A frame was received.
    pub fn received(&mut self) {
        self.receive = self.receive.saturating_sub(1);
        self.lec = 0;
        self.seen &= self.esr();
    }

    /// Back from bus-off: counters start over, what software has not acknowledged stays.
    pub fn recovered(&mut self) {
        *self = Self { interrupt: self.interrupt, ..Self::default() };
    }

    /// An own frame failed.
    pub fn transmit_error(&mut self, code: Lec) {
        self.lec = code as u32;
        self.fresh = true;
        // An error-passive node does not count missing acknowledgement: a lone node never goes bus-off.
        if code != Lec::Acknowledge || !self.passive() {
            self.transmit += 8;
        }
        if self.transmit > BUS_OFF {
            self.off = true;
        }
    }

    /// Error-passive.
    pub fn passive(&self) -> bool {
        self.transmit > PASSIVE || self.receive > PASSIVE
    }

    /// Bus-off.
    pub fn bus_off(&self) -> bool {
        self.off
    }

    /// ESR.
    pub fn esr(&self) -> u32 {
        u32::from(self.transmit >= WARNING || self.receive >= WARNING)
            | u32::from(self.passive()) << 1
            | u32::from(self.off) << 2
            | self.lec << 4
            | u32::from(self.transmit.min(BUS_OFF)) << 16
            | u32::from(self.receive.min(BUS_OFF)) << 24
    }

    /// Raise ERRI if something of ESR that IER asks for has just been set.
    pub fn flag(&mut self, ier: u32) {
        let risen = self.esr() & !self.seen;
        // EWGIE, EPVIE, BOFIE stand in the order of EWGF, EPVF, BOFF.
        if risen & 7 & (ier >> 8) != 0 || (std::mem::take(&mut self.fresh) && ier >> 11 & 1 == 1) {
            self.interrupt = true;
        }
        self.seen = self.esr();
    }

    /// ERRI.
    pub fn interrupt(&self) -> bool {
        self.interrupt
    }

    /// Software clears ERRI.
    pub fn clear_interrupt(&mut self) {
        self.interrupt = false;
    }

    /// Software writes LEC.
    pub fn set_lec(&mut self, code: u32) {
        self.lec = code;
    }
}
