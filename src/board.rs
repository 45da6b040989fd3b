//! Pins, clocks and peripherals of the NUCLEO-F446RE, and the cause of its reset (docs/reference/hardware.md section
//! 3).

use core::num::{NonZeroU8, NonZeroU16};
use embassy_stm32::adc::{self, Adc, AdcChannel, RingBufferedAdc, SampleTime};
use embassy_stm32::can::util::NominalBitTiming;
use embassy_stm32::can::{self, Can, Fifo, StandardId};
use embassy_stm32::gpio::{Input, Level, Output, Pull, Speed};
use embassy_stm32::pac::iwdg::vals::Key;
use embassy_stm32::pac::timer::vals::FilterValue;
use embassy_stm32::timer::qei::{self, Qei};
use embassy_stm32::usart::{self, BufferedUart};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Config, Peri, Peripherals, bind_interrupts, dma, pac, peripherals};
use rig_link::messages::{Clock, Fault, ResetCause};
use static_cell::StaticCell;

use crate::flash_store::Store;
use crate::iwdg;
use crate::post_mortem;
use crate::scene::{DRIVE_TRANSPORT, RIG};
use crate::serial;

bind_interrupts!(pub struct Irqs {
    USART1 => usart::BufferedInterruptHandler<peripherals::USART1>, serial::ToDrive;
    USART2 => usart::BufferedInterruptHandler<peripherals::USART2>, serial::ToHost;
    CAN1_RX0 => can::Rx0InterruptHandler<peripherals::CAN1>;
    CAN1_RX1 => can::Rx1InterruptHandler<peripherals::CAN1>;
    CAN1_SCE => can::SceInterruptHandler<peripherals::CAN1>;
    CAN1_TX => can::TxInterruptHandler<peripherals::CAN1>;
    DMA2_STREAM0 => dma::InterruptHandler<peripherals::DMA2_CH0>;
});

/// Cycles of the core in a microsecond ([`clocks`]).
pub const CYCLES_PER_US: u32 = 168;

/// Samples in one LVDT block, half of the DMA ring. At 492 ADC clocks of 21 MHz each, a block takes 6.0 ms.
pub const LVDT_BLOCK: usize = 256;

/// 1 Mbit/s from 42 MHz: 14 quanta, sampled after 11 of them. With a jump width of 3, the clocks of two nodes may
/// differ by 0.84 % (ISO 11898-1: the lesser of 3 / (20 x 14) and 3 / 2 (13 x 14 - 3)). The 7 quanta and jump width of
/// 1 that embassy-stm32 would choose allow 0.56 %. Both leave 0.71 us before the sample for the propagation there and
/// back.
const BIT_TIMING: NominalBitTiming = NominalBitTiming {
    prescaler: NonZeroU16::new(3).unwrap(),
    seg1: NonZeroU8::new(10).unwrap(),
    seg2: NonZeroU8::new(3).unwrap(),
    sync_jump_width: NonZeroU8::new(3).unwrap(),
};

/// The indicator LEDs.
pub struct Leds {
    /// LD2: blinks while the control task runs.
    pub heartbeat: Output<'static>,
    /// Lit in fault and emergency stop.
    pub fault: Output<'static>,
}

/// A normally closed contact to ground: a high level means an open contact or a broken wire.
pub struct Contact {
    pin: Input<'static>,
    last: bool,
    open: bool,
}

impl Contact {
    fn new(pin: Input<'static>) -> Self {
        let open = pin.is_high();
        Self { pin, last: open, open }
    }

    /// Samples the contact; to be called once in each tick. A change counts when two consecutive samples show it,
    /// because the motor's wires run beside the contact's and disturb it.
    pub fn is_open(&mut self) -> bool {
        let now = self.pin.is_high();
        if now == self.last {
            self.open = now;
        }
        self.last = now;
        self.open
    }
}

/// All contacts of the rig.
pub struct Switches {
    /// Emergency stop.
    pub estop: Contact,
    /// Upper end of the rail: smallest gap.
    pub upper_limit: Contact,
    /// Lower end of the rail: largest gap.
    pub lower_limit: Contact,
}

/// The peripherals of both transports to the drive, of which the scene selects one.
pub struct DriveLines {
    can: Peri<'static, peripherals::CAN1>,
    can_rx: Peri<'static, peripherals::PB8>,
    can_tx: Peri<'static, peripherals::PB9>,
    uart: Peri<'static, peripherals::USART1>,
    uart_rx: Peri<'static, peripherals::PA10>,
    uart_tx: Peri<'static, peripherals::PA9>,
}

impl DriveLines {
    /// CAN1, not enabled yet.
    pub fn can(self) -> Can<'static> {
        let mut can = Can::new(self.can, self.can_rx, self.can_tx, Irqs);
        // Embassy sets no pull on RX: without a transceiver the bus would look busy or quiet by chance.
        pac::GPIOB.pupdr().modify(|w| w.set_pupdr(8, pac::gpio::vals::Pupdr::PULL_UP));
        // The filter accepts only the drive's four reports. `set_automatic_retransmit` is not called: in embassy-stm32
        // 0.6.0 it does the opposite of its name, and the default (retransmit) is the right one here.
        let ids = drive_address()
            .report_ids()
            .map(|id| can::filter::ListEntry16::data_frames_with_id(StandardId::new(id).unwrap_or(StandardId::ZERO)));
        can.modify_filters().enable_bank(0, Fifo::Fifo0, ids);
        let config = can.modify_config();
        // Embassy switches on time stamps, which nothing here reads; the chip's errata advise against that mode.
        pac::CAN1.mcr().modify(|w| w.set_ttcm(false));
        config.set_bit_timing(BIT_TIMING).set_loopback(false).set_silent(false);
        can
    }

    /// USART1.
    pub fn uart(self) -> BufferedUart<'static> {
        // Room for a few frames; the drive sends two reports in 10 ms. Embassy's sending half is not used
        // ([`crate::serial`]).
        static TX: StaticCell<[u8; 1]> = StaticCell::new();
        static RX: StaticCell<[u8; 64]> = StaticCell::new();
        let mut serial = usart::Config::default();
        serial.baudrate = rmds405::serial::BAUD;
        let (tx, rx) = (TX.init([0]), RX.init([0; 64]));
        // It fails only for a rate or pins that the USART does not have; both are constants here.
        defmt::unwrap!(BufferedUart::new(self.uart, self.uart_rx, self.uart_tx, tx, rx, Irqs, serial))
    }
}

/// Everything on the board, set up, except the transport to the drive.
pub struct Board {
    pub uart: BufferedUart<'static>,
    pub drive: DriveLines,
    pub lvdt: RingBufferedAdc<'static, peripherals::ADC1>,
    pub encoder: Qei<'static, peripherals::TIM3>,
    pub switches: Switches,
    pub leds: Leds,
    /// Enables the motor's supply; it is not an emergency stop. An external pull-down keeps it off until the drive task
    /// raises it.
    pub motor_power: Output<'static>,
    pub watchdog: IndependentWatchdog<'static, peripherals::IWDG>,
    pub store: Store,
}

/// 168 MHz from the ST-LINK's 8 MHz clock, which gives exact CAN and UART rates (docs/reference/hardware.md section 3).
/// From the chip's own oscillator all rates are off by up to 1 %, and by more when the chip is warm: that suffices for
/// the host link, but is not guaranteed on the CAN bus.
///
/// 168 MHz does not need the over-drive mode, but embassy-stm32 0.6.0 switches it on, while the core still runs from
/// its own oscillator, as it must (RM0390 section 5.1.4). Here it only costs some supply current, because no stop mode
/// is used.
pub fn clocks(clock: Clock) -> Config {
    use embassy_stm32::rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllSource, Sysclk,
    };
    let mut config = Config::default();
    // The PLL's input is 2 MHz in both cases.
    let prediv = match clock {
        Clock::Hse => {
            config.rcc.hse = Some(Hse { freq: embassy_stm32::time::Hertz(8_000_000), mode: HseMode::Bypass });
            config.rcc.pll_src = PllSource::HSE;
            PllPreDiv::DIV4
        }
        Clock::Hsi => PllPreDiv::DIV8,
    };
    config.rcc.pll = Some(Pll { prediv, mul: PllMul::MUL168, divp: Some(PllPDiv::DIV2), divq: None, divr: None });
    config.rcc.ahb_pre = AHBPrescaler::DIV1;
    config.rcc.apb1_pre = APBPrescaler::DIV4;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config.rcc.sys = Sysclk::PLL1_P;
    config
}

/// Switches on prefetch and instruction cache, which embassy-stm32 0.6.0 leaves off. Without them the core waits five
/// cycles for each line of flash. The data cache stays off: it would return the old contents of flash that the store
/// has just written or erased, because embassy flushes it only on chips with two banks.
fn speed_up_flash() {
    pac::FLASH.acr().modify(|w| {
        w.set_prften(true);
        w.set_icen(true);
    });
}

/// The encoder's counter. Its two inputs are filtered: a change counts after eight equal samples at a quarter of the
/// timer's 84 MHz, 0.38 us. At 12 000 rpm a line of 1024 counts changes every 2.4 us.
fn encoder(
    timer: Peri<'static, peripherals::TIM3>,
    a: Peri<'static, peripherals::PA6>,
    b: Peri<'static, peripherals::PA7>,
) -> Qei<'static, peripherals::TIM3> {
    let encoder = Qei::new(timer, a, b, qei::Config::default());
    pac::TIM3.ccmr_input(0).modify(|w| {
        w.set_icf(0, FilterValue::FDTS_DIV4_N8);
        w.set_icf(1, FilterValue::FDTS_DIV4_N8);
    });
    encoder
}

impl Board {
    pub fn new(p: Peripherals) -> Self {
        speed_up_flash();
        // For the length of a tick.
        if let Some(mut core) = cortex_m::Peripherals::take() {
            core.DCB.enable_trace();
            core.DWT.enable_cycle_counter();
        }
        let leds = Leds {
            heartbeat: Output::new(p.PA5, Level::Low, Speed::Low),
            fault: Output::new(p.PC0, Level::Low, Speed::Low),
        };

        static TX: StaticCell<[u8; 1]> = StaticCell::new();
        static RX: StaticCell<[u8; 256]> = StaticCell::new();
        let mut serial = usart::Config::default();
        serial.baudrate = rig_link::BAUD;
        // It fails only for a rate or pins that the USART does not have; both are constants here.
        let uart =
            defmt::unwrap!(BufferedUart::new(p.USART2, p.PA3, p.PA2, TX.init([0]), RX.init([0; 256]), Irqs, serial));

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
            drive: DriveLines {
                can: p.CAN1,
                can_rx: p.PB8,
                can_tx: p.PB9,
                uart: p.USART1,
                uart_rx: p.PA10,
                uart_tx: p.PA9,
            },
            lvdt,
            encoder: encoder(p.TIM3, p.PA6, p.PA7),
            switches: Switches {
                estop: Contact::new(Input::new(p.PB5, Pull::Up)),
                upper_limit: Contact::new(Input::new(p.PA8, Pull::Up)),
                lower_limit: Contact::new(Input::new(p.PC7, Pull::Up)),
            },
            leds,
            motor_power: Output::new(p.PB10, Level::Low, Speed::Low),
            watchdog: IndependentWatchdog::new(p.IWDG, iwdg::TIMEOUT_US),
            store: Store::new(p.FLASH),
        }
    }
}

/// The drive's address. The build script has checked the scene's values.
pub fn drive_address() -> rmds405::Address {
    defmt::unwrap!(rmds405::Address::new(RIG.drive_group, RIG.drive_number).ok())
}

/// Why and how the board started.
#[derive(Clone)]
pub struct Start {
    pub cause: ResetCause,
    /// Boots since power came on, including this one.
    pub boot_count: u32,
    /// Message of the previous run's panic or hard fault.
    pub last_panic: Option<heapless::String<88>>,
    /// The previous run was driving the motor.
    pub was_driving: bool,
    /// The oscillator that the clocks are derived from.
    pub clock: Clock,
}

impl Start {
    /// The fault with which the firmware starts, if any: nothing moves before the operator has cleared it.
    pub fn fault(&self) -> Option<Fault> {
        match self.cause {
            // Nothing else matters until it is mended: it cannot be cleared.
            _ if self.clock == Clock::Hsi && matches!(DRIVE_TRANSPORT, rmds405::Transport::Can) => {
                Some(Fault::ClockSource)
            }
            _ if self.last_panic.is_some() => Some(Fault::Panicked),
            ResetCause::Watchdog => Some(Fault::WatchdogReset),
            // The reset button is pressed on purpose.
            ResetCause::Pin => None,
            ResetCause::BrownOut | ResetCause::LowPower => Some(Fault::UnexpectedReset),
            // RAM that kept its contents shows that the supply only dipped, while the motor was driven.
            ResetCause::PowerOn => self.was_driving.then_some(Fault::UnexpectedReset),
            // A debugger or a new image resets the board; that is no fault unless the motor was driven.
            ResetCause::Software | ResetCause::Unknown => self.was_driving.then_some(Fault::UnexpectedReset),
        }
    }
}

/// Number of checks for the ST-LINK's clock, after a reset and after power-on, and cycles of delay between them: 50 to
/// 200 ms, and 0.6 to 2.2 s, at 1 to 4 cycles per turn of the delay loop (a Cortex-M4 takes 3). After power-on from
/// another source than its USB socket the ST-LINK first has to start.
const HSE_TRIES: u32 = 100;
const HSE_TRIES_AT_POWER_ON: u32 = 1100;
const HSE_PAUSE: u32 = 8_000;

/// The oscillator to use: the ST-LINK's clock if it comes in time, else the chip's own. embassy-stm32 would wait for
/// the ST-LINK's without limit. The core runs at its own 16 MHz meanwhile. Feeds the watchdog.
pub fn find_clock(power_on: bool) -> Clock {
    let rcc = pac::RCC;
    rcc.cr().modify(|w| w.set_hsebyp(true));
    rcc.cr().modify(|w| w.set_hseon(true));
    for _ in 0..if power_on { HSE_TRIES_AT_POWER_ON } else { HSE_TRIES } {
        pac::IWDG.kr().write(|w| w.set_key(Key::RESET));
        if rcc.cr().read().hserdy() {
            return Clock::Hse;
        }
        cortex_m::asm::delay(HSE_PAUSE);
    }
    Clock::Hsi
}

/// Level of the brown-out reset in the option bytes, 0 (off) to 3. The firmware only reads it: if the supply failed
/// while option bytes are written, the chip could lock itself.
pub fn brown_out_level() -> u8 {
    3 - pac::FLASH.optcr().read().bor_lev()
}

/// Starts the watchdog, reads and clears the reset flags, reads the previous run's record, and finds the clock. Call it
/// once, before anything else.
pub fn start() -> Start {
    // The watchdog stops while a debugger halts the core: a breakpoint must not restart the drive, which drops the
    // load. So does the timer of the time driver, which would miss its wraps.
    pac::DBGMCU.apb1fzr().modify(|w| {
        w.set_iwdg(true);
        w.set_tim5(true);
    });
    // Its time is that of the reset values: 4096 counts of LSI / 4, 0.35 to 0.96 s.
    pac::IWDG.kr().write(|w| w.set_key(Key::START));
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
    let previous = post_mortem::start_record(cause == ResetCause::PowerOn);
    let clock = find_clock(matches!(cause, ResetCause::PowerOn | ResetCause::BrownOut));
    let post_mortem::PreviousRun { boot_count, was_driving, panic: last_panic } = previous;
    Start { cause, boot_count, last_panic, was_driving, clock }
}
