//! The envelope of an identified scene. Under light loads and many turns the strings of some rigs have no equilibrium, or
//! a transmission ratio that no table follows; a scene without a table is of no use to a board.

use rig_scene::{Envelope, Scene};

/// By how much the least load rises from one attempt to the next, and the greatest rise.
const STEP: f64 = 1.05;
const MOST: f64 = 2.0;

/// Raises the least load of the envelope to the first at which the scene has a table. The scene stays as it is if it has
/// one, asks for none, or would still have none at twice its least load. Returns the load (N) that it had before.
pub fn narrow(scene: &mut Scene) -> Option<f64> {
    let envelope = scene.envelope.filter(|_| scene.accuracy.is_some())?;
    let [least_n, most_n] = envelope.load_n;
    let mut rise = 1.0;
    while rise <= MOST && rise * least_n < most_n {
        // Three digits, as a person would write it.
        let digits = 10f64.powf(2.0 - (rise * least_n).log10().floor());
        let from_n = (rise * least_n * digits).ceil() / digits;
        let narrowed = Scene { envelope: Some(Envelope { load_n: [from_n, most_n], ..envelope }), ..scene.clone() };
        if narrowed.fit_table().is_ok() {
            *scene = narrowed;
            return (from_n > least_n).then_some(least_n);
        }
        rise *= STEP;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(least_n: f64) -> Scene {
        let mut scene = Scene::from_toml_str(include_str!("../../../../scenes/default.toml")).unwrap();
        scene.envelope.as_mut().unwrap().load_n[0] = least_n;
        scene
    }

    #[test]
    fn the_least_load_rises_to_the_first_that_has_a_table() {
        // At 0.5 N and 7.5 turns the strings have no equilibrium.
        let mut narrowed = scene(0.5);
        assert_eq!(narrow(&mut narrowed), Some(0.5));
        let least_n = narrowed.envelope.unwrap().load_n[0];
        assert!(narrowed.fit_table().is_ok() && least_n < 0.75, "{least_n}");
        assert!(scene(least_n / STEP).fit_table().is_err());
        assert_eq!(Scene { envelope: scene(0.5).envelope, ..narrowed }, scene(0.5));
    }

    #[test]
    fn a_scene_that_has_a_table_or_can_have_none_stays_as_it_is() {
        let mut sound = scene(1.0);
        let mut hopeless = scene(0.2);
        let mut without = Scene { accuracy: None, ..scene(0.5) };
        for scene in [&mut sound, &mut hopeless, &mut without] {
            let before = scene.clone();
            assert_eq!(narrow(scene), None);
            assert_eq!(*scene, before);
        }
    }
}
