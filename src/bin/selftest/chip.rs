//! Checks of the reset causes, the clocks and the watchdog by their registers.

use crate::registers::Flags;
use crate::retained::{self, Word};
use crate::table::{Table, Verdict};
use embassy_stm32::pac::iwdg::vals::Key;
use embassy_stm32::pac::rcc::vals::{Pllsrc, Sw};
use embassy_stm32::peripherals::RCC;
use embassy_stm32::{Peri, pac};

/// Range of the LSI (Hz): DS10693, LSI oscillator characteristics.
const LSI_HZ: core::ops::RangeInclusive<f32> = 17_000.0..=47_000.0;
/// Cycles of the LSI after which the watchdog resets, with its reset values: 4096 counts, prescaler 4 (RM0390 section
/// 20.4).
const WATCHDOG_CYCLES: f32 = 4096.0 * 4.0;
/// HCLK as the firmware sets it (src/board.rs).
const HCLK_HZ: u32 = 168_000_000;

/// Switches prefetch and instruction cache on or off.
pub fn speed_up_flash(on: bool) {
    pac::FLASH.acr().modify(|w| {
        w.set_prften(on);
        w.set_icen(on);
    });
}

/// Starts the watchdog with its reset values: it resets the board after [`WATCHDOG_CYCLES`] of the LSI.
pub fn start_watchdog() {
    pac::IWDG.kr().write(|w| w.set_key(Key::START));
}

/// Rows of the two resets that the test has caused, and of the LSI, measured by the second.
pub fn resets(table: &mut Table) {
    let software = Flags(retained::get(Word::SoftwareFlags));
    let good = software.software() && !software.watchdog();
    table.row("software reset", format_args!("flag SFT"), format_args!("flags {software}"), Verdict::of(good));

    let watchdog = Flags(retained::get(Word::WatchdogFlags));
    let wait_s = retained::get(Word::WatchdogUs) as f32 * 1e-6;
    let good = watchdog.watchdog() && !watchdog.software();
    if good {
        let seen = format_args!("flags {watchdog} after {wait_s:.3} s");
        table.row("watchdog", format_args!("resets the board; flag IWDG"), seen, Verdict::Ok);
    } else {
        table.failed(
            "watchdog",
            "resets the board; flag IWDG",
            format_args!("flags {watchdog}, {wait_s:.3} s after its start"),
        );
    }

    let lsi_hz = WATCHDOG_CYCLES / wait_s;
    let seen = format_args!("{:.1} kHz by the watchdog and TIM5", lsi_hz * 1e-3);
    let expected = format_args!("{:.0} to {:.0} kHz", LSI_HZ.start() * 1e-3, LSI_HZ.end() * 1e-3);
    table.row("LSI", expected, seen, Verdict::of(good && LSI_HZ.contains(&lsi_hz)));
}

/// Row of the core's clock; returns its frequency (Hz).
pub fn clocks(table: &mut Table, p: &Peri<'_, RCC>) -> u32 {
    let rcc = pac::RCC;
    let (cfgr, pll) = (rcc.cfgr().read(), rcc.pllcfgr().read());
    let hse = cfgr.sws() == Sw::PLL1_P && pll.pllsrc() == Pllsrc::HSE;
    let source = match (cfgr.sws(), pll.pllsrc()) {
        (Sw::PLL1_P, Pllsrc::HSE) => "PLL from HSE, the ST-LINK's 8 MHz",
        (Sw::PLL1_P, _) => "PLL from HSI: no clock from the ST-LINK",
        (Sw::HSE, _) => "HSE",
        _ => "HSI",
    };
    let hclk_hz = embassy_stm32::rcc::clocks(p).hclk1.to_hertz().map_or(0, |f| f.0);
    table.row(
        "clock",
        format_args!("{} MHz, PLL from HSE", HCLK_HZ / 1_000_000),
        format_args!("{} MHz, {source}", hclk_hz / 1_000_000),
        Verdict::of(hse && hclk_hz == HCLK_HZ),
    );
    hclk_hz
}
