//! A board that records what it is told, and a chip to poke at without a core.

use rig_emulator::machine::Machine;
pub use rig_emulator::soc::{Config, Soc};
use rig_plant::board::{Board, CanFrame, CanOutcome, Stimulus};
use std::collections::VecDeque;

/// Remembers everything; insists that time never runs backwards.
pub struct Recorder {
    pub last_s: f64,
    pub bytes: Vec<(f64, u8, u8)>,
    pub frames: Vec<(f64, CanFrame)>,
    pub outcome: CanOutcome,
    pub outputs: Vec<(f64, char, u16)>,
    pub samples: Vec<(f64, u8)>,
    pub wheel: i64,
    /// What to do when, in order of time.
    pub plan: VecDeque<(f64, Stimulus)>,
}

impl Default for Recorder {
    fn default() -> Self {
        Self {
            last_s: 0.0,
            bytes: Vec::new(),
            frames: Vec::new(),
            outcome: CanOutcome::Acknowledged,
            outputs: Vec::new(),
            samples: Vec::new(),
            wheel: 0,
            plan: VecDeque::new(),
        }
    }
}

impl Recorder {
    fn at(&mut self, t_s: f64) {
        assert!(t_s >= self.last_s, "time ran back from {} to {t_s}", self.last_s);
        self.last_s = t_s;
    }
}

impl Board for Recorder {
    fn adc(&mut self, t_s: f64, channel: u8) -> u16 {
        self.at(t_s);
        self.samples.push((t_s, channel));
        self.samples.len() as u16
    }

    fn uart_tx(&mut self, t_s: f64, usart: u8, byte: u8) {
        self.at(t_s);
        self.bytes.push((t_s, usart, byte));
    }

    fn can_tx(&mut self, t_s: f64, frame: &CanFrame) -> CanOutcome {
        self.at(t_s);
        self.frames.push((t_s, *frame));
        self.outcome
    }

    fn gpio_out(&mut self, t_s: f64, port: char, levels: u16) {
        self.at(t_s);
        self.outputs.push((t_s, port, levels));
    }

    fn quadrature(&mut self, t_s: f64, _timer: u8) -> i64 {
        self.at(t_s);
        self.wheel
    }

    fn next_event_s(&self) -> f64 {
        self.plan.front().map_or(f64::INFINITY, |(t_s, _)| *t_s)
    }

    fn poll(&mut self, t_s: f64) -> Vec<Stimulus> {
        self.at(t_s);
        let due = self.plan.iter().take_while(|(at, _)| *at <= t_s).count();
        self.plan.drain(..due).map(|(_, stimulus)| stimulus).collect()
    }
}

pub type Chip = Soc<Recorder>;

pub const RCC: u32 = 0x4002_3800;
pub const GPIOA: u32 = 0x4002_0000;
pub const GPIOB: u32 = 0x4002_0400;
pub const GPIOC: u32 = 0x4002_0800;

/// A strict chip at power-up, on its 16 MHz HSI, with every modelled peripheral's clock on.
pub fn chip() -> Chip {
    chip_of(&Config::default())
}

/// The same of another configuration.
pub fn chip_of(config: &Config) -> Chip {
    let mut chip = Soc::new(Recorder::default(), config);
    set(&mut chip, RCC + 0x30, 0x0060_00FF);
    set(&mut chip, RCC + 0x40, 0x1206_007F);
    set(&mut chip, RCC + 0x44, 0x0001_4130);
    chip
}

/// A machine that has just been switched on.
pub fn machine(elf: &[u8]) -> Machine<Recorder> {
    Machine::new(elf, Recorder::default(), Config::default()).expect("a machine")
}

/// A word of its memory.
pub fn word(machine: &mut Machine<Recorder>, address: u32) -> u32 {
    machine.soc_mut().memory.word(address).expect("in memory")
}

/// Store a word; no fault may come of it.
pub fn set(chip: &mut Chip, address: u32, value: u32) {
    chip.write(address, 4, value);
    assert_eq!(chip.faults.take(), None);
}

/// What a strict chip has refused since the last call, in words; empty if nothing.
pub fn refused(chip: &mut Chip) -> String {
    chip.faults.take().map_or_else(String::new, |fault| fault.to_string())
}

/// Load a word; no fault may come of it.
pub fn get(chip: &mut Chip, address: u32) -> u32 {
    let value = chip.read(address, 4);
    assert_eq!(chip.faults.take(), None);
    value
}

/// Let time pass.
pub fn pass(chip: &mut Chip, seconds: f64) {
    let end = chip.clock.cycle_at(chip.clock.seconds() + seconds);
    while chip.clock.now() < end && chip.reset_request.is_none() {
        chip.sleep(end);
    }
}

/// An interrupt is pending in the NVIC.
pub fn pending(chip: &mut Chip, irq: u32) -> bool {
    get(chip, 0xE000_E200 + irq / 32 * 4) >> (irq % 32) & 1 == 1
}

/// Make a pin an alternate function.
pub fn alternate(chip: &mut Chip, port: u32, pin: u32, function: u32) {
    let moder = get(chip, port);
    set(chip, port, moder & !(3 << (2 * pin)) | 2 << (2 * pin));
    let register = port + 0x20 + pin / 8 * 4;
    let shift = 4 * (pin % 8);
    let afr = get(chip, register);
    set(chip, register, afr & !(0xF << shift) | function << shift);
}

/// Make a pin analog (3), an output (1) or an input (0).
pub fn mode(chip: &mut Chip, port: u32, pin: u32, mode: u32) {
    let moder = get(chip, port);
    set(chip, port, moder & !(3 << (2 * pin)) | mode << (2 * pin));
}

/// `actual` is within `tolerance` of `wanted`.
pub fn close(actual: f64, wanted: f64, tolerance: f64) {
    assert!((actual - wanted).abs() <= tolerance, "{actual} is not within {tolerance} of {wanted}");
}
