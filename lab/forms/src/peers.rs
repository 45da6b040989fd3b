//! The tables whose cost on the board is measured beside the chosen one: of every other form the best, of the board's
//! own form the extremes, and the series on every kind of load map, so that the instruction models are checked over
//! their whole range.

use crate::axis::{Axis, LoadMap};
use crate::fit::{Candidate, Numbers};
use crate::form::Form;
use tsa_table::emit::{floats, table_source};
use tsa_table::fit::{Errors, Fit};

/// A table beside the chosen one.
#[derive(Clone, Copy, Debug)]
pub enum Peer<'a> {
    /// Of the board's own form, with other numbers of powers.
    Own(&'a tsa_table::fit::Candidate),
    /// Of another form.
    Other(&'a Candidate),
}

impl Peer<'_> {
    /// Its size in words.
    pub fn size(&self) -> String {
        match self {
            Self::Own(c) => c.table.numbers.size(),
            Self::Other(c) => c.numbers.size(),
        }
    }

    /// Bytes of numbers.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Own(c) => c.table.numbers.bytes(),
            Self::Other(c) => c.numbers.form().bytes(),
        }
    }

    /// Predicted instructions of a lookup on the board.
    pub fn instructions(&self) -> u32 {
        match self {
            Self::Own(c) => c.instructions(),
            Self::Other(c) => c.table().instructions(),
        }
    }

    fn errors(&self) -> Errors {
        match self {
            Self::Own(c) => c.errors,
            Self::Other(c) => c.errors,
        }
    }

    /// Rust source of a static table of this name.
    pub fn rust_source(&self, name: &str) -> String {
        let Errors { contraction_max_m, tr_max, .. } = self.errors();
        let doc = format!(
            "{}, {} bytes, contraction within {contraction_max_m:.2e} m, TR within {tr_max:.2e} on the selection grid.",
            self.size(),
            self.bytes(),
        );
        match self {
            Self::Own(c) => table_source(name, &doc, &c.table),
            Self::Other(c) => other_source(name, &doc, c),
        }
    }
}

/// The peers with the names of their tables.
pub fn peers<'a>(fit: &'a Fit, others: &'a [Candidate]) -> Vec<(&'static str, Peer<'a>)> {
    let ranges = |c: &&tsa_table::fit::Candidate| c.table.numbers.patches.len();
    let passing = || fit.candidates.iter().filter(|c| c.passes);
    let other = |of_kind: &dyn Fn(&Candidate) -> bool| best(others.iter().filter(|c| of_kind(c)));
    let is_series = |c: &Candidate| matches!(c.numbers, Numbers::Series { .. });
    let all = [
        ("ARC_FEW", passing().min_by_key(ranges).map(Peer::Own)),
        ("ARC_MANY", passing().max_by_key(ranges).map(Peer::Own)),
        ("SERIES", other(&|c| is_series(c) && c.load_map == LoadMap::InverseRoot)),
        ("SERIES_LOG", other(&|c| is_series(c) && c.load_map == LoadMap::Log)),
        ("SERIES_RATIO", other(&|c| is_series(c) && matches!(c.load_map, LoadMap::Ratio { .. }))),
        ("HERMITE", other(&|c| matches!(c.numbers, Numbers::Hermite { .. }))),
        ("BILINEAR", other(&|c| matches!(c.numbers, Numbers::Bilinear { .. }))),
    ];
    all.into_iter().filter_map(|(name, peer)| Some((name, peer?))).collect()
}

/// One that passes before one that fails, then the more accurate one.
fn best<'a>(candidates: impl Iterator<Item = &'a Candidate>) -> Option<Peer<'a>> {
    let error = |c: &Candidate| c.errors.contraction_max_m;
    candidates.min_by(|a, b| (!a.passes).cmp(&!b.passes).then(error(a).total_cmp(&error(b)))).map(Peer::Other)
}

fn other_source(name: &str, doc: &str, candidate: &Candidate) -> String {
    let table = candidate.table();
    let axis = |a: Axis| {
        format!("rival_forms::Axis {{ centre: {}, inverse_half: {} }}", floats(&[a.centre]), floats(&[a.inverse_half]))
    };
    let form = match table.form {
        Form::Series { row_lengths, coefficients } => {
            format!("Series {{ row_lengths: &{row_lengths:?}, coefficients: &[{}] }}", floats(coefficients))
        }
        Form::Hermite { loads, twists, nodes } => {
            let nodes: Vec<String> = nodes.iter().map(|n| format!("[{}]", floats(n))).collect();
            format!("Hermite {{ loads: {loads}, twists: {twists}, nodes: &[{}] }}", nodes.join(", "))
        }
        Form::Bilinear { loads, twists, nodes } => {
            format!("Bilinear {{ loads: {loads}, twists: {twists}, nodes: &[{}] }}", floats(nodes))
        }
    };
    let map = match table.load_map {
        LoadMap::Ratio { knee_n } => format!("Ratio {{ knee_n: {} }}", floats(&[knee_n])),
        LoadMap::Log => "Log".into(),
        LoadMap::InverseRoot => "InverseRoot".into(),
    };
    format!(
        "/// {doc}\n\
         pub static {name}: rival_forms::Table<'static> = rival_forms::Table {{\n\
         \x20   load_n: [{}], twist_rad: [{}],\n\
         \x20   load_map: rival_forms::LoadMap::{map}, load_axis: {}, twist_axis: {},\n\
         \x20   form: rival_forms::Form::{form},\n\
         }};\n",
        floats(&table.load_n),
        floats(&table.twist_rad),
        axis(table.load_axis),
        axis(table.twist_axis),
    )
}
