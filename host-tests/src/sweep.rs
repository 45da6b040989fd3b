//! Recorded sweeps and the constants from them, as `rigctl sweep` and `rigctl identify` do it: by the control code alone, or by the
//! firmware on the emulated board.

use crate::board::Bench;
use crate::{ControlBench, scene};
use rig_link::messages::{HomingResult, Request, State, Telemetry};
use rigctl::identify::compete::Candidate;
use rigctl::identify::data::Data;
use rigctl::identify::{Identified, identify, plausible};
use rigctl::log::sweep::{Sweep, reduce};
use rigctl::log::{Header, Log, Mark, Marked};
use rigctl::session::row::Row;
use std::f64::consts::{PI, TAU};
use tsa_model::Parameters;

/// Speed of the strings (rad/s).
pub const SPEED_RAD_PER_S: f64 = 4.0;
/// Rest before each turn (s), as `rigctl sweep` has it.
const REST_S: f64 = 1.0;
/// How long before the end of a turn the motor is stopped (s), as `rigctl sweep` has it.
const TURN_AHEAD_S: f64 = 0.05;
/// Longest that the strings take to stop (s).
const STOPS_S: f64 = 5.0;

/// A rig that can be swept.
pub trait Swept {
    /// One tick later, or once a request has been taken: when (s), and what the board says of itself.
    ///
    /// # Errors
    /// The request's refusal, in words.
    fn tick(&mut self, request: Option<Request>) -> Result<(f64, Option<Telemetry>), String>;
}

impl Swept for ControlBench {
    fn tick(&mut self, request: Option<Request>) -> Result<(f64, Option<Telemetry>), String> {
        match request {
            Some(request) => self.ask(request)?,
            None => _ = ControlBench::tick(self, None),
        }
        Ok((self.time_s(), self.telemetry()))
    }
}

impl Swept for Bench {
    fn tick(&mut self, request: Option<Request>) -> Result<(f64, Option<Telemetry>), String> {
        match request {
            Some(request) => {
                self.ask(&request).map_err(|refusal| format!("refused: {refusal}"))?;
                // What it sends next may still be of before.
                self.run(0.02);
            }
            None => self.step(),
        }
        Ok((self.machine.now_s(), self.last))
    }
}

/// One sweep of a rig that was homed with a result, under a known load (N) over so many turns, by its equilibria.
///
/// # Errors
/// In words.
pub fn swept(rig: &mut impl Swept, homed: &HomingResult, load_n: f64, turns: f64) -> Result<Sweep, String> {
    let mut log = Log { header: Header::default(), ..Log::default() };
    log.header.add("sweep.load_n", load_n);
    log.marks.push(Marked { row: 0, t_s: 0.0, mark: Mark::Homed(*homed) });
    let (bottom, top) = (PI, PI + TAU * turns);
    for ends in [[bottom, top], [top, bottom]] {
        record(rig, &mut log, REST_S, |_| false);
        turn(rig, ends, &mut log)?;
    }
    record(rig, &mut log, REST_S, |_| false);
    reduce(&log)
}

/// Turns the strings from one twist to another (rad).
fn turn(rig: &mut impl Swept, [from, to]: [f64; 2], log: &mut Log) -> Result<(), String> {
    let sign = (to - from).signum();
    rig.tick(Some(Request::Jog { twist_speed_rad_per_s: (sign * SPEED_RAD_PER_S) as f32 }))?;
    let limit_s = (to - from).abs() / SPEED_RAD_PER_S + 10.0;
    let near = |t: &Telemetry| {
        sign * (to - t.twist_rad.map_or(from, f64::from)) < SPEED_RAD_PER_S * TURN_AHEAD_S || t.state != State::Moving
    };
    record(rig, log, limit_s, near);
    rig.tick(Some(Request::Stop))?;
    let mut fault = None;
    let stands = record(rig, log, STOPS_S, |t| {
        fault = t.fault;
        t.state != State::Moving
    });
    match fault {
        Some(fault) => Err(format!("fault {fault}")),
        None if !stands => Err("the strings do not stop".into()),
        None => Ok(()),
    }
}

/// Takes the telemetry of so many seconds into a log, or of less once it is `done`; whether it was.
fn record(rig: &mut impl Swept, log: &mut Log, seconds: f64, mut done: impl FnMut(&Telemetry) -> bool) -> bool {
    for _ in 0..(seconds * 100.0).round() as usize {
        let Ok((t_s, Some(t))) = rig.tick(None) else { continue };
        log.rows.push(Row::new(t_s, &t, None, None));
        if done(&t) {
            return true;
        }
    }
    false
}

/// The default scene's constants from named sweeps, as `rigctl identify` does it.
///
/// # Errors
/// In words, if the sweeps are no rig's or cannot be fitted.
pub fn identified(sweeps: &[(String, Sweep)]) -> Result<Identified, String> {
    let scene = scene();
    let start = Parameters::new(&scene.geometry, &scene.string, &scene.material).map_err(|e| e.to_string())?;
    let mut data = Data::default();
    for (name, sweep) in sweeps {
        data.add_sweep(name, &start, sweep);
    }
    plausible::checked(&data, scene)?;
    let candidates = Candidate::all(scene, None, data.knows_its_zero());
    identify(scene, &data, &candidates).map_err(|e| format!("identify: {e}"))
}
