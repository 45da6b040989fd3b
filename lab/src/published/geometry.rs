//! The geometry that some of the paper's sweeps seem to have used instead of Table 1's (lab/paper.md).
//!
//! Only D0 = 30 mm has the paper's word for it; the lengths are inferred, because with them one law gives all numbers
//! that the paper computes.

/// Place in the paper, what is swept there, and what differs from Table 1, as in [`super::numbers::apply`].
pub const INFERRED: [(&str, &str, &str); 5] = [
    ("section 4.2", "load", "L0=0.100"),
    ("Fig. 8", "R", "L0=0.100"),
    ("Fig. 9", "L0", "D0=0.030"),
    ("Fig. 10", "r0", "L0=0.100"),
    ("Fig. 11", "K", "L0=0.1055"),
];

/// What differs from Table 1 at a place in the paper; nothing where Table 1 holds.
pub fn inferred(place: &str) -> &'static str {
    INFERRED.iter().find(|(at, ..)| *at == place).map_or("", |(.., changes)| changes)
}

/// The changes of a place with others after them: a sweep may change the same key.
pub(super) fn with(before: &str, changes: &str) -> String {
    [before, changes].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(";")
}

/// The table for people, in lines.
pub(super) fn text() -> Vec<String> {
    let mut lines = vec!["computed with a geometry inferred for each sweep; Table 1's elsewhere:".to_owned()];
    lines.extend(INFERRED.iter().map(|(place, swept, changes)| format!("  {swept:<5} {place:<12} {changes}")));
    lines
}
