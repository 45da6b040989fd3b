//! Feeds the independent watchdog, but only if every other task has been seen since the last time.

use crate::shared;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Ticker};

/// Twice within the shortest real time-out (0.34 s), and longer than any task's own period.
const PERIOD: Duration = Duration::from_millis(120);

#[embassy_executor::task]
pub async fn run(mut watchdog: IndependentWatchdog<'static, IWDG>) -> ! {
    // It has run since the first instruction ([`crate::board::start`]).
    watchdog.pet();
    let mut ticker = Ticker::every(PERIOD);
    loop {
        ticker.next().await;
        if shared::take_seen() == shared::ALL_TASKS {
            watchdog.pet();
        } else {
            defmt::error!("a task is missing: not feeding the watchdog");
        }
    }
}
