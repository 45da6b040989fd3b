//! What a lookup costs on the board, predicted, so that a table can be chosen by it before there is an image.
//!
//! The numbers are instructions of the Cortex-M4F, measured on the emulated board in one image (`cargo xtask cost`, which
//! also checks that they still hold).

use crate::axis::LoadMap;
use crate::form::Form;
use crate::lookup::Table;

/// Instructions that a lookup should stay within: a table that does is preferred to a smaller one that does not.
pub const LOOKUP_INSTRUCTIONS: u32 = 250;

/// Instructions of one lookup with gradient in the worst case.
pub fn lookup_instructions(table: &Table<'_>) -> u32 {
    let map = match table.metadata.load_map {
        LoadMap::Linear => 0,
        LoadMap::Ratio { .. } => 6,
        LoadMap::InverseRoot => 66,
        LoadMap::Log => 100,
    };
    let words = |n: usize| n as u32;
    match &table.form {
        Form::Arc(s) => {
            let (rows, columns) = (u32::from(s.shape.rows), u32::from(s.shape.columns));
            120 + 5 * columns * rows / 2 + 3 * columns + 7 * words(s.patches.len())
        }
        Form::Series { row_lengths, coefficients } => {
            157 + map + 35 * words(row_lengths.len()) + 3 * words(coefficients.len())
        }
        Form::Hermite { .. } => 320 + map,
        Form::Bilinear { .. } => 187 + map,
    }
}
