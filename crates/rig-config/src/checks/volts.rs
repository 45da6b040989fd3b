//! Whether supply and pins bear their volts.

use super::Verdict::{self, Fits, Impossible, Unusual};
use super::short;
use crate::Scene;

/// Supply range of the drive (docs/reference/hardware.md section 1).
const SUPPLY_V: [f64; 2] = [10.0, 58.0];
/// Maximum voltage of the drive's analog input ASIN, and its step (crates/rmds405/README.md section 2.4).
const ASIN_V: f64 = 5.0;
const ASIN_STEP_V: f64 = 1e-3;
/// Largest step of ASIN as a fraction of the supply: a quarter of the fifth at which the board reports a fault.
const ASIN_STEP_FRACTION: f64 = 0.05;
/// Analog supply, and so reference, that the STM32F446 is specified for.
const REFERENCE_V: [f64; 2] = [1.8, 3.6];
/// Maximum voltage at an analog pin: it is not 5 V tolerant, and the board's supply is this.
const PIN_V: f64 = 3.3;

pub(super) fn drive_takes_the_supply(s: &Scene) -> Verdict {
    let volts = s.rig.supply_voltage_v;
    if (SUPPLY_V[0]..=SUPPLY_V[1]).contains(&volts) {
        return Fits;
    }
    Impossible(format!("{} V, and the drive takes {} to {} V", short(volts), SUPPLY_V[0], SUPPLY_V[1]))
}

pub(super) fn supply_sense_volts(s: &Scene) -> Verdict {
    let Some(divider) = s.rig.supply_divider else { return Fits };
    let max = s.rig.supply_limits_v()[1];
    if max / divider > ASIN_V {
        return Impossible(format!(
            "{} V of supply, a fifth above its {} V, divided by {} is {} V at the drive's ASIN, which takes {ASIN_V} V: \
             divide by {} or more",
            short(max),
            short(s.rig.supply_voltage_v),
            short(divider),
            short(max / divider),
            short((max / ASIN_V).ceil())
        ));
    }
    let step = ASIN_STEP_V * divider;
    if step > ASIN_STEP_FRACTION * s.rig.supply_voltage_v {
        return Unusual(format!(
            "the drive tells {} V of supply in steps of {} V: too coarse to tell a low supply",
            short(s.rig.supply_voltage_v),
            short(step)
        ));
    }
    Fits
}

pub(super) fn adc_reference(s: &Scene) -> Verdict {
    let volts = s.rig.adc_reference_v;
    if (REFERENCE_V[0]..=REFERENCE_V[1]).contains(&volts) {
        return Fits;
    }
    Impossible(format!("{} V, and the chip takes {} to {} V", short(volts), REFERENCE_V[0], REFERENCE_V[1]))
}

pub(super) fn lvdt_pin(s: &Scene, volts: f64) -> Verdict {
    let reference = s.rig.adc_reference_v;
    if volts <= reference.min(PIN_V) {
        return Fits;
    }
    Impossible(format!(
        "{} V at the ADC pin, which reads up to {} V and bears {PIN_V} V; give the volts after the divider",
        short(volts),
        short(reference)
    ))
}
