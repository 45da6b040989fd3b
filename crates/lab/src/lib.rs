//! The laboratory: what the actuator's model and table are compared with, and the charts of it.
//!
//! - [`mechanism_figure`]: the mechanism drawn to scale under two loads.

#![forbid(unsafe_code)]

pub mod mechanism_figure;
