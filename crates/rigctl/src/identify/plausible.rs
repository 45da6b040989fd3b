//! What may be wrong with a recorded sweep: numbers that no rig can give, and units that fit better.

use super::data::{Data, Quantity, Row};
use crate::statistics::{mean, rms};
use crate::units::{MM, N, TURNS_OF_RAD};
use rig_config::Scene;
use rig_plant::units::STANDARD_GRAVITY as GRAVITY;
use std::f64::consts::TAU;
use std::ops::Range;
use tsa_model::{Mechanism, PRETWIST_RAD};

/// A length must change by this many standard deviations over a sweep before its direction is judged.
const CLEAR: f64 = 20.0;
/// Minimum twist (rad) over which a direction is judged.
const MIN_RAD: f64 = 0.5 * TAU;
/// Another unit is suggested if the scene's numbers come nearer by this factor with it: constants that are to be fitted are
/// off by tens of per cent, wrong units by more.
const NEARER: f64 = 3.0;

/// Maximum rows of a file that are examined for its units, and most loads for the direction of its lengths: some suffice.
const LOOKED_AT: usize = 12;
const LOADS: usize = 200;

/// Wrong readings of a sweep: the words for each, and its factors of loads and of lengths.
const READINGS: [(&str, f64, f64); 7] = [
    ("load_n taken as kg", GRAVITY, 1.0),
    ("load_n taken as g", 1e-3 * GRAVITY, 1.0),
    ("lengths taken as mm", 1.0, 1e-3),
    ("the opposite sign of the lengths", 1.0, -1.0),
    ("load_n taken as kg and lengths as mm", GRAVITY, 1e-3),
    ("load_n taken as kg and the opposite sign of the lengths", GRAVITY, -1.0),
    ("load_n taken as kg and lengths as mm of the opposite sign", GRAVITY, -1e-3),
];

/// The column that a row's length stands in.
fn column(row: &Row) -> &'static str {
    if row.quantity == Quantity::Gap { "gap_m" } else { "contraction_m" }
}

/// How far the strings have shortened, up to a constant for each sweep (m).
fn rise(row: &Row) -> f64 {
    if row.quantity == Quantity::Gap { -row.value } else { row.value }
}

/// What sweeps that a rig can have given suggest of their units.
///
/// # Errors
/// In words, naming the file, if no rig can have given them or a unit is wrong.
pub fn checked(data: &Data, scene: &Scene) -> Result<Vec<Hint>, String> {
    let hints = match impossible(data, scene.geometry.string_length_m) {
        Some(why) => return Err(why),
        None => likely(data, scene),
    };
    wrong_unit(&hints, data).map_or(Ok(hints), Err)
}

/// Why no rig with strings of this length can have given these sweeps, whatever its constants; names the file.
fn impossible(data: &Data, string_length_m: f64) -> Option<String> {
    data.files.iter().find_map(|(name, rows)| {
        let rows = data.rows.get(rows.clone())?;
        let what = too_long(rows, string_length_m).or_else(|| wrong_way(rows))?;
        Some(format!("sweep {name}: {what}"))
    })
}

/// Strings cannot shorten by more than they are long. The middle half of the rows is judged: one wild row must not suggest a
/// wrong unit.
fn too_long(rows: &[Row], string_length_m: f64) -> Option<String> {
    let mut rises: Vec<f64> = rows.iter().map(rise).collect();
    rises.sort_by(f64::total_cmp);
    let quarter = rises.len() / 4;
    let apart = rises.get(rises.len().checked_sub(1 + quarter)?)? - rises.get(quarter)?;
    (apart > string_length_m).then(|| {
        let hint = if 1e-3 * apart <= string_length_m { ": is it in mm?" } else { "" };
        format!(
            "{} changes by {} in the middle half of the rows, and the strings are {} long{hint}",
            column(&rows[0]),
            MM.show(apart),
            MM.exact(string_length_m)
        )
    })
}

/// Twisting shortens the strings at every load. The loads are those that a person hung on the rail, so they are few; of more
/// than that only the first are looked at.
fn wrong_way(rows: &[Row]) -> Option<String> {
    let mut by_load: Vec<Vec<&Row>> = Vec::new();
    for row in rows {
        match by_load.iter().position(|same| same[0].load_n == row.load_n) {
            Some(k) => by_load[k].push(row),
            None if by_load.len() < LOADS => by_load.push(vec![row]),
            None => {}
        }
    }
    by_load.iter().find_map(|same| {
        let first = same.first()?;
        let twist = |r: &Row| r.twist_rad.abs();
        let by_twist = |a: &&&Row, b: &&&Row| twist(a).total_cmp(&twist(b));
        let (low, high) = (same.iter().min_by(by_twist)?, same.iter().max_by(by_twist)?);
        let over = |f: &dyn Fn(&Row) -> f64| mean(&same.iter().map(|r| f(r)).collect::<Vec<_>>());
        let (mean_twist, mean_rise) = (over(&twist), over(&rise));
        let together = over(&|r| (twist(r) - mean_twist) * (rise(r) - mean_rise));
        let span_rad = twist(high) - twist(low);
        // Ends and slope have to agree: one wild row must not suggest a wrong sign.
        let falls_m = rise(low) - rise(high);
        if span_rad < MIN_RAD || together >= 0.0 || falls_m < CLEAR * first.sigma {
            return None;
        }
        let (name, does, other) = match first.quantity {
            Quantity::Gap => ("gap_m", "grows", "a contraction (contraction_m)"),
            _ => ("contraction_m", "falls", "a gap (gap_m)"),
        };
        Some(format!(
            "{name} {does} by {} while the strings are twisted by {} under {}, and twisting lifts the load: is its sign \
             wrong, or is it {other}?",
            MM.show(falls_m),
            TURNS_OF_RAD.show(span_rad),
            N.exact(first.load_n)
        ))
    })
}

/// A unit or sign with which a sweep comes much nearer to the scene than as it stands.
#[derive(Debug, Clone)]
pub struct Hint {
    reading: &'static str,
    /// In words, with the file.
    pub text: String,
}

/// Why the sweeps are not fitted as they stand: every one of them comes much nearer to the scene in the same other unit.
fn wrong_unit(hints: &[Hint], data: &Data) -> Option<String> {
    let first = hints.first()?;
    let all = hints.len() == data.files.len() && hints.iter().all(|hint| hint.reading == first.reading);
    let texts: Vec<&str> = hints.iter().map(|hint| hint.text.as_str()).collect();
    all.then(|| format!("is a unit wrong? {}; if not, begin from a scene that is nearer (--scene)", texts.join("; ")))
}

/// Units or signs with which sweeps come much nearer to the scene than as they stand, one for each file at most.
fn likely(data: &Data, scene: &Scene) -> Vec<Hint> {
    let Ok(mechanism) = scene.mechanism() else { return Vec::new() };
    let far = |rows: &Range<usize>, load: f64, length: f64| {
        residual_m(&mechanism, data.rows.get(rows.clone()).unwrap_or_default(), load, length)
    };
    let hints = data.files.iter().filter_map(|(name, rows)| {
        let as_is = far(rows, 1.0, 1.0);
        let all = READINGS.iter().map(|(what, load, length)| (what, far(rows, *load, *length)));
        let (what, other) = all.min_by(|a, b| a.1.total_cmp(&b.1))?;
        (NEARER * other < as_is).then(|| Hint {
            reading: what,
            text: format!(
                "sweep {name}: with {what} it comes within {} of the scene, as it stands within {}",
                MM.show(other),
                MM.show(as_is)
            ),
        })
    });
    hints.collect()
}

/// Root mean square of what the scene misses (m), a gap's zero taken as it fits best. A state that has no equilibrium is
/// missed by the strings' length.
fn residual_m(mechanism: &Mechanism, rows: &[Row], load_factor: f64, length_factor: f64) -> f64 {
    let lost_m = mechanism.start_length_m();
    let gap = |load_n: f64, twist: f64| mechanism.solve(load_n, twist).map(|e| e.gap_m);
    let computed = |row: &Row| {
        let load_n = load_factor * row.load_n;
        let gap_m = gap(load_n, row.twist_rad).ok()?;
        let rise_m = match row.quantity {
            Quantity::Gap => -gap_m,
            _ => gap(load_n, PRETWIST_RAD).ok()? - gap_m,
        };
        Some(rise_m - length_factor * rise(row))
    };
    let missed: Vec<Option<f64>> = rows.iter().step_by(rows.len() / LOOKED_AT + 1).map(computed).collect();
    let known: Vec<f64> = missed.iter().copied().flatten().collect();
    let free = rows.first().is_some_and(|r| r.quantity == Quantity::Gap) && !known.is_empty();
    let zero_m = if free { mean(&known) } else { 0.0 };
    rms(&missed.iter().map(|m| m.map_or(lost_m, |m| m - zero_m)).collect::<Vec<_>>())
}
