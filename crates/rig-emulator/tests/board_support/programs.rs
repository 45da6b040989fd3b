//! Programs for the tests of the core, assembled by hand; the source is beside each.

use super::Program;

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
pub const SYSTICK: Program = Program {
    code: &[
        0xF04F, 0x5200, 0x2300, 0x6013, 0x4806, 0xF643, 0x617F, 0x6041, 0x6083, 0x2107, 0x6001, 0xBF30, 0xE7FD, 0x6813,
        0x3301, 0x6013, 0x4770, 0x0000, 0xE010, 0xE000,
    ],
    handler: 0x62,
    second: 0x62,
};

/// ```text
/// ldr r4,=0x20000000
/// ldr r0,=0xE000E100
/// movs r1,#3
/// str r1,[r0]
/// ldr r0,=0xE000E400
/// movw r1,#0x4080
/// str r1,[r0]
/// ldr r5,=0xE000EF00
/// vmov.f32 s0,#1.0
/// vmov.f32 s15,#4.0
/// movs r0,#11
/// movs r1,#0
/// str r1,[r5]
/// nop
/// b 2f
/// 2: vstr s0,[r4]
/// vstr s15,[r4,#4]
/// str r0,[r4,#8]
/// b .
/// handler:
/// movs r0,#22
/// vmov.f32 s0,#2.0
/// vmov.f32 s15,#5.0
/// movs r1,#1
/// str r1,[r5]
/// b 3f
/// 3: vstr s0,[r4,#12]
/// str r0,[r4,#16]
/// mrs r1,ipsr
/// str r1,[r4,#20]
/// bx lr
/// inner:
/// movs r0,#33
/// vmov.f32 s0,#3.0
/// vmov.f32 s15,#6.0
/// mrs r1,ipsr
/// str r1,[r4,#24]
/// bx lr
/// ```
pub const NESTED: Program = Program {
    code: &[
        0xF04F, 0x5400, 0x4817, 0x2103, 0x6001, 0x4817, 0xF244, 0x0180, 0x6001, 0x4D16, 0xEEB7, 0x0A00, 0xEEF1, 0x7A00,
        0x200B, 0x2100, 0x6029, 0xBF00, 0xE7FF, 0xED84, 0x0A00, 0xEDC4, 0x7A01, 0x60A0, 0xE7FE, 0x2016, 0xEEB0, 0x0A00,
        0xEEF1, 0x7A04, 0x2101, 0x6029, 0xE7FF, 0xED84, 0x0A03, 0x6120, 0xF3EF, 0x8105, 0x6161, 0x4770, 0x2021, 0xEEB0,
        0x0A08, 0xEEF1, 0x7A08, 0xF3EF, 0x8105, 0x61A1, 0x4770, 0x0000, 0xE100, 0xE000, 0xE400, 0xE000, 0xEF00, 0xE000,
    ],
    handler: 0x7a,
    second: 0x98,
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
pub const RESETS: Program = Program {
    code: &[
        0x480F, 0x6801, 0xF04F, 0x32A5, 0x4291, 0xBF08, 0x2100, 0x3101, 0x6001, 0x4A0C, 0x6813, 0xF840, 0x3021, 0x2301,
        0x061B, 0x6013, 0x2901, 0xD003, 0x2902, 0xD005, 0xBF30, 0xE7FD, 0x4A06, 0x4B07, 0x6013, 0xE7FE, 0x4A06, 0xF64C,
        0x43CC, 0x6013, 0xE7F4, 0xE7FE, 0x0100, 0x2000, 0x3874, 0x4002, 0xED0C, 0xE000, 0x0004, 0x05FA, 0x3000, 0x4000,
    ],
    handler: 0x86,
    second: 0x86,
};

/// ```text
/// ldr r2,=0x20000000
/// movs r3,#1
/// str r3,[r2]
/// sev
/// wfe
/// movs r3,#2
/// str r3,[r2]
/// wfe
/// movs r3,#3
/// str r3,[r2]
/// b .
/// handler: b .
/// ```
pub const EVENT: Program = Program {
    code: &[0xF04F, 0x5200, 0x2301, 0x6013, 0xBF40, 0xBF20, 0x2302, 0x6013, 0xBF20, 0x2303, 0x6013, 0xE7FE, 0xE7FE],
    handler: 0x60,
    second: 0x60,
};

/// ```text
/// ldr r2,=0x20000000
/// 1: bl handler
/// wfi
/// b 1b
/// handler:
/// movs r0,#100
/// 2: subs r0,#1
/// bne 2b
/// bx lr
/// ```
pub const WATCHED: Program = Program {
    code: &[0xF04F, 0x5200, 0xF000, 0xF802, 0xBF30, 0xE7FB, 0x2064, 0x3801, 0xD1FD, 0x4770],
    handler: 0x54,
    second: 0x54,
};

/// ```text
/// ldr r0,=0x40000000
/// movs r1,#1
/// b handler
/// handler:
/// str r1,[r0]
/// b .
/// ```
pub const UNCLOCKED: Program =
    Program { code: &[0xF04F, 0x4080, 0x2101, 0xF000, 0xB800, 0x6001, 0xE7FE], handler: 0x52, second: 0x52 };

/// ```text
/// ldr r0,=0x30000000
/// b handler
/// handler:
/// ldr r1,[r0]
/// b .
/// ```
pub const STRAY: Program =
    Program { code: &[0xF04F, 0x5040, 0xF000, 0xB800, 0x6801, 0xE7FE], handler: 0x50, second: 0x50 };

/// ```text
/// b handler
/// handler:
/// udf #0
/// ```
pub const UNDEFINED: Program = Program { code: &[0xF000, 0xB800, 0xDE00], handler: 0x4c, second: 0x4c };

/// ```text
/// ldr r0,=0x40023C00
/// ldr r1,=0x45670123
/// str r1,[r0,#4]
/// ldr r1,=0xCDEF89AB
/// str r1,[r0,#4]
/// ldr r2,=0x08060000
/// ldr r4,=0x20000000
/// ldr r1,[r2]
/// str r1,[r4]
/// ldr r1,=0x201
/// str r1,[r0,#16]
/// ldr r3,=0x12345678
/// str r3,[r2]
/// ldr r1,[r2]
/// str r1,[r4,#4]
/// ldr r1,=0x1023a
/// bic r1,r1,#0x200
/// str r1,[r0,#16]
/// ldr r1,[r2]
/// str r1,[r4,#8]
/// ldr r1,[r0,#12]
/// str r1,[r4,#12]
/// b .
/// handler: b .
/// ```
pub const PROGRAM: Program = Program {
    code: &[
        0x480D, 0x490E, 0x6041, 0x490E, 0x6041, 0x4A0E, 0xF04F, 0x5400, 0x6811, 0x6021, 0xF240, 0x2101, 0x6101, 0x4B0B,
        0x6013, 0x6811, 0x6061, 0x490A, 0xF421, 0x7100, 0x6101, 0x6811, 0x60A1, 0x68C1, 0x60E1, 0xE7FE, 0xE7FE, 0x0000,
        0x3C00, 0x4002, 0x0123, 0x4567, 0x89AB, 0xCDEF, 0x0000, 0x0806, 0x5678, 0x1234, 0x023A, 0x0001,
    ],
    handler: 0x7c,
    second: 0x7c,
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
pub const PROCESS_STACK: Program = Program {
    code: &[
        0xF04F, 0x5400, 0x480B, 0xF380, 0x8809, 0x2002, 0xF380, 0x8814, 0xF3BF, 0x8F6F, 0x2007, 0xDF01, 0x6020, 0x4669,
        0x6061, 0xE7FE, 0x4669, 0x60A1, 0xF3EF, 0x8109, 0x60E1, 0xF8C4, 0xE010, 0x2263, 0x600A, 0x4770, 0x1000, 0x2000,
    ],
    handler: 0x68,
    second: 0x68,
};
