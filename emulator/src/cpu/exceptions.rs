//! Exception entry and return (ARMv7-M architecture manual B1.5), which unicorn leaves out.
//!
//! The floating-point part of a frame is stacked eagerly: firmware cannot distinguish that from lazy stacking.

use super::core::Halt;
use super::run::Cpu;
use crate::soc::memory::BELOW_RAM;
use crate::soc::nvic::exception;
use rig_plant::board::Board;
use unicorn_engine::RegisterARM as R;

/// Frame sizes without and with floating-point registers.
const FRAME: u32 = 0x20;
const FRAME_FP: u32 = 0x68;
/// Cycles of entry and return, without and with floating-point registers.
const ENTRY: (u64, u64) = (12, 29);
const RETURN: (u64, u64) = (10, 27);

/// CONTROL bits.
const SPSEL: u32 = 1 << 1;
const FPCA: u32 = 1 << 2;
/// xPSR: the frame was padded to 8 bytes. Thumb.
const PADDED: u32 = 1 << 9;
const THUMB: u32 = 1 << 24;
/// The exception number in xPSR.
const IPSR: u32 = 0x1FF;
/// What a handler inherits of xPSR: condition, saturation and GE flags.
const KEPT: u32 = 0xF80F_0000;

const CORE: [R; 6] = [R::R0, R::R1, R::R2, R::R3, R::R12, R::LR];

impl<B: Board + 'static> Cpu<B> {
    fn stacked(&mut self, address: u32, write: Option<u32>) -> Result<u32, Halt> {
        let ram = &mut self.uc.get_data_mut().soc.memory.ram;
        let done = match write {
            Some(value) => ram.set_word(address, value).map(|()| 0),
            None => ram.word(address),
        };
        if done.is_none() && write.is_some() && BELOW_RAM.contains(&address) {
            // The frame is lost, and the exception is entered nevertheless.
            self.uc.get_data_mut().soc.bus_fault(address, true);
            self.frame_lost = true;
            return Ok(0);
        }
        let what = if write.is_some() { "stacking" } else { "unstacking" };
        done.ok_or_else(|| Halt::Memory { what, address, pc: self.get(R::PC) })
    }

    /// unicorn caches the mode of the core. Of all register writes only one to the flags refreshes that cache.
    pub(super) fn refresh_mode(&mut self) {
        let flags = self.get(R::XPSR) & 0xF000_0000;
        self.set(R::APSR_NZCV, flags);
    }

    /// Take an exception.
    pub(super) fn enter(&mut self, exception: u16) -> Result<(), Halt> {
        let xpsr = self.get(R::XPSR) | THUMB;
        let control = self.get(R::CONTROL);
        let fp = control & FPCA != 0;
        let thread = xpsr & IPSR == 0;
        let process_stack = thread && control & SPSEL != 0;
        let before = self.get(R::SP);
        let padding = before & 4;
        let stack = before.wrapping_sub(padding).wrapping_sub(if fp { FRAME_FP } else { FRAME });

        for (i, register) in CORE.into_iter().enumerate() {
            let value = self.get(register);
            self.stacked(stack.wrapping_add(4 * i as u32), Some(value))?;
        }
        let pc = self.get(R::PC) & !1;
        self.stacked(stack.wrapping_add(24), Some(pc))?;
        self.stacked(stack.wrapping_add(28), Some(xpsr | if padding != 0 { PADDED } else { 0 }))?;
        if fp {
            for i in 0..8 {
                let value = self.uc.reg_read(R::D0 as i32 + i)?;
                self.stacked(stack.wrapping_add(FRAME + 8 * i as u32), Some(value as u32))?;
                self.stacked(stack.wrapping_add(FRAME + 8 * i as u32 + 4), Some((value >> 32) as u32))?;
            }
            let status = self.get(R::FPSCR);
            self.stacked(stack.wrapping_add(0x60), Some(status))?;
        }

        // A frame that runs out of RAM is a bus fault, which takes the place of the exception as a HardFault; that one
        // waits, pending. A HardFault or NMI is entered all the same (ARMv7-M architecture manual B1.5.15).
        let lost = std::mem::take(&mut self.frame_lost);
        let exception = if lost && exception > exception::HARD_FAULT { exception::HARD_FAULT } else { exception };

        // SP belongs to the stack in use: first the frame's, then over to the main stack.
        self.set(R::SP, stack);
        self.set(R::CONTROL, control & !(FPCA | if process_stack { SPSEL } else { 0 }));
        let lr: u32 = match (thread, process_stack) {
            (false, _) => 0xFFFF_FFF1,
            (true, false) => 0xFFFF_FFF9,
            (true, true) => 0xFFFF_FFFD,
        };
        self.set(R::LR, if fp { lr & !0x10 } else { lr });
        // IT bits go: the handler starts unconditionally.
        self.set(R::XPSR, (xpsr & KEPT) | THUMB | u32::from(exception));
        let core = self.uc.get_data_mut();
        core.soc.clock.advance(if fp { ENTRY.1 } else { ENTRY.0 });
        core.soc.nvic.enter(exception);
        core.counters.exceptions += 1;
        let slot = core.soc.vector_table() + 4 * u32::from(exception);
        let Some(handler) = core.soc.memory.word(slot) else {
            return Err(Halt::Memory { what: "vector fetch", address: slot, pc });
        };
        // The cycles of the entry have fetched it.
        core.next = handler & !1;
        self.set(R::PC, handler | 1);
        self.refresh_mode();
        Ok(())
    }

    /// Return from an exception: PC holds EXC_RETURN.
    pub(super) fn leave(&mut self) -> Result<(), Halt> {
        let code = self.get(R::PC) | 1;
        let (fp, process_stack) = (code & 0x10 == 0, code & 0xF == 0xD);
        let core = self.uc.get_data_mut();
        if core.soc.nvic.leave().is_none() {
            return Err(Halt::Memory { what: "exception return", address: code, pc: core.block });
        }
        core.soc.clock.advance(if fp { RETURN.1 } else { RETURN.0 });
        core.attention = true;
        core.watches.unwind(core.soc.nvic.depth());
        let control = self.get(R::CONTROL);
        let stack = self.get(if process_stack { R::PSP } else { R::SP });
        if BELOW_RAM.contains(&stack) {
            // The chip would enter the HardFault again, and so on.
            self.lock_up();
            return Ok(());
        }
        for (i, register) in CORE.into_iter().enumerate() {
            let value = self.stacked(stack.wrapping_add(4 * i as u32), None)?;
            self.set(register, value);
        }
        let pc = self.stacked(stack.wrapping_add(24), None)?;
        let xpsr = self.stacked(stack.wrapping_add(28), None)?;
        if fp {
            for i in 0..8 {
                let low = self.stacked(stack.wrapping_add(FRAME + 8 * i as u32), None)?;
                let high = self.stacked(stack.wrapping_add(FRAME + 8 * i as u32 + 4), None)?;
                self.uc.reg_write(R::D0 as i32 + i, u64::from(low) | u64::from(high) << 32)?;
            }
            let status = self.stacked(stack.wrapping_add(0x60), None)?;
            self.set(R::FPSCR, status);
        }
        let padding = if xpsr & PADDED != 0 { 4 } else { 0 };
        let after = stack.wrapping_add(if fp { FRAME_FP } else { FRAME }).wrapping_add(padding);
        if !process_stack {
            self.set(R::SP, after);
        }
        self.uc.get_data_mut().next = pc & !1;
        self.set(R::PC, pc | 1);
        self.set(R::XPSR, xpsr & !PADDED);
        let select = if process_stack { SPSEL } else { 0 };
        self.set(R::CONTROL, (control & 1) | select | if fp { FPCA } else { 0 });
        if process_stack {
            self.set(R::PSP, after);
            self.set(R::SP, after);
        }
        if xpsr & IPSR == 0 {
            self.set(R::FAULTMASK, 0);
        }
        self.refresh_mode();
        Ok(())
    }
}
