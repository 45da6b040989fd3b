//! What each command does, a file each.

pub mod budget;
pub mod chart;
mod figure;
pub mod published;
pub mod report;
pub mod solve;
pub mod study;
pub mod table;
