//! What is measured on a rig, and the floors: what is asked of it.

use rig_plant::RigPreset;

/// One thing that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Check {
    /// The stated error of the LVDT's calibration (m).
    Calibration,
    /// Error of the zero twist that homing found (rad); none if homing failed.
    Zero,
    /// Time that homing took (s).
    HomingTime,
    /// Error of the load after homing, as a share of the load.
    LoadHomed,
    /// Error of the load 5 s after a step of the load, as a share of the load.
    LoadStep,
    /// Whether the stated error of the load covers the true one: 1 or 0.
    LoadCover,
    /// The stated error of the load, as a share of the load.
    LoadStated,
    /// Error of the load over the stated one: much above 1 a wrong load was called certain.
    Certain,
    /// Whether the stated error of the position covers the true one: 1 or 0.
    PositionCover,
    /// The stated error of the position (m).
    PositionStated,
    /// Greatest deviation of the measured position from the target during 60 s of rest (m), averaged over 0.3 s: one block
    /// of the LVDT is noisier than where the load stands.
    RestMeasured,
    /// Rms deviation of the same, not averaged (m).
    RestRms,
    /// Greatest deviation of the same, not averaged (m).
    RestRaw,
    /// Reversals of the strings by more than [`super::trial::REVERSAL_RAD`] during the rest.
    Hunting,
    /// Twist that the strings were turned by during the rest, both ways together (rad).
    Travel,
    /// Greatest deviation of the true position from the target during the rest (m).
    RestTrue,
    /// Rms error of the true position while the set-point travels (m).
    FollowRms,
    /// Greatest error of the same (m).
    FollowMost,
    /// Faults without a cause.
    Faults,
    /// Whether a step of the load was followed by a fault: 1 or 0. It has a cause.
    StepFaults,
    /// Moves that were begun.
    Moves,
    /// How far the load sank in the 3 s after a fault (m).
    Sank,
    /// Rms error of predicted contractions under loads between those of the sweeps, as a share of the true ones.
    HeldOut,
    /// Whether the stated error of a predicted contraction covers the true one: 1 or 0.
    PredictionCover,
    /// The stated error of a predicted contraction, as a share of the contraction.
    PredictionStated,
    /// Error of a predicted contraction over the stated one.
    PredictionOverStated,
    /// Whether the stated error of an identified constant covers the true one: 1 or 0.
    ConstantCover,
    /// Rms error of following with the best fixed ratio on the same rig, over that of the firmware.
    FixedRatio,
}

/// What is asked of the values of a check.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Floor {
    /// So much of the values, at least, lie within a limit.
    Within {
        /// The limit.
        limit: f64,
        /// What the limit gains by one over the load (N).
        per_load_n: f64,
        /// Share of the values.
        share: f64,
    },
    /// Every value is this or more.
    AtLeast(f64),
    /// The mean lies between two values.
    Mean([f64; 2]),
    /// The sum for every 200 moves is this or less.
    Per200Moves(f64),
}

impl Check {
    /// Every check.
    pub const ALL: [Self; 28] = [
        Self::Calibration,
        Self::Zero,
        Self::HomingTime,
        Self::LoadHomed,
        Self::LoadStep,
        Self::LoadCover,
        Self::LoadStated,
        Self::Certain,
        Self::PositionCover,
        Self::PositionStated,
        Self::RestMeasured,
        Self::RestRms,
        Self::RestRaw,
        Self::Hunting,
        Self::Travel,
        Self::RestTrue,
        Self::FollowRms,
        Self::FollowMost,
        Self::Faults,
        Self::StepFaults,
        Self::Moves,
        Self::Sank,
        Self::HeldOut,
        Self::PredictionCover,
        Self::PredictionStated,
        Self::PredictionOverStated,
        Self::ConstantCover,
        Self::FixedRatio,
    ];

    /// Its name in the CSV and in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Calibration => "calibration_error_m",
            Self::Zero => "zero_error_rad",
            Self::HomingTime => "homing_s",
            Self::LoadHomed => "load_after_homing",
            Self::LoadStep => "load_after_step",
            Self::LoadCover => "load_covered",
            Self::LoadStated => "load_error_stated",
            Self::Certain => "load_error_over_stated",
            Self::PositionCover => "position_covered",
            Self::PositionStated => "position_error_stated_m",
            Self::RestMeasured => "rest_measured_m",
            Self::RestRms => "rest_measured_rms_m",
            Self::RestRaw => "rest_measured_unaveraged_m",
            Self::Hunting => "rest_reversals",
            Self::Travel => "rest_travel_rad",
            Self::RestTrue => "rest_true_m",
            Self::FollowRms => "following_rms_m",
            Self::FollowMost => "following_most_m",
            Self::Faults => "faults",
            Self::StepFaults => "faults_at_load_steps",
            Self::Moves => "moves",
            Self::Sank => "sank_after_fault_m",
            Self::HeldOut => "held_out_contraction",
            Self::PredictionCover => "prediction_covered",
            Self::PredictionStated => "prediction_error_stated",
            Self::PredictionOverStated => "prediction_error_over_stated",
            Self::ConstantCover => "constant_covered",
            Self::FixedRatio => "times_better_than_fixed_ratio",
        }
    }

    /// The row of the table that it belongs to; none if nothing is asked of it.
    pub const fn row(self) -> Option<&'static str> {
        Some(match self {
            Self::Zero => "homing succeeds, zero",
            Self::LoadHomed => "load after homing",
            Self::LoadStep => "load after a step of load",
            Self::LoadCover => "stated error covers: load",
            Self::Certain => "load error over the stated one",
            Self::PositionCover => "stated error covers: position",
            Self::RestMeasured => "at rest against the LVDT",
            Self::Hunting => "at rest, reversals",
            Self::RestTrue => "at rest against the truth",
            Self::FollowRms => "following at 2 mm/s, rms",
            Self::FollowMost => "following at 2 mm/s, most",
            Self::Faults => "faults without a cause",
            Self::Sank => "load sinks after a fault",
            Self::HeldOut => "contraction between the sweeps",
            Self::PredictionCover => "stated error covers: contraction",
            Self::PredictionStated => "contraction, stated error",
            Self::PredictionOverStated => "contraction error over the stated",
            Self::ConstantCover => "stated error covers: constants",
            Self::FixedRatio => "times better than a fixed ratio",
            _ => return None,
        })
    }

    /// Factor and unit with which its values are shown.
    pub const fn unit(self) -> (f64, &'static str) {
        match self {
            Self::Zero | Self::Travel => (1.0, "rad"),
            Self::HomingTime => (1.0, "s"),
            Self::LoadHomed | Self::LoadStep | Self::LoadStated | Self::HeldOut | Self::PredictionStated => {
                (100.0, "%")
            }
            Self::LoadCover | Self::PositionCover | Self::PredictionCover | Self::ConstantCover => (100.0, "%"),
            Self::Calibration | Self::RestMeasured | Self::RestRms | Self::RestRaw | Self::PositionStated => {
                (1e6, "um")
            }
            Self::RestTrue | Self::FollowRms | Self::FollowMost | Self::Sank => (1e3, "mm"),
            Self::Hunting | Self::Faults | Self::StepFaults | Self::Moves => (1.0, ""),
            Self::FixedRatio | Self::Certain | Self::PredictionOverStated => (1.0, "times"),
        }
    }

    /// What is asked of it on this kind of rig; `as_built` without identification, where the load's error is free.
    pub fn floor(self, kind: RigPreset, as_built: bool) -> Option<Floor> {
        let hard = kind == RigPreset::Hard;
        let pick = |nominal: f64, worst: f64| if hard { worst } else { nominal };
        let all = |nominal: f64, worst: f64| Floor::Within { limit: pick(nominal, worst), per_load_n: 0.0, share: 1.0 };
        Some(match self {
            Self::Zero => Floor::Within { limit: 0.05, per_load_n: 0.0, share: pick(0.99, 0.95) },
            Self::LoadHomed if !as_built => {
                Floor::Within { limit: pick(0.05, 0.15), per_load_n: pick(0.05, 0.1), share: 1.0 }
            }
            Self::LoadStep if !as_built => all(0.10, 0.30),
            Self::LoadCover | Self::PositionCover => Floor::Mean([0.85, 0.95]),
            Self::Certain if hard => all(CERTAIN, CERTAIN),
            Self::RestMeasured => all(50e-6, 100e-6),
            Self::Hunting => all(HUNTING, HUNTING),
            Self::RestTrue => all(0.15e-3, 0.3e-3),
            Self::FollowRms => all(0.1e-3, 0.3e-3),
            Self::FollowMost => all(0.3e-3, 0.8e-3),
            Self::Faults => Floor::Per200Moves(pick(0.0, 2.0)),
            Self::Sank => all(SAFE_M, SAFE_M),
            Self::HeldOut if !as_built => all(0.02, 0.05),
            // Wider than need be is no fault here: the effects that no sweep shows are counted on every rig.
            Self::PredictionCover | Self::ConstantCover if !as_built => Floor::Mean([0.85, 1.0]),
            Self::FixedRatio if !as_built => Floor::AtLeast(pick(2.0, 1.0)),
            _ => return None,
        })
    }
}

/// An interval that holds the truth in 90 of 100 cases is missed by its own width in one of a thousand.
const CERTAIN: f64 = 2.0;
/// More reversals than this during 60 s, one every 5 s, are hunting: creep and noise take a few in any case.
const HUNTING: f64 = 12.0;
/// A load that sinks by no more than this after a fault is held (m).
const SAFE_M: f64 = 1e-3;

impl Floor {
    /// Whether one value meets it, if it asks something of each; the load in newtons.
    pub fn is_met(self, value: Option<f64>, load_n: f64) -> Option<bool> {
        match self {
            Self::Within { limit, per_load_n, .. } => {
                Some(value.is_some_and(|v| v.abs() <= limit + per_load_n / load_n))
            }
            Self::AtLeast(least) => Some(value.is_some_and(|v| v >= least)),
            Self::Mean(_) | Self::Per200Moves(_) => None,
        }
    }

    /// In words, with the factor and unit that the check's values are shown with.
    pub fn text(self, check: Check) -> String {
        let (by, unit) = check.unit();
        match self {
            Self::Within { limit, per_load_n, share } => {
                let of = if share < 1.0 { format!(", {:.0} %", 100.0 * share) } else { String::new() };
                let more = if per_load_n > 0.0 { format!(" + {per_load_n} N") } else { String::new() };
                format!("{} {unit}{more}{of}", trimmed(by * limit)).trim_end().to_owned()
            }
            Self::AtLeast(least) => format!("{} {unit}", trimmed(by * least)),
            Self::Mean([low, high]) => format!("{} to {} {unit}", trimmed(by * low), trimmed(by * high)),
            Self::Per200Moves(most) => format!("{} in 200 moves", trimmed(most)),
        }
    }
}

/// A number without rounding errors and trailing zeros.
fn trimmed(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// One measured value.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Load at that time (kg); none for what concerns the rig as a whole.
    pub load_kg: Option<f64>,
    /// What was measured.
    pub check: Check,
    /// Its value in SI units; none if it could not be measured.
    pub value: Option<f64>,
    /// When, or why there is no value.
    pub note: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_floor_is_met_up_to_its_limit() {
        let load = Check::LoadHomed.floor(RigPreset::Nominal, false).unwrap();
        // 5 % and 0.05 N of 1 N is 10 %.
        assert_eq!(load.is_met(Some(-0.0999), 1.0), Some(true));
        assert_eq!(load.is_met(Some(0.1001), 1.0), Some(false));
        assert_eq!(load.is_met(None, 1.0), Some(false), "what could not be measured is not met");
        assert!(Check::LoadHomed.floor(RigPreset::Nominal, true).is_none(), "free without identification");
        let times = Check::FixedRatio.floor(RigPreset::Nominal, false).unwrap();
        assert_eq!((times.is_met(Some(1.9), 1.0), times.is_met(Some(2.0), 1.0)), (Some(false), Some(true)));
        assert_eq!(Check::LoadHomed.floor(RigPreset::Hard, false).unwrap().text(Check::LoadHomed), "15 % + 0.1 N");
        assert_eq!(Check::Zero.floor(RigPreset::Hard, false).unwrap().text(Check::Zero), "0.05 rad, 95 %");
    }
}
