//! Numbers of the paper that contradict each other with Table 1's geometry, whatever the law is.
//!
//! Two numbers contradict each other if they have the same inputs and differ, or if one input differs and the number
//! changes in the direction that no twisted string takes: a stiffer string contracts more, a heavier load is lifted
//! less. A number v that stands for two printed ones a > b has at least the relative error (a − b)/(a + b) to one of
//! them. For several numbers in such an order the largest of these errors is also enough.

use super::numbers::{Kind, Row, apply};
use anyhow::Result;
use rig_config::Scene;
use rigctl::identify::data::Quantity;

/// Table 1.
const PRINTED: &str = include_str!("../../../scenes/paper-printed.toml");

/// Two contractions that no law meets both.
#[derive(Debug, Clone, PartialEq)]
pub struct Contradiction<'a> {
    /// The number that is too large, and the one that is too small.
    pub rows: [&'a Row; 2],
    /// Why they contradict each other.
    pub why: &'static str,
    /// The least relative error that any law has to one of them.
    pub error: f64,
}

/// All contradictions between contractions, in the order of the rows.
///
/// # Errors
/// If Table 1 or a row's changes cannot be read.
pub fn contradictions(rows: &[Row]) -> Result<Vec<Contradiction<'_>>> {
    let table = Scene::from_toml_str(PRINTED)?;
    let contractions = rows.iter().filter(|row| row.group() == Quantity::Contraction);
    let scenes = contractions.map(|row| Ok((row, apply(&table, &row.changes)?))).collect::<Result<Vec<_>>>()?;
    let mut found = Vec::new();
    for (k, first) in scenes.iter().enumerate() {
        for second in &scenes[k + 1..] {
            for [more, less] in [[first, second], [second, first]] {
                if more.0.value > less.0.value
                    && let Some(why) = not_more(more, less)
                {
                    let (a, b) = (more.0.value, less.0.value);
                    found.push(Contradiction { rows: [more.0, less.0], why, error: (a - b) / (a + b) });
                }
            }
        }
    }
    Ok(found)
}

/// Why the first contraction cannot be more than the second.
fn not_more(first: &(&Row, Scene), second: &(&Row, Scene)) -> Option<&'static str> {
    let with_stiffness_of = |scene: &Scene, other: &Scene| {
        let mut scene = scene.clone();
        scene.string.stiffness_n_per_m = other.string.stiffness_n_per_m;
        scene
    };
    let [stiffness, other] = [first, second].map(|(_, scene)| scene.string.stiffness_n_per_m);
    let [load, other_load] = [first, second].map(|(row, _)| row.load_n);
    match () {
        () if load == other_load && first.1 == second.1 => Some("the same inputs"),
        () if load == other_load && stiffness < other && with_stiffness_of(&first.1, &second.1) == second.1 => {
            Some("the stiffer string contracts less")
        }
        () if load > other_load && first.1 == second.1 => Some("the lighter load is lifted less"),
        () => None,
    }
}

/// The least error that any law has to the worst of some contradictions.
fn min(found: &[Contradiction<'_>], belongs: impl Fn(&Contradiction<'_>) -> bool) -> f64 {
    found.iter().filter(|c| belongs(c)).map(|c| c.error).fold(0.0, f64::max)
}

/// The contradictions for people, in lines.
///
/// # Errors
/// As [`contradictions`].
pub(super) fn text(rows: &[Row]) -> Result<Vec<String>> {
    let found = contradictions(rows)?;
    let mut lines = vec![
        String::new(),
        "contradictions between printed contractions, with Table 1's geometry: any law is off one of both by at least"
            .into(),
    ];
    for Contradiction { rows: [more, less], why, error } in &found {
        let named = |row: &Row| format!("{} ({:.2} {} at {} N)", row.id, row.value, row.unit, row.load_n);
        lines.push(format!("{:>6.2} %  {:<35} and {:<27}  {why}", 100.0 * error, named(more), named(less)));
    }
    let computed = min(&found, |c| c.rows.iter().all(|row| row.kind == Kind::Theory));
    let all = min(&found, |_| true);
    lines.push(format!(
        "the best that any law can do with these: {:.2} %, with those that the paper computes {:.2} %",
        100.0 * all,
        100.0 * computed
    ));
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::published::numbers::rows;

    #[test]
    fn the_papers_numbers_contradict_each_other() {
        let rows = rows().unwrap();
        let found = contradictions(&rows).unwrap();
        let error = |ids: [&str; 2]| {
            let one = found.iter().find(|c| c.rows.map(|row| row.id.as_str()) == ids);
            one.map(|c| (1e4 * c.error).round() / 1e2)
        };
        assert_eq!(error(["d0-32", "r-0.50"]), Some(1.95));
        assert_eq!(error(["d0-32", "r0-1.5"]), Some(1.95));
        assert_eq!(error(["d0-32", "k-10"]), Some(1.25));
        assert_eq!(error(["d0-32", "exp-0.5"]), Some(3.77));
        // Equal numbers with the same inputs, and more contraction with less span, agree.
        assert_eq!((error(["r-0.50", "r0-1.5"]), error(["d0-32", "d0-26"])), (None, None));
        assert_eq!((1e4 * min(&found, |_| true)).round() / 1e2, 3.77);
    }

    #[test]
    fn numbers_that_agree_are_no_contradiction() {
        let mut rows = rows().unwrap();
        rows.retain(|row| ["d0-32", "k-1"].contains(&row.id.as_str()));
        assert_eq!(contradictions(&rows).unwrap(), []);
        // The softer string has the smaller number; the other way round it is a contradiction.
        let (a, b) = (rows[0].value, rows[1].value);
        (rows[0].value, rows[1].value) = (b, a);
        let found = contradictions(&rows).unwrap();
        assert!(matches!(&found[..], [one] if one.error == (a - b) / (a + b)), "{found:?}");
    }
}
