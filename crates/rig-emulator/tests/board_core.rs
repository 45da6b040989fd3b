//! The core on hand-assembled programs: time, sleep, exceptions, resets, errors.

mod board_support;

use board_support::{Bench, Program, programs};
use rig_emulator::machine::{Config, Machine, MachineError, ResetCause};

const RAM: u32 = 0x2000_0000;

fn machine(program: &Program) -> Machine<Bench> {
    Machine::new(&program.elf(), Bench::default(), Config::default()).expect("a good ELF")
}

fn word(machine: &mut Machine<Bench>, address: u32) -> u32 {
    machine.soc_mut().memory.word(address).expect("an address in memory")
}

#[test]
fn systick_wakes_the_core_every_millisecond() {
    let mut machine = machine(&programs::SYSTICK);
    machine.run_until(10.5e-3).expect("it runs");
    assert_eq!(word(&mut machine, RAM), 10);
    let stats = machine.stats();
    assert_eq!(stats.exceptions, 10);
    assert!(stats.core_busy > 0.0 && stats.core_busy < 0.01, "{stats:?}");
    assert!((machine.now_s() - 10.5e-3).abs() < 1e-7);
    // One exception frame of 32 bytes.
    assert_eq!(stats.stack_high_water_bytes, 32);
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
fn nested_exceptions_keep_integer_and_float_registers() {
    let mut machine = machine(&programs::NESTED);
    machine.run_until(1e-4).expect("it runs");
    let seen: Vec<u32> = (0..7).map(|i| word(&mut machine, RAM + 4 * i)).collect();
    let thread = [1.0f32.to_bits(), 4.0f32.to_bits(), 11];
    let handler = [2.0f32.to_bits(), 22, 16];
    assert_eq!(seen[..3], thread);
    assert_eq!(seen[3..6], handler);
    assert_eq!(seen[6], 17);
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
fn sev_is_remembered_for_one_wfe() {
    let mut machine = machine(&programs::EVENT);
    machine.run_until(1e-3).expect("it runs");
    assert_eq!(word(&mut machine, RAM), 2);
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
fn instructions_of_a_watched_function_are_counted() {
    let mut machine = machine(&programs::WATCHED);
    assert!(machine.watch_function("handler"));
    assert!(!machine.watch_function("nobody"));
    machine.run_until(1e-3).expect("it runs");
    let stats = machine.tick_stats();
    // movs, 100 times subs and bne, bx.
    assert_eq!((stats.count, stats.instructions_max), (1, 202));
}

#[test]
fn flash_is_programmed_and_erased_by_the_running_program() {
    let mut machine = machine(&programs::PROGRAM);
    machine.run_until(3.0).expect("it runs");
    let seen: Vec<u32> = (0..4).map(|i| word(&mut machine, RAM + 4 * i)).collect();
    assert_eq!(seen, [0xFFFF_FFFF, 0x1234_5678, 0xFFFF_FFFF, 0]);
}

#[test]
fn flash_outlives_the_machine() {
    let mut machine = machine(&programs::SYSTICK);
    let mut image = machine.flash_image();
    image[0x6_0000] = 0x42;
    machine.set_flash_image(&image).expect("the right size");
    machine.run_until(1e-3).expect("the program is still there");
    machine.power_cycle();
    assert_eq!(machine.flash_image()[0x6_0000], 0x42);
    assert!(matches!(machine.set_flash_image(&[0]), Err(MachineError::FlashSize(1))));
}

#[test]
fn strict_mode_names_the_culprit() {
    let mut strict = machine(&programs::UNCLOCKED);
    let error = strict.run_until(1e-3).expect_err("TIM2 has no clock");
    let message = error.to_string();
    assert!(message.contains("clock of TIM2") && message.contains("0x40000000"), "{message}");
    let MachineError::Fault { place, .. } = &error else { panic!("{error:?}") };
    assert_eq!(place.function, "handler");
    assert_eq!(place.pc, 0x0800_0000 + programs::UNCLOCKED.handler);
    assert_eq!(strict.run_until(2e-3), Err(error), "it stays stopped");

    let config = Config { strict: false, ..Config::default() };
    let mut lenient = Machine::new(&programs::UNCLOCKED.elf(), Bench::default(), config).expect("a good ELF");
    lenient.run_until(1e-3).expect("only counted");
    assert_eq!(lenient.stats().warnings.len(), 1);
}

#[test]
fn a_stray_access_and_an_undefined_instruction_stop_with_their_place() {
    let mut stray = machine(&programs::STRAY);
    let Err(MachineError::Memory { what, address, place }) = stray.run_until(1e-3) else { panic!("no error") };
    assert_eq!((what, address, place.function.as_str()), ("read", 0x3000_0000, "handler"));
    let mut undefined = machine(&programs::UNDEFINED);
    let Err(MachineError::Undefined { said, place }) = undefined.run_until(1e-3) else { panic!("no error") };
    assert_eq!((said, place.function.as_str()), (None, "handler"));
}

#[test]
fn what_is_no_elf_is_refused() {
    for bytes in [&b""[..], b"\x7fELF", &[0; 100]] {
        assert!(matches!(Machine::new(bytes, Bench::default(), Config::default()), Err(MachineError::Image(_))));
    }
    let good = programs::SYSTICK.elf();
    for length in 0..good.len() {
        // Whatever is cut off, there is an answer and no panic.
        let _ = Machine::new(&good[..length.min(130)], Bench::default(), Config::default());
        if length > 130 {
            break;
        }
    }
}
