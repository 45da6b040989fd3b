//! The table with a rig's own scale and curve, within its range and a little beyond, and what moves teach of the scale.

use crate::bench::Bench;
use crate::fixture::table;
use rig_control::mechanism::{Mechanism, OUTSIDE_RAD};
use rig_link::gap_curve::GapCurve;
use rig_link::messages::{LoadChoice, Request, State};

const LOAD_N: f32 = 5.0;

fn scaled(twist_scale: f32) -> Mechanism<'static> {
    // 0.1 mm, and 0.2 mm more at 40 rad than at 20 rad.
    let curve = GapCurve { middle_rad: 20.0, half_rad: 20.0, coefficients_m: [0.1e-3, 0.2e-3, 0.0, 0.0] };
    Mechanism { table: *table(), twist_scale, curve }
}

#[test]
fn strings_of_another_radius_act_as_if_they_were_twisted_by_the_scale() {
    for twist_scale in [0.97f32, 1.0, 1.03] {
        let found = scaled(twist_scale).at(LOAD_N, 30.0);
        let plain = table().look_up(LOAD_N, 30.0 * twist_scale).expect("inside");
        assert!((found.gap_m - plain.gap_m - 0.2e-3).abs() < 1e-7);
        let slope = twist_scale * plain.dgap_dtwist_m_per_rad + 0.2e-3 / 20.0;
        assert!((found.dgap_dtwist_m_per_rad / slope - 1.0).abs() < 1e-5);
        assert_eq!(found.dgap_dload_m_per_n, plain.dgap_dload_m_per_n);
    }
}

#[test]
fn a_tangent_goes_on_at_both_ends_of_the_twist() {
    let plain = Mechanism { table: *table(), twist_scale: 1.0, curve: GapCurve::constant(0.0) };
    let m = &table().metadata;
    for (end_rad, outwards) in [(m.twist_min_rad, -1.0), (m.twist_max_rad, 1.0)] {
        let end = plain.at(LOAD_N, end_rad);
        for beyond_rad in [0.3, 0.6] {
            let expected_m = end.gap_m + outwards * beyond_rad * end.dgap_dtwist_m_per_rad;
            assert!((plain.at(LOAD_N, end_rad + outwards * beyond_rad).gap_m - expected_m).abs() < 1e-7);
        }
        assert!(plain.covers(end_rad + outwards * 0.99 * OUTSIDE_RAD));
        assert!(!plain.covers(end_rad + outwards * 1.01 * OUTSIDE_RAD));
    }
    assert_eq!((scaled(0.9).twist_max_rad(), scaled(1.1).twist_max_rad()), (m.twist_max_rad, m.twist_max_rad / 1.1));
}

#[test]
fn strings_whose_radius_drifts_are_learned_from_long_moves() {
    for drifted in [1.004f32, 0.996] {
        let mut bench = Bench::homed();
        let before = bench.shown().twist_scale.unwrap();
        bench.twist_scale = drifted;
        for _ in 0..6 {
            bench.move_to(0.014, 0.006);
            bench.move_to(0.001, 0.006);
        }
        let learned = (bench.shown().twist_scale.unwrap() - before) / (drifted - 1.0);
        assert!((0.2..1.3).contains(&learned), "{learned}");
    }
}

#[test]
fn nothing_is_learned_under_a_given_load_or_while_the_load_changes() {
    let learned = |given: LoadChoice, change_n: f32| {
        let mut bench = Bench::homed();
        let before = bench.shown().twist_scale.unwrap();
        bench.twist_scale = if change_n == 0.0 { 1.004 } else { 1.0 };
        for target_m in [0.014, 0.001, 0.014, 0.001] {
            let request = Request::Move { target_m, speed_m_per_s: 0.006, load: given };
            bench.begin(request);
            bench.run(150);
            bench.load_n += if target_m > 0.01 { change_n } else { -change_n };
            bench.while_in(State::Moving);
        }
        (bench.shown().twist_scale.unwrap() - before, bench.rig.fault())
    };
    assert_eq!(learned(LoadChoice::Known(5.0), 0.0), (0.0, None));
    let (changing, fault) = learned(LoadChoice::Auto, 1.0);
    assert!(changing.abs() < 5e-4 && fault.is_none(), "{changing} {fault:?}");
}
