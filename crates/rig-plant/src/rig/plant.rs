//! Load and mechanism between the output shaft and the LVDT: the built-in ones, or somebody else's program.

use super::built_in::BuiltIn;
use super::outside::programmed::Programmed;

/// What a plant does now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantState {
    /// Gap, m.
    pub gap_m: f64,
    /// Speed of the gap, m/s; positive sinks.
    pub speed_m_per_s: f64,
    /// What the strings do to the load, N.
    pub pull_n: f64,
    /// Torque on the output shaft, N m, positive towards more twist.
    pub torque_nm: f64,
}

/// Load and mechanism.
#[derive(Clone, Debug)]
pub enum Plant {
    /// Hung from a surface of gaps: the scene's mechanism, or measured data.
    BuiltIn(Box<BuiltIn>),
    /// In a program of their own.
    Program(Box<Programmed>),
}

impl Plant {
    /// Gap, speed, pull and torque.
    pub fn state(&self) -> PlantState {
        match self {
            Self::BuiltIn(plant) => PlantState {
                gap_m: plant.gap_m,
                speed_m_per_s: plant.speed_m_per_s,
                pull_n: plant.pull_n(),
                torque_nm: plant.torque_nm(),
            },
            Self::Program(plant) => PlantState {
                gap_m: plant.now.gap_m,
                speed_m_per_s: plant.speed_m_per_s,
                pull_n: plant.now.pull_n,
                torque_nm: plant.torque_nm(),
            },
        }
    }

    /// Gap, m.
    pub fn gap_m(&self) -> f64 {
        match self {
            Self::BuiltIn(plant) => plant.gap_m,
            Self::Program(plant) => plant.now.gap_m,
        }
    }

    /// Gap at the half-turn pre-twist under the present load, m. A program is not asked for it: there it is the gap when
    /// the shaft passed that twist, and before it did the gap at the start.
    pub fn pretwist_gap_m(&self) -> f64 {
        match self {
            Self::BuiltIn(plant) => plant.gap_at(tsa_model::PRETWIST_RAD),
            Self::Program(plant) => plant.pretwist_gap_m(),
        }
    }

    /// One step of `h` seconds with the output shaft at `shaft_rad`.
    pub fn step(&mut self, h: f64, shaft_rad: f64) {
        match self {
            Self::BuiltIn(plant) => plant.step(h, shaft_rad),
            Self::Program(plant) => plant.step(h, shaft_rad),
        }
    }

    /// The built-in plant, if it is one.
    pub fn built_in(&self) -> Option<&BuiltIn> {
        if let Self::BuiltIn(plant) = self { Some(plant) } else { None }
    }
}
