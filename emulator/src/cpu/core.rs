//! The state that the hooks in unicorn share with the run loop: the chip, the counters, and why the CPU was stopped.
//!
//! A hook is called from C and must not unwind: it records here what happened and stops the CPU.

use super::blocks::{Block, Blocks};
use super::stops::Stops;
use super::timing::TAKEN_BRANCH_CYCLES;
use super::watch::Watches;
use crate::soc::Soc;
use rig_plant::board::Board;
use unicorn_engine::{RegisterARM as R, Unicorn, uc_error};

/// Why the core cannot go on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Halt {
    /// An access to an address that nothing is mapped to.
    Memory {
        /// What was tried.
        what: &'static str,
        /// Where.
        address: u32,
        /// Instruction.
        pc: u32,
    },
    /// The stack has run past the bottom of RAM: a bus fault at this address.
    StackOverflow(u32),
    /// A BKPT instruction at this address.
    Breakpoint(u32),
    /// An exception of the emulator that no firmware should cause.
    Exception(u32),
    /// Undefined instruction at this address: on the chip a HardFault. `panic-probe` ends like this.
    Undefined(u32),
    /// A strict peripheral has raised a fault, which waits in the chip. The address is that of the instruction.
    Fault(u32),
    /// unicorn itself failed.
    Unicorn(uc_error),
}

impl From<uc_error> for Halt {
    fn from(error: uc_error) -> Self {
        Self::Unicorn(error)
    }
}

/// Counters of the core.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counters {
    /// Instructions executed.
    pub instructions: u64,
    /// Translation blocks executed.
    pub blocks: u64,
    /// Exceptions taken.
    pub exceptions: u64,
    /// Cycles asleep in WFI or WFE.
    pub asleep: u64,
}

/// State behind the hooks.
pub struct Core<B> {
    /// The chip.
    pub soc: Soc<B>,
    /// Counters.
    pub counters: Counters,
    /// Watched functions.
    pub watches: Watches,
    pub(crate) blocks: Blocks,
    /// The run ends at this cycle.
    pub(super) limit: u64,
    /// The next event or the limit: until then the block hook only counts.
    pub(super) deadline: u64,
    /// Something may have become takeable.
    pub(super) attention: bool,
    /// An exception return was executed.
    pub(super) exception_return: bool,
    /// A hook has stopped the CPU.
    pub(super) stopped: bool,
    pub(super) halt: Option<Halt>,
    /// Start of the block that ran last: the best estimate of PC within a hook.
    pub(crate) block: u32,
    /// End of that block.
    pub(super) block_end: u32,
    /// Where the core goes on without a branch.
    pub(super) next: u32,
    /// Instruction that made the access a fault was raised for.
    pub(super) fault_pc: Option<u32>,
    /// Where a debugger stops the core.
    pub(super) stops: Stops,
}

impl<B: Board> Core<B> {
    /// State at power-up.
    pub fn new(soc: Soc<B>) -> Self {
        Self {
            soc,
            counters: Counters::default(),
            watches: Watches::default(),
            blocks: Blocks::new(),
            limit: 0,
            deadline: 0,
            attention: true,
            exception_return: false,
            stopped: false,
            halt: None,
            block: 0,
            block_end: 0,
            next: 0,
            fault_pc: None,
            stops: Stops::default(),
        }
    }

    /// Count a block that is about to run, and the branch that has led to it.
    pub(super) fn count(&mut self, address: u32, bytes: u32) -> Block {
        let watches = &self.watches;
        let cost = self.blocks.look_up(address, bytes, &self.soc.memory.flash, |address| watches.starts_at(address));
        let branch = if address == self.next { 0 } else { TAKEN_BRANCH_CYCLES };
        self.block = address;
        self.block_end = address.wrapping_add(bytes);
        self.next = self.block_end;
        self.counters.blocks += 1;
        self.counters.instructions += u64::from(cost.instructions);
        let waits = self.soc.fetch_cycles(address, bytes);
        self.soc.clock.advance(u64::from(cost.cycles) + branch + waits);
        cost
    }
}

/// The exception that the core would take now, masks considered.
pub fn takeable<B: Board>(uc: &Unicorn<'_, Core<B>>) -> Option<u16> {
    let nvic = &uc.get_data().soc.nvic;
    let (exception, priority) = nvic.best()?;
    if priority >= nvic.running_priority() {
        return None;
    }
    let mask = |register| uc.reg_read(register).unwrap_or(0) as i32;
    if (priority >= 0 && mask(R::PRIMASK) & 1 == 1) || (priority >= -1 && mask(R::FAULTMASK) & 1 == 1) {
        return None;
    }
    let base = mask(R::BASEPRI);
    (base == 0 || priority < base).then_some(exception)
}
