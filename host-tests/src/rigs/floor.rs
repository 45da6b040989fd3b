//! What is measured on a rig, and the floors: what is asked of it.

use rig_plant::RigPreset;
use serde::{Serialize, Serializer};

/// Makes [`Check`] and the table of what each is called.
macro_rules! checks {
    ($($(#[$doc:meta])* $check:ident, $name:literal, $row:literal, $factor:literal, $unit:literal;)*) => {
        /// One thing that is measured.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Check {
            $($(#[$doc])* $check),*
        }

        const CHECKS: &[(Check, &str, &str, f64, &str)] = &[$((Check::$check, $name, $row, $factor, $unit)),*];
    };
}

// Its name in CSV and JSON, the row of the table that it belongs to (empty if nothing is asked of it), and factor and unit with which
// its values are shown.
checks! {
    /// Error of the zero twist that homing found (rad); none if homing failed.
    Zero, "zero_error_rad", "homing succeeds, zero", 1.0, "rad";
    /// Error of the load after homing, as a fraction of the load.
    LoadHomed, "load_after_homing", "load after homing", 100.0, "%";
    /// Error of the load 5 s after a step of the load, as a fraction of the load.
    LoadStep, "load_after_step", "load after a step of load", 100.0, "%";
    /// Whether the stated error of the load covers the true one: 1 or 0.
    LoadCover, "load_covered", "stated error covers: load", 100.0, "%";
    /// Error of the load over the stated one: much above 1 a wrong load was called certain.
    Certain, "load_error_over_stated", "load error over the stated one", 1.0, "times";
    /// Whether the stated error of the position covers the true one: 1 or 0.
    PositionCover, "position_covered", "stated error covers: position", 100.0, "%";
    /// Maximum deviation of the measured position from the target during 60 s of rest (m), averaged over 0.3 s: one block
    /// of the LVDT is noisier than where the load stands.
    RestMeasured, "rest_measured_m", "at rest against the LVDT", 1e6, "µm";
    /// Reversals of the strings by more than [`super::trial::REVERSAL_RAD`] during the rest.
    Hunting, "rest_reversals", "at rest, reversals", 1.0, "";
    /// Maximum deviation of the true position from the target during the rest (m).
    RestTrue, "rest_true_m", "at rest against the truth", 1e3, "mm";
    /// Rms error of the true position while the set-point travels (m).
    FollowRms, "following_rms_m", "following at 2 mm/s, rms", 1e3, "mm";
    /// Maximum error of the same (m).
    FollowMax, "following_most_m", "following at 2 mm/s, most", 1e3, "mm";
    /// Faults without a cause.
    Faults, "faults", "faults without a cause", 1.0, "";
    /// Moves that were begun.
    Moves, "moves", "", 1.0, "";
    /// How far the load sank in the 3 s after a fault (m).
    Sank, "sank_after_fault_m", "load sinks after a fault", 1e3, "mm";
    /// Rms error of predicted contractions under loads between those of the sweeps, as a fraction of the true ones.
    HeldOut, "held_out_contraction", "contraction between the sweeps", 100.0, "%";
    /// Whether the stated error of a predicted contraction covers the true one: 1 or 0.
    PredictionCover, "prediction_covered", "stated error covers: contraction", 100.0, "%";
    /// The stated error of a predicted contraction, as a fraction of the contraction.
    PredictionStated, "prediction_error_stated", "contraction, stated error", 100.0, "%";
    /// Error of a predicted contraction over the stated one.
    PredictionOverStated, "prediction_error_over_stated", "contraction error over the stated", 1.0, "times";
    /// Whether the stated error of an identified constant covers the true one: 1 or 0.
    ConstantCover, "constant_covered", "stated error covers: constants", 100.0, "%";
    /// Rms error of following with the best fixed ratio on the same rig, over that of the firmware.
    FixedRatio, "times_better_than_fixed_ratio", "times better than a fixed ratio", 1.0, "times";
}

impl Serialize for Check {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
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
        /// Fraction of the values.
        fraction: f64,
    },
    /// Every value is this or more.
    AtLeast(f64),
    /// The mean lies between two values.
    Mean([f64; 2]),
    /// The sum for every 200 moves is this or less.
    Per200Moves(f64),
}

impl Check {
    /// Every check, in the order of the table.
    pub fn all() -> impl Iterator<Item = Self> {
        CHECKS.iter().map(|(check, ..)| *check)
    }

    /// Its name in the CSV and in JSON.
    pub fn name(self) -> &'static str {
        CHECKS[self as usize].1
    }

    /// The row of the table that it belongs to; empty if it has none.
    pub fn row(self) -> &'static str {
        CHECKS[self as usize].2
    }

    /// Factor and unit with which its values are shown.
    pub fn unit(self) -> (f64, &'static str) {
        let (.., factor, unit) = CHECKS[self as usize];
        (factor, unit)
    }

    /// What is asked of it on this kind of rig; `as_built` without identification, where the load's error is free.
    pub fn floor(self, kind: RigPreset, as_built: bool) -> Option<Floor> {
        let hard = kind == RigPreset::Hard;
        let pick = |nominal: f64, worst: f64| if hard { worst } else { nominal };
        let all =
            |nominal: f64, worst: f64| Floor::Within { limit: pick(nominal, worst), per_load_n: 0.0, fraction: 1.0 };
        Some(match self {
            Self::Zero => Floor::Within { limit: 0.05, per_load_n: 0.0, fraction: pick(0.99, 0.95) },
            Self::LoadHomed if !as_built => {
                Floor::Within { limit: pick(0.05, 0.15), per_load_n: pick(0.05, 0.1), fraction: 1.0 }
            }
            Self::LoadStep if !as_built => all(0.10, 0.30),
            Self::LoadCover | Self::PositionCover => Floor::Mean([0.85, 0.95]),
            Self::Certain if hard => all(CERTAIN, CERTAIN),
            Self::RestMeasured => all(50e-6, 100e-6),
            Self::Hunting => all(HUNTING, HUNTING),
            Self::RestTrue => all(0.15e-3, 0.3e-3),
            Self::FollowRms => all(0.1e-3, 0.3e-3),
            Self::FollowMax => all(0.3e-3, 0.8e-3),
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
            Self::AtLeast(min) => Some(value.is_some_and(|v| v >= min)),
            Self::Mean(_) => None,
            // How many there may be is asked of all of them together.
            Self::Per200Moves(_) => Some(value.is_none_or(|faults| faults <= 0.0)),
        }
    }

    /// In words, with the factor and unit that the check's values are shown with.
    pub fn text(self, check: Check) -> String {
        let (by, unit) = check.unit();
        match self {
            Self::Within { limit, per_load_n, fraction } => {
                let of = if fraction < 1.0 { format!(", {:.0} %", 100.0 * fraction) } else { String::new() };
                let more = if per_load_n > 0.0 { format!(" + {per_load_n} N") } else { String::new() };
                format!("{} {unit}{more}{of}", trimmed(by * limit)).trim_end().to_owned()
            }
            Self::AtLeast(min) => format!("{} {unit}", trimmed(by * min)),
            Self::Mean([low, high]) => format!("{} to {} {unit}", trimmed(by * low), trimmed(by * high)),
            Self::Per200Moves(max) => format!("{} in 200 moves", trimmed(max)),
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
