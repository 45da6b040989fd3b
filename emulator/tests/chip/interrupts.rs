//! Which interrupt is taken when (PM0214 sections 2.3 and 4.3, ARMv7-M B1.5), with programs on the core.

use crate::fixture::{chip, get, machine, set, word};
use crate::program::*;

/// What ran, one hexadecimal digit each, the first leftmost.
const LOG: u32 = 0x2000_0100;
const ISER: u32 = 0xE000_E100;
const ISPR: u32 = 0xE000_E200;
const IPR4: u32 = 0xE000_E404;
/// `cpsid i`, `cpsie i`, and `msr basepri, r0`.
const MASK: u16 = 0xB672;
const UNMASK: u16 = 0xB662;
const BASEPRI_FROM_R0: [u16; 2] = [0xF380, 0x8811];

/// `log = log * 16 + n`, with r2 and r3.
fn log(n: u16) -> Vec<u16> {
    // lsls r3, r3, #4
    [load(2, LOG), vec![fetch(3, 2), 0x011B, add(3, n), store(3, 2)]].concat()
}

/// A branch to the next instruction: interrupts are taken between translation blocks (the README says so).
fn let_in() -> Vec<u16> {
    vec![branch(0xE000, 1)]
}

/// Interrupts 5, 6 and 7 enabled, at priorities 0x40, `sixth` and 0x20.
fn set_up(sixth: u32) -> Vec<u16> {
    [poke(LOG, 0), poke(IPR4, 0x20 << 24 | sixth << 16 | 0x40 << 8), poke(ISER, 0b111 << 5)].concat()
}

fn logged(program: &Program) -> (u32, u64) {
    let mut machine = machine(&program.elf());
    machine.run_until(1e-3).expect("runs");
    (word(&mut machine, LOG), machine.stats().exceptions)
}

/// `main`, and handlers of interrupts 5, 6 and 7 that log themselves, or what is given for 5.
fn program(main: &[Vec<u16>], fifth: Option<&[Vec<u16>]>) -> Program {
    let mut program = Program::default();
    program.function("main", &[main.concat(), vec![PARK]]);
    program.handler(16 + 5, "five", fifth.unwrap_or(&[log(5)]));
    program.handler(16 + 6, "six", &[log(6)]);
    program.handler(16 + 7, "seven", &[log(7)]);
    program
}

#[test]
fn of_several_the_most_urgent_goes_first_and_the_lower_number_among_equals() {
    let pend = |sixth| {
        let main = [vec![MASK], set_up(sixth), poke(ISPR, 0b111 << 5), log(1), vec![UNMASK], let_in()];
        logged(&program(&main, None))
    };
    // Each returns before the next: one handler is never inside another.
    assert_eq!(pend(0x20), (0x1675, 3));
    assert_eq!(pend(0x40), (0x1756, 3));
    assert_eq!(pend(0xF0), (0x1756, 3));
    // Only the upper four bits of a priority are there: as urgent as interrupt 7.
    assert_eq!(pend(0x2F), (0x1675, 3));
}

#[test]
fn a_more_urgent_one_interrupts_a_handler_and_an_equal_one_waits() {
    let fifth = [log(1), poke(ISPR, 0b110 << 5), let_in(), log(2)];
    let main = [set_up(0x40), poke(ISPR, 1 << 5), let_in(), log(3)];
    assert_eq!(logged(&program(&main, Some(&fifth))), (0x1_7263, 3));
}

#[test]
fn basepri_holds_back_its_own_priority_and_what_is_less_urgent() {
    let main = [
        load(0, 0x40),
        BASEPRI_FROM_R0.to_vec(),
        set_up(0x40),
        poke(ISPR, 0b111 << 5),
        let_in(),
        log(1),
        load(0, 0),
        BASEPRI_FROM_R0.to_vec(),
        let_in(),
        log(2),
    ];
    assert_eq!(logged(&program(&main, None)), (0x7_1562, 3));
}

#[test]
fn a_masked_interrupt_ends_a_sleep_without_being_taken() {
    let main = [vec![MASK], set_up(0x40), poke(ISPR, 1 << 5), vec![WFI], log(1), vec![UNMASK], let_in()];
    assert_eq!(logged(&program(&main, None)), (0x15, 1));
}

#[test]
fn a_disabled_one_stays_pending_until_it_is_enabled_or_cleared() {
    let icer = ISER + 0x80;
    let icpr = ISPR + 0x80;
    let main = [
        set_up(0x40),
        poke(icer, 0b111 << 5),
        poke(ISPR, 0b111 << 5),
        poke(icpr, 1 << 6),
        log(1),
        poke(ISER, 0b111 << 5),
        let_in(),
        log(2),
    ];
    assert_eq!(logged(&program(&main, None)), (0x1752, 2));
}

/// A level, as peripherals have: TXE of an idle USART2 stays high until its enable is taken back.
#[test]
fn a_line_that_is_still_high_comes_again_and_a_low_one_does_not() {
    let cr1 = 0x4000_440C;
    let mut program = Program::default();
    program.function(
        "main",
        &[
            poke(LOG, 0),
            poke(0x4002_3840, 1 << 17),
            poke(ISER + 4, 1 << 6),
            poke(cr1, 1 << 7),
            vec![WFI, branch(0xE000, -1)],
        ],
    );
    // The third time takes the enable back.
    program.handler(16 + 38, "usart2", &[bump(LOG, 1), vec![subtract(3, 3), branch(0xD100, 10)], poke(cr1, 0)]);
    assert_eq!(logged(&program), (3, 3));
}

#[test]
fn a_line_that_stays_high_cannot_be_unpended_and_comes_back_after_its_handler() {
    let mut soc = chip();
    let (tim5, pending, unpend) = (0x4000_0C00, 0xE000_E204, 0xE000_E284);
    set(&mut soc, tim5 + 0xC, 1);
    set(&mut soc, tim5 + 0x14, 1);
    assert_eq!(get(&mut soc, pending), 1 << 18);
    set(&mut soc, unpend, 1 << 18);
    assert_eq!(get(&mut soc, pending), 1 << 18);
    soc.nvic.enter(16 + 50);
    assert_eq!(get(&mut soc, pending), 0);
    assert_eq!(soc.nvic.leave(), Some(16 + 50));
    assert_eq!(get(&mut soc, pending), 1 << 18);
    set(&mut soc, tim5 + 0x10, 0);
    set(&mut soc, unpend, 1 << 18);
    assert_eq!(get(&mut soc, pending), 0);
}
