//! What real rigs have and the ideal one has not. Each effect is a state of its own with one step function, and is switched
//! off by a size of zero.
//!
//! - [`play`]: play between motor and strings.
//! - [`memory`]: rods that remember a heavy load.
//! - [`creep`]: strings that go on stretching under a load.
//! - [`bedding`]: strings that become thinner over their first cycles.
//! - [`stribeck`]: friction of the rail that sticks, gives a little, and slips.
//! - [`current`]: the drive's reading of the motor's current.
//! - [`drift`]: noise of the LVDT that averaging over a block does not remove.
//!
//! None of them creates energy: their tests go round closed cycles and count.

pub mod bedding;
pub mod creep;
pub mod current;
pub mod drift;
pub mod memory;
pub mod play;
pub mod stribeck;
