//! Self-test of a NUCLEO-F446RE without a rig, with seven jumper wires: it checks what the firmware needs of the chip
//! (src/bin/selftest/README.md). The same image runs on the emulated board in every test run and, by `cargo xtask
//! selftest`, on a real one.
//!
//! It takes three runs with a reset after the first two: the first writes a record to flash and resets by software; the
//! second reads it and waits for the watchdog's reset, which also measures the LSI; the third checks everything else
//! and prints the table. It does not use `embedded-test`, because the two resets are part of the test and one table
//! shows all checks.

#![no_std]
#![no_main]

mod can;
mod chip;
mod cycles;
mod pins;
mod record;
mod registers;
mod retained;
mod table;

#[expect(dead_code, reason = "only clocks and interrupts are used")]
#[path = "../../board.rs"]
mod board;
#[path = "../../flash.rs"]
mod flash;
#[expect(dead_code, reason = "the self-test writes no record at rest")]
#[path = "../../flash_store.rs"]
mod flash_store;
#[path = "../../iwdg.rs"]
mod iwdg;
#[expect(dead_code, reason = "no drive is driven")]
#[path = "../../post_mortem.rs"]
mod post_mortem;
#[expect(dead_code, reason = "only the table and the rig's constants are used")]
#[path = "../../scene.rs"]
mod scene;
#[expect(dead_code, reason = "the transmitter to the host is not used")]
#[path = "../../serial.rs"]
mod serial;
#[expect(dead_code, reason = "there are no tasks; only the flash store uses it")]
#[path = "../../shared.rs"]
mod shared;

use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_time::{Instant, Timer};
use retained::{Stage, Word};
use table::{Table, line};

/// Longest wait for the watchdog's reset (µs). 4096 counts of LSI / 4 are 0.96 s at 17 kHz, the datasheet's lower
/// limit.
const WATCHDOG_US_MAX: u64 = 3_000_000;
/// Period at which the time is recorded while the test waits for the watchdog (µs): 0.05 % of the wait.
const STEP_US: u64 = 200;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let flags = registers::reset_flags();
    let panicked = post_mortem::start_record(flags.power_on()).panic;
    let stage = retained::stage(flags);
    let p = embassy_stm32::init(board::clocks(board::find_clock(true)));
    chip::speed_up_flash(true);
    if let Some(text) = panicked {
        retained::clear();
        let mut table = Table::default();
        table.failed("the image", "no panic", format_args!("{text}"));
        table.print().await;
        return table.end().await;
    }
    if stage == Stage::Done {
        return third(p).await;
    }
    let mut store = flash_store::Store::new(p.FLASH);
    if stage == Stage::Begin {
        line(format_args!("selftest 1 of 3: writes a record to flash, then resets by software")).await;
        retained::set(Word::Flash, record::write(&mut store).await);
        retained::set_next_stage(Stage::AfterSoftware);
        cortex_m::peripheral::SCB::sys_reset();
    }
    line(format_args!("selftest 2 of 3: reads the record, then waits for the watchdog's reset")).await;
    retained::set(Word::SoftwareFlags, flags.0);
    retained::set(Word::Flash, record::read(&mut store).await);
    retained::set_next_stage(Stage::AfterWatchdog);
    chip::start_watchdog();
    let began = Instant::now();
    while began.elapsed().as_micros() < WATCHDOG_US_MAX {
        retained::set(Word::WatchdogUs, began.elapsed().as_micros() as u32);
        Timer::after_micros(STEP_US).await;
    }
    // The watchdog has not reset the board; the third run reports it.
    retained::set_next_stage(Stage::Done);
    cortex_m::peripheral::SCB::sys_reset();
}

/// The checks that need no reset, and the table of all checks.
async fn third(mut p: embassy_stm32::Peripherals) {
    line(format_args!("selftest 3 of 3: everything else")).await;
    let mut table = Table::default();
    chip::resets(&mut table);
    record::row(&mut table);
    let hclk_hz = chip::clocks(&mut table, &p.RCC);
    can::row(&mut table, p.CAN1.reborrow(), p.PB8.reborrow(), p.PB9.reborrow()).await;
    pins::adc(&mut table, &mut p).await;
    pins::encoder(&mut table, &mut p);
    pins::serial(&mut table, &mut p).await;
    pins::safety(&mut table, &mut p);
    pins::can(&mut table, &mut p).await;
    cycles::rows(&mut table, hclk_hz);
    retained::clear();
    table.print().await;
    table.end().await
}
