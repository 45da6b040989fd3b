//! The floors of the controller over plants that it was not told of: seeded, with the control code alone.

use host_tests::ControlBench;
use rand::{RngExt, SeedableRng};
use rig_control::homing::{Homed, Homing, HomingInputs, Progress};
use rig_link::messages::{
    EventKind, HomingFailure, HomingResult, Limit, LoadChoice, Parameter, Refusal, Request, State,
};
use std::f64::consts::PI;

type Keys = &'static [(&'static str, &'static str)];

/// Constants 10 % off, one at a time and all together, with twice the usual friction.
const PLANTS: [(&str, Keys); 12] = [
    ("k2 -10 %", &[("k2_scale", "0.9")]),
    ("k2 +10 %", &[("k2_scale", "1.1")]),
    ("k3 -10 %", &[("k3_scale", "0.9")]),
    ("k3 +10 %", &[("k3_scale", "1.1")]),
    ("k4 -10 %", &[("k4_scale", "0.9")]),
    ("k4 +10 %", &[("k4_scale", "1.1")]),
    ("K -10 %", &[("stiffness_scale", "0.9")]),
    ("K +10 %", &[("stiffness_scale", "1.1")]),
    ("E -10 %", &[("modulus_scale", "0.9")]),
    ("E +10 %", &[("modulus_scale", "1.1")]),
    (
        "thin and soft",
        &[("k2_scale", "0.9"), ("k3_scale", "1.1"), ("stiffness_scale", "1.1"), ("modulus_scale", "0.9")],
    ),
    (
        "thick and stiff",
        &[("k2_scale", "1.1"), ("k3_scale", "0.9"), ("stiffness_scale", "0.9"), ("modulus_scale", "1.1")],
    ),
];

fn homed(keys: Keys, load: &str, friction: &str, seed: u64) -> ControlBench {
    let mut all = vec![("load", load), ("friction", friction), ("twist_at_boot", "6")];
    all.extend_from_slice(keys);
    let mut d = ControlBench::new(&all, seed);
    d.home().unwrap_or_else(|e| panic!("{keys:?} {load}: {e}"));
    d
}

/// Load estimate less the truth (N).
fn load_error(d: &ControlBench) -> f64 {
    f64::from(d.last.as_ref().unwrap().telemetry.load_n.unwrap()) - d.truth().load_n
}

/// Moves at 2 mm/s; the greatest distance from the set-point on the way (m).
fn track(d: &mut ControlBench, target_m: f32) -> f64 {
    d.tick(Some(Request::Move { target_m, speed_m_per_s: 0.002, load: LoadChoice::Auto }));
    let mut worst = 0.0f64;
    while d.control.state() == State::Moving {
        let set_point_m = d.tick(None).telemetry.setpoint_m;
        worst = worst.max((d.true_position_m() - f64::from(set_point_m.unwrap_or(f32::NAN))).abs());
    }
    assert_eq!(d.control.state(), State::Holding, "{:?}", d.control.fault());
    worst
}

#[test]
fn tracks_and_rests_and_weighs_on_plants_that_are_10_percent_off() {
    let (mut farthest, mut at_rest, mut heaviest) = (0.0f64, 0.0f64, 0.0f64);
    let (mut covered, mut cases) = (0, 0);
    for (seed, (name, keys)) in PLANTS.iter().enumerate() {
        for load in ["0.1kg", "0.15kg", "0.5kg", "1.5kg"] {
            let mut d = homed(keys, load, "0.1", seed as u64);
            for target in [0.012f32, 0.003, 0.011, 0.0] {
                let apart = track(&mut d, target);
                d.run(1.0);
                let rest = d.true_position_m() - f64::from(target);
                let load_share = load_error(&d) / d.truth().load_n;
                let stated_n = d.last.as_ref().unwrap().telemetry.load_error_n.unwrap();
                let stated_share = f64::from(stated_n) / d.truth().load_n;
                let of = format!("{name}, {load} to {target} m");
                assert!(apart < 150e-6, "{of}: {apart} m from the set-point");
                assert!(rest.abs() < 50e-6, "{of}: {rest} m at rest");
                println!("{of}: load {load_share:+.3}, stated {stated_share:.3}");
                assert!(
                    load_share.abs() < (3.0 * stated_share).max(0.12),
                    "{of}: load {load_share}, {stated_share} stated"
                );
                covered += u32::from(load_share.abs() <= stated_share);
                cases += 1;
                farthest = farthest.max(apart);
                at_rest = at_rest.max(rest.abs());
                heaviest = heaviest.max(load_share.abs());
            }
        }
    }
    // Meant to hold in 90 of 100 cases, 85 to 95.
    assert!(20 * covered >= 17 * cases, "the stated error holds the truth in {covered} of {cases} cases");
    println!(
        "worst: {:.0} um on the way, {:.0} um at rest, load {:.1} %",
        farthest * 1e6,
        at_rest * 1e6,
        heaviest * 100.0
    );
}

#[test]
fn at_rest_the_nominal_load_is_known_to_3_percent_or_a_twentieth_of_a_newton() {
    let mut worst = 0.0f64;
    for load in ["0.1kg", "0.15kg", "0.3kg", "0.5kg", "1.0kg", "1.5kg"] {
        for seed in 1..=3 {
            let mut d = homed(&[], load, "0.05", seed);
            for target in [0.012f32, 0.003] {
                track(&mut d, target);
                d.run(1.0);
                let (error, floor) = (load_error(&d), f64::max(0.05, 0.03 * d.truth().load_n));
                println!("{load} seed {seed} at {target} m: {error:+.3} N, {:+.1} %", 100.0 * error / d.truth().load_n);
                worst = worst.max(error.abs() / floor);
            }
        }
    }
    println!("worst: {worst:.2} of the floor");
    assert!(worst < 1.0);
}

#[test]
fn half_a_kilogram_more_or_less_is_known_in_a_second() {
    for (from, to, seed) in [("0.5kg", "1.0kg", 1), ("1.0kg", "0.5kg", 2), ("1.0kg", "1.5kg", 3), ("0.2kg", "0.7kg", 4)]
    {
        for moving in [false, true] {
            let mut d = homed(&[], from, "0.05", seed);
            track(&mut d, 0.006);
            if moving {
                d.tick(Some(Request::Move { target_m: 0.010, speed_m_per_s: 0.001, load: LoadChoice::Auto }));
                d.run(1.0);
            }
            d.rig.set_plant("load", to).unwrap();
            d.run(1.0);
            let (mut sum, mut worst) = (0.0, 0.0f64);
            for _ in 0..100 {
                d.tick(None);
                let share = load_error(&d) / d.truth().load_n;
                sum += share / 100.0;
                worst = worst.max(share.abs());
            }
            println!(
                "{from} to {to}, moving {moving}: after 1 s within {:.1} %, mean {:+.1} %",
                100.0 * worst,
                100.0 * sum
            );
            assert!(worst < 0.05, "{from} to {to}: {worst}");
        }
    }
}

#[test]
fn homes_within_20_mrad_from_any_twist_under_any_load() {
    let (mut worst, mut slowest) = (0.0f64, 0.0f64);
    let mut x = 20_u64;
    let mut random = || {
        // SplitMix64.
        x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    };
    for seed in 0..40 {
        let load_kg = 0.1 * 15f64.powf(random());
        // Light strings side by side end before ten turns (model.md 5).
        let most_turns = if load_kg < 0.2 { 9.0 } else { 10.0 };
        let twist = (2.0 * random() - 1.0) * most_turns * 2.0 * PI;
        let friction = 0.02 + 0.08 * random();
        let keys = [
            ("load", format!("{load_kg}kg")),
            ("twist_at_boot", twist.to_string()),
            ("friction", friction.to_string()),
            ("k2_scale", (0.9 + 0.2 * random()).to_string()),
        ];
        let keys: Vec<_> = keys.iter().map(|(k, v)| (*k, v.as_str())).collect();
        let mut d = ControlBench::new(&keys, seed);
        let seconds = d.home().unwrap_or_else(|e| panic!("{keys:?}: {e}"));
        let off = d.truth().twist_rad.abs() - PI;
        assert!(off.abs() < 0.02, "{keys:?}: zero off by {off} rad");
        assert!(seconds < 45.0, "{keys:?}: {seconds} s");
        worst = worst.max(off.abs());
        slowest = slowest.max(seconds);
    }
    println!("worst: {:.2} mrad, {slowest:.1} s", worst * 1e3);
}

/// Up to where the strings lie side by side: there the probe tightens them against their own thickness, and friction
/// holds a light load over several radians.
#[test]
fn homes_from_the_farthest_twist_that_the_strings_can_have() {
    let mut worst = (0.0f64, 0.0f64, 0.0f64);
    for (seed, load) in ["0.8", "0.9", "0.1kg", "2", "5", "18"].iter().enumerate() {
        let nominal = ControlBench::new(&[("load", load)], 1);
        let most = (10.0
            * nominal.rig.plant().built_in().expect("built in").surface.last_twist_rad(nominal.truth().load_n))
        .floor()
            / 10.0;
        for twist in [most, -most, most - 2.0, 2.0 - most, 0.9 * most, -0.9 * most] {
            for friction in ["0.02", "0.1"] {
                let keys = [("load", *load), ("friction", friction), ("twist_at_boot", &twist.to_string())];
                let mut d = ControlBench::new(&keys, seed as u64);
                let seconds = d.home().unwrap_or_else(|e| panic!("{keys:?}: {e}"));
                let off = d.truth().twist_rad.abs() - PI;
                let load_off = f64::from(d.control.homed().expect("homed").found.load_n) - d.truth().load_n;
                // From seed to seed the weighed load spreads by 1.8 % rms at 2 N, from wherever homing began.
                let load_off = load_off.abs() / f64::max(0.05, 0.06 * d.truth().load_n);
                assert!(
                    off.abs() < 0.02 && load_off < 1.0,
                    "{keys:?}: zero off by {off} rad, load by {load_off} of its floor"
                );
                assert!(seconds < 42.0, "{keys:?}: {seconds} s");
                worst = (worst.0.max(off.abs()), worst.1.max(load_off), worst.2.max(seconds));
            }
        }
    }
    println!("worst: {:.2} mrad, load {:.2} of its floor, {:.1} s", worst.0 * 1e3, worst.1, worst.2);
}

/// Nearly as far as strings under 0.1 kg can be twisted, either way: left there, they fling the rotor to the other side.
#[test]
fn homes_from_closed_strings_under_the_lightest_load() {
    for twist in ["60.8", "-60.8"] {
        for (seed, friction) in [(1, "0.02"), (2, "0.02"), (3, "0.05")] {
            let mut d = ControlBench::new(&[("load", "0.1kg"), ("friction", friction), ("twist_at_boot", twist)], seed);
            d.home().unwrap_or_else(|e| panic!("{twist} {friction}: {e}"));
            assert!((d.truth().twist_rad.abs() - PI).abs() < 0.02, "{twist} {friction}");
        }
    }
}

/// A rail that lets nothing move, anywhere: homing gives up, with the strings held and little more tension than before.
#[test]
fn a_jammed_load_is_not_homed() {
    for (load, twist) in [("0.1kg", "60"), ("0.1kg", "-60"), ("0.5kg", "71"), ("1.5kg", "40"), ("1.5kg", "-20")] {
        let mut d = ControlBench::new(&[("load", load), ("friction", "100"), ("twist_at_boot", twist)], 4);
        let error = d.home().expect_err("it cannot move");
        assert!(error.contains("NoPretwist"), "{load} {twist}: {error}");
        let pull_n = d.truth().pull_n;
        assert!(pull_n < d.truth().load_n + 3.5, "{load} {twist}: {pull_n} N");
    }
}

/// A motor that the strings cannot drive back starts where it was left, against fully closed strings: it turns back
/// before the drive takes that for a stall, and no farther than friction explains if the load does not move.
#[test]
fn the_probe_turns_back_from_closed_strings() {
    let (table, constants) = (host_tests::table(), host_tests::constants());
    let mut homing = Homing::new(0.0, 0.05, 1.0, LoadChoice::Auto);
    let (mut shaft_rad, mut pressed) = (0.0f32, 0);
    for _ in 0..1000 {
        let inputs = HomingInputs { shaft_rad, shaft_at_gap_rad: shaft_rad, gap_m: 0.05, current_a: 0.0 };
        match homing.step(table, &constants, &inputs) {
            Progress::Turning(ramp) => {
                shaft_rad = ramp.position.min(0.2);
                pressed += i32::from(ramp.position > 0.2);
            }
            end => {
                assert_eq!(end, Progress::Failed(HomingFailure::NoPretwist));
                assert!(pressed < 50, "{pressed} ticks against the strings");
                assert!((-18.5..-17.0).contains(&shaft_rad), "{shaft_rad} rad");
                return;
            }
        }
    }
    panic!("no end");
}

/// What a stalled or reset drive lets fall swings for seconds; homing waits for it.
#[test]
fn homes_a_load_that_swings() {
    let mut slowest = 0.0f64;
    for k in 0..12 {
        let keys = [("load", "0.9kg"), ("friction", "0.05"), ("twist_at_boot", "-4.5")];
        let mut d = ControlBench::new(&keys, k);
        assert!(d.until(5.0, |d| d.control.state() == State::Unhomed));
        d.rig.set_plant("load", "1.336kg").unwrap();
        d.run(0.03 * k as f64);
        let seconds = d.home().unwrap_or_else(|e| panic!("{} s after the load began to swing: {e}", 0.03 * k as f64));
        let off = d.truth().twist_rad.abs() - PI;
        assert!(off.abs() < 0.02 && seconds < 45.0, "zero off by {off} rad, {seconds} s");
        slowest = slowest.max(seconds);
    }
    println!("{slowest:.1} s");
}

#[test]
fn the_time_to_target_is_known_beforehand() {
    // How long a light load is crept up to is not known beforehand (s).
    for (load, friction, crept_s) in [("0.5kg", "0.05", 0.0), ("0.15kg", "0.2", 0.3), ("1.5kg", "0.1", 0.0)] {
        let mut d = homed(&[], load, friction, 2);
        // Both ways, short, and faster than the motor.
        for (target_m, speed_m_per_s) in
            [(0.012, 0.002), (0.0115, 0.002), (0.002, 0.001), (0.016, 0.02), (0.001, 0.02), (0.004, 0.002)]
        {
            let (said_s, took_s) = time(&mut d, target_m, speed_m_per_s);
            println!("{load} to {target_m} m: {said_s:.2} s said, {took_s:.2} s taken");
            assert!((took_s - said_s).abs() < 0.15 + 0.03 * took_s + crept_s, "{took_s} s, said {said_s} s");
            assert!(d.until(5.0, |d| d.control.state() == State::Holding));
        }
        // Another target on the way, ahead and then behind.
        let mut d = homed(&[], load, friction, 3);
        for target_m in [0.009, 0.006] {
            d.tick(Some(Request::Move { target_m, speed_m_per_s: 0.002, load: LoadChoice::Auto }));
            d.run(1.5);
        }
        let (said_s, took_s) = time(&mut d, 0.001, 0.002);
        println!("{load} turned back: {said_s:.2} s said, {took_s:.2} s taken");
        assert!((took_s - said_s).abs() < 0.1, "{took_s} s, said {said_s} s");
    }
}

/// A move: how long it says at first that its set-point will take, and how long it takes (s).
fn time(d: &mut ControlBench, target_m: f32, speed_m_per_s: f32) -> (f64, f64) {
    d.tick(Some(Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto }));
    d.run(0.07);
    let start_s = d.time_s();
    let said_s = d.last.as_ref().unwrap().telemetry.time_left_s.expect("known by now");
    assert!(d.until(30.0, |d| d.last.as_ref().unwrap().telemetry.setpoint_m == Some(target_m)));
    (said_s.into(), d.time_s() - start_s)
}

#[test]
fn nothing_swings_or_hunts_at_rest() {
    for (load, friction) in [("0.1kg", "0.1"), ("0.5kg", "0.05"), ("1.5kg", "0"), ("1.5kg", "0.1")] {
        let mut d = homed(&[], load, friction, 9);
        track(&mut d, 0.008);
        d.run(3.0);
        let (mut least, mut most, mut turned) = (f64::MAX, f64::MIN, 0.0f64);
        let mut last = d.truth().twist_rad;
        for _ in 0..2000 {
            d.tick(None);
            (least, most) = (least.min(d.true_position_m()), most.max(d.true_position_m()));
            turned += (d.truth().twist_rad - last).abs();
            last = d.truth().twist_rad;
        }
        println!("{load}, {friction} N: {:.1} um peak to peak, {turned:.3} rad turned in 20 s", (most - least) * 1e6);
        assert!(most - least < 50e-6, "{load}: {} m", most - least);
        assert!(!d.events.iter().any(|(_, e)| matches!(e, EventKind::FaultRaised(_))));
    }
}

#[test]
fn a_twist_scale_that_has_drifted_is_learned_while_working() {
    let mut d = homed(&[], "0.5kg", "0.05", 5);
    let right = *d.control.homed().unwrap();
    // As if the strings had crept since: the scale in use is 1.5 % off.
    let found = HomingResult { twist_scale: right.found.twist_scale + 0.015, ..right.found };
    d.control.resume(Homed { found, ..right });
    let drift = |d: &mut ControlBench| {
        let [low, high] = [0.001, 0.016].map(|target| {
            track(d, target);
            d.run(1.0);
            load_error(d)
        });
        (high - low).abs()
    };
    let first = drift(&mut d);
    (0..8).for_each(|_| {
        drift(&mut d);
    });
    let last = drift(&mut d);
    let after = *d.control.homed().unwrap();
    println!("estimate differs by {first:.3} N along the way at first, {last:.3} N later; {right:?} {after:?}");
    assert!((after.found.twist_scale - right.found.twist_scale).abs() < 0.004);
    assert!(last < 0.3 * first, "{last} of {first} N");
    // A jump of the load is not drift.
    d.rig.set_plant("load", "0.9kg").unwrap();
    d.run(3.0);
    track(&mut d, 0.012);
    let jumped = d.control.homed().unwrap();
    assert!((jumped.found.twist_scale - after.found.twist_scale).abs() < 2e-3, "{jumped:?}");
}

/// A load that is changed at rest is known to a few percent, and so is how far down it can come. What is asked beyond the
/// end of the strings' travel is refused; in the last bit before it a move may end short, and then says so.
#[test]
fn a_move_that_ends_with_the_travel_says_by_how_much() {
    let mut short_moves = 0;
    for (seed, [heavy, light]) in [[1.196, 0.411], [1.1, 0.8], [0.75, 0.5], [0.9, 0.35]].into_iter().enumerate() {
        let mut d = homed(&[], &format!("{heavy}kg"), "0.1", seed as u64);
        // Laid off by hand, 2 N a second.
        let mut hanging = heavy;
        while hanging > light {
            hanging = f64::max(hanging - 0.01, light);
            d.rig.set_plant("load", &format!("{hanging}kg")).unwrap();
            d.run(0.05);
        }
        d.run(1.0);
        let go = |target_m| Request::Move { target_m, speed_m_per_s: 0.003, load: LoadChoice::Auto };
        let reply = d.tick(Some(go(0.0))).reply;
        let Some(Err(Refusal::OutOfRange { parameter: Parameter::Target, min, .. })) = reply else {
            panic!("{reply:?} to what the strings cannot let this load down to");
        };
        // Through the place where a light load comes to rest with the strings at their end, or slips past its target there.
        for step in 0..12u8 {
            let above_m = -0.19e-3 + 0.05e-3 * f32::from(step);
            let target_m = min + above_m;
            // From above, so that friction has to be crossed at the end of the way down.
            track(&mut d, target_m + 1.5e-3);
            let began_s = d.time_s();
            // That way has told more of the load, and where it ends.
            if let Some(Err(refusal)) = d.tick(Some(go(target_m))).reply {
                assert!(matches!(refusal, Refusal::OutOfRange { parameter: Parameter::Target, .. }), "{refusal}");
                continue;
            }
            assert!(d.until(10.0, |d| d.control.state() == State::Holding), "{:?}", d.control.fault());
            let took_s = d.time_s() - began_s;
            let Some((_, EventKind::MoveDone { error_m: said_m })) = d.events.last() else { panic!("{:?}", d.events) };
            let said_m = f64::from(*said_m);
            d.run(0.5);
            let error_m = d.true_position_m() - f64::from(target_m);
            let limit = d.last.as_ref().unwrap().telemetry.limit;
            println!(
                "{heavy} -> {light} kg: {:+.0} um off, {:+.0} um said, {limit:?}, {took_s:.1} s",
                error_m * 1e6,
                said_m * 1e6
            );
            assert!((said_m - error_m).abs() < 40e-6, "{said_m} m said, {error_m} m off");
            if error_m.abs() > 60e-6 {
                assert!(limit == Some(Limit::Travel) && (0.0..0.4e-3).contains(&error_m), "{limit:?} {error_m}");
            }
            short_moves += usize::from(limit == Some(Limit::Travel));
        }
    }
    assert!(short_moves > 1, "none met the end of the travel");
}

/// The load is made so light that the strings, untwisted to their end, cannot let it down to where it is held.
#[test]
fn a_move_begins_where_the_load_is_and_not_at_a_place_that_it_cannot_reach() {
    let mut d = homed(&[], "1.2kg", "0.1", 7);
    d.run(0.1);
    d.move_to(0.003, 0.003, LoadChoice::Auto).unwrap();
    let mut hanging = 1.2;
    while hanging > 0.5 {
        hanging = f64::max(hanging - 0.01, 0.5);
        d.rig.set_plant("load", &format!("{hanging}kg")).unwrap();
        d.run(0.05);
    }
    // Longer than a following error may last.
    d.run(5.0);
    let telemetry = d.last.as_ref().unwrap().telemetry;
    let position_m = telemetry.position_m.unwrap();
    assert_eq!((d.control.state(), telemetry.limit), (State::Holding, Some(Limit::Travel)));
    assert!(position_m > 0.005, "{position_m} m: the load could be let down");
    d.tick(Some(Request::Move { target_m: 0.012, speed_m_per_s: 0.003, load: LoadChoice::Auto }))
        .reply
        .unwrap()
        .unwrap();
    let set_point_m = d.last.as_ref().unwrap().telemetry.setpoint_m.unwrap();
    assert!((set_point_m - position_m).abs() < 1e-4, "set-point at {set_point_m} m, load at {position_m} m");
    assert!(d.until(10.0, |d| d.control.state() != State::Moving));
    assert_eq!(d.control.state(), State::Holding, "{:?}", d.control.fault());
}

/// The strings at their end, the load sticks, then slips past its target: passing it is not arriving.
#[test]
fn a_load_that_slips_past_its_target_has_not_arrived() {
    // Seeds of the three of 464 random moves that were once called done on the way past.
    for seed in [26, 27, 69] {
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let mut hanging: f64 = random.random_range(0.7..1.5);
        let mut d = ControlBench::new(&[("load", &format!("{hanging}kg"))], seed);
        d.home().unwrap();
        d.move_to(0.004, 0.003, LoadChoice::Auto).unwrap();
        let load: f64 = random.random_range(0.3..1.2);
        while hanging != load {
            hanging += (load - hanging).clamp(-0.01, 0.01);
            d.rig.set_plant("load", &format!("{hanging}kg")).unwrap();
            d.run(0.05);
        }
        d.run(1.0);
        if d.control.state() == State::Fault {
            d.tick(Some(Request::Clear));
            d.run(0.5);
        }
        let speed_m_per_s = random.random_range(0.001..0.004);
        let go = |target_m| Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto };
        let Some(Err(Refusal::OutOfRange { min, .. })) = d.tick(Some(go(-0.05))).reply else { panic!("not refused") };
        let target_m = min + random.random_range(-0.0002..0.0006f32);
        d.move_to(target_m, speed_m_per_s, LoadChoice::Auto).unwrap();
        let Some((_, EventKind::MoveDone { error_m: said_m })) = d.events.last().copied() else { panic!("no end") };
        d.run(0.5);
        let error_m = d.true_position_m() - f64::from(target_m);
        println!("seed {seed}: {:+.0} um off, {:+.0} um said", error_m * 1e6, said_m * 1e6);
        assert!((f64::from(said_m) - error_m).abs() < 30e-6, "{said_m} m said, {error_m} m off");
    }
}
