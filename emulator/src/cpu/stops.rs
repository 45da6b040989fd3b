//! State of a debugger's stops. Time is counted by blocks, at their start, so a core that has stopped in the middle of
//! one must not count the rest of it again.

use std::collections::BTreeMap;
use unicorn_engine::UcHookId;

/// Hooks in unicorn.
#[derive(Default)]
pub(super) struct Breakpoints {
    pub(super) at: BTreeMap<u32, UcHookId>,
    /// On every instruction, while the core is stepped.
    pub(super) step: Option<UcHookId>,
}

/// Where a debugger wants the core to stop, and where it has stopped it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stops {
    /// Next address and end of a block that the core was stopped in.
    pub(super) rest: Option<(u32, u32)>,
    /// A breakpoint at this address is ignored once: the core has stopped at it already.
    pub(super) passed: Option<u32>,
    pub(super) step: Step,
    /// A hook has asked for a stop before this instruction.
    pub(super) wanted: Option<u32>,
}

/// How far a step has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Step {
    /// The core runs on.
    #[default]
    Off,
    /// The next instruction runs.
    First,
    /// The one after it does not.
    Then,
}

impl Stops {
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

    /// unicorn has returned with PC at `pc`, in a block with this end. Says whether it stopped for the debugger.
    pub(super) fn stopped_at(&mut self, pc: u32, block_end: u32) -> bool {
        // A stop inside an IT block was asked for and not granted.
        let stopped = self.wanted.take() == Some(pc);
        if stopped {
            self.rest = Some((pc, block_end));
            self.step = Step::Off;
        }
        stopped
    }

    /// PC has been changed from outside, so the core no longer stands in the block.
    pub(super) fn forget_place(&mut self) {
        *self = Self { step: self.step, ..Self::default() };
    }
}
