//! Faults by the names that scripts use (cli.md).

/// A fault of the rig. The host's (`host-silent`), the chip's (`task-hang`, `crash`, `adc-stall`) and the board's (`power-cycle`,
/// `brown-out`, `can-dominant`, `can-open`, `rtt-stalled`, `no-hse`) are not here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The drive's bus or serial wires are off: no acknowledge and no reports, while it goes on doing what it was told.
    CanSilent,
    /// The bus is shorted. A rig whose drive is on the serial line has none.
    CanBusOff,
    /// The drive goes into stall protection at once. An event.
    DriveStall,
    /// Brown-out: the drive restarts. An event.
    DriveReset,
    /// A motor lead is off: the drive turns nothing and measures no current.
    MotorOpen,
    /// The microcontroller's encoder receiver stops following; the drive's own input does not.
    EncoderStuck,
    /// The microcontroller's encoder receiver gains one motor turn. An event.
    EncoderJump,
    /// The microcontroller's encoder receiver loses every fifth count; the drive's own input does not.
    EncoderSlip,
    /// LVDT lead open: reads 0 V.
    LvdtOpen,
    /// LVDT shorted to the supply: reads full scale.
    LvdtShort,
    /// LVDT with 2 mm rms of noise.
    LvdtNoisy,
    /// LVDT reads the same code for ever.
    LvdtFrozen,
    /// The string breaks, for good. An event.
    StringBreak,
    /// The string slips 3 mm through its clamp, for good. An event.
    StringSlip,
    /// The emergency stop is pressed: PB5 high, motor lead on the brake resistor.
    Estop,
    /// The upper limit switch opens: PA8 high.
    LimitSwitch,
    /// Random bytes on the host link.
    LinkNoise,
}

/// No such fault here.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("fault `{name}` is unknown to the rig; known are {}", known())]
pub struct UnknownFault {
    /// What was given.
    pub name: String,
}

/// The fault is one of the CAN bus, and this rig has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "fault `can-bus-off` needs a CAN bus, and the scene has drive_transport = \"uart\"; a cut line is `can-silent`"
)]
pub struct NotHere;

const NAMES: [(&str, Fault); 17] = [
    ("can-silent", Fault::CanSilent),
    ("can-bus-off", Fault::CanBusOff),
    ("drive-stall", Fault::DriveStall),
    ("drive-reset", Fault::DriveReset),
    ("motor-open", Fault::MotorOpen),
    ("encoder-stuck", Fault::EncoderStuck),
    ("encoder-jump", Fault::EncoderJump),
    ("encoder-slip", Fault::EncoderSlip),
    ("lvdt-open", Fault::LvdtOpen),
    ("lvdt-short", Fault::LvdtShort),
    ("lvdt-noisy", Fault::LvdtNoisy),
    ("lvdt-frozen", Fault::LvdtFrozen),
    ("string-break", Fault::StringBreak),
    ("string-slip", Fault::StringSlip),
    ("estop", Fault::Estop),
    ("limit-switch", Fault::LimitSwitch),
    ("link-noise", Fault::LinkNoise),
];

fn known() -> String {
    NAMES.map(|(name, _)| name).join(", ")
}

impl Fault {
    /// All of them with their names.
    pub fn all() -> impl Iterator<Item = (&'static str, Self)> {
        NAMES.into_iter()
    }
}

impl std::str::FromStr for Fault {
    type Err = UnknownFault;

    fn from_str(name: &str) -> Result<Self, UnknownFault> {
        Self::all()
            .find(|(known, _)| *known == name)
            .map(|(_, fault)| fault)
            .ok_or_else(|| UnknownFault { name: name.to_owned() })
    }
}
