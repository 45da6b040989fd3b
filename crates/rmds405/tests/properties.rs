//! Both directions survive every value and every byte string.

use proptest::prelude::*;
use rmds405::report::MixedRest;
use rmds405::uart::{Decoder, Variant, encode};
use rmds405::{
    Address, Command, CurrentLimit, DriveError, Milliamps, Mixed, Mode, Output, Pwm, PwmLimit, QuadCounts, Received,
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
        any::<u8>().prop_map(|code| Report::Error(DriveError::of_code(code))),
        Just(Report::Online),
    ]
}

proptest! {
    #[test]
    fn commands_round_trip(address in address(), command in command()) {
        let frame = command.encode(address);
        prop_assert!(frame.id <= 0x7FF);
        prop_assert_eq!(Command::decode(address, &frame.received()), Ok(command));
    }

    #[test]
    fn reports_round_trip(address in address(), report in report()) {
        let frame = report.encode(address);
        prop_assert_eq!(Report::decode(address, &frame.received()), Ok(report));
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
    fn uart_finds_the_frame_after_any_noise(
        number in 1..16u8,
        noise in proptest::collection::vec(any::<u8>(), 0..40),
        report in report(),
        rs485 in any::<bool>(),
    ) {
        let variant = if rs485 { Variant::Rs485 } else { Variant::Rs232 };
        let own = Address::new(0, number).unwrap();
        let mut decoder = Decoder::new(variant, own);
        for byte in noise {
            decoder.push(byte);
        }
        decoder.idle();
        let frame = report.encode(own);
        let found: Vec<_> = encode(variant, &frame).iter().filter_map(|&byte| decoder.push(byte)).collect();
        prop_assert_eq!(found, vec![frame]);
    }

    #[test]
    fn uart_frames_back_to_back(reports in proptest::collection::vec(report(), 1..20)) {
        let own = Address::new(0, 1).unwrap();
        let mut decoder = Decoder::new(Variant::Rs485, own);
        let frames: Vec<_> = reports.iter().map(|report| report.encode(own)).collect();
        let bytes = frames.iter().flat_map(|frame| encode(Variant::Rs485, frame));
        let found: Vec<_> = bytes.filter_map(|byte| decoder.push(byte)).collect();
        prop_assert_eq!(found, frames);
        prop_assert_eq!(decoder.dropped(), 0);
    }
}
