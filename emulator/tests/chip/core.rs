//! The core: time, sleep, exceptions, resets and stops, with hand-assembled programs (ARMv7-M architecture manual).

use crate::fixture::{Recorder, chip, close, get, machine as boot, pass, set, word as ram};
use crate::listings::{PROCESS_STACK, RESETS, SYSTICK};
use crate::program::*;
use rig_emulator::cpu::timing::TAKEN_BRANCH_CYCLES;
use rig_emulator::machine::{Config, Machine, MachineError, ResetCause};

const RESULT: u32 = 0x2000_0100;
const ICSR: u32 = 0xE000_ED04;
const FLASH_ACR: u32 = 0x4002_3C00;
const FLASH_KEYR: u32 = 0x4002_3C04;
const FLASH_CR: u32 = 0x4002_3C10;

const RAM: u32 = 0x2000_0000;

fn machine(program: &Program) -> Machine<Recorder> {
    boot(&program.elf())
}

fn main_only(code: &[Vec<u16>]) -> Program {
    let mut program = Program::default();
    program.function("main", code);
    program
}

#[test]
fn a_loop_takes_its_instructions_and_its_branches() {
    let program = main_only(&[load(0, 1000), vec![subtract(0, 1), branch(0xD100, -1), WFI, branch(0xE000, -1)]]);
    let mut machine = machine(&program);
    machine.run_until(1e-3).expect("runs");
    let stats = machine.stats();
    // movw, movt; 1000 times subs and bne; the rest is asleep.
    assert_eq!(stats.instructions, 2 + 2000 + 1);
    let awake = stats.core_busy * 16_000.0;
    close(awake, (2 + 2000 + 1 + 1000 * TAKEN_BRANCH_CYCLES) as f64, 4.0);
}

#[test]
fn loads_and_pushes_take_time_and_a_branch_that_is_not_taken_takes_none() {
    // A loop of a push of eight registers, two loads that overlap, a pop, and a branch that is never taken (bcc).
    let body = vec![0xB4FF, fetch(2, 1), fetch(3, 1), 0xBCFF, subtract(0, 1), branch(0xD300, 0), branch(0xD100, -6)];
    let program = main_only(&[load(1, RESULT), load(0, 1000), body, vec![WFI, branch(0xE000, -1)]]);
    let mut machine = machine(&program);
    machine.run_until(1e-2).expect("runs");
    let each = (9 + 3 + 9 + 1 + 1 + 1) + TAKEN_BRANCH_CYCLES;
    close(machine.stats().core_busy * 160_000.0, (4 + 1000 * each) as f64, 6.0);
}

#[test]
fn flash_wait_states_cost_time_unless_the_instruction_cache_is_on() {
    // Twenty instructions and a branch: 44 bytes, which touch at least three lines of flash.
    let awake = |acr: u32| {
        let body = [vec![NOP; 20], vec![subtract(0, 1), branch(0xD100, -21), WFI, branch(0xE000, -1)]].concat();
        let program = main_only(&[poke(FLASH_ACR, acr), load(0, 1000), body]);
        let mut machine = machine(&program);
        machine.run_until(20e-3).expect("runs");
        machine.stats().core_busy * 20e-3 * 16e6
    };
    let (cached, prefetched, bare) = (awake(0x205), awake(0x105), awake(0x5));
    close(prefetched - cached, 5.0 * 1000.0, 50.0);
    assert!((3.0 * 5.0 * 1000.0..4.01 * 5.0 * 1000.0).contains(&(bare - cached)), "{}", bare - cached);
    close(awake(0x305), cached, 1.0);
}

#[test]
fn the_cycle_counter_counts_only_with_both_of_its_enables() {
    const DEMCR: u32 = 0xE000_EDFC;
    const DWT_CTRL: u32 = 0xE000_1000;
    const CYCCNT: u32 = 0xE000_1004;
    let mut chip = chip();
    let mut passes = |demcr: u32, control: u32| {
        set(&mut chip, DEMCR, demcr);
        set(&mut chip, DWT_CTRL, control);
        let before = get(&mut chip, CYCCNT);
        pass(&mut chip, 1e-3);
        get(&mut chip, CYCCNT).wrapping_sub(before)
    };
    assert_eq!(passes(0, 0), 0);
    assert_eq!(passes(1 << 24, 0), 0);
    assert_eq!(passes(0, 1), 0);
    let counted = passes(1 << 24, 1);
    assert!((16_000..16_010).contains(&counted), "{counted}");
    // It keeps its count where it stops, and goes on from what is written.
    set(&mut chip, DEMCR, 0);
    let stopped = get(&mut chip, CYCCNT);
    pass(&mut chip, 1e-3);
    assert_eq!(get(&mut chip, CYCCNT), stopped);
    set(&mut chip, CYCCNT, 1_000_000);
    set(&mut chip, DEMCR, 1 << 24);
    pass(&mut chip, 1e-3);
    let counted = get(&mut chip, CYCCNT) - 1_000_000;
    assert!((16_000..16_010).contains(&counted), "{counted}");
}

#[test]
fn a_breakpoint_ends_the_run_and_semihosting_says_how() {
    let end = |code: &[Vec<u16>]| machine(&main_only(code)).run_until(1e-3);
    let breakpoint = |result, number, success| {
        let Err(MachineError::Breakpoint { number: found, exit, place }) = result else { panic!("{result:?}") };
        assert_eq!((found, exit, place.function.as_str()), (number, success, "main"));
    };
    breakpoint(end(&[vec![NOP, 0xBE00]]), 0, Some(true));
    breakpoint(end(&[load(0, 0x18), load(1, 0x2_0026), vec![0xBEAB]]), 0xAB, Some(true));
    breakpoint(end(&[load(0, 0x18), load(1, 0x2_0023), vec![0xBEAB]]), 0xAB, Some(false));
    breakpoint(end(&[load(0, 0x04), vec![0xBEAB]]), 0xAB, None);
    let exit = |code| {
        let block = [poke(RESULT, 0x2_0026), poke(RESULT + 4, code), load(0, 0x20), load(1, RESULT)].concat();
        end(&[block, vec![0xBEAB]])
    };
    breakpoint(exit(0), 0xAB, Some(true));
    breakpoint(exit(1), 0xAB, Some(false));
}

/// A function in RAM that counts in r4, called twice with a store into it between the calls.
#[test]
fn code_in_ram_runs_and_can_be_changed() {
    const FUNCTION: u32 = 0x2000_0400;
    let two = |first: u16, second: u16| u32::from(first) | u32::from(second) << 16;
    let call = [load(5, FUNCTION | 1), vec![0x47A8]].concat();
    let program = main_only(&[
        load(4, 0),
        poke(FUNCTION, two(add(4, 1), BX_LR)),
        call.clone(),
        poke(FUNCTION, two(add(4, 16), BX_LR)),
        call.clone(),
        poke(RESULT - 4, 7),
        call,
        load(2, RESULT),
        vec![store(4, 2), PARK],
    ]);
    let mut machine = machine(&program);
    machine.run_until(1e-3).expect("runs");
    assert_eq!((ram(&mut machine, RESULT), ram(&mut machine, RESULT - 4)), (33, 7));
}

#[test]
fn systick_wakes_from_wfi() {
    let mut machine = boot(&SYSTICK.elf());
    machine.run_until(0.0105).expect("runs");
    assert_eq!(ram(&mut machine, RAM), 10);
    let stats = machine.stats();
    assert_eq!(stats.exceptions, 10);
    assert!(stats.core_busy < 0.01, "{}", stats.core_busy);
    close(machine.now_s(), 0.0105, 1e-7);
}

#[test]
fn an_event_set_before_wfe_is_not_slept_over() {
    let program =
        main_only(&[poke(RESULT, 0), vec![SEV, WFE], bump(RESULT, 1), vec![WFE], bump(RESULT, 1), vec![PARK]]);
    let mut machine = machine(&program);
    machine.run_until(0.01).expect("runs");
    assert_eq!(ram(&mut machine, RESULT), 1, "the second WFE sleeps");
}

#[test]
fn nested_handlers_leave_the_floating_point_registers_alone() {
    let mut program = Program::default();
    program.function(
        "main",
        &[
            poke(RESULT + 8, 0),
            load(0, 1.5f32.to_bits()),
            S0_FROM_R0.to_vec(),
            poke(ICSR, 1 << 28),
            vec![NOP, NOP],
            R0_FROM_S0.to_vec(),
            load(1, RESULT),
            vec![store(0, 1), PARK],
        ],
    );
    // PendSV computes in s0, pends an NMI in the middle, and keeps its own s0 in RAM.
    program.handler(
        14,
        "pendsv",
        &[
            load(0, 10.0f32.to_bits()),
            S0_FROM_R0.to_vec(),
            poke(ICSR, 1 << 31),
            vec![NOP, NOP],
            DOUBLE_S0.to_vec(),
            R0_FROM_S0.to_vec(),
            load(1, RESULT + 4),
            vec![store(0, 1)],
        ],
    );
    program.handler(2, "nmi", &[load(0, 99.0f32.to_bits()), S0_FROM_R0.to_vec(), bump(RESULT + 8, 1)]);
    let mut machine = machine(&program);
    machine.run_until(1e-3).expect("runs");
    assert_eq!(f32::from_bits(ram(&mut machine, RESULT)), 1.5);
    assert_eq!(f32::from_bits(ram(&mut machine, RESULT + 4)), 20.0);
    assert_eq!(ram(&mut machine, RESULT + 8), 1);
    assert_eq!(machine.stats().exceptions, 2);
}

#[test]
fn a_brown_out_keeps_ram_and_looks_like_power_on_unless_its_reset_is_switched_on() {
    // PINRSTF and BORRSTF, and PORRSTF where the power-down reset had to catch it (RM0390 section 6.3.21).
    for (brown_out_level, flags) in [(0, 0x0E), (3, 0x06)] {
        let program = main_only(&[bump(RESULT, 1), vec![PARK]]);
        let config = Config { brown_out_level, ..Config::default() };
        let mut machine = Machine::new(&program.elf(), Recorder::default(), config).expect("a machine");
        machine.run_until(1e-3).expect("runs");
        // RMVF: what the power-up left.
        machine.soc_mut().write(0x4002_3874, 4, 1 << 24);
        machine.brown_out();
        machine.run_until(2e-3).expect("runs");
        assert_eq!(ram(&mut machine, RESULT), 0xA5A5_A5A5 + 2);
        assert_eq!(machine.soc_mut().read(0x4002_3874, 4) >> 24, flags);
        assert_eq!(machine.stats().resets.last().map(|r| r.1), Some(ResetCause::BrownOut));
    }
}

/// Eight bytes are left on the stack; then `code`. A HardFault counts and goes on with `handler`.
fn stack_at_the_bottom_of_ram(code: &[Vec<u16>], handler: &[Vec<u16>]) -> Program {
    let mut program = Program::default();
    // The watchdog bites after 0.512 s. The last one is mov sp, r0.
    let start = [poke(0x4000_3000, 0xCCCC), load(0, 0x2000_0008), vec![0x4685]].concat();
    program.function("main", &[start, code.concat(), vec![PARK]]);
    program.handler(3, "hard_fault", &[bump(RESULT, 1), handler.concat()]);
    program.handler(15, "tick", &[bump(RESULT + 4, 1)]);
    program
}

#[test]
fn a_stack_that_leaves_ram_is_a_hard_fault_and_a_push_in_its_handler_locks_the_core_up() {
    const PUSH: u16 = 0xB4FF;
    let program = stack_at_the_bottom_of_ram(&[vec![PUSH]], &[vec![PUSH], bump(RESULT, 16)]);
    let mut machine = machine(&program);
    machine.run_until(0.6).expect("a lock-up is no error: the watchdog ends it");
    let stats = machine.stats();
    assert_eq!(stats.resets.iter().map(|r| r.1).collect::<Vec<_>>(), [ResetCause::Watchdog]);
    close(stats.resets[0].0, 0.512, 1e-4);
    assert_eq!(stats.lock_ups.len(), 2, "at each start");
    assert_eq!(ram(&mut machine, RESULT), 0xA5A5_A5A5 + 2, "the handler is entered, and stops at its push");
    // HFSR.FORCED, and the address in BFAR.
    assert_eq!(machine.soc_mut().read(0xE000_ED2C, 4), 1 << 30);
    assert!((0x1FFF_FF00..0x2000_0000).contains(&machine.soc_mut().read(0xE000_ED38, 4)));
}

#[test]
fn a_handler_that_does_without_its_stack_can_reset_the_chip() {
    let reset = [poke(0xE000_ED0C, 0x05FA_0004), vec![PARK]].concat();
    let mut machine = machine(&stack_at_the_bottom_of_ram(&[vec![0xB4FF]], &[reset]));
    machine.run_until(1e-4).expect("runs");
    let stats = machine.stats();
    assert!(stats.lock_ups.is_empty() && stats.resets.len() > 1, "{stats:?}");
    assert!(stats.resets.iter().all(|(_, cause)| *cause == ResetCause::Software));
}

#[test]
fn a_return_to_a_lost_frame_locks_the_core_up() {
    let mut machine = machine(&stack_at_the_bottom_of_ram(&[vec![0xB4FF]], &[]));
    machine.run_until(0.6).expect("runs");
    let stats = machine.stats();
    assert_eq!((stats.lock_ups.len(), stats.resets.len()), (2, 1));
}

#[test]
fn an_interrupt_that_finds_no_stack_becomes_a_hard_fault() {
    let tick = [poke(0xE000_E014, 999), poke(0xE000_E018, 0), poke(0xE000_E010, 7), vec![WFI]].concat();
    let mut machine = machine(&stack_at_the_bottom_of_ram(&[tick], &[vec![PARK]]));
    machine.run_until(1e-3).expect("runs");
    assert_eq!(ram(&mut machine, RESULT), 0xA5A5_A5A5 + 1);
    assert_eq!(ram(&mut machine, RESULT + 4), 0xA5A5_A5A5, "its own handler never runs");
    assert_eq!(machine.soc_mut().read(0xE000_ED28, 4), 1 << 12, "CFSR.STKERR");
}

#[test]
fn the_fault_stack_overflow_moves_the_stack_with_what_is_on_it() {
    // r4 and r5 are on the stack; they come back as long as nothing is pushed.
    let keep = [load(4, 0x1234_5678), load(5, 0x9ABC_DEF0), vec![0xB430], load(4, 0), load(5, 0)].concat();
    let wait = [load(0, 10_000), vec![subtract(0, 1), branch(0xD100, -1), 0xBC30]].concat();
    let seen = [load(1, RESULT), vec![store(4, 1)], load(1, RESULT + 4), vec![store(5, 1)]].concat();
    let push_for_ever = vec![0xB4FF, branch(0xE000, -1)];
    let mut program = Program::default();
    program.function("main", &[keep, wait, seen, push_for_ever]);
    program.handler(3, "hard_fault", &[vec![0xB4FF]]);
    let mut machine = machine(&program);
    machine.run_until(5e-4).expect("runs");
    machine.overflow_stack();
    machine.run_until(2e-2).expect("runs");
    assert_eq!((ram(&mut machine, RESULT), ram(&mut machine, RESULT + 4)), (0x1234_5678, 0x9ABC_DEF0));
    assert_eq!(machine.stats().lock_ups.len(), 1);
    machine.power_cycle();
    machine.run_until(2.1e-2).expect("runs");
    assert_eq!(machine.stats().lock_ups.len(), 1, "the next run has its own stack");
}

#[test]
fn a_stray_access_stops_and_says_where() {
    let reads = |address| machine(&main_only(&[load(0, address), vec![fetch(1, 0), PARK]]));
    assert!(matches!(reads(0).run_until(1e-3), Err(MachineError::Memory { address: 0, .. })));
    let mut machine = reads(0x3000_0000);
    let error = machine.run_until(1e-3).expect_err("nothing there");
    let MachineError::Memory { what: "read", address: 0x3000_0000, place } = &error else { panic!("{error}") };
    assert_eq!((place.function.as_str(), place.pc), ("main", START + 8));
    assert_eq!(machine.run_until(1e-3), Err(error), "and stays stopped");
    machine.power_cycle();
    assert!(machine.run_until(2e-3).is_err());
}

#[test]
fn a_strict_fault_names_the_register_and_the_function() {
    let program = main_only(&[vec![NOP, branch(0xE000, 1)], poke(0x4002_0000, 1), vec![PARK]]);
    let mut machine = machine(&program);
    let error = machine.run_until(1e-3).expect_err("GPIOA has no clock");
    let MachineError::Fault { fault, place } = &error else { panic!("{error}") };
    assert_eq!(place.function, "main");
    assert_eq!(fault.what, "write at 0x40020000: the clock of GPIOA is not enabled in the RCC");
}

#[test]
fn calls_are_counted_without_the_handlers_in_between() {
    let mut program = Program::default();
    // r4 counts down from 5; each round calls `work`, right behind this function, and a tick may come in between.
    let set_up =
        [poke(RESULT, 0), poke(0xE000_E014, 599), poke(0xE000_E018, 0), poke(0xE000_E010, 7), load(4, 5)].concat();
    // bl +12: over its own two halfwords, subs, bne, PARK and a NOP.
    let round = vec![0xF000, 0xF804, subtract(4, 1), branch(0xD100, -3), PARK, NOP];
    program.function("main", &[set_up, round]);
    program.function("work", &[load(0, 300), vec![subtract(0, 1), branch(0xD100, -1), BX_LR]]);
    program.handler(15, "tick", &[bump(RESULT, 1)]);
    let mut machine = machine(&program);
    assert!(machine.watch_function("work"));
    assert!(machine.watch_function("tick"));
    machine.run_until(1e-3).expect("runs");
    let work = machine.tick_stats();
    assert_eq!(work, machine.stats().tick);
    assert_eq!((work.count, work.instructions_max), (5, 2 + 600 + 1));
    assert_eq!(work.instructions_mean, 603.0);
    assert!(machine.watched("tick").is_some_and(|tick| tick.count > 5 && tick.instructions_max == 6));
    assert_eq!(machine.call_counts()[0], ("work".to_owned(), 5));
    assert!(!machine.watch_function("play"));
}

#[test]
fn the_deepest_stack_is_seen() {
    // push {r0-r7}, twice, and back.
    let program = main_only(&[vec![0xB4FF, 0xB4FF, 0xBCFF, 0xBCFF, PARK]]);
    let mut machine = machine(&program);
    machine.run_until(1e-4).expect("runs");
    // A register that holds the noise pattern would hide; these are zero.
    assert_eq!(machine.stats().stack_high_water_bytes, 64);
}

#[test]
fn flash_that_the_program_writes_survives_the_machine() {
    let program = main_only(&[
        poke(FLASH_KEYR, 0x4567_0123),
        poke(FLASH_KEYR, 0xCDEF_89AB),
        poke(FLASH_CR, 0x201),
        poke(0x0800_C000, 0x1234_5678),
        load(0, 0x0800_C000),
        load(1, RESULT),
        vec![fetch(2, 0), store(2, 1), PARK],
    ]);
    let mut first = machine(&program);
    first.run_until(1e-3).expect("runs");
    assert_eq!(ram(&mut first, RESULT), 0x1234_5678);
    let image = first.flash_image();

    let mut second =
        machine(&main_only(&[load(0, 0x0800_C000), load(1, RESULT), vec![fetch(2, 0), store(2, 1), PARK]]));
    second.set_flash_image(&image).expect("fits");
    second.run_until(1e-3).expect("the second program runs, not the first");
    assert_eq!(ram(&mut second, RESULT), 0x1234_5678);
    assert_eq!(second.set_flash_image(&[0; 4]), Err(MachineError::FlashSize(4)));
}

#[test]
fn factory_data_is_where_the_datasheet_says() {
    let program = main_only(&[
        load(0, 0x1FFF_7A28),
        load(1, RESULT),
        vec![fetch(2, 0), store(2, 1)],
        load(0, 0x1FFF_7A10),
        vec![fetch(2, 0), 0x604A, PARK],
    ]);
    let mut machine = machine(&program);
    machine.run_until(1e-3).expect("runs");
    assert_eq!(ram(&mut machine, RESULT) >> 16, 1501);
    assert_eq!(ram(&mut machine, RESULT + 4), u32::from_le_bytes(*b"emul"));
}

#[test]
fn runs_are_identical_however_they_are_cut() {
    let mut whole = boot(&SYSTICK.elf());
    whole.run_until(20e-3).expect("it runs");
    let mut cut = boot(&SYSTICK.elf());
    for step in 1..=200 {
        cut.run_until(f64::from(step) * 1e-4).expect("it runs");
    }
    let (whole, cut) = (whole.stats(), cut.stats());
    assert_eq!((whole.instructions, whole.exceptions), (cut.instructions, cut.exceptions));
    assert_eq!(whole.core_busy, cut.core_busy);
}

#[test]
fn a_supervisor_call_from_the_process_stack_returns_there() {
    let mut machine = boot(&PROCESS_STACK.elf());
    machine.run_until(1e-4).expect("it runs");
    let seen: Vec<u32> = (0..5).map(|i| ram(&mut machine, RAM + 4 * i)).collect();
    // r0 as the handler left it in the frame, both stacks, EXC_RETURN.
    assert_eq!(seen, [99, 0x2000_1000, 0x2002_0000, 0x2000_0FE0, 0xFFFF_FFFD]);
}

#[test]
fn resets_keep_ram_and_tell_their_cause() {
    let mut machine = boot(&RESETS.elf());
    machine.run_until(1.0).expect("it runs");
    let flags: Vec<u32> = (1..4).map(|i| ram(&mut machine, RAM + 0x100 + 4 * i) >> 24).collect();
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
    assert_eq!(ram(&mut machine, RAM + 0x100), 2, "RAM is lost without power, so it counts from the start");
}

#[test]
fn an_elf_that_is_cut_off_anywhere_is_refused_or_boots_but_never_panics() {
    let good = SYSTICK.elf();
    let rubbish = Machine::new(b"no ELF", Recorder::default(), Config::default());
    assert!(matches!(rubbish, Err(MachineError::Image(_))));
    for length in 0..good.len() {
        let _ = Machine::new(&good[..length], Recorder::default(), Config::default());
    }
}
