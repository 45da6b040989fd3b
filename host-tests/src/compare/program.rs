//! A controller in a program of its own (`study compare --controller`), asked by lines of JSON: docs/reference/results.md.

use super::baseline::Wanted;
use rig_control::TICK_S;
use rig_plant::rig::outside::program::{PATIENCE, Program};
use serde::Deserialize;
use serde_json::json;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// How long an answer may take, by the wall clock; the first one, for which the program starts, [`PATIENCE`].
const ANSWER: Duration = Duration::from_secs(2);

/// What it answers.
#[derive(Deserialize)]
struct Answer {
    twist_rad_per_s: f32,
}

/// The running program. Copies of its bench share it.
#[derive(Clone, Debug)]
pub struct Outside {
    program: Arc<Mutex<Program>>,
    ticks: u32,
    /// Why it cannot go on.
    pub failure: Option<String>,
}

impl Outside {
    /// Starts a program.
    ///
    /// # Errors
    /// In words, if there is none.
    pub fn start(command: &str) -> Result<Self, String> {
        let program = Program::start(command).map_err(|e| e.what.to_string())?;
        Ok(Self { program: Arc::new(Mutex::new(program)), ticks: 0, failure: None })
    }

    /// The twist speed (rad/s) that it wants in this tick; 0 after its failure.
    pub(super) fn twist_speed(&mut self, wanted: &Wanted, position_m: f32, twist_rad: f32) -> f32 {
        if self.failure.is_some() {
            return 0.0;
        }
        let line = json!({
            "t_s": f64::from(self.ticks) * f64::from(TICK_S),
            "target_m": wanted.target_m,
            "set_point_m": wanted.set_point_m,
            "speed_m_per_s": wanted.speed_m_per_s,
            "position_m": position_m,
            "twist_rad": twist_rad,
            "load_n": wanted.load_n,
        });
        let (line, patience) = (line.to_string(), if self.ticks == 0 { PATIENCE } else { ANSWER });
        self.ticks += 1;
        let mut program = self.program.lock().unwrap_or_else(PoisonError::into_inner);
        let answer = program.ask(&line, patience).and_then(|text| match serde_json::from_str(&text) {
            Ok(Answer { twist_rad_per_s }) if twist_rad_per_s.is_finite() => Ok(twist_rad_per_s),
            _ => Err(program.wrong(&line, &text, "{\"twist_rad_per_s\": a finite number}")),
        });
        answer.unwrap_or_else(|e| {
            self.failure = Some(e.what.to_string());
            0.0
        })
    }
}
