//! How well the load is known, and what must not go unreported: another load, a slip, friction that changes, a sensor
//! that is far from its scene.

use super::{Keys, homed, load_error, load_n, track};
use host_tests::ControlBench;
use host_tests::load_changes::{hang, homed_under, lay_on};
use host_tests::rigs::commission::Firmware;
use host_tests::rigs::subject::Subject;
use rig_config::Uncertainty;
use rig_control::hysteresis::RodMemory;
use rig_link::messages::{Doubt, Doubts, Fault, Limit, LoadChoice, Refusal, Request, State};
use rig_plant::trial::{Stated, Trial};
use rig_plant::units::STANDARD_GRAVITY;
use rig_plant::{RigFault, RigPreset};

/// Constants 10 % off, one at a time and all together, with twice the usual friction.
const PLANTS: [Keys; 12] = [
    &[("k2_scale", "0.9")],
    &[("k2_scale", "1.1")],
    &[("k3_scale", "0.9")],
    &[("k3_scale", "1.1")],
    &[("k4_scale", "0.9")],
    &[("k4_scale", "1.1")],
    &[("stiffness_scale", "0.9")],
    &[("stiffness_scale", "1.1")],
    &[("modulus_scale", "0.9")],
    &[("modulus_scale", "1.1")],
    &[("k2_scale", "0.9"), ("k3_scale", "1.1"), ("stiffness_scale", "1.1"), ("modulus_scale", "0.9")],
    &[("k2_scale", "1.1"), ("k3_scale", "0.9"), ("stiffness_scale", "0.9"), ("modulus_scale", "1.1")],
];

#[test]
fn tracks_and_rests_and_weighs_on_plants_that_are_10_percent_off() {
    let (mut covered, mut cases) = (0, 0);
    for (seed, keys) in PLANTS.iter().enumerate() {
        for (k, load) in ["0.1kg", "0.15kg", "0.5kg", "1.5kg"].iter().enumerate() {
            // One constant alone: two of the loads, the others with its opposite.
            if keys.len() == 1 && (seed + k) % 2 == 1 {
                continue;
            }
            let mut d = homed(keys, load, "0.1", seed as u64);
            for target in [0.012f32, 0.003, 0.011, 0.0] {
                let apart = track(&mut d, target);
                d.run(1.0);
                let rest = d.true_position_m() - f64::from(target);
                let stated_n = d.last.as_ref().unwrap().telemetry.load_error_n.unwrap();
                let (off, stated) = (load_error(&d).abs(), f64::from(stated_n) / d.truth().load_n);
                let of = format!("{keys:?}, {load} to {target} m");
                println!("{of}: {apart:.1e} m on the way, {rest:.1e} m at rest, load {off:.3}, stated {stated:.3}");
                assert!(apart < 160e-6, "{of}: {apart} m from the set-point");
                assert!(rest.abs() < 50e-6, "{of}: {rest} m at rest");
                assert!(off < (3.0 * stated).max(0.12), "{of}: load {off}, {stated} stated");
                covered += u32::from(off <= stated);
                cases += 1;
            }
        }
    }
    // Meant to hold in 90 of 100 cases, 85 to 95.
    assert!(20 * covered >= 17 * cases, "the stated error holds the truth in {covered} of {cases} cases");
}

#[test]
fn at_rest_the_nominal_load_is_known_to_3_percent_or_a_twentieth_of_a_newton() {
    for load in ["0.1kg", "0.15kg", "0.3kg", "0.5kg", "1.0kg", "1.5kg"] {
        for seed in 1..=2 {
            let mut d = homed(&[], load, "0.05", seed);
            for target in [0.012f32, 0.003] {
                track(&mut d, target);
                d.run(1.0);
                let (error_n, allowed_n) = (load_n(&d) - d.truth().load_n, f64::max(0.05, 0.03 * d.truth().load_n));
                assert!(error_n.abs() < allowed_n, "{load} seed {seed} at {target} m: {error_n} N");
            }
        }
    }
}

#[test]
fn half_a_kilogram_more_or_less_is_known_in_a_second() {
    for (from, to, seed) in [("0.5kg", "1.0kg", 1), ("1.0kg", "0.5kg", 2), ("1.0kg", "1.5kg", 3), ("0.2kg", "0.7kg", 4)]
    {
        let mut rests = homed(&[], from, "0.05", seed);
        track(&mut rests, 0.006);
        let mut moves = rests.clone();
        moves.tick(Some(super::go(0.010, 0.001)));
        moves.run(1.0);
        for mut d in [rests, moves] {
            let before_n = d.truth().load_n as f32;
            d.rig.set_plant("load", to).unwrap();
            d.run(1.0);
            d.watch(1.0, |d| {
                // These rods have no hysteresis, which the scene expects: a load that becomes lighter is reported too light,
                // and one that has swung by several newtons as if it came from 2 N more.
                let load_n = d.truth().load_n as f32;
                let heaviest_n = if load_n > before_n { load_n + 2.0 } else { before_n };
                let memory = RodMemory { light: Uncertainty::default().rod_memory as f32, heaviest_n };
                let expected = -f64::from(memory.excess(load_n));
                let error = load_error(d) - expected;
                assert!(error.abs() < 0.05, "{from} to {to}, {:?}: {error}", d.control.state());
            });
        }
    }
}

#[test]
fn a_load_seems_heavier_after_a_heavier_one_and_the_report_is_nearer_to_it() {
    for (keys, seed) in [
        (&[("rod_hysteresis", "60MPa"), ("string_creep", "0.1")] as Keys, 1),
        (&[("rod_hysteresis", "120MPa"), ("string_creep", "0.3")], 2),
    ] {
        for light in [0.1, 0.2, 0.3] {
            let mut d = homed(keys, "1.5kg", "0.05", seed);
            let heaviest_n = d.truth().load_n as f32;
            track(&mut d, 0.006);
            lay_on(&mut d, 1.5, light).unwrap();
            d.run(10.0);
            let memory = RodMemory { light: Uncertainty::default().rod_memory as f32, heaviest_n };
            assert_eq!(d.control.state(), State::Holding, "{keys:?} {light} kg");
            let (reported, true_n) = (load_error(&d), d.truth().load_n);
            let apparent = f64::from(memory.apparent_n(load_n(&d) as f32)) / true_n - 1.0;
            assert!(apparent > 0.02 && reported.abs() < apparent, "{keys:?} {light} kg: {apparent} {reported}");
        }
    }
}

/// Rods of a load that was hung on gently are on the upper branch of their loop. A swing that dies away leaves them in its middle.
#[test]
fn a_load_that_was_let_go_of_seems_heavier_than_one_that_was_hung_on_gently_and_the_report_is_nearer_to_it() {
    let hung = |gently: bool| {
        let mut d = homed(&[("rod_hysteresis", "60MPa")], "0.2kg", "0.05", 1);
        track(&mut d, 0.006);
        if gently {
            lay_on(&mut d, 0.2, 0.9).unwrap();
        } else {
            hang(&mut d, 0.9).unwrap();
        }
        d.run(5.0);
        load_n(&d)
    };
    let [gently_n, let_go_n] = [true, false].map(hung);
    let memory = RodMemory { light: Uncertainty::default().rod_memory as f32, heaviest_n: let_go_n as f32 + 2.0 };
    let seems_n = f64::from(memory.apparent_n(let_go_n as f32));
    let apart = (let_go_n - gently_n).abs() / (seems_n - gently_n);
    assert!(seems_n > 1.03 * gently_n && apart < 0.6, "{gently_n} N, {let_go_n} N, {seems_n} N");
}

#[test]
fn nothing_swings_or_hunts_at_rest() {
    for (load, friction) in [("0.1kg", "0.1"), ("0.5kg", "0.05"), ("1.5kg", "0"), ("1.5kg", "0.1")] {
        let mut d = homed(&[], load, friction, 9);
        track(&mut d, 0.008);
        d.run(3.0);
        let (mut min, mut max) = (f64::MAX, f64::MIN);
        d.watch(20.0, |d| {
            (min, max) = (min.min(d.true_position_m()), max.max(d.true_position_m()));
        });
        assert!(max - min < 50e-6, "{load}, {friction} N: {} m peak to peak", max - min);
        assert_eq!(d.control.state(), State::Holding);
    }
}

fn doubts(d: &ControlBench) -> Doubts {
    d.last.as_ref().map_or(Doubts::NONE, |o| o.telemetry.doubts)
}

/// Moves until one is refused or ends in a fault; whether all went well.
fn moves(d: &mut ControlBench, targets_m: &[f32], mut after: impl FnMut(&ControlBench)) -> bool {
    targets_m.iter().all(|target_m| {
        let well = d.move_to(*target_m, 0.002, LoadChoice::Auto).is_ok();
        if well {
            d.run(1.0);
            after(d);
        }
        well
    })
}

/// Another load, a slip and a change of friction look alike at rest: the load is then reported as unknown, until a way up
/// and a way down have found the same.
#[test]
fn a_load_that_cannot_be_told_from_a_slip_is_unknown_until_it_is_confirmed() {
    for slips in [false, true] {
        let mut d = homed(&[], "0.5kg", "0.05", 1);
        moves(&mut d, &[0.005], |_| ());
        assert_eq!(doubts(&d), Doubts::NONE);
        if slips {
            d.rig.set_fault(RigFault::StringSlip, true);
        } else {
            d.rig.set_plant("load", "0.7kg").unwrap();
        }
        // It does not become known by waiting.
        for seconds in [2.0, 10.0] {
            d.run(seconds);
            assert_eq!(doubts(&d), Doubts::of(&[Doubt::LoadUnknown]), "slips: {slips}, {:+.2}", load_error(&d));
        }
        let known = moves(&mut d, &[0.011, 0.004, 0.011, 0.004], |_| ()) && doubts(&d).is_empty();
        assert!(!known || load_error(&d).abs() < 0.05, "slips: {slips}, known, and {:+.2} off", load_error(&d));
        assert!(known || slips, "another load is found: {:?}", doubts(&d));
    }
}

#[test]
fn friction_that_changes_under_a_light_load_leaves_it_unknown() {
    let mut d = homed(&[], "0.1kg", "0", 1);
    moves(&mut d, &[0.004], |_| ());
    d.rig.set_plant("friction", "0.3N").unwrap();
    moves(&mut d, &[0.008, 0.004, 0.009, 0.005], |d| {
        let wrong = load_error(d).abs();
        assert!(wrong < 0.15 || !doubts(d).is_empty() || d.control.fault().is_some(), "{wrong:.2} off unreported");
    });
}

/// No move can show these: the load agrees with itself, and is wrong. What calibration is for is no doubt: 10 % of the
/// radius, 1 mm and 1 % of the LVDT.
#[test]
fn a_sensor_or_strings_far_from_the_scene_leave_the_load_unknown() {
    let all = |scale| ["k2_scale", "k3_scale", "k4_scale", "stiffness_scale", "modulus_scale"].map(|key| (key, scale));
    let (thin, thick) = (all("0.75"), all("1.25"));
    let far = [&[("lvdt_gain_error", "-15%")][..], &[("lvdt_gain_error", "15%")], &thin, &thick];
    let near =
        [&[("k2_scale", "1.1")][..], &[("k2_scale", "0.9")], &[("lvdt_gain_error", "1%"), ("lvdt_offset", "1mm")]];
    // Under 0.1 kg, homing cannot tell such thin strings from a load that is two thirds heavier.
    let light = far.iter().filter(|keys| **keys != thin).map(|keys| ("0.1kg", *keys, true));
    let far = ["0.5kg", "1.5kg"].into_iter().flat_map(|load| far.map(|keys| (load, keys, true))).chain(light);
    for (load, keys, is_far) in far.chain(near.map(|keys| ("0.5kg", keys, false))) {
        let mut d = ControlBench::new(&[keys, &[("load", load)]].concat(), 3);
        match d.home() {
            Err(failure) => assert!(is_far, "{keys:?}: {failure}"),
            Ok(_) => {
                d.run(1.0);
                assert_eq!(doubts(&d) != Doubts::NONE, is_far, "{load} {keys:?}: {:+.2}", load_error(&d));
            }
        }
    }
}

/// Radius and zero of these rigs are off by as much as the scene says. With a lower limit of the contradiction one load in ten is unknown.
#[test]
fn what_the_scene_says_itself_is_no_contradiction_to_it() {
    let trials = (0..60u64).map(|seed| Trial::new(RigPreset::Nominal, 2000 + seed));
    let homed: Vec<_> =
        trials.filter_map(|trial| trial.run(Firmware::as_built().boot()).0.into_iter().next()).collect();
    let is_unknown =
        |stated: &&Stated| stated.load_error_n.zip(stated.load_n).is_none_or(|(error_n, load_n)| error_n > load_n);
    let unknown = homed.iter().filter(is_unknown).count();
    assert!(homed.len() >= 58 && unknown <= 1, "{unknown} of {} are unknown", homed.len());
}

/// The scale of the twist that homing found under 0.3 kg does not fit under 1.4 kg. On these rigs the firmware took that
/// for a string that had slipped, and stopped.
#[test]
fn a_load_much_heavier_than_the_homed_one_is_no_fault() {
    for seed in [73, 87] {
        let mut bench = homed_under(&Subject::new(RigPreset::Nominal, seed), 0.3).expect("it can be homed");
        lay_on(&mut bench, 0.3, 1.4).unwrap();
        bench.run(1.0);
        for (target_mm, speed_m_per_s) in
            [(2.0f32, 0.004), (5.0, f32::INFINITY), (3.0, 0.004), (5.0, 0.004), (1.0, 0.004)]
        {
            bench
                .move_to(1e-3 * target_mm, speed_m_per_s, LoadChoice::Auto)
                .unwrap_or_else(|e| panic!("seed {seed}, {target_mm} mm: {e}"));
            bench.run(0.5);
        }
    }
}

/// Below the table's least twist no load is known, and no move begins.
#[test]
fn no_load_is_reported_outside_the_tables_twist() {
    let mut d = homed(&[], "1.7kg", "0.05", 1);
    d.tick(Some(Request::Jog { twist_speed_rad_per_s: -4.0 }));
    d.watch(10.0, |d| {
        let t = d.last.as_ref().unwrap().telemetry;
        let below = t.twist_rad.unwrap() < std::f32::consts::PI - 0.4;
        assert!(!below || t.load_n.is_none() && t.doubts.contains(Doubt::LoadUnknown), "{t:?}");
    });
    d.tick(Some(Request::Stop));
    d.run(5.0);
    assert_eq!(d.control.state(), State::Ready);
    let reply = d.tick(Some(super::go(0.003, 0.002))).reply;
    assert!(matches!(reply, Some(Err(Refusal::OutOfRange { .. }))), "{reply:?}");
}

#[test]
fn strings_that_are_jogged_closed_and_let_go_are_reported() {
    let mut d = ControlBench::new(&[("load", "1.7kg")], 1);
    assert!(d.until(5.0, |d| d.control.state() == State::Unhomed));
    d.prove();
    d.tick(Some(Request::Jog { twist_speed_rad_per_s: 4.0 }));
    assert!(d.until(30.0, |d| d.control.state() == State::Fault), "{:?}", d.control.state());
    let twist_rad = d.truth().twist_rad;
    d.watch(10.0, |d| {
        let (fallen_rad, faults) = (twist_rad - d.truth().twist_rad, d.control.faults());
        let reported = faults.contains(Fault::DriveStall) || faults.contains(Fault::NotHeld);
        assert!(fallen_rad < 2.0 || reported, "fallen by {fallen_rad} rad: {faults}");
    });
}

/// A rig without stiction has no break-away jumps: whatever small change of the load moves it past its target, it is brought back.
#[test]
fn a_small_change_of_the_load_leaves_no_error_where_nothing_sticks() {
    for (seed, at_m) in [(1, 0.003f32), (2, 0.008), (3, 0.013), (4, 0.013)] {
        for [from_kg, to_kg] in [[0.25f64, 0.3], [0.3, 0.25], [0.5, 0.55], [1.0, 0.9]] {
            let mut d = homed(&[], &format!("{}kg", from_kg.max(to_kg)), "0.05", seed);
            d.rig.set_plant("load", &format!("{from_kg}kg")).unwrap();
            d.run(2.0);
            track(&mut d, at_m);
            d.run(1.0);
            d.rig.set_plant("load", &format!("{to_kg}kg")).unwrap();
            d.run(6.0);
            let error_m = d.true_position_m() - f64::from(at_m);
            println!("{seed} {from_kg} -> {to_kg} kg at {at_m} m: {:+.0} um", 1e6 * error_m);
            assert!(error_m.abs() < 30e-6, "{from_kg} -> {to_kg} kg at {at_m} m: {error_m} m");
        }
    }
}

/// A motor with a tenth more torque for each ampere is slower than the set-point of the shaft. When this stops, the shaft still has a
/// way to go.
#[test]
fn a_changed_load_is_brought_back_by_a_motor_that_is_slower_than_the_scene_says() {
    for seed in 1..4 {
        let mut d = super::homed(&[("torque_constant_scale", "1.1")], "1.2kg", "0.2N", seed);
        d.tick(Some(super::go(0.005, 0.01)));
        d.run(6.0);
        d.rig.set_plant("load", "0.5kg").unwrap();
        d.run(6.0);
        // The lighter load hangs higher, where the strings' travel ends.
        let last = &d.last.as_ref().unwrap().telemetry;
        assert_eq!(
            (last.state, last.limit),
            (State::Holding, Some(Limit::Travel)),
            "seed {seed}: {:?}",
            d.control.fault()
        );
    }
}

/// At 19.5 V, which is no fault of the supply, the motor has four fifths of its speed.
#[test]
fn moves_at_full_speed_on_a_low_supply_end_at_their_targets() {
    for seed in [5018, 5036, 5056] {
        let mut d = switched_on(RigPreset::Nominal, seed, 1.5);
        d.rig.set_plant("supply_voltage", "19.5V").unwrap();
        d.home().unwrap();
        for target_m in [0.013, 0.001] {
            d.tick(Some(super::go(target_m, f32::INFINITY)));
            d.run(0.5);
            assert_eq!(d.last.as_ref().unwrap().telemetry.limit, Some(Limit::MotorSpeed));
            d.run(6.0);
            let error_m = d.true_position_m() - f64::from(target_m);
            assert_eq!(d.control.fault(), None, "seed {seed}, to {target_m} m");
            assert!(error_m.abs() < 0.15e-3, "seed {seed}, to {target_m} m: {error_m} m");
        }
    }
}

/// A rig of a kind that is switched on under a load (kg).
fn switched_on(kind: RigPreset, seed: u64, load_kg: f64) -> ControlBench {
    let rig = Subject::new(kind, seed).switched_on(load_kg * STANDARD_GRAVITY).expect("a rig");
    ControlBench::on(rig, host_tests::booted())
}

/// A hard rig that has homed under a load (kg), has gone to a position (m), and has held another load there for 6 s.
fn hung_meanwhile(seed: u64, load_kg: f64, at_m: f32, other: &str) -> ControlBench {
    let mut d = switched_on(RigPreset::Hard, seed, load_kg);
    d.home().unwrap();
    d.tick(Some(super::go(at_m, 0.01)));
    d.run(6.0);
    d.rig.set_plant("load", other).unwrap();
    d.run(6.0);
    assert_eq!(d.control.state(), State::Holding, "seed {seed}: {:?}", d.control.fault());
    d
}

/// The strings turn for a second and more, while it is known already that the load has become another one.
#[test]
fn a_heavy_load_of_which_half_is_taken_off_comes_back_without_a_fault() {
    for seed in 1..4 {
        let error_m = hung_meanwhile(seed, 1.6, 0.008, "0.8kg").true_position_m() - 0.008;
        assert!(error_m.abs() < 0.5e-3, "seed {seed}: {error_m} m");
    }
}

/// A load that loses nine tenths of its weight at once springs up, and falls back by more than a centimetre.
#[test]
fn a_load_that_springs_up_and_falls_back_is_no_broken_string() {
    for (load_kg, other) in [(1.5, "0.15kg"), (0.1, "1.6kg")] {
        for seed in 1..5 {
            let mut d = switched_on(RigPreset::Nominal, seed, load_kg);
            d.home().unwrap();
            track(&mut d, 0.006);
            d.rig.set_plant("load", other).unwrap();
            d.run(6.0);
            assert_eq!(d.control.fault(), None, "seed {seed}: {load_kg} kg to {other}");
        }
    }
}

/// A light load sticks: the strings take up a friction of half its weight while it is away from its set-point.
#[test]
fn a_light_load_that_becomes_lighter_and_sticks_is_no_fault() {
    for seed in [1, 30, 37, 42] {
        hung_meanwhile(seed, 0.2, 0.006, "0.1kg");
    }
}
