//! Whether the values of a scene fit each other.
//!
//! Each value may be possible by itself and the rig still not: a motor that cannot lift the range, a sensor that cannot
//! see the gap, a pin with more volts than it bears. The constant `CHECKS` is the list. What would hurt hardware or leaves no
//! mechanism is looked at whenever a scene is read; what a solve has no use for only where a rig is meant
//! ([`Scene::check_rig`]).

mod lvdt;
mod mechanism;
mod motor;
mod volts;

use crate::{Scene, SceneError};
use tsa_model::SolveError;

/// Values that do not fit each other.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: {why}", keys.join(", "))]
pub struct Residual {
    /// The keys, as in a scene file.
    pub keys: &'static [&'static str],
    /// Their numbers, and why these do not go together.
    pub why: String,
}

/// Verdict of a check.
enum Verdict {
    Fits,
    /// It works, but is so unusual for a rig that a mistake is likelier.
    Unusual(String),
    /// It cannot work, or hurts something.
    Impossible(String),
}
use Verdict::{Fits, Impossible, Unusual};

/// When a check is made.
enum Look {
    /// Whenever a scene is read.
    Always(fn(&Scene) -> Verdict),
    /// Where a rig is meant.
    Rig(fn(&Scene) -> Verdict),
    /// Where a rig is meant and the scene has an envelope.
    Envelope(fn(&Scene, &States) -> Verdict),
}

struct Check {
    keys: &'static [&'static str],
    look: Look,
}

const fn check(keys: &'static [&'static str], look: Look) -> Check {
    Check { keys, look }
}

const LVDT: &[&str] = &[
    "rig.lvdt_stroke_m",
    "rig.lvdt_gap_at_zero_m",
    "rig.lvdt_volts_at_zero",
    "rig.lvdt_volts_at_stroke",
    "envelope.load_n",
    "envelope.turns",
];
const TORQUE: &[&str] = &[
    "rig.motor_torque_constant_nm_per_a",
    "rig.drive_current_limit_a",
    "rig.gear_ratio",
    "envelope.load_n",
    "envelope.turns",
];

const CHECKS: &[Check] = &[
    check(&["geometry.rod_radius_m", "geometry.rod_span_m"], Look::Always(mechanism::rod_is_a_rod)),
    check(
        &["geometry.rod_radius_m", "geometry.rod_span_m", "geometry.clamp_width_m"],
        Look::Rig(mechanism::rod_is_slender),
    ),
    check(&["string.diameter_m", "geometry.rod_span_m"], Look::Always(mechanism::strings_are_apart)),
    check(&["rig.supply_voltage_v"], Look::Always(volts::drive_takes_the_supply)),
    check(&["rig.supply_divider", "rig.supply_voltage_v"], Look::Always(volts::supply_sense_volts)),
    check(&["rig.adc_reference_v"], Look::Always(volts::adc_reference)),
    check(
        &["rig.lvdt_volts_at_zero", "rig.adc_reference_v"],
        Look::Always(|s| volts::lvdt_pin(s, s.rig.lvdt_volts_at_zero)),
    ),
    check(
        &["rig.lvdt_volts_at_stroke", "rig.adc_reference_v"],
        Look::Always(|s| volts::lvdt_pin(s, s.rig.lvdt_volts_at_stroke)),
    ),
    check(&["rig.lvdt_stroke_m", "rig.adc_reference_v"], Look::Rig(lvdt::resolves_homing)),
    check(
        &["rig.motor_torque_constant_nm_per_a", "rig.motor_speed_max_rad_per_s", "rig.supply_voltage_v"],
        Look::Rig(motor::supply_reaches_the_speed),
    ),
    check(
        &[
            "rig.rotor_inertia_kg_m2",
            "rig.motor_acceleration_max_rad_per_s2",
            "rig.motor_torque_constant_nm_per_a",
            "rig.drive_current_limit_a",
        ],
        Look::Rig(motor::current_reaches_the_acceleration),
    ),
    check(&["rig.encoder_lines", "rig.motor_speed_max_rad_per_s"], Look::Rig(motor::drive_measures_speed)),
    check(&["rig.encoder_lines", "rig.motor_speed_max_rad_per_s"], Look::Rig(motor::board_follows_the_count)),
    check(&["string.stiffness_n_per_m", "envelope.load_n"], Look::Envelope(mechanism::string_bears_the_load)),
    check(LVDT, Look::Envelope(lvdt::sees_the_gaps)),
    check(TORQUE, Look::Envelope(motor::motor_lifts_the_load)),
    check(
        &["rig.motor_resistance_ohm", "rig.motor_torque_constant_nm_per_a", "rig.supply_voltage_v", "envelope.load_n"],
        Look::Envelope(motor::supply_reaches_the_torque),
    ),
    check(
        &["rig.motor_speed_max_rad_per_s", "rig.gear_ratio", "envelope.turns"],
        Look::Envelope(motor::speed_covers_the_turns),
    ),
    check(
        &["rig.encoder_lines", "rig.gear_ratio", "accuracy.contraction_m"],
        Look::Envelope(motor::count_is_fine_enough),
    ),
    check(&["rig.encoder_lines", "rig.gear_ratio", "envelope.turns"], Look::Envelope(motor::drive_counts_the_turns)),
];

impl Scene {
    /// The checks that every scene has to pass.
    pub(super) fn check_always(&self) -> Result<(), SceneError> {
        let found = CHECKS.iter().filter_map(|check| match check.look {
            Look::Always(look) => Some((check, look(self))),
            Look::Rig(_) | Look::Envelope(_) => None,
        });
        sort(found).map(drop)
    }

    /// Whether a rig like this can work: checks the values against each other and, where there is an envelope, against
    /// the equilibria at its edges (some 20 solves). Returns the unusual values, for warnings.
    ///
    /// # Errors
    /// [`SceneError::Impossible`] with all that cannot work or would hurt hardware, each with its keys and numbers;
    /// [`SceneError::Value`] for what is wrong by itself; [`SceneError::Unsolvable`] where an edge of the envelope has
    /// no equilibrium.
    pub fn check_rig(&self) -> Result<Vec<Residual>, SceneError> {
        // Values that describe no mechanism cannot be solved.
        self.validate()?;
        let states = States::of(self)?;
        let found = CHECKS.iter().filter_map(|check| match (&check.look, &states) {
            (Look::Always(look) | Look::Rig(look), _) => Some((check, look(self))),
            (Look::Envelope(look), Some(states)) => Some((check, look(self, states))),
            (Look::Envelope(_), None) => None,
        });
        sort(found)
    }
}

/// The unusual values, or all impossible ones.
fn sort<'a>(found: impl Iterator<Item = (&'a Check, Verdict)>) -> Result<Vec<Residual>, SceneError> {
    let (mut unusual, mut impossible) = (Vec::new(), Vec::new());
    for (check, verdict) in found {
        match verdict {
            Fits => {}
            Unusual(why) => unusual.push(Residual { keys: check.keys, why }),
            Impossible(why) => impossible.push(Residual { keys: check.keys, why }),
        }
    }
    if impossible.is_empty() { Ok(unusual) } else { Err(SceneError::Impossible(impossible)) }
}

/// A number at a load and a count of turns.
#[derive(Clone, Copy)]
struct At {
    value: f64,
    load_n: f64,
    turns: f64,
}

/// The extremes that the rig must reach in the scene's envelope and in homing.
struct States {
    /// Minimum and maximum gap (m).
    gap_m: [At; 2],
    /// Maximum torque of the strings (N m).
    torque_nm: At,
    /// Maximum change of the gap with twist (m/rad).
    slope_m_per_rad: At,
    /// First and last turn of the envelope.
    turns: [f64; 2],
    /// Maximum load (N).
    load_n: f64,
}

/// Turns past the pre-twist at which the strings have no twist.
const ZERO_TWIST: f64 = -0.5;

/// Loads and twists at which the envelope is solved along each of its edges.
const STEPS: u32 = 4;

impl States {
    fn of(scene: &Scene) -> Result<Option<Self>, SceneError> {
        let Some(envelope) = scene.envelope else { return Ok(None) };
        let mechanism = scene.mechanism()?;
        let solve = |load_n: f64, turns: f64| {
            let failed = |limit: SolveError| SceneError::Unsolvable { load_n, turns, limit };
            mechanism.solve(load_n, tsa_model::twist_from_turns(turns)).map_err(failed)
        };
        let along =
            |[from, to]: [f64; 2]| (0..=STEPS).map(move |k| from + (to - from) * f64::from(k) / f64::from(STEPS));
        let [min_n, max_n] = envelope.load_n;
        // The gap falls with the twist and rises with the load; the slope is largest at the last twist or load, and the
        // torque either there or where the strings are still open. Homing passes these twists, from zero on, where the gap has
        // its maximum.
        let edges = along(envelope.load_n)
            .map(|load_n| (load_n, envelope.turns[1]))
            .chain(along(envelope.turns).flat_map(|turns| [(min_n, turns), (max_n, turns)]))
            .chain(along([ZERO_TWIST, envelope.turns[0]]).map(|turns| (max_n, turns)));
        let start = At { value: 0.0, load_n: max_n, turns: ZERO_TWIST };
        let mut states = Self {
            gap_m: [At { value: f64::INFINITY, ..start }, start],
            torque_nm: start,
            slope_m_per_rad: start,
            turns: envelope.turns,
            load_n: max_n,
        };
        for (load_n, turns) in edges {
            let found = solve(load_n, turns)?;
            let at = |value: f64| At { value, load_n, turns };
            // Where lighter loads have no equilibrium at this twist, there is only the paper's relation.
            let conservative = mechanism.conservative_torque_nm(load_n, tsa_model::twist_from_turns(turns));
            let torque_nm = conservative.unwrap_or(found.torque_nm);
            if found.gap_m < states.gap_m[0].value {
                states.gap_m[0] = at(found.gap_m);
            }
            for (max, value) in [
                (&mut states.gap_m[1], found.gap_m),
                (&mut states.torque_nm, torque_nm.abs()),
                (&mut states.slope_m_per_rad, found.dgap_dtwist_m_per_rad.abs()),
            ] {
                if value > max.value {
                    *max = at(value);
                }
            }
        }
        Ok(Some(states))
    }
}

impl std::fmt::Display for At {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let load = short(self.load_n);
        if self.turns == ZERO_TWIST {
            write!(f, "at {load} N and zero twist")
        } else {
            write!(f, "at {load} N and {} turns", short(self.turns))
        }
    }
}

/// To four digits, as people write numbers.
fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let scale = 10f64.powi(3 - value.abs().log10().floor() as i32);
    let rounded = (value * scale).round() / scale;
    if (1e-4..1e7).contains(&rounded.abs()) { rounded.to_string() } else { format!("{rounded:e}") }
}

fn mm(metres: f64) -> String {
    format!("{} mm", short(1e3 * metres))
}
