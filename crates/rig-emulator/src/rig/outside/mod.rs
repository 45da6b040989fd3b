//! Mechanisms from outside, in place of the built-in one: somebody else's program or data. Motor, drive, encoder, LVDT and
//! board stay.
//!
//! - [`program`]: a program that answers one line a step.
//! - [`measured`]: gaps measured over load and twist.

pub mod measured;
pub mod program;
