//! The certified transmission table: the gap G(F, θ) as a short polynomial or a grid on mapped axes, in f32.
//!
//! One table answers every question that a controller asks of the mechanism, so the answers agree with each other:
//! contraction is a difference of gaps, TR = −1/(∂G/∂θ) (eq. 29), the load follows from twist and gap.
//! The same code runs on the board and on the desktop.
//!
//! - [`axis`]: how load and twist are mapped to the table's own coordinates.
//! - [`arc`]: the mixed form: the strings' arc in closed form, short polynomials for the rest.
//! - [`form`]: the forms a table can have, and their evaluation with gradient.
//! - [`lookup`]: [`Table`], its metadata, forward lookup.
//! - [`inverse`]: load from twist and gap, twist from load and gap, in a bounded number of steps.
//! - [`least_squares`], [`patch_fit`]: what a fit needs, on a desktop and on the board.
//! - [`rebuild`]: the board's own table from new constants.
//! - [`fit`], [`certificate`], [`emit`] (feature `std`): choosing, proving and writing out a table.

#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

pub mod arc;
pub mod axis;
#[cfg(feature = "std")]
mod candidates;
#[cfg(feature = "std")]
pub mod certificate;
#[cfg(feature = "std")]
mod double;
#[cfg(feature = "std")]
pub mod effort;
#[cfg(feature = "std")]
pub mod emit;
#[cfg(feature = "std")]
pub mod fit;
pub mod form;
pub mod inverse;
pub mod least_squares;
pub mod lookup;
pub mod patch_fit;
#[cfg(feature = "std")]
mod patches;
mod plane;
pub mod rebuild;

pub use arc::{ArcSeries, Growth, Patch, Shape};
pub use axis::{Axis, LoadMap};
#[cfg(feature = "std")]
pub use fit::{Accuracy, Demand};
pub use form::Form;
pub use inverse::{InverseError, LoadFromGap};
pub use lookup::{Metadata, OutOfRange, Point, Table};

/// Version of the generator and of the format; part of every table's metadata.
pub const GENERATOR_VERSION: u16 = 3;
