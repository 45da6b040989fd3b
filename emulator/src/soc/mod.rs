//! The STM32F446's peripherals on an emulated clock.
//!
//! There is a file for each peripheral. A peripheral knows its registers, when its next event is due, and how to
//! advance to a given cycle; it does not know the CPU. [`Soc`] is the bus between them: it decodes addresses, checks
//! clocks, and processes events in order of time, so that the board sees them in the order in which they happen.
//!
//! - [`peripheral`]: registers and wires. - [`clock`]: cycles and seconds. - [`memory`]: flash and RAM. - [`fault`]: what a strict board refuses.
//! - [`rcc`], [`pwr`], [`flash`], [`gpio`], [`exti`], [`iwdg`]: infrastructure.
//! - [`tim`], [`usart`], [`can`], [`adc`], [`dma`]: what firmware reaches the outside through.
//! - [`nvic`], [`scb`]: the core's own peripherals. - `map`, `bus`: addresses, and accesses by the core.

/// Borrow everything that peripherals share, leaving the peripherals free.
macro_rules! wires {
    ($soc:ident) => {
        &mut Wires {
            clock: &$soc.clock,
            nvic: &mut $soc.nvic,
            gpio: &$soc.gpio,
            board: &mut $soc.board,
            faults: &mut $soc.faults,
        }
    };
}

pub mod adc;
mod bus;
pub mod can;
pub mod clock;
pub mod dma;
pub mod exti;
pub mod fault;
pub mod flash;
pub mod gpio;
pub mod iwdg;
mod map;
pub mod memory;
pub mod nvic;
pub mod peripheral;
pub mod pwr;
pub mod rcc;
pub mod scb;
pub mod tim;
pub mod usart;

use self::clock::{Clock, NEVER};
use self::fault::{Faults, Lint};
use self::map::Unit;
use self::peripheral::Wires;
use rig_plant::board::{Board, Stimulus};

/// The chip, and how strict it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Stop at anything that the real chip would not do or that is not modelled; otherwise only count it.
    pub strict: bool,
    /// Frequency of the LSI, the watchdog's clock: nominally 32 kHz, 17 to 47 kHz by the datasheet.
    pub lsi_hz: f64,
    /// Factory calibration word of VREFINT: its ADC code at 3.3 V. 1.21 V is typical.
    pub vrefint_cal: u16,
    /// Erasing flash takes the longest time that the chip's maker allows, not the typical one.
    pub slow_flash: bool,
    /// Option byte: level of the brown-out reset, 1 to 3; 0 is off, as the factory delivers the chip.
    pub brown_out_level: u8,
    /// Unique device id.
    pub unique_id: [u8; 12],
}

impl Default for Config {
    fn default() -> Self {
        Self {
            strict: true,
            lsi_hz: 32_000.0,
            vrefint_cal: 1501,
            slow_flash: false,
            brown_out_level: 0,
            unique_id: *b"emulated-rig",
        }
    }
}

/// Why the microcontroller was reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// Supply switched off and on.
    PowerCycle,
    /// SYSRESETREQ.
    Software,
    /// The independent watchdog.
    Watchdog,
    /// A dip of the supply, deep enough for a reset and too short for RAM to lose its contents. Its flags are those of
    /// power-on unless the brown-out reset is on (RM0390 section 6.3.21).
    BrownOut,
}

/// The microcontroller without its core.
pub struct Soc<B> {
    /// What is wired to the pins.
    pub board: B,
    /// Time.
    pub clock: Clock,
    /// Interrupts.
    pub nvic: nvic::Nvic,
    /// Flash and RAM.
    pub memory: memory::Memory,
    /// Faults so far.
    pub faults: Faults,
    /// SYSRESETREQ or the watchdog requests a reset.
    pub reset_request: Option<ResetCause>,
    /// Firmware has changed flash since this was last cleared.
    pub flash_changed: bool,
    /// The contents that the words must have into which the core has just stored, whether the store was allowed or not.
    programmed: Vec<(u32, Vec<u8>)>,
    scb: scb::Scb,
    /// Clocks.
    pub rcc: rcc::Rcc,
    pwr: pwr::Pwr,
    /// Flash interface.
    pub flash: flash::Flash,
    debug: pwr::DebugMcu,
    gpio: gpio::Gpio,
    exti: exti::Exti,
    timers: [tim::Timer; 8],
    usarts: [usart::Usart; 4],
    /// CAN1.
    pub can: can::Can,
    adc: adc::Adc,
    dma: [dma::Dma; 2],
    iwdg: iwdg::Iwdg,
    /// The board is not polled again before this cycle.
    board_asked: u64,
    /// From the next power-on, or from this one if it was just now, the ST-LINK's clock comes late.
    pub hse_late: bool,
    /// Time of the last power-on (s).
    powered_s: f64,
}

/// How long a slow ST-LINK takes from power-on to its clock (s).
const HSE_LATE_S: f64 = 0.15;

impl<B: Board> Soc<B> {
    /// The chip at power-up.
    pub fn new(board: B, config: &Config) -> Self {
        Self {
            board,
            clock: Clock::default(),
            nvic: nvic::Nvic::default(),
            memory: memory::Memory::default(),
            faults: Faults::new(config.strict),
            reset_request: None,
            flash_changed: false,
            programmed: Vec::new(),
            scb: scb::Scb::default(),
            rcc: rcc::Rcc::default(),
            pwr: pwr::Pwr::default(),
            flash: flash::Flash::new(config.brown_out_level, config.slow_flash),
            debug: pwr::DebugMcu::default(),
            gpio: gpio::Gpio::default(),
            exti: exti::Exti::default(),
            timers: std::array::from_fn(|i| tim::Timer::new(&tim::TIMERS[i])),
            usarts: std::array::from_fn(|i| usart::Usart::new(&usart::USARTS[i])),
            can: can::Can::default(),
            adc: adc::Adc::default(),
            dma: [dma::Dma::new(1), dma::Dma::new(2)],
            iwdg: iwdg::Iwdg::new(config.lsi_hz),
            board_asked: 0,
            hse_late: false,
            powered_s: 0.0,
        }
    }

    /// Address of the vector table in force.
    pub fn vector_table(&self) -> u32 {
        self.scb.vector_table()
    }

    /// Reset everything but flash and, unless the power goes, RAM. The board goes on, and sees that its wires are
    /// released.
    pub fn reset(&mut self, cause: ResetCause) {
        // Conversions up to here were made with the pins as they were.
        let now = self.clock.now();
        self.catch_up_adc(now);
        for unit in map::resettable() {
            self.reset_unit(unit);
        }
        self.scb = scb::Scb::default();
        self.nvic = nvic::Nvic::default();
        self.pwr = pwr::Pwr::default();
        self.flash.reset();
        self.exti = exti::Exti::default();
        self.iwdg.reset();
        self.reset_request = None;
        self.rcc.reset();
        match cause {
            ResetCause::PowerCycle => {
                self.powered_s = self.clock.seconds();
                self.rcc.power_on();
                self.memory.ram.fill(memory::RAM_NOISE);
            }
            ResetCause::Software => self.rcc.flag(rcc::reset_flag::SOFTWARE | rcc::reset_flag::PIN),
            ResetCause::Watchdog => self.rcc.flag(rcc::reset_flag::IWDG | rcc::reset_flag::PIN),
            // With the brown-out reset off, the power-down reset responds to the dip, later.
            ResetCause::BrownOut if self.flash.brown_out_level() == 0 => self.rcc.power_on(),
            ResetCause::BrownOut => self.rcc.flag(rcc::reset_flag::BOR | rcc::reset_flag::PIN),
        }
        self.clock.retune(self.rcc.tree());
    }

    fn reset_unit(&mut self, unit: Unit) {
        match unit {
            Unit::Gpio(port) => {
                self.gpio.reset(port);
                self.tell_outputs(port);
            }
            Unit::Timer(i) => self.timers[i].reset(wires!(self)),
            Unit::Usart(i) => self.usarts[i].reset(wires!(self)),
            Unit::Can => self.can.reset(wires!(self)),
            Unit::Adc => self.adc.reset(wires!(self)),
            Unit::Dma(i) => self.dma[i].reset(&mut self.nvic),
            Unit::Syscfg => self.exti.reset_syscfg(),
            Unit::Pwr => self.pwr = pwr::Pwr::default(),
            _ => {}
        }
    }

    fn tell_outputs(&mut self, port: usize) {
        if let Some(gpio::Outputs { driven, levels }) = self.gpio.changed(port) {
            self.catch_up_adc(self.clock.now());
            let letter = (b'A' + port as u8) as char;
            self.board.gpio_drives(self.clock.seconds(), letter, driven);
            self.board.gpio_out(self.clock.seconds(), letter, levels);
        }
    }

    // ---- time

    /// The next cycle at which something happens by itself.
    pub fn next_event(&self) -> u64 {
        self.next_source().0
    }

    /// That cycle, and the peripheral; `Unit::None` is the board.
    fn next_source(&self) -> (u64, Unit) {
        // Of several at the same cycle the first. Every access to a register asks this, so it is a loop and no iterator.
        let mut first = (self.clock.cycle_at(self.board.next_event_s()).max(self.board_asked), Unit::None);
        let mut or = |at: u64, unit: Unit| {
            if at < first.0 {
                first = (at, unit);
            }
        };
        for (i, timer) in self.timers.iter().enumerate() {
            or(timer.next_event(&self.clock), Unit::Timer(i));
        }
        for (i, usart) in self.usarts.iter().enumerate() {
            or(usart.next_event(), Unit::Usart(i));
        }
        or(self.can.next_event(), Unit::Can);
        or(self.adc.next_event(&self.dma[1], &self.clock), Unit::Adc);
        or(self.scb.next_event(), Unit::Core);
        or(self.iwdg.next_event(&self.clock), Unit::Iwdg);
        first
    }

    /// Process everything that is due, in order of time. Gives the next event.
    pub fn sync(&mut self) -> u64 {
        loop {
            let (due, source) = self.next_source();
            if due > self.clock.now() || self.reset_request.is_some() {
                return due;
            }
            self.happen(due, source);
        }
    }

    fn happen(&mut self, due: u64, source: Unit) {
        if !matches!(source, Unit::Timer(_) | Unit::Core | Unit::Iwdg) {
            self.catch_up_adc(due);
        }
        match source {
            Unit::Timer(i) => self.timers[i].sync(due, wires!(self)),
            Unit::Core => self.scb.sync(due, &mut self.nvic),
            Unit::Iwdg => self.reset_request = Some(ResetCause::Watchdog),
            Unit::Usart(i) => self.usarts[i].sync(due, wires!(self)),
            Unit::Can => self.can.sync(due, wires!(self)),
            Unit::None => {
                self.board_asked = due + 1;
                for stimulus in self.board.poll(self.clock.seconds_at(due)) {
                    self.apply(stimulus, due);
                }
            }
            _ => {}
        }
    }

    fn catch_up_adc(&mut self, at: u64) {
        let (dma, memory) = (&mut self.dma[1], &mut self.memory);
        self.adc.catch_up(at, dma, memory, wires!(self));
    }

    /// The ADC's requests to its DMA stream are lost from now on, as if none of them had been served in time.
    pub fn stall_adc(&mut self, stalled: bool) {
        self.sync();
        self.catch_up_adc(self.clock.now());
        self.adc.stall(stalled);
    }

    /// This chip's HSI frequency (Hz), nominally 16 MHz.
    pub fn set_hsi(&mut self, hsi_hz: u64) {
        self.sync();
        self.rcc.set_hsi(hsi_hz);
        self.clock.retune(self.rcc.tree());
    }

    /// What is wrong with the wire from the CAN transceiver, from now on.
    pub fn set_can_line(&mut self, line: can::Line) {
        self.sync();
        self.can.set_line(line, self.clock.now(), wires!(self));
    }

    /// What feeds OSC_IN may have come up since the RCC was last looked at.
    fn look_at_hse(&mut self) {
        self.rcc.set_hse_up(!self.hse_late || self.clock.seconds() >= self.powered_s + HSE_LATE_S);
    }

    /// The board drives its side of the pins, now.
    pub fn stimulate(&mut self, stimulus: Stimulus) {
        self.sync();
        self.apply(stimulus, self.clock.now());
    }

    fn apply(&mut self, stimulus: Stimulus, at: u64) {
        match stimulus {
            Stimulus::Can(frame) => self.can.send(frame, at, wires!(self)),
            Stimulus::CanQuiet => self.can.quiet(at, wires!(self)),
            Stimulus::Uart { usart: number, bytes } => {
                match usart::USARTS.iter().position(|kind| kind.number == number) {
                    Some(i) => self.usarts[i].send(at, &bytes, wires!(self)),
                    None => self.faults.lint(Lint::BoardUsart),
                }
            }
            Stimulus::Pin { port, pin, high } => self.drive_pin(port, pin, Some(high)),
            Stimulus::Release { port, pin } => self.drive_pin(port, pin, None),
        }
    }

    /// The board drives a pin, or no longer does.
    fn drive_pin(&mut self, port: char, pin: u8, level: Option<bool>) {
        let port = (port as usize).wrapping_sub('A' as usize);
        if port >= gpio::PORTS {
            self.faults.lint(Lint::BoardPort);
            return;
        }
        let before = self.gpio.inputs(port);
        self.gpio.drive(port, pin, level);
        self.exti.edges(port, before, self.gpio.inputs(port), &mut self.nvic);
    }

    /// Time passes with the core asleep, to the next event but not beyond `limit`. Gives the cycles slept.
    pub fn sleep(&mut self, limit: u64) -> u64 {
        let before = self.clock.now();
        let next = self.next_event().min(limit);
        self.clock.advance_to(if next == NEVER { before } else { next });
        self.sync();
        self.clock.now() - before
    }
}
