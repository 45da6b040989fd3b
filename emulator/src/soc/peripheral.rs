//! What every peripheral is made of, registers, and what it can reach besides them, wires.

use super::clock::Clock;
use super::fault::Faults;
use super::gpio::Gpio;
use super::nvic::Nvic;
use rig_plant::board::Board;
use std::ops::{Index, IndexMut};

/// What a peripheral can reach besides its own registers.
pub struct Wires<'a> {
    /// Time.
    pub clock: &'a Clock,
    /// Interrupt lines.
    pub nvic: &'a mut Nvic,
    /// Pin functions.
    pub gpio: &'a Gpio,
    /// The board around the chip.
    pub board: &'a mut dyn Board,
    /// Where faults are reported.
    pub faults: &'a mut Faults,
}

/// A peripheral's registers by their offsets, and the value after a reset where it is not 0: a constant for each, and the
/// list `REGISTERS`.
macro_rules! registers {
    ($($name:ident = $offset:literal $(reset $reset:expr)?),+ $(,)?) => {
        $(const $name: u32 = $offset;)+
        const REGISTERS: &[(u32, u32)] = &[$(($name, [$($reset,)? 0][0])),+];
    };
}

pub(super) use registers;

/// Registers that hold what is written to them, each a word, by their offsets. A peripheral says itself what more a
/// register does.
#[derive(Clone, Copy, Debug)]
pub struct Registers<const N: usize> {
    words: [u32; N],
    /// Bit by word: whether there is a register.
    present: u64,
}

impl<const N: usize> Registers<N> {
    /// The registers at these offsets, with their reset values.
    pub fn new(registers: &[(u32, u32)]) -> Self {
        let mut new = Self { words: [0; N], present: 0 };
        for &(offset, reset) in registers {
            new.words[offset as usize / 4] = reset;
            new.present |= 1 << (offset / 4);
        }
        new
    }

    /// What a register holds; `None` where there is none.
    pub fn get(&self, offset: u32) -> Option<u32> {
        let there = offset < 4 * N as u32 && offset.is_multiple_of(4) && self.present >> (offset / 4) & 1 == 1;
        there.then(|| self[offset])
    }

    /// Stores a value; `None` where there is no register.
    pub fn set(&mut self, offset: u32, value: u32) -> Option<()> {
        self.get(offset)?;
        self[offset] = value;
        Some(())
    }
}

impl<const N: usize> Index<u32> for Registers<N> {
    type Output = u32;

    fn index(&self, offset: u32) -> &u32 {
        &self.words[offset as usize / 4]
    }
}

impl<const N: usize> IndexMut<u32> for Registers<N> {
    fn index_mut(&mut self, offset: u32) -> &mut u32 {
        &mut self.words[offset as usize / 4]
    }
}
