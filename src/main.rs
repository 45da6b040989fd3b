//! Firmware of the load-adaptive twisted-string rig on a NUCLEO-F446RE.
//!
//! This package holds only pins, clocks and tasks; everything that a desktop can test is in the crates. An executor at
//! interrupt level runs five tasks: [`tasks::control`] (the tick), [`tasks::drive`] (CAN or UART), [`tasks::lvdt`] (ADC
//! and DMA), [`tasks::link`] (host) and [`tasks::watchdog`], which feeds the watchdog only while all the others run.
//! The executor in thread mode runs two more: [`tasks::table`] takes a table from the host, and
//! [`tasks::settings`] saves the settings.
//!
//! [`board`] sets up the hardware, [`serial`] sends bytes, [`shared`] holds what the tasks exchange, [`flash`] and
//! [`flash_store`] keep records without power, [`post_mortem`] what a run leaves for the next one, [`scene`] the table
//! and the constants that the build script makes from the scene file.

#![no_std]
#![no_main]

mod board;
mod flash;
mod flash_store;
mod iwdg;
mod post_mortem;
mod scene;
mod serial;
mod shared;
mod tasks;

use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, Spawner};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use rmds405::Transport;
use static_cell::StaticCell;

/// Runs every task that must not wait while flash is written.
static FOREGROUND: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
unsafe fn SPDIF_RX() {
    // SAFETY: only this handler calls it, and `start` enables the interrupt.
    unsafe { FOREGROUND.on_interrupt() }
}

#[embassy_executor::main]
async fn main(background: Spawner) {
    let start = board::start();
    let board = board::Board::new(embassy_stm32::init(board::clocks(start.clock)));
    defmt::info!(
        "tsa-firmware {} ({}), scene {:08x}, reset by {}, boot {}, clock {}",
        env!("CARGO_PKG_VERSION"),
        env!("TSA_GIT"),
        scene::TABLE.metadata.scene_hash,
        start.cause,
        start.boot_count,
        start.clock
    );
    if let Some(text) = &start.last_panic {
        defmt::error!("the previous run ended with: {}", text.as_str());
    }
    let mut store = board.store;
    tasks::table::load(&mut store).await;
    let generation = tasks::settings::load(&mut store).await;
    static STORE: StaticCell<flash_store::SharedStore> = StaticCell::new();
    let store = STORE.init(flash_store::SharedStore::new(store));
    // Any interrupt that nothing else uses. The peripherals' interrupts have a higher priority.
    interrupt::SPDIF_RX.set_priority(Priority::P6);
    let spawner = FOREGROUND.start(interrupt::SPDIF_RX);
    let (link_tx, link_rx) = board.uart.split();
    // Each task has room for one instance and is spawned once, so spawning cannot fail.
    spawner.spawn(defmt::unwrap!(tasks::lvdt::run(board.lvdt)));
    // The scene's transport is a constant, so the image holds only that one.
    match scene::DRIVE_TRANSPORT {
        Transport::Can => spawner.spawn(defmt::unwrap!(tasks::drive::over_can(board.drive.can(), board.motor_power))),
        Transport::Uart => {
            spawner.spawn(defmt::unwrap!(tasks::drive::over_uart(board.drive.uart(), board.motor_power)))
        }
    }
    spawner.spawn(defmt::unwrap!(tasks::link::receive(link_rx, start.clone())));
    spawner.spawn(defmt::unwrap!(tasks::link::send(serial::Transmitter::host(link_tx))));
    spawner.spawn(defmt::unwrap!(tasks::control::run(board.encoder, board.switches, board.leds, start)));
    spawner.spawn(defmt::unwrap!(tasks::watchdog::run(board.watchdog)));
    background.spawn(defmt::unwrap!(tasks::table::run(store)));
    background.spawn(defmt::unwrap!(tasks::settings::run(store, generation)));
}
