//! Acceptance filters: 28 banks, two scales, two modes (RM0390 section 30.7.4).

use rig_plant::board::CanFrame;

const BANKS: usize = 28;
const FINIT: u32 = 1;

/// Filter banks.
#[derive(Debug)]
pub struct Filters {
    fmr: u32,
    /// 1 is list mode.
    list: u32,
    /// 1 is one 32-bit filter.
    wide: u32,
    /// 1 is FIFO 1.
    fifo1: u32,
    active: u32,
    banks: [[u32; 2]; BANKS],
}

/// A frame has been accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Match {
    /// FIFO, 0 or 1.
    pub fifo: usize,
    /// Filter match index.
    pub index: u8,
}

impl Default for Filters {
    fn default() -> Self {
        Self { fmr: 0x2A1C_0E01, list: 0, wide: 0, fifo1: 0, active: 0, banks: [[0; 2]; BANKS] }
    }
}

impl Filters {
    fn initialising(&self) -> bool {
        self.fmr & FINIT != 0
    }

    /// What becomes of a frame; `None` drops it. CAN1 has the banks below CAN2SB.
    pub fn accept(&self, frame: &CanFrame) -> Option<Match> {
        if self.initialising() {
            return None;
        }
        let own = ((self.fmr >> 8 & 0x3F) as usize).min(BANKS);
        let mut numbers = [0u8; 2];
        let mut best: Option<(u8, Match)> = None;
        for bank in 0..own {
            let bit = |register: u32| register >> bank & 1 == 1;
            let fifo = usize::from(bit(self.fifo1));
            let entries = entries(self.banks[bank], bit(self.wide), bit(self.list));
            for entry in entries.into_iter().flatten() {
                let index = numbers[fifo];
                // Inactive banks count in the numbering as well.
                numbers[fifo] += 1;
                // 32-bit filters win over 16-bit ones, then lists over masks, then the lower number.
                let rank = u8::from(!bit(self.wide)) * 2 + u8::from(!bit(self.list));
                if bit(self.active) && entry.matches(frame) && best.is_none_or(|(r, _)| rank < r) {
                    best = Some((rank, Match { fifo, index }));
                }
            }
        }
        best.map(|(_, m)| m)
    }

    /// Read at `offset` from CAN base.
    pub fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x200 => self.fmr,
            0x204 => self.list,
            0x20C => self.wide,
            0x214 => self.fifo1,
            0x21C => self.active,
            0x240..=0x31C => {
                let word = (offset as usize - 0x240) / 4;
                self.banks[word / 2][word % 2]
            }
            _ => return None,
        })
    }

    /// Write at `offset` from CAN base. `Some(false)`: the chip ignores the write, because of its state.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<bool> {
        let open = self.initialising();
        match offset {
            0x200 => self.fmr = value,
            0x204 if open => self.list = value,
            0x20C if open => self.wide = value,
            0x214 if open => self.fifo1 = value,
            0x21C => self.active = value,
            0x240..=0x31C => {
                let word = (offset as usize - 0x240) / 4;
                if !open && self.active >> (word / 2) & 1 == 1 {
                    return Some(false);
                }
                self.banks[word / 2][word % 2] = value;
            }
            0x204 | 0x20C | 0x214 => return Some(false),
            _ => return None,
        }
        Some(true)
    }
}

/// Bits that have to agree with a frame's.
#[derive(Clone, Copy)]
struct Entry {
    id: u32,
    mask: u32,
    wide: bool,
}

impl Entry {
    fn matches(&self, frame: &CanFrame) -> bool {
        let bits = if self.wide { wide_bits(frame) } else { narrow_bits(frame) };
        (bits ^ self.id) & self.mask == 0
    }
}

/// STID, EXID, IDE, RTR as RIxR and TIxR hold them, and a 32-bit filter sees them.
pub fn wide_bits(frame: &CanFrame) -> u32 {
    let id = if frame.extended { frame.id << 3 | 1 << 2 } else { frame.id << 21 };
    id | u32::from(frame.remote) << 1
}

/// STID, RTR, IDE and the top of EXID as a 16-bit filter sees them.
fn narrow_bits(frame: &CanFrame) -> u32 {
    let id = if frame.extended { (frame.id >> 18) << 5 | 1 << 3 | frame.id >> 15 & 7 } else { frame.id << 5 };
    id | u32::from(frame.remote) << 4
}

fn entries([first, second]: [u32; 2], wide: bool, list: bool) -> [Option<Entry>; 4] {
    // Bit 0 of a 32-bit filter is reserved.
    let wide_entry = |id, mask: u32| Some(Entry { id, mask: mask & !1, wide: true });
    let narrow_entry = |id, mask: u32| Some(Entry { id, mask: mask & 0xFFFF, wide: false });
    match (wide, list) {
        (true, true) => [wide_entry(first, !0), wide_entry(second, !0), None, None],
        (true, false) => [wide_entry(first, second), None, None, None],
        (false, true) => [first, first >> 16, second, second >> 16].map(|id| narrow_entry(id, !0)),
        (false, false) => [narrow_entry(first, first >> 16), narrow_entry(second, second >> 16), None, None],
    }
}
