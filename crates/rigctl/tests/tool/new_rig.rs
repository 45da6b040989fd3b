//! A new rig becomes a calibrated one, by the commands of `docs/how-to/calibrate.md` and on one emulated board: LVDT,
//! sweeps, constants, table, move; and what each of it was good for.

use crate::common::{error_of, folder, lines, rigctl};
use rig_config::Scene;
use serde_json::Value;
use std::path::{Path, PathBuf};
use tsa_model::twist_from_turns;

const SCENE: &str = "scenes/default.toml";
/// Load of the moves (N), between those of the sweeps.
const LOAD_N: f64 = 10.0;
/// How the rig differs from the scene, and its LVDT from its data sheet.
const RIG: &str =
    "k2_scale=1.15,k3_scale=0.85,stiffness_scale=1.15,modulus_scale=0.85,lvdt_offset=1mm,lvdt_gain_error=1%";

fn truth() -> Scene {
    let mut truth = Scene::load(Path::new("../..").join(SCENE)).expect("the default scene");
    truth.string.k2 *= 1.15;
    truth.string.k3 *= 0.85;
    truth.string.stiffness_n_per_m *= 1.15;
    truth.material.stress_coefficients_pa = truth.material.stress_coefficients_pa.map(|a| a * 0.85);
    truth
}

/// Maximum error of the contraction (m) over the envelope, loads between those of the sweeps included.
fn contraction_error_m(scene: &Scene) -> f64 {
    let contraction = |scene: &Scene, load: f64, turns: f64| {
        let m = scene.mechanism().expect("a mechanism");
        let gap = |turns| m.solve(load, twist_from_turns(turns)).expect("solved").gap_m;
        gap(0.0) - gap(turns)
    };
    let (truth, loads) = (truth(), [2.0, 4.0, 7.0, 11.0, 15.0]);
    let states = loads.into_iter().flat_map(|l| (1..=15).map(move |k| (l, 0.5 * f64::from(k))));
    states.map(|(l, t)| (contraction(scene, l, t) - contraction(&truth, l, t)).abs()).fold(0.0, f64::max)
}

/// The board: its flash, and the scene that the tool believes in.
struct Board {
    flash: PathBuf,
    scene: String,
}

impl Board {
    /// The last object that the command prints.
    fn runs(&self, arguments: &[&str]) -> Value {
        let flash = self.flash.to_str().expect("a path");
        let board = ["--json", "--scene", &self.scene, "--plant-scene", SCENE, "--flash", flash, "--plant", RIG];
        let output = rigctl(&[arguments, &board].concat());
        assert!(output.status.success(), "{arguments:?}: {}", error_of(&output));
        lines(&output).pop().unwrap_or_default()
    }

    fn number(&self, arguments: &[&str], key: &str) -> f64 {
        let found = self.runs(arguments);
        found[key].as_f64().unwrap_or_else(|| panic!("no {key} in {found}"))
    }

    /// Errors after a move: of the position (m), and of the load estimate as a fraction.
    fn moved(&self) -> [f64; 2] {
        let end = self.runs(&["move", "--to", "12mm", "--plant", &format!("load={LOAD_N}N")]);
        let number = |key: &str| end[key].as_f64().unwrap_or_else(|| panic!("no {key} in {end}"));
        [number("true_error_m"), number("load_n") / LOAD_N - 1.0]
    }

    /// Gap by callipers, which read to 20 um, with the strings twisted so far at power-up.
    fn measured(&self, twist: &str) -> f64 {
        let true_m = self.number(&["calibrate", "lvdt", "--plant", twist], "true_gap_m");
        (true_m / 20e-6).round() * 20e-6
    }
}

#[test]
fn a_rig_15_percent_off_its_scene_is_calibrated_on_its_own_board() {
    let folder = folder("new-rig");
    let path = |name: &str| folder.join(name).to_str().expect("a path").to_owned();
    let mut board = Board { flash: folder.join("flash.bin"), scene: SCENE.into() };
    let before = board.moved();

    let (wide, narrow) = ("twist_at_boot=1", "twist_at_boot=40");
    let first_m = board.measured(wide);
    let first = ["calibrate", "lvdt", "--plant", wide, "--gap", &first_m.to_string()];
    let point = format!("{first_m}:{}", board.number(&first, "sensor_m"));
    let second_m = board.measured(narrow).to_string();
    board.runs(&["calibrate", "lvdt", "--plant", narrow, "--gap", &second_m, "--point", &point]);

    let sweeps = ["2", "7", "15"].map(|load_n| path(&format!("sweep-{load_n}N.csv")));
    // At once, each on a board with a copy of this one's flash: a sweep keeps nothing there.
    std::thread::scope(|scope| {
        for (load_n, sweep) in ["2N", "7N", "15N"].iter().zip(&sweeps) {
            let twin = Board { flash: folder.join(format!("{load_n}.bin")), scene: board.scene.clone() };
            std::fs::copy(&board.flash, &twin.flash).expect("calibrated by now");
            scope.spawn(move || {
                assert!(
                    twin.number(&["sweep", "--load", load_n, "--speed", "25rpm", "--out", sweep], "equilibria") > 65.0
                )
            });
        }
    });
    let [found, figure] = ["found.toml", "found.svg"].map(path);
    let files = sweeps.iter().map(String::as_str);
    let identify: Vec<&str> = ["identify", "--fit", "k2,k3,K,modulus", "--out", &found, "--figure", &figure]
        .into_iter()
        .chain(files)
        .collect();
    let fit = board.runs(&identify);
    board.scene = found;
    let [was_m, is_m] = [Path::new("../..").join(SCENE), folder.join("found.toml")]
        .map(|scene| contraction_error_m(&Scene::load(scene).expect("a scene")));
    let table_m = board.number(&["table", "--board"], "contraction_error_m");
    let after = board.moved();

    println!("{fit:#}");
    println!(
        "model off by {:.0} um before, {:.1} um after; table within {:.2} um",
        was_m * 1e6,
        is_m * 1e6,
        table_m * 1e6
    );
    let [a, b] = [before, after].map(|[m, fraction]| format!("{:+.1} um, load {:+.2} %", m * 1e6, fraction * 100.0));
    println!("12 mm under {LOAD_N} N: {a} before; {b} after");
    assert!(was_m > 0.5e-3 && is_m < 60e-6, "{was_m} m before, {is_m} m after");
    assert!(table_m < 5e-6);
    assert!(before[0].abs() > 60e-6 && after[0].abs() < 30e-6, "{before:?} {after:?}");
    // Of the load itself: from one seed of the noise to the next homing weighs 1.6 % rms otherwise, so that a single load
    // tells nothing finer.
    assert!(after[1].abs() < 0.05, "{before:?} {after:?}");
}
