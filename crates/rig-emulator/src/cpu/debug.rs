//! Breakpoints, steps and registers for a debugger.
//!
//! Breakpoints are hooks in unicorn and leave flash as it is. Time is counted by blocks, at their start: where the core
//! stops in the middle of one, the rest of it runs later without being counted again and without an interrupt in
//! between, so that a run with stops is the same as one without.
//!
//! unicorn cannot stop inside an IT block and takes it for one instruction; so a step goes over all of it, and whoever
//! sets a breakpoint in one has to set it at the IT.

use super::core::Core;
use super::hooks::stop;
use super::{Cpu, R};
use crate::board::Board;
use std::collections::BTreeMap;
use unicorn_engine::{UcHookId, Unicorn, uc_error};

/// What a debugger wants, and where it has stopped the core.
#[derive(Clone, Copy, Debug, Default)]
pub struct Debug {
    /// Next address and end of a block that the core was stopped in.
    rest: Option<(u32, u32)>,
    /// A breakpoint here does not count for the first instruction: the core has stopped at it already.
    passed: Option<u32>,
    step: Step,
    /// A hook has asked for a stop before this instruction.
    wanted: Option<u32>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Step {
    #[default]
    Off,
    /// The next instruction runs.
    First,
    /// The one after it does not.
    Then,
}

impl Debug {
    /// The core stands in the middle of a block.
    pub(super) fn in_block(&self) -> bool {
        self.rest.is_some()
    }

    /// A block begins that is the rest of one that has been counted.
    pub(super) fn goes_on(&mut self, address: u32, bytes: u32) -> bool {
        let Some((_, end)) = self.rest.take().filter(|(next, _)| *next == address) else { return false };
        let reached = address.wrapping_add(bytes);
        self.rest = (reached < end).then_some((reached, end));
        true
    }

    /// unicorn has come back with PC at `pc`, in a block with this end: whether for the debugger.
    pub(super) fn stopped_at(&mut self, pc: u32, block_end: u32) -> bool {
        // A stop inside an IT block was asked for and not granted.
        let stopped = self.wanted.take() == Some(pc);
        if stopped {
            self.rest = Some((pc, block_end));
            self.step = Step::Off;
        }
        stopped
    }

    /// The core is somewhere else now.
    pub(super) fn forget_place(&mut self) {
        *self = Self { step: self.step, ..Self::default() };
    }
}

/// Hooks in unicorn.
#[derive(Default)]
pub(super) struct Breakpoints {
    at: BTreeMap<u32, UcHookId>,
    /// On every instruction, while the core is stepped.
    step: Option<UcHookId>,
}

/// Core registers as a debugger sees them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Registers {
    /// r0 to r12, SP, LR, PC.
    pub core: [u32; 16],
    /// xPSR.
    pub xpsr: u32,
    /// d0 to d15.
    pub double: [u64; 16],
    /// FPSCR.
    pub fpscr: u32,
}

/// Index of PC in [`Registers::core`].
pub const PC: usize = 15;

const CORE: [R; 16] =
    [R::R0, R::R1, R::R2, R::R3, R::R4, R::R5, R::R6, R::R7, R::R8, R::R9, R::R10, R::R11, R::R12, R::SP, R::LR, R::PC];
const DOUBLE: [R; 16] = [
    R::D0,
    R::D1,
    R::D2,
    R::D3,
    R::D4,
    R::D5,
    R::D6,
    R::D7,
    R::D8,
    R::D9,
    R::D10,
    R::D11,
    R::D12,
    R::D13,
    R::D14,
    R::D15,
];
/// Condition flags of xPSR, which a debugger may change.
const FLAGS: u32 = 0xF800_0000;

fn want<B: Board>(uc: &mut Unicorn<'_, Core<B>>, address: u32) {
    uc.get_data_mut().debug.wanted = Some(address);
    stop(uc);
}

fn on_breakpoint<B: Board>(uc: &mut Unicorn<'_, Core<B>>, address: u32) {
    let debug = &mut uc.get_data_mut().debug;
    if debug.passed.take() != Some(address) {
        want(uc, address);
    }
}

fn on_step<B: Board>(uc: &mut Unicorn<'_, Core<B>>, address: u32) {
    let debug = &mut uc.get_data_mut().debug;
    match debug.step {
        Step::Off => {}
        Step::First => debug.step = Step::Then,
        Step::Then => want(uc, address),
    }
}

impl<B: Board + 'static> Cpu<B> {
    /// Stop before the instruction at `address`.
    ///
    /// # Errors
    /// unicorn's.
    pub fn break_at(&mut self, address: u32) -> Result<(), uc_error> {
        if !self.breakpoints.at.contains_key(&address) {
            let place = u64::from(address);
            let hook = self.uc.add_code_hook(place, place, |uc, address, _| on_breakpoint(uc, address as u32))?;
            self.breakpoints.at.insert(address, hook);
            self.uc.ctl_flush_tb()?;
        }
        Ok(())
    }

    /// Stop there no more. `false` if there was no breakpoint.
    ///
    /// # Errors
    /// unicorn's.
    pub fn unbreak(&mut self, address: u32) -> Result<bool, uc_error> {
        let Some(hook) = self.breakpoints.at.remove(&address) else { return Ok(false) };
        self.unhook(hook)?;
        Ok(true)
    }

    /// No breakpoint and no step any more.
    ///
    /// # Errors
    /// unicorn's.
    pub fn let_go(&mut self) -> Result<(), uc_error> {
        let breakpoints = std::mem::take(&mut self.breakpoints);
        for hook in breakpoints.at.into_values().chain(breakpoints.step) {
            self.unhook(hook)?;
        }
        let debug = &mut self.uc.get_data_mut().debug;
        debug.step = Step::Off;
        debug.passed = None;
        Ok(())
    }

    fn unhook(&mut self, hook: UcHookId) -> Result<(), uc_error> {
        self.uc.remove_hook(hook)?;
        // Translated code may still call it.
        self.uc.ctl_flush_tb()
    }

    /// A breakpoint is at the instruction that comes next.
    pub fn at_breakpoint(&self) -> bool {
        self.breakpoints.at.contains_key(&(self.get(R::PC) & !1))
    }

    /// How the next [`Cpu::run`] goes: one instruction, or on and on.
    ///
    /// # Errors
    /// unicorn's.
    pub fn resume(&mut self, step: bool) -> Result<(), uc_error> {
        match (step, self.breakpoints.step.take()) {
            (true, None) => {
                // All addresses, by begin > end.
                self.breakpoints.step = Some(self.uc.add_code_hook(1, 0, |uc, at, _| on_step(uc, at as u32))?);
                self.uc.ctl_flush_tb()?;
            }
            (false, Some(hook)) => self.unhook(hook)?,
            (_, as_it_is) => self.breakpoints.step = as_it_is,
        }
        let debug = &mut self.uc.get_data_mut().debug;
        debug.step = if step { Step::First } else { Step::Off };
        debug.passed = debug.rest.map(|(next, _)| next);
        Ok(())
    }

    /// The registers.
    pub fn registers(&self) -> Registers {
        let mut core = CORE.map(|register| self.get(register));
        core[PC] &= !1;
        Registers {
            core,
            xpsr: self.get(R::XPSR),
            double: DOUBLE.map(|register| self.uc.reg_read(register).unwrap_or(0)),
            fpscr: self.get(R::FPSCR),
        }
    }

    /// Changes those that differ: all but xPSR's control bits.
    ///
    /// # Errors
    /// unicorn's.
    pub fn set_registers(&mut self, new: &Registers) -> Result<(), uc_error> {
        let old = self.registers();
        for (i, register) in CORE.into_iter().enumerate().filter(|(i, _)| new.core[*i] != old.core[*i]) {
            self.set(register, if i == PC { new.core[i] | 1 } else { new.core[i] });
        }
        if new.core[PC] != old.core[PC] {
            self.uc.get_data_mut().debug.forget_place();
        }
        for (i, register) in DOUBLE.into_iter().enumerate().filter(|(i, _)| new.double[*i] != old.double[*i]) {
            self.uc.reg_write(register, new.double[i])?;
        }
        if new.fpscr != old.fpscr {
            self.set(R::FPSCR, new.fpscr);
        }
        if (new.xpsr ^ old.xpsr) & FLAGS != 0 {
            self.set(R::XPSR, old.xpsr & !FLAGS | new.xpsr & FLAGS);
            self.refresh_mode();
        }
        Ok(())
    }

    /// Reads flash, RAM and system memory. `None` where there is none of them: a peripheral's registers have side effects.
    pub fn look(&self, address: u32, into: &mut [u8]) -> Option<()> {
        let core = self.uc.get_data();
        let memory = &core.soc.memory;
        let system = |into: &mut [u8]| {
            let last = u64::from(address) + into.len() as u64;
            (u64::from(address) >= super::SYSTEM_MEMORY && last <= super::SYSTEM_MEMORY + 0x1000)
                .then(|| self.uc.mem_read(address.into(), into).ok())
                .flatten()
        };
        memory.flash.read(address, into).or_else(|| memory.ram.read(address, into)).or_else(|| system(into))
    }

    /// Writes RAM. `None` where there is none.
    pub fn poke(&mut self, address: u32, from: &[u8]) -> Option<()> {
        self.uc.get_data_mut().soc.memory.ram.write(address, from)
    }
}
