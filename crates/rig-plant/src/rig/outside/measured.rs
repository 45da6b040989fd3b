//! A mechanism from measured gaps (`--plant-surface`): `load_n, twist_rad, gap_m` on a full grid, and a column `direction`
//! (`up` or `down`) where the two ways of the twist differ.
//!
//! Between the grid's points a natural cubic spline runs along the twist and another along ln F. Outside the grid the
//! surface is a guess that keeps a simulation sane: below the least twist a parabola that is level at zero twist, above the
//! maximum one nothing (the strings meet their wall there), and outside the loads a straight line in ln F.

use crate::rig::surface::GapPoint;
use std::collections::{BTreeMap, BTreeSet};

/// Minimum number of loads and of twists.
const MIN: usize = 3;
/// Minimum of the maximum twist, rad: a turn and a little past the half-turn pre-twist, where homing looks.
const MIN_TWIST_RAD: f64 = 10.0;
/// The gap goes from one way to the other while the twist turns back by this, rad. Assumed.
const TURN_BACK_RAD: f64 = 0.2;

/// Why a file is no surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// The head lacks a column.
    #[error("the head has no column `{0}`; it needs load_n, twist_rad, gap_m and may have direction")]
    Column(&'static str),
    /// A cell is no number, or a direction neither `up` nor `down`.
    #[error("line {line}, column `{column}`: `{text}` {reason}")]
    Cell {
        /// Line of the file, from 1.
        line: usize,
        /// The column.
        column: &'static str,
        /// What stands there.
        text: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A point of the grid is missing or stands twice.
    #[error("load_n = {load_n}, twist_rad = {twist_rad}{direction}: {reason}; every load needs the same twists once")]
    Grid {
        /// Load, N.
        load_n: f64,
        /// Twist, rad.
        twist_rad: f64,
        /// ` (up)`, ` (down)` or nothing.
        direction: &'static str,
        /// `missing` or `given twice`.
        reason: &'static str,
    },
    /// Too few loads or twists for a smooth surface.
    #[error("{found} values of {what}; a smooth surface needs at least {MIN}")]
    Few {
        /// `load_n` or `twist_rad`.
        what: &'static str,
        /// How many there are.
        found: usize,
    },
    /// The data end before a rig could be homed.
    #[error("the maximum twist is {0} rad; a rig needs at least {MIN_TWIST_RAD} rad")]
    Short(f64),
    /// A file for one way of the twist has a column for it.
    #[error("a file for one way only has no column `direction`")]
    TwoDirections,
    /// The gap does not grow with the load: the load could not be told from gap and twist.
    #[error("the gap falls from {} N to {} N at {twist_rad} rad; it must grow with the load", loads_n[0], loads_n[1])]
    Falls {
        /// Neighbouring loads, N.
        loads_n: [f64; 2],
        /// Twist, rad.
        twist_rad: f64,
    },
}

/// Gaps (m) by the bits of load (N) and twist (rad).
type Grid = BTreeMap<(u64, u64), f64>;

/// A measured mechanism. Both ways of the twist are kept as their mean and half their difference.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    mean: Spline,
    /// Half of up less down; `None` where the file does not tell them apart.
    half_difference: Option<Spline>,
}

/// Gaps on a grid of ln F and twist.
#[derive(Clone, Debug, PartialEq)]
struct Spline {
    log_loads: Vec<f64>,
    twists_rad: Vec<f64>,
    /// Gap (m) and its second derivative by the twist, for each load.
    rows: Vec<(Vec<f64>, Vec<f64>)>,
}

impl Measured {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// [`SurfaceError`] naming the column, the line or the point.
    pub fn parse(text: &str) -> Result<Self, SurfaceError> {
        let mut grids = [Grid::new(), Grid::new()];
        let directed = read(text, None, &mut grids)?;
        Self::of(&grids, directed)
    }

    /// Reads the texts of two files: the twist growing, and falling. The place in the error is 0 or 1, the file's.
    ///
    /// # Errors
    /// As [`Measured::parse`], with the file where it is one of them.
    pub fn parse_two(texts: [&str; 2]) -> Result<Self, (usize, SurfaceError)> {
        let mut grids = [Grid::new(), Grid::new()];
        for (way, text) in texts.into_iter().enumerate() {
            read(text, Some(way), &mut grids).map_err(|error| (way, error))?;
        }
        Self::of(&grids, true).map_err(|error| (0, error))
    }

    fn of([up, down]: &[Grid; 2], directed: bool) -> Result<Self, SurfaceError> {
        let keys = || up.keys().chain(down.keys());
        let loads: Vec<u64> = keys().map(|key| key.0).collect::<BTreeSet<_>>().into_iter().collect();
        let twists: Vec<u64> = keys().map(|key| key.1).collect::<BTreeSet<_>>().into_iter().collect();
        for (what, found) in [("load_n", loads.len()), ("twist_rad", twists.len())] {
            if found < MIN {
                return Err(SurfaceError::Few { what, found });
            }
        }
        let twists_rad: Vec<f64> = twists.iter().map(|bits| f64::from_bits(*bits)).collect();
        let last_rad = twists_rad[twists.len() - 1];
        if last_rad < MIN_TWIST_RAD {
            return Err(SurfaceError::Short(last_rad));
        }
        for (way, grid) in [up, down].into_iter().enumerate() {
            for key in loads.iter().flat_map(|load| twists.iter().map(move |twist| (*load, *twist))) {
                if !grid.contains_key(&key) {
                    return Err(point(key, directed, way, "missing"));
                }
            }
        }
        let spline = |down_fraction: f64| {
            let row = |load: &u64| {
                let gap = |twist: &u64| 0.5 * (up[&(*load, *twist)] + down_fraction * down[&(*load, *twist)]);
                let gaps: Vec<f64> = twists.iter().map(gap).collect();
                let bends = second_derivatives(&twists_rad, &gaps);
                (gaps, bends)
            };
            let log_loads = loads.iter().map(|bits| f64::from_bits(*bits).ln()).collect();
            Spline { log_loads, twists_rad: twists_rad.clone(), rows: loads.iter().map(row).collect() }
        };
        let mean = spline(1.0);
        for (k, twist_rad) in twists_rad.iter().enumerate() {
            if let Some(i) = mean.rows.windows(2).position(|pair| pair[1].0[k] <= pair[0].0[k]) {
                let loads_n = [mean.log_loads[i].exp(), mean.log_loads[i + 1].exp()];
                return Err(SurfaceError::Falls { loads_n, twist_rad: *twist_rad });
            }
        }
        Ok(Self { mean, half_difference: directed.then(|| spline(-1.0)) })
    }

    /// Maximum load of the data, N.
    pub fn max_load_n(&self) -> f64 {
        self.mean.log_loads.last().map_or(0.0, |log| log.exp())
    }

    /// Half of what the gap differs by between a twist that grows and one that falls, m.
    pub fn half_difference_m(&self, twist_rad: f64, load_n: f64) -> f64 {
        let Some(spline) = &self.half_difference else { return 0.0 };
        let [first, last] = ends(&spline.twists_rad);
        spline.at(twist_rad.abs().clamp(first, last), load_n)[0]
    }

    /// The mean of both ways at a twist of at least 0 rad and a load in N; `None` past the data.
    pub fn gap(&self, twist_rad: f64, load_n: f64) -> Option<GapPoint> {
        let [first, last] = ends(&self.mean.twists_rad);
        if twist_rad > last || load_n <= 0.0 {
            return None;
        }
        let [gap, by_twist, by_log] = self.mean.at(twist_rad.max(first), load_n);
        // Below the data: level at zero twist, and as steep as the data where they begin.
        let below = if twist_rad < first { by_twist / (2.0 * first) } else { 0.0 };
        Some(GapPoint {
            gap_m: gap - below * (first * first - twist_rad * twist_rad),
            by_twist_m_per_rad: if twist_rad < first { 2.0 * below * twist_rad } else { by_twist },
            by_load_m_per_n: by_log / load_n,
        })
    }
}

/// The first and the last of places in their order.
fn ends(places: &[f64]) -> [f64; 2] {
    [places[0], places[places.len() - 1]]
}

/// Reads a file's points into the grids of both ways; with a way, into that one alone. Returns whether they differ.
fn read(text: &str, way: Option<usize>, grids: &mut [Grid; 2]) -> Result<bool, SurfaceError> {
    const COLUMNS: [&str; 3] = ["load_n", "twist_rad", "gap_m"];
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let head: Vec<&str> = lines.next().map_or(Vec::new(), |(_, line)| line.split(',').map(str::trim).collect());
    let column = |name: &'static str| head.iter().position(|c| *c == name).ok_or(SurfaceError::Column(name));
    let [load, twist, gap] = COLUMNS.map(column);
    let columns = [load?, twist?, gap?];
    let direction = column("direction").ok();
    if direction.is_some() && way.is_some() {
        return Err(SurfaceError::TwoDirections);
    }
    let directed = direction.is_some() || way.is_some();
    for (index, line) in lines {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let cell = |at: usize| cells.get(at).copied().unwrap_or_default();
        let wrong =
            |column, text: &str, reason| SurfaceError::Cell { line: index + 1, column, text: text.into(), reason };
        let mut numbers = [0f64; 3];
        for ((number, at), name) in numbers.iter_mut().zip(columns).zip(COLUMNS) {
            *number = cell(at).parse().map_err(|_| wrong(name, cell(at), "is no number"))?;
            let good = number.is_finite() && (name == "gap_m" || *number >= 0.0) && (name != "load_n" || *number > 0.0);
            if !good {
                return Err(wrong(name, cell(at), "must be finite; a load above 0, a twist at least 0"));
            }
        }
        let ways = match (way, direction.map(cell)) {
            (Some(way), _) => way..way + 1,
            (None, None) => 0..2,
            (None, Some("up")) => 0..1,
            (None, Some("down")) => 1..2,
            (None, Some(text)) => return Err(wrong("direction", text, "is neither `up` nor `down`")),
        };
        // The bits of numbers that are not negative are ordered as the numbers are.
        let key = (numbers[0].to_bits(), numbers[1].to_bits());
        for way in ways {
            if grids[way].insert(key, numbers[2]).is_some() {
                return Err(point(key, directed, way, "given twice"));
            }
        }
    }
    Ok(directed)
}

fn point((load, twist): (u64, u64), has_directions: bool, way: usize, reason: &'static str) -> SurfaceError {
    let direction = if has_directions { [" (up)", " (down)"][way] } else { "" };
    SurfaceError::Grid { load_n: f64::from_bits(load), twist_rad: f64::from_bits(twist), direction, reason }
}

/// The part of measured gaps that differs by the way of the twist.
#[derive(Clone, Debug)]
pub struct TwoWays {
    data: Measured,
    last_rad: f64,
    /// How far the twist has gone on, at most half of [`TURN_BACK_RAD`] either way, rad.
    gone_rad: f64,
}

impl TwoWays {
    /// From a twist (rad), in the middle between the ways; `None` where the data do not tell them apart.
    pub fn new(data: &Measured, twist_rad: f64) -> Option<Self> {
        data.half_difference.as_ref()?;
        Some(Self { data: data.clone(), last_rad: twist_rad.abs(), gone_rad: 0.0 })
    }

    /// Takes the twist to a new value (rad) and returns what its way adds to the mean gap under a load (N), m.
    pub fn shift_m(&mut self, twist_rad: f64, load_n: f64) -> f64 {
        let half = 0.5 * TURN_BACK_RAD;
        self.gone_rad = (self.gone_rad + twist_rad.abs() - self.last_rad).clamp(-half, half);
        self.last_rad = twist_rad.abs();
        self.gone_rad / half * self.data.half_difference_m(twist_rad, load_n.max(1e-3))
    }
}

impl Spline {
    /// Gap (m), ∂G/∂θ (m/rad) and ∂G/∂ln F (m) at a twist within the data.
    fn at(&self, twist_rad: f64, load_n: f64) -> [f64; 3] {
        let values: Vec<[f64; 2]> =
            self.rows.iter().map(|(gaps, bends)| cubic(&self.twists_rad, gaps, bends, twist_rad)).collect();
        let along = |k: usize| {
            let column: Vec<f64> = values.iter().map(|v| v[k]).collect();
            let bends = second_derivatives(&self.log_loads, &column);
            let log = load_n.ln();
            let [low, high] = ends(&self.log_loads);
            let inside = log.clamp(low, high);
            let [value, slope] = cubic(&self.log_loads, &column, &bends, inside);
            [value + slope * (log - inside), slope]
        };
        let [gap, by_log] = along(0);
        [gap, along(1)[0], by_log]
    }
}

/// Second derivatives of the natural cubic spline through points.
fn second_derivatives(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    let mut bends = vec![0.0; n];
    // Thomas' algorithm on the tridiagonal system of the inner points.
    let (mut upper, mut right) = (vec![0.0; n], vec![0.0; n]);
    for i in 1..n - 1 {
        let (before, after) = (x[i] - x[i - 1], x[i + 1] - x[i]);
        let wanted = 6.0 * ((y[i + 1] - y[i]) / after - (y[i] - y[i - 1]) / before);
        let pivot = 2.0 * (before + after) - before * upper[i - 1];
        upper[i] = after / pivot;
        right[i] = (wanted - before * right[i - 1]) / pivot;
    }
    for i in (1..n - 1).rev() {
        bends[i] = right[i] - upper[i] * bends[i + 1];
    }
    bends
}

/// Value and slope of a cubic spline at a place within its points.
fn cubic(x: &[f64], y: &[f64], bends: &[f64], at: f64) -> [f64; 2] {
    let i = x.partition_point(|x| *x <= at).clamp(1, x.len() - 1) - 1;
    let h = x[i + 1] - x[i];
    let (b, a) = ((at - x[i]) / h, (x[i + 1] - at) / h);
    let value = a * y[i] + b * y[i + 1] + h * h / 6.0 * ((a * a * a - a) * bends[i] + (b * b * b - b) * bends[i + 1]);
    let slope = (y[i + 1] - y[i]) / h + h / 6.0 * ((1.0 - 3.0 * a * a) * bends[i] + (3.0 * b * b - 1.0) * bends[i + 1]);
    [value, slope]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;

    /// A smooth surface: falls as θ², rises as ln F.
    fn gap(load_n: f64, twist_rad: f64) -> f64 {
        0.1 + 3e-3 * load_n.ln() - 4e-6 * twist_rad * twist_rad
    }

    fn file(shift_m: &[(&str, f64)]) -> String {
        let mut text = String::from("# measured\nload_n, twist_rad, gap_m, direction\n");
        for load_n in [0.5, 1.0, 2.0, 4.0, 8.0, 16.0] {
            for k in 0..=40 {
                let twist_rad = 3.0 + f64::from(k);
                for (direction, shift_m) in shift_m {
                    let gap_m = gap(load_n, twist_rad) + shift_m;
                    let _ = writeln!(text, "{load_n}, {twist_rad}, {gap_m}, {direction}");
                }
            }
        }
        text
    }

    #[test]
    fn a_smooth_surface_comes_back_with_its_slopes() {
        let surface = Measured::parse(&file(&[("up", 0.0), ("down", 0.0)])).unwrap();
        for (load_n, twist_rad) in [(0.7, 5.3), (3.0, 20.4), (12.0, 41.7)] {
            let point = surface.gap(twist_rad, load_n).unwrap();
            assert!((point.gap_m - gap(load_n, twist_rad)).abs() < 2e-7, "{point:?}");
            assert!((point.by_twist_m_per_rad + 8e-6 * twist_rad).abs() < 3e-6, "{point:?}");
            assert!((point.by_load_m_per_n * load_n / 3e-3 - 1.0).abs() < 1e-3, "{point:?}");
        }
        assert_eq!(surface.gap(44.0, 1.0), None, "past the data");
    }

    #[test]
    fn below_the_data_it_is_even_and_level_at_zero_twist() {
        let surface = Measured::parse(&file(&[("up", 0.0), ("down", 0.0)])).unwrap();
        let [zero, near] = [0.0, 1e-3].map(|twist| surface.gap(twist, 2.0).unwrap());
        assert_eq!(zero.by_twist_m_per_rad, 0.0);
        assert!((zero.gap_m - near.gap_m).abs() < 1e-10);
        let (before, after) = (surface.gap(3.0 - 1e-9, 2.0).unwrap(), surface.gap(3.0, 2.0).unwrap());
        assert!((before.gap_m - after.gap_m).abs() < 1e-12);
        assert!((before.by_twist_m_per_rad - after.by_twist_m_per_rad).abs() < 1e-9);
    }

    #[test]
    fn two_directions_are_told_apart() {
        let surface = Measured::parse(&file(&[("up", 1e-4), ("down", -1e-4)])).unwrap();
        assert!((surface.half_difference_m(10.0, 2.0) - 1e-4).abs() < 1e-12);
        assert!((surface.half_difference_m(-10.0, 2.0) - 1e-4).abs() < 1e-12, "either way of twisting");
        let one = Measured::parse(&file(&[("up", 0.0), ("down", 0.0)])).unwrap();
        assert!((one.gap(10.0, 2.0).unwrap().gap_m - surface.gap(10.0, 2.0).unwrap().gap_m).abs() < 1e-12);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let good = file(&[("up", 0.0), ("down", 0.0)]);
        for (text, said) in [
            (String::new(), "no column `load_n`"),
            (good.replacen("gap_m", "gap", 1), "no column `gap_m`"),
            (good.replacen("0.5, 3, ", "0.5, x, ", 1), "line 3, column `twist_rad`: `x` is no number"),
            (good.replacen("0.5, 3, ", "-0.5, 3, ", 1), "column `load_n`: `-0.5` must be finite"),
            (good.replacen(", up", ", sideways", 1), "`sideways` is neither `up` nor `down`"),
            (good.replacen("0.5, 4, ", "0.5, 3, ", 1), "load_n = 0.5, twist_rad = 3 (up): given twice"),
            (
                good.lines().filter(|l| !l.starts_with("2, 7,")).collect::<Vec<_>>().join("\n"),
                "twist_rad = 7 (up): missing",
            ),
            ("load_n,twist_rad,gap_m\n1,1,0.1\n1,2,0.1\n".into(), "1 values of load_n"),
            (good.replacen("1, 3, 0.09", "1, 3, 0.02", 2), "the gap falls from"),
        ] {
            let error = Measured::parse(&text).unwrap_err().to_string();
            assert!(error.contains(said), "{said}: {error}");
        }
    }
}
