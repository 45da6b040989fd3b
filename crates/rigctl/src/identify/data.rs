//! The data of a fit: recorded sweeps, or the paper's numbers.
//!
//! A sweep is a CSV file with the columns `load_n`, `turns` (or `twist_rad`) and `gap_m` or `contraction_m`, and if
//! wanted `sigma_m`, one standard deviation of the row. Lines that begin with `#` are passed over. A log of `rigctl sweep`
//! is taken by its equilibria ([`crate::log::sweep`]) and the load in its head, not by the board's estimate. Such logs of one
//! rig share the zero of its LVDT, and the string's length is fitted to it. The zero of the gap sensor behind another file
//! with `gap_m`, or an older log, is not known: each gets an unknown of its own for it.

use crate::csv_text::{Table, no_number};
use crate::failure::Failure;
use crate::log::sweep::Sweep;
use crate::log::{self, Log, SETTINGS};
use crate::units::{M, N, TURNS_OF_RAD};
use rig_config::Scene;
use rig_control::hysteresis::memory_shape;
use rig_link::Setting;
use std::ops::Range;
use std::path::Path;
use std::time::SystemTime;
use tsa_model::{PRETWIST_RAD, Parameters, twist_from_turns};

/// What a row measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Gap between the clamps, from an unknown zero (m).
    Gap,
    /// Contraction since the half-turn pre-twist (m).
    Contraction,
    /// Transmission ratio (rad/m).
    Tr,
    /// Distance between the rods' tips (m).
    Span,
}

/// A measured number.
#[derive(Debug, Clone)]
pub struct Row {
    /// Its name: the paper's, or file and line.
    pub id: String,
    /// What it measures.
    pub quantity: Quantity,
    /// Load (N).
    pub load_n: f64,
    /// Twist (rad).
    pub twist_rad: f64,
    /// The number (m or rad/m).
    pub value: f64,
    /// One standard deviation (m or rad/m); of the paper's numbers, the number itself: errors are relative.
    pub sigma: f64,
    /// Constants of the scene with the row's own changes.
    pub base: Parameters,
    /// Keys that the row sets for itself.
    pub fixed: String,
    /// Which unknown zero, of a gap.
    pub zero: Option<usize>,
    /// Half the difference between the way up and the way down (m), of a recorded sweep.
    pub half_difference_m: Option<f64>,
    /// Not fitted, only predicted.
    pub held_out: bool,
}

impl Row {
    /// A number from which the fit may deviate by its own size.
    pub fn new(id: String, quantity: Quantity, load_n: f64, twist_rad: f64, value: f64, base: &Parameters) -> Self {
        Self {
            id,
            quantity,
            load_n,
            twist_rad,
            value,
            sigma: value,
            base: *base,
            fixed: String::new(),
            zero: None,
            half_difference_m: None,
            held_out: false,
        }
    }
}

/// Rows, and what could not be read.
#[derive(Debug, Clone, Default)]
pub struct Data {
    /// The rows.
    pub rows: Vec<Row>,
    /// Number of unknown zeros.
    pub zeros: usize,
    /// Bad rows, with file and line.
    pub bad: Vec<String>,
    /// Recorded files, and which rows are of each.
    pub files: Vec<(String, Range<usize>)>,
    /// Sweeps on rods that had just carried a heavier load, which are not fitted: file and equilibria.
    pub after: Vec<(String, Sweep)>,
    /// Sweeps that were recorded after a heavier load without saying so, in words.
    pub remembering: Vec<String>,
}

impl Data {
    /// Whether every row is a gap whose zero is known.
    pub fn knows_its_zero(&self) -> bool {
        self.rows.iter().all(|row| row.quantity == Quantity::Gap && row.zero.is_none())
    }

    /// Adds what a log of `rigctl sweep` recorded.
    fn add_log(&mut self, name: &str, base: &Parameters, log: &Log, partial: bool) -> Result<(), String> {
        let broken_off = log.header.get("broken_off").map(|why| format!("was broken off ({why})"));
        if let Some(why) = log.cut().or(broken_off).filter(|_| !partial) {
            return Err(format!("{why}; --partial takes what is there"));
        }
        let sweep = log::sweep::reduce(log)?;
        taut("sweep.load_n", sweep.load_n)?;
        self.add_sweep(name, base, &sweep);
        Ok(())
    }

    /// Adds the rows of a file with columns of its own.
    fn add_file(&mut self, name: &str, base: &Parameters, text: &str) -> Result<(), String> {
        let table = Table::parse(text)?;
        let either = |[first, second]: [&'static str; 2]| {
            let missing = || format!("has neither a column `{first}` nor `{second}`");
            [first, second].into_iter().find(|name| table.has(name)).ok_or_else(missing)
        };
        if !table.has("load_n") {
            return Err("has no column `load_n`".into());
        }
        if table.has("load_error_n") {
            return Err(
                "has a column `load_error_n`: its loads are the board's estimates, and nobody has weighed them".into(),
            );
        }
        let (twist, length) = (either(["turns", "twist_rad"])?, either(["gap_m", "contraction_m"])?);
        let quantity = if length == "gap_m" { Quantity::Gap } else { Quantity::Contraction };
        let zero = (quantity == Quantity::Gap).then_some(self.zeros);
        let before = self.rows.len();
        for (line, record) in &table.rows {
            let id = format!("{name}:{line}");
            let number = |name: &str| match table.number(record, name)? {
                number if number.is_finite() => Ok(number),
                number => Err(no_number(name, &number.to_string())),
            };
            let row = || {
                let sigma = if table.has("sigma_m") { number("sigma_m")? } else { SIGMA_M };
                if !(SIGMAS_M[0]..=SIGMAS_M[1]).contains(&sigma) {
                    return Err(format!("sigma_m {sigma} must be from {}", M.range(SIGMAS_M)));
                }
                let (load_n, turned) = (taut("load_n", number("load_n")?)?, number(twist)?);
                let twist_rad = if twist == "turns" { twist_from_turns(turned) } else { turned };
                let value = number(length)?;
                Ok(Row { zero, sigma, ..Row::new(id.clone(), quantity, load_n, twist_rad, value, base) })
            };
            match row() {
                Ok(row) => self.rows.push(row),
                Err(what) => self.bad.push(format!("{id}: {what}")),
            }
        }
        if self.rows.len() == before {
            let why = self.bad.last().map_or(String::new(), |bad| format!(" ({bad})"));
            return Err(format!("has no good row{why}"));
        }
        self.zeros += usize::from(zero.is_some());
        self.files.push((name.to_owned(), before..self.rows.len()));
        Ok(())
    }

    /// Adds the equilibria of one recorded sweep under a known load. One after a heavier load is kept beside them.
    pub fn add_sweep(&mut self, name: &str, base: &Parameters, sweep: &Sweep) {
        if sweep.after_n.is_some() {
            self.after.push((name.to_owned(), sweep.clone()));
            return;
        }
        let before = self.rows.len();
        let zero = sweep.zero_gap_m.is_none().then_some(self.zeros);
        for stop in &sweep.stops {
            let id = format!("{name} at {}", TURNS_OF_RAD.show(stop.twist_rad - PRETWIST_RAD));
            // Up is where the gap is smaller.
            let value = sweep.zero_gap_m.unwrap_or(0.0) - stop.position_m;
            self.rows.push(Row {
                half_difference_m: Some(stop.half_difference_m),
                sigma: SIGMA_M.hypot(LOOP_FRACTION * stop.half_difference_m),
                zero,
                ..Row::new(id, Quantity::Gap, sweep.load_n, stop.twist_rad, value, base)
            });
        }
        self.zeros += usize::from(zero.is_some());
        self.files.push((name.to_owned(), before..self.rows.len()));
    }

    /// The same numbers for a scene with other constants.
    #[must_use]
    pub fn based_on(&self, base: &Parameters) -> Self {
        let rows = self.rows.iter().map(|row| Row { base: *base, ..row.clone() }).collect();
        Self { rows, zeros: self.zeros, files: self.files.clone(), ..Self::default() }
    }

    /// The rows of each recorded sweep, which is one load in one file, in order of twist.
    pub fn runs(&self) -> Vec<Vec<usize>> {
        let mut runs: Vec<Vec<usize>> = Vec::new();
        for (_, rows) in &self.files {
            let first = runs.len();
            for k in rows.clone() {
                let load_n = self.rows[k].load_n;
                match runs[first..].iter_mut().find(|run| self.rows[run[0]].load_n == load_n) {
                    Some(run) => run.push(k),
                    None => runs.push(vec![k]),
                }
            }
        }
        for run in &mut runs {
            run.sort_by(|a, b| self.rows[*a].twist_rad.abs().total_cmp(&self.rows[*b].twist_rad.abs()));
        }
        runs
    }

    /// The same with at most the given number of rows of each sweep, evenly over its twist: neighbouring rows tell nearly the same.
    #[must_use]
    pub fn thinned(&self, max: usize) -> Self {
        let mut kept = vec![false; self.rows.len()];
        for run in self.runs() {
            let step = run.len().div_ceil(max).max(1);
            // The middle row of each group, so that both ends count alike.
            run.chunks(step).for_each(|some| kept[some[some.len() / 2]] = true);
        }
        let mut thin = Self { zeros: self.zeros, ..Self::default() };
        for (name, rows) in &self.files {
            let before = thin.rows.len();
            thin.rows.extend(rows.clone().filter(|k| kept[*k]).map(|k| self.rows[k].clone()));
            thin.files.push((name.clone(), before..thin.rows.len()));
        }
        thin
    }

    /// Errors of all rows (m) in standard deviations of each.
    pub fn in_deviations(&self, errors: &[f64]) -> Vec<f64> {
        errors.iter().zip(&self.rows).map(|(error, row)| error / row.sigma).collect()
    }

    /// Some values of the rows, sweep by sweep.
    pub fn by_run(&self, values: &[f64]) -> Vec<Vec<f64>> {
        self.runs().iter().map(|run| run.iter().map(|k| values[*k]).collect()).collect()
    }

    /// The file that a row is of.
    pub fn file_of(&self, row: usize) -> &str {
        self.files.iter().find(|(_, rows)| rows.contains(&row)).map_or("", |(name, _)| name)
    }
}

/// Standard error of the load in a sweep that friction leaves, as a fraction of the friction: the mean of up and down would be
/// free of it if it were alike both ways and the gap went straight with the load.
pub const LOOP_FRACTION: f64 = 0.1;
/// Standard deviation of a sweep's rows that do not say their own (m): half a count of a 12-bit converter on 200 mm.
pub const SIGMA_M: f64 = 25e-6;
/// Minimum and maximum standard error that a row can state (m). No sensor of a rig is as good or as bad, and the squares of errors in
/// standard deviations stay far from the limits of a number.
const SIGMAS_M: [f64; 2] = [1e-9, 1.0];
/// Fraction of the most that rods remember from which on it is worth a word.
const SHOWS: f32 = 0.1;

/// Recorded sweeps. A log that was cut or broken off is taken only if `partial`.
///
/// # Errors
/// If a file cannot be read, lacks a column, or has no good row.
pub fn sweeps(scene: &Scene, files: &[impl AsRef<Path>], partial: bool) -> Result<Data, Failure> {
    let base = Parameters::new(&scene.geometry, &scene.string, &scene.material)?;
    let mut data = Data::default();
    let mut recorded = Vec::new();
    let mut places = Vec::new();
    let mut contents: Vec<(String, Vec<u8>)> = Vec::new();
    let mut calibrated: Option<(String, [String; 3])> = None;
    for path in files.iter().map(AsRef::as_ref) {
        let name = path.display().to_string();
        let place = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if places.contains(&place) {
            return Err(Failure::Usage(format!("sweep {name} is given twice")));
        }
        places.push(place);
        let content = rig_config::files::read(path).map_err(|e| e.to_string());
        // The same measurement twice would look like two, and halve the errors.
        if let Ok(bytes) = &content {
            if let Some((other, _)) = contents.iter().find(|(_, other)| other == bytes) {
                return Err(Failure::Usage(format!("sweep {name} is a copy of {other}")));
            }
            contents.push((name.clone(), bytes.clone()));
        }
        let read = content.and_then(|bytes| match Log::is_one(&bytes) {
            true => {
                let log = Log::load(path)?;
                let (first, as_first) = calibrated.get_or_insert_with(|| (name.clone(), lvdt_calibration(&log)));
                if lvdt_calibration(&log) != *as_first {
                    return Err(format!(
                        "was recorded with another calibration of the LVDT than {first}: calibrate it first, then record all sweeps"
                    ));
                }
                data.add_log(&name, &base, &log, partial)?;
                recorded.extend(Recorded::new(&name, &log));
                Ok(())
            }
            false => data.add_file(&name, &base, &String::from_utf8_lossy(&bytes)),
        });
        read.map_err(|what| Failure::failed(format!("sweep {name}: {what}")))?;
    }
    data.remembering = recorded.iter().filter_map(|sweep| sweep.remembers(&recorded)).collect();
    Ok(data)
}

/// The LVDT's calibration in a log's settings, as its head has it.
fn lvdt_calibration(log: &Log) -> [String; 3] {
    [Setting::LvdtOffset.name(), Setting::LvdtGain.name(), crate::lvdt_points::NAME]
        .map(|name| log.header.get(&format!("{SETTINGS}{name}")).unwrap_or_default().to_owned())
}

/// When a sweep was recorded under which load.
struct Recorded {
    name: String,
    load_n: f64,
    is_after: bool,
    host_time: SystemTime,
    /// First and last time of the board (s).
    board_s: [f64; 2],
    emulated: bool,
}

impl Recorded {
    /// Of a log that tells all of it.
    fn new(name: &str, log: &Log) -> Option<Self> {
        Some(Self {
            name: name.to_owned(),
            load_n: log.header.get("sweep.load_n")?.parse().ok()?,
            is_after: log.header.get("sweep.after_n").is_some(),
            host_time: log.header.host_time()?,
            board_s: [log.rows.first()?.t_s, log.rows.last()?.t_s],
            emulated: log.header.get("port") == Some("sim"),
        })
    }

    /// What the rods of this sweep remember, if one of the others was recorded before it under a load so much heavier that it
    /// shows. An emulated rig begins with new rods each time.
    fn remembers(&self, all: &[Self]) -> Option<String> {
        let before = all.iter().filter(|other| {
            let earlier = other.host_time < self.host_time;
            earlier && (!self.emulated || other.board_s[1] < self.board_s[0])
        });
        let heavier = before.max_by(|a, b| a.load_n.total_cmp(&b.load_n))?;
        let shows = memory_shape(self.load_n as f32, heavier.load_n as f32) > SHOWS && !self.is_after;
        shows.then(|| {
            format!(
                "sweep {} ({}) was recorded after {} ({}), and the rods remember that load: record from the lightest load to \
                 the heaviest, or this sweep with --after",
                self.name,
                N.show(self.load_n),
                heavier.name,
                N.show(heavier.load_n)
            )
        })
    }
}

/// Checks that a string is not slack, which has no law.
fn taut(name: &str, load_n: f64) -> Result<f64, String> {
    let taut = load_n >= tsa_model::mechanism::MINIMUM_LOAD_N && load_n.is_finite();
    let why = || format!("{name} {load_n}: a slack string has no law (the column is in newtons)");
    taut.then_some(load_n).ok_or_else(why)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With 1e-300 m squares of errors overflow, and an identification would be certain of constants that are not numbers.
    #[test]
    fn a_deviation_that_no_sensor_has_is_refused_by_name() {
        let scene = Scene::from_toml_str(include_str!("../../../../scenes/default.toml")).expect("a scene");
        let file = std::env::temp_dir().join(format!("rigctl-sigma-{}.csv", std::process::id()));
        for (sigma_m, good) in [("2e-5", true), ("0", false), ("-1e-5", false), ("1e-300", false), ("1e300", false)] {
            let text = format!("load_n,turns,gap_m,sigma_m\n5,3,0.09,2e-5\n5,4,0.08,{sigma_m}\n");
            std::fs::write(&file, text).expect("a temporary file");
            let data = sweeps(&scene, &[&file], false).expect("one good row");
            let named = data.bad.iter().any(|why| why.contains(&format!("{}:3: sigma_m", file.display())));
            assert_eq!((data.rows.len(), named), (if good { 2 } else { 1 }, !good), "{sigma_m}: {:?}", data.bad);
        }
        std::fs::remove_file(&file).expect("a temporary file");
    }

    #[test]
    fn logs_of_another_calibration_of_the_lvdt_are_told_apart() {
        let log = |settings: &str| {
            let text = format!("# format = tsa-log 1\n{settings}t_s,state,position_m,twist_rad\n0,ready,0,4\n");
            Log::parse(&text).expect("a log")
        };
        let [plain, offset, gain] = ["", "# settings.lvdt-offset = 0.0005\n", "# settings.lvdt-gain = 1.01\n"].map(log);
        let points = log(&format!("# settings.{} = 0.1 0.1001\n", crate::lvdt_points::NAME));
        let all = [plain, offset, gain, points].map(|log| lvdt_calibration(&log));
        for (k, one) in all.iter().enumerate() {
            assert_eq!(all.iter().filter(|other| *other == one).count(), 1, "log {k}");
        }
    }

    #[test]
    fn sweeps_after_a_heavier_load_are_named() {
        // Load (N), the heavier one that was named, when (s), when by the board (s).
        let sweep = |(load_n, after_n, host_s, board_s): (f64, Option<f64>, u64, f64), port: &str| {
            let time = humantime::format_rfc3339(SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(host_s));
            let after = after_n.map_or(String::new(), |after_n| format!("# sweep.after_n = {after_n}\n"));
            let text = format!(
                "# format = tsa-log 1\n# port = {port}\n# host_time = {time}\n# sweep.load_n = {load_n}\n{after}\
                 t_s,state,position_m,twist_rad\n{board_s},ready,0,4\n{},ready,0,4\n",
                board_s + 60.0
            );
            Recorded::new(&load_n.to_string(), &Log::parse(&text).expect("a log")).expect("all of it")
        };
        let named = |all: [(f64, Option<f64>, u64, f64); 2], port: &str| {
            let all = all.map(|one| sweep(one, port));
            all.iter().filter_map(|one| one.remembers(&all)).collect::<Vec<_>>()
        };
        for port in ["COM3", "sim"] {
            let rising = [(3.0, None, 100, 10.0), (10.0, None, 200, 110.0)];
            assert!(named(rising, port).is_empty());
            let falling = [(10.0, None, 100, 10.0), (3.0, None, 200, 110.0)];
            let text = named(falling, port).join("; ");
            assert!(text.contains("sweep 3 (3.000 N)") && text.contains("after 10 (10.00 N)"), "{text}");
            assert!(named([falling[0], (3.0, Some(10.0), 200, 110.0)], port).is_empty(), "it says so itself");
            assert!(named([falling[0], (9.9, None, 200, 110.0)], port).is_empty(), "hardly heavier");
            // Another start of the board: a real rig has the same rods, an emulated one has new ones.
            assert_eq!(named([falling[0], (3.0, None, 200, 10.0)], port).is_empty(), port == "sim");
        }
    }
}
