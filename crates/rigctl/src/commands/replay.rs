//! `replay`: a recorded log through the controller on the desktop.

use crate::failure::Failure;
use crate::log::Log;
use crate::options::Global;
use crate::output::Output;
use crate::replay::replay;
use crate::units::{MS, N, NUMBER, RAD_PER_S, S, UM};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;

/// The log to replay.
#[derive(Debug, Clone, Args)]
pub struct Replay {
    /// Log of `record` or `sweep`, recorded with --scene
    #[arg(value_name = "FILE.csv")]
    pub file: PathBuf,
    /// Also if the log was cut short
    #[arg(long)]
    pub partial: bool,
}

/// Runs the command.
///
/// # Errors
/// If the file is not a complete log, is of another scene, or has nothing to replay.
pub fn run(global: &Global, options: &Replay, output: &mut Output) -> Result<(), Failure> {
    let name = options.file.display();
    let wrong = |what: String| Failure::failed(format!("log {name}: {what}"));
    let log = Log::load(&options.file).map_err(wrong)?;
    let log = if options.partial {
        log
    } else {
        log.whole().map_err(|e| wrong(format!("{e}; --partial replays the rest")))?
    };
    let scene = global.scene()?;
    let hash = format!("{:08x}", scene.hash());
    match log.header.get("scene_hash") {
        Some(recorded) if recorded == hash => {}
        Some(recorded) => {
            return Err(wrong(format!(
                "was recorded with scene {} ({recorded}), not {} ({hash}): name its scene with --scene",
                log.header.get("scene").unwrap_or("?"),
                global.scene.display()
            )));
        }
        None => return Err(wrong("its head has no scene_hash".into())),
    }
    let fit = scene.fit_table()?;
    let table = fit.table.table();
    let crc = format!("{:08x}", table.checksum());
    let same_table = log.header.get("table.crc").map(|logged| *logged == crc);
    match same_table {
        Some(true) => {}
        Some(false) => crate::output::say!(
            "note: the board's table was another one for the same scene; small differences are the tables'"
        ),
        None => crate::output::say!("note: the log does not tell which table the board had"),
    }
    let stretches = replay(&log, &scene, &table).map_err(wrong)?;
    output.object(&json!({"file": name.to_string(), "same_table": same_table, "stretches": stretches}))?;
    for s in &stretches {
        output.line(format!(
            "{} to {}: {} ticks ({} of them filled in), ended by {}",
            S.show(s.from_s),
            S.show(s.to_s),
            s.ticks,
            s.filled,
            s.ended_by
        ))?;
        output.line(format!("  found from the log: drive {} behind", MS.exact(s.drive_lag_s)))?;
        for (what, d, unit) in [
            ("load estimate", s.load_n, N),
            ("its error", s.load_error_n, N),
            ("position error", s.position_error_m, UM),
            ("set-point", s.setpoint_m, UM),
            ("twist speed", s.twist_speed_rad_per_s, RAD_PER_S),
        ] {
            let (largest, rms) = (unit.show(d.largest), unit.show(d.rms));
            output.line(format!("  {what:<14} differs by {largest} at most, {rms} rms"))?;
        }
        output.line(match &s.parted {
            None => "  no divergence".to_owned(),
            Some(p) => {
                let both = p.values.map_or(String::new(), |[a, b]| {
                    format!(": recorded {}, replayed {}", NUMBER.show(a), NUMBER.show(b))
                });
                format!("  divergence from {} by {}{both}", S.show(p.t_s), p.what)
            }
        })?;
    }
    Ok(())
}
