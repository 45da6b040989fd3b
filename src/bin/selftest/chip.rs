//! Reset causes, clocks and watchdog, by the registers.

use crate::kept::{self, Word};
use crate::table::{Table, Verdict};
use core::fmt;
use embassy_stm32::pac::iwdg::vals::Key;
use embassy_stm32::pac::rcc::regs::Csr;
use embassy_stm32::pac::rcc::vals::{Pllsrc, Sw};
use embassy_stm32::peripherals::RCC;
use embassy_stm32::{Peri, pac};

/// The LSI by the datasheet (Hz): DS10693, LSI oscillator characteristics.
const LSI_HZ: core::ops::RangeInclusive<f32> = 17_000.0..=47_000.0;
/// What the watchdog counts from reset: 4096 times its least prescaler, 4 (RM0390 section 20.4).
const BITE_CYCLES: f32 = 4096.0 * 4.0;
/// HCLK as the firmware sets it (src/board.rs).
const HCLK_HZ: u32 = 168_000_000;

/// What the clock-control register said of the last reset.
#[derive(Clone, Copy)]
pub struct Flags(pub u32);

impl Flags {
    fn csr(self) -> Csr {
        Csr(self.0)
    }

    pub fn power_on(self) -> bool {
        self.csr().porrstf()
    }

    pub fn software(self) -> bool {
        self.csr().sftrstf()
    }

    pub fn watchdog(self) -> bool {
        self.csr().wdgrstf()
    }
}

impl fmt::Display for Flags {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let csr = self.csr();
        let flags = [
            (csr.lpwrrstf(), "LPWR"),
            (csr.wwdgrstf(), "WWDG"),
            (csr.wdgrstf(), "IWDG"),
            (csr.sftrstf(), "SFT"),
            (csr.porrstf(), "POR"),
            (csr.padrstf(), "PIN"),
            (csr.borrstf(), "BOR"),
        ];
        let mut comma = "";
        for (_, name) in flags.iter().filter(|(set, _)| *set) {
            write!(f, "{comma}{name}")?;
            comma = ", ";
        }
        if comma.is_empty() { f.write_str("none") } else { Ok(()) }
    }
}

/// Reads the reset flags and clears them for the next time. Call once.
pub fn reset_flags() -> Flags {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    Flags(flags.0)
}

/// Prefetch and instruction cache.
pub fn speed_up_flash(on: bool) {
    pac::FLASH.acr().modify(|w| {
        w.set_prften(on);
        w.set_icen(on);
    });
}

/// Starts the watchdog as the reset left it: it bites after [`BITE_CYCLES`] of the LSI.
pub fn start_watchdog() {
    pac::IWDG.kr().write(|w| w.set_key(Key::START));
}

/// Device and revision (DBGMCU_IDCODE); an STM32F446 is 0x421.
pub fn device() -> (u16, u16) {
    let code = pac::DBGMCU.idcode().read();
    (code.dev_id(), code.rev_id())
}

/// The emulated board says so itself. For the label only.
pub fn emulated() -> bool {
    embassy_stm32::uid::uid() == *b"emulated-rig"
}

/// The two resets that the test has made, and the LSI by the second.
pub fn resets(table: &mut Table) {
    let software = Flags(kept::get(Word::SoftwareFlags));
    let good = software.software() && !software.watchdog();
    table.row("software reset", format_args!("flag SFT"), format_args!("flags {software}"), Verdict::of(good));

    let bite = Flags(kept::get(Word::WatchdogFlags));
    let bite_s = kept::get(Word::BiteUs) as f32 * 1e-6;
    let good = bite.watchdog() && !bite.software();
    if good {
        let seen = format_args!("flags {bite} after {bite_s:.3} s");
        table.row("watchdog", format_args!("bites; flag IWDG"), seen, Verdict::Ok);
    } else {
        table.failed("watchdog", "bites; flag IWDG", format_args!("flags {bite}, {bite_s:.3} s after its start"));
    }

    let lsi_hz = BITE_CYCLES / bite_s;
    let seen = format_args!("{:.1} kHz by the watchdog's bite and TIM5", lsi_hz * 1e-3);
    let expected = format_args!("{:.0} to {:.0} kHz", LSI_HZ.start() * 1e-3, LSI_HZ.end() * 1e-3);
    table.row("LSI", expected, seen, Verdict::of(good && LSI_HZ.contains(&lsi_hz)));
}

/// Which clock the core runs on; its frequency (Hz).
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
