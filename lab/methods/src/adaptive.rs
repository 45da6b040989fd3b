//! Shooting with an adaptive integrator of high order (DOP853).

use crate::ode::{Point, RodOde, plain, response, with_compliance};
use crate::shooting::correct;
use core::cell::{Cell, RefCell};
use differential_equations::prelude::{ExplicitRungeKutta, IVP};
use tsa_model::SolveError;
use tsa_model::rod::{Rod, RodResponse, TipForce};
use tsa_model::scalar::{Dual, Scalar};

/// The rod's response by shooting with DOP853.
pub(crate) fn respond(
    rod: &Rod,
    force: TipForce,
    tolerance: f64,
    evaluations: &mut u32,
) -> Result<RodResponse, SolveError> {
    let by_moment = plain(rod, force).map(Dual::of);
    let moment = correct(rod, force, 0.1 * tolerance, &mut |moment| {
        adaptive_shot::<1, 8>(&by_moment, moment, tolerance, evaluations)
    })?;
    let ode = with_compliance(rod, force);
    let start = Dual::of(moment);
    let slope = adaptive_shot::<1, 8>(&by_moment, Dual::parameter(moment, 0), tolerance, evaluations)?[1].by[0];
    let miss = adaptive_shot::<2, 12>(&ode, start, tolerance, evaluations)?[1];
    let start = start - miss / slope;
    let clamp = ode.slope([Dual::of(0.0), start, Dual::of(0.0), Dual::of(0.0)], (-ode.inward, start * 4.0));
    let (e, b) = clamp?.strain;
    let tip = adaptive_shot::<2, 12>(&ode, start, tolerance, evaluations)?;
    Ok(response(rod, tip, (e.value, b.value)))
}

/// One integration; the derivatives are part of the state (SIZE = 4 (1 + N)), so that their error is controlled too.
fn adaptive_shot<const N: usize, const SIZE: usize>(
    ode: &RodOde<Dual<N>>,
    moment: Dual<N>,
    tolerance: f64,
    evaluations: &mut u32,
) -> Result<Point<Dual<N>>, SolveError> {
    let unpack = |flat: &[f64; SIZE]| -> Point<Dual<N>> {
        core::array::from_fn(|k| {
            let at = k * (1 + N);
            Dual { value: flat[at], by: core::array::from_fn(|j| flat[at + 1 + j]) }
        })
    };
    let pack = |point: &Point<Dual<N>>| -> [f64; SIZE] {
        core::array::from_fn(|k| {
            let part = &point[k / (1 + N)];
            if k % (1 + N) == 0 { part.value } else { part.by[k % (1 + N) - 1] }
        })
    };
    let zero = Dual::of(0.0);
    let strain = RefCell::new((-ode.inward, moment * 4.0));
    let broken = Cell::new(None);
    let count = Cell::new(0);
    let rhs = |_: f64, y: &[f64; SIZE], slope: &mut [f64; SIZE]| {
        count.set(count.get() + 1);
        if broken.get().is_some() {
            *slope = [0.0; SIZE];
            return;
        }
        let start = *strain.borrow();
        match ode.slope(unpack(y), start) {
            Ok(s) => {
                *strain.borrow_mut() = s.strain;
                *slope = pack(&s.by_length);
            }
            Err(s) => {
                // The integrator cannot be stopped: it continues with zero slope, and the result is discarded.
                broken.set(Some(s));
                *slope = [0.0; SIZE];
            }
        }
    };
    let method = ExplicitRungeKutta::dop853().rtol(tolerance).atol(1e-3 * tolerance);
    let solution = IVP::ode_from_fn(rhs, 0.0, 1.0, pack(&[zero, moment, zero, zero])).method(method).solve();
    *evaluations += count.get();
    if let Some(s) = broken.get() {
        return Err(s);
    }
    let lost = SolveError::Diverged { stage: "adaptive integration along the rod" };
    let solution = solution.map_err(|_| lost)?;
    let last = solution.y.last().ok_or(lost)?;
    if last.iter().any(|x| !x.is_finite()) {
        return Err(lost);
    }
    Ok(unpack(last))
}
