//! What each fault does to the rig.

use super::Rig;
use super::encoder::Wires;
use super::motor::Bridge;
use crate::RigFault;
use crate::board::Stimulus;
use rmds405::Transport;

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

impl Rig {
    /// Switches a fault, if this rig can have it.
    ///
    /// # Errors
    /// [`FaultError`] for a fault of the bus where the scene's drive is on the serial line, and for one of the strings where
    /// a plant program has them.
    pub fn try_fault(&mut self, fault: RigFault, on: bool) -> Result<(), FaultError> {
        if fault == RigFault::CanBusOff && self.parameters.transport == Transport::Uart {
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
            RigFault::DriveEncoderDither => self.encoder.set_dither(on),
            RigFault::DriveLines => self.encoder.set_delivered(on),
            RigFault::MotorSwapped => self.motor_swapped = on,
            RigFault::LvdtReversed => self.lvdt.faults.reversed = on,
            RigFault::EncoderSlip => self.encoder.set_slipping(on, angle_rad),
            RigFault::EncoderJump if on => self.encoder.jump(),
            RigFault::LvdtOpen => self.lvdt.faults.open = on,
            RigFault::LvdtShort => self.lvdt.faults.short = on,
            RigFault::LvdtNoisy => self.lvdt.faults.noisy = on,
            RigFault::LvdtFrozen => self.lvdt.faults.frozen = on,
            RigFault::StringBreak if on => {
                if let Some(plant) = self.plant.built_in_mut() {
                    plant.break_string();
                }
            }
            RigFault::StringSlip if on => {
                if let Some(plant) = self.plant.built_in_mut() {
                    plant.slip();
                }
            }
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
