//! The error budget against the emulated rig, with one effect alone, as large as in a kind of rig.
//!
//! The budget is of first order and says nothing of a single rig, so that a factor is asked of the rms over some rigs.

use host_tests::rigs::commission::Firmware;
use host_tests::rigs::subject::{EFFECTS, Subject};
use host_tests::{ControlBench, scene};
use lab::budget::{Budget, Fraction, Part, RigErrors};
use rig_config::{Accuracy, Envelope, Scene};
use rig_link::messages::{LoadChoice, Request, State};
use rig_plant::{PlantKey, RigPreset};
use rigctl::statistics::rms;
use tsa_model::twist_from_turns;

const LOAD_N: f64 = 4.9;
const REST_M: f32 = 0.008;

/// The fraction of a part under one load, of a rig of its own model but for some keys as large as a kind of rig has them at most.
fn fraction(scene: &Scene, part: Part, keys: &[PlantKey], kind: RigPreset) -> Fraction {
    let size = |key: PlantKey| {
        let max = kind.extreme(key, 1.0).filter(|_| keys.contains(&key)).map_or(0.0, |change| change.value);
        if key == PlantKey::StictionRatio { (max - 1.0).max(0.0) } else { max }
    };
    Budget::new(scene, &RigErrors { sizes: &size, gauge_m: None }).expect("a budget").fraction(part)
}

/// The default scene at one load, where it rests in these tests: the budget has only the last state.
fn at_rest() -> Scene {
    let mechanism = scene().mechanism().expect("the default scene is good");
    let gap_m = |turns: f64| mechanism.solve(LOAD_N, twist_from_turns(turns)).expect("an equilibrium").gap_m;
    let [mut low, mut high] = [0.0, 7.5];
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if gap_m(0.0) - gap_m(middle) < f64::from(REST_M) { low = middle } else { high = middle }
    }
    Scene {
        envelope: Some(Envelope { load_n: [LOAD_N, 1.01 * LOAD_N], turns: [high - 1e-3, high] }),
        ..scene().clone()
    }
}

fn keys(name: &str) -> &'static [PlantKey] {
    EFFECTS.iter().find(|effect| effect.0 == name).expect("an effect of the study").1
}

/// The rig with one effect alone, homed, and moved to its rest.
fn rested(effect: &str, kind: RigPreset, seed: u64, firmware: &Firmware) -> ControlBench {
    let effect = EFFECTS.iter().find(|e| e.0 == effect).expect("an effect of the study");
    let subject = Subject::with_effect(effect, kind, None, seed);
    let mut bench = ControlBench::on(subject.switched_on(LOAD_N).expect("a rig"), firmware.boot());
    bench.home().expect("homes");
    go(&mut bench, REST_M);
    bench
}

fn go(bench: &mut ControlBench, target_m: f32) {
    bench.move_to(target_m, 2e-3, LoadChoice::Auto).expect("it arrives");
    bench.run(1.0);
}

/// Half widths are 1.645 standard errors.
fn compare(what: &str, measured: f64, half_width: f64, factors: [f64; 2]) {
    let ratio = measured / (half_width / 1.645);
    println!("{what}: measured {measured:.3e}, budget {:.3e}, ratio {ratio:.2}", half_width / 1.645);
    assert!((factors[0]..factors[1]).contains(&ratio), "{what}: {ratio}");
}

#[test]
fn the_sensor_makes_the_position_as_wrong_as_the_budget_says() {
    for kind in [RigPreset::Nominal, RigPreset::Hard] {
        let errors: Vec<f64> = (1..=8)
            .map(|seed| {
                let bench = rested("LVDT and converter", kind, seed, &Firmware::as_built());
                bench.true_position_m() - f64::from(REST_M)
            })
            .collect();
        let half_width = fraction(&at_rest(), Part::Sensor, keys("LVDT and converter"), kind).position_m;
        compare(&format!("sensor, {kind}, at rest"), rms(&errors), half_width, [0.5, 2.0]);
    }
}

#[test]
fn stiction_leaves_the_load_where_the_budget_says() {
    for kind in [RigPreset::Nominal, RigPreset::Hard] {
        let mut errors = Vec::new();
        for seed in 1..=3 {
            let mut bench = rested("rail friction", kind, seed, &Firmware::as_built());
            for target_m in [0.004, 0.009, 0.006] {
                bench.tick(Some(Request::Move { target_m, speed_m_per_s: 2e-3, load: LoadChoice::Auto }));
                bench.until(60.0, |bench| {
                    let set_point = bench.last.as_ref().and_then(|last| last.telemetry.setpoint_m);
                    errors.extend(set_point.map(|set_point_m| bench.true_position_m() - f64::from(set_point_m)));
                    bench.control.state() != State::Moving
                });
            }
        }
        let half_width = fraction(&at_rest(), Part::Friction, keys("rail friction"), kind).position_m;
        compare(&format!("friction, {kind}, in moves"), rms(&errors), half_width, [0.4, 2.5]);
    }
}

/// The load that homing finds with a rough table, less that with the scene's, on the same nominal rigs.
#[test]
fn a_rough_table_makes_the_load_as_wrong_as_the_budget_says() {
    let kind = RigPreset::Nominal;
    let rough = Accuracy { contraction_m: 520e-6, tr_relative: 0.11 };
    let rough = Scene { accuracy: Some(rough), ..scene().clone() };
    let fit = rough.fit_table().expect("a table");
    let fine = Firmware::as_built();
    let rough = Firmware { table: Box::leak(Box::new(Box::leak(Box::new(fit.table.clone())).table())), ..fine.clone() };
    let homed = |firmware: &Firmware, seed, load_n: f64| {
        let subject = Subject::new(kind, seed);
        let mut bench = ControlBench::on(subject.switched_on(load_n).expect("a rig"), firmware.boot());
        bench.home().expect("homes");
        bench.run(0.1);
        let reported_n = bench.last.as_ref().and_then(|last| last.telemetry.load_n).map(f64::from).expect("a load");
        reported_n / load_n
    };
    let mut loads = Vec::new();
    for load_n in [1.5, LOAD_N, 14.7] {
        loads.extend((1..=3).map(|seed| homed(&rough, seed, load_n) - homed(&fine, seed, load_n)));
    }
    let scene = Scene { envelope: Some(Envelope { load_n: [1.5, 14.7], turns: [0.0, 7.5] }), ..scene().clone() };
    let mut budget = Budget::new(&scene, &RigErrors { sizes: &|key| kind.rms(key), gauge_m: None }).expect("a budget");
    budget.set_table(&fit.table.table());
    let half_width = budget.fraction(Part::Table).load;
    compare("table, nominal, load after homing", rms(&loads), half_width, [0.1, 3.0]);
}
