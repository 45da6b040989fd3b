//! The section on a new rig's calibration: the six commands of docs/calibration.md on emulated rigs, and contractions and a
//! move before and after them.

use super::Measured;
use super::sections::{number, rigctl, significant, text};
use crate::toolchain::{Choice, choose};
use crate::{Folders, firmware, host};
use anyhow::{Context, Result};
use serde_json::Value;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// The rigs: a name, and the tool's words for it.
const RIGS: [(&str, &[&str]); 3] = [
    ("nominal", &["--rig", "nominal", "--seed", "7"]),
    ("hard", &["--rig", "hard", "--seed", "7"]),
    ("outside", &["--rig", "nominal", "--seed", "7", "--plant-program", "docs/plants/leaf_springs.py"]),
];
/// Twists (rad) at which the gap is measured for the sensor's points.
const TWISTS_RAD: [f64; 11] = [1.0, 13.0, 19.0, 23.0, 27.0, 30.5, 34.0, 37.0, 40.0, 43.0, 46.0];
/// What callipers resolve (m).
const CALLIPERS_M: f64 = 0.02e-3;
/// Loads of the sweeps, and of the moves.
const SWEPT: [&str; 3] = ["1.2N", "4N", "15N"];
const MOVED: [&str; 2] = ["2N", "12N"];
/// Loads between those of the sweeps, and turns, at which contractions by the scene are compared with the rig's own.
const COMPARED: ([&str; 2], [f64; 2]) = (["2.2N", "7.7N"], [3.75, 6.5]);

/// Calibrates each rig.
pub(super) fn measure(folders: &Folders) -> Result<Measured> {
    host::build(folders)?;
    firmware::build(folders, &choose(Choice::Auto)?)?;
    let head = [
        "rig, load",
        "load: as built",
        "calibrated",
        "position, stated error: as built",
        "calibrated",
        "true error: as built",
        "calibrated",
    ];
    let mut measured = Measured { table: vec![text(&head)], ..Measured::default() };
    for (name, words) in RIGS {
        let found = Rig::new(folders, name, words)?.calibrate(&mut measured)?;
        measured.notes.push(found);
    }
    Ok(measured)
}

/// A rig that is calibrated, with the folder for its files.
struct Rig<'a> {
    folders: &'a Folders,
    name: &'a str,
    words: &'a [&'a str],
    folder: String,
}

impl<'a> Rig<'a> {
    fn new(folders: &'a Folders, name: &'a str, words: &'a [&'a str]) -> Result<Self> {
        let folder = format!("out/calibration-{name}");
        let path = folders.root.join(&folder);
        // What an earlier run left is another board's memory.
        if path.exists() {
            std::fs::remove_dir_all(&path).with_context(|| format!("{}", path.display()))?;
        }
        std::fs::create_dir_all(&path).with_context(|| format!("{}", path.display()))?;
        Ok(Self { folders, name, words, folder })
    }

    fn file(&self, name: &str) -> String {
        format!("{}/{name}", self.folder)
    }

    /// The last object that the tool prints about this rig.
    fn rigctl(&self, words: &[&str]) -> Result<Value> {
        last(rigctl(self.folders, &[words, self.words].concat())?)
    }

    /// What `calibrate lvdt` shows of the rig switched on under a load with its strings at a twist (rad).
    fn shown(&self, load: &str, twist_rad: f64) -> Result<Value> {
        self.rigctl(&["calibrate", "lvdt", "--plant", &format!("load={load},twist_at_boot={twist_rad}")])
    }

    /// Rms error of a scene's contractions between the loads of the sweeps, as a share of the rig's own.
    fn contraction_error(&self, scene: &str) -> Result<f64> {
        let (loads, turns) = COMPARED;
        let mut squares = 0.0;
        for load in loads {
            let gap_m = |twist_rad| number(&self.shown(load, twist_rad)?, "/true_gap_m");
            let pretwist_m = gap_m(PI)?;
            for turns in turns {
                let true_m = pretwist_m - gap_m(PI + TAU * turns)?;
                let words = ["--scene", scene, "solve", "--load", load, "--turns", &turns.to_string()];
                let told_m = number(&last(rigctl(self.folders, &words)?)?, "/contraction_m")?;
                squares += (told_m / true_m - 1.0).powi(2);
            }
        }
        Ok((squares / (loads.len() * turns.len()) as f64).sqrt())
    }

    /// The gap by callipers and the sensor's reading at each twist.
    fn points(&self) -> Result<String> {
        let mut points = String::from("gap_m,sensor_m\n");
        for twist_rad in TWISTS_RAD {
            let found = self.shown("0.5kg", twist_rad)?;
            let (gap_m, sensor_m) = (number(&found, "/true_gap_m")?, number(&found, "/sensor_m")?);
            let gap_m = (gap_m / CALLIPERS_M).round() * CALLIPERS_M;
            points += &format!("{gap_m:.5},{sensor_m:.6}\n");
        }
        Ok(points)
    }

    fn calibrate(&self, measured: &mut Measured) -> Result<String> {
        let [points, flash, scene] = ["points.csv", "rig.flash", "new.toml"].map(|name| self.file(name));
        let write = |name: &str, text: String| {
            let path = Path::new(&self.folders.root).join(name);
            std::fs::write(&path, text).with_context(|| format!("{}", path.display()))
        };
        write(&points, self.points()?)?;
        let memory = ["--flash", flash.as_str()];
        self.rigctl(&[&["calibrate", "lvdt", "--points", &points][..], &memory].concat())?;
        let sweeps = SWEPT.map(|load| self.file(&format!("sweep-{load}.csv")));
        for (load, file) in SWEPT.iter().zip(&sweeps) {
            self.rigctl(&[&["sweep", "--load", load, "--out", file][..], &memory].concat())?;
        }
        let figure = format!("docs/charts/calibration-{}.svg", self.name);
        let words = ["identify", &sweeps[0], &sweeps[1], &sweeps[2], "--out", &scene, "--figure", &figure];
        let identified = last(rigctl(self.folders, &words)?)?;
        let known = [&["--scene", &scene, "--plant-scene", "scenes/default.toml"][..], &memory].concat();
        self.rigctl(&[&known[..], &["table", "--board"]].concat())?;
        for load in MOVED {
            let plant = format!("load={load}");
            let moved = ["move", "--to", "12mm", "--plant", &plant];
            let (before, after) = (self.rigctl(&moved)?, self.rigctl(&[&known[..], &moved].concat())?);
            let load_of = |found: &Value| -> Result<String> {
                Ok(format!("{:.2} ± {:.2} N", number(found, "/load_n")?, number(found, "/load_error_n")?))
            };
            let um =
                |found: &Value, at: &str| Ok::<_, anyhow::Error>(format!("{:.0} µm", 1e6 * number(found, at)?.abs()));
            measured.table.push(vec![
                format!("{}, {load}", self.name),
                load_of(&before)?,
                load_of(&after)?,
                um(&before, "/position_error_m")?,
                um(&after, "/position_error_m")?,
                um(&before, "/true_error_m")?,
                um(&after, "/true_error_m")?,
            ]);
        }
        let of = |at: &str| number(&identified, at);
        let errors = ["scenes/default.toml", &scene].map(|scene| self.contraction_error(scene));
        let [before, after] = errors.map(|error| error.map(|share| significant(100.0 * share)));
        let um = |at: &str| Ok::<_, anyhow::Error>(significant(1e6 * of(at)?));
        let corrected = match identified.pointer("/correction") {
            Some(Value::Object(_)) => format!(
                "The correction leaves {} µm, and {} µm instead of {} µm of blocks held out of one sweep. ",
                um("/correction/rms_m")?,
                um("/correction/held_out_m")?,
                um("/correction/held_out_without_m")?
            ),
            _ => String::new(),
        };
        let holds = identified.pointer("/law_holds").and_then(Value::as_bool).context("identify: no `law_holds`")?;
        Ok(format!(
            "{} rig: {} with {}, which {}; rms error {} µm over {} equilibria, and {} µm over what was held out. {}Contractions \
             under loads between those of the sweeps: {} % off as built, {} % calibrated (rms).",
            self.name,
            identified.pointer("/chosen/law").and_then(Value::as_str).unwrap_or("?"),
            identified.pointer("/chosen/material").and_then(Value::as_str).unwrap_or("?"),
            if holds { "holds" } else { "does not hold" },
            significant(1e6 * of("/fitted/rms")?),
            of("/fitted/count")?,
            significant(1e6 * of("/held_out/rms")?),
            corrected,
            before?,
            after?,
        ))
    }
}

/// The last object that the tool printed.
fn last(mut printed: Vec<Value>) -> Result<Value> {
    printed.pop().context("rigctl printed nothing")
}
