//! The board's settings as text: names and values that the operator types, and lines for people.

use crate::lvdt_points;
use crate::output::{Output, decimal};
use crate::session::Session;
use crate::units::{self, Quantity};
use rig_link::{CorrectedConstants, Dropped, Fault, Kept, Setting, SettingValues, SettingsReport};
use serde_json::{Value, json};
use std::io;

/// The setting of this name.
///
/// # Errors
/// Naming all settings.
pub fn named(name: &str) -> Result<Setting, String> {
    Setting::from_name(name).ok_or_else(|| {
        let names: Vec<&str> = Setting::ALL.iter().map(|s| s.name()).collect();
        format!("no setting `{name}`; settings: {}", names.join(", "))
    })
}

/// What `config set` changes, for its help.
pub fn help() -> String {
    let line = |setting: &Setting| format!("  {setting}: {}", quantity(*setting).units());
    let lines: Vec<String> = Setting::ALL.iter().map(line).collect();
    format!("Which; `config get` shows each with its default and range. With their units:\n{}", lines.join("\n"))
}

/// What a setting's value measures.
pub fn quantity(setting: Setting) -> Quantity {
    Quantity::of_unit(setting.spec().unit)
}

/// A value with or without a unit, into the setting's own.
///
/// # Errors
/// Naming the setting and the units.
pub fn value(setting: Setting, text: &str) -> Result<f32, units::UnitError> {
    units::parse(setting.name(), quantity(setting), text).map(|value| value as f32)
}

/// In a file of settings: the value of a setting that is at the scene's default, which may be another one in another scene, and
/// that of points that there are none of.
pub const DEFAULT: &str = "default";
/// As [`DEFAULT`].
pub const NONE: &str = "none";

/// The settings with one of them, or the LVDT's points, as a file of settings or the head of a log has it.
///
/// # Errors
/// Naming a setting that this tool does not know, or a value that is out of range.
pub fn put(values: &SettingValues, defaults: &SettingValues, name: &str, text: &str) -> Result<SettingValues, String> {
    if name == lvdt_points::NAME {
        let lvdt_curve = (text != NONE).then(|| lvdt_points::from_text(text)).transpose()?;
        return Ok(SettingValues { lvdt_curve, ..*values });
    }
    let setting = named(name)?;
    if text == DEFAULT {
        return Ok(values.with(setting, defaults.get(setting)));
    }
    let value = value(setting, text).map_err(|e| e.to_string())?;
    let value = setting.check(value, defaults.get(setting)).map_err(|refusal| refusal.to_string())?;
    Ok(values.with(setting, value))
}

/// The constants that settings correct, each with its name in a file.
pub fn named_constants(constants: &CorrectedConstants) -> [(&'static str, f32); 4] {
    let CorrectedConstants { gear_ratio, counts_per_rad, lvdt_gap_at_code_zero_m, lvdt_metres_per_code } = *constants;
    [
        ("gear_ratio", gear_ratio),
        ("counts_per_rad", counts_per_rad),
        ("lvdt_gap_at_code_zero_m", lvdt_gap_at_code_zero_m),
        ("lvdt_metres_per_code", lvdt_metres_per_code),
    ]
}

/// A setting for machines.
pub fn object(setting: Setting, report: &SettingsReport) -> Value {
    let default = report.defaults.get(setting);
    let [min, max] = setting.range(default);
    json!({
        "name": setting.name(),
        "value": decimal(report.values.get(setting)),
        "unit": setting.spec().unit,
        "default": decimal(default),
        "min": decimal(min),
        "max": decimal(max),
        "kept": is_kept(report, report.dropped.contains(setting)),
        "dropped": report.dropped.contains(setting),
    })
}

/// Whether flash holds the present value of a setting, which was `dropped` or not.
pub fn is_kept(report: &SettingsReport, dropped: bool) -> bool {
    matches!(report.kept, Kept::These | Kept::Partly) && !dropped
}

/// A setting, its default and its range in a line.
pub fn line(setting: Setting, report: &SettingsReport) -> String {
    let (value, default) = (report.values.get(setting), report.defaults.get(setting));
    let [min, max] = setting.range(default);
    let from = if value == default { String::new() } else { format!("default {}, ", setting.show(default)) };
    let mark = if report.dropped.contains(setting) { ", DROPPED" } else { "" };
    let (name, value) = (setting.name(), setting.show(value).to_string());
    format!("{name:14} {value:16} {from}allowed {}{mark}", setting.allowed(min, max))
}

/// Where the values are from.
pub fn origin(report: &SettingsReport) -> String {
    match report.kept {
        Kept::These => "kept in flash".to_owned(),
        Kept::Nothing => "defaults: none are in flash".to_owned(),
        Kept::Others => "about to be written to flash".to_owned(),
        Kept::Damaged => "defaults: those in flash are damaged, or for another rig".to_owned(),
        Kept::Partly => format!(
            "kept in flash, but DROPPED and at their defaults are {}, which flash has for another gear or LVDT than this \
             firmware's, or which are not allowed on its rig",
            dropped(&report.dropped)
        ),
    }
}

/// What to do if settings in flash are not used.
pub fn remedy(kept: Kept) -> Option<&'static str> {
    match kept {
        Kept::These | Kept::Nothing | Kept::Others => None,
        Kept::Damaged => Some("`config restore` or `config set` writes them again"),
        Kept::Partly => Some("calibrate again, or `config set` each that this rig needs, then `clear`"),
    }
}

/// The warning for who connects to a board that does not use all settings in its flash.
pub fn warning(report: &SettingsReport) -> Option<String> {
    remedy(report.kept).map(|_| format!("settings {}", origin_and_remedy(report)))
}

/// Both in one line.
pub fn origin_and_remedy(report: &SettingsReport) -> String {
    let remedy = remedy(report.kept).map_or(String::new(), |remedy| format!(": {remedy}"));
    format!("{}{remedy}", origin(report))
}

/// The names of settings that were dropped.
pub fn dropped(dropped: &Dropped) -> String {
    dropped.names().collect::<Vec<_>>().join(", ")
}

/// All settings as one object.
pub fn all(values: &SettingValues) -> Value {
    let numbers = values.iter().map(|(setting, value)| (setting.name().to_string(), json!(decimal(value))));
    let curve = values.lvdt_curve.iter().map(|curve| (lvdt_points::NAME.to_string(), lvdt_points::object(curve)));
    numbers.chain(curve).collect()
}

/// Lines of `status`: where the values are from, and every setting that is not its default.
pub fn summary(report: &SettingsReport) -> Vec<String> {
    let mut lines = vec![format!("settings {}", origin_and_remedy(report))];
    for (setting, value) in report.values.iter().filter(|(s, value)| *value != report.defaults.get(*s)) {
        let default = setting.show(report.defaults.get(setting));
        lines.push(format!("         {setting} {} (default {default})", setting.show(value)));
    }
    let curve = report.values.lvdt_curve.iter();
    lines.extend(curve.map(|curve| format!("         {}: {}", lvdt_points::NAME, lvdt_points::words(curve))));
    lines
}

/// Prints what the operator has to do after a change. `lasts`: the board has flash that outlives this call of the tool.
///
/// # Errors
/// If the output fails.
pub fn next_steps(session: &Session, lasts: bool, unhomed: bool, output: &mut Output) -> io::Result<()> {
    let corrupt = session.telemetry().is_some_and(|t| t.fault == Some(Fault::SettingsCorrupt));
    [
        (!lasts, "nothing of this lasts: without --flash FILE each call has a new emulated board"),
        (unhomed, "the position is not known any more: `rigctl home` before the next move"),
        (corrupt, "fault settings-corrupt is still latched: check the settings, then `rigctl clear`"),
    ]
    .iter()
    .filter(|(holds, _)| *holds)
    .try_for_each(|(_, line)| output.line(line))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_is_read_in_its_own_unit() {
        for setting in Setting::ALL {
            let unit = setting.spec().unit;
            assert_eq!(value(*setting, &format!("0.25{unit}")), Ok(0.25), "{setting}");
            assert_eq!(quantity(*setting) == Quantity::Number, unit.is_empty(), "{setting}");
        }
        assert_eq!(value(Setting::HeaviestLoad, "1kg"), Ok(9.80665));
    }
}
