//! An emulated NUCLEO-F446RE with the actuator's rig around it.
//!
//! - [`machine`]: boots an ELF and runs it against a [`rig_plant::board::Board`] in emulated time.
//! - [`cpu`]: Cortex-M4F exceptions, sleep and time around the unicorn CPU.
//! - [`soc`]: the STM32F446's peripherals, a module each, strict about clocks, pins and channels.
//! - [`rtt`]: decoded defmt output.
//! - [`jumpers`]: a board without a rig, for the self-test.
//! - [`flash_file`]: the board's flash in a file.
//! - [`gdb`]: a debugger on the running firmware.
//! - [`serve`]: all of it as a process, for a host tool.

pub mod cpu;
pub mod flash_file;
pub mod gdb;
pub mod jumpers;
pub mod machine;
pub mod rtt;
pub mod serve;
pub mod soc;
