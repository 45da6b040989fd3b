//! Cycles of an instruction (Cortex-M4 technical reference manual r0p1, tables 3-1 and 7-1, and section 3.3.3).
//!
//! A taken branch costs [`TAKEN_BRANCH_CYCLES`] more, which the caller adds: only it knows whether the branch was taken.
//! What depends on data or on the bus is left out: a division takes its middle time, an IT instruction is never folded, an
//! operand of the FPU is always ready, and the write buffer is never full.

use crate::soc::memory::Region;

/// Cycles that refill the pipeline after a taken branch: 1 to 3 by the manual, by the target's alignment and width, and
/// whether it was known early. The middle.
pub const TAKEN_BRANCH_CYCLES: u64 = 2;

/// SDIV and UDIV: 2 to 12, by the size of the quotient. The middle.
const DIVISION: u16 = 7;
/// VDIV and VSQRT.
const LONG_FLOAT: u16 = 14;
/// VMLA, VFMA and their kind.
const FLOAT_ACCUMULATE: u16 = 3;

/// What an instruction costs by itself, and with a single load before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cost {
    /// The same wherever it stands.
    Alone(u16),
    /// A load of one register. Behind another one it takes a cycle less, unless it needs what that one loads.
    Load { into: u16, base: u16 },
    /// A store of one register: its cycles, and the register that holds the address.
    Store { cycles: u16, base: u16 },
}

/// Instructions and cycles of the code in flash from `address` on.
pub fn of_block(address: u32, bytes: u32, flash: &Region) -> (u16, u16) {
    let half = |at| flash.half(at).unwrap_or(0);
    let (mut at, mut instructions, mut cycles) = (address, 0, 0u16);
    // The register that the instruction before has loaded.
    let mut loaded = None;
    while at < address + bytes {
        let first = half(at);
        // The first halfword of a 32-bit instruction starts with 0b11101, 0b11110 or 0b11111.
        let wide = first >> 11 >= 0x1D;
        let cost = if wide { wide_cost(first, half(at + 2)) } else { narrow_cost(first) };
        let pipelined = |base| loaded.is_some_and(|loaded| loaded != base);
        let (own, load) = match cost {
            Cost::Alone(own) => (own, None),
            Cost::Load { into, base } => (2 - u16::from(pipelined(base)), Some(into)),
            Cost::Store { cycles, base } => ((cycles - u16::from(pipelined(base))).max(1), None),
        };
        cycles = cycles.saturating_add(own);
        loaded = load;
        instructions += 1;
        at += if wide { 4 } else { 2 };
    }
    (instructions, cycles)
}

const SP: u16 = 13;
const PC: u16 = 15;

/// A cycle, and one for each register.
fn several(registers: u16) -> Cost {
    Cost::Alone(1 + registers.count_ones() as u16)
}

fn single(load: bool, register: u16, base: u16, store_cycles: u16) -> Cost {
    if load { Cost::Load { into: register, base } } else { Cost::Store { cycles: store_cycles, base } }
}

fn narrow_cost(half: u16) -> Cost {
    let (low, next, high) = (half & 7, half >> 3 & 7, half >> 8 & 7);
    match half {
        // LDR from the literal pool.
        0x4800..=0x4FFF => Cost::Load { into: high, base: PC },
        // Register offset: the first three of eight are stores, which then take two cycles.
        0x5000..=0x5FFF => single(half >> 9 & 7 > 2, low, next, 2),
        0x6000..=0x8FFF => single(half >> 11 & 1 == 1, low, next, 1),
        0x9000..=0x9FFF => single(half >> 11 & 1 == 1, high, SP, 1),
        // PUSH and POP with LR or PC, STM and LDM.
        0xB400..=0xB5FF | 0xBC00..=0xBDFF => several(half & 0x1FF),
        0xC000..=0xCFFF => several(half & 0xFF),
        _ => Cost::Alone(1),
    }
}

fn wide_cost(first: u16, second: u16) -> Cost {
    let (base, register) = (first & 15, second >> 12);
    match first {
        0xE800..=0xE9FF if first & 0x40 == 0 => several(second),
        // Exclusive accesses and table branches; the rest are LDRD and STRD.
        0xE840..=0xE85F | 0xE8C0..=0xE8DF => Cost::Alone(2),
        0xE800..=0xE9FF => Cost::Alone(3),
        0xEC00..=0xEEFF if second >> 9 & 7 == 5 => Cost::Alone(float_cycles(first, second)),
        0xF800..=0xF9FF => {
            let by_register = first & 0x80 == 0 && second & 0xFC0 == 0;
            single(first >> 4 & 1 == 1, register, base, if by_register { 2 } else { 1 })
        }
        // MLA and MLS; MUL has no register to add.
        0xFB00..=0xFB0F if register != PC => Cost::Alone(2),
        0xFB90..=0xFB9F | 0xFBB0..=0xFBBF => Cost::Alone(DIVISION),
        _ => Cost::Alone(1),
    }
}

fn float_cycles(first: u16, second: u16) -> u16 {
    match first {
        // Two core registers to or from the FPU.
        0xEC40..=0xEC5F => 2,
        // VLDR and VSTR: an address without write-back. The others load or store as many words as they say.
        0xEC00..=0xEDFF if first & 0x120 == 0x100 => 2 + (second >> 8 & 1),
        0xEC00..=0xEDFF => 1 + (second & 0xFF),
        // Moves of one register.
        _ if second & 0x10 != 0 => 1,
        _ => match (first >> 4 & 0xB, second >> 6 & 1) {
            (0 | 1 | 9 | 10, _) => FLOAT_ACCUMULATE,
            (8, _) => LONG_FLOAT,
            // VSQRT among moves, conversions and comparisons.
            (11, 1) if first & 0xF == 1 && second & 0x80 != 0 => LONG_FLOAT,
            _ => 1,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::soc::memory::FLASH_BASE;

    fn cycles(code: &[u16]) -> u16 {
        let mut flash = Region::new(FLASH_BASE, 256, 0xFF);
        let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
        flash.write(FLASH_BASE, &bytes).expect("it fits");
        of_block(FLASH_BASE, bytes.len() as u32, &flash).1
    }

    #[test]
    fn instructions_take_what_the_manual_says() {
        for (what, code, wanted) in [
            ("nop", &[0xBF00][..], 1),
            ("adds r0, #1", &[0x3001], 1),
            ("muls r0, r1", &[0x4348], 1),
            ("mla r0, r1, r2, r3", &[0xFB01, 0x3002], 2),
            ("mul r0, r1, r2", &[0xFB01, 0xF002], 1),
            ("umull r0, r1, r2, r3", &[0xFBA2, 0x0103], 1),
            ("udiv r0, r1, r2", &[0xFBB1, 0xF0F2], DIVISION),
            ("sdiv r0, r1, r2", &[0xFB91, 0xF0F2], DIVISION),
            ("ldr r0, [r1]", &[0x6808], 2),
            ("ldrb r0, [r1, r2]", &[0x5C88], 2),
            ("ldr r0, [pc, #4]", &[0x4801], 2),
            ("ldr.w r0, [r1, #256]", &[0xF8D1, 0x0100], 2),
            ("str r0, [r1]", &[0x6008], 1),
            ("str r0, [r1, r2]", &[0x5088], 2),
            ("str.w r0, [r1, #256]", &[0xF8C1, 0x0100], 1),
            ("str.w r0, [r1, r2]", &[0xF841, 0x0002], 2),
            ("push {r4-r7, lr}", &[0xB5F0], 6),
            ("pop {r4-r7, pc}", &[0xBDF0], 6),
            ("push.w {r4-r8, lr}", &[0xE92D, 0x41F0], 7),
            ("ldmia r0!, {r1-r3}", &[0xC80E], 4),
            ("ldrd r0, r1, [r2]", &[0xE9D2, 0x0100], 3),
            ("ldrex r0, [r1]", &[0xE851, 0x0F00], 2),
            ("tbb [pc, r0]", &[0xE8DF, 0xF000], 2),
            ("bl", &[0xF000, 0xF800], 1),
            ("movw r0, #1", &[0xF240, 0x0001], 1),
            ("vadd.f32 s0, s0, s0", &[0xEE30, 0x0A00], 1),
            ("vmul.f32 s0, s0, s0", &[0xEE20, 0x0A00], 1),
            ("vmla.f32 s0, s0, s0", &[0xEE00, 0x0A00], 3),
            ("vfma.f32 s0, s0, s0", &[0xEEA0, 0x0A00], 3),
            ("vdiv.f32 s0, s0, s0", &[0xEE80, 0x0A00], 14),
            ("vsqrt.f32 s0, s0", &[0xEEB1, 0x0AC0], 14),
            ("vmov.f32 s0, s1", &[0xEEB0, 0x0A60], 1),
            ("vneg.f32 s0, s0", &[0xEEB1, 0x0A40], 1),
            ("vcvt.f32.s32 s0, s0", &[0xEEB8, 0x0AC0], 1),
            ("vmov s0, r0", &[0xEE00, 0x0A10], 1),
            ("vmov r0, r1, d0", &[0xEC51, 0x0B10], 2),
            ("vldr s0, [r0]", &[0xED90, 0x0A00], 2),
            ("vldr d0, [r0]", &[0xED90, 0x0B00], 3),
            ("vstr s0, [r0]", &[0xED80, 0x0A00], 2),
            ("vpush {s16-s19}", &[0xED2D, 0x8A04], 5),
        ] {
            assert_eq!(cycles(code), wanted, "{what}");
        }
    }

    #[test]
    fn neighbouring_loads_overlap_unless_one_needs_the_other() {
        // ldr r0, [r1]; ldr r2, [r3]; str r4, [r5, r6]
        assert_eq!(cycles(&[0x6808, 0x681A]), 3);
        assert_eq!(cycles(&[0x6808, 0x681A, 0x51AC]), 4);
        // ldr r0, [r1]; ldr r2, [r0]
        assert_eq!(cycles(&[0x6808, 0x6802]), 4);
        // ldr r0, [r1]; nop; ldr r2, [r3]
        assert_eq!(cycles(&[0x6808, 0xBF00, 0x681A]), 5);
        // ldr r0, [r1]; str r2, [r3]: a store never takes less than a cycle.
        assert_eq!(cycles(&[0x6808, 0x601A]), 3);
    }
}
