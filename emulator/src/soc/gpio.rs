//! General-purpose I/O (RM0390 chapter 7).
//!
//! The board sees only pins that drive their wire: outputs, and of the open-drain ones those that are low. A pin that a
//! reset has made an input drives no longer.

use super::fault::{Faults, Lint};
use super::peripheral::{Registers, registers};

/// Ports A to H.
pub const PORTS: usize = 8;

/// What a pin does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// Digital input.
    Input,
    /// Digital output.
    Output,
    /// Alternate function 0 to 15.
    Alternate(u8),
    /// Analog.
    Analog,
}

/// A pin: port letter and number.
pub type Pin = (char, u8);

/// The pins of a port that drive their wires.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// Pins that drive.
    pub driven: u16,
    /// Those of them that are high.
    pub levels: u16,
}

registers! {
    MODER = 0x00, OTYPER = 0x04, OSPEEDR = 0x08, PUPDR = 0x0C, IDR = 0x10, ODR = 0x14, BSRR = 0x18, AFRL = 0x20, AFRH = 0x24,
}

#[derive(Clone, Debug)]
struct Port {
    registers: Registers<10>,
    /// Pins that the board drives, and their levels.
    driven: u16,
    levels: u16,
    /// What the board was last given.
    reported: Outputs,
}

impl Port {
    /// The port after a reset: of A and B, the pins of the debugger are in use.
    fn new(port: usize) -> Self {
        let mut registers = Registers::new(REGISTERS);
        (registers[MODER], registers[OSPEEDR], registers[PUPDR]) = match port {
            0 => (0xA800_0000, 0x0C00_0000, 0x6400_0000),
            1 => (0x0000_0280, 0x0000_00C0, 0x0000_0100),
            _ => (0, 0, 0),
        };
        Self { registers, driven: 0, levels: 0, reported: Outputs::default() }
    }

    /// Pins whose field of two bits has this value.
    fn pins(&self, register: u32, value: u32) -> u16 {
        let is = |pin: &u32| self.registers[register] >> (2 * pin) & 3 == value;
        (0..16).filter(is).fold(0, |mask, pin| mask | 1 << pin)
    }

    fn pulled_up(&self) -> u16 {
        self.pins(PUPDR, 1)
    }

    /// An open-drain output that is high leaves its wire to others.
    fn outputs(&self) -> Outputs {
        let odr = self.registers[ODR] as u16;
        let driven = self.pins(MODER, 1) & !(self.registers[OTYPER] as u16 & odr);
        Outputs { driven, levels: odr & driven }
    }

    fn inputs(&self) -> u16 {
        let Outputs { driven, levels } = self.outputs();
        let outside = (self.levels & self.driven) | (self.pulled_up() & !self.driven);
        (levels | (outside & !driven)) & !self.pins(MODER, 3)
    }
}

/// All ports.
#[derive(Debug)]
pub struct Gpio {
    ports: [Port; PORTS],
}

impl Default for Gpio {
    fn default() -> Self {
        Self { ports: std::array::from_fn(Port::new) }
    }
}

impl Gpio {
    /// Reset values of a port; what the board drives stays.
    pub fn reset(&mut self, port: usize) {
        self.ports[port].registers = Port::new(port).registers;
    }

    /// What a pin does.
    pub fn function(&self, (port, pin): Pin) -> Function {
        let registers = &self.ports[port as usize - 'A' as usize].registers;
        match registers[MODER] >> (2 * pin) & 3 {
            0 => Function::Input,
            1 => Function::Output,
            2 => Function::Alternate((registers[AFRL + u32::from(pin / 8 * 4)] >> (4 * (pin % 8)) & 0xF) as u8),
            _ => Function::Analog,
        }
    }

    /// A pin has its pull-up on.
    pub fn pulls_up(&self, (port, pin): Pin) -> bool {
        self.ports[port as usize - 'A' as usize].pulled_up() >> pin & 1 == 1
    }

    /// Require that `signal` reaches one of the pins that can carry it.
    pub fn require(&self, signal: &'static str, function: Function, pins: &[Pin], faults: &mut Faults) {
        if !pins.iter().any(|&pin| self.function(pin) == function) {
            let names: Vec<String> = pins.iter().map(|(port, pin)| format!("P{port}{pin}")).collect();
            let what = format!("{signal} is not on a pin: {} as {function:?}", names.join(" or "));
            faults.raise(Lint::PinFunction, what);
        }
    }

    /// Levels on a port's pins.
    pub fn inputs(&self, port: usize) -> u16 {
        self.ports[port].inputs()
    }

    /// The board drives a pin, or leaves it alone. Nothing happens if there is no such pin.
    pub fn drive(&mut self, port: usize, pin: u8, level: Option<bool>) {
        if let Some(port) = self.ports.get_mut(port)
            && pin < 16
        {
            let bit = 1 << pin;
            port.driven = if level.is_some() { port.driven | bit } else { port.driven & !bit };
            port.levels = if level == Some(true) { port.levels | bit } else { port.levels & !bit };
        }
    }

    /// What the port drives, if the board has not been given it yet.
    pub fn changed(&mut self, port: usize) -> Option<Outputs> {
        let port = &mut self.ports[port];
        let outputs = port.outputs();
        (std::mem::replace(&mut port.reported, outputs) != outputs).then_some(outputs)
    }

    /// Read a register of a port.
    pub fn read(&self, port: usize, offset: u32) -> Option<u32> {
        let port = &self.ports[port];
        if offset == IDR { Some(port.inputs().into()) } else { port.registers.get(offset) }
    }

    /// Write a register of a port.
    pub fn write(&mut self, port: usize, offset: u32, value: u32) -> Option<()> {
        let registers = &mut self.ports[port].registers;
        match offset {
            // Read-only.
            IDR => return None,
            ODR => registers[ODR] = value & 0xFFFF,
            // Setting wins over resetting.
            BSRR => registers[ODR] = registers[ODR] & !(value >> 16) | value & 0xFFFF,
            _ => registers.set(offset, value)?,
        }
        Some(())
    }
}
