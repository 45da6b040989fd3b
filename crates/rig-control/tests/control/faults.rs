//! Faults of a rig whose every number is known: when each is raised, what the drive is told then, and what `clear` leads to.

use crate::bench::{Bench, Tamper, to};
use crate::fixture::{constants, table};
use rig_control::{Controller, DriveCommand, DriveReading, Inputs, TICK_US};
use rig_link::messages::{
    Accepted, Doubt, Doubts, EventKind, Fault, Limit, LoadChoice, Refusal, Request, Setting, State,
};
use std::f32::consts::TAU;
use std::sync::Arc;

pub fn tamper(change: impl Fn(&mut Inputs) + Send + Sync + 'static) -> Option<Tamper> {
    Some(Arc::new(change))
}

/// A homed rig that holds its load at 8 mm.
pub fn holding() -> Bench {
    let mut bench = Bench::homed();
    bench.move_to(0.008, 0.004);
    bench.run(50);
    bench.events.clear();
    bench
}

/// The fault that a change of what the control code sees leads to, and after how many ticks.
pub fn fault_of(change: impl Fn(&mut Inputs) + Send + Sync + 'static) -> Option<(u32, Fault)> {
    let mut bench = holding();
    bench.tamper = tamper(change);
    bench.ticks_until_fault(500)
}

pub fn reports(inputs: &mut Inputs, change: impl Fn(&mut u64, &mut i32, &mut i16)) {
    if let DriveReading::Reports { t_us, position_qc, speed_rpm, .. } = &mut inputs.drive {
        change(t_us, position_qc, speed_rpm);
    }
}

#[test]
fn strings_outside_their_range_are_a_fault_and_after_a_clear_only_the_way_back_is_free() {
    let mut bench = Bench::homed();
    bench.begin(Request::Jog { twist_speed_rad_per_s: 4.0 });
    while bench.shown().limit != Some(Limit::Travel) {
        bench.tick(None);
    }
    bench.ask(Request::Stop).expect("it jogs");
    bench.run(50);
    // All that the drive may draw has no strength against the hand that turns the strings to so far (rad) beyond their range.
    bench.drive_lag_s = f32::INFINITY;
    bench.tamper = tamper(|inputs| {
        if let DriveReading::Reports { current_ma, .. } = &mut inputs.drive {
            *current_ma = constants().current_limit_ma;
        }
    });
    let turned = |bench: &mut Bench, beyond_rad: f32| {
        let way_rad = table().metadata.twist_max_rad + beyond_rad - bench.twist_rad;
        for _ in 0..20 {
            bench.twist_rad += way_rad / 20.0;
            bench.tick(None);
        }
        bench.run(30);
        bench.rig.fault()
    };
    assert_eq!(turned(&mut bench, 0.25), None);
    assert_eq!(turned(&mut bench, 0.4), Some(Fault::TwistRange));
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
    // Where it was cleared counts like the end of the range, until the strings have come back from there.
    for beyond_rad in [0.65, 0.2, 0.45] {
        assert_eq!(turned(&mut bench, beyond_rad), None, "{beyond_rad} rad beyond");
    }
    assert_eq!(turned(&mut bench, 0.55), Some(Fault::TwistRange));
}

#[test]
fn without_a_gap_neither_position_nor_load_is_known() {
    let mut bench = holding();
    assert!(bench.shown().load_n.is_some() && bench.shown().doubts.is_empty());
    bench.tamper = tamper(|inputs| inputs.lvdt = None);
    bench.run(20);
    let shown = bench.shown();
    assert_eq!((shown.position_m, shown.load_n, shown.load_error_n, shown.tr_rad_per_m), (None, None, None, None));
    assert_eq!(shown.doubts, Doubts::of(&[Doubt::LoadUnknown]));
    bench.tamper = None;
    bench.run(1);
    assert!(bench.shown().load_n.is_some());
}

#[test]
fn each_fault_of_the_lvdt_is_raised_after_eight_ticks_without_a_gap() {
    let code = |mean_code: f32, variance: f32| {
        move |inputs: &mut Inputs| {
            if let Some(block) = &mut inputs.lvdt {
                (block.mean_code, block.variance) = (mean_code, variance);
            }
        }
    };
    assert_eq!(fault_of(code(0.0, 1.0)), Some((8, Fault::LvdtOpen)));
    assert_eq!(fault_of(code(4095.0, 1.0)), Some((8, Fault::LvdtShort)));
    assert_eq!(fault_of(code(2000.0, 400.0)), Some((8, Fault::LvdtNoisy)));
    assert_eq!(fault_of(|inputs| inputs.lvdt = None), Some((8, Fault::LvdtStalled)));
    let frozen = |inputs: &mut Inputs| {
        if let Some(block) = &mut inputs.lvdt {
            block.variance = 0.0;
        }
    };
    assert_eq!(
        fault_of(frozen),
        Some((37, Fault::LvdtFrozen)),
        "30 blocks, of which the last is the first bad reading"
    );
    // It is held, and nothing else is reported; when the sensor is back, the position is still known.
    let mut bench = holding();
    bench.tamper = tamper(code(0.0, 1.0));
    bench.run(50);
    assert_eq!(bench.events, [EventKind::FaultRaised(Fault::LvdtOpen)]);
    assert!(matches!(bench.command, DriveCommand::Follow { .. }));
    assert_eq!(bench.ask(Request::Clear), Err(Refusal::CauseRemains { fault: Fault::LvdtOpen }));
    bench.tamper = None;
    bench.tick(None);
    assert_eq!((bench.ask(Request::Clear), bench.rig.state()), (Ok(Accepted::Done), State::Ready));
    // A sensor that was never there is reported three seconds after the drive is.
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.tamper = tamper(|inputs| inputs.lvdt = None);
    let (ticks, fault) = bench.ticks_until_fault(500).expect("a fault");
    assert!(fault == Fault::LvdtStalled && (300..315).contains(&ticks), "{fault} after {ticks}");
}

#[test]
fn a_load_that_falls_is_a_broken_string_and_a_gap_that_steps_is_the_sensor() {
    let constants = constants();
    let from_us = holding().now_us;
    // Falls freely, or as far in fewer steps.
    let fall = |distance_m: fn(f32) -> f32, variance: f32| {
        fault_of(move |inputs| {
            let seconds = 1e-6 * (inputs.now_us - from_us) as f32;
            if let Some(block) = &mut inputs.lvdt {
                let gap_m = constants.lvdt_gap_m(block.mean_code) + distance_m(seconds);
                (block.mean_code, block.variance) = (constants.lvdt_mean_code(gap_m), variance);
            }
        })
    };
    // From 31 mm lower on even the heaviest load would turn back that is hung on suddenly.
    for variance in [1.0, 900.0] {
        let (ticks, fault) = fall(|seconds| 4.9 * seconds * seconds, variance).expect("a fault");
        assert!(fault == Fault::StringBreak && (8..=9).contains(&ticks), "{fault} after {ticks} ticks");
    }
    assert_eq!(fall(|seconds| 12e-3 * (1.0 - (15.0 * seconds).cos()), 1.0), None, "it turns back");
    // A millimetre and more in two ticks between calm ones; it is known three ticks later.
    assert_eq!(fall(|_| 1.1e-3, 1.0), Some((4, Fault::LvdtJump)));
    assert_eq!(fall(|_| -1.1e-3, 1.0), Some((4, Fault::LvdtJump)));
    assert_eq!(fall(|_| 5.5e-3, 1.0), Some((4, Fault::LvdtJump)), "no string breaks within one tick");
}

#[test]
fn late_ticks_are_a_fault_and_explain_what_looks_wrong_beside_them() {
    let mut bench = holding();
    bench.now_us += 51_000;
    bench.tick(None);
    assert_eq!(bench.events, [EventKind::FaultRaised(Fault::TickLate)]);
    bench.run(30);
    assert_eq!(bench.rig.late_ticks(), 1);
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
    // A pause that is announced is none.
    bench.run(10);
    bench.events.clear();
    bench.rig.pause();
    bench.now_us += 1_000_000;
    bench.run(10);
    assert!(bench.events.is_empty() && bench.rig.late_ticks() == 1, "{:?}", bench.events);
    bench.now_us += 6_000;
    bench.tick(None);
    assert_eq!((bench.rig.late_ticks(), bench.rig.fault()), (2, None));
}

#[test]
fn a_host_that_is_silent_matters_only_while_something_moves() {
    let mut bench = holding();
    bench.host_alive = false;
    bench.run(100);
    assert_eq!(bench.rig.fault(), None);
    bench.host_alive = true;
    bench.tick(Some(to(0.002, 0.001)));
    bench.host_alive = false;
    assert_eq!(bench.ticks_until_fault(100), Some((41, Fault::HostSilent)));
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.while_in(State::Boot);
    bench.begin(Request::HOME);
    bench.tamper = tamper(|inputs| inputs.host_heard_us = None);
    assert_eq!(bench.ticks_until_fault(100), Some((1, Fault::HostSilent)));
}

#[test]
fn limit_switches_stop_the_load_and_free_only_the_way_back() {
    for upper in [true, false] {
        let open = move |inputs: &mut Inputs| {
            (inputs.upper_limit_open, inputs.lower_limit_open) = (upper, !upper);
        };
        assert_eq!(fault_of(open), Some((2, Fault::LimitSwitch)));
        let mut bench = holding();
        bench.tamper = tamper(open);
        bench.run(40);
        assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
        bench.run(40);
        assert_eq!(bench.rig.fault(), None, "it stays open");
        let back_m = if upper { 0.006 } else { 0.010 };
        bench.move_to(back_m, 0.002);
        let onwards = to(0.016 - back_m, 0.002);
        bench.begin(onwards);
        assert_eq!(bench.ticks_until_fault(200).map(|(_, fault)| fault), Some(Fault::LimitSwitch));
    }
}

#[test]
fn a_switch_that_was_cleared_open_stays_so_when_gaps_mean_something_else() {
    for (upper, offset_m) in [(true, -1e-3), (false, 1e-3)] {
        let mut bench = holding();
        bench.tamper = tamper(move |inputs| {
            (inputs.upper_limit_open, inputs.lower_limit_open) = (upper, !upper);
        });
        bench.run(40);
        assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
        // By the new offset the load seems to be 1 mm farther on.
        let set = Request::SetSetting { setting: Setting::LvdtOffset, value: offset_m };
        assert_eq!(bench.ask(set), Ok(Accepted::Unhomed));
        assert_eq!(bench.ticks_until_fault(50), None);
    }
}

#[test]
fn a_load_that_lies_at_a_switch_when_the_rig_is_switched_on_is_jogged_away_from_it() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.tamper = tamper(|inputs| inputs.lower_limit_open = true);
    bench.while_in(State::Boot);
    assert_eq!((bench.run(5), bench.rig.fault()), ((), Some(Fault::LimitSwitch)));
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
    bench.begin(Request::Jog { twist_speed_rad_per_s: 2.0 });
    bench.run(500);
    assert!(bench.rig.fault().is_none() && bench.twist_rad > 12.0, "{:?} {}", bench.rig.fault(), bench.twist_rad);
}

#[test]
fn a_damaged_table_is_a_fault_from_the_start_that_nothing_clears() {
    let mut damaged = *table();
    damaged.crc ^= 1;
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.rig = Controller::new(&damaged, constants(), None);
    bench.tick(None);
    assert_eq!((bench.rig.state(), bench.rig.fault()), (State::Fault, Some(Fault::TableCorrupt)));
    assert_eq!(bench.ask(Request::Clear), Err(Refusal::CauseRemains { fault: Fault::TableCorrupt }));
    assert!(bench.ask(Request::HOME).is_err());
}

#[test]
fn a_shaft_that_does_not_follow_is_a_fault_after_three_tenths_of_a_second() {
    let mut bench = Bench::homed();
    bench.begin(to(0.010, 0.004));
    bench.closed_at_rad = bench.twist_rad + 1.0;
    // Meanwhile the drive is sent no farther from its place than a radian and the way of 0.3 s.
    let mut farthest = 0f32;
    for _ in 0..300 {
        bench.tick(None);
        if let (DriveCommand::Follow { position_qc, .. }, Some(drive_rad)) =
            (bench.command, bench.sensors.as_ref().and_then(|sensors| sensors.drive_rad))
        {
            farthest = farthest.max(position_qc as f32 / bench.constants.counts_per_rad - drive_rad);
        }
        if bench.rig.fault().is_some() {
            break;
        }
    }
    assert_eq!(bench.rig.fault(), Some(Fault::FollowingError));
    assert!((1.5..1.0 + 0.3 * bench.constants.twist_speed_max()).contains(&farthest), "{farthest} rad");
    let to = to(0.002, 0.004);
    assert_eq!(bench.ask(to), Err(Refusal::InFault { fault: Fault::FollowingError }));
    // It is held where it stands.
    bench.run(50);
    assert!(matches!(bench.command, DriveCommand::Follow { .. }) && bench.rig.faults().iter().count() == 1);
}

/// A shaft that is behind a set-point which has come to rest still has to turn. After a fault it may be what turns wrongly.
#[test]
fn the_drives_speed_limit_outlasts_the_set_points_speed_but_not_in_a_fault() {
    let limit_rpm = |bench: &Bench| match bench.command {
        DriveCommand::Follow { speed_limit_rpm, .. } => speed_limit_rpm,
        other => panic!("{other:?}"),
    };
    let fast = || {
        let mut bench = Bench::homed();
        bench.begin(to(0.010, 0.02));
        bench.run(60);
        bench
    };
    let least_rpm = constants().motor_rpm(1.0);
    let mut bench = fast();
    let moving_rpm = limit_rpm(&bench);
    bench.ask(Request::Stop).expect("it stops");
    bench.while_in(State::Moving);
    let stopped_rpm = limit_rpm(&bench);
    let outlasts = (least_rpm + 200..moving_rpm).contains(&stopped_rpm);
    assert!(outlasts, "{least_rpm} {stopped_rpm} {moving_rpm}");
    bench.run(200);
    assert!(limit_rpm(&bench) < least_rpm + 50, "{}", limit_rpm(&bench));
    let mut bench = fast();
    bench.tamper = tamper(|inputs| inputs.upper_limit_open = true);
    bench.ticks_until_fault(10).expect("a fault");
    assert_eq!(limit_rpm(&bench), least_rpm);
}

#[test]
fn a_load_that_stays_behind_its_set_point_is_a_fault_after_three_tenths_of_a_second() {
    let mut bench = holding();
    // The rail is blocked.
    bench.friction_n = 100.0;
    bench.begin(to(0.002, 0.004));
    let (ticks, fault) = bench.ticks_until_fault(600).expect("a fault");
    // 2 mm at 4 mm/s after the rise to that speed, and 0.3 s.
    assert!(fault == Fault::FollowingError && (85..100).contains(&ticks), "{fault} after {ticks}");
}

/// A rig that holds its load at 8 mm while its strings slip: a fraction of the twist no longer shortens them.
fn slipped(fraction: f32) -> Bench {
    let mut bench = holding();
    for k in 1..=300u16 {
        bench.twist_scale = 1.0 - fraction * f32::from(k) / 300.0;
        bench.tick(None);
    }
    bench.run(100);
    bench
}

fn goes(bench: &mut Bench, target_m: f32, speed_m_per_s: f32) -> Option<Fault> {
    bench.ask(Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto }).expect("it can");
    bench.while_in(State::Moving);
    bench.run(5);
    bench.rig.fault()
}

#[test]
fn strings_that_are_no_longer_those_of_homing_are_a_fault_after_two_moves() {
    let mut bench = slipped(0.1);
    assert_eq!(goes(&mut bench, 0.001, 0.0015), None);
    assert_eq!(goes(&mut bench, 0.012, 0.0015), Some(Fault::ModelResidual));
    bench.run(50);
    assert_eq!(bench.rig.faults().iter().count(), 1, "it is raised once");
    assert!(matches!(bench.command, DriveCommand::Follow { .. }), "the shaft is held");
    // The way out of it is to home again.
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
    assert_eq!(bench.rig.state(), State::Unhomed);
}

#[test]
fn a_slip_that_looks_like_a_load_that_changes_is_told_as_a_load_that_is_not_known() {
    let mut bench = slipped(0.2);
    for target_m in [0.001, 0.012, 0.001, 0.012] {
        assert_eq!(goes(&mut bench, target_m, 0.004), None);
        assert_eq!(bench.shown().doubts, Doubts::of(&[Doubt::LoadUnknown]), "{:?}", bench.shown());
    }
}

#[test]
fn a_held_shaft_that_turns_is_let_go_once() {
    let mut bench = holding();
    bench.tamper = tamper(|inputs| inputs.bus_off = true);
    bench.tick(None);
    assert_eq!(bench.rig.fault(), Some(Fault::CanBusOff));
    // The shaft turns by 0.9 rad in nine ticks although it is held; the drive says the same.
    let from_us = bench.now_us;
    let a_tick = (0.1 * bench.constants.counts_per_rad) as i32;
    bench.tamper = tamper(move |inputs| {
        let counts = a_tick * ((inputs.now_us - from_us) / TICK_US).min(9) as i32;
        inputs.encoder_counts += i64::from(counts);
        reports(inputs, |_, position_qc, _| *position_qc += counts);
    });
    while !bench.rig.faults().contains(Fault::NotHeld) && bench.now_us < from_us + 2_000_000 {
        bench.tick(None);
    }
    assert_eq!((bench.now_us - from_us) / TICK_US, 16, "eight after 0.8 rad");
    assert_eq!((bench.command, bench.rig.fault()), (DriveCommand::PowerOff, Some(Fault::NotHeld)));
    bench.tamper = None;
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
    assert_eq!((bench.command, bench.rig.state()), (DriveCommand::RestartOpenLoop, State::Boot));
    bench.while_in(State::Boot);
    assert_eq!(bench.rig.state(), State::Unhomed);
}

#[test]
fn nothing_is_cleared_while_a_held_shaft_turns() {
    let mut bench = holding();
    bench.host_alive = false;
    bench.tick(Some(to(0.002, 0.004)));
    bench.ticks_until_fault(100).expect("the host is silent");
    bench.host_alive = true;
    assert_eq!(bench.ask(Request::Clear), Err(Refusal::ShaftTurns));
    bench.run(35);
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
    assert_eq!(bench.rig.state(), State::Ready);
    bench.move_to(0.006, 0.002);
    // A drive that says that the motor stands is not enough: the own encoder turns by 60 rpm of it.
    let counts_per_s = constants().counts_per_rad * TAU / constants().gear_ratio;
    let from_us = bench.now_us;
    bench.tamper = tamper(move |inputs| {
        let turned_s = 1e-6 * (inputs.now_us - from_us) as f32;
        inputs.encoder_counts += (turned_s * counts_per_s) as i64;
        inputs.bus_off = turned_s < 0.015;
    });
    bench.run(25);
    assert_eq!(bench.rig.fault(), Some(Fault::CanBusOff));
    assert_eq!(bench.ask(Request::Clear), Err(Refusal::ShaftTurns));
}

#[test]
fn a_load_beyond_the_table_is_a_fault_at_the_heavy_end_and_later_at_the_light_one() {
    for (load_n, ticks) in [(20.0f32, 30..500), (0.1, 300..400)] {
        let mut bench = Bench::new(if load_n > 5.0 { 10.0 } else { 1.5 }, 0.0, 9.0);
        bench.home();
        bench.move_to(0.004, 0.004);
        bench.load_n = load_n;
        let found = bench.ticks_until_fault(600);
        println!("{load_n} {found:?} {:?}", bench.shown());
        let (took, fault) = found.expect("a fault");
        assert!(fault == Fault::LoadRange && ticks.contains(&took), "{load_n} N: {fault} after {took}");
    }
}

#[test]
fn the_emergency_stop_takes_power_and_position_away() {
    let mut bench = holding();
    bench.tamper = tamper(|inputs| inputs.estop_open = true);
    bench.tick(None);
    assert_eq!((bench.rig.state(), bench.command), (State::EStop, DriveCommand::PowerOff));
    assert_eq!(bench.ask(Request::Clear), Err(Refusal::EStop));
    assert_eq!(bench.ask(Request::HOME), Err(Refusal::EStop));
    assert!(bench.rig.homed().is_none());
    bench.tamper = None;
    bench.tick(None);
    assert_eq!(bench.command, DriveCommand::LetGo, "once");
    bench.tick(None);
    assert_eq!((bench.command, bench.rig.state()), (DriveCommand::PowerOff, State::EStop));
    assert_eq!(bench.events, [EventKind::EStopOpened, EventKind::EStopClosed]);
    // Opened again, and closed for one tick only before it opens a third time.
    for (open, command) in
        [(true, DriveCommand::PowerOff), (false, DriveCommand::LetGo), (true, DriveCommand::PowerOff)]
    {
        bench.tamper = tamper(move |inputs| inputs.estop_open = open);
        bench.tick(None);
        assert_eq!((bench.command, bench.rig.state()), (command, State::EStop));
    }
    assert_eq!(bench.events[2..], [EventKind::EStopOpened, EventKind::EStopClosed, EventKind::EStopOpened]);
    bench.tamper = None;
    bench.tick(None);
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
    assert_eq!((bench.command, bench.rig.state()), (DriveCommand::RestartOpenLoop, State::Boot), "it begins again");
    bench.while_in(State::Boot);
    assert_eq!(bench.rig.state(), State::Unhomed);
}

#[test]
fn on_a_wrong_clock_nothing_is_sent_to_the_drive() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.rig = Controller::new(table(), constants(), Some(Fault::ClockSource));
    for _ in 0..10 {
        bench.tick(None);
        assert_eq!(bench.command, DriveCommand::Silence);
    }
    assert_eq!(bench.ask(Request::Clear), Err(Refusal::CauseRemains { fault: Fault::ClockSource }));
}

#[test]
fn an_own_encoder_that_fails_after_another_fault_leaves_the_load_held_by_the_drive() {
    let mut bench = holding();
    bench.tamper = tamper(|inputs| inputs.lvdt = None);
    bench.ticks_until_fault(20).expect("no gap");
    let held_rad = bench.twist_rad;
    let jump = (2.0 * bench.constants.counts_per_rad) as i64;
    bench.tamper = tamper(move |inputs| {
        inputs.lvdt = None;
        inputs.encoder_counts += jump;
    });
    bench.run(50);
    assert!(bench.rig.faults().contains(Fault::EncoderJump) && !bench.rig.faults().contains(Fault::NotHeld));
    assert!(matches!(bench.command, DriveCommand::Follow { .. }), "{:?}", bench.command);
    assert!((bench.twist_rad - held_rad).abs() < 0.1, "from {held_rad} to {} rad", bench.twist_rad);
}

#[test]
fn after_a_fault_and_an_emergency_stop_nothing_is_held_so_clear_waits_for_nothing() {
    let mut bench = holding();
    bench.tamper = tamper(|inputs| inputs.lvdt = None);
    bench.ticks_until_fault(20).expect("no gap");
    bench.tamper = tamper(|inputs| inputs.estop_open = true);
    bench.run(2);
    // The load turns the shaft.
    bench.tamper = tamper(|inputs| inputs.encoder_counts += (inputs.now_us / 100) as i64);
    bench.run(50);
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
}
