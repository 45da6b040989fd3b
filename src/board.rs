//! Pins, clocks and peripherals of the NUCLEO-F446RE (hardware.md section 8; the pin table in the README repeats it).

use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicU32, Ordering};
use embassy_stm32::adc::{self, Adc, AdcChannel, RingBufferedAdc, SampleTime};
use embassy_stm32::can::{self, Can, Fifo, StandardId};
use embassy_stm32::gpio::{Input, Level, Output, Pull, Speed};
use embassy_stm32::timer::qei::{self, Qei};
use embassy_stm32::usart::{self, BufferedUart};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Config, Peripherals, bind_interrupts, dma, pac, peripherals};
use rig_link::messages::ResetCause;
use static_cell::StaticCell;

use crate::scene::RIG;
use crate::store::Store;

bind_interrupts!(struct Irqs {
    USART2 => usart::BufferedInterruptHandler<peripherals::USART2>;
    CAN1_RX0 => can::Rx0InterruptHandler<peripherals::CAN1>;
    CAN1_RX1 => can::Rx1InterruptHandler<peripherals::CAN1>;
    CAN1_SCE => can::SceInterruptHandler<peripherals::CAN1>;
    CAN1_TX => can::TxInterruptHandler<peripherals::CAN1>;
    DMA2_STREAM0 => dma::InterruptHandler<peripherals::DMA2_CH0>;
});

/// Samples in one LVDT block, half of the DMA ring. At 492 ADC clocks of 21 MHz each, a block takes 6.0 ms.
pub const LVDT_BLOCK: usize = 256;

/// Time without feeding after which the watchdog resets the board (µs, nominal). The LSI is 17 to 47 kHz for 32, so
/// really 0.34 to 0.94 s; the drive stops at its last target meanwhile.
const WATCHDOG_US: u32 = 500_000;
/// The same in the watchdog's counts, as embassy-stm32 sets them: 32 kHz over the least prescaler that reaches.
pub const WATCHDOG_RELOAD: u16 = 3999;

/// Indicators.
pub struct Leds {
    /// LD2: blinks while the control task runs.
    pub heartbeat: Output<'static>,
    /// Lit in fault and emergency stop.
    pub fault: Output<'static>,
    /// Motor power; a pull-down keeps it off until the board is up.
    pub _motor_power: Output<'static>,
}

/// Everything on the board, set up.
pub struct Board {
    pub uart: BufferedUart<'static>,
    pub can: Can<'static>,
    pub lvdt: RingBufferedAdc<'static, peripherals::ADC1>,
    pub encoder: Qei<'static, peripherals::TIM3>,
    /// Normally closed contact to ground: high is stop, or a broken wire.
    pub estop: Input<'static>,
    pub leds: Leds,
    pub watchdog: IndependentWatchdog<'static, peripherals::IWDG>,
    pub store: Store,
}

/// 168 MHz from the ST-LINK's 8 MHz clock: no over-drive, exact CAN and UART rates (hardware.md section 8).
pub fn clocks() -> Config {
    use embassy_stm32::rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllSource, Sysclk,
    };
    let mut config = Config::default();
    config.rcc.hse = Some(Hse { freq: embassy_stm32::time::Hertz(8_000_000), mode: HseMode::Bypass });
    config.rcc.pll_src = PllSource::HSE;
    config.rcc.pll =
        Some(Pll { prediv: PllPreDiv::DIV4, mul: PllMul::MUL168, divp: Some(PllPDiv::DIV2), divq: None, divr: None });
    config.rcc.ahb_pre = AHBPrescaler::DIV1;
    config.rcc.apb1_pre = APBPrescaler::DIV4;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config.rcc.sys = Sysclk::PLL1_P;
    config
}

impl Board {
    pub fn new(p: Peripherals) -> Self {
        let leds = Leds {
            heartbeat: Output::new(p.PA5, Level::Low, Speed::Low),
            fault: Output::new(p.PC0, Level::Low, Speed::Low),
            _motor_power: Output::new(p.PB10, Level::High, Speed::Low),
        };

        static TX: StaticCell<[u8; 512]> = StaticCell::new();
        static RX: StaticCell<[u8; 256]> = StaticCell::new();
        let mut serial = usart::Config::default();
        serial.baudrate = rig_link::BAUD;
        // The pins and the rate are constants of this board: a wrong one shows at the first boot.
        let uart = defmt::unwrap!(BufferedUart::new(
            p.USART2,
            p.PA3,
            p.PA2,
            TX.init([0; 512]),
            RX.init([0; 256]),
            Irqs,
            serial
        ));

        let mut can = Can::new(p.CAN1, p.PB8, p.PB9, Irqs);
        // The drive's four reports and nothing else. `set_automatic_retransmit` is not called: in embassy-stm32 0.6.0 it
        // does the opposite of its name, and the default (retransmit) is what is wanted.
        let ids = report_ids()
            .map(|id| can::filter::ListEntry16::data_frames_with_id(StandardId::new(id).unwrap_or(StandardId::ZERO)));
        can.modify_filters().enable_bank(0, Fifo::Fifo0, ids);
        can.modify_config().set_bitrate(1_000_000).set_loopback(false).set_silent(false);

        static SAMPLES: StaticCell<[u16; 2 * LVDT_BLOCK]> = StaticCell::new();
        let lvdt = Adc::new(p.ADC1).into_ring_buffered(
            p.DMA2_CH0,
            SAMPLES.init([0; 2 * LVDT_BLOCK]),
            Irqs,
            [(p.PA0.degrade_adc(), SampleTime::CYCLES480)].into_iter(),
            adc::CONTINUOUS,
            adc::Exten::DISABLED,
        );

        Self {
            uart,
            can,
            lvdt,
            encoder: Qei::new(p.TIM3, p.PA6, p.PA7, qei::Config::default()),
            estop: Input::new(p.PB5, Pull::Up),
            leds,
            watchdog: IndependentWatchdog::new(p.IWDG, WATCHDOG_US),
            store: Store::new(p.FLASH),
        }
    }
}

/// The drive's address; the scene's values were checked by the build script.
pub fn drive_address() -> rmds405::Address {
    defmt::unwrap!(rmds405::Address::new(RIG.drive_group, RIG.drive_number).ok())
}

fn report_ids() -> [u16; 4] {
    drive_address().report_ids()
}

/// How the board came to start.
#[derive(Clone, Copy)]
pub struct Start {
    pub cause: ResetCause,
    /// Boots since power came on, counting this one.
    pub boot_count: u32,
}

/// Reads the reset flags and clears them for the next time. Call once, before anything else.
pub fn reset_cause() -> Start {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    let cause = if flags.wdgrstf() || flags.wwdgrstf() {
        ResetCause::Watchdog
    } else if flags.lpwrrstf() {
        ResetCause::LowPower
    } else if flags.porrstf() {
        ResetCause::PowerOn
    } else if flags.sftrstf() {
        ResetCause::Software
    } else if flags.borrstf() {
        ResetCause::BrownOut
    } else if flags.padrstf() {
        ResetCause::Pin
    } else {
        ResetCause::Unknown
    };
    Start { cause, boot_count: count_boot(cause) }
}

/// Counts boots in RAM that a reset does not clear.
fn count_boot(cause: ResetCause) -> u32 {
    const MAGIC: u32 = 0x7453_4101;
    #[unsafe(link_section = ".uninit.BOOTS")]
    static BOOTS: MaybeUninit<[AtomicU32; 2]> = MaybeUninit::uninit();
    // SAFETY: any bit pattern is a valid integer; the magic word tells whether this one was written by us.
    let [magic, count] = unsafe { BOOTS.assume_init_ref() };
    let fresh = cause == ResetCause::PowerOn || magic.load(Ordering::Relaxed) != MAGIC;
    let boots = if fresh { 1 } else { count.load(Ordering::Relaxed).wrapping_add(1) };
    magic.store(MAGIC, Ordering::Relaxed);
    count.store(boots, Ordering::Relaxed);
    boots
}
