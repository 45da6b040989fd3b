//! Why there is no such rig, and why a plant cannot be changed.

use super::outside::program::ProgramError;
use super::surface::NoSurface;
use crate::{PlantError, PlantKey};

/// Why a rig could not be built.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The scene's mechanism.
    #[error(transparent)]
    Mechanism(#[from] tsa_model::ParameterError),
    /// The scene's drive address.
    #[error(transparent)]
    Drive(#[from] rmds405::OutOfRange),
    /// The mechanism does not reach where the rig has to go.
    #[error("{0}; the scene or one of these plant keys is too extreme: {keys}", keys = PlantKey::names(PlantKey::is_of_the_law))]
    Surface(#[from] NoSurface),
    /// What is asked of a plant from outside.
    #[error(transparent)]
    Change(#[from] ChangeError),
    /// The load would break the rods before the strings touch.
    #[error("plant key `load`: {load_n} N is more than this mechanism can carry, at most {max_n} N")]
    Load {
        /// Asked for.
        load_n: f64,
        /// The surface's end.
        max_n: f64,
    },
    /// The strings would lie far closer than side by side, or the rods be bent far beyond their strain.
    #[error(
        "plant key `twist_at_boot`: {twist_rad} rad is more than the strings can have under {load_n} N, at most {max_rad} rad either way"
    )]
    Twist {
        /// Asked for.
        twist_rad: f64,
        /// Load, N.
        load_n: f64,
        /// The maximum possible value, rounded down.
        max_rad: f64,
    },
}

/// Why the plant cannot be changed so.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChangeError {
    /// Its value, or that it comes too late.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The plant's program refuses it, or has failed.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// Measured gaps stand in the place of what the key changes.
    #[error("plant key `{0}` is for the built-in mechanism, and this rig has measured gaps in its place")]
    Measured(PlantKey),
}
