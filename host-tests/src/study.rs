//! What a study measures: numbers, a table and notes, in the form in which docs/results.json keeps them. One writer shows them, to
//! people and in docs/results.md.

use anyhow::{Context, Result};
use rig_plant::RigPreset;
use rigctl::parallel::parallel_on;
use rigctl::plot::Figure;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

/// What one study measured.
#[derive(Clone, Debug, Default, Serialize, Deserialize, PartialEq)]
pub struct Study {
    /// The numbers that pages quote, by name, in the unit that ends the name.
    pub values: BTreeMap<String, f64>,
    /// Head and rows of the table.
    pub table: Vec<Vec<String>>,
    /// Lines of text below the table.
    pub notes: Vec<String>,
}

impl Study {
    /// One whose table has a head.
    pub fn new<T: Into<String>>(head: impl IntoIterator<Item = T>) -> Self {
        Self { table: vec![head.into_iter().map(Into::into).collect()], ..Self::default() }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.table.push(cells.into_iter().collect());
    }

    /// Keeps a number under a name, if there is one.
    pub fn value(&mut self, name: impl Into<String>, value: impl Into<Option<f64>>) {
        self.values.extend(value.into().map(|value| (name.into(), value)));
    }

    /// Another study of the same kind below this one. Notes that both have stand once, at the end.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.values.extend(other.values);
        self.table.extend(other.table.into_iter().skip(1));
        self.notes.retain(|note| !other.notes.contains(note));
        self.notes.extend(other.notes);
        self
    }
}

/// As in docs/results.md: a table, then a paragraph for each note.
impl fmt::Display for Study {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&markdown(&self.table))?;
        self.notes.iter().try_for_each(|note| write!(f, "\n{note}\n"))
    }
}

/// A Markdown table of a head and rows.
pub fn markdown(rows: &[Vec<String>]) -> String {
    let mut text = String::new();
    for (k, row) in rows.iter().enumerate() {
        let cells: Vec<String> = row.iter().map(|cell| cell.replace('|', "\\|")).collect();
        text += &format!("| {} |\n", cells.join(" | "));
        if k == 0 {
            text += &format!("|{}\n", "---|".repeat(row.len()));
        }
    }
    text
}

/// Three significant digits, without an exponent.
pub fn significant(value: f64) -> String {
    let digits = if value == 0.0 { 0 } else { (2 - value.abs().log10().floor() as i32).max(0) };
    format!("{value:.*}", digits.min(12) as usize)
}

/// A number with so many digits after the point, or a dash.
pub fn shown(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".into(), |value| format!("{value:.digits$}"))
}

/// Values in ascending order.
pub struct Sorted(Vec<f64>);

impl Sorted {
    /// Sorts them.
    pub fn new(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        Self(values)
    }

    /// The value that a fraction of them does not exceed: rank k of n lies at (k - 1/2)/n, and the nearest one above is taken.
    pub fn quantile(&self, fraction: f64) -> Option<f64> {
        let rank = (fraction * self.0.len() as f64).ceil() as usize;
        self.0.get(rank.saturating_sub(1)).copied()
    }

    /// From the smallest on.
    pub fn iter(&self) -> impl Iterator<Item = &f64> {
        self.0.iter()
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// All together.
    pub fn sum(&self) -> f64 {
        self.0.iter().sum()
    }

    /// The middle one, of an even number the upper of the two; `None` where it is not finite.
    pub fn median(&self) -> Option<f64> {
        self.0.get(self.0.len() / 2).copied().filter(|value| value.is_finite())
    }

    /// The maximum that is finite.
    pub fn max(&self) -> Option<f64> {
        self.0.iter().rev().copied().find(|value| value.is_finite())
    }

    /// Median and maximum as text.
    pub fn spread(&self) -> String {
        format!("{}; {}", shown(self.median(), 2), shown(self.max(), 2))
    }
}

/// What the studies on emulated rigs have in common.
#[derive(clap::Args, Clone, Debug)]
pub struct Rigs {
    /// Seed of the first rig (default: as in docs/results.md)
    #[arg(long)]
    pub seed: Option<u64>,
    /// How many rigs of each kind (default: as in docs/results.md)
    #[arg(long)]
    pub rigs: Option<u64>,
    /// Only this kind of rig: ideal, nominal or hard
    #[arg(long)]
    pub rig: Option<RigPreset>,
    /// Threads
    #[arg(long, default_value_t = rigctl::parallel::cores())]
    pub jobs: usize,
}

impl Rigs {
    /// Seeds of the given number of rigs, unless the user has asked for others.
    pub fn seeds(&self, count: u64) -> std::ops::Range<u64> {
        let first = self.seed.unwrap_or(1001);
        first..first + self.rigs.unwrap_or(count)
    }

    /// Whether a kind of rig is wanted.
    pub fn wants(&self, kind: RigPreset) -> bool {
        self.rig.is_none_or(|only| only == kind)
    }
}

/// `f` of every item, on the given number of threads, in the items' order.
pub fn each<T: Sync, R: Send>(jobs: usize, items: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    parallel_on(jobs, &|_, _| {}, items.len(), |k| f(&items[k]))
}

/// Writes a figure into the folder `out`.
///
/// # Errors
/// If it cannot be drawn or written.
pub fn draw(figure: &Figure, name: &str) -> Result<()> {
    write(&crate::root().join("out"), &format!("{name}.svg"), &figure.svg()?)
}

/// Writes a file into a folder, which is made if it is not there.
///
/// # Errors
/// If it cannot be written.
pub fn write(folder: &Path, name: &str, text: &str) -> Result<()> {
    let file = folder.join(name);
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&file, text))
        .with_context(|| file.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_a_rule_below_its_head_and_keeps_bars_apart() {
        let rows = [["a", "b|c"], ["1", "2"]].map(|row| row.map(str::to_owned).to_vec());
        assert_eq!(markdown(&rows), "| a | b\\|c |\n|---|---|\n| 1 | 2 |\n");
    }

    #[test]
    fn three_digits_whatever_the_size() {
        let shown = [0.0, 1.0, 0.012_345, 12_345.0, -3.456_78, 99.96].map(significant);
        assert_eq!(shown, ["0", "1.00", "0.0123", "12345", "-3.46", "100.0"].map(str::to_owned));
    }

    #[test]
    fn ranks_are_whole_and_what_never_ended_is_the_last() {
        let four = Sorted::new([3.0, f64::INFINITY, 1.0, 2.0]);
        assert_eq!([four.quantile(0.5), four.quantile(0.75), four.median()], [Some(2.0), Some(3.0), Some(3.0)]);
        assert_eq!((four.max(), four.quantile(0.95)), (Some(3.0), Some(f64::INFINITY)));
        let none = Sorted::new([]);
        assert_eq!((none.median(), none.quantile(0.95), none.spread()), (None, None, "-; -".into()));
        assert_eq!(Sorted::new([1.0, f64::INFINITY]).median(), None);
    }

    #[test]
    fn joined_studies_have_one_head_and_say_a_shared_note_once_at_the_end() {
        let one = |name: &str| {
            let mut study = Study::new(["rig", "error"]);
            study.row([name.into(), "1".into()]);
            study.notes = vec![format!("about {name}"), "about all".into()];
            study
        };
        let both = one("a").and(one("b"));
        assert_eq!(both.table.len(), 3);
        assert_eq!(both.notes, ["about a", "about b", "about all"]);
    }
}
