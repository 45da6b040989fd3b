//! What is asked of a board, with the wait for its answer.

use super::{FLASH_S, Session, TOOL};
use crate::failure::Failure;
use crate::session::link::STEP_S;
use crate::session::row::Row;
use rig_link::{Accepted, Kept, Request, Sensors, SettingsReport};

/// Longest wait for a reply (s), on a line that does not deliver late.
const REPLY_S: f64 = 3.0;
/// Longest wait for the first message of a board (s): the start-up of a drive does not hold the link back.
const HELLO_S: f64 = 5.0;
/// Readings of the gap that are averaged, half a second of them: noise and the resolution of the LVDT fall to a few µm.
const GAP_READINGS: u32 = 25;

impl Session {
    /// Longest wait for a reply on this line (s).
    pub fn reply_s(&self) -> f64 {
        self.hearing.wait_s(REPLY_S)
    }

    /// Sends a request and waits for its reply.
    ///
    /// # Errors
    /// The board's refusal, in words, or that no reply came.
    pub fn request(&mut self, request: &Request) -> Result<Accepted, Failure> {
        let number = self.post_anew(request)?;
        let wait_s = self.reply_s();
        self.until(wait_s, |s| s.reply_to(number).is_some())?;
        match self.reply_to(number).and_then(|place| self.replies.remove(place)) {
            Some((_, Ok(accepted))) => Ok(accepted),
            Some((_, Err(refusal))) => Err(Failure::of_kind("refused", format!("refused: {refusal}"))),
            None => Err(Failure::of_kind("no-reply", format!("no reply from the board within {wait_s} s"))),
        }
    }

    /// As [`Session::post`]. Numbers wrap around: an old reply with the same number must not answer this request.
    pub(super) fn post_anew(&mut self, request: &Request) -> Result<u16, Failure> {
        let number = self.post(request)?;
        self.replies.retain(|(to, _)| *to != number);
        Ok(number)
    }

    pub(super) fn reply_to(&self, number: u16) -> Option<usize> {
        self.replies.iter().position(|(to, _)| *to == number)
    }

    /// Asks for something that the board sends after its reply, and waits for it.
    fn ask<T: Clone>(
        &mut self,
        request: &Request,
        what: &str,
        newest: fn(&mut Self) -> &mut Option<T>,
    ) -> Result<T, Failure> {
        *newest(self) = None;
        self.request(request)?;
        let end_s = self.now_s() + self.reply_s();
        while self.now_s() < end_s {
            self.step()?;
            if let Some(sent) = newest(self) {
                return Ok(sent.clone());
            }
        }
        Err(Failure::failed(format!("the board did not send its {what}")))
    }

    /// Greets the board, which sends its identity, and asks for its settings.
    ///
    /// # Errors
    /// If nobody answers, or board and tool have different protocols.
    pub fn greet(&mut self) -> Result<(), Failure> {
        // A board of another protocol may send no telemetry that this tool can read: it is greeted all the same.
        let wait_s = self.hearing.wait_s(HELLO_S);
        let heard = self.until(wait_s, |s| s.last.is_some())?;
        let greeted = self.ask(&Request::Hello(TOOL), "identity", |s| &mut s.identity);
        if !heard && self.board.is_none() {
            return Err(Failure::failed(format!("no telemetry within {wait_s} s: is the board on, is it this port?")));
        }
        greeted?;
        self.settings().map(drop)
    }

    /// Asks the board for its identity again.
    ///
    /// # Errors
    /// If it does not answer.
    pub fn identify(&mut self) -> Result<(), Failure> {
        self.ask(&Request::Status, "identity", |s| &mut s.identity).map(drop)
    }

    /// Asks the board for its settings.
    ///
    /// # Errors
    /// If it does not answer.
    pub fn settings(&mut self) -> Result<SettingsReport, Failure> {
        self.ask(&Request::GetSettings, "settings", |s| &mut s.settings)
    }

    /// Changes settings, waits until they are in flash, and returns whether the board lost its position by that.
    ///
    /// # Errors
    /// The board's refusal in words, or that they are in use and not in flash.
    pub fn set(&mut self, request: &Request) -> Result<bool, Failure> {
        let accepted = self.request(request)?;
        // A report that came with the reply may be older than the change; one that is requested now is not.
        let end_s = self.now_s() + self.hearing.wait_s(FLASH_S);
        while self.now_s() < end_s {
            match self.settings()?.kept {
                Kept::These => return Ok(accepted == Accepted::Unhomed),
                Kept::Nothing => break,
                Kept::Others | Kept::Damaged | Kept::Partly => self.until(0.1, |_| false)?,
            };
        }
        Err(Failure::failed("in use, but NOT kept in flash: lost with the next reset. The board's log says why"))
    }

    /// The sensors' readings, homed or not.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn sensors(&mut self) -> Result<Sensors, Failure> {
        self.ask(&Request::ReadSensors, "sensor readings", |s| &mut s.sensors)
    }

    /// The newest telemetry, after a few more messages.
    ///
    /// # Errors
    /// As [`Session::step`].
    pub fn newest_row(&mut self) -> Result<Option<Row>, Failure> {
        self.until(10.0 * STEP_S, |_| false)?;
        Ok(self.take_rows().pop())
    }

    /// Gaps as the LVDT measures them (m), over half a second, homed or not.
    ///
    /// # Errors
    /// If one of them is not a valid reading.
    pub fn gaps_m(&mut self) -> Result<Vec<f64>, Failure> {
        let mut gaps_m = Vec::new();
        for _ in 0..GAP_READINGS {
            let gap_m = self.sensors()?.gap_m.ok_or_else(|| Failure::failed("no valid reading from the LVDT"))?;
            gaps_m.push(f64::from(gap_m));
            self.until(STEP_S, |_| false)?;
        }
        Ok(gaps_m)
    }

    /// The mean of [`Session::gaps_m`] (m).
    ///
    /// # Errors
    /// As [`Session::gaps_m`].
    pub fn gap_m(&mut self) -> Result<f64, Failure> {
        Ok(self.gaps_m()?.iter().sum::<f64>() / f64::from(GAP_READINGS))
    }
}
