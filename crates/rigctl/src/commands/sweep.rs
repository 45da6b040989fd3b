//! `sweep`: the paper's experiment. A known load, the strings turned slowly up and down, everything recorded.

use super::operate::{connect, home_session, is_sim, not_broken_off};
use super::record::header;
use crate::cli::{Global, Sweep};
use crate::failure::Failure;
use crate::log::{Header, Log, Recorder, sweep as reduced};
use crate::output::{OutFile, Output, progress};
use crate::session::Session;
use rig_control::supervisor::JOG_SPEED_MAX;
use rig_link::{Request, State};
use serde_json::json;
use sim_link::{PlantChange, PlantKey};
use std::f64::consts::{PI, TAU};
use std::io::Write;

/// Rest before each way (s), for the load to stop swinging.
const REST_S: f64 = 1.0;
/// How long before the end of a way the motor is told to stop (s): what the link and the ramp take.
const AHEAD_S: f64 = 0.05;
/// Longest that a way may take beyond its length at its speed (s).
const SLACK_S: f64 = 10.0;

/// Runs the command.
///
/// # Errors
/// If a parameter is out of range, the file cannot be written, or the board refuses or stops.
pub fn run(global: &Global, options: &Sweep, output: &mut Output) -> Result<(), Failure> {
    let (load_n, turns, speed) = (options.load, options.turns, options.speed);
    let most = f64::from(JOG_SPEED_MAX);
    if !(speed > 0.0 && speed <= most) {
        return Err(Failure::failed(format!("--speed {speed} rad/s: must be above 0 and at most {most} rad/s")));
    }
    // An emulated rig hangs the load itself, unless it is told of another.
    let mut global = global.clone();
    if is_sim(&global) && !global.plant.iter().any(|s| s.key == PlantKey::Load) {
        global.plant.push(PlantChange { key: PlantKey::Load, value: load_n });
    }
    let out = OutFile::new(&options.out)?;
    let mut session = connect(&global)?;
    let table = session.identity().map(|id| id.table.clone()).ok_or_else(|| Failure::failed("the board is silent"))?;
    for (name, value, unit, [least, most]) in [
        ("--load", load_n, "N", [table.load_min_n, table.load_max_n]),
        ("--turns", turns, "turns", [0.5, table.turns_max]),
    ] {
        if !(f64::from(least)..=f64::from(most)).contains(&value) {
            let limits = format!("must be from {least} to {most} {unit}, what the board's table covers");
            return Err(Failure::failed(format!("{name} {value} {unit}: {limits}")));
        }
    }
    let mut head = header(&global, &session, "sweep")?;
    head.add("sweep.load_n", load_n);
    head.add("sweep.turns", turns);
    head.add("sweep.speed_rad_per_s", speed);
    let rows = record(&mut session, out.begin()?, &head, turns, speed)?;
    let log = Log::load(&options.out).map_err(|e| Failure::failed(format!("{}: {e}", options.out.display())))?;
    let (_, stops) = reduced::stops(&log).map_err(|e| Failure::failed(format!("{}: {e}", options.out.display())))?;
    let contraction_m = stops.last().map_or(0.0, |s| s.position_m) - stops.first().map_or(0.0, |s| s.position_m);
    let friction_m = stops.iter().map(|s| s.half_difference_m).sum::<f64>() / stops.len() as f64;
    output.object(&json!({
        "file": options.out.display().to_string(),
        "rows": rows,
        "lost_frames": session.lost_frames(),
        "equilibria": stops.len(),
        "load_n": load_n,
        "contraction_m": contraction_m,
        "half_difference_m": friction_m,
    }))?;
    output.line(format!(
        "{rows} rows, {} equilibria over {:.2} turns: contraction {:.3} mm, up and down {:.1} um either side of it",
        stops.len(),
        stops.last().map_or(0.0, |s| s.twist_rad / TAU) - stops.first().map_or(0.0, |s| s.twist_rad / TAU),
        contraction_m * 1e3,
        friction_m * 1e6
    ))?;
    output.line(format!("written: {} (`identify` reads it)", options.out.display()))?;
    Ok(())
}

/// Homes and sweeps; the log is ended whatever happens.
fn record(session: &mut Session, sink: Box<dyn Write>, head: &Header, turns: f64, speed: f64) -> Result<u64, Failure> {
    let mut recorder = Recorder::new(sink, head)?;
    session.keep_journal();
    let mut go = || {
        home_session(session, |_| {})?;
        recorder.take(session)?;
        let (bottom, top) = (PI, PI + TAU * turns);
        for (from, to) in [(bottom, top), (top, bottom)] {
            session.until(REST_S, |_| false)?;
            way(session, &mut recorder, from, to, speed)?;
        }
        session.until(REST_S, |_| false).map(drop)
    };
    let result = go();
    recorder.end(session, result)
}

/// Turns from one twist to another (rad).
fn way(
    session: &mut Session,
    recorder: &mut Recorder<Box<dyn Write>>,
    from: f64,
    to: f64,
    speed: f64,
) -> Result<(), Failure> {
    let sign = (to - from).signum();
    session.take_events();
    session.request(&Request::Jog { twist_speed_rad_per_s: (sign * speed) as f32 })?;
    let end_s = session.now_s() + (to - from).abs() / speed + SLACK_S;
    let bar = progress(1000, if sign > 0.0 { "turning up" } else { "turning back" });
    let mut stopping = false;
    while session.now_s() < end_s {
        session.step()?;
        recorder.take(session)?;
        session.take_rows();
        let twist = session.telemetry().and_then(|t| t.twist_rad).map_or(from, f64::from);
        bar.set_position((1000.0 * ((twist - from) / (to - from)).clamp(0.0, 1.0)) as u64);
        bar.set_message(format!("{:.2} turns", (twist - PI) / TAU));
        if !stopping && sign * (to - twist) < speed * AHEAD_S {
            session.request(&Request::Stop)?;
            stopping = true;
        }
        for (_, kind) in session.take_events() {
            not_broken_off(&kind, "in the sweep")?;
        }
        if stopping && session.telemetry().is_some_and(|t| t.state != State::Moving) {
            bar.finish_and_clear();
            return Ok(());
        }
    }
    Err(Failure::failed(format!("the sweep did not reach {:.2} turns", (to - PI) / TAU)))
}
