//! The core with its run loop: sleep, faults of a debugger's and a test's making, reset.

use super::core::{Core, Halt, takeable};
use super::hooks;
use super::stops::Breakpoints;
use crate::soc::memory::{FLASH_BASE, RAM_BASE, RAM_SIZE};
use crate::soc::nvic::exception;
use crate::soc::{Config, ResetCause, Soc};
use rig_plant::board::Board;
use std::collections::HashSet;
use unicorn_engine::{Arch, ArmCpuModel, Mode, Prot, RegisterARM as R, Unicorn, uc_error};

/// An address that is never executed: emulation ends for other reasons.
const NOWHERE: u64 = 0xF000_0000;

/// Bytes of the stack that go with a stack pointer that is moved to the bottom.
const MOVED_STACK: u32 = 512;

const WFI: u16 = 0xBF30;
const WFE: u16 = 0xBF20;
const YIELD: u16 = 0xBF10;

/// System memory page with the factory's data, and where they are in it (DS10693, RM0390 chapter 34 and section 13.10).
pub(super) const SYSTEM_MEMORY: u64 = 0x1FFF_7000;
const UNIQUE_ID: u64 = 0x1FFF_7A10;
const FLASH_KIB: u64 = 0x1FFF_7A22;
const VREFINT_CAL: u64 = 0x1FFF_7A2A;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The limit is reached.
    Limit,
    /// The core has gone to sleep, before the limit: a good time to read RAM.
    Asleep,
    /// The chip requests a reset.
    Reset(ResetCause),
    /// A breakpoint is reached, or a step is done.
    Stopped,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sleep {
    Awake,
    Wfi,
    Wfe,
}

/// Why unicorn returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ended {
    /// For the debugger.
    Stopped,
    /// For another reason, which the state holds.
    Otherwise,
}

/// The core, with the chip inside it.
pub struct Cpu<B: Board + 'static> {
    pub(super) uc: Unicorn<'static, Core<B>>,
    sleep: Sleep,
    /// Nothing is executed while the chip's clocks and peripherals go on, as in an endless loop with interrupts off, until
    /// a reset: the fault `task-hang`.
    pub(crate) hung: bool,
    /// A fault in the HardFault handler: nothing is executed until a reset (ARMv7-M architecture manual B1.5.15).
    locked_up: bool,
    /// When that happened (s).
    pub(crate) lock_ups: Vec<f64>,
    /// The frame of the exception that is being entered has run out of RAM.
    pub(super) frame_lost: bool,
    /// The program outside of all handlers finds its stack here, with what was on it copied as far as it fits, as at the
    /// end of a recursion, once no exception is active: the fault `stack-overflow`.
    pub(crate) overflow_to: Option<u32>,
    sev_hooks: HashSet<u32>,
    pub(super) breakpoints: Breakpoints,
}

impl<B: Board + 'static> Cpu<B> {
    /// A core for `soc`, whose flash is programmed already. It starts with [`Cpu::reset`].
    ///
    /// # Errors
    /// An error of unicorn.
    pub fn new(soc: Soc<B>, config: &Config) -> Result<Self, uc_error> {
        // No Mode::MCLASS: it would force a Cortex-M33.
        let mut uc = Unicorn::new_with_data(Arch::ARM, Mode::THUMB, Core::new(soc))?;
        uc.ctl_set_cpu_model(ArmCpuModel::CORTEX_M4 as i32)?;
        let memory = &uc.get_data().soc.memory;
        let (flash, ram) = (memory.flash.host(), memory.ram.host());
        let (flash_size, ram_size) = (memory.flash.size() as u64, memory.ram.size() as u64);
        // SAFETY: both buffers live in the data of this very unicorn instance, which is dropped after the instance is
        // closed, and they never move: `Region` owns a heap allocation of a fixed size.
        unsafe {
            uc.mem_map_ptr(FLASH_BASE.into(), flash_size, Prot::READ | Prot::EXEC, flash.cast())?;
            // Not executable until some code in it runs: unicorn checks each store into a region with code.
            uc.mem_map_ptr(RAM_BASE.into(), ram_size, Prot::READ | Prot::WRITE, ram.cast())?;
        }
        uc.mem_map(SYSTEM_MEMORY, 0x1000, Prot::READ)?;
        uc.mem_write(UNIQUE_ID, &config.unique_id)?;
        uc.mem_write(FLASH_KIB, &((flash_size >> 10) as u16).to_le_bytes())?;
        uc.mem_write(VREFINT_CAL, &config.vrefint_cal.to_le_bytes())?;
        hooks::install(&mut uc)?;
        let mut cpu = Self {
            uc,
            sleep: Sleep::Awake,
            hung: false,
            locked_up: false,
            lock_ups: Vec::new(),
            frame_lost: false,
            overflow_to: None,
            sev_hooks: HashSet::new(),
            breakpoints: Breakpoints::default(),
        };
        cpu.code_changed()?;
        Ok(cpu)
    }

    /// What the hooks share.
    pub fn core(&self) -> &Core<B> {
        self.uc.get_data()
    }

    /// What the hooks share.
    pub fn core_mut(&mut self) -> &mut Core<B> {
        self.uc.get_data_mut()
    }

    // Core registers always exist; a failure would be a broken unicorn, and 0 leads to an early stop.
    pub(super) fn get(&self, register: impl Into<i32>) -> u32 {
        self.uc.reg_read(register).unwrap_or(0) as u32
    }

    pub(super) fn set(&mut self, register: impl Into<i32>, value: u32) {
        let _ = self.uc.reg_write(register, value.into());
    }

    /// Flash has changed: drops translated code and block lengths, and hooks new SEVs.
    ///
    /// # Errors
    /// An error of unicorn.
    pub fn code_changed(&mut self) -> Result<(), uc_error> {
        hooks::hook_sev(&mut self.uc, &mut self.sev_hooks)?;
        self.uc.get_data_mut().blocks.clear();
        self.uc.ctl_flush_tb()
    }

    /// Reset the chip and the core.
    pub fn reset(&mut self, cause: ResetCause) {
        let core = self.uc.get_data_mut();
        core.soc.reset(cause);
        core.watches.reset();
        core.attention = true;
        core.exception_return = false;
        core.halt = None;
        core.fault_pc = None;
        core.stops.forget_place();
        let vectors = core.soc.vector_table();
        let (stack, entry) = (core.soc.memory.word(vectors), core.soc.memory.word(vectors + 4));
        for number in 0..=12 {
            self.set(R::R0 as i32 + number, 0);
        }
        for register in [R::CONTROL, R::PRIMASK, R::FAULTMASK, R::BASEPRI, R::FPSCR] {
            self.set(register, 0);
        }
        self.set(R::XPSR, 1 << 24);
        self.set(R::LR, 0xFFFF_FFFF);
        self.set(R::SP, stack.unwrap_or(0) & !3);
        self.set(R::PC, entry.unwrap_or(0) | 1);
        self.refresh_mode();
        self.sleep = Sleep::Awake;
        (self.hung, self.locked_up, self.overflow_to) = (false, false, None);
    }

    /// Number of the BKPT at `pc`, and the exit that it stands for where it is semihosting's: SYS_EXIT with its reason in
    /// r1, or SYS_EXIT_EXTENDED with a block of reason and code there. Any other BKPT is a program's end.
    pub fn breakpoint(&self, pc: u32) -> (u8, Option<bool>) {
        /// ADP_Stopped_ApplicationExit.
        const EXIT: u32 = 0x2_0026;
        let memory = &self.core().soc.memory;
        let number = memory.half(pc).unwrap_or(0) as u8;
        let reason = self.get(R::R1);
        let exit = match (number, self.get(R::R0)) {
            (0xAB, 0x18) => Some(reason == EXIT),
            (0xAB, 0x20) => Some((memory.word(reason), memory.word(reason.wrapping_add(4))) == (Some(EXIT), Some(0))),
            (0xAB, _) => None,
            _ => Some(true),
        };
        (number, exit)
    }

    fn move_stack(&mut self, to: u32) {
        let from = self.get(R::SP);
        let memory = &mut self.uc.get_data_mut().soc.memory;
        let end = memory.ram.end().min(from.saturating_add(MOVED_STACK));
        let mut live = vec![0; end.saturating_sub(from) as usize];
        if to < from && memory.ram.read(from, &mut live).is_some() {
            memory.ram.write(to, &live).expect("it is below where it was read from");
            self.set(R::SP, to);
        }
    }

    /// A bus fault by a stack that has run out of RAM. The core takes it as a HardFault, whose own frame is lost; in a
    /// handler of that priority it locks up.
    fn stack_overflow(&mut self, address: u32) -> Result<(), Halt> {
        let masked = self.get(R::FAULTMASK) & 1 == 1;
        let core = self.uc.get_data_mut();
        core.soc.bus_fault(address, false);
        core.stops.forget_place();
        if masked || core.soc.nvic.running_priority() < 0 {
            self.lock_up();
            return Ok(());
        }
        self.enter(exception::HARD_FAULT)
    }

    pub(super) fn lock_up(&mut self) {
        self.locked_up = true;
        self.lock_ups.push(self.uc.get_data().soc.clock.seconds());
    }

    /// The core takes a HardFault where it is, as after a jump to an invalid address or a bus error.
    ///
    /// # Errors
    /// [`Halt::Memory`] if the exception cannot be entered, because stack or vector are missing.
    pub fn crash(&mut self) -> Result<(), Halt> {
        self.sleep = Sleep::Awake;
        self.enter(exception::HARD_FAULT)
    }

    /// Runs to the first instruction boundary that is not before `t_s`, or to an [`Outcome`] that the caller has to
    /// handle.
    ///
    /// # Errors
    /// [`Halt`] if the core cannot go on.
    pub fn run(&mut self, t_s: f64) -> Result<Outcome, Halt> {
        loop {
            if self.uc.get_data().stops.in_block() {
                // Stopped in the middle of a block: events since its start wait for its end, as they do without a stop.
                match self.execute()? {
                    Ended::Stopped => return Ok(Outcome::Stopped),
                    Ended::Otherwise if self.sleep != Sleep::Awake => return Ok(Outcome::Asleep),
                    Ended::Otherwise => {}
                }
            }
            let core = self.uc.get_data_mut();
            // Computed again each time: the firmware may change the clock on the way.
            core.limit = core.soc.clock.cycle_at(t_s);
            core.deadline = core.soc.sync().min(core.limit);
            if core.soc.faults.pending() {
                return Err(Halt::Fault(core.fault_pc.take().unwrap_or(core.block)));
            }
            match core.halt.take() {
                None => {}
                Some(Halt::StackOverflow(address)) => {
                    self.stack_overflow(address)?;
                    continue;
                }
                Some(trap) => return Err(trap),
            }
            if let Some(cause) = core.soc.reset_request {
                return Ok(Outcome::Reset(cause));
            }
            if self.hung || self.locked_up {
                let core = self.uc.get_data_mut();
                if core.soc.clock.now() >= core.limit {
                    return Ok(Outcome::Limit);
                }
                let limit = core.limit;
                core.soc.sleep(limit);
                continue;
            }
            if core.soc.nvic.depth() == 0
                && let Some(bottom) = self.overflow_to.take()
            {
                self.move_stack(bottom);
            }
            if let Some(exception) = takeable(&self.uc) {
                self.sleep = Sleep::Awake;
                self.enter(exception)?;
                continue;
            }
            let core = self.uc.get_data_mut();
            if core.soc.clock.now() >= core.limit {
                return Ok(Outcome::Limit);
            }
            if self.sleep != Sleep::Awake {
                if self.wakes() {
                    self.sleep = Sleep::Awake;
                } else {
                    let core = self.uc.get_data_mut();
                    let limit = core.limit;
                    core.counters.asleep += core.soc.sleep(limit);
                    continue;
                }
            }
            if self.execute()? == Ended::Stopped {
                return Ok(Outcome::Stopped);
            }
            if self.sleep != Sleep::Awake {
                return Ok(Outcome::Asleep);
            }
        }
    }

    /// Something ends the sleep without an exception being taken.
    fn wakes(&mut self) -> bool {
        let nvic = &mut self.uc.get_data_mut().soc.nvic;
        match self.sleep {
            Sleep::Awake => true,
            // Pending is enough, masked or not.
            Sleep::Wfi => nvic.best().is_some(),
            Sleep::Wfe => std::mem::take(&mut nvic.event),
        }
    }

    /// Let unicorn run until a hook stops it or the core goes to sleep.
    fn execute(&mut self) -> Result<Ended, Halt> {
        let core = self.uc.get_data_mut();
        core.stopped = false;
        core.attention |= !core.stops.in_block();
        if std::mem::take(&mut core.soc.flash_changed) {
            self.uc.ctl_flush_tb()?;
            self.uc.get_data_mut().blocks.clear();
        }
        let from = u64::from(self.get(R::PC) | 1);
        let result = self.uc.emu_start(from, NOWHERE, 0, 0);
        let after = self.get(R::PC) & !1;
        let core = self.uc.get_data_mut();
        if core.halt.is_some() {
            return Ok(Ended::Otherwise);
        }
        if core.stops.stopped_at(after, core.block_end) {
            return Ok(Ended::Stopped);
        }
        let hint = core.soc.memory.half(after.wrapping_sub(2));
        let ended = match result {
            Ok(()) if std::mem::take(&mut core.exception_return) => self.leave(),
            Ok(()) => {
                if !core.stopped && hint == Some(WFI) {
                    self.sleep = Sleep::Wfi;
                }
                Ok(())
            }
            // unicorn reports both hints as invalid instructions, with PC behind them.
            Err(uc_error::INSN_INVALID) if hint == Some(WFE) => {
                self.sleep = Sleep::Wfe;
                Ok(())
            }
            Err(uc_error::INSN_INVALID) if hint == Some(YIELD) => Ok(()),
            Err(uc_error::FETCH_PROT) => Ok(self.uc.mem_protect(RAM_BASE.into(), RAM_SIZE as u64, Prot::ALL)?),
            Err(uc_error::INSN_INVALID) => Err(Halt::Undefined(after)),
            Err(error) => Err(error.into()),
        };
        ended.map(|()| Ended::Otherwise)
    }
}
