//! The named codes in messages, each with the name that people and logs see. They are a part of the table of
//! [`crate::messages`].

/// Declares an enum with, for each variant, a stable number and the name that tools and documents use.
///
/// It has `ALL`, `code()`, `name()`, `from_code()`, `from_name()`, `Display`, and the derives that the link needs: serde (by
/// place on the wire, by name in text formats), the schema and (with the feature) defmt.
macro_rules! named_codes {
    ($(#[$doc:meta])* pub enum $name:ident { $($(#[$variant_doc:meta])* $variant:ident = $code:literal, $text:literal;)+ }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize, postcard_schema::Schema)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u8)]
        pub enum $name {
            $($(#[$variant_doc])* #[serde(rename = $text)] $variant = $code,)+
        }

        impl $name {
            /// Every variant, in the order of the table.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The stable number.
            pub const fn code(self) -> u8 {
                self as u8
            }

            /// The name as tools and documents write it.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }

            /// The variant with this number.
            pub const fn from_code(code: u8) -> Option<Self> {
                match code {
                    $($code => Some(Self::$variant),)+
                    _ => None,
                }
            }

            /// The variant with this name.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|v| v.name() == name)
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.pad(self.name())
            }
        }
    };
}

named_codes! {
    /// A setting of the board, kept in flash. Its unit, default and range are in [`crate::board_settings`]. The numbers never
    /// change: flash holds the settings by them.
    pub enum Setting {
        /// Gap where the scene's LVDT numbers say 0 (m).
        LvdtOffset = 0, "lvdt-offset";
        /// True change of the gap for one that the scene's LVDT numbers show.
        LvdtGain = 1, "lvdt-gain";
        /// Position that is called 0, from where the load hangs at the half-turn pre-twist (m).
        PositionZero = 2, "position-zero";
        /// Direction in which the strings are twisted: +1 as the encoder counts, -1 the opposite.
        TwistSign = 3, "twist-sign";
        /// True gear ratio over the scene's.
        GearScale = 4, "gear-scale";
        /// Maximum speed of the load in a move (m/s).
        SpeedMax = 5, "speed-max";
        /// Current limit sent with every command to the drive (A).
        CurrentLimit = 6, "current-limit";
        /// Scale of the twist that homing assumes for these strings.
        TwistScale = 7, "twist-scale";
        /// Fraction of the position loop's feedback that is used: less gives a slower loop with more margin.
        LoopGain = 8, "loop-gain";
        /// Heaviest load that these rods had carried before power-up (N), which they remember; 0 for new ones.
        HeaviestLoad = 9, "heaviest-load";
    }
}

named_codes! {
    /// Why points are no calibration of the LVDT.
    pub enum CurveFlaw {
        /// Not 2 to 11 of them.
        Count = 0, "there must be 2 to 11 of them";
        /// A number is infinite or none.
        NotFinite = 1, "one of the numbers is not finite";
        /// The gap falls where the sensor's reading grows.
        WrongSign = 2, "the gap falls where the sensor's reading grows: the sensor has the wrong sign";
        /// Readings or gaps are not in order.
        NotMonotonic = 3, "gap and sensor's reading do not grow together: not monotonic";
        /// Two of them are too close together.
        TooClose = 4, "two of them are less than 1 mm apart";
        /// The gap changes by less than half or more than twice the sensor's reading.
        Slope = 5, "between two of them the gap changes by less than half or more than twice the sensor's reading";
        /// A correction is greater than that of any sensor of this kind.
        Correction = 6, "one of them differs from the sensor's reading by more than 50 mm";
        /// The stated error is negative or too large.
        Error = 7, "their error must be from 0 to 10 mm";
    }
}

named_codes! {
    /// What flash holds of the settings.
    pub enum Kept {
        /// Nothing: these are the defaults, or were set and could not be written.
        Nothing = 0, "not kept";
        /// These values.
        These = 1, "kept";
        /// Other values: these are about to be written.
        Others = 2, "being written";
        /// A damaged record, or one of an older format for other constants of the rig. These are the defaults.
        Damaged = 3, "damaged";
        /// These values; and others, which are not used because they were made for other constants of the rig or are not
        /// allowed on this one. Their settings are at their defaults.
        Partly = 4, "partly kept";
    }
}

named_codes! {
    /// How a request was accepted.
    pub enum Accepted {
        /// It took effect at once.
        Done = 0, "done";
        /// It has begun; an event reports its end.
        Started = 1, "started";
        /// It has begun, and the position is no longer known: home again.
        Unhomed = 2, "unhomed";
    }
}

named_codes! {
    /// Parameters that a refusal can name.
    pub enum Parameter {
        /// Target position (m).
        Target = 0, "target";
        /// Speed of the load (m/s).
        Speed = 1, "speed";
        /// Load (N).
        Load = 2, "load";
        /// Twist speed (rad/s).
        TwistSpeed = 3, "twist speed";
        /// Twist (rad).
        Twist = 4, "twist";
        /// How long a set-point of a stream holds (s).
        HoldsFor = 5, "for";
    }
}

impl Parameter {
    /// SI unit of the values that a refusal gives.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Target => "m",
            Self::Speed => "m/s",
            Self::Load => "N",
            Self::TwistSpeed => "rad/s",
            Self::Twist => "rad",
            Self::HoldsFor => "s",
        }
    }
}

named_codes! {
    /// The rig's sensors.
    pub enum Sensor {
        /// Displacement transducer of the load.
        Lvdt = 0, "LVDT";
        /// The rig's own encoder.
        Encoder = 1, "encoder";
        /// The drive's own measurements of its motor.
        Drive = 2, "drive";
    }
}

named_codes! {
    /// State of the rig.
    pub enum State {
        /// Starting; no reading of drive and sensors yet.
        Boot = 0, "boot";
        /// Ready to home; the twist is not known.
        Unhomed = 1, "unhomed";
        /// Homing.
        Homing = 2, "homing";
        /// Homed, at rest.
        Ready = 3, "ready";
        /// Moving to a target, or jogging.
        Moving = 4, "moving";
        /// Holding a position in closed loop.
        Holding = 5, "holding";
        /// Stopped by a latched fault.
        Fault = 6, "fault";
        /// Emergency stop.
        EStop = 7, "estop";
    }
}

named_codes! {
    /// A fault, which stops the rig. It is latched until cleared; `docs/reference/faults.md` has an entry for each. The
    /// numbers never change and are never reused (24 was in use once).
    pub enum Fault {
        /// No heartbeat from the host during a motion.
        HostSilent = 1, "host-silent";
        /// Control ticks came late or were missed.
        TickLate = 2, "tick-late";
        /// The last reset was the watchdog's.
        WatchdogReset = 3, "watchdog-reset";
        /// The board was reset while the strings may have been twisted.
        UnexpectedReset = 4, "unexpected-reset";
        /// The drive sends no feedback.
        DriveSilent = 5, "drive-silent";
        /// The CAN controller has left the bus.
        CanBusOff = 6, "can-bus-off";
        /// The drive reports a stall.
        DriveStall = 7, "drive-stall";
        /// The drive restarted by itself: it has no mode, and its position is 0 again.
        DriveReset = 8, "drive-reset";
        /// The motor is commanded to turn and the encoder does not count.
        EncoderStuck = 9, "encoder-stuck";
        /// The encoder counted more than the motor can turn.
        EncoderJump = 10, "encoder-jump";
        /// Encoder and drive report different positions.
        EncoderDisagrees = 11, "encoder-disagrees";
        /// LVDT signal at the rail of a broken wire.
        LvdtOpen = 12, "lvdt-open";
        /// LVDT signal at the rail of a short circuit.
        LvdtShort = 13, "lvdt-short";
        /// LVDT noise above its limit.
        LvdtNoisy = 14, "lvdt-noisy";
        /// The LVDT repeats one code exactly: a live one has noise.
        LvdtFrozen = 15, "lvdt-frozen";
        /// No new LVDT samples arrive.
        LvdtStalled = 16, "lvdt-stalled";
        /// LVDT and table disagree: slip, creep or overtwist.
        ModelResidual = 17, "model-residual";
        /// The load dropped without motor motion.
        StringBreak = 18, "string-break";
        /// The position fell too far behind its set-point.
        FollowingError = 19, "following-error";
        /// The embedded table fails its checksum.
        TableCorrupt = 20, "table-corrupt";
        /// A computed value is infinite or not a number.
        NotFinite = 21, "not-finite";
        /// The settings in flash are damaged, or some of them were made for other constants of the rig.
        SettingsCorrupt = 22, "settings-corrupt";
        /// A limit switch opened.
        LimitSwitch = 23, "limit-switch";
        /// The previous run ended in a panic or a fault of the core.
        Panicked = 25, "panicked";
        /// The drive refused or left its start-up sequence.
        DriveStartUp = 26, "drive-start-up";
        /// Supply voltage of the drive outside its limits.
        Supply = 27, "supply";
        /// Twist outside the range that the strings withstand.
        TwistRange = 28, "twist-range";
        /// The estimated load left the range of the table.
        LoadRange = 29, "load-range";
        /// The shaft turns although the drive is commanded to hold it.
        NotHeld = 30, "not-held";
        /// The LVDT's reading stepped as no load can make it: the sensor, its core or its conditioner has shifted.
        LvdtJump = 31, "lvdt-jump";
        /// The motor turns against the voltage that the drive is told to put on it: its leads are swapped.
        MotorDirection = 32, "motor-direction";
        /// A voltage on the motor moves neither encoder: a motor lead, or the encoder's cable or supply.
        MotorStill = 33, "motor-still";
        /// The drive's encoder input stands or counts backwards while the shaft turns: its wires. The drive's loop is then open.
        DriveEncoder = 34, "drive-encoder";
        /// The rig's own encoder input counts backwards: its channels are swapped.
        EncoderDirection = 35, "encoder-direction";
        /// The shaft, or the drive's count of it, does not come to rest after a start.
        ShaftUnsteady = 36, "shaft-unsteady";
        /// The board runs on its own oscillator, which is too coarse for the CAN bus.
        ClockSource = 37, "clock-source";
    }
}

named_codes! {
    /// A limit on the motion that does not stop the rig.
    pub enum Limit {
        /// The motor is at its maximum speed.
        MotorSpeed = 1, "motor-speed";
        /// The motor is at its maximum current.
        MotorCurrent = 2, "motor-current";
        /// The set-point is at the end of the travel.
        Travel = 3, "travel";
        /// The motor is at its maximum acceleration.
        MotorAcceleration = 5, "motor-acceleration";
        /// The set-point of a stream moves, and the rail's friction holds the load.
        Friction = 6, "friction";
    }
}

named_codes! {
    /// Why an estimate is not to be relied on.
    pub enum Doubt {
        /// The load estimate is at the end of the table's range.
        LoadRange = 0, "load-range";
        /// The load is not known well: light, fast, or it has just changed.
        LoadUnknown = 1, "load-unknown";
    }
}

named_codes! {
    /// Why homing failed.
    pub enum HomingFailure {
        /// It took longer than allowed.
        TimeOut = 0, "time-out";
        /// The gap did not change as twisted strings change it.
        NoPretwist = 1, "no-pretwist";
        /// Twist and gap fit no load in the table's range.
        LoadOutOfRange = 2, "load-out-of-range";
        /// The sweep does not fit the model.
        PoorFit = 3, "poor-fit";
        /// A sensor gave no valid reading.
        SensorInvalid = 4, "sensor-invalid";
        /// The motor did not move as commanded.
        DriveFailed = 5, "drive-failed";
        /// Stopped by the operator.
        Stopped = 6, "stopped";
        /// The end of the sensor's or the string's travel was reached first.
        TravelEnd = 7, "travel-end";
        /// The gap shifted during homing: a string slipped, the load was changed, or the LVDT moved.
        Shifted = 8, "shifted";
        /// The gap changes ever faster towards its supposed maximum: the LVDT's output is reversed.
        LvdtReversed = 9, "lvdt-reversed";
    }
}

named_codes! {
    /// Why a stream of set-points ended.
    pub enum StreamEnd {
        /// The next set-point did not come in time.
        Late = 0, "late";
        /// A set-point was refused; the reply says why.
        Refused = 1, "refused";
        /// It ran farther ahead of the load than the motor can catch up with.
        TooFast = 2, "too-fast";
    }
}

named_codes! {
    /// Why the board does not use a table that it was sent.
    pub enum TableRefusal {
        /// Parts are missing, or it is longer than any table.
        Incomplete = 0, "incomplete";
        /// Its checksum is wrong.
        Damaged = 1, "damaged";
        /// It was made by another version of the generator.
        Version = 2, "version";
        /// A range or a stated error is impossible.
        Range = 3, "range";
        /// The gap is not monotone.
        NotMonotone = 4, "not-monotone";
    }
}

named_codes! {
    /// Source of the clock of the board's core and buses.
    pub enum Clock {
        /// 8 MHz from the ST-LINK.
        Hse = 0, "hse";
        /// The chip's own oscillator, accurate to 1 % at best: the 8 MHz are missing.
        Hsi = 1, "hsi";
    }
}

named_codes! {
    /// Why the board last started.
    pub enum ResetCause {
        /// Power came on.
        PowerOn = 0, "power-on";
        /// The supply dipped.
        BrownOut = 1, "brown-out";
        /// The reset pin.
        Pin = 2, "pin";
        /// Reset by the firmware itself or by a debugger.
        Software = 3, "software";
        /// A watchdog.
        Watchdog = 4, "watchdog";
        /// Low-power reset.
        LowPower = 5, "low-power";
        /// No flag was set.
        Unknown = 6, "unknown";
    }
}
