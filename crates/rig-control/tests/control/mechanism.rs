//! The table with a rig's own scale and curve, within its range and a little beyond.

use crate::fixture::table;
use rig_control::mechanism::{Mechanism, OUTSIDE_RAD};
use rig_link::gap_curve::GapCurve;

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
fn a_tangent_goes_on_at_both_ends_of_the_twist_for_half_a_radian() {
    let plain = Mechanism { table: *table(), twist_scale: 1.0, curve: GapCurve::constant(0.0) };
    let m = &table().metadata;
    for (end_rad, outwards) in [(m.twist_min_rad, -1.0), (m.twist_max_rad, 1.0)] {
        let end = plain.at(LOAD_N, end_rad);
        for (beyond_rad, counts_rad) in [(0.3f32, 0.3f32), (0.6, 0.5)] {
            let expected_m = end.gap_m + outwards * counts_rad * end.dgap_dtwist_m_per_rad;
            assert!((plain.at(LOAD_N, end_rad + outwards * beyond_rad).gap_m - expected_m).abs() < 1e-7);
        }
        assert!(plain.covers(end_rad + outwards * 0.99 * OUTSIDE_RAD));
        assert!(!plain.covers(end_rad + outwards * 1.01 * OUTSIDE_RAD));
    }
    assert_eq!((scaled(0.9).twist_max_rad(), scaled(1.1).twist_max_rad()), (m.twist_max_rad, m.twist_max_rad / 1.1));
}
