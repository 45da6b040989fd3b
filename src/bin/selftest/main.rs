//! Self-test of a NUCLEO-F446RE without a rig: four jumper wires, and what the firmware needs of the chip (docs/selftest.md).
//! The same image runs on the emulated board in every test run and, by `cargo xtask selftest`, on a real one.
//!
//! Three runs with a reset between each: the first writes a record to flash and resets by software; the second reads it and
//! lets the watchdog bite, which also measures the LSI; the third looks at everything else and prints the table. A plain
//! image and not `embedded-test`: the two resets belong to the test, and the table is one for all checks.

#![no_std]
#![no_main]

mod can;
mod chip;
mod cycles;
mod kept;
mod pins;
mod record;
mod table;

#[expect(dead_code, reason = "clocks and interrupts are the firmware's; its tasks are not here")]
#[path = "../../board.rs"]
mod board;
#[path = "../../flash.rs"]
mod flash;
#[expect(dead_code, reason = "nothing is driven")]
#[path = "../../keep.rs"]
mod keep;
#[expect(dead_code, reason = "only table and rig are of interest here")]
#[path = "../../scene.rs"]
mod scene;
#[expect(dead_code, reason = "only its interrupt handlers are bound")]
#[path = "../../serial.rs"]
mod serial;
#[expect(dead_code, reason = "there are no tasks to share anything")]
#[path = "../../shared.rs"]
mod shared;
#[expect(dead_code, reason = "nothing is kept for the rig")]
#[path = "../../store.rs"]
mod store;

use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_time::{Instant, Timer};
use kept::Stage;
use table::{Table, line};

/// Longest wait for the watchdog's bite (µs). 4096 counts of LSI / 4 are 0.96 s at 17 kHz, the slowest of the datasheet.
const BITE_US: u64 = 3_000_000;
/// How often the time of the bite is written down (µs): 0.05 % of it.
const STEP_US: u64 = 200;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let flags = chip::reset_flags();
    let panicked = keep::begin(flags.power_on()).panic;
    let stage = kept::stage(flags);
    let p = embassy_stm32::init(board::clocks(board::find_clock()));
    chip::speed_up_flash(true);
    if let Some(text) = panicked {
        kept::forget();
        let mut table = Table::default();
        table.failed("the image", "no panic", format_args!("{text}"));
        table.print().await;
        return table.end().await;
    }
    if stage == Stage::Done {
        return third(p).await;
    }
    let mut store = store::Store::new(p.FLASH);
    if stage == Stage::Begin {
        line(format_args!("selftest 1 of 3: writes a record to flash, then resets by software")).await;
        kept::set(kept::Word::Flash, record::write(&mut store).await);
        kept::next(Stage::AfterSoftware);
        cortex_m::peripheral::SCB::sys_reset();
    }
    line(format_args!("selftest 2 of 3: reads it back, then waits for the watchdog's bite")).await;
    kept::set(kept::Word::SoftwareFlags, flags.0);
    kept::set(kept::Word::Flash, record::read(&mut store).await);
    kept::next(Stage::AfterWatchdog);
    chip::start_watchdog();
    let began = Instant::now();
    while began.elapsed().as_micros() < BITE_US {
        kept::set(kept::Word::BiteUs, began.elapsed().as_micros() as u32);
        Timer::after_micros(STEP_US).await;
    }
    // No bite: the third run has to be told.
    kept::next(Stage::Done);
    cortex_m::peripheral::SCB::sys_reset();
}

/// Everything that needs no reset, and the table.
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
    cycles::rows(&mut table, hclk_hz);
    kept::forget();
    table.print().await;
    table.end().await
}
