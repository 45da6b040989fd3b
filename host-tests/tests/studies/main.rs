//! The studies in short, so that they cannot rot: comparison, margins, rigs, budget, endurance, what fuzzing has kept, and which
//! packages may know which.

mod budget;
mod comparison;
mod corpus;
mod endurance;
mod layers;
mod margin;
mod rigs;
