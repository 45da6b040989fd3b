//! The table of an identified scene. A scene without one is of no use to a board.
//!
//! Under light loads and many turns the strings of some rigs have no equilibrium, or a transmission ratio that no table
//! follows. The envelope then begins at a heavier load.

use rig_scene::{Envelope, Scene};
use tsa_table::fit::Fit as Table;

/// By how much the least load rises from one attempt to the next, and the greatest rise.
const STEP: f64 = 1.05;
const MOST: f64 = 2.0;

/// The table of a scene, whose envelope's least load rises to the first at which there is one; `None` if the scene does not
/// say what a table has to cover and how well.
///
/// # Errors
/// Why there is no table over the whole envelope, in words, if there is none at twice its least load either. The scene then
/// stays as it is.
pub fn table(scene: &mut Scene) -> Result<Option<Table>, String> {
    let (Some(envelope), Some(_)) = (scene.envelope, scene.accuracy) else { return Ok(None) };
    let why = match scene.fit_table() {
        Ok(table) => return Ok(Some(table)),
        Err(e) => e.to_string(),
    };
    let [least_n, most_n] = envelope.load_n;
    let mut from_n = least_n;
    while from_n * STEP <= MOST * least_n && from_n * STEP < most_n {
        // Three digits, as a person would write it.
        let digits = 10f64.powf(2.0 - (from_n * STEP).log10().floor());
        from_n = (from_n * STEP * digits).ceil() / digits;
        let narrowed = Scene { envelope: Some(Envelope { load_n: [from_n, most_n], ..envelope }), ..scene.clone() };
        if let Ok(table) = narrowed.fit_table() {
            *scene = narrowed;
            return Ok(Some(table));
        }
    }
    Err(why)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(least_n: f64) -> Scene {
        let mut scene = Scene::from_toml_str(include_str!("../../../../scenes/default.toml")).expect("a scene");
        scene.envelope.as_mut().expect("an envelope").load_n[0] = least_n;
        scene
    }

    #[test]
    fn the_least_load_rises_to_the_first_that_has_a_table() {
        // At 0.5 N and 7.5 turns the strings have no equilibrium.
        let mut narrowed = scene(0.5);
        assert!(table(&mut narrowed).expect("a table").is_some());
        let least_n = narrowed.envelope.expect("an envelope").load_n[0];
        assert!(narrowed.fit_table().is_ok() && least_n < 0.75, "{least_n}");
        assert!(scene(least_n / STEP / STEP).fit_table().is_err());
        assert_eq!(Scene { envelope: scene(0.5).envelope, ..narrowed }, scene(0.5));
    }

    #[test]
    fn a_scene_that_has_a_table_asks_for_none_or_can_have_none_stays_as_it_is() {
        let (mut sound, mut without) = (scene(1.0), Scene { accuracy: None, ..scene(0.5) });
        assert!(table(&mut sound).expect("a table").is_some());
        assert!(table(&mut without).expect("nothing is asked for").is_none());
        let mut hopeless = scene(0.2);
        assert!(table(&mut hopeless).expect_err("no equilibrium").contains("past a limit of the model"));
        assert_eq!([sound, without, hopeless], [scene(1.0), Scene { accuracy: None, ..scene(0.5) }, scene(0.2)]);
    }
}
