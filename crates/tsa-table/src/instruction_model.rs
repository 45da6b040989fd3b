//! A prediction of what a lookup costs on the board, so that a table can be chosen by it before there is an image.
//!
//! The numbers are instructions of the Cortex-M4F, counted on the emulated board in one image (`cargo xtask cost`,
//! which also checks that they still hold).

use crate::arc::ArcSeries;

/// Maximum instructions that a lookup should take: a table within them is preferred to a smaller one that is slower.
pub const LOOKUP_INSTRUCTIONS: u32 = 260;

/// Instructions of one lookup with gradient in the worst case.
pub fn lookup_instructions(series: &ArcSeries<'_>) -> u32 {
    let (rows, columns) = (u32::from(series.shape.rows), u32::from(series.shape.columns));
    120 + 5 * columns * rows / 2 + 3 * columns + 21 * series.patches.len() as u32 / 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Growth, Patch, Shape};

    /// Two tables whose most instructions `docs/results.md` states, section `cost`: 255 and 268.
    #[test]
    fn the_prediction_is_within_two_per_cent_of_what_was_counted() {
        let growth = Growth { per_load_m_n: 0.0, powers: [0.0; 6], per_log_m: 0.0 };
        let patch = Patch { load_max_n: 1.0, centre: [0.0; 2] };
        for (rows, columns, ranges, counted) in [(4, 8, 3, 255.0), (5, 8, 2, 268.0)] {
            let patches = vec![patch; ranges];
            let shape = Shape::of(rows, columns).unwrap();
            let series = ArcSeries { growth, shape, patches: &patches, coefficients: &[] };
            let predicted = f64::from(lookup_instructions(&series));
            assert!((predicted / counted - 1.0).abs() < 0.02, "{predicted} for {counted}");
        }
    }
}
