//! Feeds the independent watchdog, but only if every supervised task has reported since the last time.

use crate::shared;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Ticker};

/// Two periods fit into the shortest real time-out (0.34 s), and one is longer than any task's own period.
const PERIOD: Duration = Duration::from_millis(120);

#[embassy_executor::task]
pub async fn run(mut watchdog: IndependentWatchdog<'static, IWDG>) -> ! {
    // The watchdog has run since the first instruction ([`crate::board::start`]).
    watchdog.pet();
    let mut ticker = Ticker::every(PERIOD);
    loop {
        ticker.next().await;
        if shared::take_alive() == shared::ALL_TASKS {
            watchdog.pet();
        } else {
            defmt::error!("a task does not report: the watchdog is not fed");
        }
    }
}
