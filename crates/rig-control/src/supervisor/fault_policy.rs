//! One table: what is done about each fault, and which fault outranks which. `docs/reference/faults.md` explains it to
//! the operator.
//!
//! Every fault latches, and several can be latched at a time. The most severe one decides the command to the drive; a graver one
//! is latched beside it at once. No fault unwinds the strings by itself: each puts in doubt something that a controlled way down needs.
//! No fault takes the torque away from a drive that holds: the strings would untwist and drop the load. A drive whose motor or
//! encoder has the wrong sign, or that does not see the shaft turn, does not hold: it runs away.

use rig_link::messages::{Fault, Faults};

/// The command to the drive while a fault is latched, in order of gravity: a later one outranks an earlier one, because
/// less is known of the load, or the load falls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Response {
    /// Hold the twist that the rig's own encoder shows, in closed loop.
    Hold,
    /// Hold the position that the drive reports, because the rig's own encoder is wrong.
    HoldByDrive,
    /// Hold, in case the drive still listens; nothing shows whether it does.
    HoldIfHeard,
    /// Only a Reset: the drive gives no torque any more, and must not return to an old target.
    LetGo,
    /// Nothing: no target was given since the board or the drive started, so the drive gives no torque.
    Wait,
}

/// What has to be done after `clear` before a load can be moved again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum After {
    /// Nothing: the position is still known.
    Nothing,
    /// Home: the drive goes on holding, but the position is not known any more.
    Home,
    /// `clear` starts the drive again, with a Reset that lets go of the load; then home.
    Restart,
    /// `clear` is refused: the cause remains until another image is flashed, or the power was off.
    Never,
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Policy {
    /// The fault.
    pub fault: Fault,
    /// The command to the drive.
    pub response: Response,
    /// What `clear` leads to.
    pub after: After,
    /// Faults that are only its consequences: they are not raised beside it.
    pub explains: Faults,
}

const fn row(fault: Fault, response: Response, after: After, explains: &[Fault]) -> Policy {
    Policy { fault, response, after, explains: Faults::of(explains) }
}

/// Faults of the rig's own encoder: one of them shows itself in the others' checks as well.
const ENCODER: [Fault; 3] = [Fault::EncoderStuck, Fault::EncoderJump, Fault::EncoderDisagrees];
/// The drive cannot be told anything.
pub(super) const UNHEARD: Faults = Faults::of(&[Fault::CanBusOff, Fault::DriveSilent]);
/// What looks wrong when control ticks are missing.
const MISSED: [Fault; 8] = [
    Fault::EncoderStuck,
    Fault::EncoderJump,
    Fault::EncoderDisagrees,
    Fault::DriveSilent,
    Fault::LvdtStalled,
    Fault::LvdtJump,
    Fault::StringBreak,
    Fault::FollowingError,
];
/// What looks wrong when the drive gives no torque or cannot be heard; a falling load blurs the LVDT's blocks.
const NO_DRIVE: [Fault; 7] = [
    Fault::DriveSilent,
    Fault::FollowingError,
    Fault::NotHeld,
    Fault::EncoderStuck,
    Fault::EncoderDisagrees,
    Fault::LvdtNoisy,
    Fault::LvdtJump,
];
/// What looks wrong when the drive does not see the shaft turn.
const UNSEEN: [Fault; 6] = [
    Fault::NotHeld,
    Fault::EncoderStuck,
    Fault::EncoderJump,
    Fault::EncoderDisagrees,
    Fault::FollowingError,
    Fault::LvdtJump,
];
/// What looks wrong when the LVDT is.
const NO_LVDT: [Fault; 3] = [Fault::FollowingError, Fault::ModelResidual, Fault::LoadRange];

/// The table. Of faults with the same response that are found in the same tick, the earlier row is reported first.
pub const POLICY: [Policy; Fault::ALL.len()] = [
    row(Fault::TableCorrupt, Response::Wait, After::Never, &[]),
    row(Fault::SettingsCorrupt, Response::Wait, After::Restart, &[]),
    row(Fault::Panicked, Response::Wait, After::Restart, &[]),
    row(Fault::WatchdogReset, Response::Wait, After::Restart, &[]),
    row(Fault::UnexpectedReset, Response::Wait, After::Restart, &[]),
    row(Fault::ClockSource, Response::Wait, After::Never, &NO_DRIVE),
    row(Fault::DriveStartUp, Response::Wait, After::Restart, &NO_DRIVE),
    row(Fault::DriveStall, Response::LetGo, After::Restart, &NO_DRIVE),
    row(Fault::DriveReset, Response::LetGo, After::Restart, &NO_DRIVE),
    row(Fault::MotorDirection, Response::LetGo, After::Restart, &NO_DRIVE),
    row(Fault::MotorStill, Response::LetGo, After::Restart, &NO_DRIVE),
    row(Fault::EncoderDirection, Response::LetGo, After::Restart, &ENCODER),
    row(Fault::DriveEncoder, Response::LetGo, After::Restart, &UNSEEN),
    row(Fault::ShaftUnsteady, Response::LetGo, After::Restart, &NO_DRIVE),
    row(Fault::NotHeld, Response::LetGo, After::Restart, &[Fault::FollowingError, Fault::LvdtNoisy, Fault::LvdtJump]),
    row(Fault::CanBusOff, Response::HoldIfHeard, After::Restart, &[Fault::DriveSilent, Fault::FollowingError]),
    row(Fault::DriveSilent, Response::HoldIfHeard, After::Restart, &[Fault::FollowingError]),
    row(Fault::EncoderJump, Response::HoldByDrive, After::Restart, &ENCODER),
    row(Fault::EncoderStuck, Response::HoldByDrive, After::Restart, &ENCODER),
    row(Fault::EncoderDisagrees, Response::HoldByDrive, After::Restart, &ENCODER),
    row(Fault::NotFinite, Response::Hold, After::Restart, &[]),
    row(Fault::TickLate, Response::Hold, After::Nothing, &MISSED),
    row(
        Fault::StringBreak,
        Response::Hold,
        After::Restart,
        &[Fault::LvdtNoisy, Fault::LvdtJump, Fault::FollowingError, Fault::ModelResidual, Fault::LoadRange],
    ),
    row(Fault::LvdtOpen, Response::Hold, After::Nothing, &NO_LVDT),
    row(Fault::LvdtShort, Response::Hold, After::Nothing, &NO_LVDT),
    row(Fault::LvdtNoisy, Response::Hold, After::Nothing, &NO_LVDT),
    row(Fault::LvdtFrozen, Response::Hold, After::Nothing, &NO_LVDT),
    row(Fault::LvdtStalled, Response::Hold, After::Nothing, &NO_LVDT),
    row(Fault::LvdtJump, Response::Hold, After::Home, &NO_LVDT),
    row(Fault::Supply, Response::Hold, After::Nothing, &[]),
    row(Fault::LimitSwitch, Response::Hold, After::Nothing, &[]),
    row(Fault::HostSilent, Response::Hold, After::Nothing, &[]),
    row(Fault::TwistRange, Response::Hold, After::Nothing, &[]),
    row(Fault::FollowingError, Response::Hold, After::Nothing, &[]),
    row(Fault::ModelResidual, Response::Hold, After::Home, &[]),
    row(Fault::LoadRange, Response::Hold, After::Nothing, &[]),
];

/// The row of a fault.
pub fn policy(fault: Fault) -> &'static Policy {
    // A test checks that each fault has a row.
    POLICY.iter().find(|row| row.fault == fault).unwrap_or(&POLICY[0])
}

/// The faults that stopped the rig.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Latched {
    /// All of them.
    pub all: Faults,
    /// The one that decides what the drive is told: of those with the most severe response the first that was latched.
    pub gravest: Option<Fault>,
}

impl Latched {
    /// What the drive is told, if anything is latched.
    pub fn response(self) -> Option<Response> {
        self.gravest.map(|fault| policy(fault).response)
    }

    /// Whether one of them says that the own encoder is wrong.
    pub fn own_encoder_is_wrong(self) -> bool {
        self.all.meets(Faults::of(&ENCODER))
    }

    /// Latches a fault.
    pub fn insert(&mut self, fault: Fault) {
        self.all.insert(fault);
        if self.response().is_none_or(|now| policy(fault).response > now) {
            self.gravest = Some(fault);
        }
    }

    /// Those of `found` that are new, and no consequences of what is found or latched. Missing ticks make other things look
    /// wrong only as long as `ticks_missed_lately`.
    pub fn news(self, found: Faults, ticks_missed_lately: bool) -> Faults {
        // As in almost every tick.
        if found.without(self.all).is_empty() {
            return Faults::NONE;
        }
        let mut explained = Faults::NONE;
        for row in &POLICY {
            let lasts = if row.fault == Fault::TickLate {
                ticks_missed_lately
            } else {
                found.contains(row.fault) || self.all.contains(row.fault)
            };
            if lasts {
                explained = explained.and(row.explains.without(Faults::NONE.with(row.fault)));
            }
        }
        found.without(self.all).without(explained)
    }

    /// What `clear` leads to.
    pub fn after(self) -> After {
        self.all.iter().map(|fault| policy(fault).after).max().unwrap_or(After::Nothing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_fault_has_one_row_and_a_graver_row_stands_before_a_milder_one() {
        for &fault in Fault::ALL {
            assert_eq!(POLICY.iter().filter(|row| row.fault == fault).count(), 1, "{fault}");
        }
        assert!(POLICY.windows(2).all(|rows| rows[0].response >= rows[1].response));
        assert!(POLICY.iter().all(|row| row.response == Response::Hold || row.after >= After::Restart));
    }

    #[test]
    fn the_gravest_leads_in_either_order() {
        for &a in Fault::ALL {
            for &b in Fault::ALL {
                let mut latched = Latched::default();
                latched.insert(a);
                latched.insert(b);
                let graver = if policy(b).response > policy(a).response { b } else { a };
                assert_eq!(latched.gravest, Some(graver), "{a}, then {b}");
                assert!(latched.all.contains(a) && latched.all.contains(b));
                assert_eq!(latched.after(), policy(a).after.max(policy(b).after));
            }
        }
    }

    #[test]
    fn consequences_are_not_news_and_a_cause_is_news_beside_its_consequence() {
        let mut latched = Latched::default();
        let both = Faults::of(&[Fault::DriveStall, Fault::FollowingError]);
        assert_eq!(latched.news(both, false), Faults::NONE.with(Fault::DriveStall));
        latched.insert(Fault::FollowingError);
        assert_eq!(latched.news(both, false), Faults::NONE.with(Fault::DriveStall));
        latched.insert(Fault::DriveStall);
        assert!(latched.news(both, false).is_empty());
        // Late ticks explain what looks wrong beside them, and nothing later.
        let late = Faults::of(&[Fault::TickLate, Fault::EncoderJump]);
        let mut latched = Latched::default();
        assert_eq!(latched.news(late, true), Faults::NONE.with(Fault::TickLate));
        latched.insert(Fault::TickLate);
        assert_eq!(latched.news(Faults::NONE.with(Fault::EncoderJump), false), Faults::NONE.with(Fault::EncoderJump));
        // Of two encoder faults the first that was seen stays.
        latched.insert(Fault::EncoderStuck);
        assert!(latched.news(Faults::NONE.with(Fault::EncoderDisagrees), false).is_empty());
    }
}
