//! Faults of drive, encoder and supply of a rig whose every number is known.

use crate::bench::{Bench, to};
use crate::faults::{fault_of, holding, reports, tamper};
use crate::fixture::constants;
use rig_control::{DriveCommand, DriveReading, Inputs, RigConstants, TICK_US};
use rig_link::messages::{Accepted, EventKind, Fault, LoadChoice, Refusal, Request, State};
use std::f32::consts::TAU;

#[test]
fn each_fault_of_drive_and_bus_is_raised_in_its_time() {
    assert_eq!(fault_of(|inputs| inputs.bus_off = true), Some((1, Fault::CanBusOff)));
    assert_eq!(fault_of(|inputs| inputs.drive_stalled = true), Some((1, Fault::DriveStall)));
    assert_eq!(fault_of(|inputs| inputs.drive = DriveReading::Failed), Some((1, Fault::DriveStartUp)));
    assert_eq!(fault_of(|inputs| inputs.drive = DriveReading::Starting), Some((1, Fault::DriveReset)));
    assert_eq!(
        fault_of(|inputs| reports(inputs, |_, position_qc, _| *position_qc = 399)),
        Some((1, Fault::DriveReset))
    );
    let aged = |age_us| move |inputs: &mut Inputs| reports(inputs, |t_us, _, _| *t_us -= age_us);
    assert_eq!(fault_of(aged(55_001)), Some((1, Fault::DriveSilent)));
    assert_eq!(fault_of(aged(55_000)), None);
}

#[test]
fn the_supply_must_be_off_in_two_reports() {
    let volts = |volts: f32, age_us: u64| {
        move |inputs: &mut Inputs| {
            let Some(supply) = &mut inputs.supply else { return };
            (supply.volts, supply.t_us) = (Some(volts), supply.t_us - age_us);
        }
    };
    let [min, max] = constants().supply_limits_v;
    assert_eq!(fault_of(volts(min - 0.01, 0)), Some((2, Fault::Supply)));
    assert_eq!(fault_of(volts(max + 0.01, 149_000)), Some((2, Fault::Supply)));
    assert_eq!(fault_of(volts(max + 0.01, 150_000)), None, "it is old");
    assert_eq!(fault_of(volts(min, 0)), None);
    // A report each 50 ms, of which every fourth is wrong and the one after it is lost.
    let one_lost = |inputs: &mut Inputs| {
        let Some(supply) = &mut inputs.supply else { return };
        let newest = inputs.now_us / 50_000;
        let report = newest - u64::from(newest % 4 == 1);
        (supply.t_us, supply.volts) = (50_000 * report, Some(if report.is_multiple_of(4) { 0.0 } else { 24.0 }));
    };
    assert_eq!(fault_of(one_lost), None);
    // Two, between which the drive was silent.
    let mut bench = holding();
    bench.tamper = tamper(volts(0.0, 0));
    bench.run(1);
    bench.tamper = tamper(|inputs| {
        inputs.supply = None;
        reports(inputs, |t_us, _, _| *t_us -= 200_000);
    });
    bench.run(30);
    bench.tamper = tamper(volts(0.0, 0));
    bench.run(1);
    bench.tamper = None;
    bench.run(30);
    assert!(!bench.events.contains(&EventKind::FaultRaised(Fault::Supply)), "{:?}", bench.events);
    // It cannot be cleared while it lasts.
    let mut bench = holding();
    bench.tamper = tamper(volts(0.0, 0));
    bench.run(40);
    assert_eq!(bench.ask(Request::Clear), Err(Refusal::CauseRemains { fault: Fault::Supply }));
    bench.tamper = None;
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
    assert_eq!(bench.rig.state(), State::Ready);
    assert_eq!(bench.events, [EventKind::FaultRaised(Fault::Supply), EventKind::FaultCleared(Fault::Supply)]);
}

#[test]
fn own_encoder_and_drive_are_compared() {
    // 1500 counts at rest are allowed; they must differ for eight ticks.
    let apart = |counts| move |inputs: &mut Inputs| reports(inputs, |_, position_qc, _| *position_qc += counts);
    assert_eq!(fault_of(apart(1490)), None);
    assert_eq!(fault_of(apart(-1490)), None);
    assert_eq!(fault_of(apart(1510)), Some((8, Fault::EncoderJump)), "it goes on counting alike");
    assert_eq!(fault_of(apart(-4096)), Some((8, Fault::EncoderJump)));
    // One and a half times what the maximum speed makes, and what the two may differ by.
    let constants = constants();
    let max = (1.5 * constants.twist_speed_max() * constants.counts_per_rad * 0.01 + 1500.0) as i64;
    let start_us = holding().now_us;
    let jump = |counts| {
        move |inputs: &mut Inputs| {
            let even = (inputs.now_us - start_us) / TICK_US % 2 == 1;
            inputs.encoder_counts += if even { counts } else { 0 };
        }
    };
    assert_eq!(fault_of(jump(max + 20)), Some((1, Fault::EncoderJump)));
    assert_ne!(fault_of(jump(max - 20)).map(|(ticks, _)| ticks), Some(1));
    // An encoder that stands while the drive turns, and one that turns at half the drive's speed.
    let slower = |fraction: f32| {
        let mut bench = holding();
        let from = (bench.twist_rad + bench.zero_rad()) * constants.counts_per_rad;
        bench.tamper = tamper(move |inputs| {
            inputs.encoder_counts = (from + fraction * (inputs.encoder_counts as f32 - from)) as i64;
        });
        bench.begin(to(0.002, 0.004));
        let fault = bench.ticks_until_fault(300).map(|(_, fault)| fault);
        // The drive holds where it is by its own count.
        bench.run(50);
        assert_eq!(bench.rig.faults().iter().count(), 1, "{:?}", bench.events);
        let DriveCommand::Follow { position_qc, .. } = bench.command else { panic!("{:?}", bench.command) };
        let sensors = bench.sensors.as_ref().unwrap();
        let there = (sensors.drive_rad.unwrap() * constants.counts_per_rad) as i32;
        assert!((position_qc - there).abs() < 4000, "{position_qc} {there}");
        fault
    };
    assert_eq!(slower(0.0), Some(Fault::EncoderStuck));
    assert_eq!(slower(0.5), Some(Fault::EncoderDisagrees));
}

#[test]
fn a_drives_report_is_compared_with_the_own_count_of_its_time() {
    let counts_per_rpm = constants().counts_per_rad * TAU / constants().gear_ratio / 60.0;
    let mut bench = Bench::homed();
    bench.tamper = tamper(move |inputs| {
        reports(inputs, |t_us, position_qc, speed_rpm| {
            *t_us -= 30_000;
            *position_qc -= (0.03 * counts_per_rpm * f32::from(*speed_rpm)) as i32;
        });
    });
    bench.move_to(0.012, f32::INFINITY);
}

#[test]
fn own_encoder_and_drive_are_matched_when_the_motor_stands_but_for_its_hunting() {
    let counts_per_s_per_rpm = constants().counts_per_rad * TAU / constants().gear_ratio / 60.0;
    for (rpm, stands) in [(-35.0, true), (55.0, false)] {
        let mut bench = Bench::new(5.0, 0.01, 9.0);
        bench.while_in(State::Boot);
        bench.begin(Request::CheckDirection);
        while bench.command != DriveCommand::Restart {
            bench.tick(None);
        }
        let from_us = bench.now_us;
        bench.tamper = tamper(move |inputs| {
            let turned = (1e-6 * (inputs.now_us - from_us) as f32 * rpm * counts_per_s_per_rpm) as i32;
            inputs.encoder_counts += i64::from(turned);
            reports(inputs, |_, position_qc, _| *position_qc += turned);
        });
        bench.run(60);
        assert_eq!(bench.rig.state() == State::Unhomed, stands, "{rpm} rpm: {:?}", bench.rig.state());
    }
}

#[test]
fn the_directions_are_reported_as_proven_when_the_next_motion_can_begin() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.while_in(State::Boot);
    bench.begin(Request::CheckDirection);
    while bench.events.is_empty() {
        bench.tick(None);
    }
    assert_eq!(bench.events, [EventKind::DirectionProven]);
    bench.begin(Request::Home { load: LoadChoice::Auto });
}

/// A rig whose drive starts again in closed loop, after its directions have been proven.
fn restarting() -> Bench {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.while_in(State::Boot);
    bench.begin(Request::HOME);
    while bench.command != DriveCommand::Restart {
        bench.tick(None);
    }
    bench
}

#[test]
fn a_set_point_that_turns_while_neither_count_does_is_let_go_before_the_drive_has_run_away() {
    for (current_ma, expected) in [(0, Fault::MotorStill), (constants().current_limit_ma, Fault::FollowingError)] {
        let mut bench = Bench::homed();
        bench.begin(Request::Jog { twist_speed_rad_per_s: 2.0 });
        bench.run(100);
        // Both inputs lose their encoder. The motor draws little where it turns, and all that it may where it is blocked.
        let counts = bench.sensors.as_ref().map(|sensors| sensors.shaft_rad * constants().counts_per_rad);
        let own = counts.expect("a shaft") as i64;
        bench.tamper = tamper(move |inputs| {
            let DriveReading::Reports { position_qc, speed_rpm, current_ma: drawn_ma, .. } = &mut inputs.drive else {
                return;
            };
            *position_qc += (own - inputs.encoder_counts) as i32;
            (inputs.encoder_counts, *speed_rpm, *drawn_ma) = (own, 0, current_ma);
        });
        let (ticks, fault) = bench.ticks_until_fault(200).expect("a fault");
        // 0.05 rad at 2 rad/s, a quarter of a second, and 80 ms.
        assert_eq!((fault, ticks < 38), (expected, expected == Fault::MotorStill), "after {ticks} ticks");
        let let_go = bench.command == DriveCommand::LetGo;
        assert_eq!(let_go, expected == Fault::MotorStill, "{:?}", bench.command);
    }
}

/// A drive turns its motor by the motor's angle from its target, whatever the gear.
#[test]
fn a_motor_behind_a_low_gear_has_as_far_to_go_before_it_counts_as_unseen() {
    // 3.1 rad of the motor at 0.5 rad/s of the strings, a quarter of a second, and 80 ms.
    for (gear_ratio, expected) in [(62.0, 42..46), (19.0, 64..69)] {
        let scale = gear_ratio / constants().gear_ratio;
        let counts_per_rad = scale * constants().counts_per_rad;
        let geared = RigConstants { gear_ratio, counts_per_rad, ..constants() };
        let mut bench = Bench::of(geared, 5.0, 0.01, 9.0);
        bench.home();
        let own = (bench.sensors.as_ref().expect("sensors").shaft_rad * counts_per_rad) as i64;
        bench.begin(Request::Jog { twist_speed_rad_per_s: 0.5 });
        bench.tamper = tamper(move |inputs| {
            if let DriveReading::Reports { position_qc, speed_rpm, current_ma, .. } = &mut inputs.drive {
                *position_qc += (own - inputs.encoder_counts) as i32;
                (inputs.encoder_counts, *speed_rpm, *current_ma) = (own, 0, 0);
            }
        });
        let (ticks, fault) = bench.ticks_until_fault(200).expect("a fault");
        assert!(
            fault == Fault::MotorStill && expected.contains(&ticks),
            "{fault} after {ticks} ticks at {gear_ratio}:1"
        );
    }
}

/// A shaft that stands, homed or held by a fault, and a drive that reports a voltage on the motor of which its current explains a part.
#[test]
fn a_motor_that_turns_by_its_voltage_while_no_count_moves_is_let_go_also_at_rest() {
    // 0.1 A through 10 Ω is 1 V, 0.04 of 24 V; a quarter of the maximum speed induces 6 V.
    for (on_motor, current_ma, age_us, let_go) in [
        (0.35, 100, 0, true),
        (-0.35, -100, 0, true),
        (0.25, 100, 0, false),
        (0.35, 300, 0, false),
        (0.35, 100, 200_000, false),
    ] {
        for fault in [None, Some(Fault::HostSilent)] {
            let mut bench = Bench::homed();
            if fault.is_some() {
                bench.begin(Request::Jog { twist_speed_rad_per_s: 0.1 });
                bench.host_alive = false;
                bench.ticks_until_fault(100);
                bench.host_alive = true;
                bench.run(50);
            }
            bench.tamper = tamper(move |inputs| {
                if let (DriveReading::Reports { current_ma: drawn_ma, .. }, Some(supply)) =
                    (&mut inputs.drive, &mut inputs.supply)
                {
                    *drawn_ma = current_ma;
                    (supply.on_motor, supply.t_us) = (on_motor, supply.t_us - age_us);
                }
            });
            bench.run(10);
            let expected = if let_go { Some(Fault::MotorStill) } else { fault };
            assert_eq!(
                bench.rig.fault(),
                expected,
                "{on_motor} of the supply, {current_ma} mA, {age_us} us, {fault:?}"
            );
            assert_eq!(bench.command == DriveCommand::LetGo, let_go);
        }
    }
}

/// A stop or a limit switch ends the check of the directions just when the line breaks: the drive has not heard of it.
#[test]
fn a_drive_that_does_not_hear_of_the_end_of_the_check_loses_its_power() {
    for stops in [false, true] {
        let mut bench = Bench::new(5.0, 0.01, 9.0);
        bench.while_in(State::Boot);
        bench.begin(Request::HOME);
        while !matches!(bench.command, DriveCommand::Voltage { pwm: 1.. }) {
            bench.tick(None);
        }
        bench.tamper = tamper(move |inputs| {
            reports(inputs, |t_us, _, _| *t_us = 0);
            inputs.upper_limit_open = !stops;
        });
        bench.tick(stops.then_some(Request::Stop));
        bench.run(12);
        assert!(bench.rig.faults().contains(Fault::NotHeld), "{}", bench.rig.faults());
        assert_eq!(bench.command, DriveCommand::PowerOff, "{stops}");
    }
}

#[test]
fn a_drive_that_turns_the_motor_by_a_voltage_and_does_not_hear_loses_its_power() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.while_in(State::Boot);
    // One that only brakes it goes on with that.
    let mut braking = bench.clone();
    braking.tamper = tamper(|inputs| reports(inputs, |t_us, _, _| *t_us = 0));
    braking.ticks_until_fault(10);
    assert_eq!((braking.rig.fault(), braking.command), (Some(Fault::DriveSilent), DriveCommand::Voltage { pwm: 0 }));
    bench.begin(Request::HOME);
    while !matches!(bench.command, DriveCommand::Voltage { pwm: 1.. }) {
        bench.tick(None);
    }
    bench.tamper = tamper(|inputs| reports(inputs, |t_us, _, _| *t_us = 0));
    bench.ticks_until_fault(10);
    assert_eq!((bench.rig.fault(), bench.command), (Some(Fault::NotHeld), DriveCommand::PowerOff));
    assert!(bench.shown().drive_speed_rad_per_s.is_nan() && bench.shown().drive_current_a.is_nan(), "they are old");
    bench.tamper = None;
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
    assert_eq!(bench.command, DriveCommand::RestartOpenLoop);
}

#[test]
fn a_fault_while_the_drive_restarts_holds_from_its_first_report_and_clear_goes_on_with_the_start() {
    let mut bench = restarting();
    bench.run(1);
    bench.now_us += 60_000;
    bench.run(1);
    assert_eq!((bench.rig.fault(), bench.command), (Some(Fault::TickLate), DriveCommand::Silence));
    bench.run(300);
    assert!(matches!(bench.command, DriveCommand::Follow { .. }), "{:?}", bench.command);
    let held_rad = bench.twist_rad;
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
    bench.while_in(State::Boot);
    bench.begin(Request::HOME);
    assert!(bench.rig.state() == State::Homing && (bench.twist_rad - held_rad).abs() < 0.05, "it has not let go");
}

#[test]
fn a_hold_that_a_fault_began_before_the_shaft_has_stood_is_watched() {
    let mut bench = restarting();
    bench.run(1);
    bench.now_us += 60_000;
    bench.run(300);
    assert_eq!(bench.rig.fault(), Some(Fault::TickLate));
    let counts = (0.9 * bench.constants.counts_per_rad) as i32;
    bench.tamper = tamper(move |inputs| {
        inputs.encoder_counts += i64::from(counts);
        reports(inputs, |_, position_qc, _| *position_qc += counts);
    });
    bench.run(10);
    assert_eq!((bench.rig.fault(), bench.command), (Some(Fault::NotHeld), DriveCommand::LetGo));
}

#[test]
fn ticks_that_were_missed_and_come_at_once_are_no_encoder_that_fails() {
    let mut bench = Bench::homed();
    bench.begin(Request::Jog { twist_speed_rad_per_s: 4.0 });
    bench.run(100);
    // The shaft has gone on by 0.4 rad; then ten ticks follow each other in no time, in which neither count moves.
    let stood = bench.sensors.as_ref().map(|sensors| sensors.shaft_rad * constants().counts_per_rad);
    let own = stood.expect("a shaft") as i64 + (0.4 * constants().counts_per_rad) as i64;
    bench.now_us += 90_000;
    bench.tamper = tamper(move |inputs| {
        let moved = (own - inputs.encoder_counts) as i32;
        reports(inputs, |_, position_qc, speed_rpm| (*position_qc, *speed_rpm) = (*position_qc + moved, 0));
        inputs.encoder_counts = own;
    });
    bench.run(10);
    assert_eq!(bench.rig.faults().iter().collect::<Vec<_>>(), [Fault::TickLate]);
}
