//! Whole programs, assembled by hand; the source is beside each.

use crate::program::{Program, START};

/// A program that starts with its first instruction.
pub struct Listing {
    code: &'static [u16],
    handler: u32,
}

impl Listing {
    /// Address of the handler of every exception.
    pub fn handler(&self) -> u32 {
        START + self.handler
    }

    /// Its ELF, with the symbols `start` and `handler`.
    pub fn elf(&self) -> Vec<u8> {
        let (start, handler) = self.code.split_at(self.handler as usize / 2);
        let mut program = Program::default();
        program.function("start", &[start.to_vec()]);
        program.function("handler", &[handler.to_vec()]);
        (2..0x80).for_each(|exception| program.vector(exception, self.handler()));
        program.elf()
    }
}

/// ```text
/// ldr r2,=0x20000000
/// movs r3,#0
/// str r3,[r2]
/// ldr r0,=0xE000E010
/// movw r1,#15999
/// str r1,[r0,#4]
/// str r3,[r0,#8]
/// movs r1,#7
/// str r1,[r0]
/// 1: wfi
/// b 1b
/// handler:
/// ldr r3,[r2]
/// adds r3,#1
/// str r3,[r2]
/// bx lr
/// ```
pub const SYSTICK: Listing = Listing {
    code: &[
        0xF04F, 0x5200, 0x2300, 0x6013, 0x4806, 0xF643, 0x617F, 0x6041, 0x6083, 0x2107, 0x6001, 0xBF30, 0xE7FD, 0x6813,
        0x3301, 0x6013, 0x4770, 0x0000, 0xE010, 0xE000,
    ],
    handler: 0x1A,
};

/// ```text
/// ldr r0,=0x20000100
/// ldr r1,[r0]
/// ldr r2,=0xA5A5A5A5
/// cmp r1,r2
/// it eq
/// moveq r1,#0
/// adds r1,#1
/// str r1,[r0]
/// ldr r2,=0x40023874
/// ldr r3,[r2]
/// str.w r3,[r0,r1,lsl #2]
/// movs r3,#1
/// lsls r3,r3,#24
/// str r3,[r2]
/// cmp r1,#1
/// beq 1f
/// cmp r1,#2
/// beq 2f
/// 3: wfi
/// b 3b
/// 1: ldr r2,=0xE000ED0C
/// ldr r3,=0x05FA0004
/// str r3,[r2]
/// b .
/// 2: ldr r2,=0x40003000
/// movw r3,#0xCCCC
/// str r3,[r2]
/// b 3b
/// handler: b .
/// ```
pub const RESETS: Listing = Listing {
    code: &[
        0x480F, 0x6801, 0xF04F, 0x32A5, 0x4291, 0xBF08, 0x2100, 0x3101, 0x6001, 0x4A0C, 0x6813, 0xF840, 0x3021, 0x2301,
        0x061B, 0x6013, 0x2901, 0xD003, 0x2902, 0xD005, 0xBF30, 0xE7FD, 0x4A06, 0x4B07, 0x6013, 0xE7FE, 0x4A06, 0xF64C,
        0x43CC, 0x6013, 0xE7F4, 0xE7FE, 0x0100, 0x2000, 0x3874, 0x4002, 0xED0C, 0xE000, 0x0004, 0x05FA, 0x3000, 0x4000,
    ],
    handler: 0x3E,
};

/// ```text
/// ldr r4,=0x20000000
/// ldr r0,=0x20001000
/// msr psp,r0
/// movs r0,#2
/// msr control,r0
/// isb
/// movs r0,#7
/// svc #1
/// str r0,[r4]
/// mov r1,sp
/// str r1,[r4,#4]
/// b .
/// handler:
/// mov r1,sp
/// str r1,[r4,#8]
/// mrs r1,psp
/// str r1,[r4,#12]
/// str lr,[r4,#16]
/// movs r2,#99
/// str r2,[r1]
/// bx lr
/// ```
pub const PROCESS_STACK: Listing = Listing {
    code: &[
        0xF04F, 0x5400, 0x480B, 0xF380, 0x8809, 0x2002, 0xF380, 0x8814, 0xF3BF, 0x8F6F, 0x2007, 0xDF01, 0x6020, 0x4669,
        0x6061, 0xE7FE, 0x4669, 0x60A1, 0xF3EF, 0x8109, 0x60E1, 0xF8C4, 0xE010, 0x2263, 0x600A, 0x4770, 0x1000, 0x2000,
    ],
    handler: 0x20,
};

/// ```text
/// ldr r0,=0x20000000
/// 1: adds r1,#1
/// tst r1,#1
/// itete eq
/// addeq r2,#1
/// addne r3,#1
/// addeq r4,#1
/// addne r5,#1
/// str r2,[r0]
/// b 1b
/// handler: b .
/// ```
pub const CONDITIONS: Listing = Listing {
    code: &[0xF04F, 0x5000, 0x3101, 0xF011, 0x0F01, 0xBF0B, 0x3201, 0x3301, 0x3401, 0x3501, 0x6002, 0xE7F5, 0xE7FE],
    handler: 0x18,
};
