//! A recorded sweep reduced to equilibria, to which constants are fitted.
//!
//! The load moves slowly, so each row is an equilibrium but for two effects that depend on the direction: rail friction and
//! the age of the gap. The mean of the way up and the way down at the same twist is free of both.

use super::{Log, Mark, SETTINGS};
use crate::session::row::Row;
use rig_link::{Setting, State};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Rows within this much twist (turns) are averaged: over it the gap deviates from a line by less than a micrometre.
const BIN_TURNS: f64 = 0.1;
/// Minimum rows of a bin in either direction: fewer come from where the motor was starting or stopping.
const MIN_ROWS: u32 = 5;

/// Largest difference of the mean twists of both directions (rad): it is larger where one way began or ended within the
/// bin, so that the two means are not at the same place.
const SAME_RAD: f64 = 0.05 * BIN_TURNS * TAU;

/// How far the load must move (m) before its rows count: until the strings have overcome friction it stands still, and their
/// tension is anywhere between the values of the two directions.
const MOVED_M: f64 = 0.1e-3;

/// One equilibrium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// Twist (rad).
    pub twist_rad: f64,
    /// How far the load has come up since the half-turn pre-twist, from an unknown zero (m).
    pub position_m: f64,
    /// Half the difference between the way up and the way down (m): the effect of friction.
    pub half_difference_m: f64,
}

#[derive(Default, Clone, Copy)]
struct Sums {
    count: u32,
    twist: f64,
    position: f64,
}

/// A sweep by its equilibria.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// The load that hung (N).
    pub load_n: f64,
    /// Heavier load that the rods had just carried (N), if so.
    pub after_n: Option<f64>,
    /// Gap that the LVDT showed at position zero (m); none in older logs.
    pub zero_gap_m: Option<f64>,
    /// In order of twist.
    pub stops: Vec<Stop>,
}

/// A number of the header; none if it is not there.
fn number(log: &Log, key: &str) -> Result<Option<f64>, String> {
    let parse = |text: &str| {
        let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| format!("{key} `{text}` is not a number"))
    };
    log.header.get(key).map(parse).transpose()
}

/// The gap at position zero, by the log's last homing and its settings (m).
fn zero_gap_m(log: &Log) -> Result<Option<f64>, String> {
    let homed = log.marks.iter().rev().find_map(|marked| match marked.mark {
        Mark::Homed(found) => Some(f64::from(found.reference_gap_m)),
        _ => None,
    });
    let Some(homed) = homed else { return Ok(None) };
    let zero = number(log, &format!("{SETTINGS}{}", Setting::PositionZero.name()))?;
    Ok(Some(homed - zero.unwrap_or(0.0)))
}

/// The load that hung, and the equilibria.
///
/// # Errors
/// In words, if the log is not one of a sweep, or has one direction only.
pub fn reduce(log: &Log) -> Result<Sweep, String> {
    let load_n = number(log, "sweep.load_n")?.ok_or("is a log, but not of `rigctl sweep`: nobody weighed its load")?;
    let after_n = number(log, "sweep.after_n")?;
    let mut bins: BTreeMap<i64, [Sums; 2]> = BTreeMap::new();
    let moving = |row: &Row| {
        let (twist_rad, position_m) = row.twist_rad.zip(row.position_m).filter(|_| row.state == State::Moving)?;
        Some((f64::from(twist_rad), f64::from(position_m)))
    };
    // Where the load stood when the way began, until it has moved away from there.
    let mut stood_m: Option<f64> = None;
    for pair in log.rows.windows(2) {
        let Some((twist, position)) = moving(&pair[1]) else { continue };
        let Some((before, _)) = moving(&pair[0]) else {
            stood_m = Some(position);
            continue;
        };
        if stood_m.is_some_and(|stood_m| (position - stood_m).abs() < MOVED_M) {
            continue;
        }
        stood_m = None;
        let sums = &mut bins.entry((twist / TAU / BIN_TURNS).floor() as i64).or_default()[usize::from(twist < before)];
        sums.count += 1;
        sums.twist += twist;
        sums.position += position;
    }
    let mean = |s: &Sums| {
        let count = f64::from(s.count);
        (s.twist / count, s.position / count)
    };
    let both = bins.values().filter(|ways| ways.iter().all(|s| s.count >= MIN_ROWS));
    let stops: Vec<Stop> = both
        .map(|[up, down]| (mean(up), mean(down)))
        .filter(|((twist_up, _), (twist_down, _))| (twist_up - twist_down).abs() < SAME_RAD)
        .map(|((twist_up, up), (twist_down, down))| Stop {
            twist_rad: 0.5 * (twist_up + twist_down),
            position_m: 0.5 * (up + down),
            half_difference_m: 0.5 * (down - up),
        })
        .collect();
    if stops.is_empty() {
        return Err("has no twist that was passed both up and down".into());
    }
    Ok(Sweep { load_n, after_n, zero_gap_m: zero_gap_m(log)?, stops })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One equilibrium, passed up and down.
    const LOG: &str = include_str!("sweep.log");

    fn reduced(from: &str, to: &str) -> Result<Sweep, String> {
        assert!(LOG.contains(from));
        reduce(&Log::parse(&LOG.replacen(from, to, 1))?)
    }

    #[test]
    fn the_gap_at_position_zero_is_that_of_homing_and_settings() {
        let sweep = reduced("", "").expect("a sweep");
        assert_eq!((sweep.load_n, sweep.after_n, sweep.stops.len()), (5.0, None, 1));
        assert!(sweep.zero_gap_m.is_some_and(|gap_m| (gap_m - 0.099).abs() < 1e-6), "{:?}", sweep.zero_gap_m);
    }

    #[test]
    fn what_is_no_number_is_named() {
        for (from, to, named) in [
            ("sweep.load_n = 5", "sweep.load_n = inf", "sweep.load_n `inf`"),
            ("sweep.load_n = 5", "sweep.load_n = 5\n# sweep.after_n = nan", "sweep.after_n `nan`"),
            ("position-zero = 0.001", "position-zero = inf", "settings.position-zero `inf`"),
            ("position-zero = 0.001", "position-zero = x", "settings.position-zero `x`"),
            ("\"reference_gap_m\":0.1", "\"reference_gap_m\":1e39", "event homed"),
        ] {
            let error = reduced(from, to).expect_err(to);
            assert!(error.contains(named), "{to}: {error}");
        }
    }
}
