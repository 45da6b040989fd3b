//! The certificate of a table: its errors at random points off any grid, and at the worst point that a search finds.

use crate::arc_growth;
use crate::errors::{Errors, error_at, errors_over};
use crate::record::is_monotone;
use crate::reference::{Exact, Reference};
use crate::table::Table;
use crate::table_spec::FitError;
use rand::{RngExt, SeedableRng};

/// Random points of a certificate.
pub const RANDOM_POINTS: usize = 20_000;

/// Intervals of load and twist at whose ends the gradient's signs are checked.
const SIGNS: u8 = 240;

/// Errors of a table against the full solver, measured with the f32 code that the board runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorBounds {
    /// Errors over all points, including the worst one found by the search.
    pub errors: Errors,
    /// Points sampled.
    pub points: usize,
    /// Load and twist of the worst contraction error (N, rad).
    pub worst_contraction_at: [f64; 2],
    /// Load and twist of the worst TR error (N, rad).
    pub worst_tr_at: [f64; 2],
    /// ∂G/∂θ < 0 and ∂G/∂F > 0 at every point of a dense grid: both inverses exist.
    pub monotone: bool,
    /// Largest difference between the table's contraction and the integral of its own 1/TR over the twist (m).
    pub closure_m: f64,
    /// The part of the errors that rounding makes.
    pub rounding: Rounding,
}

/// The part of a table's errors that f32 makes, the worst among the random points. [`Errors`] contain it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rounding {
    /// Of the gap by the lookup's arithmetic: f32 against the same numbers in f64 (m).
    pub arithmetic_m: f64,
    /// Of the gap by rounding load and twist to f32, half a unit in the last place each (m).
    pub inputs_m: f64,
    /// Of TR by the arithmetic (relative).
    pub tr_arithmetic: f64,
}

/// Measures the rounding of a table at these loads and twists.
fn rounding(table: &Table<'_>, at: &[Exact]) -> Rounding {
    let mut worst = Rounding::default();
    for e in at {
        let (load, twist) = (e.load_n as f32, e.twist_rad as f32);
        let single = table.point_inside(load, twist);
        let [gap, slope] = arc_growth::evaluate(&table.series, f64::from(load), f64::from(twist));
        worst.arithmetic_m = worst.arithmetic_m.max((f64::from(single.gap_m) - gap).abs());
        worst.tr_arithmetic = worst.tr_arithmetic.max((f64::from(single.dgap_dtwist_m_per_rad) / slope - 1.0).abs());
        let half = 0.5 * f64::from(f32::EPSILON);
        let by_load = f64::from(single.dgap_dload_m_per_n) * e.load_n * half;
        let by_twist = f64::from(single.dgap_dtwist_m_per_rad) * e.twist_rad * half;
        worst.inputs_m = worst.inputs_m.max(by_load.abs() + by_twist.abs());
    }
    worst
}

/// [`ErrorBounds::closure_m`], by Simpson's rule over the whole twist at loads from light to heavy.
fn closure(table: &Table<'_>) -> f64 {
    const LOADS: u32 = 60;
    const TWISTS: u32 = 400;
    let m = &table.metadata;
    let mut worst = 0f64;
    for i in 0..=LOADS {
        let load = m.load_min_n * (m.load_max_n / m.load_min_n).powf(i as f32 / LOADS as f32);
        let twist = |k: f32| m.twist_min_rad + (m.twist_max_rad - m.twist_min_rad) * k / TWISTS as f32;
        let at = |k: f32| table.point_inside(load, twist(k));
        let (start, mut integral) = (f64::from(at(0.0).gap_m), 0.0);
        for k in 0..TWISTS {
            let k = k as f32;
            let [a, b, c] = [k, k + 0.5, k + 1.0].map(|k| f64::from(at(k).dgap_dtwist_m_per_rad));
            integral += (a + 4.0 * b + c) / 6.0 * f64::from(twist(k + 1.0) - twist(k));
            worst = worst.max((start + integral - f64::from(at(k + 1.0).gap_m)).abs());
        }
    }
    worst
}

/// Measures a table at `points` random points and searches for the largest error from the worst of them.
pub(crate) fn certify(table: &Table<'_>, reference: &Reference<'_>, points: usize) -> Result<ErrorBounds, FitError> {
    let [f0, f1] = reference.load_n;
    let [t0, t1] = reference.twist_rad;
    // Half of the points are spread evenly over the load, half over its logarithm: the gap bends most at the light end.
    let state = |u: f64, v: f64, even: bool| {
        let load = if even { f0 + (f1 - f0) * u } else { f0 * (f1 / f0).powf(u) };
        (load.clamp(f0, f1), t0 + (t1 - t0) * v)
    };
    // The seed is the scene's hash, so that a certificate is reproducible.
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(u64::from(table.metadata.scene_hash));
    let mut exact = Vec::with_capacity(points);
    for k in 0..points {
        let (u, v): (f64, f64) = (random.random(), random.random());
        let (load, twist) = state(u, v, k % 2 == 0);
        exact.push(reference.exact(load, twist)?);
    }
    let look_up = |load_n, twist_rad| table.point_inside(load_n, twist_rad);
    let mut errors = errors_over(look_up, &exact);
    let mut worst = [[f0, t0], [f0, t0]];
    for (which, at) in worst.iter_mut().enumerate() {
        let pick = |p: &Exact| {
            let (contraction, tr) = error_at(look_up, p);
            if which == 0 { contraction } else { tr }
        };
        let mut order: Vec<(f64, [f64; 2])> = exact.iter().map(|p| (pick(p), [p.load_n, p.twist_rad])).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut best = order[0];
        for start in order.iter().take(24) {
            let climbed = climb(*start, [f0, f1], [t0, t1], |load, twist| Ok(pick(&reference.exact(load, twist)?)))?;
            if climbed.0 > best.0 {
                best = climbed;
            }
        }
        *at = best.1;
        let field = if which == 0 { &mut errors.contraction_max_m } else { &mut errors.tr_max };
        *field = field.max(best.0);
    }
    Ok(ErrorBounds {
        errors,
        points,
        worst_contraction_at: worst[0],
        worst_tr_at: worst[1],
        monotone: is_monotone(table, SIGNS),
        closure_m: closure(table),
        rounding: rounding(table, &exact),
    })
}

/// Pattern search for the largest error from a point: the steps are halved when no neighbour has a larger one.
fn climb(
    start: (f64, [f64; 2]),
    loads: [f64; 2],
    twists: [f64; 2],
    error: impl Fn(f64, f64) -> Result<f64, FitError>,
) -> Result<(f64, [f64; 2]), FitError> {
    let mut best = start;
    let (mut load_step, mut twist_step) = (0.05, 0.02 * (twists[1] - twists[0]));
    while load_step > 1e-4 {
        let [load, twist] = best.1;
        let before = best.0;
        for (a, b) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (1.0, 1.0), (-1.0, -1.0)] {
            let l = (load * (1.0 + a * load_step)).clamp(loads[0], loads[1]);
            let t = (twist + b * twist_step).clamp(twists[0], twists[1]);
            let e = error(l, t)?;
            if e > best.0 {
                best = (e, [l, t]);
            }
        }
        if best.0 <= before {
            load_step *= 0.5;
            twist_step *= 0.5;
        }
    }
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Patch;
    use crate::arc_growth::example::PARAMETERS;
    use crate::table::example::{COEFFICIENTS, PATCHES, table};
    use tsa_model::{Mechanism, PRETWIST_RAD, Tier};

    #[test]
    fn the_gap_is_the_integral_of_its_slope_up_to_rounding() {
        let closure_m = closure(&table(&PATCHES, &COEFFICIENTS));
        assert!(closure_m > 1e-9 && closure_m < 2e-7, "{closure_m:e} m");
        // The same square about an arc 4 m away is the difference of numbers two thousand times as large: however small
        // the part of the loads that has it, it is found at the light end and at the heavy one.
        let far = [0.0, -1.0, 0.0, 7.94, 5e-5, -15.7515];
        let patch = |load_max_n, away_m: f32| Patch { load_max_n, centre: [8.0, 0.02 - away_m] };
        for (patches, coefficients) in [
            ([patch(1.2, 4.0), patch(16.0, 0.0)], [far, COEFFICIENTS].concat()),
            ([patch(15.5, 0.0), patch(16.0, 4.0)], [COEFFICIENTS, far].concat()),
        ] {
            let closure_m = closure(&table(&patches, &coefficients));
            assert!(closure_m > 1e-6 && closure_m < 1e-4, "{closure_m:e} m");
        }
    }

    #[test]
    fn the_points_of_a_certificate_lie_evenly_over_the_twist_half_over_the_load_and_half_over_its_logarithm() {
        let (mechanism, t) = (Mechanism::of(PARAMETERS), table(&PATCHES, &COEFFICIENTS));
        let (load_n, twist_rad) = ([1.0, 16.0], [PRETWIST_RAD, 40.0]);
        let reference = Reference { mechanism: &mechanism, tier: Tier::Rigid, load_n, twist_rad };
        let found = certify(&t, &reference, 4000).unwrap().errors;
        let part = |k: u32| (f64::from(k % 40) + 0.5) / 40.0;
        let grid: Vec<Exact> = (0..1600)
            .flat_map(|k| {
                [1.0 + 15.0 * part(k), 16f64.powf(part(k))]
                    .map(|load| (load, 40.0 - (40.0 - PRETWIST_RAD) * part(k / 40)))
            })
            .map(|(load, twist)| reference.exact(load, twist).unwrap())
            .collect();
        // This table is of another mechanism, so that its error is another one at each state.
        let expected = errors_over(|load, twist| t.point_inside(load, twist), &grid);
        for (found, expected) in
            [(found.contraction_rms_m, expected.contraction_rms_m), (found.tr_rms, expected.tr_rms)]
        {
            assert!((found / expected - 1.0).abs() < 0.02, "{found:e} {expected:e}");
        }
    }

    #[test]
    fn rounding_is_that_of_the_arithmetic_and_of_half_a_unit_in_the_last_place_of_the_inputs() {
        let t = table(&PATCHES, &COEFFICIENTS);
        let state = |load_n, twist_rad| Exact { load_n, twist_rad, gap_m: 0.0, by_twist: 0.0, start_gap_m: 0.0 };
        let gap = |load_n, twist_rad| arc_growth::evaluate(&t.series, load_n, twist_rad)[0];
        let inputs = |load: f64, twist: f64| {
            let by_load = (gap(load * 1.0001, twist) - gap(load * 0.9999, twist)) / 0.0002;
            let by_twist = (gap(load, twist * 1.0001) - gap(load, twist * 0.9999)) / 0.0002;
            0.5 * f64::from(f32::EPSILON) * (by_load.abs() + by_twist.abs())
        };
        let alone = rounding(&t, &[state(4.0, 50.0)]);
        assert!((alone.inputs_m / inputs(4.0, 50.0) - 1.0).abs() < 1e-3, "{:e}", alone.inputs_m);
        let states: Vec<Exact> =
            (0..200).map(|k| state(1.0 + 0.07 * f64::from(k), 4.0 + 0.28 * f64::from(k))).collect();
        let all = rounding(&t, &states);
        let worst = states.iter().map(|e| inputs(e.load_n, e.twist_rad)).fold(0.0, f64::max);
        assert!((all.inputs_m / worst - 1.0).abs() < 1e-3, "{:e} {worst:e}", all.inputs_m);
        // Some 20 operations on a gap of 0.1 m, each wrong by at most 6e-8 of it.
        assert!(all.arithmetic_m > 1e-9 && all.arithmetic_m < 2e-7 && all.tr_arithmetic < 1e-5, "{all:?}");
        assert!(all.tr_arithmetic > 1e-8, "{all:?}");
    }

    #[test]
    fn the_search_climbs_to_the_top_inside_the_range_or_on_its_edge() {
        let (loads, twists) = ([1.0, 16.0], [3.0, 60.0]);
        for (top, at) in [([5.0, 20.0], [5.0, 20.0]), ([20.0, 30.0], [16.0, 30.0]), ([0.5, 70.0], [1.0, 60.0])] {
            let error = |load: f64, twist: f64| {
                assert!((loads[0]..=loads[1]).contains(&load) && (twists[0]..=twists[1]).contains(&twist));
                Ok(1.0 - ((load / top[0]).ln().powi(2) + ((twist - top[1]) / 50.0).powi(2)))
            };
            let start = [3.0, 35.0];
            let (best, found) = climb((error(start[0], start[1]).unwrap(), start), loads, twists, error).unwrap();
            assert!((found[0] / at[0] - 1.0).abs() < 2e-3 && (found[1] - at[1]).abs() < 0.05, "{found:?}");
            assert_eq!(best, error(found[0], found[1]).unwrap());
        }
        // From a narrow top it does not go away.
        let needle = |load: f64, _: f64| Ok(if load == 2.0 { 1.0 } else { 0.0 });
        assert_eq!(climb((1.0, [2.0, 9.0]), loads, twists, needle).unwrap(), (1.0, [2.0, 9.0]));
    }
}
