//! What is done about each fault, decided in one place; `docs/faults.md` tells it to the person at the bench.
//!
//! Every fault latches. None unwinds the strings by itself: each puts in doubt something that a controlled way down needs.
//! None takes the torque away on purpose: the strings would untwist and drop the load. Where nothing is said to the drive
//! any more, it is because it has already let go, or does not listen.

use rig_link::messages::Fault;

/// What the drive is told while a fault is latched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// Hold the twist that the rig's own encoder shows, in closed loop.
    Hold,
    /// Hold where the drive says it is: the rig's own encoder is what is wrong.
    HoldByDrive,
    /// Nothing: the drive has lost its torque or its mode, and only a start-up brings it back.
    Silence,
}

/// The decision.
pub const fn response(fault: Fault) -> Response {
    match fault {
        Fault::EncoderStuck | Fault::EncoderJump | Fault::EncoderDisagrees => Response::HoldByDrive,
        Fault::DriveStall
        | Fault::DriveReset
        | Fault::DriveStartUp
        | Fault::WatchdogReset
        | Fault::UnexpectedReset
        | Fault::Panicked
        | Fault::TableCorrupt
        | Fault::SettingsCorrupt => Response::Silence,
        // A drive that is silent may still listen.
        Fault::DriveSilent | Fault::CanBusOff => Response::Hold,
        Fault::HostSilent
        | Fault::TickLate
        | Fault::LvdtOpen
        | Fault::LvdtShort
        | Fault::LvdtNoisy
        | Fault::LvdtFrozen
        | Fault::LvdtStalled
        | Fault::ModelResidual
        | Fault::StringBreak
        | Fault::FollowingError
        | Fault::NotFinite
        | Fault::LimitSwitch
        | Fault::Supply
        | Fault::TwistRange
        | Fault::LoadRange => Response::Hold,
    }
}

/// Whether the twist is not known any more, so that the drive is started and the rig homed anew.
pub const fn needs_homing(fault: Fault) -> bool {
    match fault {
        Fault::DriveSilent
        | Fault::DriveReset
        | Fault::DriveStall
        | Fault::DriveStartUp
        | Fault::CanBusOff
        | Fault::EncoderStuck
        | Fault::EncoderJump
        | Fault::EncoderDisagrees
        | Fault::StringBreak
        | Fault::NotFinite
        | Fault::TableCorrupt
        | Fault::SettingsCorrupt
        | Fault::WatchdogReset
        | Fault::UnexpectedReset
        | Fault::Panicked => true,
        Fault::HostSilent
        | Fault::TickLate
        | Fault::LvdtOpen
        | Fault::LvdtShort
        | Fault::LvdtNoisy
        | Fault::LvdtFrozen
        | Fault::LvdtStalled
        | Fault::ModelResidual
        | Fault::FollowingError
        | Fault::LimitSwitch
        | Fault::Supply
        | Fault::TwistRange
        | Fault::LoadRange => false,
    }
}
