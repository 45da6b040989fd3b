//! `status` and `sensors`: the board's identity, state and readings, homed or not.

use super::motion::any_board;
use crate::board_settings;
use crate::diagnosis;
use crate::failure::Failure;
use crate::lvdt_points::GAP_M;
use crate::options::Global;
use crate::options::values;
use crate::output::{Output, at, decimal};
use crate::session::{Session, Target};
use crate::units::{HZ, MM, Quantity, RAD, S, UM, Unit, V};
use clap::Args;
use serde_json::{Value, json};

/// How long `status` listens to the telemetry (s).
const LISTEN_S: f64 = 1.0;
/// Time between two readings of `sensors` (s).
const READING_S: f64 = 0.2;

/// `status`: the board's identity, state and readings.
///
/// # Errors
/// If nobody answers; or, after everything is printed, if the board's scene is another.
pub fn run(global: &Global, output: &mut Output) -> Result<(), Failure> {
    let target = global.target()?;
    let mut session = any_board(&target)?;
    of(&mut session, &target, output)?;
    target.check_scene(&session)
}

/// The same in a session that has begun.
///
/// # Errors
/// If nobody answers.
pub fn of(session: &mut Session, target: &Target, output: &mut Output) -> Result<(), Failure> {
    session.take_rows();
    session.until(LISTEN_S, |_| false)?;
    let mut rows = session.take_rows();
    let telemetry_hz = rows.len() as f64 / LISTEN_S;
    let row = rows.pop().ok_or_else(|| Failure::failed("no telemetry from the board"))?;
    let id = session.require_identity()?.clone();
    let (settings, sensors) = (session.settings()?, session.sensors()?);
    let counters = sensors.counters;
    let faults = session.telemetry().map(|t| t.faults).unwrap_or_default();
    let (lost, damaged) = (session.link.lost_frames(), session.link.damaged_frames());
    output.object(&json!({
        "rig": target.rig(),
        "firmware": id.version.as_str(),
        "git": id.git.as_str(),
        "scene_hash": format!("{:08x}", id.scene_hash),
        "scene_matches": target.check_scene(session).is_ok(),
        "protocol_hash": format!("{:08x}", id.protocol_hash),
        "reset_cause": id.reset_cause.name(),
        "boot_count": id.boot_count,
        "clock": id.clock.name(),
        "brown_out_level": id.brown_out_level,
        "table": {
            "form": id.table.form.as_str(),
            "bytes": id.table.bytes,
            "contraction_error_m": id.table.contraction_error_m,
            "tr_relative_error": id.table.tr_relative_error,
            "load_n": [id.table.load_min_n, id.table.load_max_n],
            "turns": [id.table.turns_min, id.table.turns_max],
            "crc": format!("{:08x}", id.table.crc),
            "sent": id.table.sent,
        },
        "settings": board_settings::all(&settings.values),
        "settings_kept": settings.kept.name(),
        "settings_dropped": settings.dropped.names().collect::<Vec<_>>(),
        "last_panic": id.last_panic.as_deref(),
        "faults": faults.iter().map(|f| f.name()).collect::<Vec<_>>(),
        "link_errors": counters.link_errors,
        "foreign_frames": counters.foreign_frames,
        "late_ticks": counters.late_ticks,
        "longest_tick_s": f64::from(counters.longest_tick_us) * 1e-6,
        "telemetry_hz": telemetry_hz,
        "lost_frames": lost,
        "unsent": counters.unsent,
        "sensors": reading(&sensors),
        "telemetry": row,
    }))?;
    if let Some(options) = target.emulated() {
        output.line(format!("rig      {options}"))?;
    }
    output.line(format!(
        "firmware {} ({}), protocol {:08x}, scene {:08x}, last started by {}",
        id.version, id.git, id.protocol_hash, id.scene_hash, id.reset_cause
    ))?;
    output.line(format!("table    {}", diagnosis::board::table(&id.table)))?;
    output.line(format!(
        "link     {} damaged frames at the board, {} here; {} foreign frames on the bus",
        counters.link_errors, damaged, counters.foreign_frames
    ))?;
    output.line(format!(
        "         telemetry at {}; {lost} frames lost on the way, {} never sent",
        HZ.exact(telemetry_hz),
        counters.unsent
    ))?;
    output.line(format!("tick     {} late, the longest took {} µs", counters.late_ticks, counters.longest_tick_us))?;
    output.line(format!("sensors  {}", words(&sensors)))?;
    if let Some(tolerance_m) = sensors.rest_tolerance_m {
        output.line(format!("at rest  an error below {} is within the dead band", UM.error(tolerance_m)))?;
    }
    board_settings::summary(&settings).iter().try_for_each(|line| output.line(line))?;
    if let Some(text) = &id.last_panic {
        output.line(format!("         the run before ended with: {text}"))?;
    }
    output.line(row.text())?;
    for fault in faults.iter() {
        output.line(format!("fault    {fault}: docs/reference/faults.md, `{fault}`"))?;
    }
    Ok(())
}

/// Print the raw readings, homed or not: gap, encoder, drive, supply, contacts
#[derive(Debug, Args)]
pub struct Sensors {
    /// One reading every 0.2 s for this time [default: one reading]
    #[arg(long, value_name = "S", default_value = "0s", hide_default_value = true, allow_hyphen_values = true,
        value_parser = values::of("seconds", Quantity::Time))]
    seconds: f64,
}

impl Sensors {
    /// Runs the command, whatever the board's scene.
    ///
    /// # Errors
    /// If nobody answers.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        if !(0.0..=86_400.0).contains(&self.seconds) {
            return Err(Failure::Usage(format!("--seconds {}: must be from 0 to 86400 s", S.exact(self.seconds))));
        }
        let mut session = any_board(&global.target()?)?;
        let end_s = session.now_s() + self.seconds;
        loop {
            let t_s = session.now_s();
            let sensors = session.sensors()?;
            let mut object = reading(&sensors);
            object["t_s"] = json!(t_s);
            output.object(&object)?;
            output.line(format!("{}  {}", at(t_s), words(&sensors)))?;
            output.flush()?;
            if session.now_s() + READING_S > end_s {
                return Ok(());
            }
            session.until(READING_S - (session.now_s() - t_s), |_| false)?;
        }
    }
}

fn reading(s: &rig_link::Sensors) -> Value {
    json!({
        "gap_m": s.gap_m.map(decimal),
        "shaft_rad": decimal(s.shaft_rad),
        "drive_rad": s.drive_rad.map(decimal),
        "supply_v": s.supply_v.map(decimal),
        "estop_open": s.estop_open,
        "upper_limit_open": s.upper_limit_open,
        "lower_limit_open": s.lower_limit_open,
        "rest_tolerance_m": s.rest_tolerance_m.map(decimal),
    })
}

fn words(s: &rig_link::Sensors) -> String {
    let read = |value: Option<f32>, unit: Unit| value.map_or("not read".to_owned(), |v| unit.show(v));
    let contact = |open: bool| if open { "OPEN" } else { "closed" };
    format!(
        "gap {}, strings turned {} by the encoder, {} by the drive, supply {}; emergency stop {}, upper limit {}, \
         lower limit {}",
        s.gap_m.map_or("not read".to_owned(), |m| MM.rounded(m, GAP_M)),
        RAD.show(s.shaft_rad),
        read(s.drive_rad, RAD),
        read(s.supply_v, V),
        contact(s.estop_open),
        contact(s.upper_limit_open),
        contact(s.lower_limit_open),
    )
}
