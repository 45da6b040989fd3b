//! The start-up sequence against a clock of our own.

use rmds405::start_up::{AFTER_MODE_MS, AFTER_RESET_MS, CONFIG_RETRY_MS, CONFIG_TRIES, ONLINE_TRIES, POWER_UP_MS};
use rmds405::{Action, Address, Command, Milliamps, Mode, QuadCounts, Report, Rpm, StartUp};

fn start_up() -> StartUp {
    StartUp::new(Address::new(0, 1).unwrap(), Mode::CurrentVelocity, 10, 0)
}

const MOTION: Report = Report::Motion { current: Milliamps(0), speed: Rpm(0), position: QuadCounts(0) };

/// Steps every 1 ms; the drive answers a command by `answer`. Commands with their times, and how it ended.
fn play(until_ms: u64, mut answer: impl FnMut(u64, Command) -> Option<Report>) -> (Vec<(u64, Command)>, Action) {
    let own = Address::new(0, 1).unwrap();
    let mut start_up = start_up();
    let mut sent = Vec::new();
    let mut report = None;
    for now_ms in 0..until_ms {
        match start_up.step(now_ms, report) {
            Action::Send(frame) => {
                let command = Command::decode(own, &frame.received()).unwrap();
                sent.push((now_ms, command));
                report = answer(now_ms, command);
            }
            Action::Wait => report = None,
            end => {
                for report in [None, Some(MOTION), Some(Report::Online)] {
                    assert_eq!(start_up.step(now_ms + 1000, report), end, "the end stays whatever comes after it");
                }
                return (sent, end);
            }
        }
    }
    (sent, Action::Wait)
}

#[test]
fn in_order_and_never_early() {
    let (sent, end) = play(5000, |_, command| match command {
        Command::OnlineCheck => Some(Report::Online),
        Command::Config { .. } => Some(MOTION),
        _ => None,
    });
    assert_eq!(end, Action::Ready);
    let commands: Vec<_> = sent.iter().map(|&(_, command)| command).collect();
    let config = Command::Config { motion_ms: 10, mixed_ms: 0 };
    let mode = Command::ChooseMode(Mode::CurrentVelocity);
    assert_eq!(commands, [Command::Reset, Command::OnlineCheck, Command::Reset, mode, config]);
    let at: Vec<_> = sent.iter().map(|&(now_ms, _)| now_ms).collect();
    assert_eq!(at[0], 0);
    assert!(at[1] >= POWER_UP_MS);
    assert!(at[3] - at[2] >= AFTER_RESET_MS);
    assert!(at[4] - at[3] >= AFTER_MODE_MS);
    assert!(at[4] < 1800, "ready within two seconds of power-up");
}

#[test]
fn a_late_drive_is_waited_for() {
    let (_, end) = play(10_000, |now_ms, command| match command {
        Command::OnlineCheck if now_ms > 2500 => Some(Report::Online),
        Command::Config { .. } => Some(MOTION),
        _ => None,
    });
    assert_eq!(end, Action::Ready);
}

#[test]
fn a_drive_that_is_silent_or_does_not_report_has_failed_after_so_many_questions() {
    let (sent, end) = play(10_000, |_, _| None);
    assert_eq!((sent.len(), end), (1 + usize::from(ONLINE_TRIES), Action::Failed));
    let (sent, end) = play(10_000, |_, command| (command == Command::OnlineCheck).then_some(Report::Online));
    let asked = sent.iter().filter(|(_, command)| matches!(command, Command::Config { .. }));
    let asked: Vec<_> = asked.map(|&(now_ms, _)| now_ms).collect();
    assert_eq!((asked.len(), end), (usize::from(CONFIG_TRIES), Action::Failed));
    assert!(asked.windows(2).all(|pair| pair[1] - pair[0] == CONFIG_RETRY_MS), "{asked:?}");
}

#[test]
fn other_reports_do_not_count_as_echo() {
    let mut start_up = start_up();
    start_up.step(0, None);
    start_up.step(500, None);
    assert_eq!(start_up.step(501, Some(MOTION)), Action::Wait);
    assert!(matches!(start_up.step(502, Some(Report::Online)), Action::Send(_)));
    // Reports left over from before the reset do not make it ready.
    assert_eq!(start_up.step(503, Some(MOTION)), Action::Wait);
    // A clock that jumps back does not panic.
    assert_eq!(start_up.step(0, None), Action::Wait);
}
