//! What real rigs have and the ideal one has not. Each effect is a state of its own with one step function, and is switched
//! off by a size of zero. None of them creates energy: tests go round closed cycles and count.
//!
//! - [`strings`]: their play between motor and mechanism, their run-in, and their creep.
//! - [`rods`]: stress of the rods beyond their law, as a force on the load: hysteresis and temperature.
//! - [`stribeck`]: friction of the rail that sticks, gives a little, and slips.
//!
//! The constants here belong to no rig, so that no preset draws them. The error budget computes with them as well. Their
//! sources stand in docs/reference/simulator.md.

pub mod rods;
pub mod stribeck;
pub mod strings;

/// Change of the LVDT's gain with the temperature, 1/K: what data sheets of such sensors state.
pub const LVDT_GAIN_PER_K: f64 = 2e-4;
/// Stress that warmth adds to the rods once they transform, Pa/K.
pub const ROD_STRESS_PER_K: f64 = 6.5e6;
/// Strains of the rods between which their transformation begins: under the default scene's 8 N the strain is below them.
pub const ROD_ONSET: [f64; 2] = [0.027, 0.037];
/// Changes of the rods' strain after which the elements of their memory slip. Assumed: above what a sweep of the twist
/// adds (0.7 % at most), and such that most of the loop is reached between 15 and 10 N.
pub const ROD_THRESHOLDS: [f64; 3] = [0.005, 0.0065, 0.008];
/// Times of the strings' slow stretch, s: half a minute of homing sees the first, an hour at work all of them. Each has the
/// same fraction of the stretch.
pub const CREEP_TIMES_S: [f64; 3] = [3.0, 60.0, 1800.0];
/// Cycles of new strings after which all but 1/e of the change of their radius is done.
pub const RUN_IN_CYCLES: f64 = 20.0;
/// Turns up and back down that count as one such cycle: the paper's sweep of 7.5 turns.
pub const TURNS_PER_CYCLE: f64 = 15.0;

/// Fraction of the full stress by warmth that rods have at a strain, and its slope by the strain.
pub fn rod_onset(strain: f64) -> [f64; 2] {
    let width = ROD_ONSET[1] - ROD_ONSET[0];
    let x = ((strain - ROD_ONSET[0]) / width).clamp(0.0, 1.0);
    [x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) / width]
}

#[cfg(test)]
mod tests;
