//! Interrupt controller and system handlers' priorities (PM0214 sections 4.3 and 2.3).
//!
//! Levels are modelled as on the chip: a peripheral raises a line, the rising edge pends the interrupt, and a line that
//! is still high when its handler returns pends it again. PRIGROUP is not modelled: all four priority bits pre-empt.

/// Exception numbers of the system handlers that can be pended here.
pub mod exception {
    /// Non-maskable interrupt.
    pub const NMI: u16 = 2;
    /// A fault that no other handler takes.
    pub const HARD_FAULT: u16 = 3;
    /// Supervisor call.
    pub const SVCALL: u16 = 11;
    /// Pendable service request.
    pub const PENDSV: u16 = 14;
    /// System tick.
    pub const SYSTICK: u16 = 15;
    /// First external interrupt.
    pub const FIRST_IRQ: u16 = 16;
}

/// Words of 32 interrupts: the F446 has 97.
const WORDS: usize = 4;

/// NVIC state.
#[derive(Debug)]
pub struct Nvic {
    enabled: [u32; WORDS],
    pending: [u32; WORDS],
    line: [u32; WORDS],
    priority: [u8; 32 * WORDS],
    system_priority: [u8; 16],
    system_pending: u16,
    active: Vec<u16>,
    /// WFE's event register.
    pub event: bool,
}

impl Default for Nvic {
    fn default() -> Self {
        Self {
            enabled: [0; WORDS],
            pending: [0; WORDS],
            line: [0; WORDS],
            priority: [0; 32 * WORDS],
            system_priority: [0; 16],
            system_pending: 0,
            active: Vec::new(),
            event: false,
        }
    }
}

impl Nvic {
    /// Configured priority; smaller is more urgent, 256 is thread mode.
    fn priority_of(&self, exception: u16) -> i32 {
        match exception {
            0 => 256,
            1 => -3,
            2 => -2,
            3 => -1,
            4..=15 => i32::from(self.system_priority[usize::from(exception)]),
            irq => i32::from(self.priority[usize::from(irq - exception::FIRST_IRQ)]),
        }
    }

    /// Priority that the core runs at, before masks.
    pub fn running_priority(&self) -> i32 {
        self.active.iter().map(|&e| self.priority_of(e)).min().unwrap_or(256)
    }

    /// The most urgent exception that is pending and enabled, with its priority.
    pub fn best(&self) -> Option<(u16, i32)> {
        let mut best: Option<(u16, i32)> = None;
        let mut consider = |exception: u16, priority: i32| {
            if best.is_none_or(|(_, p)| priority < p) {
                best = Some((exception, priority));
            }
        };
        for exception in [exception::NMI, exception::SVCALL, exception::PENDSV, exception::SYSTICK] {
            if self.system_pending >> exception & 1 == 1 {
                consider(exception, self.priority_of(exception));
            }
        }
        for word in 0..WORDS {
            let mut waiting = self.pending[word] & self.enabled[word];
            while waiting != 0 {
                let exception = (word * 32) as u16 + waiting.trailing_zeros() as u16 + exception::FIRST_IRQ;
                waiting &= waiting - 1;
                consider(exception, self.priority_of(exception));
            }
        }
        best
    }

    /// A peripheral's interrupt line.
    pub fn set_line(&mut self, irq: u8, high: bool) {
        let (word, mask) = (usize::from(irq / 32), 1 << (irq % 32));
        if high {
            self.pending[word] |= mask & !self.line[word];
            self.line[word] |= mask;
        } else {
            self.line[word] &= !mask;
        }
    }

    /// Pend a system handler.
    pub fn pend_system(&mut self, exception: u16) {
        self.system_pending |= 1 << exception;
    }

    /// The core takes `exception`.
    pub fn enter(&mut self, exception: u16) {
        self.active.push(exception);
        match exception.checked_sub(exception::FIRST_IRQ) {
            Some(irq) => self.pending[usize::from(irq / 32)] &= !(1 << (irq % 32)),
            None => self.system_pending &= !(1 << exception),
        }
    }

    /// The core returns from its innermost exception; `None` if there is none.
    pub fn leave(&mut self) -> Option<u16> {
        let exception = self.active.pop()?;
        if let Some(irq) = exception.checked_sub(exception::FIRST_IRQ) {
            let (word, mask) = (usize::from(irq / 32), 1 << (irq % 32));
            self.pending[word] |= self.line[word] & mask;
        }
        self.event = true;
        Some(exception)
    }

    /// How deep exceptions are nested.
    pub fn depth(&self) -> usize {
        self.active.len()
    }

    /// Exception being handled, 0 in thread mode.
    pub fn vector_active(&self) -> u32 {
        self.active.last().copied().unwrap_or(0).into()
    }

    /// An external interrupt is pending in the NVIC, enabled or not.
    #[cfg(test)]
    pub fn is_pending(&self, irq: u8) -> bool {
        self.pending[usize::from(irq / 32)] >> (irq % 32) & 1 == 1
    }

    /// ICSR as read.
    pub fn icsr(&self) -> u32 {
        let pending = u32::from(self.system_pending);
        self.vector_active()
            | u32::from(self.best().map_or(0, |(e, _)| e)) << 12
            | (pending >> exception::PENDSV & 1) << 28
            | (pending >> exception::SYSTICK & 1) << 26
            | (pending >> exception::NMI & 1) << 31
    }

    /// A write to ICSR.
    pub fn write_icsr(&mut self, value: u32) {
        for (bit, exception, set) in [
            (31, exception::NMI, true),
            (28, exception::PENDSV, true),
            (27, exception::PENDSV, false),
            (26, exception::SYSTICK, true),
            (25, exception::SYSTICK, false),
        ] {
            if value >> bit & 1 == 1 {
                if set {
                    self.system_pending |= 1 << exception;
                } else {
                    self.system_pending &= !(1 << exception);
                }
            }
        }
    }

    /// Read at `offset` from 0xE000_E100.
    pub fn read(&self, offset: u32) -> Option<u32> {
        let word = (offset & 0x1F) as usize / 4;
        Some(match offset {
            0x300..=0x37F => {
                let first = (offset - 0x300) as usize & !3;
                u32::from_le_bytes(self.priority[first..first + 4].try_into().ok()?)
            }
            _ if word >= WORDS => 0,
            0x000..=0x01F | 0x080..=0x09F => self.enabled[word],
            0x100..=0x11F | 0x180..=0x19F => self.pending[word],
            0x200..=0x21F => self
                .active
                .iter()
                .filter_map(|e| e.checked_sub(exception::FIRST_IRQ))
                .filter(|irq| usize::from(irq / 32) == word)
                .fold(0, |bits, irq| bits | 1 << (irq % 32)),
            _ => return None,
        })
    }

    /// Write at `offset` from 0xE000_E100, `size` bytes.
    pub fn write(&mut self, offset: u32, size: usize, value: u32) -> Option<()> {
        let word = (offset & 0x1F) as usize / 4;
        match offset {
            0x300..=0x37F => store_priorities(&mut self.priority, (offset - 0x300) as usize, size, value),
            _ if word >= WORDS => {}
            0x000..=0x01F => self.enabled[word] |= value,
            0x080..=0x09F => self.enabled[word] &= !value,
            0x100..=0x11F => self.pending[word] |= value,
            // A line that is high cannot be unpended.
            0x180..=0x19F => self.pending[word] = (self.pending[word] & !value) | (self.line[word] & value),
            _ => return None,
        }
        Some(())
    }

    /// Software trigger (STIR).
    pub fn trigger(&mut self, irq: u32) {
        if let Some(word) = self.pending.get_mut(irq as usize / 32) {
            *word |= 1 << (irq % 32);
        }
    }

    /// SHPR1 to SHPR3, at `offset` from 0xE000_ED18.
    pub fn system_priorities(&self, offset: u32) -> u32 {
        let first = (offset as usize & !3) + 4;
        u32::from_le_bytes([0, 1, 2, 3].map(|i| self.system_priority[first + i]))
    }

    /// A write to SHPR1 to SHPR3.
    pub fn set_system_priorities(&mut self, offset: u32, size: usize, value: u32) {
        store_priorities(&mut self.system_priority, offset as usize + 4, size, value);
    }
}

/// Priority fields are bytes of which the F446 implements the upper four bits.
fn store_priorities(table: &mut [u8], first: usize, size: usize, value: u32) {
    for (byte, slot) in value.to_le_bytes().into_iter().zip(table.iter_mut().skip(first).take(size)) {
        *slot = byte & 0xF0;
    }
}
