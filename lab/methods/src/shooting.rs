//! Shooting: guess the clamp's moment, integrate to the tip, correct by Newton–Raphson until the moment there is zero.

use crate::ode::{Point, RodOde, plain, response, with_compliance};
use tsa_model::helix::{ALPHA_LIMIT, State};
use tsa_model::rod::{Rod, RodResponse, TipForce};
use tsa_model::scalar::{Dual, Scalar};
use tsa_model::{Equilibrium, Mechanism, SolveError};

/// Maximum corrections of the clamp's moment.
const CORRECTIONS: u32 = 60;
/// Maximum relaxations of the helix angle.
const RELAXATIONS: u32 = 500;

/// An integration from the clamp: initial moment in, tip out.
type Shot<'a> = &'a mut dyn FnMut(Dual<1>) -> Result<Point<Dual<1>>, SolveError>;

/// Newton–Raphson on the clamp's moment, starting from that of the straight rod, M = Py l.
pub(crate) fn correct(rod: &Rod, force: TipForce, tolerance: f64, shot: Shot<'_>) -> Result<f64, SolveError> {
    let scale = force.sideways_n * rod.length_m / (rod.stiffness_n * rod.radius_m);
    let mut moment = scale;
    for _ in 0..CORRECTIONS {
        let tip = shot(Dual::parameter(moment, 0))?;
        let step = tip[1].value / tip[1].by[0];
        if !step.is_finite() {
            break;
        }
        moment -= step;
        // A step of the size of rounding ends it too: a smaller one would lead to 0/0.
        if step.abs() <= tolerance.max(4.0 * f64::EPSILON) * moment.abs() {
            return Ok(moment);
        }
    }
    Err(SolveError::Diverged { stage: "shooting for the clamp's moment" })
}

/// Classical Runge–Kutta from the clamp to the tip.
fn runge_kutta<T: Scalar>(
    ode: &RodOde<T>,
    moment: T,
    steps: usize,
    evaluations: &mut u32,
) -> Result<(Point<T>, (f64, f64)), SolveError> {
    let zero = T::of(0.0);
    let mut y = [zero, moment, zero, zero];
    let mut strain = (-ode.inward, moment * 4.0);
    let mut clamp = None;
    let h = 1.0 / steps as f64;
    for _ in 0..steps {
        let mut sum = [zero; 4];
        let mut stage = y;
        for (weight, ahead) in [(1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0)] {
            let slope = ode.slope(stage, strain)?;
            *evaluations += 1;
            strain = slope.strain;
            clamp.get_or_insert((strain.0.value(), strain.1.value()));
            for k in 0..4 {
                sum[k] += slope.by_length[k] * (weight * h / 6.0);
                stage[k] = y[k] + slope.by_length[k] * (ahead * h);
            }
        }
        for k in 0..4 {
            y[k] += sum[k];
        }
    }
    Ok((y, clamp.unwrap_or_default()))
}

/// The rod's response by shooting with fixed steps.
fn respond(
    rod: &Rod,
    force: TipForce,
    steps: usize,
    tolerance: f64,
    evaluations: &mut u32,
) -> Result<RodResponse, SolveError> {
    let by_moment = plain(rod, force).map(Dual::of);
    let moment =
        correct(rod, force, tolerance, &mut |moment| Ok(runge_kutta(&by_moment, moment, steps, evaluations)?.0))?;
    // One Newton step in numbers that carry derivatives by the force gives those of the solution.
    let slope = runge_kutta(&by_moment, Dual::parameter(moment, 0), steps, evaluations)?.0[1].by[0];
    let ode = with_compliance(rod, force);
    let start = Dual::of(moment);
    let miss = runge_kutta(&ode, start, steps, evaluations)?.0[1];
    let (tip, clamp) = runge_kutta(&ode, start - miss / slope, steps, evaluations)?;
    Ok(response(rod, tip, clamp))
}

/// The paper's method, Fig. 5: solve the rod at a helix angle, put its span into eq. 25, relax the angle towards the
/// result, until it no longer changes.
pub(crate) fn paper(
    m: &Mechanism,
    state: &State,
    steps: usize,
    relaxation: f64,
    tolerance: f64,
) -> Result<Equilibrium, SolveError> {
    let mut alpha = m.rigid_helix_angle(state);
    let mut evaluations = 0;
    for iterations in 1..=RELAXATIONS {
        let helix = m.helix(state, alpha);
        let rod = respond(m.rod(), state.force(helix.tan), steps, tolerance, &mut evaluations)?;
        // tan α' = H/X
        let run = helix.run(m.parameters(), state, rod.reach.value);
        let step = relaxation * (Scalar::asin(run / (run * run + helix.x_m * helix.x_m).sqrt()) - alpha);
        if step.abs() <= tolerance {
            let mut found = m.finish(state, alpha, &rod)?;
            (found.iterations, found.evaluations) = (iterations, evaluations);
            return Ok(found);
        }
        alpha += step;
        if !(0.0..ALPHA_LIMIT).contains(&alpha) {
            break;
        }
    }
    Err(SolveError::Diverged { stage: "relaxation of the helix angle" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tsa_model::section::Strain;

    #[test]
    fn the_first_integral_is_conserved_along_the_rod() {
        // The heaviest of the full polynomial rods (crates/tsa-model/README.md 2.4): 8.5 N at 40°.
        let rod = Rod::new(0.013, 0.0005, &[2e10; 5]);
        let force = TipForce { inward_n: 8.5 * 40f64.to_radians().tan(), sideways_n: 8.5 };
        let moment = {
            let mut ode = plain(&rod, force);
            ode.slenderness = rod.length_m / rod.radius_m;
            let dual = ode.map(Dual::of);
            correct(&rod, force, 1e-14, &mut |m| Ok(runge_kutta(&dual, m, 2000, &mut 0)?.0)).unwrap()
        };
        let mut values = Vec::new();
        for part in 0..=10 {
            let mut ode = plain(&rod, force);
            ode.slenderness *= f64::from(part) / 10.0;
            let (point, _) = runge_kutta(&ode, moment, 2000, &mut 0).unwrap();
            let (e, b) = ode.slope(point, (0.0, 4.0 * point[1])).unwrap().strain;
            values.push(rod.section.first_integral(Strain { axial: e, bending_squared: b * b }));
        }
        // The terms of the integral are of the size of κM at the clamp.
        let size = moment * moment;
        let drift = values.iter().map(|h| (h - values[0]).abs()).fold(0.0, f64::max) / size;
        assert!(drift < 1e-12, "{drift}: {values:?}");
    }
}
