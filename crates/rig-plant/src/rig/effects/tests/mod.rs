//! Each effect on the rig against its own equation, and all of them against the conservation of energy.

use crate::bench::settings;
use crate::board::{Board, Stimulus};
use crate::rig::EmulatedRig;
use crate::rig::built_in::BuiltIn;
use crate::rig::plant::Plant;
use crate::{PlantSettings, RigPreset};
use rig_config::Scene;
use std::f64::consts::{PI, TAU};
use tsa_model::Mechanism;

/// Rods that strain by up to 4.8 % under 15 N, so that all of them transform.
const SCENE: &str = "paper-identified";

fn scene(name: &str) -> Scene {
    let file = format!("{}/../../scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Scene::load(file).unwrap_or_else(|e| panic!("{e}"))
}

fn rig(keys: &[(&str, &str)]) -> EmulatedRig {
    EmulatedRig::new(&scene(SCENE), settings(keys), 1).unwrap_or_else(|e| panic!("{e}"))
}

/// The load and its mechanism by themselves, without friction unless the keys give it.
struct Hung {
    plant: BuiltIn,
    shaft_rad: f64,
    /// Work of shaft and weight on the mechanism, J.
    work_j: f64,
}

const H: f64 = 1e-3;

impl Hung {
    fn new(keys: &[(&str, &str)]) -> Self {
        let keys = [&[("friction", "0"), ("twist_at_boot", "3.2")], keys].concat();
        Self::of(rig(&keys))
    }

    fn of(rig: EmulatedRig) -> Self {
        let shaft_rad = rig.settings.twist_at_boot_rad;
        let Plant::BuiltIn(plant) = rig.plant else { panic!("built in") };
        Self { shaft_rad, plant: *plant, work_j: 0.0 }
    }

    fn step(&mut self, h: f64, shaft_rad: f64) {
        let (before_nm, before_m) = (self.plant.torque_nm(), self.plant.gap_m);
        self.plant.step(h, shaft_rad);
        let mean_nm = 0.5 * (before_nm + self.plant.torque_nm());
        self.work_j +=
            self.plant.settings.load_n * (self.plant.gap_m - before_m) - mean_nm * (shaft_rad - self.shaft_rad);
        self.shaft_rad = shaft_rad;
    }

    fn turn_to(&mut self, shaft_rad: f64, seconds: f64) {
        let (from, steps) = (self.shaft_rad, (seconds / H) as u32);
        (1..=steps).for_each(|k| self.step(H, from + (shaft_rad - from) * f64::from(k) / f64::from(steps)));
    }

    fn load_to(&mut self, load_n: f64, seconds: f64) {
        let (from, steps) = (self.plant.settings.load_n, (seconds / H) as u32);
        for k in 1..=steps {
            self.plant.settings.load_n = from + (load_n - from) * f64::from(k) / f64::from(steps);
            self.step(H, self.shaft_rad);
        }
    }

    /// By how much the load would be taken wrong from gap and twist, N.
    fn wrong_n(&self) -> f64 {
        let surface = &self.plant.surface;
        surface.pull(self.shaft_rad, self.plant.gap_m, self.plant.settings.load_n).force_n - self.plant.settings.load_n
    }
}

#[test]
fn rods_remember_a_heavy_load_and_a_sweep_of_the_twist_does_not_show_it() {
    let mut hung = Hung::new(&[("rod_hysteresis", "60MPa"), ("load", "0.5N")]);
    let wrong = |hung: &mut Hung, load_n: f64| {
        hung.load_to(load_n, 3.0);
        hung.turn_to(3.2, 2.0);
        hung.wrong_n()
    };
    let before = [1.0, 5.0, 10.0].map(|load_n| wrong(&mut hung, load_n));
    wrong(&mut hung, 15.0);
    let mut after = [10.0, 5.0, 1.0].map(|load_n| wrong(&mut hung, load_n));
    after.reverse();
    // 60 MPa either way, as a fraction of the stress, on the fraction of the compliance that is the rods'.
    for (k, expected) in [0.6, 1.1, 1.0].into_iter().enumerate() {
        let loop_n = after[k] - before[k];
        assert!((loop_n / expected - 1.0).abs() < 0.25, "{loop_n} N wider by the visit, about {expected} expected");
    }
    // The first sweep may still slip an element; the second closes.
    hung.load_to(5.0, 5.0);
    let way = |hung: &mut Hung, to: f64| {
        (0..10)
            .map(|k| {
                let from = hung.shaft_rad;
                hung.turn_to(from + (to - from) / f64::from(10 - k), 1.0);
                hung.turn_to(hung.shaft_rad, 2.0);
                hung.plant.gap_m
            })
            .collect::<Vec<_>>()
    };
    hung.turn_to(40.0, 5.0);
    hung.turn_to(3.2, 5.0);
    let up = way(&mut hung, 40.0);
    hung.turn_to(40.0, 1.0);
    let down = way(&mut hung, 3.2);
    for k in 0..9 {
        assert!((up[k] - down[8 - k]).abs() < 2e-6, "{} and {}", up[k], down[8 - k]);
    }
}

/// At rest, the predicted gap of the present load is its gap.
#[test]
fn a_load_hangs_where_rods_that_remember_say_that_it_does() {
    for kelvin in ["-10", "10"] {
        let mut hung = Hung::new(&[("rod_hysteresis", "60MPa"), ("load", "0.5N"), ("temperature", kelvin)]);
        for load_n in [15.0, 5.0, 12.0, 0.5] {
            hung.load_to(load_n, 3.0);
            hung.turn_to(3.2, 5.0);
            let (gap_m, told_m) = (hung.plant.gap_m, hung.plant.gap_at(3.2));
            assert!((gap_m - told_m).abs() < 2e-6, "{load_n} N: {gap_m} and {told_m} m");
        }
    }
}

#[test]
fn warm_rods_are_stiffer_under_a_heavy_load_only() {
    let gap = |load: &str, kelvin: &str| {
        let hung = Hung::new(&[("load", load), ("temperature", kelvin)]);
        hung.plant.gap_m
    };
    let light_m = gap("8N", "0") - gap("8N", "10");
    assert!(light_m.abs() < 1e-9, "{light_m}");
    // As much as a modulus that is greater by the fraction of the stress: 6.5 MPa/K of the law's at the clamp.
    let stress_pa = {
        let scene = scene(SCENE);
        let mechanism = Mechanism::new(&scene.geometry, &scene.string, &scene.material).unwrap();
        scene.material.stress_pa(mechanism.solve(15.0, 3.2).unwrap().bending_strain)
    };
    let fraction = 6.5e6 * 5.0 / stress_pa;
    let stiffer =
        |fraction: f64| Hung::new(&[("load", "15N"), ("modulus_scale", &format!("{}", 1.0 + fraction))]).plant.gap_m;
    let warm_m = gap("15N", "5");
    let (by_temperature, by_modulus) = (gap("15N", "-5") - warm_m, stiffer(-fraction) - stiffer(fraction));
    assert!((by_temperature / by_modulus - 1.0).abs() < 0.05, "{by_temperature} and {by_modulus} m");
    // A change in the run does the same.
    let mut r = rig(&[("load", "15N"), ("friction", "0"), ("twist_at_boot", "3.2")]);
    r.set_plant("temperature", "5").unwrap_or_else(|e| panic!("{e}"));
    let mut hung = Hung::of(r);
    hung.turn_to(3.2, 5.0);
    assert!((hung.plant.gap_m - warm_m).abs() < 5e-6, "{} {warm_m}", hung.plant.gap_m);
}

#[test]
fn strings_creep_as_a_softer_string_would_stretch() {
    let mut hung = Hung::new(&[("string_creep", "0.3"), ("load", "5N")]);
    let start_m = hung.plant.gap_m;
    (0..300).for_each(|_| hung.step(1e-2, 3.2));
    let after_3s = hung.plant.gap_m - start_m;
    (0..200_000).for_each(|_| hung.step(5e-2, 3.2));
    let end = hung.plant.gap_m - start_m;
    let softer = Hung::new(&[("stiffness_scale", &format!("{}", 1.0 / 1.3)), ("load", "5N")]).plant.gap_m - start_m;
    // Their pull is a little more than half the load each, because they are inclined.
    assert!((end / softer - 1.0).abs() < 0.15, "{end} and {softer} m");
    let first = (1.0 - (-1f64).exp() + (1.0 - (-0.05f64).exp()) + (1.0 - (-3.0f64 / 1800.0).exp())) / 3.0;
    assert!((after_3s / (0.3 * 5.0 / (2.0 * 1370.0)) / first - 1.0).abs() < 0.05, "{after_3s} m after 3 s");
}

/// Gap of a scene's mechanism with strings of another diameter, m.
fn with_diameter(name: &str, factor: f64, load_n: f64, twist_rad: f64) -> f64 {
    let mut scene = scene(name);
    scene.string.diameter_m *= factor;
    let mechanism = Mechanism::new(&scene.geometry, &scene.string, &scene.material).unwrap();
    mechanism.formal(load_n, twist_rad).unwrap().gap_m
}

#[test]
fn after_twenty_cycles_the_mechanism_is_that_of_thinner_strings() {
    let mut hung = Hung::new(&[("string_bedding", "0.05"), ("load", "5N"), ("twist_at_boot", "0.1")]);
    for _ in 0..20 {
        hung.turn_to(0.1 + 7.5 * TAU, 1.0);
        hung.turn_to(0.1, 1.0);
    }
    hung.turn_to(30.0, 2.0);
    hung.turn_to(30.0, 4.0);
    let turned = (20.0 * 15.0 * TAU + 29.9) / (15.0 * TAU * 20.0);
    let left = 1.0 - 0.05 * (1.0 - (-turned).exp());
    let expected = with_diameter(SCENE, left, 5.0, 30.0);
    assert!((hung.plant.gap_m - expected).abs() < 3e-6, "{} and {expected}", hung.plant.gap_m);
    assert!((expected - with_diameter(SCENE, 1.0, 5.0, 30.0)).abs() > 100e-6);
}

#[test]
fn another_exponent_contracts_as_the_solver_says_by_either_law() {
    let shifted = |name: &str, shift: &str| {
        let settings = settings(&[("twist_exponent_shift", shift), ("load", "5N"), ("twist_at_boot", "30")]);
        EmulatedRig::new(&scene(name), settings, 1).unwrap_or_else(|e| panic!("{e}")).truth().gap_m
    };
    let mut exact = scene(SCENE);
    exact.string.twist_exponent = exact.string.twist_exponent.map(|p| p + 0.05);
    let mechanism = Mechanism::new(&exact.geometry, &exact.string, &exact.material).unwrap();
    let expected = mechanism.solve(5.0, 30.0).unwrap().gap_m;
    assert!((shifted(SCENE, "0.05") - expected).abs() < 1e-6);
    assert!(shifted(SCENE, "0") - expected > 100e-6, "a greater exponent contracts more");
    // The law by the length has no exponent: its radius is multiplied by the power of the twist.
    let expected = with_diameter("paper-identified-eq6", (30.0 / PI).powf(0.05), 5.0, 30.0);
    assert!((shifted("paper-identified-eq6", "0.05") - expected).abs() < 2e-6);
}

#[test]
fn play_in_the_twist_is_a_loop_of_its_width() {
    let mut hung = Hung::new(&[("twist_play", "0.4"), ("load", "5N")]);
    hung.turn_to(30.0, 5.0);
    hung.turn_to(20.0, 5.0);
    hung.turn_to(20.0, 4.0);
    let ideal = |twist: f64| hung.plant.surface.gap(twist, 5.0).gap_m;
    assert!((hung.plant.gap_m - ideal(20.2)).abs() < 1e-6, "on the way down the strings are behind by half the play");
    hung.turn_to(19.0, 1.0);
    hung.turn_to(19.2, 1.0);
    assert_eq!(hung.plant.torque_nm(), 0.0, "within the play the strings do not pull at the shaft");
    hung.turn_to(20.0, 1.0);
    hung.turn_to(20.0, 4.0);
    let ideal = hung.plant.surface.gap(19.8, 5.0).gap_m;
    assert!((hung.plant.gap_m - ideal).abs() < 1e-6, "on the way up, too");
    assert!(hung.plant.torque_nm() < -1e-3);
}

#[test]
fn the_rail_holds_by_its_static_friction_with_the_loads_share() {
    let keys = [
        ("friction", "0.2"),
        ("friction_load_share", "2%"),
        ("stiction_ratio", "1.5"),
        ("stribeck_speed", "2mm/s"),
        ("presliding", "10um"),
        ("load", "5N"),
        ("twist_at_boot", "20"),
    ];
    let mut hung = Hung::new(&keys);
    let start_m = hung.plant.gap_m;
    // (0.2 + 2 % of 5.46) x 1.5 N, which the give takes up over 10 um.
    hung.load_to(5.45, 5.0);
    let give_m = hung.plant.gap_m - start_m;
    assert!(give_m > 1e-6 && give_m < 12e-6, "{give_m} m below static friction");
    hung.load_to(5.52, 5.0);
    assert!(hung.plant.gap_m - start_m > 50e-6, "{} m above it", hung.plant.gap_m - start_m);
}

/// What the drive reports of the current while it holds still, A.
fn reported(keys: &[(&str, &str)], seed: u64) -> Vec<f64> {
    let mut rig = EmulatedRig::new(&scene(SCENE), settings(keys), seed).unwrap_or_else(|e| panic!("{e}"));
    rig.gpio_out(0.0, 'B', 1 << 10);
    crate::rig::tests::start(&mut rig);
    crate::rig::tests::listen(&mut rig, 3.0)
        .into_iter()
        .filter_map(|report| match report {
            rmds405::Report::Motion { current, .. } => Some(f64::from(current.0) * 1e-3),
            _ => None,
        })
        .collect()
}

#[test]
fn the_reported_current_has_offset_noise_and_quantum_and_its_noise_is_no_stall() {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let exact = reported(&[], 1);
    let wrong = reported(&[("current_offset", "20mA"), ("current_noise", "300mA"), ("current_quantum", "50mA")], 1);
    assert!(wrong.len() > 150 && wrong.iter().all(|a| ((a / 0.05).round() * 0.05 - a).abs() < 1e-9));
    assert!(reported(&[("current_offset", "20mA")], 1).iter().zip(&exact).all(|(a, b)| (a - b - 0.02).abs() < 1.1e-3));
    assert!((mean(&wrong) - mean(&exact) - 0.02).abs() < 0.08, "{}", mean(&wrong) - mean(&exact));
    let rms = (wrong.iter().map(|a| (a - mean(&wrong)).powi(2)).sum::<f64>() / wrong.len() as f64).sqrt();
    assert!((0.25..0.35).contains(&rms), "{rms} A");
}

/// Keys of each effect of the mechanism, as large as on a hard rig.
const EFFECTS: [(&str, &[(&str, &str)]); 8] = [
    ("friction", &[("friction", "0.4"), ("friction_load_share", "3%")]),
    (
        "stribeck",
        &[("friction", "0.4"), ("stiction_ratio", "1.5"), ("stribeck_speed", "2mm/s"), ("presliding", "10um")],
    ),
    ("memory", &[("rod_hysteresis", "90MPa")]),
    ("creep", &[("string_creep", "0.3")]),
    ("bedding", &[("string_bedding", "0.05")]),
    ("play", &[("twist_play", "1.4")]),
    ("warm", &[("temperature", "10")]),
    ("cold", &[("temperature", "-10")]),
];

/// Work put into a cycle of the twist and one of the load, each closed at the second time round, J.
fn cycles(keys: &[(&str, &str)]) -> [f64; 2] {
    let mut hung = Hung::new(&[&[("load", "5N")], keys].concat());
    let turn = |hung: &mut Hung| {
        hung.turn_to(40.0, 4.0);
        hung.turn_to(5.0, 4.0);
        hung.turn_to(5.0, 1.0);
    };
    turn(&mut hung);
    hung.work_j = 0.0;
    turn(&mut hung);
    let twist_j = hung.work_j;
    hung.turn_to(20.0, 2.0);
    let lift = |hung: &mut Hung| {
        hung.load_to(15.0, 4.0);
        hung.load_to(2.0, 4.0);
        hung.turn_to(20.0, 1.0);
    };
    lift(&mut hung);
    hung.work_j = 0.0;
    lift(&mut hung);
    [twist_j, hung.work_j]
}

#[test]
fn no_effect_creates_energy_alone_or_with_the_others() {
    // A stroke lifts 5 N by some 20 mm, 100 mJ. Without an effect the damping takes its part; no effect gives back more
    // than the step rule is wrong by.
    const OFF_J: f64 = 50e-6;
    let [damped_twist_j, damped_load_j] = cycles(&[]);
    for (name, keys) in EFFECTS {
        let [twist_j, load_j] = cycles(keys);
        let (twist_j, load_j) = (twist_j - damped_twist_j, load_j - damped_load_j);
        assert!(twist_j > -OFF_J && load_j > -OFF_J, "{name}: {twist_j} J by the twist, {load_j} J by the load");
        match name {
            "friction" | "stribeck" => assert!(twist_j > 5e-3 && load_j > 5e-3, "{name}: {twist_j} {load_j}"),
            "memory" => assert!(twist_j < 0.5e-3 && load_j > 5e-3, "{name}: {twist_j} {load_j}"),
            "creep" => assert!(load_j > OFF_J, "{name}: {load_j}"),
            _ => {}
        }
    }
    let all = EFFECTS.iter().filter(|(name, _)| *name != "cold").flat_map(|(_, keys)| keys.iter().copied());
    let [twist_j, load_j] = cycles(&all.collect::<Vec<_>>());
    assert!(twist_j > 1e-3 && load_j > 1e-3, "all: {twist_j} J by the twist, {load_j} J by the load");
}

#[test]
fn a_seed_names_one_rig_to_the_last_bit() {
    let run = |preset, seed| {
        let settings = PlantSettings::preset(preset, seed);
        let mut rig = EmulatedRig::new(&scene(SCENE), settings, seed).unwrap_or_else(|e| panic!("{e}"));
        rig.record();
        let codes: Vec<u16> = (0..500).map(|k| rig.adc(1e-3 * f64::from(k), 0)).collect();
        let pins = rig.poll(0.5).iter().filter(|s| matches!(s, Stimulus::Pin { .. })).count();
        format!("{codes:?} {pins} {:?}", rig.take_records())
    };
    let hard = run(RigPreset::Hard, 3);
    assert!(hard == run(RigPreset::Hard, 3) && hard != run(RigPreset::Hard, 4) && hard != run(RigPreset::Nominal, 3));
    assert_eq!(PlantSettings::preset(RigPreset::Ideal, 9), PlantSettings::default());
}

/// ∂T/∂F = ∂G/∂θ on the surface, and the torque is that of the model.
#[test]
fn the_torque_of_the_surface_conserves_energy() {
    let hung = Hung::new(&[]);
    let (surface, mechanism) = (&hung.plant.surface, scene(SCENE).mechanism().unwrap());
    for load_n in [0.4, 1.0, 5.0, 15.0] {
        for twist_rad in [2.0, 3.5, 12.0, 30.0, -30.0] {
            let torque = |load_n: f64| surface.torque_nm(twist_rad, load_n);
            let by_load = (torque(1.001 * load_n) - torque(0.999 * load_n)) / (0.002 * load_n);
            let slope = surface.gap(twist_rad, load_n).by_twist_m_per_rad;
            assert!((by_load / slope - 1.0).abs() < 5e-3, "{load_n} N, {twist_rad} rad: {by_load} and {slope}");
            let model_nm = mechanism.conservative_torque_nm(load_n, twist_rad).unwrap();
            assert!((torque(load_n) / -model_nm - 1.0).abs() < 2e-3, "{load_n} N, {twist_rad} rad: {model_nm}");
        }
    }
}

/// Up with one load and down with another. A torque of the load times ∂G/∂θ does not keep this.
#[test]
fn a_cycle_of_twist_and_load_takes_no_work_but_that_of_the_damper() {
    let mut hung = Hung::new(&[("load", "1N"), ("damping", "0.2"), ("twist_at_boot", "5")]);
    hung.turn_to(5.0, 1.0);
    hung.work_j = 0.0;
    hung.turn_to(35.0, 20.0);
    let up_j = hung.plant.settings.load_n * 6e-3;
    hung.load_to(5.0, 20.0);
    hung.turn_to(5.0, 20.0);
    hung.load_to(1.0, 20.0);
    assert!(hung.work_j.abs() < 0.05 * up_j, "{} J of {up_j} J", hung.work_j);
}
