//! `replay`: a recorded log through the controller on the desktop.

use crate::failure::Failure;
use crate::log::Log;
use crate::options::Global;
use crate::output::Output;
use crate::replay::replay;
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
    let same_table = log.header.get("table.crc") == Some(&crc);
    if !same_table {
        eprintln!("note: the board's table was another one for the same scene; small differences are the tables'");
    }
    let stretches = replay(&log, &scene, &table).map_err(wrong)?;
    output.object(&json!({"file": name.to_string(), "same_table": same_table, "stretches": stretches}))?;
    for s in &stretches {
        output.line(format!(
            "{:.2} to {:.2} s: {} ticks ({} of them filled in), ended by {}",
            s.from_s, s.to_s, s.ticks, s.filled, s.ended_by
        ))?;
        output.line(format!("  found from the log: drive {:.0} ms behind", s.drive_lag_s * 1e3))?;
        for (what, d, factor, unit) in [
            ("load estimate", s.load_n, 1.0, "N"),
            ("its error", s.load_error_n, 1.0, "N"),
            ("position error", s.position_error_m, 1e6, "um"),
            ("set-point", s.setpoint_m, 1e6, "um"),
            ("twist speed", s.twist_speed_rad_per_s, 1.0, "rad/s"),
        ] {
            let (largest, rms) = (d.largest * factor, d.rms * factor);
            output.line(format!("  {what:<14} differs by {largest:.4} {unit} at most, {rms:.4} {unit} rms"))?;
        }
        output.line(match &s.parted {
            None => "  they never part".to_owned(),
            Some(p) => {
                let both = p.values.map_or(String::new(), |[a, b]| format!(": recorded {a:.6}, replayed {b:.6}"));
                format!("  they part at {:.2} s by {}{both}", p.t_s, p.what)
            }
        })?;
    }
    Ok(())
}
