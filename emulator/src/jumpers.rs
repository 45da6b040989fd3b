//! A NUCLEO without a rig: jumper wires from pin to pin, for the self-test (src/bin/selftest/README.md) and for any
//! other program (emulator/own-program.md). Each wire can be missing, and parts can be broken on purpose.
//!
//! A wire carries the level of the end that drives it. Where neither does, each pin follows its own pull. A USART's
//! bytes go along a wire as whole characters, so a pin that reads such a wire as GPIO sees nothing of them.

use crate::machine::{Machine, MachineError};
use crate::soc::adc;
use crate::soc::gpio::{Outputs, Pin};
use crate::soc::tim::encoder_pins;
use crate::soc::usart::USARTS;
use rig_plant::board::{Board, CanFrame, CanOutcome, Stimulus};
use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

/// A wire between two pins. Where it is broken on purpose, the second one is the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Jumper(pub Pin, pub Pin);

impl Jumper {
    /// A1 to A0: ADC1's channel 0.
    pub const ADC: Self = Self(('A', 1), ('A', 0));
    /// D13 to D12: encoder A, TIM3's channel 1.
    pub const ENCODER_A: Self = Self(('A', 5), ('A', 6));
    /// D10 to D11: encoder B, TIM3's channel 2.
    pub const ENCODER_B: Self = Self(('B', 6), ('A', 7));
    /// D8 to D2: USART1, TX to RX.
    pub const SERIAL: Self = Self(('A', 9), ('A', 10));
    /// D6 to D4: motor power to the emergency stop's input.
    pub const STOP: Self = Self(('B', 10), ('B', 5));
    /// D9 to D7: the limits' inputs, of which each drives the other in turn.
    pub const LIMITS: Self = Self(('C', 7), ('A', 8));
    /// D14 to D15: CAN1, TX to RX.
    pub const CAN: Self = Self(('B', 9), ('B', 8));
    /// Those of the self-test.
    pub const SELFTEST: [Self; 7] =
        [Self::ADC, Self::ENCODER_A, Self::ENCODER_B, Self::SERIAL, Self::STOP, Self::LIMITS, Self::CAN];

    /// The other end, if the wire has one at `pin`.
    fn other(self, pin: Pin) -> Option<Pin> {
        if self.0 == pin { Some(self.1) } else { (self.1 == pin).then_some(self.0) }
    }
}

/// Not two pins.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no jumper: two pins from PA0 to PH15, for example PA9-PA10")]
pub struct BadJumper(String);

impl FromStr for Jumper {
    type Err = BadJumper;

    fn from_str(text: &str) -> Result<Self, BadJumper> {
        let pin = |name: &str| {
            let mut letters = name.strip_prefix('P')?.chars();
            let port = letters.next().filter(|port| ('A'..='H').contains(port))?;
            let number = letters.as_str().parse().ok().filter(|number| *number < 16)?;
            Some((port, number))
        };
        let pins = text.split_once('-').and_then(|(a, b)| Some((pin(a)?, pin(b)?)));
        pins.filter(|(a, b)| a != b).map(|(a, b)| Self(a, b)).ok_or_else(|| BadJumper(text.to_owned()))
    }
}

impl fmt::Display for Jumper {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self((a, i), (b, k)) = self;
        write!(f, "P{a}{i}-P{b}{k}")
    }
}

/// What is wrong with the board.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Broken {
    /// This wire is not there.
    pub missing: Option<Jumper>,
    /// The input of this wire stays at one level.
    pub stuck: Option<(Jumper, bool)>,
    /// Relative error of the ADC's channels.
    pub adc_gain: f64,
    /// Relative error of the ADC's reading of VREFINT; the reading of VDDA has the opposite one.
    pub vrefint_gain: f64,
    /// Bits that are flipped in every byte on a serial line.
    pub serial_flips: u8,
    /// The encoder's timer misses one edge in this many; 0 for none.
    pub edges_lost: i64,
    /// Bits come back inverted on CAN1's wire.
    pub can_inverted: bool,
}

/// ADC code of VREFINT at 3.3 V, the factory's word in [`crate::machine::Config`].
const VREFINT_CODE: f64 = 1501.0;
const FULL_SCALE: f64 = 4095.0;
/// The USART that the NUCLEO wires to its ST-LINK, whose virtual serial port it is.
const CONSOLE: u8 = 2;

/// A board with jumper wires alone.
#[derive(Debug)]
pub struct JumperBoard {
    wires: Vec<Jumper>,
    broken: Broken,
    outputs: BTreeMap<char, Outputs>,
    /// Levels that wires give to pins.
    given: BTreeMap<Pin, bool>,
    /// Edges that each timer's encoder inputs have seen, with their sign.
    quadrature: BTreeMap<u8, i64>,
    /// Stimuli that the pins have not had yet.
    pending: Vec<Stimulus>,
    now_s: f64,
    /// Bytes to the ST-LINK's serial port.
    console: Vec<u8>,
}

impl JumperBoard {
    /// A board with these wires but the broken ones.
    pub fn new(wires: &[Jumper], broken: Broken) -> Self {
        let sound =
            |wire: &Jumper| broken.missing != Some(*wire) && broken.stuck.is_none_or(|(stuck, _)| stuck != *wire);
        let mut board = Self {
            wires: wires.iter().copied().filter(sound).collect(),
            broken,
            outputs: BTreeMap::new(),
            given: BTreeMap::new(),
            quadrature: BTreeMap::new(),
            pending: Vec::new(),
            now_s: 0.0,
            console: Vec::new(),
        };
        board.settle();
        board
    }

    /// The level at which the chip drives a pin.
    fn driven(&self, (port, pin): Pin) -> Option<bool> {
        let outputs = self.outputs.get(&port)?;
        (outputs.driven >> pin & 1 == 1).then_some(outputs.levels >> pin & 1 == 1)
    }

    /// Gives each pin what its wires carry now.
    fn settle(&mut self) {
        let mut levels = BTreeMap::new();
        for &Jumper(a, b) in &self.wires {
            for (from, to) in [(a, b), (b, a)] {
                if let Some(high) = self.driven(from) {
                    levels.insert(to, high);
                }
            }
        }
        if let Some((stuck, high)) = self.broken.stuck {
            levels.insert(stuck.1, high);
        }
        let before = std::mem::replace(&mut self.given, levels);
        for &(port, pin) in before.keys().filter(|pin| !self.given.contains_key(pin)) {
            self.pending.push(Stimulus::Release { port, pin });
        }
        for (&(port, pin), &high) in self.given.iter().filter(|(pin, high)| before.get(pin) != Some(high)) {
            self.pending.push(Stimulus::Pin { port, pin, high });
        }
        for timer in 2..=5 {
            let step = (encoder_place(timer, &self.given) - encoder_place(timer, &before)).rem_euclid(4);
            *self.quadrature.entry(timer).or_default() += match step {
                1 => 1,
                3 => -1,
                _ => 0,
            };
        }
    }

    /// Whole lines that the chip has sent to the ST-LINK's serial port.
    fn console_lines(&mut self) -> Vec<String> {
        let Some(end) = self.console.iter().rposition(|&byte| byte == b'\n') else { return Vec::new() };
        let text: Vec<u8> = self.console.drain(..=end).collect();
        String::from_utf8_lossy(&text).lines().map(|line| line.trim_end_matches('\r').to_owned()).collect()
    }
}

/// An encoder with A ahead of B counts up (RM0390 section 17.3.12, mode 3): four edges a turn of the Gray code.
fn encoder_place(timer: u8, levels: &BTreeMap<Pin, bool>) -> i64 {
    let Some((_, a, b)) = encoder_pins(timer) else { return 0 };
    let high = |pins: &[Pin]| pins.iter().any(|pin| levels.get(pin) == Some(&true));
    match (high(a), high(b)) {
        (false, false) => 0,
        (true, false) => 1,
        (true, true) => 2,
        (false, true) => 3,
    }
}

impl Board for JumperBoard {
    fn adc(&mut self, _t_s: f64, channel: u8) -> u16 {
        if channel == 17 {
            return (VREFINT_CODE * (1.0 + self.broken.vrefint_gain)) as u16;
        }
        let high = adc::pin(channel).is_some_and(|pin| self.given.get(&pin) == Some(&true));
        if high { (FULL_SCALE * (1.0 + self.broken.adc_gain)).clamp(0.0, FULL_SCALE) as u16 } else { 0 }
    }

    /// The other end begins to receive at the same time, so that its stop bit is the sender's.
    fn uart_starts(&mut self, t_s: f64, pin: Pin, byte: u8) {
        for other in self.wires.iter().filter_map(|wire| wire.other(pin)) {
            if let Some(kind) = USARTS.iter().find(|kind| kind.rx.contains(&other)) {
                self.now_s = t_s;
                self.pending.push(Stimulus::Uart { usart: kind.number, bytes: vec![byte ^ self.broken.serial_flips] });
            }
        }
    }

    fn uart_tx(&mut self, _t_s: f64, usart: u8, byte: u8) {
        if usart == CONSOLE {
            self.console.push(byte);
        }
    }

    fn can_tx(&mut self, _t_s: f64, _frame: &CanFrame) -> CanOutcome {
        if self.broken.can_inverted { CanOutcome::BitError } else { CanOutcome::Unacknowledged }
    }

    fn gpio_drives(&mut self, _t_s: f64, port: char, driven: u16) {
        self.outputs.entry(port).or_default().driven = driven;
    }

    fn gpio_out(&mut self, t_s: f64, port: char, levels: u16) {
        self.now_s = t_s;
        self.outputs.entry(port).or_default().levels = levels;
        self.settle();
    }

    fn quadrature(&mut self, _t_s: f64, timer: u8) -> i64 {
        let edges = self.quadrature.get(&timer).copied().unwrap_or(0);
        match self.broken.edges_lost {
            0 => edges,
            lost => edges - edges / lost,
        }
    }

    fn next_event_s(&self) -> f64 {
        if self.pending.is_empty() { f64::INFINITY } else { self.now_s }
    }

    fn poll(&mut self, _t_s: f64) -> Vec<Stimulus> {
        std::mem::take(&mut self.pending)
    }
}

/// The log is read this often (s).
const STEP_S: f64 = 0.01;

/// When a run is over.
#[derive(Clone, Debug, PartialEq)]
pub struct Ends {
    /// Parts of a log line that mean success.
    pub ok: Vec<String>,
    /// Parts of a log line that mean failure. A line that has both is a success.
    pub fail: Vec<String>,
    /// Emulated time (s).
    pub limit_s: f64,
}

impl Ends {
    /// Those of the self-test. With the slowest LSI the watchdog's reset takes 1 s.
    pub fn selftest() -> Self {
        Self { ok: vec!["selftest ended: all".into()], fail: vec!["selftest ended: ".into()], limit_s: 30.0 }
    }
}

/// How a run has ended.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// A line of success, or BKPT where no such line was asked for.
    Passed,
    /// A line of failure, an exit with an error, or BKPT before the line of success.
    Failed,
    /// The time is up.
    TimeLimit,
    /// The machine cannot go on.
    Stopped(MachineError),
}

/// Runs a program to its end, and gives each line of its log and of the ST-LINK's serial port to `line`, with the machine.
pub fn run(
    machine: &mut Machine<JumperBoard>,
    ends: &Ends,
    mut line: impl FnMut(&str, &mut Machine<JumperBoard>),
) -> End {
    let end_s = machine.now_s() + ends.limit_s;
    while machine.now_s() < end_s {
        let ran = machine.run_until(end_s.min(machine.now_s() + STEP_S));
        let mut lines: Vec<String> = machine.defmt_lines().into_iter().map(|line| line.message).collect();
        lines.append(&mut machine.board_mut().console_lines());
        for text in lines {
            line(&text, machine);
            let has = |parts: &[String]| parts.iter().any(|part| text.contains(part));
            if has(&ends.ok) {
                return End::Passed;
            }
            if has(&ends.fail) {
                return End::Failed;
            }
        }
        match ran {
            Ok(()) => {}
            Err(MachineError::Breakpoint { exit: Some(success), .. }) => {
                return if success && ends.ok.is_empty() { End::Passed } else { End::Failed };
            }
            Err(error) => return End::Stopped(error),
        }
    }
    End::TimeLimit
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::soc::{Config, Soc};

    const GPIOA: u32 = 0x4002_0000;
    const USART1: u32 = 0x4001_1000;

    fn chip(wires: &[&str]) -> Soc<JumperBoard> {
        let wires: Vec<Jumper> = wires.iter().map(|text| text.parse().expect("two pins")).collect();
        let mut chip = Soc::new(JumperBoard::new(&wires, Broken::default()), &Config::default());
        chip.write(0x4002_3830, 4, 0x87);
        chip.write(0x4002_3844, 4, 1 << 4);
        chip
    }

    fn pass(chip: &mut Soc<JumperBoard>, cycles: u64) {
        let end = chip.clock.now() + cycles;
        while chip.clock.now() < end {
            chip.sleep(end);
        }
    }

    fn high(chip: &mut Soc<JumperBoard>, pin: u32) -> bool {
        chip.read(GPIOA + 0x10, 4) >> pin & 1 == 1
    }

    #[test]
    fn pins_are_read_and_refused_by_name() {
        assert_eq!("PA9-PA10".parse(), Ok(Jumper::SERIAL));
        assert_eq!(Jumper::ENCODER_B.to_string(), "PB6-PA7");
        for bad in ["PA9", "PA9-PA16", "PI1-PA0", "A9-A10", "PA9-PA9", ""] {
            assert!(bad.parse::<Jumper>().is_err_and(|error| error.to_string().contains("PA9-PA10")), "{bad}");
        }
    }

    #[test]
    fn a_character_takes_one_character_time_from_pin_to_pin() {
        let mut chip = chip(&["PA10-PA9"]);
        chip.write(GPIOA, 4, 0xA800_0000 | 0b1010 << 18);
        chip.write(GPIOA + 0x24, 4, 0x770);
        chip.write(USART1 + 8, 4, 100);
        chip.write(USART1 + 12, 4, 0x200C);
        for byte in [0x5A, 0xC3] {
            chip.write(USART1 + 4, 4, byte);
        }
        // Ten bits of 100 cycles, less what the writes have taken.
        pass(&mut chip, 990);
        assert_eq!(chip.read(USART1, 4) & 0x20, 0);
        pass(&mut chip, 20);
        assert_eq!(chip.read(USART1, 4) & 0x30, 0x20);
        assert_eq!(chip.read(USART1 + 4, 4), 0x5A);
        pass(&mut chip, 1000);
        assert_eq!(chip.read(USART1, 4) & 0x70, 0x60, "received when the sender is done, and not idle in between");
        assert_eq!(chip.read(USART1 + 4, 4), 0xC3);
        assert_eq!(chip.faults.take(), None);
    }

    #[test]
    fn a_wire_carries_a_level_both_ways_and_leaves_an_undriven_pin_to_its_pull() {
        let mut chip = chip(&["PA9-PA8"]);
        // PA8 is an input with its pull-up on; PA9 becomes an output, low.
        chip.write(GPIOA + 12, 4, 1 << 16);
        assert!(high(&mut chip, 8));
        chip.write(GPIOA, 4, 0xA800_0000 | 1 << 18);
        assert!(!high(&mut chip, 8));
        chip.write(GPIOA + 0x18, 4, 1 << 9);
        assert!(high(&mut chip, 8));
        // The other way round, with the pull-up still on.
        chip.write(GPIOA, 4, 0xA800_0000 | 1 << 16);
        assert!(!high(&mut chip, 9));
        // An open-drain output that is high lets its wire go: the pull-down of PA9 wins.
        chip.write(GPIOA + 4, 4, 1 << 8);
        chip.write(GPIOA + 0x18, 4, 1 << 8);
        chip.write(GPIOA + 12, 4, 2 << 18);
        assert!(!high(&mut chip, 9));
        chip.write(GPIOA + 12, 4, 1 << 18);
        assert!(high(&mut chip, 9));
        chip.write(GPIOA + 0x18, 4, 1 << 24);
        assert!(!high(&mut chip, 9));
        assert_eq!(chip.faults.take(), None);
    }
}
