//! What real rigs have and the ideal one has not. Each effect is a state of its own with one step function, and is switched
//! off by a size of zero.
//!
//! - [`strings`]: the strings with all that is theirs.
//! - [`play`]: play between motor and strings.
//! - [`rods`]: stress of the rods beyond their law, as a force on the load.
//! - [`memory`]: rods that remember a heavy load.
//! - [`creep`]: strings that go on stretching under a load.
//! - [`bedding`]: strings that become thinner over their first cycles.
//! - [`stribeck`]: friction of the rail that sticks, gives a little, and slips.
//! - [`current`]: the drive's reading of the motor's current.
//! - [`drift`]: noise of the LVDT that averaging over a block does not remove.
//!
//! None of them creates energy: tests go round closed cycles and count.

pub mod bedding;
pub mod creep;
pub mod current;
pub mod drift;
pub mod memory;
pub mod play;
pub mod rods;
pub mod stribeck;
pub mod strings;

#[cfg(test)]
mod tests;
