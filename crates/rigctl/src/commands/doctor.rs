//! `doctor`: is the rig well, and if not, what to do.

use super::operate::{home_session, is_sim, meet};
use crate::cli::Global;
use crate::failure::Failure;
use crate::output::Output;
use crate::session::Session;
use rig_control::TICK_US;
use rig_link::{
    Clock, Fault, Faults, Identity, PROTOCOL_HASH, Request, ResetCause, Sensors, Setting, State, Telemetry,
};
use rig_scene::Scene;
use serde::Serialize;
use serde_json::json;

/// How long to listen (s).
const LISTEN_S: f64 = 2.0;
/// How long the drive's start may take (s).
const START_S: f64 = 10.0;
/// Rms noise of a position at rest (m) that is plausible: a block's is about 4 µm.
const NOISE_M: f64 = 15e-6;
/// How far a resting load may seem to be outside its travel (m).
const OUTSIDE_M: f64 = 2e-3;
/// How far the gap of a rig that is not homed may be outside what its strings can make (m): an LVDT before it is
/// calibrated, and a load that rests on something.
const GAP_OUTSIDE_M: f64 = 10e-3;
/// Speed (rad/s) and time (s) of the turn that compares encoder and drive.
const TURN: (f32, f64) = (2.0, 1.0);
/// Share by which the two may differ over that turn: the drive's speed is coarse.
const TURN_SHARE: f64 = 0.1;
/// Share of a tick's period that the longest tick may take.
const TICK_SHARE: f64 = 0.5;

/// One thing looked at.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Check {
    name: &'static str,
    ok: bool,
    seen: String,
    /// What to do; of what is well, nothing.
    advice: Option<String>,
}

fn check(name: &'static str, ok: bool, seen: impl Into<String>, advice: impl Into<String>) -> Check {
    Check { name, ok, seen: seen.into(), advice: (!ok).then(|| advice.into()) }
}

/// Runs the command.
///
/// # Errors
/// If the scene cannot be read or is of a rig that cannot work, or anything is not well.
pub fn run(global: &Global, home: bool, output: &mut Output) -> Result<(), Failure> {
    let scene = super::rig_scene(global)?;
    // A scene that asks for no table is the scene's fault, not the board's.
    scene.table_demand()?;
    let checks = match meet(global).and_then(|mut session| examine(&mut session, &scene, home)) {
        Ok(checks) => checks,
        Err(failure) => vec![check(
            "link",
            false,
            failure.message().unwrap_or_default(),
            format!("is the board powered, is {} its port, is tool and firmware one build?", global.port),
        )],
    };
    let well = checks.iter().all(|c| c.ok);
    let port = if is_sim(global) { "sim (a fresh emulated board)" } else { &global.port };
    output.object(&json!({"ok": well, "port": global.port, "checks": checks}))?;
    output.line(format!("rigctl {} looking at {port}", env!("CARGO_PKG_VERSION")))?;
    for c in &checks {
        let advice = c.advice.as_ref().map_or(String::new(), |a| format!(": {a}"));
        output.line(format!("{:<5} {:<9} {}{advice}", if c.ok { "ok" } else { "CHECK" }, c.name, c.seen))?;
    }
    if well { Ok(()) } else { Err(Failure::Reported) }
}

fn examine(session: &mut Session, scene: &Scene, home: bool) -> Result<Vec<Check>, Failure> {
    let state = |s: &Session| s.telemetry().map_or(State::Boot, |t| t.state);
    session.until(START_S, |s| state(s) != State::Boot)?;
    let mut checks = Vec::new();
    let mut turned = None;
    if home {
        match home_session(session, |_| {}) {
            Ok(_) => turned = Some(turn(session, scene.rig.gear())?),
            Err(failure) => checks.push(check(
                "homing",
                false,
                failure.message().unwrap_or_default(),
                "see docs/faults.md; is the load hung, does it move freely?",
            )),
        }
        session.until(1.0, |_| false)?;
    }
    session.take_rows();
    let mut heard: Vec<Telemetry> = Vec::new();
    session.until(LISTEN_S, |s| {
        heard.extend(s.telemetry().filter(|t| heard.last().is_none_or(|l: &Telemetry| l.t_us != t.t_us)));
        false
    })?;
    let messages = session.take_rows().len();
    let id = session.identity().cloned().ok_or_else(|| Failure::failed("the board did not say who it is"))?;
    let Some(last) = heard.last().copied() else { return Err(Failure::failed("no telemetry from the board")) };
    let mut all = board(&id, scene)?;
    all.append(&mut checks);
    all.push(faults(&last));
    all.push(drive(&heard, scene));
    all.push(lvdt(&heard, &id, scene, session)?);
    let sensors = session.sensors()?;
    all.push(encoder(turned, &last, &sensors));
    all.push(supply(&last, scene, &sensors));
    all.extend(timing(&last, session, messages));
    Ok(all)
}

/// Who the board is.
fn board(id: &Identity, scene: &Scene) -> Result<Vec<Check>, Failure> {
    let tool = env!("CARGO_PKG_VERSION");
    let (envelope, accuracy) = scene.table_demand()?;
    let turns = envelope.turns;
    let t = &id.table;
    let close = |a: f64, b: f32| (a - f64::from(b)).abs() < 1e-5 * a.abs().max(1.0);
    let accurate = f64::from(t.contraction_error_m) <= accuracy.contraction_m
        && f64::from(t.tr_relative_error) <= accuracy.tr_relative;
    let covers = (f64::from(t.load_min_n) <= envelope.load_n[0] || close(envelope.load_n[0], t.load_min_n))
        && (f64::from(t.load_max_n) >= envelope.load_n[1] || close(envelope.load_n[1], t.load_max_n))
        && (f64::from(t.turns_max) >= turns[1] || close(turns[1], t.turns_max));
    let asked_for = matches!(id.reset_cause, ResetCause::PowerOn | ResetCause::Pin | ResetCause::Software);
    Ok(vec![
        check(
            "firmware",
            id.version == tool,
            format!("{} (git {}), tool {tool}", id.version, id.git),
            "build and flash the firmware that goes with this tool",
        ),
        check(
            "protocol",
            id.protocol_hash == PROTOCOL_HASH,
            format!("{:08x}", id.protocol_hash),
            format!("the tool speaks {PROTOCOL_HASH:08x}: build both from one tree"),
        ),
        check(
            "reset",
            asked_for,
            format!("last started by {}, {} boots since power came on", id.reset_cause, id.boot_count),
            match id.reset_cause {
                ResetCause::BrownOut => "the supply dipped: look at the board's supply and its ground",
                ResetCause::Watchdog => "the firmware hung: see the last panic, then `clear` and `home`",
                _ => "nobody asked for it: look at supply and reset wiring",
            },
        ),
        clock(id.clock),
        brown_out(id.brown_out_level),
        check(
            "panic",
            id.last_panic.is_none(),
            id.last_panic.as_ref().map_or("none".to_owned(), |text| format!("the run before ended with: {text}")),
            "report it with a `record` of what led to it; `clear` and `home` to go on",
        ),
        check(
            "scene",
            id.scene_hash == scene.hash(),
            format!("board {:08x}, --scene {:08x}", id.scene_hash, scene.hash()),
            "name the board's scene with --scene, or `table --board`, or build and flash for this one",
        ),
        check(
            "rig",
            id.rig_hash == scene.rig_hash() && id.demand_hash == scene.demand_hash(),
            format!("built with [rig] {:08x}, --scene has {:08x}", id.rig_hash, scene.rig_hash()),
            "the scene's [rig], [envelope] or [accuracy] is not what this firmware was built with: build and flash",
        ),
        check(
            "table",
            accurate && covers,
            format!(
                "{}, {}: contraction within {:.2} um, TR within {:.3} %, {} to {} N, {} to {} turns",
                t.form,
                if t.rebuilt { "made on the board" } else { "built in" },
                f64::from(t.contraction_error_m) * 1e6,
                f64::from(t.tr_relative_error) * 100.0,
                t.load_min_n,
                t.load_max_n,
                t.turns_min,
                t.turns_max
            ),
            format!(
                "the scene asks for {:.2} um and {:.3} % over {} to {} N and {} turns: build and flash for it",
                accuracy.contraction_m * 1e6,
                accuracy.tr_relative * 100.0,
                envelope.load_n[0],
                envelope.load_n[1],
                turns[1]
            ),
        ),
    ])
}

/// What the board runs on.
fn clock(clock: Clock) -> Check {
    let seen = match clock {
        Clock::Hse => "the ST-LINK's 8 MHz",
        Clock::Hsi => "the chip's own oscillator: the ST-LINK's 8 MHz was missing at the last start",
    };
    let advice =
        "solder bridges SB16 and SB50, power by the ST-LINK's USB socket; then reset. Do not rely on the CAN bit rate";
    check("clock", clock == Clock::Hse, seen, advice)
}

/// The chip's brown-out reset, an option byte.
fn brown_out(level: u8) -> Check {
    let seen = match level {
        0 => "the reset by a dip of the supply is off".to_owned(),
        level => format!("reset by a dip of the supply at level {level} of 3"),
    };
    let advice =
        "below 2.7 V the chip may do anything, and a dip passes for power-on: set level 3 (docs/first-hour.md)";
    check("brown-out", level == 3, seen, advice)
}

fn faults(last: &Telemetry) -> Check {
    let fault = last.fault.map_or("no fault".to_owned(), |_| format!("fault {}", last.faults));
    let advice = match (last.state, last.fault) {
        (State::EStop, _) => "release the emergency stop, then `clear` and `home`".to_owned(),
        (_, Some(fault)) => format!("docs/faults.md, `{fault}`: remove the cause, then `clear`"),
        _ => "the drive does not start: see `drive`".to_owned(),
    };
    let well = last.fault.is_none() && !matches!(last.state, State::EStop | State::Boot);
    check("state", well, format!("{}, {fault}", last.state), advice)
}

fn drive(heard: &[Telemetry], scene: &Scene) -> Check {
    let last = heard.last();
    let gone = Faults::of(&[
        Fault::DriveSilent,
        Fault::CanBusOff,
        Fault::DriveStartUp,
        Fault::DriveReset,
        Fault::DriveStall,
        Fault::NotHeld,
    ]);
    let online = last.is_some_and(|t| t.state != State::Boot && !t.faults.meets(gone));
    let most_a = heard.iter().map(|t| f64::from(t.drive_current_a).abs()).fold(0.0, f64::max);
    let limit_a = f64::from(scene.rig.drive_current_limit_ma()) * 1e-3;
    let seen = format!("{}, at most {most_a:.3} A of {limit_a:.3} A", if online { "online" } else { "not online" });
    let advice = if online {
        "the motor is at its current limit at rest: is the load too heavy, or stuck?"
    } else {
        "power, CAN wiring and termination, group and number of the drive (docs/faults.md)"
    };
    check("drive", online && most_a < limit_a, seen, advice)
}

/// Mean and rms about it.
fn mean_rms(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt())
}

fn lvdt(heard: &[Telemetry], id: &Identity, scene: &Scene, session: &mut Session) -> Result<Check, Failure> {
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
            "wiring, supply and mounting of the LVDT (docs/faults.md)",
        ));
    }
    // Exactly no noise is as wrong as too much.
    let noisy = "a healthy block has a few micrometres: screen, ground and supply of the LVDT; does the load swing?";
    let quiet = |rms: f64| rms > 0.0 && rms < NOISE_M;
    let mechanism = scene.mechanism()?;
    let [low, high] = scene.table_demand()?.0.twist_rad();
    let [least_n, most_n] = [id.table.load_min_n, id.table.load_max_n].map(f64::from);
    let at_rest = |t: &&Telemetry| matches!(t.state, State::Ready | State::Holding);
    // From where the load hangs at the pre-twist, wherever `calibrate zero` has put 0.
    let zero_m = session.known_settings().map_or(0.0, |s| f64::from(s.values.get(Setting::PositionZero)));
    let positions: Vec<f64> =
        heard.iter().filter(at_rest).filter_map(|t| Some(f64::from(t.position_m?) + zero_m)).collect();
    if positions.len() < 20 {
        let Ok(gaps_m) = session.gaps_m() else {
            return Ok(check("LVDT", false, "no valid reading", "wiring and supply of the LVDT (docs/faults.md)"));
        };
        let (mean, rms) = mean_rms(&gaps_m);
        // Untwisted strings end their rods farther apart than the pre-twist leaves them, by less than the allowance.
        let (least, most) = (mechanism.solve(least_n, high)?.gap_m, mechanism.solve(most_n, low)?.gap_m);
        let inside = (least - GAP_OUTSIDE_M..=most + GAP_OUTSIDE_M).contains(&mean);
        let seen = format!(
            "gap {:.3} mm (strings make {:.1} to {:.1} mm), noise {:.1} um rms; its position is judged on a homed rig (--home)",
            mean * 1e3,
            least * 1e3,
            most * 1e3,
            rms * 1e6
        );
        let advice =
            if inside { noisy } else { "measure the gap with callipers, then `calibrate lvdt`; is it the scene's?" };
        return Ok(check("LVDT", inside && quiet(rms), seen, advice));
    }
    let (mean, rms) = mean_rms(&positions);
    // The least load is lifted farthest.
    let travel_m = mechanism.solve(least_n, low)?.gap_m - mechanism.solve(least_n, high)?.gap_m;
    let inside = (-OUTSIDE_M..=travel_m + OUTSIDE_M).contains(&mean);
    let seen = format!("at {:.3} mm of 0 to {:.1} mm, noise {:.1} um rms", mean * 1e3, travel_m * 1e3, rms * 1e6);
    let advice = if inside {
        noisy
    } else {
        "the position is outside the travel: home anew, check the LVDT's mounting and scale"
    };
    Ok(check("LVDT", inside && quiet(rms), seen, advice))
}

/// Turns up and back; the way up by the encoder and by the drive (rad of twist).
fn turn(session: &mut Session, gear: f64) -> Result<[f64; 2], Failure> {
    session.until(0.5, |_| false)?;
    session.take_rows();
    let mut way = [0.0; 2];
    for speed in [TURN.0, -TURN.0] {
        session.request(&Request::Jog { twist_speed_rad_per_s: speed })?;
        session.until(TURN.1, |_| false)?;
        session.request(&Request::Stop)?;
        session.until(5.0, |s| s.telemetry().is_some_and(|t| t.state != State::Moving))?;
        session.until(0.3, |_| false)?;
        let rows = session.take_rows();
        if speed > 0.0 {
            let twist = |r: &crate::session::row::Row| r.twist_rad.map(f64::from);
            let ends = rows.first().and_then(twist).zip(rows.last().and_then(twist));
            way[0] = ends.map_or(0.0, |(from, to)| to - from);
            way[1] =
                rows.windows(2).map(|r| (r[1].t_s - r[0].t_s) * f64::from(r[1].drive_speed_rad_per_s) / gear).sum();
        }
    }
    Ok(way)
}

fn encoder(turned: Option<[f64; 2]>, last: &Telemetry, sensors: &Sensors) -> Check {
    let advice = "coupling, gear ratio and encoder lines of the scene, A and B swapped (docs/faults.md)";
    let bad = [Fault::EncoderStuck, Fault::EncoderJump, Fault::EncoderDisagrees];
    if let Some(fault) = last.fault.filter(|f| bad.contains(f)) {
        return check("encoder", false, fault.name(), advice);
    }
    let Some([own, motor]) = turned else {
        let seen =
            format!("at {:+.3} rad, no fault; compared with the drive while it turns (--home)", sensors.shaft_rad);
        return check("encoder", true, seen, "");
    };
    let seen = format!("turned {own:.3} rad by the encoder, {motor:.3} rad by the drive");
    check("encoder", own > 0.5 && (motor - own).abs() < TURN_SHARE * own, seen, advice)
}

fn supply(last: &Telemetry, scene: &Scene, sensors: &Sensors) -> Check {
    let [least, most] = scene.rig.supply_limits_v();
    let seen = match (scene.rig.supply_divider, sensors.supply_v) {
        (Some(_), Some(volts)) => format!("{volts:.1} V, allowed {least:.1} to {most:.1} V"),
        (Some(_), None) => "not reported yet".to_owned(),
        (None, _) => "not wired by this scene (no supply_divider), so not watched".to_owned(),
    };
    check("supply", last.fault != Some(Fault::Supply), seen, "the drive's supply and its cable, then `clear`")
}

/// Control ticks and link.
fn timing(last: &Telemetry, session: &Session, messages: usize) -> [Check; 2] {
    let c = last.counters;
    let share = f64::from(c.longest_tick_us) / TICK_US as f64;
    let rate_hz = messages as f64 / LISTEN_S;
    let damaged = session.damaged_frames();
    let lost = session.lost_frames();
    [
        check(
            "ticks",
            c.late_ticks == 0 && share < TICK_SHARE,
            format!(
                "{} late; the longest took {} us of {TICK_US} us, margin {:.0} %",
                c.late_ticks,
                c.longest_tick_us,
                (1.0 - share) * 100.0
            ),
            "the core is held up: a debugger halting it, a build without optimisation? Then power-cycle to count anew",
        ),
        check(
            "link",
            rate_hz > 95.0 && c.link_errors == 0 && damaged == 0 && lost == 0 && c.unsent == 0,
            format!(
                "telemetry at {rate_hz:.0} Hz; damaged {} at the board, {damaged} here; {lost} lost, {} unsent; {} foreign \
                 frames on the bus",
                c.link_errors, c.unsent, c.foreign_frames
            ),
            "cable, ground and baud rate of the host link; another program on the port?",
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::{Clock, brown_out, clock};

    #[test]
    fn a_board_on_its_own_clock_or_without_brown_out_reset_is_not_well() {
        assert!(clock(Clock::Hse).ok && brown_out(3).ok);
        for bad in [clock(Clock::Hsi), brown_out(0), brown_out(2)] {
            assert!(!bad.ok && bad.advice.is_some(), "{bad:?}");
        }
        assert!(brown_out(0).seen.contains("off"));
    }
}
