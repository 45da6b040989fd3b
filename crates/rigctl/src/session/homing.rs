//! Homing, from the request to its result.

use super::client::Session;
use super::motion::ended;
use super::row::{RangeEnd, Row, load_text};
use crate::failure::Failure;
use crate::output::progress;
use crate::units::{N, RAD, S};
use rig_link::{EventKind, HomingResult, LoadChoice, Request};
use serde::Serialize;

/// Longest homing (s) on the board's clock, the drive's start-up included: an emulated board behind a serial line may be slower
/// than this machine's clock.
const HOMING_S: f64 = 120.0;

/// How a homing ended.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct HomeResult {
    /// Homing time, without the start-up of the drive (s).
    pub duration_s: f64,
    /// Estimated load (N).
    pub load_n: f32,
    /// The end of the table's range that the estimate stands at: the load may be beyond it.
    pub load_at_range_end: Option<RangeEnd>,
    /// Half the width of the interval around `load_n` that holds the true load in 90 of 100 cases (N).
    pub load_error_n: f32,
    /// Coulomb friction of the rail (N).
    pub friction_n: f32,
    /// Half the width of the interval around zero twist that holds the true one in 90 of 100 cases (rad).
    pub zero_error_rad: f32,
    /// Measured gap at position zero (m).
    pub reference_gap_m: f32,
}

impl HomeResult {
    /// From what the board reports.
    pub fn new(duration_s: f64, found: &HomingResult, load_at_range_end: Option<RangeEnd>) -> Self {
        let HomingResult { load_n, load_error_n, friction_n, zero_error_rad, reference_gap_m, .. } = *found;
        Self { duration_s, load_n, load_at_range_end, load_error_n, friction_n, zero_error_rad, reference_gap_m }
    }

    /// A line for people.
    pub fn text(&self) -> String {
        let contradicts = if self.load_error_n > self.load_n {
            "; the load is unknown: what the rig shows contradicts its scene, or the weight that was given"
        } else {
            ""
        };
        format!(
            "homed in {}: load {}, friction {}, zero twist ± {}{contradicts}",
            S.show(self.duration_s),
            load_text(self.load_n, self.load_error_n, self.load_at_range_end),
            N.show(self.friction_n),
            RAD.error(self.zero_error_rad)
        )
    }
}

/// Homes; `load` is what the operator says of the load's weight, `each` gets every row of telemetry.
///
/// # Errors
/// The board's refusal or failure in words, that it did not end, or that the board went silent.
pub fn home(session: &mut Session, load: LoadChoice, mut each: impl FnMut(&Row)) -> Result<HomeResult, Failure> {
    session.wait_ready()?;
    let start_s = session.board_s();
    let request = Request::Home { load };
    session.request(&request)?;
    let bar = progress(45, "homing");
    while session.board_s() < start_s + HOMING_S {
        session.step()?;
        bar.set_position((session.board_s() - start_s) as u64);
        session.take_rows().iter().for_each(&mut each);
        if let Some((t_s, EventKind::Homed(found))) = ended(session, &request, "while homing")? {
            bar.finish_and_clear();
            return Ok(HomeResult::new(t_s - start_s, &found, session.range_end(found.load_n)));
        }
    }
    Err(Failure::failed(format!("homing did not end within {HOMING_S} s")))
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::fixtures::telemetry;
    use crate::session::link::Port;
    use rig_link::messages::GapCurve;
    use rig_link::{Accepted, Decoder, MAX_FRAME, Message, encode};
    use rig_plant::Run;

    /// Time (µs) for which the board has been on, and how much of it passes in a step of 10 ms on the port's clock.
    const ON_US: u64 = 3_600_000_000;
    const STEP_US: u64 = 4000;

    /// A board that has been on for an hour and runs slower than the port's clock. It homes in a time (µs), or falls silent.
    struct Slow {
        homes_in_us: Option<u64>,
        asked_us: Option<u64>,
        board_us: u64,
        port_s: f64,
        sequence: u16,
        decoder: Decoder<Request>,
    }

    impl Slow {
        fn session(homes_in_us: Option<u64>) -> Session {
            Session::new(Box::new(Self {
                homes_in_us,
                asked_us: None,
                board_us: ON_US,
                port_s: 0.0,
                sequence: 0,
                decoder: Decoder::new(),
            }))
        }
    }

    impl Port for Slow {
        fn pass(&mut self, bytes: &[u8], seconds: f64) -> Result<Run, Failure> {
            let mut messages = Vec::new();
            for frame in bytes.iter().filter_map(|byte| self.decoder.push(*byte)?.ok()) {
                if matches!(frame.body, Request::Home { .. }) {
                    messages.push(Message::Reply { to: frame.sequence, result: Ok(Accepted::Started) });
                    self.asked_us = Some(self.board_us);
                }
            }
            self.port_s += seconds;
            self.board_us += STEP_US;
            let homes_us = self.asked_us.zip(self.homes_in_us).map(|(asked_us, takes_us)| asked_us + takes_us);
            if homes_us.is_some_and(|t_us| (t_us..t_us + STEP_US).contains(&self.board_us)) {
                messages.push(Message::Event { t_us: self.board_us, kind: EventKind::Homed(FOUND) });
            }
            if self.asked_us.is_none() || self.homes_in_us.is_some() {
                messages.push(Message::Telemetry(telemetry(self.board_us)));
            }
            let mut received = Run::default();
            for message in messages {
                self.sequence = self.sequence.wrapping_add(1);
                received.uart.extend(encode(self.sequence, &message, &mut [0; MAX_FRAME]).expect("it fits"));
            }
            Ok(received)
        }

        fn now_s(&self) -> f64 {
            self.port_s
        }
    }

    const FOUND: HomingResult = HomingResult {
        zero_error_rad: 0.01,
        load_n: 5.0,
        load_error_n: 0.5,
        friction_n: 0.1,
        reference_gap_m: 0.1,
        gap_noise_m: 1e-6,
        jump_m: 0.0,
        twist_scale: 1.0,
        curve: GapCurve::constant(0.0),
        covariance: [1e-4, 0.0, 1e-8, 0.0, 0.0, 1e-8],
        drive_lag_s: 0.02,
    };

    #[test]
    fn homing_takes_the_time_of_the_boards_clock_however_long_it_has_been_on() {
        // 33 s of the board are 82 s of the port.
        let homed = home(&mut Slow::session(Some(33_000_000)), LoadChoice::Auto, |_| {}).expect("it homes");
        assert!((homed.duration_s - 33.0).abs() < 0.05, "{} s", homed.duration_s);
        let late = home(&mut Slow::session(Some(121_000_000)), LoadChoice::Auto, |_| {}).expect_err("too late");
        assert!(late.message().is_some_and(|why| why.contains("120 s")));
    }

    #[test]
    fn a_board_that_falls_silent_while_homing_is_told() {
        let mut session = Slow::session(None);
        let silent = home(&mut session, LoadChoice::Auto, |_| {}).expect_err("it is silent");
        assert!(silent.message().is_some_and(|why| why.contains("silent") && why.contains("did NOT acknowledge")));
        // Half a second of silence, and as long for the stops.
        assert!((1.0..1.2).contains(&session.now_s()), "{} s", session.now_s());
    }
}
