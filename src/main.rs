//! Firmware of the load-adaptive twisted-string rig on a NUCLEO-F446RE.
//!
//! Only pins, clocks and tasks live here; everything that a desktop can test is in the crates. One thread-mode executor
//! runs five tasks: [`tasks::control`] (the tick), [`tasks::drive`] (CAN), [`tasks::lvdt`] (ADC and DMA),
//! [`tasks::link`] (host) and [`tasks::watchdog`], which feeds the dog only if all the others have been seen.

#![no_std]
#![no_main]

mod board;
mod scene;
mod shared;
mod tasks;

use defmt_rtt as _;
use embassy_executor::Spawner;
use panic_probe as _;

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let start = board::reset_cause();
    let board = board::Board::new(embassy_stm32::init(board::clocks()));
    defmt::info!(
        "tsa-firmware {} ({}), scene {:08x}, reset by {}, boot {}",
        env!("CARGO_PKG_VERSION"),
        env!("TSA_GIT"),
        scene::TABLE.metadata.scene_hash,
        start.cause,
        start.boot_count
    );
    let (link_tx, link_rx) = board.uart.split();
    // A task's arena is sized for the instances spawned here, once each: spawning cannot fail.
    spawner.spawn(defmt::unwrap!(tasks::lvdt::run(board.lvdt)));
    spawner.spawn(defmt::unwrap!(tasks::drive::run(board.can)));
    spawner.spawn(defmt::unwrap!(tasks::link::receive(link_rx, start)));
    spawner.spawn(defmt::unwrap!(tasks::link::send(link_tx)));
    spawner.spawn(defmt::unwrap!(tasks::control::run(board.encoder, board.estop, board.leds, start)));
    spawner.spawn(defmt::unwrap!(tasks::watchdog::run(board.watchdog)));
}
