//! What can be broken in an emulated rig, by the names that scripts use (docs/reference/simulator.md), and what that
//! does to the rig.

use super::EmulatedRig;
use super::encoder::Wires;
use super::motor::Bridge;
use super::plant::Plant;
use crate::board::Stimulus;
use rig_config::DriveTransport;
use serde::{Deserialize, Serialize};

/// Declares an enum with one name for each variant, and the list of all of them.
macro_rules! named_faults {
    ($(#[$doc:meta])* pub enum $name:ident { $($(#[$variant_doc:meta])* $variant:ident = $text:literal,)+ }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name {
            $($(#[$variant_doc])* $variant,)+
        }

        impl $name {
            /// Every fault.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The name as scripts write it.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }
        }
    };
}

named_faults! {
    /// A fault of the rig around the board. An event happens when it is switched on and cannot be taken back.
    pub enum RigFault {
        /// The drive's bus or serial wires are off: no acknowledge and no reports, while it goes on doing its last
        /// command.
        CanSilent = "can-silent",
        /// The bus is shorted. A rig whose drive is on the serial line has none.
        CanBusOff = "can-bus-off",
        /// The drive goes into stall protection at once. An event.
        DriveStall = "drive-stall",
        /// Brown-out: the drive restarts. An event.
        DriveReset = "drive-reset",
        /// The microcontroller's encoder receiver stops following; the drive's own input does not.
        EncoderStuck = "encoder-stuck",
        /// The microcontroller's encoder receiver gains one motor turn. An event.
        EncoderJump = "encoder-jump",
        /// The microcontroller's encoder receiver loses every fifth count; the drive's own input does not.
        EncoderSlip = "encoder-slip",
        /// A motor lead is off: the drive turns nothing and measures no current.
        MotorOpen = "motor-open",
        /// The motor's leads are swapped: it turns against the drive's commands.
        MotorSwapped = "motor-swapped",
        /// Channels A and B are swapped at the drive's encoder input, which counts backwards.
        DriveEncoderSwapped = "drive-encoder-swapped",
        /// The drive's encoder input stops following; the microcontroller's receiver does not.
        DriveEncoderStuck = "drive-encoder-stuck",
        /// One channel of the drive's encoder input is dead: it counts one edge up and down.
        DriveEncoderChannel = "drive-encoder-channel",
        /// The drive's encoder input sees edges of noise: its count dithers by 4 in each millisecond.
        DriveEncoderDither = "drive-encoder-dither",
        /// The drive is as delivered: set for an encoder of 500 lines.
        DriveLines = "drive-lines",
        /// Channels A and B are swapped at the microcontroller's receiver, which counts backwards.
        EncoderSwapped = "encoder-swapped",
        /// One channel of the microcontroller's receiver is dead: it counts one edge up and down.
        EncoderChannel = "encoder-channel",
        /// The encoder has no supply: neither the drive nor the microcontroller counts.
        EncoderUnpowered = "encoder-unpowered",
        /// The LVDT's output is reversed: it falls where it should rise.
        LvdtSwapped = "lvdt-swapped",
        /// LVDT lead open: reads 0 V.
        LvdtOpen = "lvdt-open",
        /// LVDT shorted to the supply: reads full scale.
        LvdtShort = "lvdt-short",
        /// LVDT with 2 mm rms of noise.
        LvdtNoisy = "lvdt-noisy",
        /// LVDT reads the same code indefinitely.
        LvdtFrozen = "lvdt-frozen",
        /// The string breaks, for good. An event.
        StringBreak = "string-break",
        /// The string slips 3 mm through its clamp, for good. An event.
        StringSlip = "string-slip",
        /// The clamp at the drive's supply is missing.
        NoRailClamp = "no-rail-clamp",
        /// The emergency stop is pressed: PB5 high, motor lead on the brake resistor.
        Estop = "estop",
        /// The upper limit switch opens: PA8 high.
        LimitSwitch = "limit-switch",
    }
}

named_faults! {
    /// A fault of the microcontroller and its board.
    pub enum ChipFault {
        /// A task never ends, and those below it do not run any more.
        TaskHang = "task-hang",
        /// The core runs into a fault and its handler. An event.
        Crash = "crash",
        /// The converter delivers no more samples.
        AdcStall = "adc-stall",
        /// The board's supply dips below the brown-out level. An event.
        BrownOut = "brown-out",
        /// The CAN transceiver's RX is dominant indefinitely.
        CanDominant = "can-dominant",
        /// The CAN transceiver's RX is not connected.
        CanOpen = "can-open",
        /// The host does not read the log any more.
        RttStalled = "rtt-stalled",
        /// The ST-LINK gives no 8 MHz clock.
        NoHse = "no-hse",
        /// The ST-LINK's 8 MHz clock comes only 150 ms after the board's power-on.
        HseLate = "hse-late",
        /// The main stack runs past its lowest address. An event.
        StackOverflow = "stack-overflow",
    }
}

/// Any fault that an emulated rig can have. It is serialized as its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "&'static str", try_from = "String")]
pub enum Fault {
    /// Of the rig around the board.
    Rig(RigFault),
    /// Of the microcontroller and its board.
    Chip(ChipFault),
}

/// No fault has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no fault `{name}`; faults: {}", Fault::all().map(Fault::name).collect::<Vec<_>>().join(", "))]
pub struct UnknownFault {
    /// What was given.
    pub name: String,
}

impl Fault {
    /// Every fault, those of the rig first.
    pub fn all() -> impl Iterator<Item = Self> {
        let rig = RigFault::ALL.iter().copied().map(Self::Rig);
        rig.chain(ChipFault::ALL.iter().copied().map(Self::Chip))
    }

    /// The name as scripts write it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rig(fault) => fault.name(),
            Self::Chip(fault) => fault.name(),
        }
    }
}

impl std::str::FromStr for Fault {
    type Err = UnknownFault;

    fn from_str(name: &str) -> Result<Self, UnknownFault> {
        Self::all().find(|fault| fault.name() == name).ok_or_else(|| UnknownFault { name: name.to_owned() })
    }
}

impl From<Fault> for &'static str {
    fn from(fault: Fault) -> Self {
        fault.name()
    }
}

impl TryFrom<String> for Fault {
    type Error = UnknownFault;

    fn try_from(name: String) -> Result<Self, UnknownFault> {
        name.parse()
    }
}

/// Why this rig cannot have a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FaultError {
    /// The fault is one of the CAN bus, and this rig has none.
    #[error(
        "fault `can-bus-off` needs a CAN bus, and the scene has drive_transport = \"uart\"; a cut line is `can-silent`"
    )]
    NoCanBus,
    /// The fault is one of the strings, and they are in a plant program.
    #[error("fault `{}` is one of the built-in strings, and this rig has a plant program in their place", .0.name())]
    Program(RigFault),
}

impl EmulatedRig {
    /// Switches a fault, if this rig can have it.
    ///
    /// # Errors
    /// [`FaultError`] for a fault of the bus where the scene's drive is on the serial line, and for one of the strings where
    /// a plant program has them.
    pub fn try_fault(&mut self, fault: RigFault, on: bool) -> Result<(), FaultError> {
        if fault == RigFault::CanBusOff && self.parameters.drive_transport == DriveTransport::Uart {
            return Err(FaultError::NoCanBus);
        }
        if matches!(fault, RigFault::StringBreak | RigFault::StringSlip) && self.plant.built_in().is_none() {
            return Err(FaultError::Program(fault));
        }
        self.set_fault(fault, on);
        Ok(())
    }

    /// Switches a fault. Events (stall, reset, jump, break, slip) happen when switched on and cannot be taken back.
    pub fn set_fault(&mut self, fault: RigFault, on: bool) {
        let angle_rad = self.motor.angle_rad;
        let faulty = |wires| if on { wires } else { Wires::Good };
        match fault {
            RigFault::CanSilent => self.silent = on,
            RigFault::CanBusOff => {
                if self.can_shorted && !on {
                    self.pending.push(Stimulus::CanQuiet);
                }
                self.can_shorted = on;
            }
            RigFault::DriveStall if on => self.drive.stall(),
            RigFault::DriveReset if on && self.drive.is_powered() => {
                self.drive.restart(self.now_s(), self.drive_counts());
                self.bridge = Bridge::Open;
            }
            RigFault::EncoderStuck => self.encoder.wire_mcu(faulty(Wires::Dead), angle_rad),
            RigFault::EncoderSwapped => self.encoder.wire_mcu(faulty(Wires::Swapped), angle_rad),
            RigFault::EncoderChannel => self.encoder.wire_mcu(faulty(Wires::OneChannel), angle_rad),
            RigFault::DriveEncoderSwapped => self.encoder.wire_drive(faulty(Wires::Swapped), angle_rad),
            RigFault::DriveEncoderStuck => self.encoder.wire_drive(faulty(Wires::Dead), angle_rad),
            RigFault::DriveEncoderChannel => self.encoder.wire_drive(faulty(Wires::OneChannel), angle_rad),
            RigFault::EncoderUnpowered => {
                self.encoder.wire_mcu(faulty(Wires::Dead), angle_rad);
                self.encoder.wire_drive(faulty(Wires::Dead), angle_rad);
            }
            RigFault::DriveEncoderDither => self.encoder.dithers = on,
            RigFault::DriveLines => self.encoder.delivered = on,
            RigFault::MotorSwapped => self.motor_swapped = on,
            RigFault::LvdtSwapped => self.lvdt.faults.reversed = on,
            RigFault::EncoderSlip => self.encoder.set_slipping(on, angle_rad),
            RigFault::EncoderJump if on => self.encoder.jump(),
            RigFault::LvdtOpen => self.lvdt.faults.open = on,
            RigFault::LvdtShort => self.lvdt.faults.short = on,
            RigFault::LvdtNoisy => self.lvdt.faults.noisy = on,
            RigFault::LvdtFrozen => self.lvdt.faults.frozen = on,
            RigFault::StringBreak | RigFault::StringSlip if on => match (&mut self.plant, fault) {
                (Plant::BuiltIn(plant), RigFault::StringBreak) => plant.break_string(),
                (Plant::BuiltIn(plant), _) => plant.slip(),
                (Plant::Program(_), _) => {}
            },
            RigFault::NoRailClamp => self.rail.clamped = !on,
            RigFault::Estop => self.estop = on,
            RigFault::MotorOpen => self.motor_open = on,
            RigFault::LimitSwitch => self.limit_fault = on,
            RigFault::DriveStall
            | RigFault::DriveReset
            | RigFault::EncoderJump
            | RigFault::StringBreak
            | RigFault::StringSlip => {}
        }
        self.look_at_pins();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_come_back() {
        for fault in Fault::all() {
            assert_eq!(fault.name().parse(), Ok(fault));
        }
        let message = "lvdt".parse::<Fault>().expect_err("no fault").to_string();
        assert!(message.contains("`lvdt`") && message.contains("lvdt-open") && message.contains("no-hse"), "{message}");
    }
}
