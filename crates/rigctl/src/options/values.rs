//! Values of options, read from text. Each error names the option.

use crate::identify::laws::{LAWS, Law};
use crate::request;
use crate::units::{self, Quantity};
use clap::builder::PossibleValuesParser;
use tsa_model::Tier;

/// Methods of solution: the tool's own, and those of the laboratory.
pub const METHODS: [&str; 5] = ["first-integral", "paper", "adaptive-shooting", "collocation", "continuation"];

/// `--tier` that leaves the choice to the estimates.
pub const AUTO: &str = "auto";

pub(crate) fn radius_law(text: &str) -> Result<Law, String> {
    Law::named(text).ok_or_else(|| format!("it is {}", LAWS.map(|(_, name)| name).join(" or ")))
}

pub(crate) fn methods() -> PossibleValuesParser {
    PossibleValuesParser::new(METHODS)
}

pub(crate) fn tiers() -> PossibleValuesParser {
    PossibleValuesParser::new(Tier::ALL.into_iter().map(Tier::name).chain([AUTO]))
}

pub(crate) fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (1e-15..=0.1).contains(&x) => Ok(x),
        _ => Err("tolerance must be a number from 1e-15 to 0.1".into()),
    }
}

/// A load (N).
///
/// # Errors
/// If it is none.
pub fn load(text: &str) -> Result<f64, units::UnitError> {
    units::parse("load", Quantity::Load, text)
}

/// A quantity that an error calls by this name, in SI units.
pub(crate) fn of(
    name: &'static str,
    quantity: Quantity,
) -> impl Fn(&str) -> Result<f64, units::UnitError> + Clone + Send + Sync {
    move |text| units::parse(name, quantity, text)
}

/// The error of gauges (m).
///
/// # Errors
/// If it is none, or above 1 mm.
pub fn gauge_error(text: &str) -> Result<f64, String> {
    match units::parse("gauge-error", Quantity::Length, text) {
        Ok(error_m) if (0.0..=1e-3).contains(&error_m) => Ok(error_m),
        Ok(error_m) => Err(format!("gauge-error is {error_m} m, allowed are 0 to 1 mm")),
        Err(error) => Err(error.to_string()),
    }
}

/// A speed, or `max`: infinite.
pub(crate) fn speed_or_max(text: &str) -> Result<f64, String> {
    request::SPEED.parse("speed", text)
}
