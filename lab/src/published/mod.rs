//! The numbers that the paper prints beside the same numbers computed for one or several scenes.
//!
//! - [`numbers`]: the printed numbers and quoted ratios, each with its computation.
//! - [`geometry`]: geometry of some sweeps that the paper does not state; [`contradictions`]: what no law can meet.
//! - [`identify`]: constants fitted to them.
//! - `comparison`: both as rows, tables and CSV; `figures`: the paper's Figs 6 to 11 and 13 redrawn.

mod comparison;
pub mod contradictions;
mod figures;
pub mod geometry;
pub mod identify;
pub mod numbers;

use anyhow::Result;
pub use comparison::Compared;
use comparison::Set;
use numbers::{Ratio, Row};
use rig_config::Scene;

/// The paper's three parameter sets, as scene files: what was fitted, the same with eq. 6 kept, and Table 1 as printed.
pub const SETS: [&str; 3] = ["paper-identified", "paper-identified-eq6", "paper-printed"];

/// Every printed number and quoted ratio, computed for some scenes.
pub struct Comparison {
    rows: Vec<Row>,
    ratios: Vec<Ratio>,
    sets: Vec<Set>,
    /// Whether some sweeps have the geometry that is inferred for them.
    inferred: bool,
}

impl Comparison {
    /// Computes all of them for scenes with their names, on request with the [`geometry`] that is `inferred` for some.
    ///
    /// # Errors
    /// If a scene describes no mechanism.
    pub fn new(scenes: Vec<(String, Scene)>, inferred: bool) -> Result<Self> {
        let (mut rows, ratios) = (numbers::rows()?, numbers::ratios()?);
        if inferred {
            geometry::put(&mut rows);
        }
        let set = |(name, scene)| Set::new(name, scene, &rows, &ratios, inferred);
        let sets = scenes.into_iter().map(set).collect::<Result<_>>()?;
        Ok(Self { rows, ratios, sets, inferred })
    }

    /// A row for each printed number and scene.
    pub fn compared(&self) -> Vec<Compared<'_>> {
        let several = self.sets.len() > 1;
        let of_set =
            |set| self.rows.iter().enumerate().map(move |(k, row)| Compared::new(set, several, k, row, self.inferred));
        self.sets.iter().flat_map(of_set).collect()
    }

    /// Tables, remarks and sums of errors for people, in lines.
    ///
    /// # Errors
    /// Never for the quantities that exist: each has a name.
    pub fn text(&self) -> Result<Vec<String>> {
        let (rows, sets) = (&self.rows, &self.sets);
        let mut lines = if self.inferred { geometry::text() } else { Vec::new() };
        lines.extend(comparison::table(rows, sets)?);
        lines.extend(comparison::remarks(rows, sets));
        lines.extend(comparison::summary(rows, sets));
        lines.extend([String::new(), "ratios that the text quotes".into()]);
        lines.extend(comparison::ratio_table(&self.ratios, sets)?);
        lines.extend(contradictions::text(&numbers::rows()?)?);
        Ok(lines)
    }

    /// Data and figures as file names and contents.
    ///
    /// # Errors
    /// If a figure cannot be drawn.
    pub fn files(&self) -> Result<Vec<(String, String)>> {
        let mut files = vec![
            ("published.csv".to_owned(), comparison::rows_csv(&self.rows, &self.sets)?),
            ("ratios.csv".to_owned(), comparison::ratios_csv(&self.ratios, &self.sets)?),
        ];
        files.extend(figures::draw(&self.rows, &self.ratios, &self.sets, self.inferred)?);
        Ok(files)
    }
}
