//! What each command does, a file each.

pub mod budget;
pub mod chart;
pub mod closed_loop;
mod figure;
pub mod published;
pub mod report;
pub mod solve;
pub mod study;
pub mod table;
