//! Long runs on the emulated board: random moves under random loads with incidents between them, and random bytes at both
//! doors. What is looked for is what only time shows: drift, missed ticks, a stack that grows, a message lost.

mod incident;
mod moves;
mod noise;

pub use incident::Incident;
pub use moves::{Endurance, Miss, moves};
pub use noise::{Noise, noise};
