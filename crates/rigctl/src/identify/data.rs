//! The data of a fit: recorded sweeps, or the paper's numbers.
//!
//! A sweep is a CSV file with the columns `load_n`, `turns` (or `twist_rad`) and `gap_m` or `contraction_m`, and if
//! wanted `sigma_m`, one standard deviation of the row. Lines that begin with `#` are passed over. A log of `rigctl sweep`
//! is taken by its equilibria ([`crate::log::sweep`]) and the load in its head, not by the board's estimate. Such logs of one
//! rig share the zero of its LVDT, and the string's length is fitted to it. The zero of the gap sensor behind another file
//! with `gap_m`, or an older log, is not known: each gets an unknown of its own for it.

use crate::failure::Failure;
use crate::log::sweep::Sweep;
use crate::log::{self, Log};
use crate::published::{self, Group, Kind};
use rig_config::Scene;
use std::io::Read;
use std::ops::Range;
use std::path::Path;
use tsa_model::{Parameters, twist_from_turns};

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
}

impl Data {
    /// Whether every row is a gap whose zero is known.
    pub fn knows_its_zero(&self) -> bool {
        self.rows.iter().all(|row| row.quantity == Quantity::Gap && row.zero.is_none())
    }

    /// Adds the equilibria of one recorded sweep under a known load.
    pub fn add_sweep(&mut self, name: &str, base: &Parameters, sweep: &Sweep) {
        let before = self.rows.len();
        let zero = sweep.zero_gap_m.is_none().then_some(self.zeros);
        for stop in &sweep.stops {
            self.rows.push(Row {
                half_difference_m: Some(stop.half_difference_m),
                held_out: false,
                id: format!("{name} at {:.2} turns", stop.twist_rad / std::f64::consts::TAU - 0.5),
                quantity: Quantity::Gap,
                load_n: sweep.load_n,
                twist_rad: stop.twist_rad,
                // Up is where the gap is smaller.
                value: sweep.zero_gap_m.unwrap_or(0.0) - stop.position_m,
                sigma: SIGMA_M.hypot(LOOP_SHARE * stop.half_difference_m),
                base: *base,
                fixed: String::new(),
                zero,
            });
        }
        self.zeros += usize::from(zero.is_some());
        self.files.push((name.to_owned(), before..self.rows.len()));
    }

    /// The same numbers for a scene with other constants.
    #[must_use]
    pub fn based_on(&self, base: &Parameters) -> Self {
        let rows = self.rows.iter().map(|row| Row { base: *base, ..row.clone() }).collect();
        Self { rows, zeros: self.zeros, bad: Vec::new(), files: self.files.clone(), after: Vec::new() }
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

    /// The same with at most so many rows of each sweep, evenly over its twist: neighbouring rows tell nearly the same.
    #[must_use]
    pub fn thinned(&self, most: usize) -> Self {
        let mut kept = vec![false; self.rows.len()];
        for run in self.runs() {
            let step = run.len().div_ceil(most).max(1);
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

    /// The file that a row is of.
    pub fn file_of(&self, row: usize) -> &str {
        self.files.iter().find(|(_, rows)| rows.contains(&row)).map_or("", |(name, _)| name)
    }
}

/// Standard error of the load in a sweep that friction leaves, as a share of the friction: the mean of up and down would be
/// free of it if it were alike both ways and the gap went straight with the load.
pub const LOOP_SHARE: f64 = 0.1;
/// Standard deviation of a sweep's rows that do not say their own (m): half a count of a 12-bit converter on 200 mm.
pub const SIGMA_M: f64 = 25e-6;
/// Least and greatest one that a row can say (m). No sensor of a rig is as good or as bad, and the squares of errors in
/// standard deviations stay far from the limits of a number.
const SIGMAS_M: [f64; 2] = [1e-9, 1.0];

/// The paper's numbers; `held_out` are ids, or `theory`, `experiment`, `tr`, `span`, `contraction`.
///
/// # Errors
/// If an id does not occur, or a change cannot be made.
pub fn published(scene: &Scene, held_out: &[String]) -> Result<Data, Failure> {
    let rows = published::rows()?;
    for name in held_out {
        let kinds = ["theory", "experiment", "tr", "span", "contraction"];
        if !kinds.contains(&name.as_str()) && !rows.iter().any(|r| r.id == *name) {
            return Err(Failure::Usage(format!("--hold-out: no published number is called `{name}`")));
        }
    }
    let mut data = Data::default();
    for r in rows {
        let (quantity, group, si) = match r.quantity.group() {
            Group::Contraction => (Quantity::Contraction, "contraction", 1e-3),
            Group::Tr => (Quantity::Tr, "tr", 1e3),
            Group::Span => (Quantity::Span, "span", 1e-3),
        };
        let kind = if r.kind == Kind::Theory { "theory" } else { "experiment" };
        let changed = published::apply(scene, &r.changes).map_err(|e| Failure::failed(format!("{}: {e}", r.id)))?;
        data.rows.push(Row {
            half_difference_m: None,
            held_out: held_out.iter().any(|h| *h == r.id || h == kind || h == group),
            id: r.id,
            quantity,
            load_n: r.load_n,
            twist_rad: twist_from_turns(r.quantity.turns()),
            value: r.value * si,
            sigma: r.value * si,
            base: Parameters::new(&changed.geometry, &changed.string, &changed.material)?,
            fixed: r.changes,
            zero: None,
        });
    }
    Ok(data)
}

/// Whether a file begins as a log does.
fn is_log(path: &Path) -> bool {
    let mut start = [0; 10];
    std::fs::File::open(path).and_then(|mut f| f.read_exact(&mut start)).is_ok() && &start == b"# format ="
}

/// Recorded sweeps. A log that was cut or broken off is taken only if `partial`.
///
/// # Errors
/// If a file cannot be read, lacks a column, or has no good row.
pub fn sweeps(scene: &Scene, files: &[impl AsRef<Path>], partial: bool) -> Result<Data, Failure> {
    let base = Parameters::new(&scene.geometry, &scene.string, &scene.material)?;
    let mut data = Data::default();
    for file in files {
        let path = file.as_ref();
        let wrong = |what: String| Failure::failed(format!("sweep {}: {what}", path.display()));
        rig_config::files::check_regular(path).map_err(|e| wrong(e.to_string()))?;
        let before = data.rows.len();
        if is_log(path) {
            let log = Log::load(path).map_err(wrong)?;
            if !partial {
                let whole = log.clone().whole().map_err(|e| e.to_string());
                let ended = whole.and_then(|log| match log.header.get("broken_off") {
                    Some(why) => Err(format!("was broken off ({why})")),
                    None => Ok(()),
                });
                ended.map_err(|e| wrong(format!("{e}; --partial takes what is there")))?;
            }
            let sweep = log::sweep::reduce(&log).map_err(wrong)?;
            let load_n = sweep.load_n;
            if !(load_n >= tsa_model::mechanism::MINIMUM_LOAD_N && load_n.is_finite()) {
                return Err(wrong(format!(
                    "sweep.load_n {load_n}: a slack string has no law (the column is in newtons)"
                )));
            }
            let name = path.display().to_string();
            match sweep.after_n {
                Some(_) => data.after.push((name, sweep)),
                None => data.add_sweep(&name, &base, &sweep),
            }
            continue;
        }
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .flexible(true)
            .from_path(path)
            .map_err(|e| wrong(e.to_string()))?;
        let header = reader.headers().map_err(|e| wrong(e.to_string()))?.clone();
        let column = |name: &str| header.iter().position(|h| h == name);
        let load = column("load_n").ok_or_else(|| wrong("has no column `load_n`".into()))?;
        let (turn, turns) = match (column("turns"), column("twist_rad")) {
            (Some(k), _) => (k, true),
            (None, Some(k)) => (k, false),
            _ => return Err(wrong("has neither a column `turns` nor `twist_rad`".into())),
        };
        let (value, quantity) = match (column("gap_m"), column("contraction_m")) {
            (Some(k), _) => (k, Quantity::Gap),
            (None, Some(k)) => (k, Quantity::Contraction),
            _ => return Err(wrong("has neither a column `gap_m` nor `contraction_m`".into())),
        };
        let sigma = column("sigma_m");
        let zero = (quantity == Quantity::Gap).then_some(data.zeros);
        for record in reader.records() {
            let line = record.as_ref().ok().and_then(|r| r.position()).map_or(0, |p| p.line());
            let id = format!("{}:{line}", path.display());
            let row = record.map_err(|e| e.to_string()).and_then(|record| {
                let number = |k: usize| {
                    let cell = record.get(k).unwrap_or("");
                    let name = header.get(k).unwrap_or("");
                    match cell.parse::<f64>() {
                        Ok(x) if x.is_finite() => Ok(x),
                        _ => Err(format!("{name} `{cell}` is not a number")),
                    }
                };
                let sigma = sigma.map_or(Ok(SIGMA_M), number)?;
                let [least, most] = SIGMAS_M;
                if !(least..=most).contains(&sigma) {
                    return Err(format!("sigma_m {sigma} must be from {least} to {most} m"));
                }
                let load_n = number(load)?;
                if load_n < tsa_model::mechanism::MINIMUM_LOAD_N {
                    return Err(format!("load_n {load_n}: a slack string has no law (the column is in newtons)"));
                }
                let twist = number(turn)?;
                let twist_rad = if turns { twist_from_turns(twist) } else { twist };
                Ok((load_n, twist_rad, number(value)?, sigma))
            });
            match row {
                Ok((load_n, twist_rad, value, sigma)) => data.rows.push(Row {
                    half_difference_m: None,
                    held_out: false,
                    id,
                    quantity,
                    load_n,
                    twist_rad,
                    value,
                    sigma,
                    base,
                    fixed: String::new(),
                    zero,
                }),
                Err(what) => data.bad.push(format!("{id}: {what}")),
            }
        }
        if data.rows.len() == before {
            return Err(wrong(format!(
                "has no good row{}",
                data.bad.last().map_or(String::new(), |b| format!(" ({b})"))
            )));
        }
        data.zeros += usize::from(zero.is_some());
        data.files.push((path.display().to_string(), before..data.rows.len()));
    }
    Ok(data)
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
}
