//! Address map (RM0390 table 1) and which RCC bits belong to which peripheral.

use super::rcc::{Gate, ahb1, apb1, apb2};
use super::{can, gpio, tim, usart};
use std::fmt;

/// A peripheral, with its index among its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Reset and clock control.
    Rcc,
    /// Power control.
    Pwr,
    /// Flash interface.
    Flash,
    /// GPIO port, 0 is A.
    Gpio(usize),
    /// External interrupts.
    Exti,
    /// System configuration.
    Syscfg,
    /// Independent watchdog.
    Iwdg,
    /// Index into [`tim::TIMERS`].
    Timer(usize),
    /// Index into [`usart::USARTS`].
    Usart(usize),
    /// CAN1.
    Can,
    /// ADC1 and the common registers.
    Adc,
    /// DMA controller, 0 is DMA1.
    Dma(usize),
    /// DBGMCU.
    Debug,
    /// Interrupt controller.
    Nvic,
    /// The rest of the core's registers.
    Core,
    /// Nothing modelled.
    None,
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Gpio(port) => write!(f, "GPIO{}", (b'A' + port as u8) as char),
            Self::Timer(i) => write!(f, "TIM{}", tim::TIMERS[i].number),
            Self::Usart(i) => write!(f, "USART{}", usart::USARTS[i].number),
            Self::Can => f.write_str("CAN1"),
            Self::Adc => f.write_str("ADC1"),
            Self::Dma(i) => write!(f, "DMA{}", i + 1),
            Self::Syscfg => f.write_str("SYSCFG"),
            Self::Pwr => f.write_str("PWR"),
            other => write!(f, "{other:?}"),
        }
    }
}

/// First register of the NVIC.
pub const NVIC: u32 = 0xE000_E100;

/// Peripherals that the RCC, and every reset of the chip, can reset.
pub fn resettable() -> impl Iterator<Item = Unit> {
    let timers = (0..tim::TIMERS.len()).map(Unit::Timer);
    let usarts = (0..usart::USARTS.len()).map(Unit::Usart);
    let others = [Unit::Can, Unit::Adc, Unit::Dma(0), Unit::Dma(1), Unit::Syscfg, Unit::Pwr];
    (0..gpio::PORTS).map(Unit::Gpio).chain(timers).chain(usarts).chain(others)
}

/// The peripheral at an address.
pub fn unit_at(address: u32) -> Unit {
    match address {
        0xE000_E100..=0xE000_E4FF => return Unit::Nvic,
        0xE000_1000..=0xE000_1FFF | 0xE000_E000..=0xE000_EFFF => return Unit::Core,
        _ => {}
    }
    match address & !0x3FF {
        0x4002_3800 => Unit::Rcc,
        0x4000_7000 => Unit::Pwr,
        0x4002_3C00 => Unit::Flash,
        base @ 0x4002_0000..=0x4002_1C00 => Unit::Gpio((base - 0x4002_0000) as usize / 0x400),
        0x4001_3C00 => Unit::Exti,
        0x4001_3800 => Unit::Syscfg,
        0x4000_3000 => Unit::Iwdg,
        can::BASE => Unit::Can,
        0x4001_2000 => Unit::Adc,
        0x4002_6000 => Unit::Dma(0),
        0x4002_6400 => Unit::Dma(1),
        0xE004_2000 => Unit::Debug,
        base => {
            let timer = tim::TIMERS.iter().position(|kind| kind.base == base).map(Unit::Timer);
            let usart = || usart::USARTS.iter().position(|kind| kind.base == base).map(Unit::Usart);
            timer.or_else(usart).unwrap_or(Unit::None)
        }
    }
}

/// The name of what is at an address, modelled or not (RM0390 table 1).
pub fn name(address: u32) -> String {
    let name = match address & !0x3FF {
        0x4000_1C00 => "TIM13",
        0x4000_2000 => "TIM14",
        0x4000_2800 => "RTC",
        0x4000_2C00 => "WWDG",
        0x4000_3800 => "SPI2",
        0x4000_3C00 => "SPI3",
        0x4000_4000 => "SPDIF-RX",
        0x4000_4C00 => "UART4",
        0x4000_5000 => "UART5",
        0x4000_5400 => "I2C1",
        0x4000_5800 => "I2C2",
        0x4000_5C00 => "I2C3",
        0x4000_6000 => "FMPI2C1",
        0x4000_6800 => "CAN2",
        0x4000_6C00 => "CEC",
        0x4000_7400 => "DAC",
        0x4001_0000 => "TIM1",
        0x4001_0400 => "TIM8",
        0x4001_2000 if address & 0x300 == 0x100 => "ADC2",
        0x4001_2000 if address & 0x300 == 0x200 => "ADC3",
        0x4001_2C00 => "SDIO",
        0x4001_3000 => "SPI1",
        0x4001_3400 => "SPI4",
        0x4001_4400 => "TIM10",
        0x4001_4800 => "TIM11",
        0x4001_5800 => "SAI1",
        0x4001_5C00 => "SAI2",
        0x4002_3000 => "CRC",
        0x4004_0000..=0x4007_FFFF => "USB OTG HS",
        0x5000_0000..=0x5003_FFFF => "USB OTG FS",
        0x5005_0000 => "DCMI",
        _ => match unit_at(address) {
            Unit::None => "no peripheral",
            unit => return unit.to_string(),
        },
    };
    name.to_owned()
}

/// The RCC bits of a peripheral, if it has any.
pub fn gate(unit: Unit) -> Option<Gate> {
    Some(match unit {
        Unit::Gpio(port) => ahb1(port as u8),
        Unit::Dma(i) => ahb1(21 + i as u8),
        Unit::Timer(i) => tim::TIMERS[i].gate,
        Unit::Usart(i) => usart::USARTS[i].gate,
        Unit::Can => can::GATE,
        Unit::Adc => apb2(8),
        Unit::Syscfg => apb2(14),
        Unit::Pwr => apb1(28),
        _ => return None,
    })
}

/// What an address in the bit-band alias of SRAM or of the peripherals stands for: a word and a bit in it (PM0214
/// section 2.2.5).
pub fn bit_band(address: u32) -> Option<(u32, u32)> {
    let base = match address {
        0x2200_0000..=0x23FF_FFFF => 0x2000_0000,
        0x4200_0000..=0x43FF_FFFF => 0x4000_0000,
        _ => return None,
    };
    let bit = (address & 0x1FF_FFFF) / 4;
    Some((base + bit / 32 * 4, bit % 32))
}

/// Registers that may be written in bytes or halfwords, by the manual's chapter of each peripheral: GPIO, RCC and the
/// flash interface in both, but FLASH_KEYR and FLASH_OPTKEYR in words alone; 16-bit peripherals and priorities.
pub fn takes_narrow_writes(unit: Unit, address: u32, size: usize) -> bool {
    match unit {
        Unit::Timer(_) | Unit::Usart(_) => address & 3 == 0,
        Unit::Pwr | Unit::Iwdg => address & 3 == 0 && size == 2,
        Unit::Nvic | Unit::Rcc | Unit::Gpio(_) => true,
        Unit::Flash => !matches!(address & 0x3FC, 0x04 | 0x08),
        Unit::Core => (0xE000_ED18..0xE000_ED24).contains(&address),
        _ => false,
    }
}

/// A narrow write leaves the other bytes of the register as they are.
pub fn has_byte_lanes(unit: Unit) -> bool {
    matches!(unit, Unit::Rcc | Unit::Flash | Unit::Gpio(_))
}

/// A register whose bits act when 1 is written: FLASH_SR, and GPIO's BSRR.
pub fn acts_on_ones(unit: Unit, word: u32) -> bool {
    matches!((unit, word & 0x3FF), (Unit::Flash, 0x0C) | (Unit::Gpio(_), 0x18))
}
