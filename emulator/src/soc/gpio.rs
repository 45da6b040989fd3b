//! General-purpose I/O (RM0390 chapter 7).
//!
//! The board sees only pins that drive their wire: outputs, and of the open-drain ones those that are low. A pin that a
//! reset has made an input drives no longer.

use super::fault::{Fault, Faults};

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

#[derive(Clone, Debug, Default)]
struct Port {
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    odr: u16,
    afr: [u32; 2],
    /// Pins that the board drives, and their levels.
    driven: u16,
    levels: u16,
    /// What the board was last given.
    reported: Outputs,
}

impl Port {
    fn mask(&self, mode: u32) -> u16 {
        (0..16).filter(|pin| self.moder >> (2 * pin) & 3 == mode).fold(0, |mask, pin| mask | 1 << pin)
    }

    fn pulled_up(&self) -> u16 {
        (0..16).filter(|pin| self.pupdr >> (2 * pin) & 3 == 1).fold(0, |mask, pin| mask | 1 << pin)
    }

    /// An open-drain output that is high leaves its wire to others.
    fn outputs(&self) -> Outputs {
        let driven = self.mask(1) & !(self.otyper as u16 & self.odr);
        Outputs { driven, levels: self.odr & driven }
    }

    fn inputs(&self) -> u16 {
        let Outputs { driven, levels } = self.outputs();
        let outside = (self.levels & self.driven) | (self.pulled_up() & !self.driven);
        (levels | (outside & !driven)) & !self.mask(3)
    }
}

/// All ports.
#[derive(Debug)]
pub struct Gpio {
    ports: [Port; PORTS],
}

impl Default for Gpio {
    fn default() -> Self {
        let mut gpio = Self { ports: Default::default() };
        (0..PORTS).for_each(|port| gpio.reset(port));
        gpio
    }
}

impl Gpio {
    /// Reset values of a port; what the board drives stays.
    pub fn reset(&mut self, port: usize) {
        let old = std::mem::take(&mut self.ports[port]);
        let (moder, ospeedr, pupdr) = match port {
            0 => (0xA800_0000, 0x0C00_0000, 0x6400_0000),
            1 => (0x0000_0280, 0x0000_00C0, 0x0000_0100),
            _ => (0, 0, 0),
        };
        let Port { driven, levels, reported, .. } = old;
        self.ports[port] = Port { moder, ospeedr, pupdr, driven, levels, reported, ..Port::default() };
    }

    /// What a pin does.
    pub fn function(&self, (port, pin): Pin) -> Function {
        let port = &self.ports[port as usize - 'A' as usize];
        match port.moder >> (2 * pin) & 3 {
            0 => Function::Input,
            1 => Function::Output,
            2 => Function::Alternate((port.afr[usize::from(pin / 8)] >> (4 * (pin % 8)) & 0xF) as u8),
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
            let wanted = format!("{} as {function:?}", names.join(" or "));
            faults.raise(Fault::PinFunction { signal, wanted });
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
        Some(match offset {
            0x00 => port.moder,
            0x04 => port.otyper,
            0x08 => port.ospeedr,
            0x0C => port.pupdr,
            0x10 => port.inputs().into(),
            0x14 => port.odr.into(),
            0x18 => 0,
            0x20 => port.afr[0],
            0x24 => port.afr[1],
            _ => return None,
        })
    }

    /// Write a register of a port.
    pub fn write(&mut self, port: usize, offset: u32, value: u32) -> Option<()> {
        let port = &mut self.ports[port];
        match offset {
            0x00 => port.moder = value,
            0x04 => port.otyper = value,
            0x08 => port.ospeedr = value,
            0x0C => port.pupdr = value,
            0x14 => port.odr = value as u16,
            // Setting wins over resetting.
            0x18 => port.odr = port.odr & !((value >> 16) as u16) | value as u16,
            0x20 => port.afr[0] = value,
            0x24 => port.afr[1] = value,
            _ => return None,
        }
        Some(())
    }
}
