//! `config`: the board's settings, one by one or all in a file.

use crate::backup::{self, to_toml};
use crate::board_settings::{self, all};
use crate::failure::Failure;
use crate::lvdt_points;
use crate::options::Global;
use crate::out_file::OutFile;
use crate::output::Output;
use crate::output::decimal;
use crate::session::{Session, Wanted};
use clap::Subcommand;
use rig_link::{Kept, Request, Setting};
use serde_json::json;
use std::path::{Path, PathBuf};

/// The value of `twist-scale` that stands for the scale that the board has learned.
const LEARNED: &str = "learned";

/// Print, change, back up and restore the board's settings
#[derive(Debug, Clone, Subcommand)]
pub enum Config {
    /// Show all settings, or one, with default and range
    Get {
        /// Which; all if none is named
        #[arg(value_name = "NAME", value_parser = board_settings::named)]
        name: Option<Setting>,
    },
    /// Change one setting and keep it
    Set {
        /// Which
        #[arg(value_name = "NAME", value_parser = board_settings::named, long_help = board_settings::help())]
        name: Setting,
        /// Its value, with or without a unit; `learned` for twist-scale takes the scale that the board has learned
        #[arg(value_name = "VALUE", allow_hyphen_values = true)]
        value: String,
    },
    /// Write all settings to a file
    Backup {
        /// File to write
        #[arg(value_name = "FILE.toml")]
        file: PathBuf,
    },
    /// Set all settings from a file, or none if anything in it is wrong. Those that correct other constants than this
    /// rig's stay as they are, and the exit code is then 1
    Restore {
        /// File to read: a backup, or a log of `record` or `sweep`, whose header holds the settings, too
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// Also those that correct other constants of the rig
        #[arg(long)]
        force: bool,
    },
}

/// Runs the command.
///
/// # Errors
/// The board's refusal in words, or what is wrong with the value or the file.
pub fn run(global: &Global, what: &Config, output: &mut Output) -> Result<(), Failure> {
    // Before a board is asked: a value that the setting cannot have, or a file that cannot be read.
    match what {
        Config::Set { name, value } => drop(typed(*name, value)?),
        Config::Restore { file, .. } => readable(file)?,
        Config::Get { .. } | Config::Backup { .. } => {}
    }
    let changes = matches!(what, Config::Set { .. } | Config::Restore { .. });
    let mut session = global.target()?.connect(if changes { Wanted::OfScene } else { Wanted::Any })?;
    if changes {
        session.wait_started()?;
    }
    of(&mut session, what, global.flash_lasts(), output)
}

/// The same in a session that has begun; `lasts`: the board's flash outlives it.
///
/// # Errors
/// As [`run`].
pub fn of(session: &mut Session, what: &Config, lasts: bool, output: &mut Output) -> Result<(), Failure> {
    match what {
        Config::Get { name } => get(session, *name, output),
        Config::Set { name, value } => set(session, *name, value, lasts, output),
        Config::Backup { file } => backup(session, file, output),
        Config::Restore { file, force } => restore(session, file, *force, lasts, output),
    }
}

fn get(session: &mut Session, name: Option<Setting>, output: &mut Output) -> Result<(), Failure> {
    let report = session.settings()?;
    for setting in Setting::ALL.iter().filter(|setting| name.is_none_or(|name| name == **setting)) {
        output.object(&board_settings::object(*setting, &report))?;
        output.line(board_settings::line(*setting, &report))?;
    }
    if let (None, Some(curve)) = (name, &report.values.lvdt_curve) {
        let kept = board_settings::is_kept(&report, false);
        output.object(&json!({"name": lvdt_points::NAME, "value": lvdt_points::object(curve), "kept": kept}))?;
        output.line(format!("{:14} {}", lvdt_points::NAME, lvdt_points::words(curve)))?;
    }
    output.line(board_settings::origin_and_remedy(&report))?;
    Ok(())
}

/// The value that is set; `None` is the learned one.
fn typed(setting: Setting, text: &str) -> Result<Option<f32>, Failure> {
    let learned = setting == Setting::TwistScale && text == LEARNED;
    let typed = if learned { None } else { Some(board_settings::value(setting, text)) };
    typed.transpose().map_err(|e| Failure::Usage(e.to_string()))
}

fn set(session: &mut Session, setting: Setting, text: &str, lasts: bool, output: &mut Output) -> Result<(), Failure> {
    let before = session.settings()?.values.get(setting);
    let value = match typed(setting, text)? {
        Some(value) => value,
        None => session
            .telemetry()
            .and_then(|t| t.twist_scale)
            .ok_or_else(|| Failure::failed("twist-scale: nothing is learned before the rig is homed and has moved"))?,
    };
    let unhomed = session.set(&Request::SetSetting { setting, value })?;
    output.object(&json!({"name": setting.name(), "value": decimal(value), "unit": setting.spec().unit,
        "before": decimal(before),
        "kept": true, "unhomed": unhomed}))?;
    output.line(format!("{setting}: {} -> {}, kept in flash", setting.show(before), setting.show(value)))?;
    Ok(board_settings::next_steps(session, lasts, unhomed, output)?)
}

fn backup(session: &mut Session, file: &Path, output: &mut Output) -> Result<(), Failure> {
    let report = session.settings()?;
    if report.kept == Kept::Damaged {
        return Err(Failure::failed("the settings in flash are damaged: nothing to back up but defaults"));
    }
    let text = to_toml(&report, session.require_identity()?);
    OutFile::new(file)?.write(&text)?;
    output.object(&json!({"file": file.display().to_string(), "settings": all(&report.values)}))?;
    output.line(format!("{} settings written to {}", Setting::ALL.len(), file.display()))?;
    Ok(())
}

fn readable(file: &Path) -> Result<(), Failure> {
    rig_config::files::check_regular(file).map_err(|e| Failure::failed(format!("{}: {e}", file.display())))
}

fn restore(session: &mut Session, file: &Path, force: bool, lasts: bool, output: &mut Output) -> Result<(), Failure> {
    readable(file)?;
    let report = session.settings()?;
    let rig_hash = session.identity().map_or(0, |id| id.rig_hash);
    let (values, dropped) = backup::load(file, &report.defaults)?.for_board(rig_hash, &report, file, force)?;
    let unhomed = session.set(&Request::SetSettings(values))?;
    let changed = report.values.iter().filter(|(s, value)| *value != values.get(*s)).count()
        + usize::from(report.values.lvdt_curve != values.lvdt_curve);
    output.object(
        &json!({"file": file.display().to_string(), "settings": all(&values), "before": all(&report.values), "changed": changed, "kept": true,
        "unhomed": unhomed, "dropped": dropped.names().collect::<Vec<_>>()}),
    )?;
    let count = Setting::ALL.len() - Setting::ALL.iter().filter(|setting| dropped.contains(**setting)).count();
    output.line(format!("{count} settings restored, {changed} of them changed; kept in flash"))?;
    for (setting, before) in report.values.iter().filter(|(setting, before)| *before != values.get(*setting)) {
        let after = setting.show(values.get(setting));
        output.line(format!("{setting}: {} -> {after}", setting.show(before)))?;
    }
    if report.values.lvdt_curve != values.lvdt_curve {
        let words = |curve: &Option<_>| curve.as_ref().map_or("none".to_owned(), lvdt_points::words);
        let (before, after) = (words(&report.values.lvdt_curve), words(&values.lvdt_curve));
        output.line(format!("{}: {before} -> {after}", lvdt_points::NAME))?;
    }
    board_settings::next_steps(session, lasts, unhomed, output)?;
    // After the rest has been restored: a script must not go on with a calibration that is missing.
    backup::require_all(&dropped, file)
}
