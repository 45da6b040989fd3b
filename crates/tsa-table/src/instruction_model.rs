//! A prediction of what a lookup costs on the board, so that a table can be chosen by it before there is an image.
//!
//! The numbers are instructions of the Cortex-M4F, counted on the emulated board in one image (`cargo xtask cost`,
//! which also checks that they still hold).

use crate::arc::ArcSeries;

/// Most instructions that a lookup should take: a table within them is preferred to a smaller one that is slower.
pub const LOOKUP_INSTRUCTIONS: u32 = 260;

/// Instructions of one lookup with gradient in the worst case.
pub fn lookup_instructions(series: &ArcSeries<'_>) -> u32 {
    let (rows, columns) = (u32::from(series.shape.rows), u32::from(series.shape.columns));
    120 + 5 * columns * rows / 2 + 3 * columns + 21 * series.patches.len() as u32 / 2
}
