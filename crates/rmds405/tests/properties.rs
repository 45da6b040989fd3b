//! Both directions survive every value and every byte string.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rmds405::report::MixedRest;
use rmds405::serial::{BYTE_US, Decoder, HEADER, LENGTH, QUIET_US, encode};
use rmds405::{
    Address, Command, CurrentLimit, Function, Milliamps, Mixed, Mode, Output, Pwm, PwmLimit, QuadCounts, Received,
    Report, Rpm, SpeedLimit,
};

fn address() -> impl Strategy<Value = Address> {
    (0..8u8, 1..16u8).prop_map(|(group, number)| Address::new(group, number).unwrap())
}

fn output() -> impl Strategy<Value = Output> {
    prop_oneof![Just(Output::On), Just(Output::Off), Just(Output::Unchanged)]
}

fn command() -> impl Strategy<Value = Command> {
    let pwm_limit = || (0..=5000i16).prop_map(|value| PwmLimit::new(value).unwrap());
    let current_limit = || (0..=i16::MAX).prop_map(|value| CurrentLimit::new(value).unwrap());
    let speed_limit = || (0..=i16::MAX).prop_map(|value| SpeedLimit::new(value).unwrap());
    let position = || any::<i32>().prop_map(QuadCounts);
    prop_oneof![
        Just(Command::Reset),
        Just(Command::OnlineCheck),
        (1..=8u8).prop_map(|code| Command::ChooseMode(Mode::try_from(code).unwrap())),
        (-5000..=5000i16).prop_map(|value| Command::OpenLoop { pwm: Pwm::new(value).unwrap() }),
        (pwm_limit(), any::<i16>())
            .prop_map(|(pwm_limit, current)| Command::Current { pwm_limit, current: Milliamps(current) }),
        (pwm_limit(), any::<i16>()).prop_map(|(pwm_limit, speed)| Command::Velocity { pwm_limit, speed: Rpm(speed) }),
        (pwm_limit(), position()).prop_map(|(pwm_limit, position)| Command::Position { pwm_limit, position }),
        (pwm_limit(), speed_limit(), position()).prop_map(|(pwm_limit, speed_limit, position)| {
            Command::VelocityPosition { pwm_limit, speed_limit, position }
        }),
        (current_limit(), any::<i16>())
            .prop_map(|(current_limit, speed)| Command::CurrentVelocity { current_limit, speed: Rpm(speed) }),
        (current_limit(), position())
            .prop_map(|(current_limit, position)| Command::CurrentPosition { current_limit, position }),
        (current_limit(), speed_limit(), position()).prop_map(|(current_limit, speed_limit, position)| {
            Command::CurrentVelocityPosition { current_limit, speed_limit, position }
        }),
        any::<(u8, u8)>().prop_map(|(motion_ms, mixed_ms)| Command::Config { motion_ms, mixed_ms }),
        (output(), output()).prop_map(|(out1, out2)| Command::Outputs { out1, out2 }),
    ]
}

fn report() -> impl Strategy<Value = Report> {
    let rest = (any::<bool>(), any::<u16>(), any::<bool>(), -5000..=5000i16)
        .prop_map(|(dsin, asin_mv, chz, pwm)| MixedRest { dsin, asin_mv, chz, pwm: Pwm::new(pwm).unwrap() });
    prop_oneof![
        any::<(i16, i16, i32)>().prop_map(|(current, speed, position)| Report::Motion {
            current: Milliamps(current),
            speed: Rpm(speed),
            position: QuadCounts(position),
        }),
        (any::<bool>(), any::<bool>(), proptest::option::of(rest))
            .prop_map(|(ctl1, ctl2, rest)| Report::Mixed(Mixed { ctl1, ctl2, rest })),
        any::<u8>().prop_map(Report::Error),
        Just(Report::Online),
    ]
}

fn config() -> ProptestConfig {
    ProptestConfig { cases: 2000, rng_seed: RngSeed::Fixed(405), failure_persistence: None, ..Default::default() }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn commands_round_trip(address in address(), command in command()) {
        let frame = command.encode(address);
        prop_assert!(frame.id <= 0x7FF);
        prop_assert_eq!(Command::decode(address, &frame.received()), Ok(command));
        prop_assert_eq!(Line::default().send(&mut Decoder::commands(), &encode(&frame)), vec![command]);
    }

    #[test]
    fn reports_round_trip(address in address(), report in report()) {
        let frame = report.encode(address);
        prop_assert_eq!(Report::decode(address, &frame.received()), Ok(report));
        prop_assert_eq!(encode(&frame), encode(&report.encode(own())), "the serial line has no address");
    }

    #[test]
    fn any_frame_is_tolerated(
        address in address(),
        own in any::<bool>(),
        id in any::<u32>(),
        extended in any::<bool>(),
        remote in any::<bool>(),
        data in proptest::collection::vec(any::<u8>(), 0..12),
    ) {
        let id = if own { u32::from(address.id(rmds405::Function::of_id(id as u16))) } else { id };
        let received = Received { id, extended, remote, data: &data };
        if let Ok(command) = Command::decode(address, &received) {
            // What is understood means the same again.
            prop_assert_eq!(Command::decode(address, &command.encode(address).received()), Ok(command));
        }
        if let Ok(report) = Report::decode(address, &received) {
            prop_assert_eq!(report.encode(address).id, address.id(report.function()));
        }
    }

    #[test]
    fn serial_finds_a_report_after_any_garbage_and_a_quiet_line(
        garbage in bytes(40),
        report in report(),
        gap_us in QUIET_US..1_000_000,
    ) {
        let mut line = Line::default();
        let mut decoder = Decoder::reports();
        line.send(&mut decoder, &garbage);
        line.now_us += gap_us;
        let found = line.send(&mut decoder, &encode(&report.encode(own())));
        prop_assert_eq!(found, vec![report]);
    }

    #[test]
    fn serial_finds_reports_cut_anywhere(
        reports in proptest::collection::vec(report(), 1..20),
        pauses in proptest::collection::vec(0..QUIET_US - BYTE_US, 200),
    ) {
        // Pauses that are no quiet line, within frames and between them.
        let mut decoder = Decoder::reports();
        let bytes = reports.iter().flat_map(|report| encode(&report.encode(own())));
        let mut now_us = 0;
        let mut found = Vec::new();
        for (byte, pause_us) in bytes.zip(pauses) {
            now_us += BYTE_US + pause_us;
            found.extend(decoder.push(now_us, byte));
        }
        prop_assert_eq!(found, reports);
        prop_assert_eq!(decoder.foreign(), 0);
    }

    #[test]
    fn serial_counts_what_broke_off(report in report(), next in report(), sent in 0..LENGTH) {
        let mut line = Line::default();
        let mut decoder = Decoder::reports();
        prop_assert_eq!(line.send(&mut decoder, &encode(&report.encode(own()))[..sent]), vec![]);
        line.now_us += QUIET_US;
        prop_assert_eq!(line.send(&mut decoder, &encode(&next.encode(own()))), vec![next]);
        prop_assert_eq!(decoder.foreign(), sent as u32);
    }

    /// Whatever comes without a quiet line in between, every byte is part of a report or counted.
    #[test]
    fn serial_accounts_for_every_byte(
        pieces in proptest::collection::vec(prop_oneof![
            bytes(30),
            report().prop_map(|report| encode(&report.encode(own())).to_vec()),
        ], 0..10),
        quiet in proptest::collection::vec(any::<bool>(), 10),
    ) {
        let mut line = Line::default();
        let mut decoder = Decoder::reports();
        let mut found = 0;
        for (piece, quiet) in pieces.iter().zip(quiet) {
            line.now_us += if quiet { QUIET_US } else { 0 };
            found += line.send(&mut decoder, piece).len();
        }
        line.now_us += QUIET_US;
        let last = line.send(&mut decoder, &[HEADER]);
        let all: usize = pieces.iter().map(Vec::len).sum();
        prop_assert!(last.is_empty());
        prop_assert_eq!(found * LENGTH + decoder.foreign() as usize, all);
    }

    /// A report with a wrong header, another function's number or a byte that should be padding is none.
    #[test]
    fn serial_refuses_a_damaged_form(which in 0..3usize, flip in 1..=255u8) {
        let mut bytes = encode(&Report::Online.encode(own()));
        let at = [0, 1, 5][which];
        bytes[at] ^= flip;
        // A motion report has no padding, and an error report may have any code.
        prop_assume!(bytes[1] != Function::Motion as u8 && bytes[1] != Function::Error as u8);
        let mut decoder = Decoder::reports();
        prop_assert_eq!(Line::default().send(&mut decoder, &bytes), vec![]);
    }
}

fn own() -> Address {
    Address::new(0, 1).unwrap()
}

fn bytes(max: usize) -> impl Strategy<Value = Vec<u8>> {
    // Headers and functions are common, so that something looks like a frame now and then.
    let byte = prop_oneof![any::<u8>(), Just(HEADER), Just(0x0Bu8), Just(0x55u8)];
    proptest::collection::vec(byte, 0..max)
}

/// A line on which bytes come back to back.
#[derive(Default)]
struct Line {
    now_us: u64,
}

impl Line {
    fn send<T>(&mut self, decoder: &mut Decoder<T>, bytes: &[u8]) -> Vec<T> {
        let mut found = Vec::new();
        for byte in bytes {
            self.now_us += BYTE_US;
            found.extend(decoder.push(self.now_us, *byte));
        }
        found
    }
}
