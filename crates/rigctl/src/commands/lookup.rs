//! `lookup`: what the firmware would answer.

use super::solve::EXACT_M;
use crate::batch::{self, At, Query};
use crate::failure::{Failure, Refused};
use crate::options::Global;
use crate::output::Output;
use crate::units::{MM, MM_PER_N, NUMBER, RAD_PER_MM};
use clap::Args;
use serde::Serialize;
use tsa_model::twist_from_turns;
use tsa_table::Table;

/// One answer. The numbers are the board's own f32.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Answer {
    /// Load (N), as asked.
    pub load_n: f64,
    /// Turns past the half-turn pre-twist, as asked.
    pub turns: f64,
    /// Contraction since the half-turn pre-twist at this load (m).
    pub contraction_m: f32,
    /// Gap between the clamps (m).
    pub gap_m: f32,
    /// Transmission ratio (rad/m).
    pub tr_rad_per_m: f32,
    /// How far the load sinks for each newton more (m/N).
    pub dgap_dload_m_per_n: f32,
}

/// Asks the table.
///
/// # Errors
/// The parameter that is outside the table.
pub fn look_up(table: &Table<'_>, query: Query) -> Result<Answer, Refused> {
    let Query { load_n, turns } = query;
    for (name, value) in [("load_n", load_n), ("turns", turns)] {
        if !value.is_finite() {
            return Err(Refused::new("not-finite", format!("{name} {value} is not a finite number")));
        }
    }
    let (load, twist) = (load_n as f32, twist_from_turns(turns) as f32);
    let answer = table.look_up(load, twist).and_then(|point| Ok((point, table.contraction_m(load, twist)?)));
    let (point, contraction_m) = answer.map_err(|e| {
        // The operator gave turns, the table's error has radians: the message names both.
        let asked = if e.parameter == "twist_rad" { format!("turns {turns}: ") } else { String::new() };
        Refused::new("out-of-range", format!("{asked}{e}"))
    })?;
    Ok(Answer {
        load_n,
        turns,
        contraction_m,
        gap_m: point.gap_m,
        tr_rad_per_m: point.tr_rad_per_m(),
        dgap_dload_m_per_n: point.dgap_dload_m_per_n,
    })
}

/// Print the firmware's answer for a load and turns, by the same code and table
///
/// Example: `rigctl lookup --load 0.5kg --turns 3`
#[derive(Debug, Args)]
pub struct Lookup {
    #[command(flatten)]
    at: At,
}

/// Runs the command.
///
/// # Errors
/// If the scene has no table, the batch file is bad, or the one point is outside the table.
pub fn run(global: &Global, Lookup { at }: &Lookup, output: &mut Output) -> Result<(), Failure> {
    let fit = global.scene()?.fit_table()?;
    let table = fit.table.table();
    let heading = format!(
        "{:>10} {:>8} {:>14} {:>11} {:>11} {:>12}",
        "load N", "turns", "contraction mm", "gap mm", "TR rad/mm", "gap mm/N"
    );
    let line = |a: &Answer| {
        format!(
            "{:>10} {:>8} {:>14} {:>11} {:>11} {:>12}",
            NUMBER.exact(a.load_n),
            NUMBER.exact(a.turns),
            MM.number(a.contraction_m, EXACT_M),
            MM.number(a.gap_m, EXACT_M),
            RAD_PER_MM.number(a.tr_rad_per_m, None::<f64>),
            MM_PER_N.number(a.dgap_dload_m_per_n, None::<f64>)
        )
    };
    let Some(query) = at.one() else {
        return batch::answer(at, output, &heading, |query| look_up(&table, query), line);
    };
    let answer = look_up(&table, query)?;
    output.object(&answer)?;
    output.line(heading)?;
    Ok(output.line(line(&answer))?)
}
