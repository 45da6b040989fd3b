//! What options take: texts into values, each error naming the option.

use super::options::AUTO;
use crate::script;
use crate::units::{self, Quantity};
use clap::builder::PossibleValuesParser;
use rig_link::LoadChoice;
use rival_methods::Method;
use tsa_model::{RadiusLaw, Tier};

pub(super) fn radius_law(text: &str) -> Result<RadiusLaw, String> {
    match text {
        "length-ratio" => Ok(RadiusLaw::LengthRatio),
        "twist-power" => Ok(RadiusLaw::TwistPower),
        _ => Err("it is length-ratio or twist-power".into()),
    }
}

pub(super) fn methods() -> PossibleValuesParser {
    PossibleValuesParser::new(Method::ALL.iter().map(Method::name))
}

pub(super) fn tiers() -> PossibleValuesParser {
    PossibleValuesParser::new(Tier::ALL.into_iter().map(Tier::name).chain([AUTO]))
}

pub(super) fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (1e-15..=0.1).contains(&x) => Ok(x),
        _ => Err("tolerance must be a number from 1e-15 to 0.1".into()),
    }
}

pub(super) fn load(text: &str) -> Result<f64, units::UnitError> {
    units::parse("load", Quantity::Load, text)
}

pub(super) fn seconds(text: &str) -> Result<f64, units::UnitError> {
    units::parse("seconds", Quantity::Time, text)
}

pub(super) fn turns(text: &str) -> Result<f64, units::UnitError> {
    units::parse("turns", Quantity::Turns, text)
}

pub(super) fn target(text: &str) -> Result<f64, units::UnitError> {
    units::parse("to", Quantity::Length, text)
}

pub(super) fn gap(text: &str) -> Result<f64, units::UnitError> {
    units::parse("gap", Quantity::Length, text)
}

pub(super) fn speed(text: &str) -> Result<f64, units::UnitError> {
    units::parse("speed", Quantity::Speed, text)
}

pub(super) fn twist_speed(text: &str) -> Result<f64, units::UnitError> {
    units::parse("speed", Quantity::AngularSpeed, text)
}

pub(super) fn load_choice(text: &str) -> Result<LoadChoice, String> {
    script::load_choice(text)
}
