//! The machine as `gdbstub` wants it: registers, memory, breakpoints, steps.

use crate::cpu::debug::{PC, Registers};
use crate::machine::Machine;
use gdbstub::arch::Arch;
use gdbstub::common::Signal;
use gdbstub::target::ext::base::BaseOps;
use gdbstub::target::ext::base::singlethread::{
    SingleThreadBase, SingleThreadResume, SingleThreadResumeOps, SingleThreadSingleStep, SingleThreadSingleStepOps,
};
use gdbstub::target::ext::breakpoints::{
    Breakpoints, BreakpointsOps, HwBreakpoint, HwBreakpointOps, SwBreakpoint, SwBreakpointOps,
};
use gdbstub::target::{Target, TargetError, TargetResult};
use rig_plant::board::Board;
use unicorn_engine::uc_error;

/// A Cortex-M4 with its FPU.
pub enum CortexM4 {}

impl Arch for CortexM4 {
    type Usize = u32;
    type Registers = Registers;
    type BreakpointKind = usize;
    type RegId = ();

    fn target_description_xml() -> Option<&'static str> {
        Some(include_str!("cortex-m4f.xml"))
    }
}

/// Bytes of all registers in the order of the description.
const ALL: usize = 4 * 17 + 8 * 16 + 4;

impl gdbstub::arch::Registers for Registers {
    type ProgramCounter = u32;

    fn pc(&self) -> u32 {
        self.core[PC]
    }

    fn gdb_serialize(&self, mut write_byte: impl FnMut(Option<u8>)) {
        let words = self.core.iter().chain([&self.xpsr]).flat_map(|word| word.to_le_bytes());
        let doubles = self.double.iter().flat_map(|double| double.to_le_bytes());
        words.chain(doubles).chain(self.fpscr.to_le_bytes()).for_each(|byte| write_byte(Some(byte)));
    }

    fn gdb_deserialize(&mut self, bytes: &[u8]) -> Result<(), ()> {
        let bytes: &[u8; ALL] = bytes.try_into().map_err(|_| ())?;
        let (words, rest) = bytes.split_at(4 * 17);
        let (doubles, fpscr) = rest.split_at(8 * 16);
        let mut words = words.as_chunks().0.iter().copied().map(u32::from_le_bytes);
        self.core = std::array::from_fn(|_| words.next().unwrap_or_default());
        self.xpsr = words.next().unwrap_or_default();
        for (double, chunk) in self.double.iter_mut().zip(doubles.as_chunks().0) {
            *double = u64::from_le_bytes(*chunk);
        }
        self.fpscr = u32::from_le_bytes(fpscr.try_into().map_err(|_| ())?);
        Ok(())
    }
}

impl<B: Board + 'static> Target for Machine<B> {
    type Arch = CortexM4;
    type Error = uc_error;

    fn base_ops(&mut self) -> BaseOps<'_, CortexM4, uc_error> {
        BaseOps::SingleThread(self)
    }

    fn support_breakpoints(&mut self) -> Option<BreakpointsOps<'_, Self>> {
        Some(self)
    }
}

impl<B: Board + 'static> SingleThreadBase for Machine<B> {
    fn read_registers(&mut self, registers: &mut Registers) -> TargetResult<(), Self> {
        *registers = self.cpu_mut().registers();
        Ok(())
    }

    fn write_registers(&mut self, registers: &Registers) -> TargetResult<(), Self> {
        self.cpu_mut().set_registers(registers).map_err(TargetError::Fatal)
    }

    fn read_addrs(&mut self, address: u32, into: &mut [u8]) -> TargetResult<usize, Self> {
        self.cpu_mut().look(address, into).map(|()| into.len()).ok_or(TargetError::NonFatal)
    }

    fn write_addrs(&mut self, address: u32, from: &[u8]) -> TargetResult<(), Self> {
        self.cpu_mut().poke(address, from).ok_or(TargetError::NonFatal)
    }

    fn support_resume(&mut self) -> Option<SingleThreadResumeOps<'_, Self>> {
        Some(self)
    }
}

impl<B: Board + 'static> SingleThreadResume for Machine<B> {
    fn resume(&mut self, _: Option<Signal>) -> Result<(), uc_error> {
        self.cpu_mut().resume(false)
    }

    fn support_single_step(&mut self) -> Option<SingleThreadSingleStepOps<'_, Self>> {
        Some(self)
    }
}

impl<B: Board + 'static> SingleThreadSingleStep for Machine<B> {
    fn step(&mut self, _: Option<Signal>) -> Result<(), uc_error> {
        self.cpu_mut().resume(true)
    }
}

impl<B: Board + 'static> Breakpoints for Machine<B> {
    fn support_sw_breakpoint(&mut self) -> Option<SwBreakpointOps<'_, Self>> {
        Some(self)
    }

    fn support_hw_breakpoint(&mut self) -> Option<HwBreakpointOps<'_, Self>> {
        Some(self)
    }
}

impl<B: Board + 'static> SwBreakpoint for Machine<B> {
    fn add_sw_breakpoint(&mut self, address: u32, _: usize) -> TargetResult<bool, Self> {
        let place = self.stop_for(address & !1);
        self.cpu_mut().break_at(place).map(|()| true).map_err(TargetError::Fatal)
    }

    fn remove_sw_breakpoint(&mut self, address: u32, _: usize) -> TargetResult<bool, Self> {
        let place = self.stop_for(address & !1);
        self.cpu_mut().unbreak(place).map_err(TargetError::Fatal)
    }
}

/// Both kinds are the same here: nothing is written into flash, and their number is not limited.
impl<B: Board + 'static> HwBreakpoint for Machine<B> {
    fn add_hw_breakpoint(&mut self, address: u32, kind: usize) -> TargetResult<bool, Self> {
        self.add_sw_breakpoint(address, kind)
    }

    fn remove_hw_breakpoint(&mut self, address: u32, kind: usize) -> TargetResult<bool, Self> {
        self.remove_sw_breakpoint(address, kind)
    }
}

impl<B: Board + 'static> Machine<B> {
    /// Where the core can be stopped for an instruction: at the IT of its block, if it is in one.
    fn stop_for(&mut self, address: u32) -> u32 {
        let Some(mut at) = self.image().start_of_function_at(address) else { return address };
        let half = |machine: &mut Self, at: u32| machine.soc_mut().memory.half(at).unwrap_or(0);
        // Instructions left of an IT block, and where that began.
        let (mut left, mut begun) = (0, address);
        while at < address {
            let code = half(self, at);
            if left > 0 {
                left -= 1;
            } else if code & 0xFF00 == 0xBF00 && code & 0xF != 0 {
                // The lowest bit that is set ends the mask of one to four instructions.
                (left, begun) = (4 - (code & 0xF).trailing_zeros(), at);
            }
            at += if code >> 11 >= 0x1D { 4 } else { 2 };
        }
        if left > 0 { begun } else { address }
    }
}
