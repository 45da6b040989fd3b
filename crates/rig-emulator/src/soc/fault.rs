//! What a strict board refuses: firmware that would work here and not on the chip.

use std::collections::BTreeMap;

/// Something that the real chip would not do, or that this one does not model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// A register that is not modelled.
    #[error("{} of an unmodelled register at {address:#010x}", verb(*write))]
    Unmodelled {
        /// Address of the access.
        address: u32,
        /// A write, not a read.
        write: bool,
    },
    /// An access of a width that the register does not take.
    #[error("{size}-byte write at {address:#010x}: this register takes whole words")]
    Width {
        /// Address of the access.
        address: u32,
        /// Width in bytes.
        size: usize,
    },
    /// A peripheral whose clock is off.
    #[error("{} at {address:#010x}: the clock of {unit} is not enabled in the RCC", verb(*write))]
    Unclocked {
        /// Name of the peripheral.
        unit: String,
        /// Address of the access.
        address: u32,
        /// A write, not a read.
        write: bool,
    },
    /// A pin that does not carry the function that a peripheral needs there.
    #[error("{signal} is not on a pin: {wanted}")]
    PinFunction {
        /// Signal name.
        signal: &'static str,
        /// What would have been right.
        wanted: String,
    },
    /// A DMA stream that does not serve the peripheral it points to.
    #[error("DMA{controller} stream {stream} channel {channel} does not serve the register at {peripheral:#010x}")]
    DmaRequest {
        /// Controller, 1 or 2.
        controller: u8,
        /// Stream, 0 to 7.
        stream: u8,
        /// CHSEL.
        channel: u8,
        /// PAR.
        peripheral: u32,
    },
    /// A DMA stream that points outside RAM.
    #[error("DMA{controller} stream {stream}: bad memory address {address:#010x}")]
    DmaMemory {
        /// Controller, 1 or 2.
        controller: u8,
        /// Stream, 0 to 7.
        stream: u8,
        /// Memory address.
        address: u32,
    },
    /// A mode or bit that is not modelled, or that the chip forbids.
    #[error("{unit}: {what}")]
    Feature {
        /// Name of the peripheral.
        unit: &'static str,
        /// What is wrong.
        what: &'static str,
    },
}

fn verb(write: bool) -> &'static str {
    if write { "write" } else { "read" }
}

/// Faults raised so far.
#[derive(Debug, Default)]
pub struct Faults {
    strict: bool,
    first: Option<Fault>,
    warnings: BTreeMap<String, u64>,
}

impl Faults {
    /// Stop at the first fault, or only count them.
    pub fn new(strict: bool) -> Self {
        Self { strict, ..Self::default() }
    }

    /// Report a fault.
    pub fn raise(&mut self, fault: Fault) {
        if self.strict {
            self.first.get_or_insert(fault);
        } else {
            *self.warnings.entry(fault.to_string()).or_insert(0) += 1;
        }
    }

    /// Shorthand for [`Fault::Feature`].
    pub fn feature(&mut self, unit: &'static str, what: &'static str) {
        self.raise(Fault::Feature { unit, what });
    }

    /// A fault waits to be reported.
    pub fn pending(&self) -> bool {
        self.first.is_some()
    }

    /// The fault to report, once.
    pub fn take(&mut self) -> Option<Fault> {
        self.first.take()
    }

    /// Faults that were let pass, with how often.
    pub fn warnings(&self) -> &BTreeMap<String, u64> {
        &self.warnings
    }
}
