//! Whether rods and strings are rods and strings.

use super::Verdict::{self, Fits, Impossible, Unusual};
use super::{States, mm, short};
use crate::Scene;

pub(super) fn rod_is_a_rod(s: &Scene) -> Verdict {
    let g = &s.geometry;
    if 2.0 * g.rod_radius_m < g.rod_span_m {
        return Fits;
    }
    Impossible(format!(
        "a radius of {} makes a rod {} thick between strings that are {} apart; lengths are in metres",
        mm(g.rod_radius_m),
        mm(2.0 * g.rod_radius_m),
        mm(g.rod_span_m)
    ))
}

/// Fraction of the bend that shear adds at the tip of a round cantilever of radius R and length l, which the rod's law
/// leaves out: 3 E I / (κ G A l²) = 2.17 (R/l)², with E/G = 2.6 and κ = 0.9.
const SHEAR: f64 = 2.17;
/// Where that is no longer small.
const MAX_SHEAR: f64 = 0.1;

pub(super) fn rod_is_slender(s: &Scene) -> Verdict {
    let g = &s.geometry;
    let free_m = 0.5 * (g.rod_span_m - g.clamp_width_m);
    let shear = SHEAR * (g.rod_radius_m / free_m).powi(2);
    // No free length at all is a rigid rod, an exact limit of the model.
    if free_m == 0.0 || shear < MAX_SHEAR {
        return Fits;
    }
    Unusual(format!(
        "the free half of the rod is {} long and {} thick: so stout a rod bends {} % further by shear, which the model \
         leaves out",
        mm(free_m),
        mm(2.0 * g.rod_radius_m),
        short(100.0 * shear)
    ))
}

pub(super) fn strings_are_apart(s: &Scene) -> Verdict {
    let (diameter, span) = (s.string.diameter_m, s.geometry.rod_span_m);
    if diameter < span {
        return Fits;
    }
    Impossible(format!(
        "strings {} thick do not fit side by side {} apart; lengths are in metres",
        mm(diameter),
        mm(span)
    ))
}

pub(super) fn string_bears_the_load(s: &Scene, states: &States) -> Verdict {
    let (stretch, length) = (0.5 * states.load_n / s.string.stiffness_n_per_m, s.geometry.string_length_m);
    if stretch < 0.5 * length {
        return Fits;
    }
    Impossible(format!(
        "at {} N the strings would stretch by {}, and they are {} long; the stiffness is in N/m, of one string",
        short(states.load_n),
        mm(stretch),
        mm(length)
    ))
}
