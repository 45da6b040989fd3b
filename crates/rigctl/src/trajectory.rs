//! A trajectory of the load over time, which is streamed to the board as set-points.

use crate::csv_text::{Table, columns};
use crate::failure::Failure;
use rig_link::Request;
use std::path::Path;

/// Time between two set-points of a stream (s).
pub const EVERY_S: f64 = 0.02;
/// How long the board goes on without the next one (s): a busy computer and its serial line may keep one back, and a person
/// beside the rig does not wait long.
pub const HOLDS_FOR_S: f32 = 0.2;

/// Longest trajectory (s), maximum position (m) and speed (m/s) that are taken for a rig's: beyond them a unit is wrong, and
/// set-points between two points could be more than a number of the link can hold.
const LONGEST_S: f64 = 1e6;
const MAX_M: f64 = 10.0;
const MAX_M_PER_S: f64 = 100.0;
/// Column of the speeds, if there is one.
const SPEED: &str = "speed_m_per_s";

/// One point of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryPoint {
    /// Line of its file, or its place in the lists that it comes from.
    pub row: usize,
    /// Time since the beginning (s).
    pub t_s: f64,
    /// Position (m).
    pub position_m: f64,
    /// Speed (m/s).
    pub speed_m_per_s: f64,
}

/// A trajectory: at least two points in order of time. Between them the position is the cubic that has both their speeds.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory(Vec<TrajectoryPoint>);

impl Trajectory {
    /// Reads a file with the columns `t_s`, `position_m` and, if it likes, `speed_m_per_s`.
    ///
    /// # Errors
    /// Naming file and line.
    pub fn load(path: &Path) -> Result<Self, Failure> {
        let text = rig_config::files::read_to_string(path).map_err(|e| e.to_string());
        text.and_then(|text| Self::parse(&text))
            .map_err(|e| Failure::failed(format!("trajectory file {}: {e}", path.display())))
    }

    /// The same of a text.
    ///
    /// # Errors
    /// Naming the line.
    pub fn parse(text: &str) -> Result<Self, String> {
        let table = Table::parse(text)?;
        let has_speed = table.has(SPEED);
        if let Some(name) = table.names.1.iter().find(|name| name.starts_with("speed") && *name != SPEED) {
            return Err(format!("has a column `{name}`: speeds are in a column `{SPEED}`"));
        }
        let mut points: Vec<(usize, [f64; 3])> = Vec::new();
        if has_speed {
            for (line, row) in columns(text, ["t_s", "position_m", SPEED])? {
                points.push((line, row?));
            }
        } else {
            for (line, row) in columns(text, ["t_s", "position_m"])? {
                let [t_s, position_m] = row?;
                points.push((line, [t_s, position_m, f64::NAN]));
            }
        }
        if let Some(pair) = points.windows(2).find(|pair| pair[1].1[0] <= pair[0].1[0]) {
            let (line, [t_s, ..]) = pair[1];
            return Err(format!("line {line}: t_s {t_s} is not later than {} in the line before", pair[0].1[0]));
        }
        let column = |k: usize| points.iter().map(|(_, row)| row[k]).collect::<Vec<f64>>();
        let made = Self::through(&column(0), &column(1), has_speed.then(|| column(2)).as_deref());
        let mut trajectory = made.map_err(|(point, why)| match point.and_then(|k| points.get(k)) {
            Some((line, _)) => format!("line {line}: {why}"),
            None => why,
        })?;
        for (point, (line, _)) in trajectory.0.iter_mut().zip(&points) {
            point.row = *line;
        }
        Ok(trajectory)
    }

    /// Through positions (m) at times (s), with these speeds (m/s). Without speeds it begins and ends at rest, and has the mean
    /// slope to both neighbours between.
    ///
    /// # Errors
    /// Naming what is wrong: fewer than two points, numbers that are not finite or that no rig can have, times that do not
    /// grow, lists of unlike lengths.
    pub fn new(times_s: &[f64], positions_m: &[f64], speeds_m_per_s: Option<&[f64]>) -> Result<Self, String> {
        Self::through(times_s, positions_m, speeds_m_per_s).map_err(|(point, why)| match point {
            Some(k) => format!("point {k}: {why}"),
            None => why,
        })
    }

    /// The same; an error has the point that is wrong, if it is one.
    fn through(
        times_s: &[f64],
        positions_m: &[f64],
        speeds_m_per_s: Option<&[f64]>,
    ) -> Result<Self, (Option<usize>, String)> {
        let count = times_s.len();
        if count < 2 {
            return Err((None, format!("a trajectory has at least 2 points, this one has {count}")));
        }
        if positions_m.len() != count || speeds_m_per_s.is_some_and(|speeds| speeds.len() != count) {
            let speeds = speeds_m_per_s.map_or(String::new(), |speeds| format!(" and {} speeds", speeds.len()));
            let why = format!("{count} times, {} positions{speeds}: they must be as many", positions_m.len());
            return Err((None, why));
        }
        // Before speeds are made of them, so that the number itself is named.
        for k in 0..count {
            let speed = speeds_m_per_s.map_or(0.0, |speeds| speeds[k]);
            for (name, value) in [("time", times_s[k]), ("position", positions_m[k]), ("speed", speed)] {
                if !value.is_finite() {
                    return Err((Some(k), format!("its {name} must be a finite number, and is {value}")));
                }
            }
        }
        let slope = |k: usize| match speeds_m_per_s {
            Some(speeds) => speeds[k],
            None if k == 0 || k + 1 == count => 0.0,
            None => (positions_m[k + 1] - positions_m[k - 1]) / (times_s[k + 1] - times_s[k - 1]),
        };
        let points: Vec<TrajectoryPoint> = (0..count)
            .map(|k| TrajectoryPoint {
                row: k,
                t_s: times_s[k] - times_s[0],
                position_m: positions_m[k],
                speed_m_per_s: slope(k),
            })
            .collect();
        for (k, p) in points.iter().enumerate() {
            let later = k == 0 || p.t_s > points[k - 1].t_s;
            if !later {
                return Err((Some(k), format!("its time, {} s, is not later than the one before", times_s[k])));
            }
            for (name, value, max, unit) in [
                ("time", p.t_s, LONGEST_S, "s"),
                ("position", p.position_m, MAX_M, "m"),
                ("speed", p.speed_m_per_s, MAX_M_PER_S, "m/s"),
            ] {
                if value.abs() > max {
                    return Err((Some(k), format!("its {name} is {value} {unit}, more than {max} {unit}")));
                }
            }
        }
        Ok(Self(points))
    }

    /// How long it takes (s).
    pub fn duration_s(&self) -> f64 {
        self.0[self.0.len() - 1].t_s
    }

    /// Where it begins (m).
    pub fn start_m(&self) -> f64 {
        self.0[0].position_m
    }

    /// Position (m) and speed (m/s) at a time (s); at its ends before and after.
    pub fn at(&self, t_s: f64) -> (f64, f64) {
        let next = self.0.partition_point(|p| p.t_s <= t_s);
        if next == 0 {
            return (self.start_m(), 0.0);
        }
        let Some(b) = self.0.get(next) else {
            return (self.0[next - 1].position_m, 0.0);
        };
        let a = &self.0[next - 1];
        let width_s = b.t_s - a.t_s;
        let x = (t_s - a.t_s) / width_s;
        let rise = b.position_m - a.position_m;
        // Hermite: values and slopes at both ends.
        let [va, vb] = [a.speed_m_per_s * width_s, b.speed_m_per_s * width_s];
        let (two, three) = (va + vb - 2.0 * rise, 3.0 * rise - 2.0 * va - vb);
        let position_m = a.position_m + x * (va + x * (three + x * two));
        (position_m, (va + x * (2.0 * three + 3.0 * x * two)) / width_s)
    }

    /// Its points and four more on the way to each, with their accelerations (m/s²), before and after each point. One between two
    /// rows belongs to the second.
    pub fn samples(&self) -> impl Iterator<Item = (TrajectoryPoint, f64)> + '_ {
        self.0.windows(2).flat_map(move |pair| {
            let (a, b) = (pair[0], pair[1]);
            let width_s = b.t_s - a.t_s;
            // The acceleration changes evenly between two points, and jumps at one.
            let first = 2.0 * (3.0 * (b.position_m - a.position_m) / width_s - 2.0 * a.speed_m_per_s - b.speed_m_per_s);
            let last = 2.0 * (b.speed_m_per_s - a.speed_m_per_s) - first;
            [0, 5, 1, 2, 3, 4].into_iter().map(move |step| {
                let x = 0.2 * f64::from(step);
                let row = if step == 0 { a.row } else { b.row };
                let t_s = a.t_s + x * width_s;
                let (position_m, speed_m_per_s) = match step {
                    0 => (a.position_m, a.speed_m_per_s),
                    5 => (b.position_m, b.speed_m_per_s),
                    _ => self.at(t_s),
                };
                (TrajectoryPoint { row, t_s, position_m, speed_m_per_s }, (first + x * (last - first)) / width_s)
            })
        })
    }

    /// The set-points of the whole trajectory, each with its time (s).
    pub fn set_points(&self) -> impl Iterator<Item = (f64, Request)> + '_ {
        let count = (self.duration_s() / EVERY_S).ceil() as u32;
        (0..=count).map(move |k| {
            let t_s = (EVERY_S * f64::from(k)).min(self.duration_s());
            let (position_m, speed_m_per_s) = self.at(t_s);
            let speed_m_per_s = if k == count { 0.0 } else { speed_m_per_s };
            let request = Request::Track {
                position_m: position_m as f32,
                speed_m_per_s: speed_m_per_s as f32,
                for_s: HOLDS_FOR_S,
            };
            (t_s, request)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trajectory_goes_through_its_points_with_its_speeds() {
        let trajectory = Trajectory::parse("t_s,position_m,speed_m_per_s\n1,0.001,0\n1.5,0.002,0.004\n3,0.002,0\n")
            .unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((trajectory.duration_s(), trajectory.start_m()), (2.0, 0.001));
        assert_eq!((trajectory.at(-1.0), trajectory.at(9.0)), ((0.001, 0.0), (0.002, 0.0)));
        let (position_m, speed_m_per_s) = trajectory.at(0.5);
        assert!((position_m - 0.002).abs() < 1e-12 && (speed_m_per_s - 0.004).abs() < 1e-12);
        // The speed is the slope of the position.
        for k in 1..39 {
            let t_s = 0.05 * f64::from(k) + 0.01;
            let slope = (trajectory.at(t_s + 1e-6).0 - trajectory.at(t_s - 1e-6).0) / 2e-6;
            assert!((slope - trajectory.at(t_s).1).abs() < 1e-7, "{t_s}");
        }
        let points: Vec<_> = trajectory.set_points().collect();
        assert_eq!(points.len(), 101);
        let last = Request::Track { position_m: 0.002, speed_m_per_s: 0.0, for_s: HOLDS_FOR_S };
        assert_eq!(points[100], (2.0, last));
    }

    #[test]
    fn without_speeds_it_begins_and_ends_at_rest() {
        let trajectory =
            Trajectory::new(&[0.0, 1.0, 2.0], &[0.0, 0.002, 0.002], None).unwrap_or_else(|e| panic!("{e}"));
        let speeds = [0.0, 1.0, 2.0].map(|t_s| trajectory.at(t_s).1);
        assert_eq!(speeds, [0.0, 0.001, 0.0]);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, named) in [
            ("t_s,position_m\n0,0.001\n", "at least 2"),
            ("t_s,position_m\n0,0.001\n0,0.002\n", "line 3"),
            ("t_s,position_m\n0,0.001\n1,x\n", "line 3"),
            ("t_s,position_m\n0,0.001\n1,0.002\n2,0.002\n3,nan\n", "line 5: its position"),
            ("t_s,position_m\n0,0.001\n1,12\n", "line 3: its position"),
            ("t_s,height\n0,0.001\n1,0\n", "position_m"),
            ("t_s,position_m,speed_mm_s\n0,0.001,1\n1,0.002,1\n", "`speed_mm_s`"),
            ("t_s,position_m,speed_m_per_s,speed_m_per_s\n0,0.001,0,0\n1,0.002,0,0\n", "two columns"),
        ] {
            let error = Trajectory::parse(text).expect_err(text);
            assert!(error.contains(named), "{text:?}: {error}");
        }
        assert!(Trajectory::new(&[0.0, 1.0], &[0.0], None).is_err_and(|e| e.contains("2 times, 1 positions")));
        assert!(Trajectory::new(&[0.0, 1.0], &[0.0, f64::INFINITY], None).is_err_and(|e| e.contains("point 1")));
        // Finite numbers that no single-precision set-point can have.
        for (times_s, positions_m, speeds_m_per_s, named) in [
            ([0.0, 1.0], [0.0, 1e300], [0.0; 2], "point 1: its position"),
            ([0.0, 1.0], [0.0, 0.01], [0.0, -1e39], "point 1: its speed"),
            ([0.0, 1e39], [0.0, 0.01], [0.0, 0.01], "point 1: its time"),
        ] {
            let error = Trajectory::new(&times_s, &positions_m, Some(&speeds_m_per_s)).expect_err(named);
            assert!(error.contains(named), "{error}");
        }
    }
}
