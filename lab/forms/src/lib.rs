//! Forms of the transmission table that the board does not use, to compare its own form with: a global polynomial and
//! two grids, each on several maps of the load.
//!
//! - [`form`]: the forms and their evaluation with gradient.
//! - [`table`]: a form with its numbers, its range and its maps of load and twist.
//! - [`fit`] (feature `std`): the smallest table of each form.
//! - [`considered`] (feature `std`): all tables whatever their form, and those whose cost on the board is measured.

#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

#[cfg(feature = "std")]
pub mod considered;
#[cfg(feature = "std")]
pub mod fit;
pub mod form;
pub mod table;

pub use form::Form;
pub use table::{Axis, LoadMap, Table};
