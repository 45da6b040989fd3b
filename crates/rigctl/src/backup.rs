//! The file of a settings backup.

use crate::board_settings::{self, DEFAULT, NONE};
use crate::failure::Failure;
use crate::log::{FORMAT, Log};
use crate::lvdt_points;
use rig_link::{CorrectedConstants, Dropped, Identity, PROTOCOL_HASH, Setting, SettingValues, SettingsReport};
use serde::{Deserialize, Deserializer, de};
use std::fmt::Write;
use std::path::Path;
use toml::{Table, Value};

/// The text of a backup: the board's identity and the constants that settings correct, then every setting in SI units, and
/// the LVDT's points. It has a line for each, so that one that was cut short is known.
pub fn to_toml(report: &SettingsReport, identity: &Identity) -> String {
    let mut text = format!(
        "# Settings of a board, written by `rigctl config backup`. SI units; text with a unit, as \"1.2mm\", is read too.\n\
         [board]\nfirmware = \"{} ({})\"\nscene_hash = \"{:08x}\"\nrig_hash = \"{:08x}\"\nprotocol_hash = \"{:08x}\"\n\n[constants]\n",
        identity.version, identity.git, identity.scene_hash, identity.rig_hash, identity.protocol_hash
    );
    for (name, value) in board_settings::named_constants(&report.constants) {
        // Writing into a string does not fail. {:?} always has a point or an exponent: a TOML float.
        let _ = writeln!(text, "{name} = {value:?}");
    }
    text.push_str("\n[settings]\n");
    for (setting, value) in report.values.iter() {
        let unit = setting.spec().unit;
        let unit = if unit.is_empty() { String::new() } else { format!("  # {unit}") };
        let scenes = setting.spec().default.is_none() && value == report.defaults.get(setting);
        let _ = match scenes {
            true => writeln!(text, "{} = \"{DEFAULT}\"  # of the scene: {value:?}", setting.name()),
            false => writeln!(text, "{} = {value:?}{unit}", setting.name()),
        };
    }
    let points = report.values.lvdt_curve.as_ref().map_or(NONE.to_owned(), lvdt_points::text);
    let _ = writeln!(text, "{} = \"{points}\"  # m", lvdt_points::NAME);
    text
}

/// A backup as read.
#[derive(Debug, PartialEq)]
pub struct Backup {
    /// Hash of the `[rig]` that the board was built for, if the file has it.
    pub rig_hash: Option<u32>,
    /// The constants of the board that its settings correct, if the file has them.
    pub constants: Option<CorrectedConstants>,
    /// The board's protocol hash, if the file has it.
    pub protocol_hash: Option<u32>,
    /// Every setting; those that the file does not have are the defaults.
    pub values: SettingValues,
    /// Which those are.
    pub missing: Vec<Setting>,
    /// Whether the file says which points the LVDT has, or that it has none.
    pub has_points: bool,
}

impl Backup {
    /// The backup's settings for a board with this hash of its `[rig]` and this report of its settings; notes on `file` go to
    /// standard error. A setting that the backup has for other constants than the board's stays as it is on the board and is
    /// named as dropped, unless `force` takes it all the same. With `force` a backup may lack settings, which stay as they are
    /// on the board; but the board's points of the LVDT go with an offset or a gain that were measured without.
    ///
    /// # Errors
    /// Naming both hashes, if they differ and the file has no constants; naming what the backup lacks.
    pub fn for_board(
        &self,
        rig_hash: u32,
        board: &SettingsReport,
        file: &Path,
        force: bool,
    ) -> Result<(SettingValues, Dropped), Failure> {
        let name = file.display();
        let mut lacks: Vec<&str> = self.missing.iter().map(|setting| setting.name()).collect();
        if !self.has_points && board.values.lvdt_curve.is_some() {
            lacks.push(lvdt_points::NAME);
        }
        let mut values = self.missing.iter().fold(self.values, |v, s| v.with(*s, board.values.get(*s)));
        // Offset and gain of a file without points were measured without any.
        let calibrates = [Setting::LvdtOffset, Setting::LvdtGain].iter().any(|setting| !self.missing.contains(setting));
        if !self.has_points && !calibrates {
            values.lvdt_curve = board.values.lvdt_curve;
        }
        let result = match (&self.constants, self.rig_hash) {
            _ if force => (values, Dropped::NONE),
            (Some(constants), _) => values.carried_over(constants, &board.constants, &board.defaults, &board.values),
            (None, Some(theirs)) if theirs != rig_hash => {
                return Err(Failure::failed(format!(
                    "{name}: written for a [rig] of hash {theirs:08x}, this is {rig_hash:08x}: with other LVDT or gear numbers \
                     these settings are wrong. `config restore --force` takes them all the same"
                )));
            }
            (None, _) => (values, Dropped::NONE),
        };
        if !lacks.is_empty() && !force {
            return Err(Failure::failed(format!(
                "{name}: was it cut short? It lacks {}. In a backup each setting has a line, with the value \"{DEFAULT}\" where \
                 the scene's is wanted, and `{}` has \"{NONE}\" where the LVDT has none. `config restore --force` takes what is \
                 there, and leaves the rest as it is on the board; offset or gain of the LVDT without points remove the board's points",
                lacks.join(", "),
                lvdt_points::NAME
            )));
        }
        if self.protocol_hash.is_some_and(|theirs| theirs != PROTOCOL_HASH) {
            crate::output::say!("{name} is of another firmware; settings keep their names, so this is no harm");
        }
        lacks.retain(|lacking| !calibrates || *lacking != lvdt_points::NAME);
        if !lacks.is_empty() {
            crate::output::say!("not in {name}, so left as on the board: {}", lacks.join(", "));
        }
        if values.lvdt_curve.is_none() && board.values.lvdt_curve.is_some() {
            crate::output::say!("{name} calibrates the LVDT without points: those of the board are removed");
        }
        Ok(result)
    }
}

/// Checks that every setting of a backup could be used.
///
/// # Errors
/// Naming those that could not.
pub fn require_all(dropped: &Dropped, file: &Path) -> Result<(), Failure> {
    if dropped.is_empty() {
        return Ok(());
    }
    Err(Failure::failed(format!(
        "NOT taken from {}, which has them for another gear or LVDT than this rig's: {}. Calibrate again, or `config set` each \
         that this rig needs; `config restore --force` takes them all the same",
        file.display(),
        board_settings::dropped(dropped)
    )))
}

/// Reads the settings in a file for a board with these defaults: a backup, or the head of a recorded log.
///
/// # Errors
/// Naming the file and everything that is wrong with it.
pub fn load(file: &Path, defaults: &SettingValues) -> Result<Backup, Failure> {
    let in_file = |message: String| Failure::failed(format!("{}: {message}", file.display()));
    let text = rig_config::files::read_to_string(file).map_err(|e| in_file(e.to_string()))?;
    if !text.starts_with(&format!("# format = {FORMAT}")) {
        return from_toml(&text, defaults).map_err(in_file);
    }
    let log = Log::parse(&text).map_err(in_file)?;
    if !log.has_head {
        return Err(in_file("the log was cut short in its head, which holds the settings".into()));
    }
    let (values, missing) = log.settings(defaults).map_err(in_file)?;
    let hash = |key: &str| log.header.get(key).and_then(|text| u32::from_str_radix(text, 16).ok());
    let (rig_hash, protocol_hash) = (hash("rig_hash"), hash("protocol_hash"));
    // A log has no line for points that there are none of, so that a whole head always says which there are.
    Ok(Backup { rig_hash, constants: log.constants(), protocol_hash, values, missing, has_points: true })
}

/// The file of a backup as it stands.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    board: Board,
    constants: Option<CorrectedConstants>,
    settings: Table,
}

/// What of the board's identity matters.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Board {
    #[serde(deserialize_with = "hash")]
    rig_hash: Option<u32>,
    #[serde(deserialize_with = "hash")]
    protocol_hash: Option<u32>,
}

fn hash<'de, D: Deserializer<'de>>(value: D) -> Result<Option<u32>, D::Error> {
    let wrong = |_| de::Error::custom("not eight hexadecimal digits in quotes");
    u32::from_str_radix(&String::deserialize(value)?, 16).map(Some).map_err(wrong)
}

/// Reads the file of a backup for a board with these defaults.
///
/// # Errors
/// What is wrong with its form, or every setting that is wrong, each named.
pub fn from_toml(text: &str, defaults: &SettingValues) -> Result<Backup, String> {
    let File { board, constants, settings } = toml::from_str(text).map_err(|e| e.to_string())?;
    let (mut values, mut wrong) = (*defaults, Vec::new());
    for (name, given) in &settings {
        let text = match given {
            Value::String(text) => Ok(text.clone()),
            Value::Integer(_) | Value::Float(_) if name != lvdt_points::NAME => Ok(given.to_string()),
            other => Err(format!("{name} is a {}", other.type_str())),
        };
        match text.and_then(|text| board_settings::put(&values, defaults, name, &text)) {
            Ok(with) => values = with,
            Err(message) => wrong.push(message),
        }
    }
    if !wrong.is_empty() {
        return Err(wrong.join("; "));
    }
    let missing = Setting::ALL.iter().copied().filter(|setting| !settings.contains_key(setting.name())).collect();
    let has_points = settings.contains_key(lvdt_points::NAME);
    let Board { rig_hash, protocol_hash } = board;
    Ok(Backup { rig_hash, constants, protocol_hash, values, missing, has_points })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::identity;
    use rig_link::{Kept, LvdtCurve};

    fn defaults() -> SettingValues {
        Setting::ALL.iter().fold(SettingValues::ZERO, |values, s| values.with(*s, s.spec().default.unwrap_or(0.5)))
    }

    const RIG: CorrectedConstants = CorrectedConstants {
        gear_ratio: 62.0,
        counts_per_rad: 40_415.98,
        lvdt_gap_at_code_zero_m: 0.0,
        lvdt_metres_per_code: 5.372_405_5e-5,
    };

    fn report(values: SettingValues) -> SettingsReport {
        SettingsReport { values, defaults: defaults(), constants: RIG, kept: Kept::These, dropped: Dropped::NONE }
    }

    #[test]
    fn for_other_constants_the_rest_is_taken_and_the_boards_own_stays() {
        let set =
            defaults().with(Setting::LvdtGain, 1.01).with(Setting::TwistSign, -1.0).with(Setting::GearScale, 1.02);
        let backup =
            from_toml(&to_toml(&report(set), &identity("abcdef")), &defaults()).unwrap_or_else(|e| panic!("{e}"));
        let file = Path::new("b.toml");
        let present = defaults().with(Setting::LvdtGain, 0.95).with(Setting::LvdtOffset, 2e-3);
        let other_lvdt = CorrectedConstants { lvdt_metres_per_code: 5e-5, ..RIG };
        let board = SettingsReport { constants: other_lvdt, ..report(present) };
        let (values, dropped) = backup.for_board(1, &board, file, false).unwrap_or_else(|_| panic!("refused"));
        assert_eq!(values, present.with(Setting::TwistSign, -1.0).with(Setting::GearScale, 1.02));
        assert!(dropped.names().eq(["lvdt-gain"]), "{dropped:?}");
        assert!(require_all(&dropped, file).is_err() && require_all(&Dropped::NONE, file).is_ok());
        let forced = backup.for_board(1, &board, file, true).unwrap_or_else(|_| panic!("refused"));
        assert_eq!(forced, (set, Dropped::NONE));
        // A file of an older tool has no constants.
        let old = Backup { rig_hash: Some(7), constants: None, ..backup };
        assert!(old.for_board(1, &board, file, false).is_err());
        assert_eq!(old.for_board(7, &board, file, false).ok(), Some((set, Dropped::NONE)));
    }

    #[test]
    fn a_backup_is_read_back_to_the_last_bit() {
        let values = defaults()
            .with(Setting::LvdtOffset, -0.001_234_567)
            .with(Setting::LvdtGain, 1.0 + f32::EPSILON)
            .with(Setting::TwistSign, -1.0)
            .with(Setting::SpeedMax, 1e-4);
        let lvdt_curve = LvdtCurve::new(&[[0.1000001, 1e-4], [0.11, -2.345e-4], [0.12, 0.0]], 2.1e-5).ok();
        let values = SettingValues { lvdt_curve, ..values };
        let of_board = report(values);
        let identity = Identity { protocol_hash: 0xabcd, rig_hash: 0x2345_6789, ..identity("abcdef") };
        let text = to_toml(&of_board, &identity);
        let backup = from_toml(&text, &defaults()).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let wanted = Backup {
            rig_hash: Some(0x2345_6789),
            constants: Some(RIG),
            protocol_hash: Some(0xabcd),
            values,
            missing: Vec::new(),
            has_points: true,
        };
        assert_eq!(backup, wanted, "{text}");
        let limited = to_toml(&report(values.with(Setting::CurrentLimit, 0.3)), &identity);
        assert_eq!(from_toml(&limited, &defaults()).map(|backup| backup.missing), Ok(Vec::new()));
        // A scene with a lower limit, where nobody has set one.
        let lower = defaults().with(Setting::CurrentLimit, 0.4);
        let limit_a = from_toml(&text, &lower).map(|backup| backup.values.get(Setting::CurrentLimit));
        assert_eq!(limit_a, Ok(0.4));
    }

    #[test]
    fn units_are_read_and_what_is_missing_is_default() {
        let backup = from_toml("[settings]\nlvdt-offset = \"1.5mm\"\ntwist-sign = -1\n", &defaults());
        let backup = backup.unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(backup.values, defaults().with(Setting::LvdtOffset, 1.5e-3).with(Setting::TwistSign, -1.0));
        assert_eq!((backup.missing.len(), backup.has_points), (Setting::ALL.len() - 2, false));
    }

    #[test]
    fn a_backup_that_was_cut_anywhere_takes_nothing_from_the_board() {
        let lvdt_curve = LvdtCurve::new(&[[0.1, 1e-4], [0.12, 0.0]], 2e-5).ok();
        let set = SettingValues { lvdt_curve, ..defaults().with(Setting::CurrentLimit, 0.3) };
        let board = report(set.with(Setting::LvdtGain, 1.02));
        let file = Path::new("b.toml");
        for wanted in [set, SettingValues { lvdt_curve: None, ..set }, defaults()] {
            let text = to_toml(&report(wanted), &identity("abcdef"));
            for end in text.match_indices('\n').map(|(end, _)| end + 1) {
                let cut = &text[..end];
                let restored = from_toml(cut, &defaults()).map(|backup| backup.for_board(0, &board, file, false));
                match restored {
                    Ok(Ok((values, _))) => assert_eq!((values, end), (wanted, text.len()), "{cut}"),
                    Ok(Err(refused)) => {
                        let why = refused.message().unwrap_or_default();
                        assert!(end < text.len() && why.contains("lvdt-points") && why.contains("--force"), "{why}");
                    }
                    Err(why) => assert!(why.contains("settings") || why.contains("[constants]"), "{why}"),
                }
            }
        }
        // Written before there were points: its gain was measured without any.
        let older = from_toml("[settings]\nlvdt-gain = 1.01\n", &defaults()).expect("a table");
        let (forced, _) = older.for_board(0, &board, file, true).expect("forced");
        assert_eq!(forced, SettingValues { lvdt_curve: None, ..board.values.with(Setting::LvdtGain, 1.01) });
        let empty = from_toml("[settings]\n", &defaults()).expect("a table");
        let forced = empty.for_board(0, &board, file, true).expect("forced");
        assert_eq!(forced, (board.values, Dropped::NONE), "what the file lacks stays as it is on the board");
    }

    #[test]
    fn everything_that_is_wrong_is_named() {
        for (text, named) in [
            ("settings = 3", &["settings = 3", "line 1"][..]),
            ("[board]\nscene_hash = \"12\"", &["`settings`"]),
            ("[settings]\nlvdt-gian = 1.0", &["lvdt-gian", "lvdt-gain"]),
            ("[settings]\nlvdt-gain = true\nspeed-max = \"2mm\"", &["lvdt-gain is a boolean", "speed-max", "mm/s"]),
            ("[settings]\nlvdt-gain = 3.0\ntwist-sign = 0", &["lvdt-gain is 3, allowed are 0.8", "-1 or 1"]),
            ("[settings]\nlvdt-gain = nan", &["lvdt-gain", "not a finite number"]),
            ("[settings]\ncurrent-limit = 0.6", &["current-limit is 0.6 A", "to 0.5 A"]),
            ("[board]\nrig_hash = 12\n[settings]\n", &["rig_hash = 12", "line 2"]),
            ("[settings]\nlvdt-points = \"0.1:0 error 0\"", &["lvdt-points", "2 to 11"]),
            ("[settings]\nlvdt-points = 3", &["lvdt-points is a integer"]),
            ("[constants]\ngear_ratio = 62.0\n[settings]\n", &["[constants]", "counts_per_rad"]),
            ("[sttings]\n[settings]\n", &["sttings"]),
            ("[settings", &["settings"]),
        ] {
            let error = from_toml(text, &defaults()).expect_err(text);
            assert!(named.iter().all(|part| error.contains(part)), "{text}: {error}");
        }
    }
}
