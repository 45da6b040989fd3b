//! System control block, SysTick and DWT cycle counter (PM0214 chapter 4, ARMv7-M architecture manual C1.8).

use super::clock::{Clock, NEVER};
use super::nvic::{Nvic, exception};
use super::peripheral::Registers;

/// CPUID of the Cortex-M4 r0p1.
const CPUID: u32 = 0x410F_C241;
/// FPCCR with ASPEN and LSPEN, their reset value. The emulator stacks eagerly, which firmware cannot observe.
const FPCCR: u32 = 0xC000_0000;

/// Start of the system control block, and offsets in it.
const BLOCK: u32 = 0xE000_ED00;
const VTOR: u32 = 0x08;
const SCR: u32 = 0x10;
const CCR: u32 = 0x14;
const SHCSR: u32 = 0x24;
const CFSR: u32 = 0x28;
const HFSR: u32 = 0x2C;
const DFSR: u32 = 0x30;
const MMFAR: u32 = 0x34;
const BFAR: u32 = 0x38;
const CPACR: u32 = 0x88;

/// Registers of the core other than the NVIC.
#[derive(Debug)]
pub struct Scb {
    registers: Registers<36>,
    demcr: u32,
    systick: SysTick,
    cycles: CycleCounter,
}

impl Default for Scb {
    fn default() -> Self {
        let present = [VTOR, SCR, CCR, SHCSR, CFSR, HFSR, DFSR, MMFAR, BFAR, CPACR].map(|offset| (offset, 0));
        let registers = Registers::new(&present);
        Self { registers, demcr: 0, systick: SysTick::default(), cycles: CycleCounter::default() }
    }
}

/// DEMCR.TRCENA: DWT and ITM are on.
const TRCENA: u32 = 1 << 24;
const CYCCNTENA: u32 = 1;

/// DWT's cycle counter. It counts only while DEMCR.TRCENA and DWT_CTRL.CYCCNTENA are set (ARMv7-M architecture manual
/// C1.8.1).
#[derive(Debug, Default)]
struct CycleCounter {
    control: u32,
    running: bool,
    /// The count while it stands still; while it runs, what is to be added to the time.
    offset: u64,
}

impl CycleCounter {
    fn count(&self, now: u64) -> u32 {
        (if self.running { now.wrapping_add(self.offset) } else { self.offset }) as u32
    }

    fn set(&mut self, count: u32, now: u64) {
        self.offset = u64::from(count).wrapping_sub(if self.running { now } else { 0 });
    }

    fn run(&mut self, demcr: u32, now: u64) {
        let count = self.count(now);
        self.running = demcr & TRCENA != 0 && self.control & CYCCNTENA != 0;
        self.set(count, now);
    }
}

#[derive(Debug, Default)]
struct SysTick {
    control: u32,
    reload: u32,
    /// Cycle at which the counter last held its reload value.
    start: u64,
    wrapped: bool,
}

impl SysTick {
    /// Cycles between wraps: the reference clock is HCLK/8.
    fn period(&self) -> u64 {
        (u64::from(self.reload) + 1) * self.divider()
    }

    fn divider(&self) -> u64 {
        if self.control & 4 == 0 { 8 } else { 1 }
    }

    fn sync(&mut self, now: u64, nvic: &mut Nvic) {
        if self.control & 1 == 0 || self.reload == 0 {
            return;
        }
        let wraps = now.saturating_sub(self.start) / self.period();
        if wraps > 0 {
            self.start += wraps * self.period();
            self.wrapped = true;
            if self.control & 2 != 0 {
                nvic.pend_system(exception::SYSTICK);
            }
        }
    }
}

impl Scb {
    /// Address of the vector table. 0 is the alias of flash from which the chip boots.
    pub fn vector_table(&self) -> u32 {
        if self.registers[VTOR] == 0 { super::memory::FLASH_BASE } else { self.registers[VTOR] }
    }

    /// A bus fault at `address`, taken as a HardFault because BusFaults have their own handler neither here nor, by
    /// default, on the chip. `stacking`: it came up while an exception was entered.
    pub fn bus_fault(&mut self, address: u32, stacking: bool) {
        /// CFSR: PRECISERR and BFARVALID; STKERR. HFSR: FORCED.
        const PRECISE: u32 = 1 << 9 | 1 << 15;
        const STACKING: u32 = 1 << 12;
        const FORCED: u32 = 1 << 30;
        self.registers[CFSR] |= if stacking { STACKING } else { PRECISE };
        self.registers[HFSR] |= FORCED;
        if !stacking {
            self.registers[BFAR] = address;
        }
    }

    /// The next SysTick interrupt.
    pub fn next_event(&self) -> u64 {
        let tick = &self.systick;
        if tick.control & 3 == 3 && tick.reload != 0 { tick.start + tick.period() } else { NEVER }
    }

    /// Catch up with the SysTick at `now`.
    pub fn sync(&mut self, now: u64, nvic: &mut Nvic) {
        self.systick.sync(now, nvic);
    }

    /// Read at `address`.
    pub fn read(&mut self, address: u32, clock: &Clock, nvic: &mut Nvic) -> Option<u32> {
        Some(match address {
            0xE000_1000 => self.cycles.control | 0x4000_0000,
            0xE000_1004 => self.cycles.count(clock.now()),
            0xE000_E004 => 2,
            0xE000_E010 => {
                self.systick.sync(clock.now(), nvic);
                self.systick.control | u32::from(std::mem::take(&mut self.systick.wrapped)) << 16
            }
            0xE000_E014 => self.systick.reload,
            0xE000_E018 => {
                self.systick.sync(clock.now(), nvic);
                let tick = &self.systick;
                if tick.control & 1 == 0 {
                    0
                } else {
                    tick.reload - (clock.now().saturating_sub(tick.start) / tick.divider()) as u32
                }
            }
            0xE000_E01C => 0x4000_0000 | 2_624,
            0xE000_ED00 => CPUID,
            0xE000_ED04 => nvic.icsr(),
            0xE000_ED0C => 0xFA05_0000,
            0xE000_ED14 => self.registers[CCR] | 0x200,
            0xE000_ED18..=0xE000_ED23 => nvic.system_priorities(address - 0xE000_ED18),
            0xE000_ED90 => 0x800,
            0xE000_EDF0 => 0,
            0xE000_EDFC => self.demcr,
            0xE000_EF34 => FPCCR,
            _ => return self.registers.get(address.checked_sub(BLOCK)?),
        })
    }

    /// Write at `address`. Says whether it requests a reset (SYSRESETREQ).
    pub fn write(&mut self, address: u32, size: usize, value: u32, clock: &Clock, nvic: &mut Nvic) -> Option<bool> {
        match address {
            0xE000_1000 => {
                self.cycles.control = value;
                self.cycles.run(self.demcr, clock.now());
            }
            0xE000_1004 => self.cycles.set(value, clock.now()),
            0xE000_E010 => {
                self.systick.sync(clock.now(), nvic);
                if self.systick.control & 1 == 0 {
                    self.systick.start = clock.now();
                }
                self.systick.control = value & 7;
            }
            0xE000_E014 => self.systick.reload = value & 0xFF_FFFF,
            0xE000_E018 => {
                self.systick.start = clock.now();
                self.systick.wrapped = false;
            }
            0xE000_ED04 => nvic.write_icsr(value),
            // Writes count only with the key, and PRIGROUP is not kept.
            0xE000_ED0C if value >> 16 == 0x5FA && value & 4 != 0 => return Some(true),
            0xE000_ED0C => {}
            0xE000_ED18..=0xE000_ED23 => nvic.set_system_priorities(address - 0xE000_ED18, size, value),
            // Their flags are cleared by ones.
            0xE000_ED28..=0xE000_ED3B => self.registers[address - BLOCK] &= !value,
            0xE000_EDFC => {
                self.demcr = value;
                self.cycles.run(value, clock.now());
            }
            0xE000_EF00 => nvic.trigger(value & 0x1FF),
            0xE000_EF34 => {}
            _ => self.registers.set(address.checked_sub(BLOCK)?, value)?,
        }
        Some(false)
    }
}
