//! Whether the LVDT's stroke covers the gaps.

use super::Verdict::{self, Fits, Impossible, Unusual};
use super::{States, mm};
use crate::Scene;

/// Change of the gap (m) by which homing decides which way the load goes (rig-control, `homing`).
const HOMING_CHANGE_M: f64 = 0.25e-3;

pub(super) fn resolves_homing(s: &Scene) -> Verdict {
    let step = s.rig.lvdt_metres_per_code().abs();
    if step <= HOMING_CHANGE_M {
        return Fits;
    }
    Impossible(format!(
        "a stroke of {} makes {} of one ADC code, and homing has to see {}; lengths are in metres",
        mm(s.rig.lvdt_stroke_m),
        mm(step),
        mm(HOMING_CHANGE_M)
    ))
}

/// Shares of the ADC's range outside of which the board takes the lead for broken or shorted (rig-control, `sensors`).
const CODES: [f64; 2] = [0.01, 0.99];
/// Middle of the stroke that a sensor should be used in (docs/reference/hardware.md section 2.2).
const MIDDLE: [f64; 2] = [0.05, 0.95];

pub(super) fn sees_the_gaps(s: &Scene, states: &States) -> Verdict {
    let rig = &s.rig;
    let ends_of = |fractions: [f64; 2], length: f64, start: f64| {
        let ends = fractions.map(|fraction| start + fraction * length);
        [ends[0].min(ends[1]), ends[0].max(ends[1])]
    };
    let read = ends_of(CODES, 4095.0 * rig.lvdt_metres_per_code(), rig.lvdt_gap_at_code_zero_m());
    let stroke = ends_of([0.0, 1.0], rig.lvdt_stroke_m, rig.lvdt_gap_at_zero_m);
    let middle = ends_of(MIDDLE, rig.lvdt_stroke_m, rig.lvdt_gap_at_zero_m);
    let seen = [stroke[0].max(read[0]), stroke[1].min(read[1])];
    let [min, max] = states.gap_m;
    let within = |range: [f64; 2]| min.value >= range[0] && max.value <= range[1];
    let needed = format!("the gap goes from {} ({min}) to {} ({max})", mm(min.value), mm(max.value));
    if !within(seen) {
        return Impossible(format!(
            "{needed}, and the LVDT with its ADC sees {} to {}; lengths are in metres",
            mm(seen[0]),
            mm(seen[1])
        ));
    }
    if !within(middle) {
        return Unusual(format!(
            "{needed}: nearer to an end of the LVDT's stroke than its middle 90 %, {} to {}",
            mm(middle[0]),
            mm(middle[1])
        ));
    }
    Fits
}
