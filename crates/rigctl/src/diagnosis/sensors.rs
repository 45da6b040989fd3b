//! Checks of LVDT, encoder and supply.

use super::{Check, check};
use crate::failure::Failure;
use crate::lvdt_points::GAP_M;
use crate::session::Session;
use crate::session::row::Row;
use crate::statistics::{Errors, mean};
use crate::units::{MM, PERCENT, RAD, UM, V};
use rig_config::Scene;
use rig_link::{Fault, Faults, Identity, Request, Sensors, Setting, State, Telemetry};

/// Rms noise of a position at rest (m) that is plausible: a block's is about 4 µm.
const NOISE_M: f64 = 15e-6;
/// How far a resting load may seem to be outside its travel (m).
const OUTSIDE_M: f64 = 2e-3;
/// How far the gap of a rig that is not homed may be outside the range of its strings (m): the LVDT may not be calibrated,
/// and the load may rest on something.
const GAP_OUTSIDE_M: f64 = 10e-3;
/// Speed (rad/s) and time (s) of the turn that compares encoder and drive.
const TURN: (f32, f64) = (2.0, 1.0);
/// Minimum turn that the encoder shows (rad).
const TURN_RAD: f64 = 0.5;
/// Fraction by which encoder and drive may differ over that turn: the drive's speed has a coarse resolution.
const TURN_FRACTION: f64 = 0.1;

/// Mean and rms about it.
fn mean_rms(values: &[f64]) -> (f64, f64) {
    let mean = mean(values);
    (mean, Errors::over(values.iter().map(|v| v - mean)).rms)
}

/// The LVDT: its noise, and where it sees the load.
///
/// # Errors
/// If the scene has no equilibria to compare with, or the board does not answer.
pub fn lvdt(heard: &[Telemetry], id: &Identity, scene: &Scene, session: &mut Session) -> Result<Check, Failure> {
    let bad = Faults::of(&[
        Fault::LvdtOpen,
        Fault::LvdtShort,
        Fault::LvdtNoisy,
        Fault::LvdtFrozen,
        Fault::LvdtStalled,
        Fault::LvdtJump,
        Fault::ModelResidual,
    ]);
    if let Some(fault) = heard.last().and_then(|t| t.faults.iter().find(|f| bad.contains(*f))) {
        return Ok(check(
            "LVDT",
            false,
            format!("{fault}"),
            "wiring, supply and mounting of the LVDT (docs/reference/faults.md)",
        ));
    }
    // Exactly no noise is as wrong as too much.
    let noisy =
        "a healthy block has a few micrometres: screen, ground and supply of the LVDT; does the load oscillate?";
    let quiet = |rms: f64| rms > 0.0 && rms < NOISE_M;
    let noise = |rms: f64| format!("{} rms (allowed: above 0, below {})", UM.error(rms), UM.exact(NOISE_M));
    let mechanism = scene.mechanism()?;
    let [low, high] = scene.table_requirement()?.0.twist_rad();
    let [min_n, max_n] = [id.table.load_min_n, id.table.load_max_n].map(f64::from);
    let at_rest = |t: &&Telemetry| matches!(t.state, State::Ready | State::Holding);
    // From where the load hangs at the pre-twist, wherever `calibrate zero` has put 0.
    let zero_m = session.known_settings().map_or(0.0, |s| f64::from(s.values.get(Setting::PositionZero)));
    let positions: Vec<f64> =
        heard.iter().filter(at_rest).filter_map(|t| Some(f64::from(t.position_m?) + zero_m)).collect();
    if positions.len() < 20 {
        let Ok(gaps_m) = session.gaps_m() else {
            return Ok(check(
                "LVDT",
                false,
                "no valid reading",
                "wiring and supply of the LVDT (docs/reference/faults.md)",
            ));
        };
        let (mean, rms) = mean_rms(&gaps_m);
        // Untwisted strings end their rods farther apart than the pre-twist leaves them, by less than the allowance.
        let (min, max) = (mechanism.solve(min_n, high)?.gap_m, mechanism.solve(max_n, low)?.gap_m);
        let inside = (min - GAP_OUTSIDE_M..=max + GAP_OUTSIDE_M).contains(&mean);
        let seen = format!(
            "gap {} (strings make {}, allowed are {} more each way), noise {}; its position is judged on a homed actuator (--home)",
            MM.rounded(mean, GAP_M),
            MM.range([min, max]),
            MM.exact(GAP_OUTSIDE_M),
            noise(rms)
        );
        let advice =
            if inside { noisy } else { "measure the gap with callipers, then `calibrate lvdt`; is it the scene's?" };
        return Ok(check("LVDT", inside && quiet(rms), seen, advice));
    }
    let (mean, rms) = mean_rms(&positions);
    // The least load is lifted farthest.
    let travel_m = mechanism.solve(min_n, low)?.gap_m - mechanism.solve(min_n, high)?.gap_m;
    let inside = (-OUTSIDE_M..=travel_m + OUTSIDE_M).contains(&mean);
    let seen = format!(
        "at {} of 0 to {} (allowed are {} more each way), noise {}",
        MM.rounded(mean, GAP_M),
        MM.show(travel_m),
        MM.exact(OUTSIDE_M),
        noise(rms)
    );
    let advice = if inside {
        noisy
    } else {
        "the position is outside the travel: home again, check the LVDT's mounting and scale"
    };
    Ok(check("LVDT", inside && quiet(rms), seen, advice))
}

/// Turns up and back, and returns the way up by the encoder and by the drive (rad of twist).
///
/// # Errors
/// If the board refuses the turn, or does not answer.
pub fn turn(session: &mut Session, gear: f64) -> Result<[f64; 2], Failure> {
    session.until(0.5, |_| false)?;
    session.take_rows();
    let mut way = [0.0; 2];
    for speed in [TURN.0, -TURN.0] {
        session.request(&Request::Jog { twist_speed_rad_per_s: speed })?;
        session.until(TURN.1, |_| false)?;
        session.request(&Request::Stop)?;
        session.until(5.0, |s| !s.is_moving())?;
        session.until(0.3, |_| false)?;
        let rows = session.take_rows();
        if speed > 0.0 {
            let twist = |r: &Row| r.twist_rad.map(f64::from);
            let ends = rows.first().and_then(twist).zip(rows.last().and_then(twist));
            way[0] = ends.map_or(0.0, |(from, to)| to - from);
            way[1] = rows
                .windows(2)
                .filter_map(|r| Some((r[1].t_s - r[0].t_s) * f64::from(r[1].drive_speed_rad_per_s?) / gear))
                .sum();
        }
    }
    Ok(way)
}

/// The encoder, against the drive if the strings were turned.
pub fn encoder(turned: Option<[f64; 2]>, last: &Telemetry, sensors: &Sensors) -> Check {
    let advice = "coupling, gear ratio and encoder lines of the scene, A and B swapped (docs/reference/faults.md)";
    let bad = [Fault::EncoderStuck, Fault::EncoderJump, Fault::EncoderDisagrees];
    if let Some(fault) = last.fault.filter(|f| bad.contains(f)) {
        return check("encoder", false, fault.name(), advice);
    }
    let Some([own, motor]) = turned else {
        let seen =
            format!("at {}, no fault; compared with the drive while it turns (--home)", RAD.show(sensors.shaft_rad));
        return check("encoder", true, seen, "");
    };
    let seen = format!(
        "turned {} by the encoder (at least {}), {} by the drive (within {})",
        RAD.show(own),
        RAD.exact(TURN_RAD),
        RAD.show(motor),
        PERCENT.exact(TURN_FRACTION)
    );
    check("encoder", own > TURN_RAD && (motor - own).abs() < TURN_FRACTION * own, seen, advice)
}

/// The drive's supply.
pub fn supply(last: &Telemetry, scene: &Scene, sensors: &Sensors) -> Check {
    let [min, max] = scene.rig.supply_limits_v();
    let seen = match (scene.rig.supply_divider, sensors.supply_v) {
        (Some(_), Some(volts)) => format!("{}, allowed {}", V.show(volts), V.range([min, max])),
        (Some(_), None) => "not reported yet".to_owned(),
        (None, _) => "not wired by this scene (no supply_divider), so not watched".to_owned(),
    };
    check("supply", last.fault != Some(Fault::Supply), seen, "the drive's supply and its cable, then `clear`")
}
