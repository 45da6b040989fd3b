//! Tables whatever their form: all that were considered, and those whose cost on the board is measured.

use crate::fit::candidates;
use crate::form::Form;
use crate::table::{LoadMap, Table};
use tsa_model::Mechanism;
use tsa_table::emit::table_source;
use tsa_table::fit::{Errors, Fit, FitError, preference};
use tsa_table::owned::OwnedTable;
use tsa_table::{FORM, TableSpec};

/// A table that was considered.
#[derive(Clone, Debug)]
pub struct Considered {
    /// Name of its form.
    pub form: &'static str,
    /// Its size in words.
    pub size: String,
    /// Map of the load; `None` for the form that the board uses, which needs none.
    pub load_map: Option<LoadMap>,
    /// Bytes of numbers.
    pub bytes: usize,
    /// Predicted instructions of a lookup on the board.
    pub instructions: u32,
    /// Errors on the selection grid.
    pub errors: Errors,
    /// Whether it meets the accuracy within [`tsa_table::fit::MAX_BYTES`].
    pub passes: bool,
    table: AnyTable,
}

#[derive(Clone, Debug)]
enum AnyTable {
    Own(OwnedTable),
    Other(Table<Vec<f32>>),
}

/// The other forms' best tables, then the candidates of a fit.
fn all(mechanism: &Mechanism, table_spec: &TableSpec, fit: &Fit) -> Result<Vec<Considered>, FitError> {
    let others = candidates(mechanism, table_spec)?.into_iter().map(|c| Considered {
        form: c.table.form.name(),
        size: match c.table.form {
            Form::Series { rows, row_lengths } => {
                let longest = row_lengths.iter().max().copied().unwrap_or(0);
                format!("{} of {rows}x{longest} coefficients", c.table.numbers.len())
            }
            Form::Hermite { loads, twists } | Form::Bilinear { loads, twists } => format!("{loads}x{twists} nodes"),
        },
        load_map: Some(c.table.load_map),
        bytes: c.table.bytes(),
        instructions: c.table.instructions(),
        errors: c.errors,
        passes: c.passes,
        table: AnyTable::Other(c.table),
    });
    let own = fit.candidates.iter().map(|c| Considered {
        form: FORM,
        size: c.table.numbers.size(),
        load_map: None,
        bytes: c.table.numbers.bytes(),
        instructions: c.instructions(),
        errors: c.errors,
        passes: c.passes,
        table: AnyTable::Own(c.table.clone()),
    });
    Ok(others.chain(own).collect())
}

/// The candidates of a fit and those of the other forms, in the order of preference.
///
/// # Errors
/// As [`tsa_table::fit::fit_tier`].
pub fn considered(mechanism: &Mechanism, table_spec: &TableSpec, fit: &Fit) -> Result<Vec<Considered>, FitError> {
    let mut all = all(mechanism, table_spec, fit)?;
    all.sort_by_key(|c| preference(c.passes, c.bytes, c.instructions));
    Ok(all)
}

/// The tables whose cost on the board is measured beside the chosen one, with their names there: of every other form the best,
/// of the board's own form the extremes, and the series on every kind of load map, so that the instruction models are checked
/// over their whole range.
///
/// # Errors
/// As [`tsa_table::fit::fit_tier`].
pub fn peers(
    mechanism: &Mechanism,
    table_spec: &TableSpec,
    fit: &Fit,
) -> Result<Vec<(&'static str, Considered)>, FitError> {
    let all = all(mechanism, table_spec, fit)?;
    let ranges = |c: &&Considered| if let AnyTable::Own(own) = &c.table { own.numbers.patches.len() } else { 0 };
    let own = || all.iter().filter(|c| c.passes && c.form == FORM);
    // One that passes before one that fails, then the more accurate one.
    let best = |of: &dyn Fn(&Table<Vec<f32>>) -> bool| {
        let others = all.iter().filter(|c| matches!(&c.table, AnyTable::Other(table) if of(table)));
        let error = |c: &Considered| c.errors.contraction_max_m;
        others.min_by(|a, b| (!a.passes).cmp(&!b.passes).then(error(a).total_cmp(&error(b))))
    };
    let series = |of: fn(&LoadMap) -> bool| best(&|t| matches!(t.form, Form::Series { .. }) && of(&t.load_map));
    let peers = [
        ("ARC_FEW", own().min_by_key(ranges)),
        ("ARC_MANY", own().max_by_key(ranges)),
        ("SERIES", series(|map| *map == LoadMap::InverseRoot)),
        ("SERIES_LOG", series(|map| *map == LoadMap::Log)),
        ("SERIES_RATIO", series(|map| matches!(map, LoadMap::Ratio { .. }))),
        ("HERMITE", best(&|t| matches!(t.form, Form::Hermite { .. }))),
        ("BILINEAR", best(&|t| matches!(t.form, Form::Bilinear { .. }))),
    ];
    Ok(peers.into_iter().filter_map(|(name, peer)| Some((name, peer?.clone()))).collect())
}

impl Considered {
    /// Rust source of a static table of this name, where the names of this crate are in scope.
    pub fn rust_source(&self, name: &str) -> String {
        let Errors { contraction_max_m, tr_max, .. } = self.errors;
        let doc = format!(
            "{}, {} bytes, contraction within {contraction_max_m:.2e} m, TR within {tr_max:.2e} on the selection grid.",
            self.size, self.bytes,
        );
        match &self.table {
            AnyTable::Own(table) => table_source(name, &doc, table),
            AnyTable::Other(table) => {
                // As Rust writes it, which loses no digit, but for paths and references.
                let paths = [("form: ", "form: Form::"), ("map: ", "map: LoadMap::"), ("numbers: ", "numbers: &")];
                let source = paths.iter().fold(format!("{table:?}"), |text, (from, to)| text.replace(from, to));
                format!("/// {doc}\npub static {name}: Table<&[f32]> = {source};\n")
            }
        }
    }
}
