//! The limits of a rod's states: the zone in which the equilibrium is known to be unique, and the physical limits.

use super::contour::{self, Field};
use super::grid::Grid;
use rigctl::parallel::{Progress, parallel};
use std::f64::consts::PI;
use tsa_model::material::FIT_RANGE;
use tsa_model::rod::TipForce;
use tsa_model::{Mechanism, twist_from_turns};

/// Nodes along each axis.
const NODES: usize = 60;

/// A line over turns (across) and load (N, up), in pieces.
pub type Line = Vec<Vec<(f64, f64)>>;

/// The limits over the grid's range, computed on a finer grid:
///
/// - |n| l²/EI = π²/4, EI the softest bending stiffness that occurs: below it there is one equilibrium.
/// - X = r0 θ/π: past it two strings of diameter r0 have no room.
/// - The clamp's bending strain is where the stress–strain curve is flattest, if it has a plateau.
/// - The clamp's bending strain leaves the range of the stress–strain fit.
pub fn lines(mechanism: &Mechanism, grid: &Grid, progress: &Progress<'_>) -> [Line; 4] {
    let part = |k: usize| k as f64 / (NODES - 1) as f64;
    let ([t0, t1], [f0, f1]) = (grid.turn_range, grid.load_range_n);
    let turns: Vec<f64> = (0..NODES).map(|k| t0 + (t1 - t0) * part(k)).collect();
    let loads: Vec<f64> = (0..NODES).map(|k| f0 * (f1 / f0).powf(part(k))).collect();
    let nodes =
        parallel(progress, NODES * NODES, |k| at(mechanism, loads[k % NODES], twist_from_turns(turns[k / NODES])));
    let line = |which: usize, level: f64| {
        let values: Vec<f64> = nodes.iter().map(|node| node[which]).collect();
        contour::lines(&Field { x: &turns, y: &loads, values: &values }, level)
    };
    let plateau = plateau_strain(&mechanism.parameters().stress_coefficients_pa).map_or(vec![], |e| line(2, e));
    [line(0, 1.0), line(1, 1.0), plateau, line(2, FIT_RANGE)]
}

/// Whether one equilibrium is known to exist at a state: its load number is below π²/4.
pub fn is_safe(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> bool {
    at(mechanism, load_n, twist_rad)[0] < 1.0
}

/// Load number over its safe limit, distance of the rods over that of two strings side by side, bending strain; NaN
/// where there is no equilibrium.
fn at(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> [f64; 3] {
    let Ok(e) = mechanism.formal(load_n, twist_rad) else { return [f64::NAN; 3] };
    let rod = mechanism.rod();
    let softest = rod.section.softest(e.bending_strain * e.bending_strain);
    let side_by_side_m = mechanism.parameters().diameter_m * twist_rad / PI;
    [rod.load_number(TipForce::of(&e)) * 4.0 / (PI * PI * softest), e.x_m / side_by_side_m, e.bending_strain]
}

/// The strain within the fit at which a fibre's tangent modulus is least, if that is under a quarter of its first.
fn plateau_strain(a: &[f64; 5]) -> Option<f64> {
    let tangent = |e: f64| a[0] + e * (2.0 * a[1] + e * (3.0 * a[2] + e * (4.0 * a[3] + e * 5.0 * a[4])));
    let strains = (0..=1000).map(|k| FIT_RANGE * f64::from(k) / 1000.0);
    let (strain, min) = strains.map(|e| (e, tangent(e))).min_by(|x, y| x.1.total_cmp(&y.1))?;
    (min < 0.25 * a[0] && strain < FIT_RANGE).then_some(strain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plateau_is_found_where_it_is() {
        assert_eq!(plateau_strain(&[2e10; 5]), None);
        let at = plateau_strain(&[2.4e10, 0.0, -9.5e12, 0.0, 1.72e15]).unwrap();
        assert!((at - (28.5f64 / 17200.0).sqrt()).abs() < 1e-4, "{at}");
    }
}
