//! `sweep`: the paper's experiment. A known load, the strings turned slowly up and down, everything recorded.

use crate::failure::Failure;
use crate::log::{Ended, Header, Log, Recorder, sweep as reduced};
use crate::options::Global;
use crate::options::values::{self, load};
use crate::out_file::OutFile;
use crate::output::Output;
use crate::session::{Place, STEP_S, Session, Target, Wanted, homing, motion};
use crate::units::{MM, N, Quantity, RAD_PER_S, TURNS, TURNS_OF_RAD, UM};
use clap::Args;
use rig_control::hysteresis::MEMORY_COMPLETE_N;
use rig_control::supervisor::JOG_SPEED_MAX;
use rig_link::LoadChoice;
use rig_plant::{PlantChange, PlantKey};
use serde_json::json;
use std::f64::consts::{PI, TAU};
use std::path::PathBuf;

/// Rest before each turn (s), for the load to stop oscillating.
const REST_S: f64 = 1.0;
/// How long an emulated rig carries the heavier load of `--after`, and how long it then rests before homing (s); how fast a
/// hand takes the load off (N/s), since the board takes a sudden change for a broken string.
const CARRIED_S: f64 = 3.0;
const TAKEN_OFF_N_PER_S: f64 = 2.0;

/// A load and how far to turn.
#[derive(Debug, Clone, Args)]
pub struct Sweep {
    /// Load that hangs on the rail, as weighed (N or kg)
    #[arg(long, value_name = "L", allow_hyphen_values = true, value_parser = load)]
    pub load: f64,
    /// Heavier load that the rods have just carried (N or kg): `identify` compares this sweep with one of the same load without
    /// --after, and finds what the rods remember. On an emulated rig it is hung on first
    #[arg(long, value_name = "L", allow_hyphen_values = true, value_parser = load)]
    pub after: Option<f64>,
    /// Turns past the half-turn pre-twist
    #[arg(long, value_name = "T", default_value = "7.5", allow_hyphen_values = true, value_parser = values::of("turns", Quantity::Turns))]
    pub turns: f64,
    /// Speed of the strings (rad/s, deg/s, rpm)
    #[arg(long, value_name = "W", default_value = "12.5rpm", allow_hyphen_values = true, value_parser = values::of("speed", Quantity::AngularSpeed))]
    pub speed: f64,
    /// File to write
    #[arg(long, value_name = "FILE.csv")]
    pub out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// If a parameter is out of range, the file cannot be written, or the board refuses or stops.
pub fn run(global: &Global, options: &Sweep, output: &mut Output) -> Result<(), Failure> {
    check_speed(options.speed)?;
    let load_n = options.load;
    let mut target = global.target()?;
    let min_n = load_n + f64::from(MEMORY_COMPLETE_N);
    if let Some(after_n) = options.after.filter(|after_n| *after_n < min_n) {
        let [after, min, below] = [after_n, min_n, min_n - load_n].map(|load_n| N.exact(load_n));
        let why = format!("must be at least {min}: the rods' hysteresis shows in full {below} below it");
        return Err(Failure::failed(format!("--after {after}: {why}")));
    }
    // On an emulated rig this load is hung, unless --plant names another.
    let mut takes_off = false;
    if let Place::Emulated(emulated) = &mut target.place
        && !emulated.plant.iter().any(|s| s.key == PlantKey::Load)
    {
        takes_off = options.after.is_some();
        emulated.plant.push(hangs(options.after.unwrap_or(load_n)));
    }
    let out = OutFile::new(&options.out)?;
    let mut session = target.connect(Wanted::OfScene)?;
    of(&mut session, &target, options, out, takes_off, output)
}

fn hangs(load_n: f64) -> PlantChange {
    PlantChange { key: PlantKey::Load, value: load_n }
}

fn check_speed(speed: f64) -> Result<(), Failure> {
    let max = f64::from(JOG_SPEED_MAX);
    if speed > 0.0 && speed <= max {
        return Ok(());
    }
    Err(Failure::failed(format!("--speed {}: must be above 0 and at most {max} rad/s", RAD_PER_S.exact(speed))))
}

/// The same in a session that has begun, with the load on the rail; on an emulated rig `takes_off` the heavier one first.
///
/// # Errors
/// As [`run`].
pub fn of(
    session: &mut Session,
    target: &Target,
    options: &Sweep,
    out: OutFile,
    takes_off: bool,
    output: &mut Output,
) -> Result<(), Failure> {
    check_speed(options.speed)?;
    let (load_n, turns, speed) = (options.load, options.turns, options.speed);
    let table = session.require_identity()?.table.clone();
    for (name, value, unit, [min, max]) in [
        ("--load", load_n, N, [table.load_min_n, table.load_max_n]),
        ("--after", options.after.unwrap_or(load_n), N, [table.load_min_n, table.load_max_n]),
        ("--turns", turns, TURNS, [0.5, table.turns_max]),
    ] {
        if !(f64::from(min)..=f64::from(max)).contains(&value) {
            let limits = format!("must be from {}, what the board's table covers", unit.range([min, max]));
            return Err(Failure::failed(format!("{name} {}: {limits}", unit.exact(value))));
        }
    }
    if let Some(after_n) = options.after.filter(|_| takes_off) {
        session.until(CARRIED_S, |_| false)?;
        let mut hanging_n = after_n;
        while hanging_n > load_n {
            hanging_n = f64::max(hanging_n - TAKEN_OFF_N_PER_S * STEP_S, load_n);
            if let Some(emulated) = session.emulated() {
                emulated.plant(hangs(hanging_n))?;
            }
            session.until(STEP_S, |_| false)?;
        }
        session.until(CARRIED_S, |_| false)?;
    }
    let mut head = Header::new(target, session, "sweep")?;
    head.add("sweep.load_n", load_n);
    if let Some(after_n) = options.after {
        head.add("sweep.after_n", after_n);
    }
    head.add("sweep.turns", turns);
    head.add("sweep.speed_rad_per_s", speed);
    let Ended { rows, lost_rows, lost_frames } = record(session, out, &head, options)?;
    let log = Log::load(&options.out).map_err(|e| Failure::failed(format!("{}: {e}", options.out.display())))?;
    let reduced::Sweep { stops, .. } =
        reduced::reduce(&log).map_err(|e| Failure::failed(format!("{}: {e}", options.out.display())))?;
    let contraction_m = stops.last().map_or(0.0, |s| s.position_m) - stops.first().map_or(0.0, |s| s.position_m);
    let friction_m = stops.iter().map(|s| s.half_difference_m).sum::<f64>() / stops.len() as f64;
    output.object(&json!({
        "file": options.out.display().to_string(),
        "rows": rows,
        "lost_rows": lost_rows,
        "lost_frames": lost_frames,
        "equilibria": stops.len(),
        "load_n": load_n,
        "contraction_m": contraction_m,
        "half_difference_m": friction_m,
    }))?;
    output.line(format!(
        "{rows} rows, {} equilibria over {}: contraction {}, up and down {} either side of it",
        stops.len(),
        TURNS_OF_RAD.show(stops.last().map_or(0.0, |s| s.twist_rad) - stops.first().map_or(0.0, |s| s.twist_rad)),
        MM.show(contraction_m),
        UM.show(friction_m)
    ))?;
    output.line(format!("written: {} (`identify` reads it)", options.out.display()))?;
    Ok(())
}

/// Homes and sweeps; the log of a sweep that has begun gets its end in any case. Returns what the log holds.
fn record(session: &mut Session, out: OutFile, head: &Header, options: &Sweep) -> Result<Ended, Failure> {
    // Before the file: a homing that fails must not take the place of an earlier sweep.
    let passed = session.watch();
    homing::home(session, LoadChoice::Known(options.load as f32), |_| {})?;
    let mut recorder = Recorder::new(out.begin()?, head, passed, session)?;
    let mut sweep = || {
        let (bottom, top) = (PI, PI + TAU * options.turns);
        for ends in [[bottom, top], [top, bottom]] {
            session.until(REST_S, |_| false)?;
            motion::turn(session, ends, options.speed, |session| {
                session.take_rows();
                recorder.take().map(drop)
            })?;
        }
        session.until(REST_S, |_| false).map(drop)
    };
    let result = sweep();
    Ok(recorder.end(session, result)?.0)
}
