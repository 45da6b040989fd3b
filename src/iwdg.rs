//! The times of the independent watchdog.

use embassy_stm32::pac;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};

/// Time without feeding after which the watchdog resets the board (µs, nominal). The LSI of nominally 32 kHz has 17 to
/// 47 kHz, so the real time is 0.34 to 0.94 s; meanwhile the drive stops at its last target.
pub const TIMEOUT_US: u32 = 500_000;
/// The same time in counts of the watchdog, as embassy-stm32 sets them: 32 kHz divided by the smallest prescaler that
/// suffices, 4.
pub const RELOAD: u16 = 3999;

/// Sets prescaler and counts of the watchdog, and feeds it.
pub fn set_times(prescaler: Pr, counts: u16) {
    let iwdg = pac::IWDG;
    let wait = || while iwdg.sr().read().pvu() || iwdg.sr().read().rvu() {};
    wait();
    // No interrupt may come between: the watchdog task feeds the watchdog from interrupt level, which locks the
    // registers.
    cortex_m::interrupt::free(|_| {
        iwdg.kr().write(|w| w.set_key(Key::ENABLE));
        iwdg.pr().write(|w| w.set_pr(prescaler));
        iwdg.rlr().write(|w| w.set_rl(counts));
    });
    wait();
    iwdg.kr().write(|w| w.set_key(Key::RESET));
}
