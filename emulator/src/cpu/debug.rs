//! Breakpoints, steps and registers for a debugger.
//!
//! Breakpoints are hooks in unicorn and leave flash as it is. Time is counted by blocks, at their start: where the core
//! stops in the middle of one, the rest of it runs later without being counted again and without an interrupt in
//! between, so that a run with stops is the same as one without.
//!
//! unicorn treats an IT block as one instruction and cannot stop inside it. So a step goes over all of it, and a
//! breakpoint in an IT block has to be set at the IT.

use super::core::Core;
use super::hooks::stop;
use super::run::{Cpu, SYSTEM_MEMORY};
use super::stops::Step;
use rig_plant::board::Board;
use unicorn_engine::{RegisterARM as R, UcHookId, Unicorn, uc_error};

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

/// unicorn's number of a core register.
fn core_register(index: usize) -> i32 {
    match index {
        0..=12 => R::R0 as i32 + index as i32,
        13 => R::SP as i32,
        14 => R::LR as i32,
        _ => R::PC as i32,
    }
}

/// unicorn's number of a double-precision register.
fn double_register(index: usize) -> i32 {
    R::D0 as i32 + index as i32
}

/// Condition flags of xPSR, which a debugger may change.
const FLAGS: u32 = 0xF800_0000;

fn want<B: Board>(uc: &mut Unicorn<'_, Core<B>>, address: u32) {
    uc.get_data_mut().stops.wanted = Some(address);
    stop(uc);
}

fn on_breakpoint<B: Board>(uc: &mut Unicorn<'_, Core<B>>, address: u32) {
    let stops = &mut uc.get_data_mut().stops;
    if stops.passed.take() != Some(address) {
        want(uc, address);
    }
}

fn on_step<B: Board>(uc: &mut Unicorn<'_, Core<B>>, address: u32) {
    let stops = &mut uc.get_data_mut().stops;
    match stops.step {
        Step::Off => {}
        Step::First => stops.step = Step::Then,
        Step::Then => want(uc, address),
    }
}

impl<B: Board + 'static> Cpu<B> {
    /// Sets a breakpoint before the instruction at `address`.
    ///
    /// # Errors
    /// An error of unicorn.
    pub fn break_at(&mut self, address: u32) -> Result<(), uc_error> {
        if !self.breakpoints.at.contains_key(&address) {
            let place = u64::from(address);
            let hook = self.uc.add_code_hook(place, place, |uc, address, _| on_breakpoint(uc, address as u32))?;
            self.breakpoints.at.insert(address, hook);
            self.uc.ctl_flush_tb()?;
        }
        Ok(())
    }

    /// Removes a breakpoint. `false` if there was none.
    ///
    /// # Errors
    /// An error of unicorn.
    pub fn unbreak(&mut self, address: u32) -> Result<bool, uc_error> {
        let Some(hook) = self.breakpoints.at.remove(&address) else { return Ok(false) };
        self.unhook(hook)?;
        Ok(true)
    }

    /// Removes all breakpoints and ends stepping.
    ///
    /// # Errors
    /// An error of unicorn.
    pub fn let_go(&mut self) -> Result<(), uc_error> {
        let breakpoints = std::mem::take(&mut self.breakpoints);
        for hook in breakpoints.at.into_values().chain(breakpoints.step) {
            self.unhook(hook)?;
        }
        let stops = &mut self.uc.get_data_mut().stops;
        stops.step = Step::Off;
        stops.passed = None;
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

    /// Says whether the next [`Cpu::run`] is a step of one instruction, or goes on.
    ///
    /// # Errors
    /// An error of unicorn.
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
        let stops = &mut self.uc.get_data_mut().stops;
        stops.step = if step { Step::First } else { Step::Off };
        stops.passed = stops.rest.map(|(next, _)| next);
        Ok(())
    }

    /// The registers.
    pub fn registers(&self) -> Registers {
        let mut core = std::array::from_fn(|i| self.get(core_register(i)));
        core[PC] &= !1;
        Registers {
            core,
            xpsr: self.get(R::XPSR),
            double: std::array::from_fn(|i| self.uc.reg_read(double_register(i)).unwrap_or(0)),
            fpscr: self.get(R::FPSCR),
        }
    }

    /// Changes those that differ: all but xPSR's control bits.
    ///
    /// # Errors
    /// An error of unicorn.
    pub fn set_registers(&mut self, new: &Registers) -> Result<(), uc_error> {
        let old = self.registers();
        for i in (0..16).filter(|i| new.core[*i] != old.core[*i]) {
            self.set(core_register(i), if i == PC { new.core[i] | 1 } else { new.core[i] });
        }
        if new.core[PC] != old.core[PC] {
            self.uc.get_data_mut().stops.forget_place();
        }
        for i in (0..16).filter(|i| new.double[*i] != old.double[*i]) {
            self.uc.reg_write(double_register(i), new.double[i])?;
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

    /// Reads flash, RAM and system memory. `None` where there is none of them: a peripheral's registers have side
    /// effects.
    pub fn look(&self, address: u32, into: &mut [u8]) -> Option<()> {
        let core = self.uc.get_data();
        let memory = &core.soc.memory;
        let system = |into: &mut [u8]| {
            let last = u64::from(address) + into.len() as u64;
            (u64::from(address) >= SYSTEM_MEMORY && last <= SYSTEM_MEMORY + 0x1000)
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
