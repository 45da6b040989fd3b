//! Load and mechanism between the output shaft and the LVDT: the built-in ones, or somebody else's program.

use super::built_in::BuiltIn;
use super::effects::stribeck::RailFriction;
use super::outside::programmed::Programmed;
use super::surface::Surface;

/// What acts on load and mechanism from outside.
#[derive(Clone, Copy, Debug)]
pub struct Conditions {
    /// Weight, N; the inertia is weight / g.
    pub weight_n: f64,
    /// Friction of the rail.
    pub friction: RailFriction,
    /// Viscous damping, N s/m.
    pub damping_n_s_per_m: f64,
    /// Temperature of the rods, less that of the calibration, K.
    pub temperature_k: f64,
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
    /// Gap, m.
    pub fn gap_m(&self) -> f64 {
        match self {
            Self::BuiltIn(plant) => plant.gap_m,
            Self::Program(plant) => plant.gap_m(),
        }
    }

    /// Speed of the gap, m/s; positive sinks.
    pub fn speed_m_per_s(&self) -> f64 {
        match self {
            Self::BuiltIn(plant) => plant.speed_m_per_s,
            Self::Program(plant) => plant.speed_m_per_s(),
        }
    }

    /// What the strings do to the load now, N.
    pub fn pull_n(&self) -> f64 {
        match self {
            Self::BuiltIn(plant) => plant.pull_n(),
            Self::Program(plant) => plant.pull_n(),
        }
    }

    /// Torque on the output shaft, N m, positive towards more twist.
    pub fn torque_nm(&self, conditions: &Conditions) -> f64 {
        match self {
            Self::BuiltIn(plant) => plant.torque_nm(conditions),
            Self::Program(plant) => plant.torque_nm(),
        }
    }

    /// Gap at the half-turn pre-twist under the present load, m. A program is not asked for it: there it is the gap when
    /// the shaft passed that twist, and before it did the gap at the start.
    pub fn pretwist_gap_m(&self, conditions: &Conditions) -> f64 {
        match self {
            Self::BuiltIn(plant) => plant.gap_at(tsa_model::PRETWIST_RAD, conditions),
            Self::Program(plant) => plant.pretwist_gap_m(),
        }
    }

    /// One step of `h` seconds with the output shaft at `shaft_rad`.
    pub fn step(&mut self, h: f64, shaft_rad: f64, conditions: &Conditions) {
        match self {
            Self::BuiltIn(plant) => plant.step(h, shaft_rad, conditions),
            Self::Program(plant) => plant.step(h, shaft_rad),
        }
    }

    /// The built-in plant, if it is one.
    pub fn built_in(&self) -> Option<&BuiltIn> {
        match self {
            Self::BuiltIn(plant) => Some(plant),
            Self::Program(_) => None,
        }
    }

    /// As [`Plant::built_in`].
    pub fn built_in_mut(&mut self) -> Option<&mut BuiltIn> {
        match self {
            Self::BuiltIn(plant) => Some(plant),
            Self::Program(_) => None,
        }
    }

    /// The interpolant of the built-in plant.
    pub fn surface(&self) -> Option<&Surface> {
        self.built_in().map(BuiltIn::surface)
    }
}
