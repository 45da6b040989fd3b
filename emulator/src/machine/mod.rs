//! Boots an ELF on the emulated chip and runs it against a [`Board`] in emulated time.
//!
//! ```no_run
//! # use rig_emulator::machine::{Config, Machine};
//! # use rig_plant::board::Board;
//! # fn run(elf: &[u8], board: impl Board + 'static) -> Result<(), Box<dyn std::error::Error>> {
//! let mut machine = Machine::new(elf, board, Config::default())?;
//! machine.watch_function("control_tick");
//! machine.run_until(2.0)?;
//! for line in machine.defmt_lines() {
//!     println!("{line}");
//! }
//! println!("{:?}", machine.tick_stats());
//! # Ok(())
//! # }
//! ```

mod error;

pub use error::{MachineError, Place};

use crate::cpu::core::Halt;
use crate::cpu::image::Image;
use crate::cpu::{Cpu, Outcome};
use crate::rtt::{DefmtLine, Level, Rtt};
use crate::soc::Soc;
use crate::soc::memory::{FLASH_BASE, RAM_BASE, RAM_NOISE};
use rig_plant::board::{Board, Stimulus};

pub use crate::cpu::watch::TickStats;
pub use crate::soc::{Config, ResetCause};

/// RTT is read this often, so that a firmware that never sleeps does not overflow its buffer.
const RTT_INTERVAL_S: f64 = 1e-3;

/// Bytes that a stack has left before it overflows.
const STACK_LEFT: u32 = 16;

/// What the machine has done since it was built.
#[derive(Clone, Debug, PartialEq)]
pub struct Stats {
    /// Instructions executed.
    pub instructions: u64,
    /// Translation blocks executed.
    pub blocks: u64,
    /// Exceptions taken.
    pub exceptions: u64,
    /// Part of the time that the core was not asleep.
    pub core_busy: f64,
    /// Resets after the first start: when and why.
    pub resets: Vec<(f64, ResetCause)>,
    /// When the core has locked up: a fault in the HardFault handler (s).
    pub lock_ups: Vec<f64>,
    /// Cost of the function that was watched first.
    pub tick: TickStats,
    /// The most that was ever on the main stack, in bytes.
    pub stack_high_water_bytes: u32,
    /// What a strict machine would have stopped at, with how often.
    pub warnings: Vec<(String, u64)>,
}

/// An emulated NUCLEO-F446RE on a board of type `B`.
pub struct Machine<B: Board + 'static> {
    cpu: Cpu<B>,
    image: Image,
    rtt: Option<Rtt>,
    lines: Vec<DefmtLine>,
    resets: Vec<(f64, ResetCause)>,
    stack_high_water: u32,
    dead: Option<MachineError>,
    debugger: Option<Box<dyn Debugger<B>>>,
}

/// Why a [`Debugger`] is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pause {
    /// Nothing has happened: a debugger may want to look.
    Slice,
    /// The core has reached a breakpoint.
    Breakpoint,
    /// The core has done one step.
    Step,
    /// The firmware has failed; the error is returned when the debugger releases the machine.
    Failed,
}

/// Something that may hold the machine and look into it. Emulated time stands still meanwhile.
pub trait Debugger<B: Board + 'static> {
    /// The machine goes on when this returns.
    fn pause(&mut self, machine: &mut Machine<B>, why: Pause);
}

impl<B: Board + 'static> Machine<B> {
    /// Programs the ELF into an erased chip and switches it on.
    ///
    /// # Errors
    /// [`MachineError::Image`] if the ELF cannot be loaded.
    pub fn new(elf: &[u8], board: B, config: Config) -> Result<Self, MachineError> {
        let image = Image::parse(elf)?;
        let mut soc = Soc::new(board, &config);
        program(&mut soc, &image);
        let mut cpu = Cpu::new(soc, &config).map_err(|error| MachineError::Emulator(format!("{error:?}")))?;
        cpu.reset(ResetCause::PowerCycle);
        let rtt = image.symbol("_SEGGER_RTT").and_then(|address| Rtt::new(elf, address));
        Ok(Self {
            cpu,
            image,
            rtt,
            lines: Vec::new(),
            resets: Vec::new(),
            stack_high_water: 0,
            dead: None,
            debugger: None,
        })
    }

    /// Emulated time since power-up, in seconds.
    pub fn now_s(&self) -> f64 {
        self.cpu.core().soc.clock.seconds()
    }

    /// The board.
    pub fn board(&self) -> &B {
        &self.cpu.core().soc.board
    }

    /// The board.
    pub fn board_mut(&mut self) -> &mut B {
        &mut self.cpu.core_mut().soc.board
    }

    /// The chip without its core, for looking at registers.
    pub fn soc_mut(&mut self) -> &mut Soc<B> {
        &mut self.cpu.core_mut().soc
    }

    /// Drive pins now, besides what the board does by itself.
    pub fn send(&mut self, stimulus: Stimulus) {
        self.cpu.core_mut().soc.stimulate(stimulus);
    }

    /// Runs until `t_s`. Resets may happen on the way.
    ///
    /// # Errors
    /// [`MachineError`] if the firmware cannot go on. The error stays until [`Machine::power_cycle`].
    pub fn run_until(&mut self, t_s: f64) -> Result<(), MachineError> {
        if let Some(error) = &self.dead {
            return Err(error.clone());
        }
        while self.now_s() < t_s {
            let slice = t_s.min(self.now_s() + RTT_INTERVAL_S);
            self.pause(Pause::Slice);
            let mut outcome = self.cpu.run(slice);
            while outcome == Ok(Outcome::Stopped) {
                self.pause(if self.cpu.at_breakpoint() { Pause::Breakpoint } else { Pause::Step });
                outcome = self.cpu.run(slice);
            }
            if outcome.is_err() {
                self.pause(Pause::Failed);
            }
            self.poll_rtt();
            match outcome {
                Ok(Outcome::Limit) if slice >= t_s => break,
                // A stop has been handled above.
                Ok(Outcome::Limit | Outcome::Asleep | Outcome::Stopped) => {}
                Ok(Outcome::Reset(cause)) => self.reset(cause),
                Err(error) => {
                    let error = self.explain(error);
                    self.dead = Some(error.clone());
                    return Err(error);
                }
            }
        }
        Ok(())
    }

    /// Gives the machine to a debugger, now and then and at its stops.
    pub fn attach(&mut self, debugger: Box<dyn Debugger<B>>) {
        self.debugger = Some(debugger);
    }

    fn pause(&mut self, why: Pause) {
        // Taken out of the machine, since it works on the machine that holds it.
        if let Some(mut debugger) = self.debugger.take() {
            debugger.pause(self, why);
            self.debugger = Some(debugger);
        }
    }

    /// The core, for a debugger.
    pub(crate) fn cpu_mut(&mut self) -> &mut Cpu<B> {
        &mut self.cpu
    }

    /// The firmware's symbols, for a debugger.
    pub(crate) fn image(&self) -> &Image {
        &self.image
    }

    fn poll_rtt(&mut self) {
        if let Some(rtt) = &mut self.rtt {
            let soc = &mut self.cpu.core_mut().soc;
            let t_s = soc.clock.seconds();
            rtt.poll(&mut soc.memory, t_s);
            self.lines.append(&mut rtt.take());
        }
    }

    fn reset(&mut self, cause: ResetCause) {
        self.poll_rtt();
        if let Some(rtt) = &mut self.rtt {
            rtt.reset();
        }
        self.stack_high_water = self.stack_high_water();
        self.resets.push((self.now_s(), cause));
        self.cpu.reset(cause);
    }

    /// The core stops executing, as in an endless loop with interrupts off, until a reset (for example the watchdog's)
    /// or until this is called with `false`. Peripherals and DMA go on.
    pub fn hang(&mut self, hung: bool) {
        self.cpu.hung = hung;
    }

    /// A debugger is attached that has asked for blocking RTT and no longer reads it.
    pub fn stall_rtt(&mut self, stalled: bool) {
        if let Some(rtt) = &mut self.rtt {
            rtt.stall(stalled);
        }
    }

    /// The ST-LINK feeds its 8 MHz into OSC_IN, or no longer does; a core that runs on it stands still until a reset.
    /// The other clocks of the chip go on here, as with [`Machine::hang`].
    pub fn feed_hse(&mut self, fed: bool) {
        if !self.soc_mut().rcc.feed_hse(fed) {
            self.hang(true);
        }
    }

    /// The microcontroller's supply dips for a moment ([`ResetCause::BrownOut`]). RAM keeps its contents.
    pub fn brown_out(&mut self) {
        self.dead = None;
        self.reset(ResetCause::BrownOut);
    }

    /// The core takes a HardFault where it is, as after a jump to an invalid address or a bus error: the fault `crash`.
    ///
    /// # Errors
    /// If the exception cannot be entered, because stack or vector are missing.
    pub fn crash(&mut self) -> Result<(), MachineError> {
        self.cpu.crash().map_err(|error| self.explain(error))
    }

    /// The main stack runs past its lowest address with the next pushes outside of all handlers: the fault
    /// `stack-overflow`. Into RAM below it, or, where the stack is at the bottom of RAM, into a lock-up of the core.
    pub fn overflow_stack(&mut self) {
        let soc = &self.cpu.core().soc;
        if let Some(top) = soc.memory.word(soc.vector_table()) {
            self.cpu.overflow_to = Some((self.stack_bottom(top) + STACK_LEFT) & !7);
        }
    }

    /// Switch the supply off and on. Flash keeps its contents, RAM does not; emulated time goes on.
    pub fn power_cycle(&mut self) {
        self.dead = None;
        self.reset(ResetCause::PowerCycle);
    }

    fn place(&self, pc: u32) -> Place {
        let function = self.image.function_at(pc & !1).unwrap_or("?").to_owned();
        Place { pc: pc & !1, function, t_s: self.now_s() }
    }

    fn explain(&mut self, error: Halt) -> MachineError {
        let last_block = self.cpu.core().block;
        match error {
            Halt::Fault(pc) => {
                let place = self.place(pc);
                match self.cpu.core_mut().soc.faults.take() {
                    Some(fault) => MachineError::Fault { fault, place },
                    None => MachineError::Emulator("a fault without a cause".into()),
                }
            }
            Halt::Undefined(pc) => {
                let said = self.lines.iter().rev().find(|line| line.level == Some(Level::Error));
                MachineError::Undefined { said: said.map(ToString::to_string), place: self.place(pc) }
            }
            Halt::Memory { what, address, pc } => MachineError::Memory { what, address, place: self.place(pc) },
            Halt::Breakpoint(pc) => {
                let (number, exit) = self.cpu.breakpoint(pc);
                MachineError::Breakpoint { number, exit, place: self.place(pc) }
            }
            // The run loop handles it.
            Halt::StackOverflow(address) => {
                MachineError::Memory { what: "stack access", address, place: self.place(last_block) }
            }
            Halt::Exception(number) => MachineError::Exception { number, place: self.place(last_block) },
            Halt::Unicorn(error) => MachineError::Emulator(format!("{error:?} {}", self.place(last_block))),
        }
    }

    /// Lines that the firmware has logged since the last call.
    pub fn defmt_lines(&mut self) -> Vec<DefmtLine> {
        self.poll_rtt();
        std::mem::take(&mut self.lines)
    }

    /// Count instructions of each call of a function, named by its symbol or the last segment of a Rust path. `false`
    /// if the ELF has no such function.
    pub fn watch_function(&mut self, symbol: &str) -> bool {
        let Some(entry) = self.image.function(symbol) else { return false };
        let core = self.cpu.core_mut();
        core.watches.add(symbol, entry);
        core.blocks.clear();
        true
    }

    /// Cost of the function that was watched first.
    pub fn tick_stats(&self) -> TickStats {
        self.cpu.core().watches.stats().next().map(|(_, stats)| stats).unwrap_or_default()
    }

    /// Cost of a watched function.
    pub fn watched(&self, symbol: &str) -> Option<TickStats> {
        self.cpu.core().watches.stats().find(|(name, _)| *name == symbol).map(|(_, stats)| stats)
    }

    /// Names of the watched functions, and how often each has been called.
    pub fn call_counts(&self) -> Vec<(String, u64)> {
        self.cpu.core().watches.call_counts().map(|(name, calls)| (name.to_owned(), calls)).collect()
    }

    /// What has happened so far.
    pub fn stats(&self) -> Stats {
        let core = self.cpu.core();
        let total = core.soc.clock.now().max(1) as f64;
        Stats {
            instructions: core.counters.instructions,
            blocks: core.counters.blocks,
            exceptions: core.counters.exceptions,
            core_busy: 1.0 - core.counters.asleep as f64 / total,
            resets: self.resets.clone(),
            lock_ups: self.cpu.lock_ups.clone(),
            tick: self.tick_stats(),
            stack_high_water_bytes: self.stack_high_water(),
            warnings: core.soc.faults.warnings().iter().map(|(what, count)| (what.clone(), *count)).collect(),
        }
    }

    /// Lowest address of the main stack, whose first is `top`.
    fn stack_bottom(&self, top: u32) -> u32 {
        self.image.stack_bottom(top).unwrap_or(RAM_BASE)
    }

    /// RAM holds a known byte at power-up: the first other byte above the statics was once on the stack.
    fn stack_high_water(&self) -> u32 {
        let memory = &self.cpu.core().soc.memory;
        let Some(top) = memory.word(self.cpu.core().soc.vector_table()) else { return 0 };
        let bottom = self.stack_bottom(top);
        let Some(size) = top.checked_sub(bottom) else { return 0 };
        let mut stack = vec![0; size as usize];
        if memory.ram.read(bottom, &mut stack).is_none() {
            return 0;
        }
        let untouched = stack.iter().position(|&byte| byte != RAM_NOISE).unwrap_or(stack.len());
        self.stack_high_water.max(size - untouched as u32)
    }

    /// An image of all of flash.
    pub fn flash_image(&self) -> Vec<u8> {
        self.cpu.core().soc.memory.flash.to_vec()
    }

    /// Restores an image of flash, except where this machine's own firmware lies. Reset or power-cycle the machine
    /// afterwards, unless it has not run yet.
    ///
    /// # Errors
    /// [`MachineError::FlashSize`] if the image has another size.
    pub fn set_flash_image(&mut self, image: &[u8]) -> Result<(), MachineError> {
        let soc = &mut self.cpu.core_mut().soc;
        if image.len() != soc.memory.flash.size() {
            return Err(MachineError::FlashSize(image.len()));
        }
        soc.memory.flash.write(FLASH_BASE, image);
        program(soc, &self.image);
        self.cpu.code_changed().map_err(|error| MachineError::Emulator(format!("{error:?}")))
    }
}

fn program<B: Board>(soc: &mut Soc<B>, image: &Image) {
    for (address, bytes) in &image.segments {
        // `Image::parse` has checked that they fit.
        soc.memory.flash.write(*address, bytes);
    }
}
