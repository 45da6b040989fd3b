//! What framing promises: round trips, and no noise, cut or flipped byte ever makes a message that was not sent.

use proptest::prelude::*;

use rig_link::{
    Accepted, Clock, CorrectedConstants, Counters, CurveFlaw, Decoder, Doubt, Doubts, EncodeError, EventKind, Fault,
    Faults, Frame, GapCurve, HomingFailure, HomingResult, Identity, Kept, LVDT_POINTS_MAX, Limit, LoadChoice,
    LvdtCurve, MAX_FRAME, Message, Parameter, Refusal, Request, ResetCause, Sensors, Setting, SettingValues,
    SettingsReport, State, TableIdentity, TablePart, TableRefusal, Telemetry, Versions, encode,
};
use serde::{Serialize, de::DeserializeOwned};

fn one_of<T: Copy + core::fmt::Debug + 'static>(all: &'static [T]) -> impl Strategy<Value = T> {
    proptest::sample::select(all)
}

/// Any float but NaN, which is equal to nothing.
fn float() -> impl Strategy<Value = f32> {
    prop::num::f32::NORMAL | prop::num::f32::ZERO | prop::num::f32::INFINITE | prop::num::f32::SUBNORMAL
}

fn versions() -> impl Strategy<Value = Versions> {
    (any::<u32>(), "[0-9.]{0,24}", "[0-9a-f]{0,24}")
        .prop_map(|(hash, version, git)| Versions::new(hash, &version, &git))
}

fn request() -> impl Strategy<Value = Request> {
    let load = || prop_oneof![Just(LoadChoice::Auto), float().prop_map(LoadChoice::Known)];
    prop_oneof![
        versions().prop_map(Request::Hello),
        Just(Request::Heartbeat),
        load().prop_map(|load| Request::Home { load }),
        (float(), float(), load()).prop_map(|(target_m, speed_m_per_s, load)| Request::Move {
            target_m,
            speed_m_per_s,
            load
        }),
        float().prop_map(|twist_speed_rad_per_s| Request::Jog { twist_speed_rad_per_s }),
        Just(Request::Stop),
        Just(Request::Clear),
        Just(Request::Status),
        table_part().prop_map(Request::TablePart),
        Just(Request::GetSettings),
        (one_of(Setting::ALL), float()).prop_map(|(setting, value)| Request::SetSetting { setting, value }),
        (values(), curve())
            .prop_map(|(values, lvdt_curve)| Request::SetSettings(SettingValues { lvdt_curve, ..values })),
        Just(Request::ReadSensors),
    ]
}

fn values() -> impl Strategy<Value = SettingValues> {
    prop::array::uniform10(float()).prop_map(|numbers| SettingValues { numbers, ..SettingValues::ZERO })
}

fn curve() -> impl Strategy<Value = Option<LvdtCurve>> {
    let corrections = prop::collection::vec(-1e-4..1e-4f32, 2..=LVDT_POINTS_MAX);
    prop::option::of((corrections, 0.0..1e-3f32)).prop_map(|curve| {
        let (corrections, error_m) = curve?;
        let points: Vec<[f32; 2]> = (0..).zip(corrections).map(|(k, c)| [0.08 + 2e-3 * k as f32, c]).collect();
        Some(LvdtCurve::new(&points, error_m).expect("a curve"))
    })
}

fn corrected() -> impl Strategy<Value = CorrectedConstants> {
    prop::array::uniform4(float()).prop_map(|[gear_ratio, counts_per_rad, gap_m, metres_per_code]| CorrectedConstants {
        gear_ratio,
        counts_per_rad,
        lvdt_gap_at_code_zero_m: gap_m,
        lvdt_metres_per_code: metres_per_code,
    })
}

fn table_part() -> impl Strategy<Value = TablePart> {
    (any::<u16>(), any::<u16>(), prop::array::uniform32(any::<u32>())).prop_map(|(offset, total, words)| TablePart {
        offset,
        total,
        words,
    })
}

fn refusal() -> impl Strategy<Value = Refusal> {
    prop_oneof![
        Just(Refusal::NotHomed),
        Just(Refusal::EStop),
        one_of(State::ALL).prop_map(|state| Refusal::Busy { state }),
        one_of(Fault::ALL).prop_map(|fault| Refusal::InFault { fault }),
        (one_of(Parameter::ALL), float(), float(), float())
            .prop_map(|(parameter, min, max, given)| { Refusal::OutOfRange { parameter, min, max, given } }),
        Just(Refusal::NotGreeted),
        (one_of(Setting::ALL), float(), float(), float())
            .prop_map(|(setting, min, max, given)| Refusal::SettingOutOfRange { setting, min, max, given }),
        one_of(Setting::ALL).prop_map(|setting| Refusal::SettingNotFinite { setting }),
        one_of(CurveFlaw::ALL).prop_map(|flaw| Refusal::LvdtPoints { flaw }),
    ]
}

fn telemetry() -> impl Strategy<Value = Telemetry> {
    let state =
        (any::<u64>(), one_of(State::ALL), prop::option::of(one_of(Fault::ALL)), prop::option::of(one_of(Limit::ALL)));
    let values = prop::array::uniform12(prop::option::of(float()));
    (state, values, float(), float()).prop_map(|(s, v, current, speed)| Telemetry {
        t_us: s.0,
        state: s.1,
        fault: s.2,
        faults: s.2.map_or(Faults::NONE, |fault| Faults::NONE.with(fault)),
        limit: s.3,
        doubts: Doubts::of(Doubt::ALL),
        target_m: v[0],
        setpoint_m: v[1],
        position_m: v[2],
        twist_rad: v[3],
        load_n: v[4],
        load_error_n: v[8],
        position_error_m: v[9],
        tr_rad_per_m: v[5],
        drive_current_a: current,
        drive_speed_rad_per_s: speed,
        time_left_s: v[6],
        twist_scale: v[7],
        gap_m: v[10],
        shaft_rad: speed,
        supply_v: v[11],
    })
}

fn event() -> impl Strategy<Value = EventKind> {
    prop_oneof![
        (prop::array::uniform8(float()), prop::array::uniform6(float()), prop::array::uniform6(float())).prop_map(
            |(
                [zero_error_rad, load_n, load_error_n, friction_n, reference_gap_m, gap_noise_m, twist_scale, lag],
                c,
                v,
            )| {
                EventKind::Homed(HomingResult {
                    zero_error_rad,
                    load_n,
                    load_error_n,
                    friction_n,
                    reference_gap_m,
                    gap_noise_m,
                    jump_m: gap_noise_m,
                    twist_scale,
                    curve: GapCurve { middle_rad: c[0], half_rad: c[1], coefficients_m: [c[2], c[3], c[4], c[5]] },
                    covariance: v,
                    drive_lag_s: lag,
                })
            }
        ),
        one_of(HomingFailure::ALL).prop_map(EventKind::HomingRefused),
        float().prop_map(|error_m| EventKind::MoveDone { error_m }),
        one_of(Fault::ALL).prop_map(EventKind::FaultRaised),
        (any::<u32>(), any::<bool>()).prop_map(|(crc, kept)| EventKind::TableStored { crc, kept }),
        one_of(TableRefusal::ALL).prop_map(EventKind::TableRefused),
    ]
}

fn message() -> impl Strategy<Value = Message> {
    let accepted = one_of(Accepted::ALL);
    prop_oneof![
        versions().prop_map(Message::Hello),
        (any::<u16>(), prop_oneof![accepted.prop_map(Ok), refusal().prop_map(Err)])
            .prop_map(|(to, result)| Message::Reply { to, result }),
        telemetry().prop_map(Message::Telemetry),
        (any::<u64>(), event()).prop_map(|(t_us, kind)| Message::Event { t_us, kind }),
        Just(Message::Identity(longest_identity())),
        (values(), curve(), values(), one_of(Kept::ALL), corrected()).prop_map(
            |(values, lvdt_curve, defaults, kept, rig)| {
                let values = SettingValues { lvdt_curve, ..values };
                let other = CorrectedConstants { gear_ratio: 2.0 * rig.gear_ratio, ..rig };
                let (_, dropped) = values.carried_over(&other, &rig, &defaults, &defaults);
                Message::Settings(SettingsReport { values, defaults, constants: rig, kept, dropped })
            }
        ),
        sensors().prop_map(Message::Sensors),
    ]
}

fn sensors() -> impl Strategy<Value = Sensors> {
    let maybe = || prop::option::of(float());
    (maybe(), float(), maybe(), maybe(), any::<[bool; 3]>(), maybe(), any::<[u32; 5]>()).prop_map(
        |(gap_m, shaft_rad, drive_rad, supply_v, open, rest_tolerance_m, counts)| {
            let [estop_open, upper_limit_open, lower_limit_open] = open;
            let [link_errors, foreign_frames, late_ticks, unsent, longest_tick_us] = counts;
            Sensors {
                gap_m,
                shaft_rad,
                drive_rad,
                supply_v,
                estop_open,
                upper_limit_open,
                lower_limit_open,
                rest_tolerance_m,
                counters: Counters { link_errors, foreign_frames, late_ticks, unsent, longest_tick_us },
            }
        },
    )
}

fn text<const N: usize>(text: &str) -> heapless::String<N> {
    let mut s = heapless::String::new();
    s.push_str(text).expect("the text fits");
    s
}

fn longest_identity() -> Identity {
    Identity {
        version: text(&"9".repeat(24)),
        git: text(&"f".repeat(24)),
        protocol_hash: u32::MAX,
        scene_hash: u32::MAX,
        rig_hash: u32::MAX,
        table: TableIdentity {
            form: text(&"x".repeat(32)),
            bytes: u16::MAX,
            contraction_error_m: 5e-6,
            tr_relative_error: 2e-3,
            load_min_n: 0.5,
            load_max_n: 18.0,
            turns_min: 0.0,
            turns_max: 7.5,
            crc: u32::MAX,
            sent: true,
        },
        reset_cause: ResetCause::Watchdog,
        clock: Clock::Hsi,
        brown_out_level: 3,
        boot_count: u32::MAX,
        last_panic: Some(text(&"p".repeat(88))),
    }
}

fn wire<T: Serialize>(sequence: u16, body: &T) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    encode(sequence, body, &mut buffer).expect("every message fits").to_vec()
}

/// All good frames in the bytes, and how many errors were counted.
fn decode<T: DeserializeOwned>(bytes: &[u8]) -> (Vec<Frame<T>>, u32) {
    let mut decoder = Decoder::new();
    let frames = bytes.iter().filter_map(|&b| decoder.push(b)).filter_map(Result::ok).collect();
    (frames, decoder.errors())
}

proptest! {
    #[test]
    fn requests_round_trip(sequence: u16, body in request()) {
        let (frames, errors) = decode::<Request>(&wire(sequence, &body));
        prop_assert_eq!(frames, vec![Frame { sequence, body }]);
        prop_assert_eq!(errors, 0);
    }

    #[test]
    fn messages_round_trip(bodies in prop::collection::vec(message(), 1..5)) {
        let bytes: Vec<u8> = bodies.iter().zip(0..).flat_map(|(body, n)| wire(n, body)).collect();
        let (frames, errors) = decode::<Message>(&bytes);
        prop_assert_eq!(frames.into_iter().map(|f| f.body).collect::<Vec<_>>(), bodies);
        prop_assert_eq!(errors, 0);
    }

    #[test]
    fn noise_between_frames_loses_none(
        bodies in prop::collection::vec((message(), prop::collection::vec(any::<u8>(), 0..700)), 1..4),
    ) {
        let mut bytes = Vec::new();
        for (n, (body, noise)) in bodies.iter().enumerate() {
            bytes.extend(noise);
            bytes.extend(wire(n as u16, body));
        }
        let (frames, _) = decode::<Message>(&bytes);
        prop_assert_eq!(
            frames.into_iter().map(|f| f.body).collect::<Vec<_>>(),
            bodies.into_iter().map(|(body, _)| body).collect::<Vec<_>>()
        );
    }

    #[test]
    fn noise_alone_makes_no_message(noise in prop::collection::vec(any::<u8>(), 0..2000)) {
        prop_assert!(decode::<Message>(&noise).0.is_empty());
        prop_assert!(decode::<Request>(&noise).0.is_empty());
    }

    #[test]
    fn a_cut_frame_is_dropped_and_the_next_is_found(first in message(), second in message(), keep in 0.0..1.0f64) {
        let mut bytes = wire(1, &first);
        bytes.truncate(((bytes.len() - 1) as f64 * keep) as usize);
        bytes.extend(wire(2, &second));
        let (frames, _) = decode::<Message>(&bytes);
        prop_assert_eq!(frames, vec![Frame { sequence: 2, body: second }]);
    }

    #[test]
    fn a_changed_byte_never_makes_another_message(body in message(), place: prop::sample::Index, change in 1..=255u8) {
        let mut bytes = wire(7, &body);
        let place = place.index(bytes.len());
        bytes[place] ^= change;
        for frame in decode::<Message>(&bytes).0 {
            prop_assert_eq!(frame, Frame { sequence: 7, body: body.clone() }); // only a delimiter was hit
        }
    }
}

#[test]
fn the_longest_messages_fit() {
    assert!(wire(u16::MAX, &Message::Identity(longest_identity())).len() <= MAX_FRAME - 8);
    let telemetry = Telemetry {
        t_us: 1 << 40,
        state: State::Moving,
        fault: Some(Fault::DriveSilent),
        faults: Faults::of(Fault::ALL),
        limit: Some(Limit::MotorSpeed),
        doubts: Doubts::of(Doubt::ALL),
        target_m: Some(1.0),
        setpoint_m: Some(1.0),
        position_m: Some(1.0),
        twist_rad: Some(1.0),
        load_n: Some(1.0),
        load_error_n: Some(1.0),
        position_error_m: Some(1.0),
        tr_rad_per_m: Some(1.0),
        drive_current_a: 1.0,
        drive_speed_rad_per_s: 1.0,
        time_left_s: Some(1.0),
        twist_scale: Some(1.0),
        gap_m: Some(1.0),
        shaft_rad: 1.0,
        supply_v: Some(1.0),
    };
    assert!(wire(u16::MAX, &Message::Telemetry(telemetry)).len() <= 100, "the rate of telemetry rests on this");
}

#[test]
fn the_longest_body_fills_a_frame_and_one_byte_more_is_refused() {
    // A slice of more than 127 bytes begins with two bytes of length; around the body are 9 bytes.
    let body = [0x55_u8; MAX_FRAME];
    let longest = MAX_FRAME - 9 - 2;
    let mut buffer = [0; 2 * MAX_FRAME];
    assert_eq!(encode(0, &&body[..longest], &mut buffer).map(<[u8]>::len), Ok(MAX_FRAME));
    assert_eq!(encode(0, &&body[..=longest], &mut buffer), Err(EncodeError::TooLong));
}

#[test]
fn an_error_of_the_line_is_counted_and_costs_the_frame_that_it_hit() {
    let bytes = wire(5, &Request::Stop);
    let mut decoder = Decoder::<Request>::new();
    assert!(bytes[..4].iter().all(|&byte| decoder.push(byte).is_none()));
    decoder.line_error();
    assert!(bytes[4..].iter().all(|&byte| decoder.push(byte).is_none()), "the rest of it makes no second error");
    assert_eq!(decoder.errors(), 1);
    let next = bytes.iter().find_map(|&byte| decoder.push(byte));
    assert_eq!(next, Some(Ok(Frame { sequence: 5, body: Request::Stop })));
}

#[test]
fn too_small_a_buffer_is_an_error() {
    for length in 0..wire(0, &Request::HOME).len() {
        assert!(encode(0, &Request::HOME, &mut vec![0; length]).is_err(), "{length}");
    }
}

#[test]
fn an_endless_run_is_one_error_and_ends_at_the_delimiter() {
    let mut bytes = vec![0x55; 10 * MAX_FRAME];
    bytes.extend(wire(3, &Request::Stop));
    let (frames, errors) = decode::<Request>(&bytes);
    assert_eq!(frames, vec![Frame { sequence: 3, body: Request::Stop }]);
    assert_eq!(errors, 1);
}

#[test]
fn bytes_after_a_message_are_refused() {
    // Well framed and with a good checksum, but longer than the message: not of this protocol.
    let (frames, errors) = decode::<Request>(&wire(0, &(Request::HOME, 0_u8)));
    assert!(frames.is_empty());
    assert_eq!(errors, 1);
}

#[test]
fn names_and_numbers_are_unique_and_come_back() {
    for (n, fault) in Fault::ALL.iter().enumerate() {
        assert_eq!(Fault::from_name(fault.name()), Some(*fault));
        assert_eq!(Fault::from_code(fault.code()), Some(*fault));
        assert!(Fault::ALL[..n].iter().all(|f| f.name() != fault.name() && f.code() != fault.code()));
    }
    assert_eq!(Fault::from_code(0), None);
    assert_eq!(State::from_name("estop"), Some(State::EStop));
}

#[test]
fn refusals_name_parameter_and_limits() {
    let refusal = Refusal::OutOfRange { parameter: Parameter::Target, min: 0.0, max: 0.02, given: 0.5 };
    assert_eq!(refusal.to_string(), "target is 0.5 m, allowed are 0 to 0.02 m");
}
