//! Every frame and identifier of crates/rmds405/README.md 3.

use rmds405::report::{MixedRest, STALL};
use rmds405::{
    Address, Command, CurrentLimit, Frame, Function, Ignored, Milliamps, Mixed, Mode, OutOfRange, Output, Pwm,
    PwmLimit, QuadCounts, Received, Report, Rpm, SpeedLimit, serial,
};

const P: u8 = 0x55;

fn six() -> Address {
    Address::new(6, 2).unwrap()
}

fn number(number: u8) -> Address {
    Address::new(0, number).unwrap()
}

/// The frame that begins so, with its other bytes unused.
fn frame(id: u16, used: &[u8]) -> Frame {
    let mut data = [P; 8];
    data[..used.len()].copy_from_slice(used);
    Frame { id, data }
}

/// Encodes to exactly this frame, and back.
fn command(from: Command, to: Address, id: u16, used: &[u8]) {
    assert_eq!(from.encode(to), frame(id, used), "{from:?}");
    assert_eq!(Command::decode(to, &from.encode(to).received()), Ok(from));
}

fn report(of: Report, from: Address, id: u16, used: &[u8]) {
    assert_eq!(Report::decode(from, &frame(id, used).received()), Ok(of));
    assert_eq!(of.encode(from), frame(id, used));
}

#[test]
fn every_frame_is_as_documented() {
    let one = number(1);
    let (pwm_limit, position) = (PwmLimit::MAX, QuadCounts(-30000));
    let current_limit = CurrentLimit::new(800).unwrap();
    let speed_limit = |rpm| SpeedLimit::new(rpm).unwrap();
    command(Command::Reset, one, 0x010, &[]);
    assert_eq!(Command::decode(one, &frame(0x000, &[]).received()), Ok(Command::Reset), "to the whole group");
    command(Command::ChooseMode(Mode::OpenLoop), one, 0x011, &[1]);
    let pwm = |value| Command::OpenLoop { pwm: Pwm::new(value).unwrap() };
    command(pwm(500), one, 0x012, &[0x01, 0xF4]);
    command(pwm(-500), one, 0x012, &[0xFE, 0x0C]);
    command(pwm(0), one, 0x012, &[0, 0]);
    command(Command::Config { motion_ms: 10, mixed_ms: 10 }, number(2), 0x02A, &[0x0A, 0x0A]);
    command(Command::OnlineCheck, one, 0x01F, &[]);
    report(Report::Online, one, 0x01F, &[]);
    command(Command::Current { pwm_limit, current: Milliamps(-100) }, one, 0x013, &[0x13, 0x88, 0xFF, 0x9C]);
    command(Command::Velocity { pwm_limit, speed: Rpm(1000) }, one, 0x014, &[0x13, 0x88, 0x03, 0xE8]);
    command(Command::Velocity { pwm_limit, speed: Rpm(-1000) }, one, 0x014, &[0x13, 0x88, 0xFC, 0x18]);
    let half = Command::Position { pwm_limit: PwmLimit::new(2500).unwrap(), position };
    command(half, one, 0x015, &[0x09, 0xC4, P, P, 0xFF, 0xFF, 0x8A, 0xD0]);
    let bounded = Command::VelocityPosition { pwm_limit, speed_limit: speed_limit(1200), position: QuadCounts(32000) };
    command(bounded, one, 0x016, &[0x13, 0x88, 0x04, 0xB0, 0x00, 0x00, 0x7D, 0x00]);
    command(Command::CurrentVelocity { current_limit, speed: Rpm(-100) }, one, 0x017, &[0x03, 0x20, 0xFF, 0x9C]);
    let bounded = Command::CurrentPosition { current_limit, position };
    command(bounded, one, 0x018, &[0x03, 0x20, P, P, 0xFF, 0xFF, 0x8A, 0xD0]);
    let bounded = Command::CurrentVelocityPosition { current_limit, speed_limit: speed_limit(300), position };
    command(bounded, one, 0x019, &[0x03, 0x20, 0x01, 0x2C, 0xFF, 0xFF, 0x8A, 0xD0]);
    let motion = Report::Motion { current: Milliamps(850), speed: Rpm(-1200), position };
    report(motion, number(2), 0x02B, &[0x03, 0x52, 0xFB, 0x50, 0xFF, 0xFF, 0x8A, 0xD0]);
    let rest = Some(MixedRest { dsin: false, asin_mv: 5000, chz: true, pwm: Pwm::new(-500).unwrap() });
    let mixed = |rest| Report::Mixed(Mixed { ctl1: true, ctl2: false, rest });
    report(mixed(rest), number(10), 0x0AC, &[0x01, 0x00, 0x00, 0x13, 0x88, 0x01, 0xFE, 0x0C]);
    // Of an older drive.
    report(mixed(None), one, 0x01C, &[1, 0]);
    report(Report::Error(STALL), one, 0x01D, &[1]);
    command(Command::Outputs { out1: Output::On, out2: Output::Off }, one, 0x01E, &[0, 1]);
    // What the serial variant assumes, byte by byte.
    assert_eq!(serial::encode(&Command::Reset.encode(number(3))), [0x32, 0x00, P, P, P, P, P, P, P, P]);
    let expected = [0x32, 0x0B, 0x03, 0x52, 0xFB, 0x50, 0xFF, 0xFF, 0x8A, 0xD0];
    assert_eq!(serial::encode(&motion.encode(number(2))), expected);
}

#[test]
fn identifiers() {
    use Function::{ChooseMode, Config, CurrentVelocityPosition, Error, Mixed, OnlineCheck, Outputs, Reset, Velocity};
    let ten = number(10);
    let ids = [Reset, ChooseMode, Velocity, CurrentVelocityPosition, Config, Error].map(|f| ten.id(f));
    assert_eq!(ids, [0x0A0, 0x0A1, 0x0A4, 0x0A9, 0x0AA, 0x0AD]);
    let ids = [Reset, ChooseMode, Velocity, CurrentVelocityPosition, Config, Mixed, Error, OnlineCheck];
    assert_eq!(ids.map(|f| six().id(f)), [0x620, 0x621, 0x624, 0x629, 0x62A, 0x62C, 0x62D, 0x62F]);
    assert_eq!(number(1).report_ids(), [0x01B, 0x01C, 0x01D, 0x01F]);
    assert_eq!(Address::new(7, 15).unwrap().id(OnlineCheck), 0x7FF);
    assert_eq!(Address::new(0, 1).unwrap().id(Outputs), 0x01E);
    assert_eq!(Address::new(8, 1), Err(OutOfRange::Group(8)));
    assert_eq!(Address::new(0, 0), Err(OutOfRange::Number(0)));
    assert_eq!(Address::new(0, 16), Err(OutOfRange::Number(16)));
}

#[test]
fn thirty_two_bit_positions() {
    for (counts, bytes) in [
        (500_000_000, [0x1D, 0xCD, 0x65, 0x00]),
        (-500_000_000, [0xE2, 0x32, 0x9B, 0x00]),
        (2_100_000_000, [0x7D, 0x2B, 0x75, 0x00]),
        (-2_100_000_000, [0x82, 0xD4, 0x8B, 0x00]),
    ] {
        let frame = Command::Position { pwm_limit: PwmLimit::MAX, position: QuadCounts(counts) }.encode(number(1));
        assert_eq!(frame.data[4..], bytes);
    }
}

#[test]
fn every_mode_has_its_data_function() {
    for code in 1..=8u8 {
        let mode = Mode::try_from(code).unwrap();
        assert_eq!(mode as u8, code);
        assert_eq!(mode.data_function() as u8, code + 1);
    }
    assert_eq!(Mode::try_from(0), Err(OutOfRange::Mode(0)));
    assert_eq!(Mode::try_from(0x11), Err(OutOfRange::Mode(0x11)));
}

#[test]
fn foreign_and_short_frames_are_ignored_with_a_reason() {
    let one = number(1);
    let good = Report::Online.encode(one);
    let base = good.received();
    let decode = |received: Received<'_>| Report::decode(one, &received);
    assert_eq!(decode(base), Ok(Report::Online));
    assert_eq!(decode(Received { extended: true, ..base }), Err(Ignored::Extended));
    assert_eq!(decode(Received { remote: true, ..base }), Err(Ignored::Remote));
    assert_eq!(decode(Received { id: 0x02F, ..base }), Err(Ignored::OtherDrive(0x02F)));
    assert_eq!(decode(Received { id: 0x1_001F, ..base }), Err(Ignored::OtherDrive(0x1_001F)));
    assert_eq!(decode(Received { data: &good.data[..7], ..base }), Err(Ignored::Length(7)));
    assert_eq!(decode(Received { id: 0x014, ..base }), Err(Ignored::WrongDirection(Function::Velocity)));
    assert_eq!(decode(Received { data: &[P, P, 0, P, P, P, P, P], ..base }), Err(Ignored::Field(2)));
    assert_eq!(Command::decode(six(), &Received { id: 0x600, ..base }), Ok(Command::Reset), "a broadcast to its group");
    assert_eq!(Command::decode(one, &Received { id: 0x600, ..base }), Err(Ignored::OtherDrive(0x600)));
    // A broadcast is for drives, never from one.
    assert_eq!(decode(Received { id: 0x00F, ..base }), Err(Ignored::OtherDrive(0x00F)));
    let motion = Received { id: 0x01B, ..base };
    assert_eq!(Command::decode(one, &motion), Err(Ignored::WrongDirection(Function::Motion)));
}

#[test]
fn ranges() {
    assert_eq!(Pwm::new(5001), Err(OutOfRange::Pwm(5001)));
    assert_eq!(Pwm::new(-5001), Err(OutOfRange::Pwm(-5001)));
    assert_eq!(PwmLimit::new(-1), Err(OutOfRange::PwmLimit(-1)));
    assert_eq!(CurrentLimit::new(-1), Err(OutOfRange::CurrentLimit(-1)));
    assert_eq!(SpeedLimit::new(-1), Err(OutOfRange::SpeedLimit(-1)));
}

#[test]
fn a_function_that_does_not_exist_ends_a_serial_frame_at_once() {
    use rmds405::serial::{Decoder, HEADER};
    let mut decoder = Decoder::reports();
    assert_eq!((decoder.push(0, HEADER), decoder.foreign()), (None, 0));
    assert_eq!((decoder.push(90, 0x10), decoder.foreign()), (None, 2));
}
