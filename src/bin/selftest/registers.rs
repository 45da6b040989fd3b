//! What single registers of the chip hold: the causes of the last reset, and which chip it is.

use core::fmt;
use embassy_stm32::pac;
use embassy_stm32::pac::rcc::regs::Csr;

/// The reset flags of the clock-control register (RCC_CSR).
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

/// Reads the reset flags and clears them for the next reset. Call it once.
pub fn reset_flags() -> Flags {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    Flags(flags.0)
}

/// Device and revision (DBGMCU_IDCODE); the device of an STM32F446 is 0x421.
pub fn device() -> (u16, u16) {
    let code = pac::DBGMCU.idcode().read();
    (code.dev_id(), code.rev_id())
}

/// Whether the board is emulated, by its unique id. Used for labels only.
pub fn emulated() -> bool {
    embassy_stm32::uid::uid() == *b"emulated-rig"
}
