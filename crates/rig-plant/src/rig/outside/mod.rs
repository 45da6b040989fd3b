//! Plants from outside, in place of the built-in one: somebody else's program or data. Motor, drive, encoder, LVDT and
//! board stay.
//!
//! - [`program`]: a program that answers one line a step, and [`programmed`]: the plant that it makes.
//! - [`measured`]: gaps measured over load and twist.

pub mod measured;
pub mod program;
pub mod programmed;

use crate::PlantKey;

/// Where a plant comes from.
#[derive(Clone, Debug)]
pub enum Outside {
    /// A program and its arguments, separated by blanks.
    Program(String),
    /// Measured gaps.
    Measured(measured::Measured),
}

/// Whether a key is one of the built-in mechanism's constants, for which measured gaps stand.
pub fn is_of_the_law(key: PlantKey) -> bool {
    matches!(
        key,
        PlantKey::K2Scale
            | PlantKey::K3Scale
            | PlantKey::K4Scale
            | PlantKey::StiffnessScale
            | PlantKey::ModulusScale
            | PlantKey::TwistExponentShift
            | PlantKey::RodHysteresis
    )
}

/// Whether a key is one of mechanism, load or rail, which a plant program has in the emulator's place. The temperature is
/// the LVDT's as well.
pub fn is_of_the_plant(key: PlantKey) -> bool {
    is_of_the_law(key)
        || matches!(
            key,
            PlantKey::Load
                | PlantKey::Friction
                | PlantKey::FrictionLoadShare
                | PlantKey::StictionRatio
                | PlantKey::StribeckSpeed
                | PlantKey::Presliding
                | PlantKey::Damping
                | PlantKey::StringCreep
                | PlantKey::StringBedding
                | PlantKey::TwistPlay
                | PlantKey::Temperature
        )
}

#[cfg(test)]
mod tests;
