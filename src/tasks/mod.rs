//! The firmware's tasks.

pub mod control;
pub mod drive;
pub mod link;
pub mod lvdt;
pub mod settings;
pub mod table;
pub mod watchdog;
