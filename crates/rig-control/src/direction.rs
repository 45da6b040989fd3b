//! Which way the motor turns and both encoders count, before the drive closes any loop.
//!
//! With swapped motor leads, or with A and B swapped at the drive's encoder input, the drive's position loop is unstable and
//! runs away at full speed. So the drive starts in open loop, where nothing can run away, and the first motion is two short
//! pulses of voltage, one each way, as soon as the load hardly turns the shorted motor. Each rises slowly until one of the
//! encoders has moved; then the motor is shorted again, and when the drive has reported that, the counts' farthest moves are
//! compared:
//!
//! | drive | own | gap | verdict |
//! |-------|-----|-----|---------|
//! | as commanded | as commanded | – | good |
//! | against | against | – | motor leads swapped |
//! | against, or stands | as commanded, or against | – | drive's encoder input |
//! | as commanded | against | – | own encoder's channels swapped |
//! | as commanded, or against | stands | – | own encoder's wires |
//! | stands | stands | moves | encoder's cable or supply |
//! | stands | stands | stands | motor leads, or encoder's cable with a load that friction holds |
//!
//! The twist that a mirrored rig makes (motor leads and both encoder inputs swapped) is as good as the other one. Whether the
//! LVDT is reversed does not show here: the gap may change either way with the twist. Homing finds that.

use crate::RigConstants;
use crate::sensors::LVDT_COUNT_M;
use rig_link::messages::Fault;

/// Maximum voltage on the motor, in 1/5000 of the supply: 2.4 V of 24 V. Without load it makes 1.7 rad/s of the strings on
/// the default rig; a stiff gear with 1 mN m of friction breaks away at 0.5 V.
const PWM_MAX: i16 = 500;
/// Ticks in which the voltage rises to [`PWM_MAX`].
const RISE_TICKS: i16 = 20;
/// Ticks for which the first pulse waits at most, a multiple of [`RISE_TICKS`]. A shaft that turns for longer, or an encoder that
/// counts by itself, gets its verdict by the pulses.
const WAIT_TICKS: i16 = 500;
/// Turn (rad of the strings) that ends a pulse: many times the play of an encoder's edges, and too little to be felt.
const MEASURED_RAD: f32 = 0.05;
/// Ticks for the shorted motor to stop (J R / k² is 2.3 ms for the default one), and for the drive to report it.
const STOP_TICKS: i16 = 6;
/// Maximum difference of the two counts, as a part of the greater one: a channel that loses every fifth count, or a drive that
/// is set for another encoder, must show. An encoder that turns by less stands.
const ALIKE: f32 = 0.1;

/// Shaft angles by both encoders (rad of the strings, in the direction of positive counts), and the gap (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Witnesses {
    /// By the drive.
    pub drive_rad: f32,
    /// By the rig's own encoder.
    pub own_rad: f32,
    /// By the LVDT.
    pub gap_m: f32,
}

/// What is to be done in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// This voltage on the motor, in 1/5000 of the supply.
    Voltage(i16),
    /// All directions agree.
    Proven,
    /// They do not.
    Wrong(Fault),
}

/// The two pulses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionCheck {
    /// Direction of the present pulse: first +1, then −1.
    sign: i16,
    /// Of the present pulse; below 0 before the first one.
    ticks: i16,
    /// Ticks since the pulse ended.
    stopped: Option<i16>,
    start: Option<Witnesses>,
    /// How far each count has come at most since the start, in the direction of the pulse, because a load may turn the shorted motor
    /// back before the drive has reported it; and how far the gap has come now.
    farthest: Witnesses,
}

impl DirectionCheck {
    /// Nothing has turned yet.
    pub const NEW: Self = Self { sign: 1, ticks: -WAIT_TICKS, stopped: None, start: None, farthest: Witnesses::NONE };

    /// One tick.
    pub fn step(&mut self, now: &Witnesses) -> Step {
        let start = *self.start.get_or_insert(*now);
        let moved = Witnesses {
            drive_rad: f32::from(self.sign) * (now.drive_rad - start.drive_rad),
            own_rad: f32::from(self.sign) * (now.own_rad - start.own_rad),
            gap_m: now.gap_m - start.gap_m,
        };
        self.farthest = self.farthest.or_farther(&moved);
        match &mut self.stopped {
            None if self.ticks < 0 => {
                // A load may turn the shorted motor against the voltage and faster than that. Where it turns the strings by half a radian
                // per second, the voltage turns them the other way before they have come far enough for a verdict.
                self.ticks += 1;
                if self.ticks % RISE_TICKS == 0 {
                    (self.start, self.farthest) = (Some(*now), Witnesses::NONE);
                    if moved.turned() < 2.0 * MEASURED_RAD {
                        self.ticks = 0;
                    }
                }
                Step::Voltage(0)
            }
            None => {
                self.ticks += 1;
                if moved.turned() >= MEASURED_RAD || self.ticks > RISE_TICKS {
                    self.stopped = Some(0);
                    return Step::Voltage(0);
                }
                Step::Voltage(self.sign * (PWM_MAX / RISE_TICKS) * self.ticks)
            }
            Some(ticks) if *ticks < STOP_TICKS => {
                *ticks += 1;
                Step::Voltage(0)
            }
            Some(_) => match (self.farthest.wrong(), self.sign) {
                (Some(fault), _) => Step::Wrong(fault),
                (None, 1) => {
                    *self = Self { sign: -1, ticks: 0, ..Self::NEW };
                    Step::Voltage(0)
                }
                (None, _) => Step::Proven,
            },
        }
    }
}

impl Witnesses {
    /// Nothing has moved.
    const NONE: Self = Self { drive_rad: 0.0, own_rad: 0.0, gap_m: 0.0 };

    /// The counts of these moves or of later ones, whichever have come farther, and the later gap.
    fn or_farther(&self, later: &Self) -> Self {
        let farther = |one: f32, later: f32| if later.abs() > one.abs() { later } else { one };
        let drive_rad = farther(self.drive_rad, later.drive_rad);
        Self { drive_rad, own_rad: farther(self.own_rad, later.own_rad), gap_m: later.gap_m }
    }

    /// The readings of a tick.
    pub fn new(constants: &RigConstants, drive_counts: i64, own_counts: i64, gap_m: f32) -> Self {
        let rad = |counts| crate::angle_rad(counts, constants.counts_per_rad.abs());
        Self { drive_rad: rad(drive_counts), own_rad: rad(own_counts), gap_m }
    }

    fn turned(&self) -> f32 {
        self.drive_rad.abs().max(self.own_rad.abs())
    }

    /// What is wrong with a move that was commanded to be positive.
    fn wrong(&self) -> Option<Fault> {
        let Self { drive_rad, own_rad, gap_m } = *self;
        let turned = self.turned();
        if turned < ALIKE * MEASURED_RAD {
            // Ten times the noise of a reading.
            return Some(if gap_m.abs() > LVDT_COUNT_M { Fault::EncoderStuck } else { Fault::MotorStill });
        }
        let stands = |rad: f32| rad.abs() < ALIKE * turned;
        match (drive_rad > 0.0, own_rad > 0.0) {
            _ if stands(drive_rad) => Some(Fault::DriveEncoder),
            _ if stands(own_rad) => Some(Fault::EncoderStuck),
            (true, false) => Some(Fault::EncoderDirection),
            (false, true) => Some(Fault::DriveEncoder),
            (false, false) => Some(Fault::MotorDirection),
            (true, true) => ((drive_rad - own_rad).abs() > ALIKE * turned).then_some(Fault::EncoderDisagrees),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motor without load whose speed goes with the voltage at once, seen by witnesses with these signs.
    fn check(motor: f32, drive: f32, own: f32, gap_m_per_rad: f32) -> (Step, f32) {
        let (mut check, mut angle, mut farthest) = (DirectionCheck::NEW, 0.0f32, 0.0f32);
        for _ in 0..200 {
            let now = Witnesses { drive_rad: drive * angle, own_rad: own * angle, gap_m: 0.09 + gap_m_per_rad * angle };
            match check.step(&now) {
                Step::Voltage(pwm) => angle += motor * f32::from(pwm) / f32::from(PWM_MAX) * 1.7 * crate::TICK_S,
                step => return (step, farthest),
            }
            farthest = farthest.max(angle.abs());
        }
        panic!("no verdict");
    }

    #[test]
    fn each_combination_of_signs_has_its_verdict() {
        use Fault::*;
        for (motor, drive, own, verdict) in [
            (1.0, 1.0, 1.0, Step::Proven),
            (-1.0, 1.0, 1.0, Step::Wrong(MotorDirection)),
            (1.0, -1.0, 1.0, Step::Wrong(DriveEncoder)),
            (1.0, 1.0, -1.0, Step::Wrong(EncoderDirection)),
            // The drive's own loop is good, so the odd one out is the own encoder.
            (-1.0, -1.0, 1.0, Step::Wrong(EncoderDirection)),
            (-1.0, 1.0, -1.0, Step::Wrong(DriveEncoder)),
            (1.0, -1.0, -1.0, Step::Wrong(MotorDirection)),
            // Mirrored: as good.
            (-1.0, -1.0, -1.0, Step::Proven),
            (1.0, 0.0, 1.0, Step::Wrong(DriveEncoder)),
            (1.0, 0.0, -1.0, Step::Wrong(DriveEncoder)),
            (1.0, 1.0, 0.0, Step::Wrong(EncoderStuck)),
            (1.0, 2000.0 / 4096.0, 1.0, Step::Wrong(EncoderDisagrees)),
            (1.0, 1.0, 0.8, Step::Wrong(EncoderDisagrees)),
            (1.0, 1.0, 0.95, Step::Proven),
            (0.0, 1.0, 1.0, Step::Wrong(MotorStill)),
            (1.0, 0.0, 0.0, Step::Wrong(EncoderStuck)),
        ] {
            let (step, farthest) = check(motor, drive, own, 0.4e-3);
            assert_eq!(step, verdict, "motor {motor}, drive {drive}, own {own}");
            assert!(farthest < 0.3, "{farthest} rad");
        }
        // Friction holds the load: the gap says nothing.
        assert_eq!(check(1.0, 0.0, 0.0, 0.0).0, Step::Wrong(Fault::MotorStill));
    }

    #[test]
    fn a_pulse_rises_slowly_ends_when_something_moves_and_is_followed_by_one_the_other_way() {
        let mut check = DirectionCheck::NEW;
        let still = Witnesses { drive_rad: 0.0, own_rad: 0.0, gap_m: 0.09 };
        assert!((0..RISE_TICKS).all(|_| check.step(&still) == Step::Voltage(0)), "whether the strings stand");
        let rise: [Step; 3] = core::array::from_fn(|_| check.step(&still));
        assert_eq!(rise, [25, 50, 75].map(Step::Voltage));
        let moved = Witnesses { drive_rad: 0.06, own_rad: 0.06, ..still };
        assert!((0..=STOP_TICKS).all(|_| check.step(&moved) == Step::Voltage(0)));
        assert_eq!(check.step(&moved), Step::Voltage(0), "the verdict of the first pulse");
        assert_eq!(check.step(&moved), Step::Voltage(-25));
    }

    #[test]
    fn strings_that_a_load_turns_back_are_waited_for_and_prove_the_directions_all_the_same() {
        // Slowly, and so fast that they are almost back when the drive has reported how far the first pulse came.
        for back_per_s in [2.0, 12.0] {
            let (mut check, mut angle, mut reported, mut waited) = (DirectionCheck::NEW, 2.0f32, 2.0f32, 0u16);
            loop {
                let now = Witnesses { drive_rad: reported, own_rad: angle, gap_m: 0.09 };
                reported = angle;
                match check.step(&now) {
                    Step::Voltage(pwm) => {
                        waited += u16::from(pwm == 0);
                        let turns = 3.4 * f32::from(pwm) / f32::from(PWM_MAX);
                        angle += (turns - back_per_s * angle) * crate::TICK_S;
                    }
                    step => {
                        assert_eq!(step, Step::Proven, "{back_per_s} per second after {waited} ticks");
                        // Until they turn by half a radian per second.
                        assert!((40..250).contains(&waited), "{waited}");
                        break;
                    }
                }
            }
        }
    }

    #[test]
    fn an_encoder_that_counts_by_itself_gets_its_verdict() {
        let mut check = DirectionCheck::NEW;
        let counts = |tick: i16| Witnesses { drive_rad: 0.0, own_rad: 0.01 * f32::from(tick), gap_m: 0.09 };
        let found = (0..600).map(|tick| check.step(&counts(tick))).find(|step| !matches!(step, Step::Voltage(_)));
        assert_eq!(found, Some(Step::Wrong(Fault::DriveEncoder)));
    }

    #[test]
    fn a_gap_that_jumps_by_noise_on_the_way_is_no_motion() {
        let mut check = DirectionCheck::NEW;
        let noise_m = |tick: i16| if tick % 4 == 1 { 2.0 * LVDT_COUNT_M } else { 0.0 };
        let still = |tick: i16| Witnesses { drive_rad: 0.0, own_rad: 0.0, gap_m: 0.09 + noise_m(tick) };
        let found = (0..100).map(|tick| check.step(&still(tick))).find(|step| !matches!(step, Step::Voltage(_)));
        assert_eq!(found, Some(Step::Wrong(Fault::MotorStill)));
    }
}
