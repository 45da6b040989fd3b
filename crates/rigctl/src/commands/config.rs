//! `config`: the board's settings, one by one or all in a file.

use super::operate::{connect, is_sim, meet};
use crate::cli::{Config, Global};
use crate::failure::Failure;
use crate::output::{OutFile, Output};
use crate::session::Session;
use crate::settings::{self, decimal, to_toml};
use rig_link::{Fault, Kept, Request, Setting, SettingValues, SettingsReport};
use serde_json::{Value, json};
use std::path::Path;

/// Value that stands for what the board has learned of its strings.
const LEARNED: &str = "learned";

/// The command.
///
/// # Errors
/// The board's refusal in words, or what is wrong with the value or the file.
pub fn run(global: &Global, what: &Config, output: &mut Output) -> Result<(), Failure> {
    match what {
        Config::Get { name } => get(&mut meet(global)?, *name, output),
        Config::Set { name, value } => set(global, *name, value, output),
        Config::Backup { file } => backup(&mut meet(global)?, file, output),
        Config::Restore { file, force } => restore(global, file, *force, output),
    }
}

fn object(setting: Setting, report: &SettingsReport) -> Value {
    let default = report.defaults.get(setting);
    let [min, max] = setting.range(default);
    json!({
        "name": setting.name(),
        "value": decimal(report.values.get(setting)),
        "unit": setting.spec().unit,
        "default": decimal(default),
        "min": decimal(min),
        "max": decimal(max),
        "kept": report.kept == Kept::These,
    })
}

/// A setting, its default and its range in a line.
fn line(setting: Setting, report: &SettingsReport) -> String {
    let (value, default) = (report.values.get(setting), report.defaults.get(setting));
    let [min, max] = setting.range(default);
    let from = if value == default { String::new() } else { format!("default {}, ", setting.show(default)) };
    format!("{:14} {:16} {from}allowed {}", setting.name(), setting.show(value).to_string(), setting.allowed(min, max))
}

/// What to do where flash holds something else than these values.
fn of_flash(kept: Kept) -> &'static str {
    match kept {
        Kept::These => "kept in flash",
        Kept::Nothing => "defaults: none are in flash",
        Kept::Others => "about to be written to flash",
        Kept::Damaged => {
            "defaults: those in flash are damaged, or for another rig. `config restore` or `config set` makes them anew"
        }
    }
}

fn get(session: &mut Session, name: Option<Setting>, output: &mut Output) -> Result<(), Failure> {
    let report = session.settings()?;
    for setting in Setting::ALL.iter().filter(|setting| name.is_none_or(|name| name == **setting)) {
        output.object(&object(*setting, &report))?;
        output.line(line(*setting, &report))?;
    }
    output.line(of_flash(report.kept))?;
    Ok(())
}

/// Lines of `status`: what is not as by default, and whether it is kept.
pub fn status(report: &SettingsReport, output: &mut Output) -> Result<(), Failure> {
    output.line(format!("settings {}", of_flash(report.kept)))?;
    for (setting, value) in report.values.iter().filter(|(s, value)| *value != report.defaults.get(*s)) {
        let default = setting.show(report.defaults.get(setting));
        output.line(format!("         {setting} {} (default {default})", setting.show(value)))?;
    }
    Ok(())
}

/// All of them as one object.
pub fn all(values: &SettingValues) -> Value {
    values.iter().map(|(setting, value)| (setting.name().to_string(), json!(decimal(value)))).collect()
}

fn set(global: &Global, setting: Setting, text: &str, output: &mut Output) -> Result<(), Failure> {
    let learned = setting == Setting::TwistScale && text == LEARNED;
    // Before a board is asked: what is no such value is wrong usage.
    let typed = if learned { None } else { Some(settings::value(setting, text)) };
    let typed = typed.transpose().map_err(|e| Failure::Usage(e.to_string()))?;
    let mut session = connect(global)?;
    session.wait_started()?;
    let before = session.settings()?.values.get(setting);
    let value = match typed {
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
    hints(global, &session, unhomed, output)
}

/// What the operator has to do next.
pub fn hints(global: &Global, session: &Session, unhomed: bool, output: &mut Output) -> Result<(), Failure> {
    if is_sim(global) && global.flash.is_none() {
        output.line("nothing of this lasts: without --flash FILE each call has a new emulated board")?;
    }
    if unhomed {
        output.line("the position is not known any more: `rigctl home` before the next move")?;
    }
    if session.telemetry().is_some_and(|t| t.fault == Some(Fault::SettingsCorrupt)) {
        output.line("fault settings-corrupt is still latched: check the settings, then `rigctl clear`")?;
    }
    Ok(())
}

fn backup(session: &mut Session, file: &Path, output: &mut Output) -> Result<(), Failure> {
    let report = session.settings()?;
    if report.kept == Kept::Damaged {
        return Err(Failure::failed("the settings in flash are damaged: nothing to back up but defaults"));
    }
    let identity = session.identity().ok_or_else(|| Failure::failed("the board did not say who it is"))?;
    let text = to_toml(&report, identity);
    OutFile::new(file)?.write(&text)?;
    output.object(&json!({"file": file, "settings": all(&report.values)}))?;
    output.line(format!("{} settings written to {}", Setting::ALL.len(), file.display()))?;
    Ok(())
}

fn restore(global: &Global, file: &Path, force: bool, output: &mut Output) -> Result<(), Failure> {
    // What cannot be read is known before a board is asked.
    rig_scene::files::check_regular(file).map_err(|e| Failure::failed(format!("{}: {e}", file.display())))?;
    let mut session = connect(global)?;
    session.wait_started()?;
    let report = session.settings()?;
    let rig_hash = session.identity().map_or(0, |id| id.rig_hash);
    let backup = settings::load(file, &report.defaults)?.of_rig(rig_hash, file, force)?;
    let unhomed = session.set(&Request::SetSettings(backup.values))?;
    let changed = report.values.iter().filter(|(s, value)| *value != backup.values.get(*s)).count();
    output.object(&json!({"file": file, "settings": all(&backup.values), "changed": changed, "kept": true,
        "unhomed": unhomed}))?;
    output.line(format!("{} settings restored, {changed} of them changed; kept in flash", Setting::ALL.len()))?;
    hints(global, &session, unhomed, output)
}
