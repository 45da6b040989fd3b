//! Choosing a table by measurement: the smallest fast one that reaches the accuracy.

use crate::error_bounds::{self, ErrorBounds};
pub use crate::errors::Errors;
use crate::errors::errors_over;
use crate::instruction_model::{LOOKUP_INSTRUCTIONS, lookup_instructions};
pub use crate::owned::{OwnedSeries, OwnedTable};
use crate::patches::Ranges;
use crate::record::MAX_PATCHES;
use crate::reference::{Exact, Reference};
use crate::table::Metadata;
pub use crate::table_spec::{Accuracy, FitError, MAX_BYTES, TableSpec};
use tsa_model::{Mechanism, Tier};

/// A candidate must stay within this fraction of the accuracy on the selection grid; the certificate's search, which finds
/// larger errors, then usually passes.
const SELECTION_FRACTION: f64 = 0.9;

/// One candidate: the table of its shape with the fewest ranges of the load.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The table.
    pub table: OwnedTable,
    /// Errors on the selection grid.
    pub errors: Errors,
    /// Whether it meets the accuracy within [`MAX_BYTES`].
    pub passes: bool,
}

impl Candidate {
    fn new(numbers: OwnedSeries, reference: &Reference<'_>, table_spec: &TableSpec, points: &[Exact]) -> Self {
        let [load_min_n, load_max_n] = reference.load_n.map(|f| f as f32);
        let [twist_min_rad, twist_max_rad] = reference.twist_rad.map(|t| t as f32);
        let metadata = Metadata {
            load_min_n,
            load_max_n,
            twist_min_rad,
            twist_max_rad,
            contraction_error_m: 0.0,
            tr_relative_error: 0.0,
            uncertainty: table_spec.uncertainty,
            scene_hash: table_spec.scene_hash,
            generator_version: crate::GENERATOR_VERSION,
        };
        let table = OwnedTable { metadata, numbers, crc: 0 };
        let errors = errors_over(|load_n, twist_rad| table.table().point_inside(load_n, twist_rad), points);
        let passes = errors.meets(&table_spec.accuracy, SELECTION_FRACTION)
            && table.numbers.bytes() <= MAX_BYTES
            && table.numbers.patches.len() <= MAX_PATCHES;
        Self { table, errors, passes }
    }

    /// Instructions of a lookup on the board, predicted, see [`crate::instruction_model`].
    pub fn instructions(&self) -> u32 {
        lookup_instructions(&self.table.numbers.series())
    }
}

/// The order of preference, also for candidates of other forms: those that pass, of these the ones that the board looks
/// up fast enough, then the smallest, and of equal size the faster.
pub fn preference(passes: bool, bytes: usize, instructions: u32) -> impl Ord {
    (!passes, instructions > LOOKUP_INSTRUCTIONS, bytes, instructions)
}

/// The chosen table, its certificate, and the candidates.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The chosen table.
    pub table: OwnedTable,
    /// Its certificate.
    pub error_bounds: ErrorBounds,
    /// Every candidate, in the order of preference.
    pub candidates: Vec<Candidate>,
}

/// Shares of the accuracy that the ranges of a table are fitted for: less where the search for the worst point finds more
/// in every table than its own points show, as with a measured correction that bends at the edge of its data.
const FITTED_FRACTIONS: [f64; 2] = [1.0, 0.5];

/// Fits, chooses and certifies a table of the mechanism by a tier of the model, which also judges it: a cheaper one than
/// the full shows what control by it would be like.
///
/// # Errors
/// [`FitError`]: the first point at which the envelope breaks the model, or an accuracy out of reach.
pub fn fit_tier(mechanism: &Mechanism, table_spec: &TableSpec, tier: Tier) -> Result<Fit, FitError> {
    let reference = Reference::new(mechanism, tier, table_spec);
    let accuracy = &table_spec.accuracy;
    let points = reference.selection_grid()?;
    let candidate = |numbers| Candidate::new(numbers, &reference, table_spec, &points);
    let mut candidates: Vec<Candidate> = Vec::new();
    for fraction in FITTED_FRACTIONS {
        let aim =
            Accuracy { contraction_m: fraction * accuracy.contraction_m, tr_relative: fraction * accuracy.tr_relative };
        let mut ranges = Ranges::new(&reference, &aim)?;
        let numbers = ranges.as_mut().map(Ranges::fewest_of_each_shape).unwrap_or_default();
        candidates = numbers.into_iter().map(candidate).collect();
        candidates.sort_by_key(|c| preference(c.passes, c.table.numbers.bytes(), c.instructions()));
        for candidate in candidates.iter().filter(|c| c.passes) {
            let mut table = candidate.table.clone();
            let error_bounds = error_bounds::certify(&table.table(), &reference, error_bounds::RANDOM_POINTS)?;
            if error_bounds.errors.meets(accuracy, 1.0) && error_bounds.monotone {
                table.metadata.contraction_error_m = error_bounds.errors.contraction_max_m as f32;
                table.metadata.tr_relative_error = error_bounds.errors.tr_max as f32;
                table.crc = table.table().checksum();
                return Ok(Fit { table, error_bounds, candidates });
            }
        }
        // The list so far has only shapes that reach the accuracy with some number of ranges.
        candidates.extend(ranges.as_mut().and_then(Ranges::shortest).map(candidate));
    }
    let best = candidates.iter().min_by(|a, b| a.errors.contraction_max_m.total_cmp(&b.errors.contraction_max_m));
    let best = best.map_or("no numbers".into(), |c| {
        let e = &c.errors;
        format!("{:.3e} m and {:.3e} in {} bytes", e.contraction_max_m, e.tr_max, c.table.numbers.bytes())
    });
    Err(FitError::Accuracy { contraction_m: accuracy.contraction_m, tr_relative: accuracy.tr_relative, best })
}

#[cfg(test)]
mod tests {
    use super::{LOOKUP_INSTRUCTIONS, preference};

    #[test]
    fn what_passes_comes_first_then_the_fast_then_the_small() {
        let order = [
            (true, 500, LOOKUP_INSTRUCTIONS - 20),
            (true, 500, LOOKUP_INSTRUCTIONS),
            (true, 900, 100),
            (true, 400, LOOKUP_INSTRUCTIONS + 1),
            (false, 300, 100),
        ];
        let key = |(passes, bytes, instructions)| preference(passes, bytes, instructions);
        assert!(order.windows(2).all(|pair| key(pair[0]) < key(pair[1])));
    }
}
