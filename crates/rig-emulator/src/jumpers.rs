//! A NUCLEO that carries only the jumper wires of the self-test (docs/selftest.md). Each wire can be missing, and parts
//! can be broken on purpose.
//!
//! A pin that is no output counts as low on its wire. The self-test reads a wire only while its other end is driven.

use crate::board::{Board, CanFrame, CanOutcome, Stimulus};
use crate::machine::{Machine, MachineError};
use std::ops::ControlFlow;

/// A pin: port letter and number.
type Pin = (char, u8);

/// A wire from an output to an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Jumper {
    /// A1 to A0: ADC1's channel 0.
    Adc,
    /// D13 to D12: encoder A, TIM3's channel 1.
    EncoderA,
    /// D10 to D11: encoder B, TIM3's channel 2.
    EncoderB,
    /// D8 to D2: USART1, TX to RX.
    Serial,
    /// D6 to D4: motor power to the emergency stop's input.
    Stop,
    /// D9 to D7: the limits' inputs, of which each drives the other in turn.
    Limits,
    /// The same wire in the other direction, D7 to D9.
    LimitsBack,
    /// D14 to D15: CAN1, TX to RX.
    Can,
}

impl Jumper {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Adc,
        Self::EncoderA,
        Self::EncoderB,
        Self::Serial,
        Self::Stop,
        Self::Limits,
        Self::LimitsBack,
        Self::Can,
    ];

    fn from(self) -> Pin {
        match self {
            Self::Adc => ('A', 1),
            Self::EncoderA => ('A', 5),
            Self::EncoderB => ('B', 6),
            Self::Serial => ('A', 9),
            Self::Stop => ('B', 10),
            Self::Limits => ('C', 7),
            Self::LimitsBack => ('A', 8),
            Self::Can => ('B', 9),
        }
    }

    fn to(self) -> Pin {
        match self {
            Self::Adc => ('A', 0),
            Self::EncoderA => ('A', 6),
            Self::EncoderB => ('A', 7),
            Self::Serial => ('A', 10),
            Self::Stop => ('B', 5),
            Self::Limits => ('A', 8),
            Self::LimitsBack => ('C', 7),
            Self::Can => ('B', 8),
        }
    }
}

/// What is wrong with the board.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Broken {
    /// This wire is not there.
    pub missing: Option<Jumper>,
    /// The input of this wire stays at one level.
    pub stuck: Option<(Jumper, bool)>,
    /// Relative error of the ADC's channel 0.
    pub adc_gain: f64,
    /// Relative error of the ADC's reading of VREFINT; the reading of VDDA has the opposite one.
    pub vrefint_gain: f64,
    /// Bits that are flipped in every byte on the serial line.
    pub serial_flips: u8,
    /// The encoder's timer misses one edge in this many; 0 for none.
    pub edges_lost: i64,
    /// Bits come back inverted on CAN1's wire.
    pub can_inverted: bool,
}

/// ADC code of VREFINT at 3.3 V, the factory's word in [`crate::machine::Config`].
const VREFINT_CODE: f64 = 1501.0;
const FULL_SCALE: f64 = 4095.0;

/// A board with jumper wires alone.
#[derive(Debug)]
pub struct JumperBoard {
    broken: Broken,
    /// Levels of the inputs.
    levels: [bool; Jumper::ALL.len()],
    /// Edges that the encoder has seen, with their sign.
    quadrature: i64,
    /// Stimuli that the pins have not had yet.
    pending: Vec<Stimulus>,
    now_s: f64,
}

impl JumperBoard {
    /// A board with all wires but the broken ones.
    pub fn new(broken: Broken) -> Self {
        let mut board =
            Self { broken, levels: [false; Jumper::ALL.len()], quadrature: 0, pending: Vec::new(), now_s: 0.0 };
        for (place, jumper) in Jumper::ALL.into_iter().enumerate() {
            if let Some((_, high)) = broken.stuck.filter(|(stuck, _)| *stuck == jumper) {
                board.levels[place] = high;
                board.drive(jumper, high);
            } else if broken.missing != Some(jumper) {
                board.drive(jumper, false);
            }
        }
        board
    }

    fn drive(&mut self, jumper: Jumper, high: bool) {
        let (port, pin) = jumper.to();
        self.pending.push(Stimulus::Pin { port, pin, high });
    }

    /// An encoder with A ahead of B counts up (RM0390 section 17.3.12, mode 3): four edges a turn of the Gray code.
    fn encoder_place(&self) -> i64 {
        match (self.levels[1], self.levels[2]) {
            (false, false) => 0,
            (true, false) => 1,
            (true, true) => 2,
            (false, true) => 3,
        }
    }
}

impl Board for JumperBoard {
    fn adc(&mut self, _t_s: f64, channel: u8) -> u16 {
        match channel {
            0 if self.levels[0] => (FULL_SCALE * (1.0 + self.broken.adc_gain)).clamp(0.0, FULL_SCALE) as u16,
            17 => (VREFINT_CODE * (1.0 + self.broken.vrefint_gain)) as u16,
            _ => 0,
        }
    }

    fn uart_tx(&mut self, t_s: f64, usart: u8, byte: u8) {
        if usart == 1 && self.broken.missing != Some(Jumper::Serial) {
            self.now_s = t_s;
            self.pending.push(Stimulus::Uart { usart, bytes: vec![byte ^ self.broken.serial_flips] });
        }
    }

    fn can_tx(&mut self, _t_s: f64, _frame: &CanFrame) -> CanOutcome {
        if self.broken.can_inverted { CanOutcome::BitError } else { CanOutcome::Unacknowledged }
    }

    fn gpio_out(&mut self, t_s: f64, port: char, levels: u16) {
        self.now_s = t_s;
        for (place, jumper) in Jumper::ALL.into_iter().enumerate() {
            let (from_port, pin) = jumper.from();
            let high = levels >> pin & 1 == 1;
            let stuck = self.broken.stuck.is_some_and(|(stuck, _)| stuck == jumper);
            let idle = from_port != port || stuck || self.broken.missing == Some(jumper);
            if idle || self.levels[place] == high {
                continue;
            }
            let before = self.encoder_place();
            self.levels[place] = high;
            self.quadrature += match (self.encoder_place() - before).rem_euclid(4) {
                1 => 1,
                3 => -1,
                _ => 0,
            };
            self.drive(jumper, high);
        }
    }

    fn quadrature(&mut self, _t_s: f64, timer: u8) -> i64 {
        match (timer, self.broken.edges_lost) {
            (3, 0) => self.quadrature,
            (3, lost) => self.quadrature - self.quadrature / lost,
            _ => 0,
        }
    }

    fn next_event_s(&self) -> f64 {
        if self.pending.is_empty() { f64::INFINITY } else { self.now_s }
    }

    fn poll(&mut self, _t_s: f64) -> Vec<Stimulus> {
        std::mem::take(&mut self.pending)
    }
}

/// Beginning of the self-test's last line.
pub const END: &str = "selftest ended: ";
/// How long the self-test may take on the emulated board (s). With the slowest LSI the watchdog's reset takes 1 s.
const LONGEST_S: f64 = 30.0;
/// The log is read this often (s).
const STEP_S: f64 = 0.01;

/// Why a self-test gave no result.
#[derive(Debug, thiserror::Error)]
pub enum SelfTestError {
    /// The chip or the image.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// It did not end in time.
    #[error("the self-test has not ended after {LONGEST_S} s of emulated time")]
    NoEnd,
}

/// Runs the self-test to its end, and gives each line of its log to `line`, with the machine.
///
/// # Errors
/// If the machine stops, or the self-test does not end.
pub fn run(
    machine: &mut Machine<JumperBoard>,
    mut line: impl FnMut(&str, &mut Machine<JumperBoard>),
) -> Result<(), SelfTestError> {
    let end_s = machine.now_s() + LONGEST_S;
    while machine.now_s() < end_s {
        let ran = machine.run_until(machine.now_s() + STEP_S);
        let lines = machine.defmt_lines();
        let told = lines.iter().try_for_each(|l| {
            line(&l.message, machine);
            if l.message.starts_with(END) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        if told.is_break() {
            return Ok(());
        }
        ran?;
    }
    Err(SelfTestError::NoEnd)
}
