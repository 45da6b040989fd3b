//! Rods in closed form, or nearly so, and the effects that they neglect.

use crate::error::SolveError;
use crate::rod::{Compliance, Rod, RodResponse, TipForce};
use crate::scalar::{Dual, Scalar};
use crate::section::Strain;
use core::f64::consts::{FRAC_PI_2, PI};

/// Px and Py in units of EI/l², as the two parameters of the derivatives.
fn numbers(rod: &Rod, force: TipForce) -> (Dual<2>, Dual<2>) {
    let unit = rod.length_m * rod.length_m / rod.bending_stiffness_nm2();
    (Dual::parameter(force.inward_n, 0) * unit, Dual::parameter(force.sideways_n, 1) * unit)
}

/// The response from reach and deflection in units of the length, tip angle, and clamp moment in units of EI/l.
fn response_of(rod: &Rod, reach: Dual<2>, deflection: Dual<2>, tip_angle: f64, moment: f64) -> RodResponse {
    let compliance = |x: Dual<2>| Compliance {
        value: x.value * rod.length_m,
        by_inward: x.by[0] * rod.length_m,
        by_sideways: x.by[1] * rod.length_m,
    };
    let bending = moment * rod.radius_m / rod.length_m;
    RodResponse {
        reach: compliance(reach),
        deflection: compliance(deflection),
        tip_angle_rad: tip_angle,
        clamp: Strain { axial: 0.0, bending_squared: bending * bending },
    }
}

/// Beam-column: small rotations, moments taken on the bent rod. With z = (kl)² = Px l²/EI:
/// w = ν l (tan kl/kl − 1)/z, and the second-order shortening u = −½∫w'² dx, ν = Py l²/EI.
pub(super) fn beam_column(rod: &Rod, force: TipForce) -> Result<RodResponse, SolveError> {
    let (z, v) = numbers(rod, force);
    if z.value >= FRAC_PI_2 * FRAC_PI_2 {
        return Err(SolveError::TierRange {
            tier: "beam-column", limit: "Px l²/EI < π²/4, where the column buckles"
        });
    }
    // Both are 0/0 at z = 0: Taylor's series serves below 0.1, to 1e-10.
    let series = |c: [f64; 6]| c.iter().rev().fold(Dual::of(0.0), |sum, c| sum * z + *c);
    let (deflection, shortening) = if z.value < 0.1 {
        (
            series([1.0 / 3.0, 2.0 / 15.0, 17.0 / 315.0, 62.0 / 2835.0, 1382.0 / 155_925.0, 21_844.0 / 6_081_075.0]),
            series([
                2.0 / 15.0,
                34.0 / 315.0,
                62.0 / 945.0,
                5528.0 / 155_925.0,
                21_844.0 / 1_216_215.0,
                1_859_138.0 / 212_837_625.0,
            ]),
        )
    } else {
        let s = z.sqrt();
        let (sin, cos) = s.sin_cos();
        let tan = sin / (cos * s);
        let bent = (sin * cos / s + 1.0) * 0.5 / (cos * cos);
        ((tan - 1.0) / z, (bent - tan * 2.0 + 1.0) / (z * z))
    };
    let (w, u) = (v * deflection, v * v * shortening * -0.5);
    // φ_l = ν (sec kl − 1)/z = Py/Px · …, and near zero ν/2.
    let (zv, vv) = (z.value, v.value);
    let angle = if zv < 1e-4 { 0.5 * vv } else { vv * (1.0 / Scalar::sin_cos(zv.sqrt()).1 - 1.0) / zv };
    let reach = u + 1.0;
    Ok(response_of(rod, reach, w, angle, vv * reach.value + zv * w.value))
}

/// Distance of the pseudo-rigid body's pivot from the tip, and its spring (Howell's γ and K_Θ;
/// docs/explanation/model.md 8).
const PIVOT: f64 = 0.85;
const SPRING: f64 = 2.65;

/// Pseudo-rigid body: a stiff link of 0.85 l on a spring of 2.65 · 0.85 EI/l:
/// 2.65 Θ = ν cos Θ + η sin Θ, η = Px l²/EI, ν = Py l²/EI.
pub(super) fn pseudo_rigid(rod: &Rod, force: TipForce) -> Result<RodResponse, SolveError> {
    let (h, v) = numbers(rod, force);
    let (mut low, mut high) = (0.0, PI);
    let mut angle = Dual::of((v.value / SPRING).min(1.0));
    let mut left = 2;
    for _ in 0..50 {
        let (sin, cos) = angle.sin_cos();
        let miss = angle * SPRING - v * cos - h * sin;
        let slope = v * sin - h * cos + SPRING;
        if miss.value > 0.0 {
            high = angle.value
        } else {
            low = angle.value
        }
        let next = angle - miss / slope;
        let inside = next.value > low && next.value < high;
        if miss.value.abs() < 1e-12 * (SPRING + v.value) {
            left -= 1;
        }
        if left == 0 {
            let (reach, deflection) = (cos * PIVOT + (1.0 - PIVOT), sin * PIVOT);
            let moment = (v * reach + h * deflection).value;
            // Howell's c_Θ: the tip turns further than the link.
            return Ok(response_of(rod, reach, deflection, 1.24 * angle.value, moment));
        }
        angle = if inside || left < 2 { next } else { Dual::of(0.5 * (low + high)) };
    }
    Err(SolveError::Diverged { stage: "the pseudo-rigid body's angle" })
}

/// The response with the bending that a tier neglects, to first order, and the size of that relative to the deflection.
///
/// A law that is not a straight line: at the clamp the curvature is (1 + ρ) times the linear one, and along the rod on
/// average, for a cubic term, ∫x·x³/∫x·x = 3/5 of that. Large rotations (for small-rotation theory): −0.45 φ_l², from
/// the exact end-load table. More bending puts the force further out, which near buckling feeds back.
pub(super) fn bent_further(
    rod: &Rod,
    force: TipForce,
    response: &RodResponse,
    rotation: bool,
) -> Result<(RodResponse, f64), SolveError> {
    let linear = Scalar::sqrt(response.clamp.bending_squared);
    if linear == 0.0 {
        return Ok((*response, 0.0));
    }
    let solved = rod.section.invert(0.0, 0.25 * linear, (0.0, linear));
    let (e, b, _) = solved?;
    let column = 1.0 - (4.0 / (PI * PI)) * force.inward_n * rod.length_m * rod.length_m / rod.bending_stiffness_nm2();
    let turned = if rotation { 0.45 * response.tip_angle_rad * response.tip_angle_rad } else { 0.0 };
    let curved = 0.6 * (b / linear - 1.0);
    let rho = ((curved - turned) / column.max(0.2)).max(-0.5);
    // By the force it grows like a cube: the slopes change by three times as much.
    let grown = |c: &Compliance, by: f64, origin: f64| Compliance {
        value: origin + (c.value - origin) * (1.0 + by),
        by_inward: c.by_inward * (1.0 + 3.0 * by),
        by_sideways: c.by_sideways * (1.0 + 3.0 * by),
    };
    let further = RodResponse {
        reach: grown(&response.reach, 2.0 * rho, rod.length_m),
        deflection: grown(&response.deflection, rho, 0.0),
        tip_angle_rad: response.tip_angle_rad * (1.0 + rho),
        clamp: Strain { axial: e, bending_squared: b * b },
    };
    // The two may cancel in the first order, but not in the second.
    Ok((further, (curved.abs() + turned) / column.max(0.2)))
}

/// The largest displacement of the tip by the stretch of the axis (m): the components of N along and across add up.
pub(super) fn stretch_m(rod: &Rod, force: TipForce, tip_angle_rad: f64) -> f64 {
    // The mean rotation is about 2/3 of the tip's.
    let (sin, cos) = Scalar::sin_cos(2.0 / 3.0 * tip_angle_rad);
    (force.sideways_n * sin + force.inward_n * cos) * rod.length_m / rod.stiffness_n
}
