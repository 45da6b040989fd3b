//! What `chip` leaves: runs cut into slices, the process stack, a chain of resets, broken images, levels at the NVIC.

mod board_support;

use board_support::{Bare, Program, programs};
use rig_emulator::machine::{Config, Machine, ResetCause};
use rig_emulator::soc::Soc;

const RAM: u32 = 0x2000_0000;

fn machine(program: &Program) -> Machine<Bare> {
    Machine::new(&program.elf(), Bare, Config::default()).expect("a good ELF")
}

fn word(machine: &mut Machine<Bare>, address: u32) -> u32 {
    machine.soc_mut().memory.word(address).expect("an address in memory")
}

#[test]
fn runs_are_identical_however_they_are_cut() {
    let mut whole = machine(&programs::SYSTICK);
    whole.run_until(20e-3).expect("it runs");
    let mut cut = machine(&programs::SYSTICK);
    for step in 1..=200 {
        cut.run_until(f64::from(step) * 1e-4).expect("it runs");
    }
    assert_eq!(whole.stats().instructions, cut.stats().instructions);
    assert_eq!(word(&mut whole, RAM), word(&mut cut, RAM));
}

#[test]
fn a_supervisor_call_from_the_process_stack_returns_there() {
    let mut machine = machine(&programs::PROCESS_STACK);
    machine.run_until(1e-4).expect("it runs");
    let seen: Vec<u32> = (0..5).map(|i| word(&mut machine, RAM + 4 * i)).collect();
    // r0 as the handler left it in the frame, both stacks, EXC_RETURN.
    assert_eq!(seen, [99, 0x2000_1000, 0x2002_0000, 0x2000_0FE0, 0xFFFF_FFFD]);
}

#[test]
fn resets_keep_ram_and_tell_their_cause() {
    let mut machine = machine(&programs::RESETS);
    machine.run_until(1.0).expect("it runs");
    let flags: Vec<u32> = (1..4).map(|i| word(&mut machine, RAM + 0x100 + 4 * i) >> 24).collect();
    // Power-on with brown-out and pin; software and pin; watchdog and pin.
    assert_eq!(flags, [0x0E, 0x14, 0x24]);
    let resets = machine.stats().resets;
    assert_eq!(
        resets.iter().map(|(_, cause)| *cause).collect::<Vec<_>>(),
        [ResetCause::Software, ResetCause::Watchdog]
    );
    // 4096 counts of the LSI divided by 4.
    assert!((resets[1].0 - resets[0].0 - 0.512).abs() < 1e-4, "{resets:?}");
    machine.power_cycle();
    machine.run_until(1.1).expect("it runs");
    assert_eq!(word(&mut machine, RAM + 0x100), 2, "RAM is lost without power, so it counts from the start");
}

#[test]
fn an_elf_that_is_cut_off_anywhere_is_refused_or_boots_but_never_panics() {
    let good = programs::SYSTICK.elf();
    for length in 0..good.len() {
        let _ = Machine::new(&good[..length], Bare, Config::default());
    }
}

#[test]
fn a_line_that_stays_high_cannot_be_unpended_and_comes_back_after_its_handler() {
    let mut soc = Soc::new(Bare, &Config::default());
    let (tim5, pending, unpend) = (0x4000_0C00, 0xE000_E204, 0xE000_E284);
    soc.write(0x4002_3840, 4, 1 << 3);
    soc.write(tim5 + 0xC, 4, 1);
    soc.write(tim5 + 0x14, 4, 1);
    assert_eq!(soc.read(pending, 4), 1 << 18);
    soc.write(unpend, 4, 1 << 18);
    assert_eq!(soc.read(pending, 4), 1 << 18);
    soc.nvic.enter(16 + 50);
    assert_eq!(soc.read(pending, 4), 0);
    assert_eq!(soc.nvic.leave(), Some(16 + 50));
    assert_eq!(soc.read(pending, 4), 1 << 18);
    soc.write(tim5 + 0x10, 4, 0);
    soc.write(unpend, 4, 1 << 18);
    assert_eq!(soc.read(pending, 4), 0);
    assert_eq!(soc.faults.take(), None);
}
