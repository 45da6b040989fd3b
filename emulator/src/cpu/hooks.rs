//! Hooks in unicorn: time at block starts, peripheral accesses, exceptions, SEV, writes to flash, stray accesses.

use super::core::{Core, Halt, takeable};
use crate::soc::memory::{BELOW_RAM, FLASH_BASE, FLASH_SIZE, RAM_BASE, RAM_SIZE};
use crate::soc::nvic::exception;
use rig_plant::board::Board;
use std::collections::HashSet;
use unicorn_engine::{HookType, MemType, RegisterARM, Unicorn, uc_error};

/// Address ranges of peripherals: APB and AHB1, AHB2, the core's own; and the bit-band aliases of RAM and of the first.
const PERIPHERALS: [(u64, u64); 5] = [
    (0x4000_0000, 0x8_0000),
    (0x5000_0000, 0x6_1000),
    (0xE000_0000, 0x10_0000),
    (0x2200_0000, 32 * RAM_SIZE as u64),
    (0x4200_0000, 32 * 0x8_0000),
];

/// unicorn's number of an exception return, of BKPT, and of SVC.
const EXCEPTION_EXIT: u32 = 8;
const BREAKPOINT: u32 = 7;
const SUPERVISOR_CALL: u32 = 2;

/// Bytes of the largest store with write-back: VPUSH of 32 single registers.
const LARGEST_PUSH: u32 = 128;

/// SEV.
const SEV: u16 = 0xBF40;

pub(super) fn stop<B: Board>(uc: &mut Unicorn<'_, Core<B>>) {
    uc.get_data_mut().stopped = true;
    // It can only fail on a handle that is gone.
    let _ = uc.emu_stop();
}

fn pc<B: Board>(uc: &Unicorn<'_, Core<B>>) -> u32 {
    uc.reg_read(RegisterARM::PC).map_or_else(|_| uc.get_data().block, |pc| pc as u32)
}

/// Installs all hooks.
///
/// # Errors
/// An error of unicorn.
pub fn install<B: Board + 'static>(uc: &mut Unicorn<'static, Core<B>>) -> Result<(), uc_error> {
    for (base, size) in PERIPHERALS {
        uc.mmio_map(
            base,
            size,
            Some(move |uc: &mut Unicorn<'_, Core<B>>, offset: u64, size: usize| read(uc, (base + offset) as u32, size)),
            Some(move |uc: &mut Unicorn<'_, Core<B>>, offset: u64, size: usize, value: u64| {
                write(uc, (base + offset) as u32, size, value as u32);
            }),
        )?;
    }
    // Block and code hooks are bounded to all addresses by begin > end.
    uc.add_block_hook(1, 0, |uc, address, size| on_block(uc, address as u32, size))?;
    uc.add_intr_hook(on_exception)?;
    uc.add_mem_hook(
        HookType::MEM_WRITE_PROT,
        u64::from(FLASH_BASE),
        u64::from(FLASH_BASE) + FLASH_SIZE as u64 - 1,
        program,
    )?;
    // Not over RAM: unicorn would take every store into it the long way.
    let ram_end = u64::from(RAM_BASE) + RAM_SIZE as u64;
    for (first, last) in [(0, u64::from(RAM_BASE) - 1), (ram_end, u32::MAX.into())] {
        uc.add_mem_hook(HookType::MEM_UNMAPPED, first, last, stray)?;
    }
    Ok(())
}

/// unicorn executes SEV as a NOP: hooks every halfword of flash that looks like a SEV (a false hit in data is never
/// executed).
///
/// # Errors
/// An error of unicorn.
pub fn hook_sev<B: Board + 'static>(
    uc: &mut Unicorn<'static, Core<B>>,
    hooked: &mut HashSet<u32>,
) -> Result<(), uc_error> {
    let flash = &uc.get_data().soc.memory.flash;
    let found: Vec<u32> = (FLASH_BASE..FLASH_BASE + FLASH_SIZE as u32)
        .step_by(2)
        .filter(|&address| flash.half(address) == Some(SEV) && !hooked.contains(&address))
        .collect();
    for address in found {
        hooked.insert(address);
        uc.add_code_hook(address.into(), address.into(), |uc, _, _| uc.get_data_mut().soc.nvic.event = true)?;
    }
    Ok(())
}

fn on_block<B: Board>(uc: &mut Unicorn<'_, Core<B>>, address: u32, size: u32) {
    let core = uc.get_data_mut();
    if core.stops.goes_on(address, size) {
        return;
    }
    if core.attention || core.soc.clock.now() >= core.deadline {
        core.soc.settle_flash();
        core.deadline = core.soc.sync().min(core.limit);
        let waiting = core.soc.nvic.best().is_some();
        // While an exception is pending that a mask holds back, every block checks again.
        core.attention = waiting;
        let end = core.soc.clock.now() >= core.limit || core.soc.reset_request.is_some() || core.soc.faults.pending();
        if end || (waiting && takeable(uc).is_some()) {
            stop(uc);
            return;
        }
    }
    let core = uc.get_data_mut();
    let cost = core.count(address, size);
    if cost.watched || core.watches.running() {
        watch(uc, address, cost.instructions.into(), cost.watched);
    }
}

fn watch<B: Board>(uc: &mut Unicorn<'_, Core<B>>, address: u32, instructions: u64, entry: bool) {
    let register = |register| uc.reg_read(register).unwrap_or(0) as u32;
    let (stack, return_to) = (register(RegisterARM::SP), register(RegisterARM::LR));
    let core = uc.get_data_mut();
    let depth = core.soc.nvic.depth();
    if entry {
        core.watches.enter(address, return_to, stack, depth);
    }
    core.watches.block(address, instructions, depth, || stack);
}

fn read<B: Board>(uc: &mut Unicorn<'_, Core<B>>, address: u32, size: usize) -> u64 {
    let core = uc.get_data_mut();
    let value = core.soc.read(address, size);
    // A read can clear a flag and make events due; it starts nothing.
    core.deadline = 0;
    check(uc);
    value.into()
}

fn write<B: Board>(uc: &mut Unicorn<'_, Core<B>>, address: u32, size: usize, value: u32) {
    let core = uc.get_data_mut();
    core.soc.write(address, size, value);
    core.attention = true;
    check(uc);
}

fn check<B: Board>(uc: &mut Unicorn<'_, Core<B>>) {
    if uc.get_data().soc.faults.pending() {
        let pc = pc(uc);
        uc.get_data_mut().fault_pc.get_or_insert(pc);
        stop(uc);
    }
}

fn on_exception<B: Board>(uc: &mut Unicorn<'_, Core<B>>, number: u32) {
    let pc = pc(uc);
    let core = uc.get_data_mut();
    match number {
        EXCEPTION_EXIT => core.exception_return = true,
        SUPERVISOR_CALL => {
            core.soc.nvic.pend_system(exception::SVCALL);
            core.attention = true;
        }
        BREAKPOINT => core.halt = Some(Halt::Breakpoint(pc & !1)),
        other => core.halt = Some(Halt::Exception(other)),
    }
    stop(uc);
}

/// A store into flash. unicorn carries out some of them although the region is read-only: the hook of the next block
/// restores the contents.
fn program<B: Board>(uc: &mut Unicorn<'_, Core<B>>, _: MemType, address: u64, size: usize, value: i64) -> bool {
    let core = uc.get_data_mut();
    core.soc.program_flash(address as u32, size, value as u64);
    core.attention = true;
    true
}

fn stray<B: Board>(uc: &mut Unicorn<'_, Core<B>>, kind: MemType, address: u64, _: usize, _: i64) -> bool {
    let what = match kind {
        MemType::READ_UNMAPPED => "read",
        MemType::WRITE_UNMAPPED => "write",
        _ => "instruction fetch",
    };
    let pc = pc(uc);
    let address = address as u32;
    let sp = uc.reg_read(RegisterARM::SP).unwrap_or(0) as u32;
    // A push below the stack, or an access to a frame that is below it already.
    let overflow = BELOW_RAM.contains(&address) && (BELOW_RAM.start..BELOW_RAM.end + LARGEST_PUSH).contains(&sp);
    let trap = if overflow { Halt::StackOverflow(address) } else { Halt::Memory { what, address, pc } };
    uc.get_data_mut().halt = Some(trap);
    stop(uc);
    false
}
