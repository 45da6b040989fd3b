//! The tool as a user calls it, one program for all tests that can run beside each other: those on the desktop, and those on the
//! emulated board with the real firmware. `serial.rs`, beside this folder, has a board in real time to itself.

mod common;

mod board_settings;
mod citations;
mod desktop;
mod doctor;
mod emulated;
mod export;
mod faults;
mod gdb;
mod hostile;
mod identify;
mod logs;
mod monitor;
mod new_rig;
mod plants;
#[cfg(target_os = "linux")]
mod ros2;
mod scenes;
mod selftest;
mod serve;
