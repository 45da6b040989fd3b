//! The start-up sequence against a clock of our own.

use rmds405::start_up::{AFTER_MODE_MS, AFTER_RESET_MS, CONFIG_RETRY_MS, CONFIG_TRIES, ONLINE_TRIES, POWER_UP_MS};
use rmds405::{
    Action, Address, Command, Event, Milliamps, Mode, OutOfRange, QuadCounts, Report, Rpm, StartError, StartUp,
};

fn start_up() -> StartUp {
    StartUp::new(Address::new(0, 1).unwrap(), Mode::CurrentVelocity, 10).unwrap()
}

const MOTION: Report = Report::Motion { current: Milliamps(0), speed: Rpm(0), position: QuadCounts(0) };

/// Steps every 1 ms; the drive answers a command by `answer`. Commands with their times, and how it ended.
fn play(until_ms: u64, mut answer: impl FnMut(u64, Command) -> Option<Report>) -> (Vec<(u64, Command)>, Action) {
    let own = Address::new(0, 1).unwrap();
    let mut start_up = start_up();
    let mut sent = Vec::new();
    let mut event = Event::Tick;
    for now_ms in 0..until_ms {
        match start_up.step(now_ms, event) {
            Action::Send(frame) => {
                let command = Command::decode(own, &frame.received()).unwrap();
                sent.push((now_ms, command));
                event = answer(now_ms, command).map_or(Event::Tick, Event::Report);
            }
            Action::Wait => event = Event::Tick,
            end => return (sent, end),
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
fn a_silent_drive_is_a_named_error() {
    let (sent, end) = play(10_000, |_, _| None);
    assert_eq!(end, Action::Failed(StartError::NoEcho));
    assert_eq!(sent.len(), 1 + usize::from(ONLINE_TRIES));
}

#[test]
fn no_reports_is_another() {
    let (sent, end) = play(10_000, |_, command| (command == Command::OnlineCheck).then_some(Report::Online));
    assert_eq!(end, Action::Failed(StartError::NoFeedback));
    let asked = sent.iter().filter(|(_, command)| matches!(command, Command::Config { .. }));
    let asked: Vec<_> = asked.map(|&(now_ms, _)| now_ms).collect();
    assert_eq!(asked.len(), usize::from(CONFIG_TRIES));
    assert!(asked.windows(2).all(|pair| pair[1] - pair[0] == CONFIG_RETRY_MS), "{asked:?}");
}

#[test]
fn the_end_stays_whatever_comes_after_it() {
    let own = Address::new(0, 1).unwrap();
    for answers in [true, false] {
        let mut start_up = start_up();
        let mut event = Event::Tick;
        let mut now_ms = 0;
        let end = loop {
            now_ms += 10;
            event = match start_up.step(now_ms, event) {
                Action::Send(frame) => match Command::decode(own, &frame.received()).unwrap() {
                    Command::OnlineCheck if answers => Event::Report(Report::Online),
                    Command::Config { .. } => Event::Report(MOTION),
                    _ => Event::Tick,
                },
                Action::Wait => Event::Tick,
                end => break end,
            };
        };
        assert_eq!(end, if answers { Action::Ready } else { Action::Failed(StartError::NoEcho) });
        for event in [Event::Tick, Event::Report(MOTION), Event::Report(Report::Online)] {
            now_ms += 1000;
            assert_eq!(start_up.step(now_ms, event), end);
        }
    }
}

#[test]
fn other_reports_do_not_count_as_echo() {
    let mut start_up = start_up();
    start_up.step(0, Event::Tick);
    start_up.step(500, Event::Tick);
    assert_eq!(start_up.step(501, Event::Report(MOTION)), Action::Wait);
    assert!(matches!(start_up.step(502, Event::Report(Report::Online)), Action::Send(_)));
    // Reports left over from before the reset do not make it ready.
    assert_eq!(start_up.step(503, Event::Report(MOTION)), Action::Wait);
    // A clock that jumps back does not panic.
    assert_eq!(start_up.step(0, Event::Tick), Action::Wait);
    assert_eq!(
        StartUp::new(Address::new(0, 1).unwrap(), Mode::CurrentVelocity, 0).err(),
        Some(OutOfRange::FeedbackPeriod)
    );
}
