//! The certified transmission table: the gap G(F, θ) as short polynomials, in f32.
//!
//! One table answers every question that a controller asks of the mechanism, so the answers agree with each other:
//! contraction is a difference of gaps, TR = −1/(∂G/∂θ) (eq. 29), the load follows from twist and gap.
//! The same code runs on the board and on the desktop.
//!
//! - [`arc`]: the numbers and their evaluation: the strings' arc in closed form, short polynomials for the rest.
//! - [`table`]: [`Table`], its metadata, forward lookup.
//! - [`inverse`]: the twist from load and gap, in a bounded number of steps.
//! - [`record`]: a table as bytes, on the link and in flash.
//! - `least_squares`, `patch_fit`, `arc_growth` (feature `std`): fitting.
//! - [`table_spec`], [`mod@reference`], [`errors`], `patches`, [`error_bounds`], [`fit`] (feature `std`): what a table must
//!   reach, the solver it is judged by, its candidates, its certificate, and the choice.
//! - [`instruction_model`], [`emit`] (feature `std`): the predicted cost of a lookup, and the table as Rust source.

#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

pub mod arc;
#[cfg(feature = "std")]
mod arc_growth;
#[cfg(feature = "std")]
pub mod emit;
#[cfg(feature = "std")]
pub mod error_bounds;
#[cfg(feature = "std")]
pub mod errors;
#[cfg(feature = "std")]
pub mod fit;
#[cfg(feature = "std")]
pub mod instruction_model;
pub mod inverse;
#[cfg(feature = "std")]
mod least_squares;
#[cfg(feature = "std")]
pub mod owned;
#[cfg(feature = "std")]
mod patch_fit;
#[cfg(feature = "std")]
mod patches;
pub mod record;
#[cfg(feature = "std")]
pub mod reference;
pub mod table;
#[cfg(feature = "std")]
pub mod table_spec;

pub use arc::{ArcSeries, FORM, Growth, Patch, Point, Shape};
pub use inverse::InverseError;
pub use table::{Metadata, OutOfRange, Table, Uncertainty};
#[cfg(feature = "std")]
pub use table_spec::{Accuracy, TableSpec};

/// Version of the generator and of the format; part of every table's metadata.
pub const GENERATOR_VERSION: u16 = 4;
