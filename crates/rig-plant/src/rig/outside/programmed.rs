//! A plant that a program computes, as the rig sees it.

use super::program::{Answer, PATIENCE, PlantProgram, ProgramError};
use crate::PlantChange;
use crate::rig::STEP_S;
use tsa_model::PRETWIST_RAD;

/// The plant. When its program fails it stands still, and says why.
#[derive(Debug)]
pub struct Programmed {
    /// Its program, or why that cannot go on.
    program: Result<PlantProgram, ProgramError>,
    /// Its last answer.
    pub now: Answer,
    /// Speed of the gap over the last step, m/s.
    pub speed_m_per_s: f64,
    shaft_rad: f64,
    pretwist_gap_m: f64,
}

impl Clone for Programmed {
    /// A plant that stands still: one program cannot be in two rigs.
    fn clone(&self) -> Self {
        let program = match &self.program {
            Ok(program) => Err(program.copied()),
            Err(failure) => Err(failure.clone()),
        };
        Self { program, ..*self }
    }
}

impl Programmed {
    /// Starts a program with the output shaft at a twist (rad). It need not know the keys in `offered`, but those in
    /// `given`; keys of motor, drive, sensors and board are not its own and left out.
    ///
    /// # Errors
    /// [`ProgramError`]: it cannot be started, does not answer as it should, or refuses a key.
    pub fn start(
        command: &str,
        twist_rad: f64,
        seed: u64,
        offered: &[PlantChange],
        given: &[PlantChange],
    ) -> Result<Self, ProgramError> {
        let mut program = PlantProgram::start(command, STEP_S, twist_rad, seed, PATIENCE)?;
        for change in offered.iter().filter(|change| change.key.is_of_the_plant()) {
            program.offer(change.key.name(), change.value)?;
        }
        for change in given.iter().filter(|change| change.key.is_of_the_plant()) {
            program.set(change.key.name(), change.value)?;
        }
        let now = program.step(twist_rad)?;
        let pretwist_gap_m = now.gap_m;
        Ok(Self { program: Ok(program), now, speed_m_per_s: 0.0, shaft_rad: twist_rad, pretwist_gap_m })
    }

    /// Gives it a plant key.
    ///
    /// # Errors
    /// [`ProgramError`]: it does not know or refuses the key, or has failed.
    pub fn set(&mut self, change: PlantChange) -> Result<(), ProgramError> {
        match &mut self.program {
            Ok(program) => program.set(change.key.name(), change.value),
            Err(failure) => Err(failure.clone()),
        }
    }

    /// One step of `h` seconds with the output shaft at a twist (rad).
    pub fn step(&mut self, h: f64, shaft_rad: f64) {
        let Ok(program) = &mut self.program else { return };
        match program.step(shaft_rad) {
            Ok(now) => {
                self.speed_m_per_s = (now.gap_m - self.now.gap_m) / h;
                self.now = now;
            }
            Err(failure) => {
                self.speed_m_per_s = 0.0;
                // Without its owner the program is ended.
                self.program = Err(failure);
            }
        }
        if (self.shaft_rad.abs() - PRETWIST_RAD) * (shaft_rad.abs() - PRETWIST_RAD) <= 0.0 {
            self.pretwist_gap_m = self.now.gap_m;
        }
        self.shaft_rad = shaft_rad;
    }

    /// Why its program cannot go on.
    pub fn failure(&self) -> Option<&ProgramError> {
        self.program.as_ref().err()
    }

    /// Torque on the output shaft, N m; none once the program has failed.
    pub fn torque_nm(&self) -> f64 {
        if self.program.is_err() { 0.0 } else { self.now.torque_nm }
    }

    /// Gap when the shaft last passed the half-turn pre-twist, m; before it did, the gap at the start.
    pub fn pretwist_gap_m(&self) -> f64 {
        self.pretwist_gap_m
    }
}
