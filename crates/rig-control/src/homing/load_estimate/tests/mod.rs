//! The weighing, step by step, on sweeps that the default scene's table makes: against the formula of the stated error, and against the minimum of the fit's sum, found here by differences.

extern crate std;

use super::*;
use crate::constants::tests::RIG;
use crate::hysteresis::memory_shape;
use crate::observer::open_gap_m;
use std::sync::OnceLock;
use tsa_table::Uncertainty;
use tsa_table::owned::OwnedTable;

/// The table of the default scene.
pub(crate) fn table() -> &'static Table<'static> {
    static OWNED: OnceLock<OwnedTable> = OnceLock::new();
    static TABLE: OnceLock<Table<'static>> = OnceLock::new();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/default.toml");
    let fitted = || rig_config::Scene::load(path).expect("a scene").fit_table().expect("it has a table").table;
    TABLE.get_or_init(|| OWNED.get_or_init(fitted).table())
}

/// A rig whose sweeps are made up.
struct Swept {
    load_n: f32,
    friction_n: f32,
    twist_scale: f32,
    /// What the gap differs by from the table's (m), at a twist (rad).
    beside_m: fn(f32) -> f32,
}

const SWEPT: Swept = Swept { load_n: 5.0, friction_n: 0.05, twist_scale: 1.0, beside_m: |_| 0.0 };
/// Twists (rad) at the ends of the sweeps; readings of each; the way down is measured at other twists than the way up.
const ENDS_RAD: [f32; 2] = [5.0, 37.0];
const READINGS: u16 = 320;
const DOWN_RAD: f32 = 0.2;

impl Swept {
    fn gap_m(&self, pull_n: f32, twist_rad: f32) -> f32 {
        let inside_n = pull_n.min(table().metadata.load_max_n);
        let point = table().point_inside(inside_n, self.twist_scale * twist_rad);
        point.gap_m + (pull_n - inside_n) * point.dgap_dload_m_per_n + (self.beside_m)(twist_rad)
    }

    /// Both sweeps, as far as a fraction of them is recorded.
    fn recorded(&self, given: LoadChoice, until: f32) -> LoadEstimate {
        let mut load_estimate = LoadEstimate::new(1.0, given, 0.0);
        for (pass, direction) in [1.0, -1.0].into_iter().enumerate() {
            for k in 0..READINGS {
                let fraction = (f32::from(k) + 0.5) / f32::from(READINGS);
                let twist_rad =
                    ENDS_RAD[0] + fraction * (ENDS_RAD[1] - ENDS_RAD[0]) + if pass == 1 { DOWN_RAD } else { 0.0 };
                let gap_m = self.gap_m(self.load_n + direction * self.friction_n, twist_rad);
                if fraction < until {
                    load_estimate.sweeps.record(fraction, twist_rad, gap_m);
                }
            }
            assert_eq!((load_estimate.sweeps.pass, load_estimate.sweeps.end_pass()), (pass, pass == 1));
        }
        load_estimate
    }
}

fn fitted(load_estimate: &mut LoadEstimate) -> Result<Weighed, HomingFailure> {
    fitted_by(load_estimate, table())
}

fn fitted_by(load_estimate: &mut LoadEstimate, table: &Table<'_>) -> Result<Weighed, HomingFailure> {
    load_estimate.begin_fit(table, &RIG);
    for _ in 1..STEPS {
        assert!(load_estimate.fit_step(table)?.is_none());
    }
    load_estimate.fit_step(table).map(|found| found.expect("the last step"))
}

#[track_caller]
fn near(found: f32, expected: f32, fraction: f32) {
    assert!((found - expected).abs() <= fraction * expected.abs(), "{found} instead of {expected}");
}

#[test]
fn the_curve_goes_through_a_cubic_rest_and_carries_the_offset() {
    let rest: [(f32, f32); 24] = core::array::from_fn(|k| {
        let twist_rad = 8.0 + k as f32;
        let place = (twist_rad - 19.5) / 11.5;
        (twist_rad, 1e-4 * place * place * place - 5e-5 * place)
    });
    let curve = curve(&rest, 2e-3).unwrap();
    for (twist_rad, left_m) in rest {
        assert!((curve.at(twist_rad).0 - left_m - 2e-3).abs() < 1e-7);
    }
}

#[test]
fn readings_go_where_their_share_of_the_sweep_says() {
    let mut load_estimate = LoadEstimate::new(1.0, LoadChoice::Auto, 0.0);
    for fraction in [-0.01, 1.01, f32::NAN] {
        load_estimate.sweeps.record(fraction, 1.0, 1.0);
    }
    for (fraction, place) in [(0.0, 0), (0.99 / 32.0, 0), (1.0 / 32.0, 1), (0.5, 16), (0.999, 31), (1.0, 31)] {
        let before = load_estimate.sweeps.bins[0][place].count;
        load_estimate.sweeps.record(fraction, 2.0, 0.1);
        assert_eq!(load_estimate.sweeps.bins[0][place].count, before + 1, "{fraction}");
    }
    assert_eq!(load_estimate.sweeps.bins[0].iter().map(|bin| bin.count).sum::<u16>(), 6);
    assert_eq!((load_estimate.sweeps.bins[0][31].angle_sum, load_estimate.sweeps.bins[0][31].gap_sum), (4.0, 0.2));
    // A way without readings makes no pair.
    assert!(load_estimate.pair(16).is_none());
}

#[test]
fn both_ways_of_a_bin_count_the_same_however_many_readings_they_have() {
    let mut load_estimate = LoadEstimate::new(1.0, LoadChoice::Auto, 0.0);
    (0..3).for_each(|_| load_estimate.sweeps.record(0.5, 10.0, 0.09));
    load_estimate.sweeps.end_pass();
    load_estimate.sweeps.record(0.5, 12.0, 0.08);
    let pair = load_estimate.pair(16).expect("both ways");
    near(pair.twist_rad, 11.0, 1e-6);
    near(pair.gap_m, 0.085, 1e-6);
    near(pair.half_twist_rad, -1.0, 1e-6);
    near(pair.half_gap_m, 0.005, 1e-4);
}

#[test]
fn the_fit_begins_with_a_given_weight_or_in_the_middle_of_the_table() {
    let m = &table().metadata;
    let begins = |given: LoadChoice| {
        let mut load_estimate = SWEPT.recorded(given, 1.0);
        load_estimate.begin_fit(table(), &RIG);
        load_estimate.unknowns.load_n
    };
    near(begins(LoadChoice::Auto), libm::sqrtf(m.load_min_n * m.load_max_n), 1e-6);
    assert_eq!(begins(LoadChoice::Known(3.0)), 3.0);
    assert_eq!(begins(LoadChoice::Known(1e3)), m.load_max_n);
}

#[test]
fn a_rig_that_is_its_table_is_found_as_it_is() {
    // On the way up the last one pulls harder than the table reaches.
    for (load_n, friction_n) in [(5.0, 0.05), (1.2, 0.02), (14.0, 0.4), (17.65, 0.6)] {
        let swept = Swept { load_n, friction_n, ..SWEPT };
        let found = fitted(&mut swept.recorded(LoadChoice::Auto, 1.0)).expect("a load");
        near(found.load_n, load_n, 0.02);
        near(found.friction_n, friction_n, 0.05);
        near(found.twist_scale, 1.0, 2e-3);
        for twist_rad in [6.0, 15.0, 25.0, 35.0] {
            let mechanism = Mechanism { table: *table(), twist_scale: found.twist_scale, curve: found.curve };
            near(mechanism.at(found.load_n, twist_rad).gap_m, swept.gap_m(load_n, twist_rad), 1e-4);
        }
    }
}

/// A rig with another radius, another zero and a gap that no load explains.
const BESIDE: Swept =
    Swept { twist_scale: 1.004, beside_m: |twist_rad| 0.1e-3 + 0.08e-3 * libm::sinf(0.7 * twist_rad), ..SWEPT };

/// Residuals (mm) of the fit at its unknowns: logarithm of the load, logarithm of the scale, offset (mm), slope, growth.
fn residuals(load_estimate: &LoadEstimate, unknowns: [f32; UNKNOWNS]) -> std::vec::Vec<f64> {
    let mechanism = Mechanism {
        table: *table(),
        twist_scale: libm::expf(unknowns[1]),
        curve: GapCurve::constant(1e-3 * unknowns[2]),
    };
    let load_n = libm::expf(unknowns[0]);
    let left = |pair: Pair| {
        let up = mechanism.at(load_n + load_estimate.friction_n, pair.twist_rad + pair.half_twist_rad);
        let down = mechanism.at(load_n - load_estimate.friction_n, pair.twist_rad - pair.half_twist_rad);
        let by_twist = 0.5 * f64::from(up.dgap_dtwist_m_per_rad + down.dgap_dtwist_m_per_rad);
        let twist_rad = f64::from(pair.twist_rad);
        let by_slope_m = f64::from(unknowns[3] * (pair.gap_m - load_estimate.middle_m));
        let by_growth_m = f64::from(unknowns[4]) * by_twist * twist_rad * (twist_rad / core::f64::consts::PI).ln();
        1e3 * (f64::from(pair.gap_m) - 0.5 * (f64::from(up.gap_m) + f64::from(down.gap_m)) - by_slope_m - by_growth_m)
    };
    load_estimate.pairs().map(left).collect()
}

/// What is fitted ends where the sum of squares has its minimum, and its covariance is the inverse of half the sum's curvature.
#[test]
fn the_fit_ends_at_the_minimum_and_states_the_inverse_of_its_curvature() {
    for given in [LoadChoice::Auto, LoadChoice::Known(5.1)] {
        let mut load_estimate = BESIDE.recorded(given, 1.0);
        let found = fitted(&mut load_estimate).expect("a load");
        let uncertainty = &table().metadata.uncertainty;
        let Unknowns { load_n, twist_scale, offset_m, slope, growth } = load_estimate.unknowns;
        let at = [libm::logf(load_n), libm::logf(twist_scale), 1e3 * offset_m, slope, growth];
        let left = residuals(&load_estimate, at);
        let residual_mm = (left.iter().map(|r| r * r).sum::<f64>() / left.len() as f64).sqrt();
        assert!(residual_mm > 5e-3, "above the minimum error of a bin: {residual_mm}");
        let law_error_mm = 1e3 * f64::from(load_estimate.law_error_m);
        let weight = 1.0 / (residual_mm * residual_mm + law_error_mm * law_error_mm);
        // Derivatives of the residuals by differences.
        const STEP: f32 = 4e-3;
        let derivatives: [std::vec::Vec<f64>; UNKNOWNS] = core::array::from_fn(|unknown| {
            let mut sides = [at; 2];
            (sides[0][unknown], sides[1][unknown]) = (at[unknown] - STEP, at[unknown] + STEP);
            let [low, high] = sides.map(|side| residuals(&load_estimate, side));
            low.iter().zip(high).map(|(low, high)| (high - low) / f64::from(2.0 * STEP)).collect()
        });
        // What else is known: the scene's radius, zero and LVDT, a given weight.
        let mut known = std::vec![
            (1, f64::from(uncertainty.twist_scale), f64::from(at[1])),
            (2, f64::from(1e3 * libm::hypotf(uncertainty.gap_zero_m, RIG.lvdt_reading_error_m())), f64::from(at[2])),
            (3, f64::from(RIG.lvdt_slope_error()), f64::from(at[3])),
            (4, f64::from(uncertainty.twist_scale), f64::from(at[4])),
        ];
        if let LoadChoice::Known(given_n) = given {
            known.push((0, f64::from(GIVEN_ERROR * given_n / load_n), f64::from((load_n - given_n) / load_n)));
        }
        let mut information = [[0.0f64; UNKNOWNS]; UNKNOWNS];
        let mut falls = [0.0f64; UNKNOWNS];
        for a in 0..UNKNOWNS {
            falls[a] += weight * derivatives[a].iter().zip(&left).map(|(d, r)| d * r).sum::<f64>();
            for b in 0..UNKNOWNS {
                information[a][b] +=
                    weight * derivatives[a].iter().zip(&derivatives[b]).map(|(a, b)| a * b).sum::<f64>();
            }
        }
        for (unknown, sigma, away) in known {
            information[unknown][unknown] += 1.0 / (sigma * sigma);
            falls[unknown] += away / (sigma * sigma);
        }
        for unknown in 0..UNKNOWNS {
            let fraction = falls[unknown] / information[unknown][unknown].sqrt();
            assert!(fraction.abs() < 0.05, "{unknown}: the sum still falls by {fraction} standard errors");
        }
        let inverse = Cholesky::new(information.map(|row| row.map(|x| x as f32))).expect("positive").inverse();
        let [scale, both, constant, scale_slope, constant_slope, slope] = found.covariance;
        // The one scale is the fit's and a multiple of the growth.
        let sum = |a: usize, b: usize| derivatives[a].iter().zip(&derivatives[b]).map(|(a, b)| a * b).sum::<f64>();
        let of_growth = (sum(1, 4) / sum(1, 1)) as f32;
        near(found.twist_scale, twist_scale * (1.0 + of_growth * growth), 1e-3);
        near(scale, inverse[1][1] + of_growth * (2.0 * inverse[1][4] + of_growth * inverse[4][4]), 0.04);
        // From the middle of the gaps to gap 0.
        let middle_m = load_estimate.middle_m;
        near(scale_slope, inverse[1][3] + of_growth * inverse[3][4], 0.04);
        near(both, 1e-3 * (inverse[1][2] + of_growth * inverse[2][4]) - middle_m * scale_slope, 0.02);
        near(constant, 1e-6 * inverse[2][2] + middle_m * (middle_m * inverse[3][3] - 2e-3 * inverse[2][3]), 0.02);
        near(constant_slope, 1e-3 * inverse[2][3] - middle_m * inverse[3][3], 0.02);
        near(slope, inverse[3][3], 0.02);
        let shape = if given == LoadChoice::Auto { uncertainty.load_shape } else { 0.0 };
        near(found.load_sigma_n, load_n * libm::sqrtf(inverse[0][0] + shape * shape), 0.02);
    }
}

/// An error of the load by `load_shape` changes the gaps of the sweep by as much, about their mean.
#[test]
fn the_mechanism_may_miss_the_gaps_by_as_much_as_load_shape_changes_them() {
    let mut load_estimate = SWEPT.recorded(LoadChoice::Auto, 1.0);
    load_estimate.begin_fit(table(), &RIG);
    let m = &table().metadata;
    let shape = f64::from(m.uncertainty.load_shape);
    let load_n = f64::from(m.load_min_n * m.load_max_n).sqrt();
    let gap_m =
        |fraction: f64, pair: &Pair| f64::from(table().point_inside((load_n * fraction) as f32, pair.twist_rad).gap_m);
    let changes_m: std::vec::Vec<f64> =
        load_estimate.pairs().map(|pair| 0.5 * (gap_m(1.0 + shape, &pair) - gap_m(1.0 - shape, &pair))).collect();
    let count = changes_m.len() as f64;
    let mean_m = changes_m.iter().sum::<f64>() / count;
    let rms_m = (changes_m.iter().map(|x| (x - mean_m) * (x - mean_m)).sum::<f64>() / count).sqrt();
    near(load_estimate.law_error_m, rms_m as f32, 0.15);
}

/// The scene of an identified rig knows radius and zero well, and how much its law misses. Gaps that differ from the table by as
/// much do not contradict the scene.
#[test]
fn what_the_scene_says_that_its_law_misses_does_not_contradict_it() {
    let uncertainty = Uncertainty { twist_scale: 0.004, gap_zero_m: 1e-4, load_shape: 0.06, rod_memory: 0.0 };
    let mut identified = *table();
    identified.metadata.uncertainty = uncertainty;
    for load_n in [2.0, 4.0, 8.0] {
        for beside_m in
            [|twist_rad: f32| 5e-5 * libm::cosf(0.1 * twist_rad), |twist_rad: f32| 5e-5 * libm::sinf(0.1 * twist_rad)]
        {
            let mut load_estimate = Swept { load_n, beside_m, ..SWEPT }.recorded(LoadChoice::Auto, 1.0);
            let found = fitted_by(&mut load_estimate, &identified).expect("a load");
            let error_n = super::super::NINETY_PERCENT * found.load_sigma_n;
            assert!(
                (found.load_n - load_n).abs() < error_n && error_n < 0.15 * load_n,
                "{load_n} N: {} ± {error_n} N",
                found.load_n
            );
        }
    }
}

/// Half of the difference of the ways is friction.
#[test]
fn friction_is_what_the_ways_differ_by_whatever_their_twists() {
    for friction_n in [0.0, 0.1, 0.6] {
        let mut load_estimate = Swept { friction_n, ..SWEPT }.recorded(LoadChoice::Known(5.0), 1.0);
        let found = fitted(&mut load_estimate).expect("a load");
        assert!((found.friction_n - friction_n).abs() < 2e-3 + 0.01 * friction_n, "{} {friction_n}", found.friction_n);
    }
    // No more than 0.4 of the load is friction, and never less than none.
    let found = fitted(&mut Swept { friction_n: 3.0, ..SWEPT }.recorded(LoadChoice::Known(5.0), 1.0));
    assert!(found.is_err() || found.is_ok_and(|found| found.friction_n <= 0.4 * 5.1));
    let found = fitted(&mut Swept { friction_n: -0.5, ..SWEPT }.recorded(LoadChoice::Known(5.0), 1.0)).expect("a load");
    assert_eq!(found.friction_n, 0.0);
}

#[test]
fn half_of_the_bins_are_enough() {
    // Of 32 bins the first four are left out; twelve are half of those that are used.
    let until = |bins: f32| fitted(&mut SWEPT.recorded(LoadChoice::Known(5.0), (bins - 0.01) / BINS as f32));
    assert_eq!(until(4.0 + 11.0), Err(HomingFailure::PoorFit));
    assert!(until(4.0 + 12.0).is_ok());
}

/// The result of unknowns and a covariance, on sweeps that the table makes.
fn result(unknowns: Unknowns, given: LoadChoice, wanted_n: f32, residual_m: f32) -> Result<Weighed, HomingFailure> {
    let mut covariance = [[0.0; UNKNOWNS]; UNKNOWNS];
    (covariance[0][0], covariance[1][1], covariance[2][1], covariance[2][2]) = (1e-4, 4e-6, 5e-4, 9e-2);
    ended(unknowns, given).result(table(), wanted_n, &covariance, 0.0, residual_m)
}

/// At the last step.
fn ended(unknowns: Unknowns, given: LoadChoice) -> LoadEstimate {
    let recorded = SWEPT.recorded(given, 1.0);
    LoadEstimate {
        unknowns,
        friction_n: 0.1,
        zero_error_m: ZERO_ERROR_M,
        slope_error: RIG.lvdt_slope_error(),
        ..recorded
    }
}

/// Standard error of the LVDT's zero (m).
const ZERO_ERROR_M: f32 = 0.5e-3;
const EXPECTED: Unknowns = Unknowns { load_n: 5.0, twist_scale: 1.0, offset_m: 0.0, slope: 0.0, growth: 0.0 };

#[test]
fn errors_are_those_of_the_fit_and_of_how_the_radius_depends_on_the_load() {
    let shape = table().metadata.uncertainty.load_shape;
    for (given, shape) in [(LoadChoice::Auto, shape), (LoadChoice::Known(5.0), 0.0)] {
        let found = result(EXPECTED, given, 5.0, 0.0).expect("a load");
        assert_eq!((found.load_n, found.friction_n, found.twist_scale), (5.0, 0.1, 1.0));
        near(found.load_sigma_n, 5.0 * libm::sqrtf(1e-4 + shape * shape), 1e-3);
        for (found, expected) in found.covariance.into_iter().zip([4e-6, 5e-7, 9e-8, 0.0, 0.0, 0.0]) {
            near(found, expected, 1e-3);
        }
    }
    assert!(result(EXPECTED, LoadChoice::Auto, 5.0, 9.9 * LAW_GAP_ERROR_M).is_ok());
    assert_eq!(result(EXPECTED, LoadChoice::Auto, 5.0, 10.1 * LAW_GAP_ERROR_M), Err(HomingFailure::PoorFit));
}

#[test]
fn a_load_on_rods_that_remember_a_heavier_one_is_lighter_than_it_seems_unless_it_is_given() {
    let Uncertainty { rod_memory, load_shape, .. } = table().metadata.uncertainty;
    for heaviest_n in [0.0f32, 5.0, 7.0, 12.0] {
        let found = |given| {
            let heaviest_n = LoadEstimate::new(1.0, given, heaviest_n).heaviest_n;
            let remembers = LoadEstimate { heaviest_n, ..ended(EXPECTED, given) };
            (remembers.result(table(), 5.0, &[[0.0; UNKNOWNS]; UNKNOWNS], 0.0, 0.0).expect("a load"), heaviest_n)
        };
        let (weighed, remembered_n) = found(LoadChoice::Auto);
        let excess = rod_memory * memory_shape(weighed.load_n, heaviest_n);
        assert_eq!((weighed.apparent_n, remembered_n), (5.0, heaviest_n));
        near(weighed.load_n * (1.0 + excess), 5.0, 1e-3);
        near(weighed.load_sigma_n / weighed.load_n, load_shape.hypot(MEMORY_ERROR * excess), 1e-3);
        let (given, remembered_n) = found(LoadChoice::Known(5.0));
        assert_eq!((given.apparent_n, given.load_n, given.load_sigma_n, remembered_n), (5.0, 5.0, 0.0, 0.0));
    }
}

/// Rig and scene contradict each other: the load is unknown, unless the operator says it.
#[test]
fn a_surprise_that_is_too_large_leaves_the_load_unknown() {
    let scale = table().metadata.uncertainty.twist_scale;
    for (sigmas, contradicts) in [(0.99, false), (1.01, true)].map(|(x, c)| (x * libm::sqrtf(MAX_SURPRISE), c)) {
        for (unknowns, residual_m) in [
            (EXPECTED, sigmas * LAW_GAP_ERROR_M),
            (Unknowns { twist_scale: 1.0 + sigmas * scale, ..EXPECTED }, 0.0),
            (Unknowns { offset_m: -sigmas * ZERO_ERROR_M, ..EXPECTED }, 0.0),
            (Unknowns { slope: sigmas * RIG.lvdt_slope_error(), ..EXPECTED }, 0.0),
            (Unknowns { growth: -sigmas * scale, ..EXPECTED }, 0.0),
        ] {
            let found = |given| result(unknowns, given, 5.0, residual_m).expect("a load").load_sigma_n;
            assert_eq!(found(LoadChoice::Auto) == 5.0, contradicts, "{sigmas} {unknowns:?}");
            assert!(found(LoadChoice::Known(5.0)) < 0.1, "{sigmas} {unknowns:?}");
        }
    }
}

/// The scale makes good for a growth that is left out: what is left of the gap and the covariance follow.
#[test]
fn one_scale_stands_for_scale_and_growth() {
    let mut covariance = [[0.0; UNKNOWNS]; UNKNOWNS];
    (covariance[1][1], covariance[4][1], covariance[4][4]) = (4e-4, -1e-4, 9e-4);
    (covariance[2][1], covariance[4][2], covariance[2][2]) = (5e-4, 2e-4, 9e-2);
    let estimate = ended(Unknowns { growth: -0.02, ..EXPECTED }, LoadChoice::Auto);
    let found = estimate.result(table(), 5.0, &covariance, 2.0, 0.0);
    let found = found.expect("a load");
    near(found.twist_scale, 1.0 - 2.0 * 0.02, 1e-6);
    let mechanism = Mechanism { table: *table(), twist_scale: found.twist_scale, curve: found.curve };
    for twist_rad in [10.0, 20.0, 30.0] {
        near(mechanism.at(5.0, twist_rad).gap_m, SWEPT.gap_m(5.0, twist_rad), 1e-4);
    }
    // (1, 2) C (1, 2)ᵀ and (1, 2) C (0, 1)ᵀ with millimetres.
    near(found.covariance[0], 4e-4 - 4.0 * 1e-4 + 4.0 * 9e-4, 1e-4);
    near(found.covariance[1], 1e-3 * (5e-4 + 2.0 * 2e-4), 1e-4);
}

/// The fit has all that it found from these gaps: one of them alone shows the load as well as all of them do.
#[test]
fn at_the_twists_of_the_sweep_the_gap_is_as_open_as_the_load_makes_it() {
    let shape = table().metadata.uncertainty.load_shape;
    for load_n in [1.0, 2.0, 5.0, 14.0] {
        let swept = Swept { load_n, friction_n: 0.02, ..SWEPT };
        let found = fitted(&mut swept.recorded(LoadChoice::Auto, 1.0)).expect("a load");
        let mechanism = Mechanism { table: *table(), twist_scale: found.twist_scale, curve: found.curve };
        let by_fit_n = libm::sqrtf(found.load_sigma_n.powi(2) - (shape * found.load_n).powi(2));
        for twist_rad in [5.0, 10.0, 20.0, 32.0] {
            let point = mechanism.at(found.load_n, twist_rad);
            let by_gap_n = open_gap_m(&found.covariance, &point, twist_rad) / point.dgap_dload_m_per_n;
            near(by_gap_n, by_fit_n, 0.05);
        }
    }
}

#[test]
fn a_load_is_refused_only_where_it_is_outside_whatever_its_error() {
    let m = &table().metadata;
    let sigma_n = |load_n: f32| load_n * 1e-2;
    for (load_n, edge_n, outwards) in [
        (m.load_max_n, 1.1 * m.load_max_n + super::super::NINETY_PERCENT * sigma_n(m.load_max_n), 1.0),
        (m.load_min_n, 0.9 * m.load_min_n - super::super::NINETY_PERCENT * sigma_n(m.load_min_n), -1.0),
    ] {
        let at = |wanted_n: f32| result(Unknowns { load_n, ..EXPECTED }, LoadChoice::Known(load_n), wanted_n, 0.0);
        assert!(at(edge_n - 1e-3 * outwards).is_ok(), "{load_n}");
        assert_eq!(at(edge_n + 1e-3 * outwards), Err(HomingFailure::LoadOutOfRange), "{load_n}");
    }
}

#[test]
fn a_curve_needs_a_way_along_the_twist() {
    assert!(curve(&[], 0.0).is_none());
    assert!(curve(&[(5.0, 1e-4); 8], 0.0).is_none());
    let found = curve(&core::array::from_fn::<_, 8, _>(|k| (10.0 + 2.0 * k as f32, 0.0)), 1e-3).expect("a curve");
    assert_eq!((found.middle_rad, found.half_rad), (17.0, 7.0));
}

/// Below the table's least load F₀ the gap goes on as a + b/F: with the table's slope at F₀, and nine times it at F₀/3.
#[test]
fn lighter_loads_than_the_tables_are_continued_in_one_over_the_load() {
    let mechanism = Mechanism { table: *table(), twist_scale: 1.0, curve: GapCurve::constant(0.0) };
    let min_n = table().metadata.load_min_n;
    let inside = mechanism.at(1.5 * min_n, 20.0);
    assert_eq!(below(&mechanism, 1.5 * min_n, 20.0), inside);
    let edge = mechanism.at(min_n, 20.0);
    let at = |load_n: f32| below(&mechanism, load_n, 20.0);
    let third = at(min_n / 3.0);
    near(third.dgap_dload_m_per_n, 9.0 * edge.dgap_dload_m_per_n, 1e-5);
    near(third.gap_m - edge.gap_m, -2.0 * edge.dgap_dload_m_per_n * min_n, 1e-4);
    // Its slope is that of its gap.
    let by_difference = (at(0.3383 * min_n).gap_m - at(0.3283 * min_n).gap_m) / (0.01 * min_n);
    near(by_difference, third.dgap_dload_m_per_n, 1e-3);
    // A load of nothing, or less, is taken for a tenth of the least.
    near(at(0.0).gap_m - edge.gap_m, -9.0 * edge.dgap_dload_m_per_n * min_n, 1e-4);
    assert_eq!(at(0.0), at(0.1 * min_n));
    assert_eq!(at(-1.0), at(0.1 * min_n));
}

/// What every rig as built has: an LVDT whose slope is 1 % off, and a radius that grows by another power of the twist.
#[test]
fn a_wrong_slope_and_a_radius_of_another_growth_are_not_taken_for_another_load() {
    fn slope(twist_rad: f32) -> f32 {
        0.01 * (table().point_inside(2.0, twist_rad).gap_m - 0.08)
    }
    fn growth(twist_rad: f32) -> f32 {
        let grown_rad = twist_rad * libm::powf(twist_rad / core::f32::consts::PI, -0.03);
        table().point_inside(2.0, grown_rad).gap_m - table().point_inside(2.0, twist_rad).gap_m
    }
    for beside_m in [slope as fn(f32) -> f32, growth] {
        let swept = Swept { load_n: 2.0, beside_m, ..SWEPT };
        let found = fitted(&mut swept.recorded(LoadChoice::Auto, 1.0)).expect("a load");
        let error_n = super::super::NINETY_PERCENT * found.load_sigma_n;
        assert!((found.load_n - 2.0).abs() < 0.5 * error_n && error_n < 0.3 * 2.0, "{} ± {error_n} N", found.load_n);
        // At the homed load gap and slope are those that this rig showed.
        let mechanism = Mechanism { table: *table(), twist_scale: found.twist_scale, curve: found.curve };
        for twist_rad in [10.0, 20.0, 30.0] {
            near(mechanism.at(found.load_n, twist_rad).gap_m, swept.gap_m(2.0, twist_rad), 2e-4);
        }
    }
}

/// Twice and half the load, and a load that is off by what a scale may be.
#[test]
fn a_given_weight_that_the_sweeps_contradict_leaves_the_load_unknown() {
    for (load_n, given_n, known) in [(10.0, 5.0, false), (5.0, 10.0, false), (5.0, 5.0, true), (5.0, 5.2, true)] {
        let swept = Swept { load_n, ..SWEPT };
        let Ok(found) = fitted(&mut swept.recorded(LoadChoice::Known(given_n), 1.0)) else {
            assert!(!known, "{given_n} N for {load_n} N");
            continue;
        };
        assert_eq!(found.load_sigma_n < 0.3 * load_n, known, "{given_n} N for {load_n} N: {found:?}");
    }
}
