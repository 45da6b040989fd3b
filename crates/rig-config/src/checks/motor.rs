//! Whether motor, drive, gear and encoder are up to the load and the turns.

use super::Verdict::{self, Fits, Impossible, Unusual};
use super::{States, short};
use crate::Scene;
use rig_control::homing::{LOAD_TURNS, MOTOR_FRACTION, SPEED, SWEEP_HALF, time_out_s};
use std::f64::consts::{PI, TAU};
use tsa_model::twist_from_turns;

/// Fraction of the current above which almost nothing remains for friction and acceleration (rig-control, `limits`).
const HOLDING_FRACTION: f64 = 0.9;
/// Longest time (s) for the way between the ends of the envelope.
const WAY_S: f64 = 180.0;

fn rpm(rad_per_s: f64) -> String {
    format!("{} rpm", short(rad_per_s * 60.0 / TAU))
}

pub(super) fn supply_reaches_the_speed(s: &Scene) -> Verdict {
    let rig = &s.rig;
    let volts = rig.motor_torque_constant_nm_per_a * rig.motor_speed_max_rad_per_s;
    if volts < rig.supply_voltage_v {
        return Fits;
    }
    Impossible(format!(
        "at {} rad/s ({}) the motor itself makes {} V, and the supply has {} V: it reaches {} rad/s at most. The torque \
         constant is in N m/A",
        short(rig.motor_speed_max_rad_per_s),
        rpm(rig.motor_speed_max_rad_per_s),
        short(volts),
        short(rig.supply_voltage_v),
        short(rig.supply_voltage_v / rig.motor_torque_constant_nm_per_a)
    ))
}

/// Acceleration of the twist (rad/s²) in homing, unless the scene gives the motor less (rig-control, `homing`).
const HOMING_RAD_PER_S2: f64 = 25.0;

pub(super) fn current_reaches_the_acceleration(s: &Scene) -> Verdict {
    let rig = &s.rig;
    let max_nm = rig.motor_torque_constant_nm_per_a * rig.drive_current_limit_a;
    let why = |acceleration: f64| {
        format!(
            "the rotor alone needs {} mN m for {} rad/s², and {} A make {} mN m; the inertia is in kg m² (1 g cm² is 1e-7)",
            short(1e3 * rig.rotor_inertia_kg_m2 * acceleration),
            short(acceleration),
            short(rig.drive_current_limit_a),
            short(1e3 * max_nm)
        )
    };
    let max = rig.motor_acceleration_max_rad_per_s2;
    let homing = max.min(HOMING_RAD_PER_S2 * rig.gear());
    if rig.rotor_inertia_kg_m2 * homing >= max_nm {
        Impossible(why(homing))
    } else if rig.rotor_inertia_kg_m2 * max > max_nm {
        Unusual(why(max))
    } else {
        Fits
    }
}

/// Fraction of the maximum speed that a step of the drive's measured speed may be: one count in its window of 1 ms, which
/// is 60000/(4 lines) rpm (crates/rmds405/README.md section 1).
const SPEED_STEP_FRACTION: f64 = 0.1;

pub(super) fn drive_measures_speed(s: &Scene) -> Verdict {
    let (lines, speed) = (s.rig.encoder_lines, s.rig.motor_speed_max_rad_per_s);
    let step = TAU * 1e3 / (4.0 * f64::from(lines));
    if step <= SPEED_STEP_FRACTION * speed {
        return Fits;
    }
    Impossible(format!(
        "with {lines} lines the drive measures speed in steps of {}, and the motor turns {} at most",
        rpm(step),
        rpm(speed)
    ))
}

/// Seconds from one reading of the board's 16-bit encoder count to the next (rig-control, `TICK_S`).
const TICK_S: f64 = 0.01;

pub(super) fn board_follows_the_count(s: &Scene) -> Verdict {
    let counts = 4.0 * f64::from(s.rig.encoder_lines) * s.rig.motor_speed_max_rad_per_s / TAU * TICK_S;
    if counts < 32_768.0 {
        return Fits;
    }
    Impossible(format!(
        "{} lines at {} are {} counts between two readings of the board, whose 16-bit counter tells at most 32767",
        s.rig.encoder_lines,
        rpm(s.rig.motor_speed_max_rad_per_s),
        short(counts)
    ))
}

/// Time (s) that homing takes from some turns: to zero twist and past it, two sweeps across it, to the half-turn pre-twist, up and
/// down over the weighed turns; and the rests and the probe. With a slow motor the emulated rig needs less.
fn homing_s(from_turns: f64, weighed_turns: f64, max_rad_per_s: f64) -> f64 {
    const RESTS_S: f64 = 3.0;
    let sweep_half = f64::from(SWEEP_HALF);
    let seek_rad = PI + TAU * from_turns + sweep_half;
    let way_rad = seek_rad + 4.0 * sweep_half + (sweep_half + PI) + 2.0 * TAU * weighed_turns;
    RESTS_S + way_rad / max_rad_per_s.min(SPEED.into())
}

pub(super) fn speed_covers_the_turns(s: &Scene, states: &States) -> Verdict {
    let speed = f64::from(MOTOR_FRACTION) * s.rig.motor_speed_max_rad_per_s / s.rig.gear();
    let turning = |what: String, seconds: f64, max: f64| {
        Impossible(format!(
            "{} of the motor through a gear of {}:{} turn the strings at {} rad/s with a tenth to spare: {what} would \
             take {} s, and is given {} s",
            rpm(s.rig.motor_speed_max_rad_per_s),
            s.rig.gear_ratio[0],
            s.rig.gear_ratio[1],
            short(speed),
            short(seconds),
            short(max)
        ))
    };
    let [first, last] = states.turns;
    let home_s = homing_s(last, (last - first).min(LOAD_TURNS.into()), speed);
    let time_out_s = f64::from(time_out_s(twist_from_turns(last) as f32));
    let way_s = (last - first) * TAU / speed;
    if home_s > time_out_s {
        turning(format!("homing from {} turns", short(last)), home_s, time_out_s)
    } else if way_s > WAY_S {
        turning(format!("the way of {} turns", short(last - first)), way_s, WAY_S)
    } else {
        Fits
    }
}

/// Current (A) that holds the heaviest state, without friction.
fn holding_a(s: &Scene, states: &States) -> f64 {
    states.torque_nm.value / (s.rig.gear() * s.rig.motor_torque_constant_nm_per_a)
}

pub(super) fn motor_lifts_the_load(s: &Scene, states: &States) -> Verdict {
    let (needed, limit) = (holding_a(s, states), s.rig.drive_current_limit_a);
    let why = |rest: &str| {
        format!(
            "the strings pull back with {} mN m {}, which through a gear of {}:{} takes {} A of the motor, and its limit \
             is {} A{rest}",
            short(1e3 * states.torque_nm.value),
            states.torque_nm,
            s.rig.gear_ratio[0],
            s.rig.gear_ratio[1],
            short(needed),
            short(limit)
        )
    };
    if needed >= limit {
        Impossible(why("; the torque constant is in N m/A, the limit in A"))
    } else if needed > HOLDING_FRACTION * limit {
        Unusual(why(": hardly any is left for friction and acceleration"))
    } else {
        Fits
    }
}

pub(super) fn supply_reaches_the_torque(s: &Scene, states: &States) -> Verdict {
    let (needed, min) = (holding_a(s, states) * s.rig.motor_resistance_ohm, s.rig.supply_limits_v()[0]);
    if needed < min {
        return Fits;
    }
    Impossible(format!(
        "the {} A that the load needs {} take {} V through {} ohm, and the supply may be as low as {} V",
        short(holding_a(s, states)),
        states.torque_nm,
        short(needed),
        short(s.rig.motor_resistance_ohm),
        short(min)
    ))
}

pub(super) fn count_is_fine_enough(s: &Scene, states: &States) -> Verdict {
    let Some(accuracy) = s.accuracy else { return Fits };
    let step = states.slope_m_per_rad.value / s.rig.counts_per_rad();
    if step <= accuracy.contraction_m {
        return Fits;
    }
    Impossible(format!(
        "one count of the encoder moves the load by {} um {}, and {} um are asked for",
        short(1e6 * step),
        states.slope_m_per_rad,
        short(1e6 * accuracy.contraction_m)
    ))
}

pub(super) fn drive_counts_the_turns(s: &Scene, states: &States) -> Verdict {
    let turns = states.turns[1] - states.turns[0];
    let counts = s.rig.counts_per_rad() * TAU * turns;
    if counts < f64::from(i32::MAX) {
        return Fits;
    }
    Impossible(format!(
        "{} turns are {} counts of the encoder, and the drive counts to {}",
        short(turns),
        short(counts),
        i32::MAX
    ))
}
