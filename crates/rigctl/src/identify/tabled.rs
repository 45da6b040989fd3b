//! The table of an identified scene. A scene without one is of no use to a board.
//!
//! Under light loads and many turns the strings of some rigs have no equilibrium, or a transmission ratio that no table
//! follows. The envelope then begins at a heavier load.

use rig_config::{Envelope, Scene};
use tsa_table::fit::Fit as Table;

/// By how much a limit moves inwards from one attempt to the next, and at most: first the least load, then the turns.
const STEP: f64 = 1.05;
const MOST: f64 = 2.0;

/// The table of a scene; `None` if the scene does not say what a table has to cover and how well. Where there is no table
/// over the whole envelope, its least load rises to the first at which there is one, at most to twice; if that is not
/// enough, its turns become fewer too, at most by half.
///
/// # Errors
/// Why there is no table over the whole envelope, in words, if there is none over a smaller one either. The scene then stays
/// as it is.
pub fn table(scene: &mut Scene) -> Result<Option<Table>, String> {
    let (Some(envelope), Some(_)) = (scene.envelope, scene.accuracy) else { return Ok(None) };
    let why = match scene.fit_table() {
        Ok(table) => return Ok(Some(table)),
        Err(e) => e.to_string(),
    };
    let steps = (MOST.ln() / STEP.ln()).round() as i32;
    let ([least_n, most_n], [first, last]) = (envelope.load_n, envelope.turns);
    for step in 1..=2 * steps {
        let (up, back) = (STEP.powi(step.min(steps)), STEP.powi((step - steps).max(0)));
        let narrowed =
            Envelope { load_n: [three_digits(up * least_n), most_n], turns: [first, three_digits(last / back)] };
        let narrowed = Scene { envelope: Some(narrowed), ..scene.clone() };
        if narrowed.validate().is_ok()
            && let Ok(table) = narrowed.fit_table()
        {
            *scene = narrowed;
            return Ok(Some(table));
        }
    }
    Err(why)
}

/// As a person would write it.
fn three_digits(value: f64) -> f64 {
    let digits = 10f64.powf(2.0 - value.log10().floor());
    (value * digits).round() / digits
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
    fn the_turns_become_fewer_where_twice_the_least_load_has_no_table_either() {
        let mut narrowed = scene(0.5);
        narrowed.envelope.as_mut().expect("an envelope").turns[1] = 10.0;
        assert!(table(&mut narrowed).expect("a table").is_some());
        let envelope = narrowed.envelope.expect("an envelope");
        assert!(envelope.load_n[0] > 0.98 && (7.5..9.6).contains(&envelope.turns[1]), "{envelope:?}");
    }

    #[test]
    fn a_scene_that_has_a_table_asks_for_none_or_can_have_none_stays_as_it_is() {
        let (mut sound, mut without) = (scene(1.0), Scene { accuracy: None, ..scene(0.5) });
        assert!(table(&mut sound).expect("a table").is_some());
        assert!(table(&mut without).expect("nothing is asked for").is_none());
        let mut hopeless = scene(0.05);
        assert!(table(&mut hopeless).expect_err("no equilibrium").contains("past a limit of the model"));
        assert_eq!([sound, without, hopeless], [scene(1.0), Scene { accuracy: None, ..scene(0.5) }, scene(0.05)]);
    }
}
