//! The table of an identified scene. A scene without one is of no use to a board.
//!
//! A law that predicts well where sweeps were recorded may have no equilibrium at an edge of the envelope, or a radius there
//! that no table within its size follows.

use lab::parallel::parallel;
use rig_scene::{Envelope, Scene};
use serde::Serialize;
use tsa_table::fit::Fit as Table;

/// How far a limit of the envelope is moved inwards to see whether it is the cause: by these factors in turn.
const INWARDS: [f64; 2] = [0.8, 0.5];

/// That no candidate has a table.
#[derive(Debug, Clone, Serialize)]
pub struct Untabled {
    /// Why the scene that is written has none.
    pub why: String,
    /// Limits of the envelope each of which, moved inwards alone as said here, leaves a table; none if no single one does.
    pub limits: Vec<String>,
}

/// The table of a scene; `None` if the scene does not say what a table has to cover and how well.
///
/// # Errors
/// Why there is none, in words.
pub fn table(scene: &Scene) -> Result<Option<Table>, String> {
    if scene.envelope.is_none() || scene.accuracy.is_none() {
        return Ok(None);
    }
    scene.fit_table().map(Some).map_err(|e| e.to_string())
}

/// Which limits of the envelope are the cause that a scene has no table.
pub fn limits(scene: &Scene) -> Vec<String> {
    let Some(envelope) = scene.envelope else { return Vec::new() };
    let ([least_n, most_n], [first, last]) = (envelope.load_n, envelope.turns);
    let moved = |limit: usize, by: f64| match limit {
        0 => (
            Envelope { load_n: [least_n / by, most_n], ..envelope },
            "envelope.load_n from",
            least_n,
            least_n / by,
            "N",
        ),
        1 => {
            (Envelope { load_n: [least_n, most_n * by], ..envelope }, "envelope.load_n up to", most_n, most_n * by, "N")
        }
        _ => (Envelope { turns: [first, last * by], ..envelope }, "envelope.turns up to", last, last * by, "turns"),
    };
    let cause = |limit: usize| {
        INWARDS.into_iter().find_map(|by| {
            let (envelope, name, old, new, unit) = moved(limit, by);
            let smaller = Scene { envelope: Some(envelope), ..scene.clone() };
            let valid = smaller.validate().is_ok() && smaller.fit_table().is_ok();
            valid.then(|| format!("{name} {new:.2} {unit} instead of {old:.2} {unit}"))
        })
    };
    parallel(&|_, _| (), 3, cause).into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        Scene::load(format!("{}/../../scenes/default.toml", env!("CARGO_MANIFEST_DIR"))).expect("a scene")
    }

    #[test]
    fn the_limit_that_leaves_no_table_is_named() {
        let scene = scene();
        let envelope = scene.envelope.expect("an envelope");
        let far =
            Scene { envelope: Some(Envelope { turns: [0.0, 1.25 * envelope.turns[1]], ..envelope }), ..scene.clone() };
        assert!(table(&far).expect_err("too many turns").contains("past a limit of the model"));
        let named = limits(&far);
        assert!(named.iter().any(|limit| limit.starts_with("envelope.turns up to 7.50")), "{named:?}");
        assert!(table(&scene).expect("a table").is_some());
        assert!(table(&Scene { accuracy: None, ..scene }).expect("nothing is asked for").is_none());
    }
}
