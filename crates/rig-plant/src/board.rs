//! The seam between the emulated microcontroller and whatever is wired to its pins.
//!
//! The machine calls a [`Board`] with the emulated time; the board answers with what the wires carry.
//! Time is in seconds since power-up and never runs backwards.

/// A classic CAN frame as the bus carries it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanFrame {
    /// 11-bit or 29-bit identifier.
    pub id: u32,
    /// 29-bit identifier.
    pub extended: bool,
    /// Remote frame.
    pub remote: bool,
    /// Data length, 0 to 8.
    pub dlc: u8,
    /// Payload; bytes past `dlc` are 0.
    pub data: [u8; 8],
}

/// What became of a frame that the microcontroller put on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanOutcome {
    /// At least one other node acknowledged it.
    Acknowledged,
    /// Nobody did: the controller counts a transmit error and, by default, tries again.
    Unacknowledged,
    /// The bus was disturbed (short, dominant level): a bit error, which leads to bus-off.
    BitError,
}

/// An input that the board drives from outside.
#[derive(Clone, Debug, PartialEq)]
pub enum Stimulus {
    /// A frame from another node, starting now (or when the bus is next free).
    Can(CanFrame),
    /// Bytes on a USART's receive line, back to back, starting now.
    Uart {
        /// USART number, 1 to 6.
        usart: u8,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// A level on a GPIO input pin.
    Pin {
        /// Port letter, 'A' to 'H'.
        port: char,
        /// Pin number, 0 to 15.
        pin: u8,
        /// Level, `true` is high.
        high: bool,
    },
    /// A GPIO pin is left to the chip's own pull.
    Release {
        /// Port letter, 'A' to 'H'.
        port: char,
        /// Pin number, 0 to 15.
        pin: u8,
    },
    /// The bus is free of disturbance again (bus-off recovery may proceed).
    CanQuiet,
}

/// Everything wired to the microcontroller.
pub trait Board {
    /// The sample that ADC1 takes on `channel` at `t_s`: 12-bit code, 0 to 4095.
    fn adc(&mut self, t_s: f64, channel: u8) -> u16;

    /// A byte begins on the pin of a USART's transmit line; [`Board::uart_tx`] follows at the end of its stop bit.
    fn uart_starts(&mut self, _t_s: f64, _pin: (char, u8), _byte: u8) {}

    /// A byte has left the transmit line of a USART.
    fn uart_tx(&mut self, t_s: f64, usart: u8, byte: u8);

    /// A frame has been sent on CAN1.
    fn can_tx(&mut self, t_s: f64, frame: &CanFrame) -> CanOutcome;

    /// Which pins of a port drive their wires: outputs, and of the open-drain ones those that are low. Comes before
    /// [`Board::gpio_out`].
    fn gpio_drives(&mut self, _t_s: f64, _port: char, _driven: u16) {}

    /// An output register changed.
    fn gpio_out(&mut self, t_s: f64, port: char, levels: u16);

    /// Quadrature counts of the encoder on the two channels of `timer` (as many edges as A and B made since power-up).
    fn quadrature(&mut self, t_s: f64, timer: u8) -> i64;

    /// When the board next wants [`Board::poll`] to be called, in seconds; `f64::INFINITY` if never.
    fn next_event_s(&self) -> f64;

    /// Advance to `t_s` and hand over everything that the board does to the pins until then.
    fn poll(&mut self, t_s: f64) -> Vec<Stimulus>;
}
