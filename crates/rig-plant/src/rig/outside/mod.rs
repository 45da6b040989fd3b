//! Plants from outside, in place of the built-in one: somebody else's program or data. Motor, drive, encoder, LVDT and
//! board stay.
//!
//! - [`program`]: a program that answers one line a step, and [`programmed`]: the plant that it makes.
//! - [`measured`]: gaps measured over load and twist.

pub mod measured;
pub mod program;
pub mod programmed;

/// Where a plant comes from.
#[derive(Clone, Debug)]
pub enum Outside {
    /// A program and its arguments, separated by blanks.
    Program(String),
    /// Measured gaps.
    Measured(measured::Measured),
}

#[cfg(test)]
mod tests;
