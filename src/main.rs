//! Firmware of the load-adaptive twisted-string rig on a NUCLEO-F446RE.
//!
//! Only pins, clocks and tasks live here; everything that a desktop can test is in the crates. An executor at interrupt
//! level runs five tasks: [`tasks::control`] (the tick), [`tasks::drive`] (CAN or UART), [`tasks::lvdt`] (ADC and DMA),
//! [`tasks::link`] (host) and [`tasks::watchdog`], which feeds the dog only if all the others have been seen. Below them, in
//! thread mode, [`tasks::table`] solves equilibria for a table of the board's own and [`tasks::settings`] keeps settings.

#![no_std]
#![no_main]

mod board;
mod flash;
mod keep;
mod scene;
mod serial;
mod shared;
mod store;
mod tasks;

use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, Spawner};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use rmds405::Transport;
use static_cell::StaticCell;

/// Everything that must not wait for a table to be solved.
static FOREGROUND: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
unsafe fn SPDIF_RX() {
    // SAFETY: called from this handler alone, which is enabled by `start`.
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
        defmt::error!("the run before ended with: {}", text.as_str());
    }
    let mut store = board.store;
    if let Some(table) = tasks::table::kept(&mut store).await {
        shared::TABLE.set(table);
    }
    let generation = tasks::settings::kept(&mut store).await;
    static STORE: StaticCell<store::SharedStore> = StaticCell::new();
    let store = STORE.init(store::SharedStore::new(store));
    // Any interrupt that nothing else uses; the peripherals' own stay above it.
    interrupt::SPDIF_RX.set_priority(Priority::P6);
    let spawner = FOREGROUND.start(interrupt::SPDIF_RX);
    let (link_tx, link_rx) = board.uart.split();
    // A task's arena is sized for the instances spawned here, once each: spawning cannot fail.
    spawner.spawn(defmt::unwrap!(tasks::lvdt::run(board.lvdt)));
    // The scene's choice is a constant: the other one does not get into the image.
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
