//! A frame's bits on the wire: how long it takes, stuffing included (ISO 11898-1 sections 10.4 and 10.5).

use rig_plant::board::CanFrame;

/// CRC delimiter, ACK slot and delimiter, end of frame: bits without stuffing before the pause.
const TAIL: u64 = 1 + 1 + 1 + 7;
/// Pause between frames.
pub const PAUSE: u64 = 3;

/// Bit time of the other nodes (s), whose clocks are exact.
const BIT_S: f64 = 1e-6;

/// Whether a node with the bit timing `btr` and a bit of `bit_s` (s) receives what nodes at `BIT_S` send: the
/// difference of both clocks is within twice what ISO 11898-1 allows each. With SJW, both phase segments and N quanta
/// in a bit that is the lesser of SJW / 20 N and min(phase) / 2 (13 N - phase 2). The second phase segment is taken for
/// the shorter one.
pub fn follows(btr: u32, bit_s: f64) -> bool {
    let field = |shift: u32, mask: u32| f64::from((btr >> shift & mask) + 1);
    let (jump, before, after) = (field(24, 3), field(16, 0xF), field(20, 7));
    let quanta = 1.0 + before + after;
    let allowed = (jump.min(after) / (20.0 * quanta)).min(after.min(before) / (2.0 * (13.0 * quanta - after)));
    (bit_s / BIT_S - 1.0).abs() <= 2.0 * allowed
}

/// Frame start to the end of the end-of-frame field, in bits.
pub fn frame_bits(frame: &CanFrame) -> u64 {
    let mut bits = Stuffed::default();
    bits.push(0, 1);
    if frame.extended {
        // SRR and IDE are recessive; then RTR and two reserved bits.
        bits.push(frame.id >> 18, 11);
        bits.push(0b11, 2);
        bits.push(frame.id & 0x3_FFFF, 18);
        bits.push(u32::from(frame.remote) << 2, 3);
    } else {
        bits.push(frame.id, 11);
        bits.push(u32::from(frame.remote) << 2, 3);
    }
    bits.push(frame.dlc.into(), 4);
    if !frame.remote {
        for byte in &frame.data[..usize::from(frame.dlc.min(8))] {
            bits.push((*byte).into(), 8);
        }
    }
    bits.push(bits.crc, 15);
    bits.count + TAIL
}

/// Counts bits as they are stuffed, and computes the CRC over the unstuffed ones.
#[derive(Default)]
struct Stuffed {
    count: u64,
    crc: u32,
    last: u32,
    run: u32,
}

impl Stuffed {
    fn push(&mut self, value: u32, width: u32) {
        for bit in (0..width).rev().map(|i| value >> i & 1) {
            let feedback = self.crc >> 14 & 1 ^ bit;
            self.crc = (self.crc << 1 & 0x7FFF) ^ if feedback == 1 { 0x4599 } else { 0 };
            self.put(bit);
            if self.run == 5 {
                self.put(1 - bit);
            }
        }
    }

    fn put(&mut self, bit: u32) {
        self.run = if self.count > 0 && bit == self.last { self.run + 1 } else { 1 };
        self.last = bit;
        self.count += 1;
    }
}

/// Order of arbitration: the smaller wins. Base identifier, then RTR/SRR, IDE, extension and RTR.
pub fn arbitration(frame: &CanFrame) -> u64 {
    let remote = u64::from(frame.remote);
    if frame.extended {
        let id = u64::from(frame.id);
        (id >> 18) << 21 | 1 << 20 | 1 << 19 | (id & 0x3_FFFF) << 1 | remote
    } else {
        u64::from(frame.id) << 21 | remote << 20
    }
}
