//! The STM32F446's peripherals on an emulated clock.
//!
//! A file for each peripheral. Every one knows its registers, when it next has something to do, and how to catch up with a
//! given cycle; none knows the CPU. [`Soc`] is the bus between them: it decodes addresses, checks clocks, and works events
//! off in order of time, so that the board hears of everything in the order in which it happens.
//!
//! - [`clock`]: cycles and seconds. - [`memory`]: flash and RAM. - [`fault`]: what the strict board objects to.
//! - [`rcc`], [`pwr`], [`flash`], [`gpio`], [`exti`], [`iwdg`]: infrastructure.
//! - [`tim`], [`usart`], [`can`], [`adc`], [`dma`]: what firmware talks through.
//! - [`nvic`], [`scb`]: the core's own peripherals.

pub mod adc;
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
pub mod pwr;
pub mod rcc;
pub mod scb;
pub mod tim;
pub mod usart;

use self::clock::{Clock, NEVER};
use self::fault::{Fault, Faults};
use self::map::{Unit, gate, unit_at};
use self::scb::Effect;
use crate::board::{Board, Stimulus};

/// Cycles that a peripheral access takes on top of its instruction: AHB-to-APB bridges make the core wait.
const ACCESS_CYCLES: u64 = 2;

/// What a peripheral can reach besides its own registers.
pub struct Wires<'a> {
    /// Time.
    pub clock: &'a Clock,
    /// Interrupt lines.
    pub nvic: &'a mut nvic::Nvic,
    /// Pin functions.
    pub gpio: &'a gpio::Gpio,
    /// What is outside.
    pub board: &'a mut dyn Board,
    /// Where to complain.
    pub faults: &'a mut Faults,
}

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

/// Why the microcontroller was reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// Supply switched off and on.
    PowerCycle,
    /// SYSRESETREQ.
    Software,
    /// The independent watchdog.
    Watchdog,
}

/// Something that will happen by itself.
#[derive(Clone, Copy, Debug)]
enum Source {
    Board,
    Timer(usize),
    Usart(usize),
    Can,
    Adc,
    SysTick,
    Iwdg,
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
    /// Complaints.
    pub faults: Faults,
    /// SYSRESETREQ or the watchdog ask for a reset.
    pub reset_request: Option<ResetCause>,
    /// Firmware has changed flash since this was last cleared.
    pub flash_changed: bool,
    scb: scb::Scb,
    rcc: rcc::Rcc,
    pwr: pwr::Pwr,
    flash: flash::Flash,
    debug: pwr::DebugMcu,
    gpio: gpio::Gpio,
    exti: exti::Exti,
    timers: [tim::Timer; 8],
    usarts: [usart::Usart; 4],
    can: can::Can,
    adc: adc::Adc,
    dma: [dma::Dma; 2],
    iwdg: iwdg::Iwdg,
    /// The board is not asked again before this cycle.
    board_asked: u64,
}

impl<B: Board> Soc<B> {
    /// The chip at power-up. `lsi_hz` is the watchdog's clock, nominally 32 kHz.
    pub fn new(board: B, strict: bool, lsi_hz: f64) -> Self {
        Self {
            board,
            clock: Clock::default(),
            nvic: nvic::Nvic::default(),
            memory: memory::Memory::default(),
            faults: Faults::new(strict),
            reset_request: None,
            flash_changed: false,
            scb: scb::Scb::default(),
            rcc: rcc::Rcc::default(),
            pwr: pwr::Pwr::default(),
            flash: flash::Flash::default(),
            debug: pwr::DebugMcu::default(),
            gpio: gpio::Gpio::default(),
            exti: exti::Exti::default(),
            timers: std::array::from_fn(|i| tim::Timer::new(&tim::TIMERS[i])),
            usarts: std::array::from_fn(|i| usart::Usart::new(&usart::USARTS[i])),
            can: can::Can::default(),
            adc: adc::Adc::default(),
            dma: [dma::Dma::new(1), dma::Dma::new(2)],
            iwdg: iwdg::Iwdg::new(lsi_hz),
            board_asked: 0,
        }
    }

    /// Address of the vector table in force.
    pub fn vector_table(&self) -> u32 {
        self.scb.vector_table()
    }

    /// Reset everything but flash and, unless the power goes, RAM. The board lives on and sees its wires let go.
    pub fn reset(&mut self, cause: ResetCause) {
        for unit in map::RESETTABLE {
            self.reset_unit(unit);
        }
        self.scb = scb::Scb::default();
        self.nvic = nvic::Nvic::default();
        self.pwr = pwr::Pwr::default();
        self.flash = flash::Flash::default();
        self.exti = exti::Exti::default();
        self.iwdg.reset();
        self.reset_request = None;
        self.rcc.reset();
        match cause {
            ResetCause::PowerCycle => {
                self.rcc.power_on();
                self.memory.ram.fill(memory::RAM_NOISE);
            }
            ResetCause::Software => self.rcc.flag(rcc::reset_flag::SOFTWARE | rcc::reset_flag::PIN),
            ResetCause::Watchdog => self.rcc.flag(rcc::reset_flag::IWDG | rcc::reset_flag::PIN),
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
        if let Some(levels) = self.gpio.changed(port) {
            self.catch_up_adc(self.clock.now());
            let letter = (b'A' + port as u8) as char;
            self.board.gpio_out(self.clock.seconds(), letter, levels);
        }
    }

    // ---- time

    /// The next cycle at which something happens by itself.
    pub fn next_event(&self) -> u64 {
        self.next_source().0
    }

    fn next_source(&self) -> (u64, Source) {
        let board = self.clock.cycle_at(self.board.next_event_s()).max(self.board_asked);
        let mut next = (board, Source::Board);
        let mut consider = |due: u64, source: Source| {
            if due < next.0 {
                next = (due, source);
            }
        };
        for (i, timer) in self.timers.iter().enumerate() {
            consider(timer.next_event(&self.clock), Source::Timer(i));
        }
        for (i, usart) in self.usarts.iter().enumerate() {
            consider(usart.next_event(), Source::Usart(i));
        }
        consider(self.can.next_event(), Source::Can);
        consider(self.adc.next_event(&self.dma[1], &self.clock), Source::Adc);
        consider(self.scb.next_event(), Source::SysTick);
        consider(self.iwdg.next_event(&self.clock), Source::Iwdg);
        next
    }

    /// Work off everything that is due, in order of time. Gives the next event.
    pub fn sync(&mut self) -> u64 {
        loop {
            let (due, source) = self.next_source();
            if due > self.clock.now() || self.reset_request.is_some() {
                return due;
            }
            self.happen(due, source);
        }
    }

    fn happen(&mut self, due: u64, source: Source) {
        match source {
            Source::Timer(i) => self.timers[i].sync(due, wires!(self)),
            Source::SysTick => self.scb.sync(due, &mut self.nvic),
            Source::Adc => self.catch_up_adc(due),
            Source::Iwdg => self.reset_request = Some(ResetCause::Watchdog),
            Source::Usart(i) => {
                self.catch_up_adc(due);
                self.usarts[i].sync(due, wires!(self));
            }
            Source::Can => {
                self.catch_up_adc(due);
                self.can.sync(due, wires!(self));
            }
            Source::Board => {
                self.catch_up_adc(due);
                self.board_asked = due + 1;
                for stimulus in self.board.poll(self.clock.seconds_at(due)) {
                    self.apply(stimulus, due);
                }
            }
        }
    }

    fn catch_up_adc(&mut self, at: u64) {
        let (dma, memory) = (&mut self.dma[1], &mut self.memory);
        self.adc.catch_up(at, dma, memory, wires!(self));
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
                    None => self.faults.feature("board", "a stimulus for a USART that is not modelled"),
                }
            }
            Stimulus::Pin { port, pin, high } => {
                let port = (port as usize).wrapping_sub('A' as usize);
                if port >= gpio::PORTS {
                    self.faults.feature("board", "a stimulus for a port that is not modelled");
                    return;
                }
                let before = self.gpio.inputs(port);
                self.gpio.drive(port, pin, high);
                self.exti.edges(port, before, self.gpio.inputs(port), &mut self.nvic);
            }
        }
    }

    // ---- bus

    fn clocked(&mut self, unit: Unit, address: u32, write: bool) -> bool {
        let on = gate(unit).is_none_or(|gate| self.rcc.enabled(gate));
        if !on {
            self.faults.raise(Fault::Unclocked { unit: unit.to_string(), address, write });
        }
        on
    }

    /// A load by the core.
    pub fn read(&mut self, address: u32, size: usize) -> u32 {
        self.clock.advance(ACCESS_CYCLES);
        self.sync();
        let unit = unit_at(address);
        if !self.clocked(unit, address, false) {
            return 0;
        }
        let Some(word) = self.read_word(unit, address & !3) else {
            self.faults.raise(Fault::Unmodelled { address, write: false });
            return 0;
        };
        let shifted = word >> (8 * (address & 3));
        match size {
            1 => shifted & 0xFF,
            2 => shifted & 0xFFFF,
            _ => shifted,
        }
    }

    fn read_word(&mut self, unit: Unit, address: u32) -> Option<u32> {
        let offset = address & 0x3FF;
        match unit {
            Unit::Rcc => self.rcc.read(offset),
            Unit::Pwr => self.pwr.read(offset),
            Unit::Flash => self.flash.read(offset),
            Unit::Gpio(port) => self.gpio.read(port, offset),
            Unit::Exti => self.exti.read(offset),
            Unit::Syscfg => self.exti.read_syscfg(offset),
            Unit::Iwdg => self.iwdg.read(offset),
            Unit::Timer(i) => {
                self.catch_up_adc(self.clock.now());
                self.timers[i].read(offset, wires!(self))
            }
            Unit::Usart(i) => self.usarts[i].read(offset, wires!(self)),
            Unit::Can => self.can.read(offset, &self.clock),
            Unit::Adc => {
                self.catch_up_adc(self.clock.now());
                self.adc.read(offset, wires!(self))
            }
            Unit::Dma(i) => {
                self.catch_up_adc(self.clock.now());
                self.dma[i].read(offset)
            }
            Unit::Debug => self.debug.read(offset),
            Unit::Nvic => self.nvic.read(address - map::NVIC),
            Unit::Core => self.scb.read(address, &self.clock, &mut self.nvic),
            Unit::None => None,
        }
    }

    /// A store by the core.
    pub fn write(&mut self, address: u32, size: usize, value: u32) {
        self.clock.advance(ACCESS_CYCLES);
        self.sync();
        let unit = unit_at(address);
        if !self.clocked(unit, address, true) {
            return;
        }
        if size < 4 && !map::takes_narrow_writes(unit, address) {
            self.faults.raise(Fault::Width { address, size });
        }
        if self.write_word(unit, address, size, value).is_none() {
            self.faults.raise(Fault::Unmodelled { address, write: true });
        }
    }

    fn write_word(&mut self, unit: Unit, address: u32, size: usize, value: u32) -> Option<()> {
        let offset = address & 0x3FF;
        match unit {
            Unit::Rcc => self.write_rcc(offset, value),
            Unit::Pwr => self.pwr.write(offset, value),
            Unit::Flash => {
                let stall_s = self.flash.write(offset, value, &mut self.memory)?;
                self.stall(stall_s);
                Some(())
            }
            Unit::Gpio(port) => {
                // A halfword to the upper half of BSRR.
                let value = value << (8 * (address & 3));
                self.gpio.write(port, offset & !3, value)?;
                self.tell_outputs(port);
                Some(())
            }
            Unit::Exti => self.exti.write(offset, value, &mut self.nvic),
            Unit::Syscfg => self.exti.write_syscfg(offset, value),
            Unit::Iwdg => self.iwdg.write(offset, value, &self.clock),
            Unit::Timer(i) => {
                self.catch_up_adc(self.clock.now());
                self.timers[i].write(offset, value, wires!(self))
            }
            Unit::Usart(i) => self.usarts[i].write(offset, value, wires!(self)),
            Unit::Can => self.can.write(offset, value, wires!(self)),
            Unit::Adc => {
                self.catch_up_adc(self.clock.now());
                self.adc.write(offset, value, wires!(self))
            }
            Unit::Dma(i) => {
                self.catch_up_adc(self.clock.now());
                self.dma[i].write(offset, value, &mut self.nvic, &mut self.faults)
            }
            Unit::Debug => self.debug.write(offset, value),
            Unit::Nvic => self.nvic.write(address - map::NVIC, size, value),
            Unit::Core => {
                if self.scb.write(address, size, value, &self.clock, &mut self.nvic)? == Effect::Reset {
                    self.reset_request = Some(ResetCause::Software);
                }
                Some(())
            }
            Unit::None => None,
        }
    }

    fn write_rcc(&mut self, offset: u32, value: u32) -> Option<()> {
        self.catch_up_adc(self.clock.now());
        let (register, bits) = self.rcc.write(offset, value, self.flash.wait_states(), &mut self.faults)?;
        for unit in map::RESETTABLE {
            if gate(unit).is_some_and(|gate| gate.offset == register && bits >> gate.bit & 1 == 1) {
                self.reset_unit(unit);
            }
        }
        if self.rcc.tree() != self.clock.tree() {
            for timer in &mut self.timers {
                timer.rebase(&self.clock, self.clock.now());
            }
            self.clock.retune(self.rcc.tree());
        }
        Some(())
    }

    /// A store by the core into flash.
    pub fn program_flash(&mut self, address: u32, size: usize, value: u64) {
        let stall_s = self.flash.program(address, size, value, &mut self.memory);
        self.stall(stall_s);
    }

    /// The core waits for flash: time passes, and what happens meanwhile is worked off at the next chance.
    fn stall(&mut self, seconds: f64) {
        if seconds > 0.0 {
            self.flash_changed = true;
            self.clock.advance(self.clock.span(seconds));
        }
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
