//! Scenes of rigs that cannot work: refused before anything is built, started or spoken to.

use crate::common::{error_of, file, lines, rigctl, root, text};
use std::path::PathBuf;
use std::process::Output;

/// The default scene with one key changed, in a file of its own.
struct Changed(PathBuf);

impl Changed {
    fn new(key: &str, value: &str) -> Self {
        let scene = std::fs::read_to_string(root().join("scenes/default.toml")).expect("the default scene");
        let line = scene.lines().find(|line| line.starts_with(&format!("{key} = "))).expect("a key of it");
        // Two tests that run at once may change the same key.
        let path = file(&format!("scene-{key}-{value}.toml"));
        std::fs::write(&path, scene.replace(line, &format!("{key} = {value}"))).expect("written");
        Self(path)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        rigctl(&[arguments, &["--scene", text(&self.0)]].concat())
    }
}

#[test]
fn a_rig_that_cannot_work_is_refused_wherever_a_rig_is_meant() {
    let weak = Changed::new("drive_current_limit_a", "0.001");
    for arguments in [
        &["home"][..],
        &["move", "--to", "1mm"],
        &["sim"],
        &["doctor"],
        &["table"],
        &["table", "--board"],
        &["home", "--port", "/dev/no-such-port"],
    ] {
        let refused = weak.run(arguments);
        let said = error_of(&refused);
        assert_eq!(refused.status.code(), Some(1), "{arguments:?}: {said}");
        for named in ["rig.drive_current_limit_a", "0.001 A", text(&weak.0)] {
            assert!(said.contains(named), "{arguments:?} does not name {named}: {said}");
        }
    }
    // A solve has nothing to do with the motor.
    assert!(weak.run(&["solve", "--load", "5N", "--turns", "3"]).status.success());
    // The emulated board is told of the same rig as of any other: it refuses by itself.
    let plant = text(&weak.0);
    let refused = rigctl(&["home", "--plant-scene", plant]);
    assert!(error_of(&refused).contains("rig.drive_current_limit_a"), "{}", error_of(&refused));
}

#[test]
fn what_could_hurt_hardware_is_refused_even_for_a_solve() {
    let hot = Changed::new("supply_divider", "1.0");
    let refused = hot.run(&["solve", "--load", "5N", "--turns", "3"]);
    assert_eq!(refused.status.code(), Some(1));
    let said = error_of(&refused);
    assert!(["rig.supply_divider", "28.8 V", "5 V"].iter().all(|named| said.contains(named)), "{said}");
}

#[test]
fn what_is_unusual_is_said_and_goes_on() {
    let stout = Changed::new("supply_divider", "2000.0");
    let made = stout.run(&["table", "--json"]);
    let said = error_of(&made);
    assert!(made.status.success() && said.contains("warning") && said.contains("rig.supply_divider"), "{said}");
    assert_eq!(lines(&made).len(), 1, "the warning is not in the table's own output");
}

#[test]
fn an_emulated_board_is_sent_the_table_of_the_scene_whatever_its_flash_has() {
    let flash = file("scenes.flash");
    let other = Changed::new("k2", "0.13");
    let default = root().join("scenes/default.toml");
    for _ in 0..2 {
        for scene in [text(&other.0), text(&default)] {
            let homed = rigctl(&["home", "--scene", scene, "--flash", text(&flash)]);
            assert!(homed.status.success() && error_of(&homed).contains("was sent the table"), "{}", error_of(&homed));
        }
    }
}

#[test]
fn a_given_weight_that_the_rig_contradicts_is_said() {
    let homed = rigctl(&["home", "--load", "0.5kg", "--plant", "load=1kg"]);
    let said = String::from_utf8_lossy(&homed.stdout);
    assert!(homed.status.success() && said.contains("the load is unknown"), "{said}");
}
