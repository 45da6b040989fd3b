//! The firmware's tasks, a file or a folder each.

pub mod control;
pub mod drive;
pub mod link;
pub mod lvdt;
pub mod settings;
pub mod table;
pub mod watchdog;
