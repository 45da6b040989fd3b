//! Forms of the transmission table that the board does not use, to compare its own form with: a global polynomial and
//! two grids, each on several maps of the load.
//!
//! - [`axis`]: the maps of load and twist to [−1, 1].
//! - [`form`]: the numbers of each form and their evaluation with gradient.
//! - [`table`]: a form with its range and its maps.
//! - [`fit`] (feature `std`): the smallest table of each form, and all candidates in the order of preference.
//! - [`peers`] (feature `std`): the tables whose cost on the board is measured beside the chosen one.

#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

pub mod axis;
#[cfg(feature = "std")]
pub mod fit;
pub mod form;
#[cfg(feature = "std")]
pub mod peers;
pub mod table;

pub use axis::{Axis, LoadMap};
pub use form::Form;
pub use table::Table;
