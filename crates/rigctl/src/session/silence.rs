//! Whether the board is heard, and how many of its rows were lost, by the times that the board itself gives them.

use super::link::STEP_S;
use rig_link::TELEMETRY_PERIOD_MS;

/// Time without telemetry after which a board is silent (s): fifty rows.
const SILENT_S: f64 = 0.5;
/// The environment variable that names another time (s), for a line that delivers late.
const SILENT_VARIABLE: &str = "RIGCTL_SILENT_S";
/// The same while the board may write its flash (s): to erase all three sectors stalls it for up to 2 s.
const STORING_S: f64 = 3.0;
/// What one exchange adds at most (s): a longer one was delayed by this machine, and says nothing about the board.
const MAX_S: f64 = 10.0 * STEP_S;

/// Rows of telemetry since a start of the board.
#[derive(Clone, Copy)]
struct Rows {
    first_us: u64,
    last_us: u64,
    count: u64,
}

impl Rows {
    /// Rows that are missing between the first and the last one.
    fn lost(&self) -> u64 {
        let period_us = u64::from(TELEMETRY_PERIOD_MS) * 1000;
        let sent = (self.last_us - self.first_us + period_us / 2) / period_us + 1;
        sent.saturating_sub(self.count)
    }
}

/// What was heard of a board so far.
pub struct Hearing {
    /// Time without telemetry after which the board is silent (s).
    silent_after_s: f64,
    /// End of the last exchange, on the port's clock (s).
    now_s: f64,
    /// Time spent listening since the last row (s).
    quiet_s: f64,
    rows: Option<Rows>,
    /// Rows that were lost before the board's last start.
    lost_before: u64,
    /// Until when the board may be writing its flash (s).
    stores_until_s: f64,
}

impl Default for Hearing {
    fn default() -> Self {
        let named = std::env::var(SILENT_VARIABLE).ok().and_then(|text| text.parse().ok());
        Self {
            silent_after_s: named.filter(|seconds| (SILENT_S..=60.0).contains(seconds)).unwrap_or(SILENT_S),
            now_s: 0.0,
            quiet_s: 0.0,
            rows: None,
            lost_before: 0,
            stores_until_s: 0.0,
        }
    }
}

impl Hearing {
    /// An exchange has ended. Its rows follow.
    pub fn listened(&mut self, now_s: f64) {
        self.quiet_s += (now_s - self.now_s).min(MAX_S);
        self.now_s = now_s;
    }

    /// A row of this time since the board's start (µs).
    pub fn row(&mut self, t_us: u64) {
        self.quiet_s = 0.0;
        let rows = self.rows.get_or_insert(Rows { first_us: t_us, last_us: t_us, count: 0 });
        rows.last_us = t_us;
        rows.count += 1;
    }

    /// The board was reset, and its times begin again.
    pub fn restarted(&mut self) {
        self.lost_before = self.lost();
        self.rows = None;
    }

    /// For so long (s) the board may be writing its flash; 0 when it has done so.
    pub fn may_store(&mut self, for_s: f64) {
        self.stores_until_s = self.now_s + for_s;
    }

    /// A wait (s), longer by as much as a line delivers later than usual.
    pub fn wait_s(&self, usual_s: f64) -> f64 {
        usual_s * self.silent_after_s / SILENT_S
    }

    /// How long a board has been silent that was heard before (s).
    pub fn silent_s(&self) -> Option<f64> {
        let storing_s = if self.now_s < self.stores_until_s { STORING_S } else { 0.0 };
        let allowed_s = storing_s.max(self.silent_after_s);
        (self.rows.is_some() && self.quiet_s > allowed_s).then_some(self.quiet_s)
    }

    /// Rows that were lost so far. Nobody knows how many a board has sent since it was heard last.
    pub fn lost(&self) -> u64 {
        self.lost_before + self.rows.map_or(0, |rows| rows.lost())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Listens for so long (s), without a row.
    fn quiet(hearing: &mut Hearing, seconds: f64) {
        let end_s = hearing.now_s + seconds;
        while hearing.now_s < end_s {
            hearing.listened(hearing.now_s + STEP_S);
        }
    }

    #[test]
    fn half_a_second_without_a_row_is_silence_and_the_next_row_ends_it() {
        let mut hearing = Hearing::default();
        quiet(&mut hearing, 10.0);
        assert_eq!(hearing.silent_s(), None, "one that was never heard is not connected yet");
        hearing.row(1_000_000);
        quiet(&mut hearing, 0.49);
        assert_eq!(hearing.silent_s(), None);
        quiet(&mut hearing, 0.03);
        assert!(hearing.silent_s().is_some_and(|silent_s| (silent_s - 0.52).abs() < 0.02));
        hearing.row(1_520_000);
        assert_eq!(hearing.silent_s(), None);
    }

    #[test]
    fn a_machine_that_was_busy_or_asleep_is_no_silent_board() {
        let mut hearing = Hearing::default();
        hearing.row(0);
        (1..=4).for_each(|hours| hearing.listened(3600.0 * f64::from(hours)));
        assert_eq!(hearing.silent_s(), None);
    }

    #[test]
    fn a_board_that_writes_its_flash_may_be_silent_for_longer() {
        let mut hearing = Hearing::default();
        hearing.row(0);
        hearing.may_store(10.0);
        quiet(&mut hearing, 2.5);
        assert_eq!(hearing.silent_s(), None);
        hearing.may_store(0.0);
        assert!(hearing.silent_s().is_some());
        hearing.may_store(10.0);
        quiet(&mut hearing, 0.6);
        assert!(hearing.silent_s().is_some(), "but not for ever");
    }

    #[test]
    fn rows_are_missed_by_the_boards_time_however_long_it_was_silent() {
        let mut hearing = Hearing::default();
        let mut rows = |times_ms: &[u64]| {
            times_ms.iter().for_each(|ms| hearing.row(ms * 1000));
            hearing.lost()
        };
        assert_eq!(rows(&[5000, 5010, 5020]), 0);
        assert_eq!(rows(&[5037, 5040, 5051, 5060]), 0, "a late tick is not a lost one");
        assert_eq!(rows(&[5090]), 2);
        // More frames than their number counts.
        assert_eq!(rows(&[3_605_090]), 2 + 359_999);
        hearing.restarted();
        hearing.row(20_000);
        hearing.row(50_000);
        assert_eq!(hearing.lost(), 360_001 + 2);
    }

    #[test]
    fn waits_grow_with_the_time_after_which_a_board_is_silent() {
        let usual = Hearing::default();
        let slow = Hearing { silent_after_s: 10.0 * SILENT_S, ..Hearing::default() };
        assert_eq!((usual.wait_s(3.0), slow.wait_s(3.0)), (3.0, 30.0));
    }
}
