//! Every fault: it fires where it should, it stays until cleared, and a near miss stays quiet. The control code alone
//! against the emulated rig; `crates/rigctl/tests/faults.rs` plays the same on the emulated board.

use host_tests::{Desk, constants, table};
use rig_control::sensors::DriveReading;
use rig_control::supervisor::response::{Response, needs_homing, response};
use rig_control::{DriveCommand, Inputs, Rig as Control};
use rig_emulator::rig::faults::Fault as RigFault;
use rig_link::messages::{Constants, EventKind, Fault, Limit, LoadChoice, Parameter, Refusal, Request, State};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, OnceLock};

/// What happens to a rig that is moving.
type Happens = fn(&mut Desk);

/// A homed rig, 2 s into a slow move up.
fn moving() -> Desk {
    static DESK: OnceLock<Desk> = OnceLock::new();
    let desk = DESK.get_or_init(|| {
        let mut d = Desk::new(&[("load", "0.5kg"), ("twist_at_boot", "5")], 6);
        d.home().unwrap();
        d.tick(Some(Request::Move { target_m: 0.014, speed_m_per_s: 0.001, load: LoadChoice::Auto }));
        d.run(2.0);
        assert_eq!(d.control.state(), State::Moving);
        d
    });
    desk.clone()
}

fn tamper(d: &mut Desk, with: impl Fn(&mut Inputs) + Send + Sync + 'static) {
    d.tamper = Some(Arc::new(with));
}

/// For so many seconds, then no more.
fn tamper_for(d: &mut Desk, seconds: f64, with: impl Fn(&mut Inputs) + Send + Sync + 'static) {
    tamper(d, with);
    d.run(seconds);
    d.tamper = None;
}

fn rig_fault_for(d: &mut Desk, fault: RigFault, seconds: f64) {
    d.rig.set_fault(fault, true);
    d.run(seconds);
    d.rig.set_fault(fault, false);
}

/// Adds to the time from now on: the next tick comes that much late.
fn late_by(d: &mut Desk, late_us: u64) {
    tamper(d, move |i| i.now_us += late_us);
}

/// Every other tick so late, `count` times.
fn late_now_and_then(d: &mut Desk, late_us: u64, count: u32) {
    let ticks = AtomicU32::new(0);
    tamper(d, move |i| {
        let tick = ticks.fetch_add(1, Ordering::Relaxed);
        i.now_us += if tick.is_multiple_of(2) && tick < 2 * count { late_us } else { 0 };
    });
}

/// The encoder gains or loses counts from now on: `share` of all further ones.
fn encoder_slips(d: &mut Desk, share: f64) {
    let start = OnceLock::new();
    tamper(d, move |i| {
        let from = *start.get_or_init(|| i.encoder_counts);
        i.encoder_counts -= ((i.encoder_counts - from) as f64 * share) as i64;
    });
}

fn lvdt_mean(i: &mut Inputs, mean_code: f32) {
    if let Some(block) = &mut i.lvdt {
        block.mean_code = mean_code;
    }
}

fn drive_current(i: &mut Inputs, milliamps: i16) {
    if let DriveReading::Reports { current_ma, .. } = &mut i.drive {
        *current_ma = milliamps;
    }
}

/// Row of the list of faults to survive, the fault, within how many seconds, what causes it, and what nearly does.
const CASES: [(u8, Fault, f64, Happens, Happens); 22] = [
    (
        1,
        Fault::HostSilent,
        0.51,
        |d| d.host_alive = false,
        |d| {
            d.host_alive = false;
            d.run(0.25);
            d.host_alive = true;
        },
    ),
    (2, Fault::TickLate, 0.05, |d| late_by(d, 60_000), |d| late_by(d, 30_000)),
    (2, Fault::TickLate, 0.3, |d| late_now_and_then(d, 7000, 6), |d| late_now_and_then(d, 7000, 3)),
    (
        5,
        Fault::DriveSilent,
        0.1,
        |d| d.rig.set_fault(RigFault::CanSilent, true),
        |d| {
            rig_fault_for(d, RigFault::CanSilent, 0.03);
        },
    ),
    (5, Fault::CanBusOff, 0.02, |d| tamper(d, |i| i.bus_off = true), |d| rig_fault_for(d, RigFault::CanSilent, 0.03)),
    (
        5,
        Fault::DriveStartUp,
        5.0,
        |d| {
            *d = Desk::new(&[], 6);
            d.rig.set_fault(RigFault::CanSilent, true);
        },
        |d| {
            // It answers late.
            *d = Desk::new(&[], 6);
            rig_fault_for(d, RigFault::CanSilent, 2.4);
            assert!(d.until(4.0, |d| d.control.state() == State::Unhomed), "{:?}", d.control.fault());
        },
    ),
    (
        6,
        Fault::DriveStall,
        0.2,
        |d| d.rig.set_fault(RigFault::DriveStall, true),
        |d| {
            // At its current limit, as for a heavy load, but turning.
            tamper(d, |i| drive_current(i, 500));
        },
    ),
    (
        7,
        Fault::EncoderStuck,
        0.3,
        |d| d.rig.set_fault(RigFault::EncoderStuck, true),
        |d| {
            tamper_for(d, 0.04, {
                let at = OnceLock::new();
                move |i| i.encoder_counts = *at.get_or_init(|| i.encoder_counts)
            });
        },
    ),
    (
        7,
        Fault::EncoderJump,
        0.2,
        |d| d.rig.set_fault(RigFault::EncoderJump, true),
        |d| {
            tamper(d, |i| i.encoder_counts += 1000);
        },
    ),
    (
        7,
        Fault::EncoderJump,
        0.02,
        |d| tamper(d, |i| i.encoder_counts += 60_000),
        |d| {
            tamper(d, |i| i.encoder_counts -= 1000);
        },
    ),
    (7, Fault::EncoderDisagrees, 1.0, |d| encoder_slips(d, 0.2), |d| encoder_slips(d, 0.002)),
    (
        9,
        Fault::LvdtOpen,
        0.2,
        |d| d.rig.set_fault(RigFault::LvdtOpen, true),
        |d| {
            rig_fault_for(d, RigFault::LvdtOpen, 0.05);
        },
    ),
    (
        9,
        Fault::LvdtShort,
        0.2,
        |d| d.rig.set_fault(RigFault::LvdtShort, true),
        |d| {
            tamper_for(d, 0.05, |i| lvdt_mean(i, 4095.0));
        },
    ),
    (
        9,
        Fault::LvdtNoisy,
        0.3,
        |d| d.rig.set_fault(RigFault::LvdtNoisy, true),
        |d| {
            d.rig.set_plant("lvdt_noise", "0.4mm").unwrap();
        },
    ),
    (
        9,
        Fault::LvdtFrozen,
        0.6,
        |d| d.rig.set_fault(RigFault::LvdtFrozen, true),
        |d| {
            rig_fault_for(d, RigFault::LvdtFrozen, 0.2);
        },
    ),
    (
        9,
        Fault::LvdtStalled,
        0.3,
        |d| {
            tamper(d, |i| {
                if let Some(block) = &mut i.lvdt {
                    block.t_us = block.t_us.saturating_sub(60_000)
                }
            })
        },
        |d| {
            tamper_for(d, 0.06, |i| {
                if let Some(block) = &mut i.lvdt {
                    block.t_us = block.t_us.saturating_sub(60_000)
                }
            })
        },
    ),
    (
        10,
        Fault::StringBreak,
        1.0,
        |d| d.rig.set_fault(RigFault::StringBreak, true),
        |d| {
            d.rig.set_plant("load", "0.6kg").unwrap();
        },
    ),
    (
        11,
        Fault::FollowingError,
        4.0,
        |d| d.rig.set_plant("friction", "60N").unwrap(),
        |d| {
            d.rig.set_plant("friction", "0.3N").unwrap();
        },
    ),
    (
        14,
        Fault::NotFinite,
        0.2,
        |d| tamper(d, |i| lvdt_mean(i, f32::NAN)),
        |d| {
            tamper_for(d, 0.01, |i| lvdt_mean(i, f32::NAN));
        },
    ),
    (
        17,
        Fault::Supply,
        0.4,
        |d| d.rig.set_plant("supply_voltage", "15V").unwrap(),
        |d| {
            d.rig.set_plant("supply_voltage", "21V").unwrap();
        },
    ),
    (
        17,
        Fault::Supply,
        0.4,
        |d| d.rig.set_plant("supply_voltage", "30V").unwrap(),
        |d| {
            d.rig.set_plant("supply_voltage", "27V").unwrap();
        },
    ),
    (
        19,
        Fault::LimitSwitch,
        0.05,
        |d| d.rig.set_fault(RigFault::LimitSwitch, true),
        |d| {
            // One tick: contacts bounce.
            tamper(d, |i| i.upper_limit_open = true);
            d.tick(None);
            d.tamper = None;
        },
    ),
];

#[test]
fn each_fault_fires_and_stays_and_its_near_miss_is_quiet() {
    for (row, fault, within_s, cause, near_miss) in CASES {
        let mut d = moving();
        cause(&mut d);
        let start_s = d.time_s();
        assert!(d.until(within_s, |d| d.control.fault().is_some()), "row {row}: {fault} does not fire");
        assert_eq!(d.control.fault(), Some(fault), "row {row}");
        println!("row {row:2}: {fault:18} after {:.2} s", d.time_s() - start_s);
        assert!(d.events.iter().any(|(_, e)| *e == EventKind::FaultRaised(fault)));
        // The strings stop; whatever the motor's own fault is, they do not go on.
        d.run(0.5);
        let twist = d.truth().twist_rad;
        let silent = d.last.as_ref().is_some_and(|o| o.drive == DriveCommand::Silence);
        assert_eq!(silent, response(fault) == Response::Silence || fault == Fault::DriveStartUp, "{fault}");
        // The cause goes, the fault does not.
        d.host_alive = true;
        d.tamper = None;
        for (_, fault) in RigFault::all() {
            d.rig.set_fault(fault, false);
        }
        d.run(1.5);
        if response(fault) != Response::Silence && fault != Fault::StringBreak {
            let moved = (d.truth().twist_rad - twist).abs();
            assert!(moved < 0.1, "{fault}: the strings turn by {moved} rad in fault");
        }
        assert_eq!((d.control.state(), d.control.fault()), (State::Fault, Some(fault)), "row {row}");
        assert_eq!(d.tick(Some(Request::Home)).reply, Some(Err(Refusal::InFault { fault })));
        assert!(d.tick(Some(Request::Stop)).reply.is_some_and(|r| r.is_ok()), "stop is always taken");

        let mut d = moving();
        near_miss(&mut d);
        d.run(3.0);
        assert_eq!(d.control.fault(), None, "row {row}: the near miss of {fault}");
    }
}

#[test]
fn after_clear_nothing_moves_and_what_lost_the_position_is_homed_anew() {
    for (_, fault, within_s, cause, _) in CASES {
        // What the test below is about, and what does not come right by itself.
        if matches!(fault, Fault::StringBreak | Fault::DriveStartUp) {
            continue;
        }
        let mut d = moving();
        cause(&mut d);
        assert!(d.until(within_s, |d| d.control.fault() == Some(fault)), "{fault}: {:?}", d.control.fault());
        (d.host_alive, d.tamper) = (true, None);
        for (_, fault) in RigFault::all() {
            d.rig.set_fault(fault, false);
        }
        for (key, value) in [("supply_voltage", "24V"), ("friction", "0.05N"), ("load", "0.5kg")] {
            d.rig.set_plant(key, value).unwrap();
        }
        d.run(1.0);
        let reply = d.tick(Some(Request::Clear)).reply;
        assert!(reply.is_some_and(|r| r.is_ok()), "{fault}: {reply:?}");
        assert!(d.events.iter().any(|(_, e)| *e == EventKind::FaultCleared(fault)));
        let rest = if needs_homing(fault) { State::Unhomed } else { State::Ready };
        assert!(
            d.until(6.0, |d| d.control.state() == rest),
            "{fault}: {:?} {:?}",
            d.control.state(),
            d.control.fault()
        );
        d.run(1.0);
        assert_eq!(d.control.state(), rest, "{fault}: {:?}", d.control.fault());
        let go = Request::Move { target_m: 0.003, speed_m_per_s: 0.002, load: LoadChoice::Auto };
        let reply = d.tick(Some(go)).reply;
        let refused = reply == Some(Err(Refusal::NotHomed));
        assert_eq!(refused, needs_homing(fault), "{fault}: {reply:?}");
        if !refused {
            assert!(d.until(30.0, |d| d.control.state() != State::Moving));
            assert_eq!(d.control.state(), State::Holding, "{fault}: {:?}", d.control.fault());
        }
    }
}

#[test]
fn a_cause_that_is_still_there_cannot_be_cleared() {
    for (fault, cause) in [
        (Fault::LvdtOpen, (|d| d.rig.set_fault(RigFault::LvdtOpen, true)) as Happens),
        (Fault::Supply, |d| d.rig.set_plant("supply_voltage", "15V").unwrap()),
        (Fault::CanBusOff, |d| tamper(d, |i| i.bus_off = true)),
    ] {
        let mut d = moving();
        cause(&mut d);
        assert!(d.until(1.0, |d| d.control.fault() == Some(fault)), "{:?}", d.control.fault());
        assert_eq!(d.tick(Some(Request::Clear)).reply, Some(Err(Refusal::CauseRemains { fault })));
        assert_eq!(d.control.fault(), Some(fault));
    }
}

#[test]
fn a_start_that_was_no_power_up_waits_for_the_operator() {
    for fault in [Fault::WatchdogReset, Fault::UnexpectedReset, Fault::Panicked, Fault::SettingsCorrupt] {
        let mut d = Desk::with(Control::new(table(), constants(), Some(fault)), &[("twist_at_boot", "20")], 3);
        d.run(5.0);
        assert_eq!((d.control.state(), d.control.fault()), (State::Fault, Some(fault)));
        assert_eq!(d.last.as_ref().unwrap().drive, DriveCommand::Silence);
        assert_eq!(d.tick(Some(Request::Home)).reply, Some(Err(Refusal::InFault { fault })));
        assert!(d.tick(Some(Request::Clear)).reply.is_some_and(|r| r.is_ok()));
        assert!(d.until(6.0, |d| d.control.state() == State::Unhomed), "{fault}");
        assert_eq!(d.last.as_ref().unwrap().telemetry.twist_rad, None);
        d.run(1.0);
        let go = Request::Move { target_m: 0.003, speed_m_per_s: 0.002, load: LoadChoice::Auto };
        assert_eq!(d.tick(Some(go)).reply, Some(Err(Refusal::NotHomed)));
    }
    // By power or by hand: no fault, and nothing moves either.
    let mut d = Desk::new(&[], 3);
    assert!(d.until(6.0, |d| d.control.state() == State::Unhomed));
    assert_eq!(d.control.fault(), None);
}

#[test]
fn a_restarted_drive_is_noticed_by_its_silence_or_its_position() {
    let mut d = moving();
    d.rig.set_fault(RigFault::DriveReset, true);
    d.run(0.5);
    assert!(matches!(d.control.fault(), Some(Fault::DriveSilent | Fault::DriveReset)), "{:?}", d.control.fault());
    let mut d = moving();
    tamper(&mut d, |i| {
        if let DriveReading::Reports { position_qc, .. } = &mut i.drive {
            *position_qc = 50;
        }
    });
    d.run(0.02);
    assert_eq!(d.control.fault(), Some(Fault::DriveReset));
    // Near zero it is where it has been before, too: homing passes it all the time and no fault comes of it.
    let mut d = moving();
    tamper(&mut d, |i| {
        if let DriveReading::Reports { position_qc, .. } = &mut i.drive {
            *position_qc -= 1000;
        }
    });
    d.run(1.0);
    assert_eq!(d.control.fault(), None);
}

#[test]
fn the_first_readings_after_power_up_are_not_believed() {
    let mut d = Desk::new(&[], 1);
    tamper(&mut d, |i| {
        if i.now_us < 3_200_000 {
            lvdt_mean(i, 0.0)
        }
    });
    d.run(3.2);
    assert_eq!((d.control.state(), d.control.fault()), (State::Boot, None));
    d.run(0.1);
    assert_eq!(d.control.state(), State::Boot, "not at the first good one");
    assert!(d.until(2.0, |d| d.control.state() == State::Unhomed), "{:?}", d.control.fault());
    // A sensor that never comes is said, instead of waiting without a word.
    let mut d = Desk::new(&[], 1);
    d.rig.set_fault(RigFault::LvdtOpen, true);
    d.run(6.0);
    assert_eq!(d.control.fault(), Some(Fault::LvdtOpen));
    d.rig.set_fault(RigFault::LvdtOpen, false);
    d.run(0.2);
    assert!(d.tick(Some(Request::Clear)).reply.is_some_and(|r| r.is_ok()));
    assert!(d.until(6.0, |d| d.control.state() == State::Unhomed), "{:?}", d.control.fault());
}

#[test]
fn a_limit_switch_lets_the_load_only_move_away() {
    let mut d = moving();
    d.rig.set_fault(RigFault::LimitSwitch, true);
    assert!(d.until(0.1, |d| d.control.fault() == Some(Fault::LimitSwitch)));
    let at = d.true_position_m();
    d.run(1.0);
    assert!((d.true_position_m() - at).abs() < 0.2e-3);
    assert!(d.tick(Some(Request::Clear)).reply.is_some_and(|r| r.is_ok()));
    d.run(1.0);
    assert_eq!(d.control.state(), State::Ready, "at rest the open switch is known");
    // Away, with the switch still open.
    d.move_to((at - 1e-3) as f32, 0.002, LoadChoice::Auto).unwrap();
    // Back towards it.
    let reply =
        d.tick(Some(Request::Move { target_m: (at + 3e-3) as f32, speed_m_per_s: 0.002, load: LoadChoice::Auto }));
    assert!(reply.reply.is_some_and(|r| r.is_ok()));
    assert!(d.until(3.0, |d| d.control.fault() == Some(Fault::LimitSwitch)));
    assert!(d.true_position_m() < at, "{} past {at} m", d.true_position_m());
}

#[test]
fn the_twist_range_clips_and_outside_it_is_a_fault_with_the_way_back_free() {
    let mut d = moving();
    d.tick(Some(Request::Stop));
    assert!(d.until(5.0, |d| d.control.state() == State::Holding));
    let jog = |d: &mut Desk, twist_speed_rad_per_s| {
        assert!(d.tick(Some(Request::Jog { twist_speed_rad_per_s })).reply.is_some_and(|r| r.is_ok()));
    };
    jog(&mut d, 4.0);
    let clipped = |d: &Desk| d.last.as_ref().is_some_and(|o| o.telemetry.limit == Some(Limit::Travel));
    assert!(d.until(20.0, clipped));
    d.run(2.0);
    assert_eq!(d.control.fault(), None, "at the limit is not outside");
    d.tick(Some(Request::Stop));
    d.run(0.5);
    // The shaft is turned on by a hand: encoder and drive both see it.
    let at_s = d.time_s();
    tamper(&mut d, move |i| {
        let turned = ((i.now_us as f64 * 1e-6 - at_s) * 200_000.0).min(20_000.0);
        i.encoder_counts += turned as i64;
        if let DriveReading::Reports { position_qc, .. } = &mut i.drive {
            *position_qc += turned as i32;
        }
    });
    assert!(d.until(0.5, |d| d.control.fault() == Some(Fault::TwistRange)), "{:?}", d.control.fault());
    d.run(1.0);
    assert!(d.tick(Some(Request::Clear)).reply.is_some_and(|r| r.is_ok()));
    d.run(0.5);
    assert_eq!(d.control.state(), State::Ready, "{:?}", d.control.fault());
    let go = Request::Move { target_m: 0.003, speed_m_per_s: 0.002, load: LoadChoice::Auto };
    match d.tick(Some(go)).reply {
        Some(Err(Refusal::OutOfRange { parameter: Parameter::Twist, .. })) => {}
        other => panic!("{other:?}"),
    }
    jog(&mut d, -3.0);
    d.run(1.0);
    d.tick(Some(Request::Stop));
    d.run(0.5);
    assert_eq!(d.control.state(), State::Ready, "{:?}", d.control.fault());
}

#[test]
fn constants_are_not_changed_in_motion() {
    let constants = Constants {
        scene_hash: 1,
        geometry_m: [0.1; 4],
        string: [1.0; 5],
        twist_exponent: None,
        stress_coefficients_pa: [1e10; 5],
    };
    let mut d = moving();
    assert_eq!(d.tick(Some(Request::Rebuild(constants))).reply, Some(Err(Refusal::Busy { state: State::Moving })));
    assert!(!d.control.use_table(table()), "nor a table that was made meanwhile");
    d.tick(Some(Request::Stop));
    assert!(d.until(5.0, |d| d.control.state() == State::Holding));
    assert!(d.tick(Some(Request::Rebuild(constants))).reply.is_some_and(|r| r.is_ok()));
}

#[test]
fn an_encoder_that_counts_no_number_stops_the_rig() {
    let mut bad = constants();
    bad.counts_per_rad = 0.0;
    let mut d = Desk::with(Control::new(table(), bad, None), &[], 1);
    d.run(0.1);
    assert_eq!(d.control.fault(), Some(Fault::NotFinite));
    assert_eq!(d.last.as_ref().unwrap().drive, DriveCommand::Silence);
}

#[test]
fn the_emergency_stops_contact_is_told_both_ways() {
    let mut d = moving();
    d.rig.set_fault(RigFault::Estop, true);
    d.run(0.2);
    d.rig.set_fault(RigFault::Estop, false);
    d.run(0.2);
    d.rig.set_fault(RigFault::Estop, true);
    d.run(0.2);
    let stops: Vec<EventKind> = d
        .events
        .iter()
        .map(|(_, e)| *e)
        .filter(|e| matches!(e, EventKind::EStopOpened | EventKind::EStopClosed))
        .collect();
    assert_eq!(stops, [EventKind::EStopOpened, EventKind::EStopClosed, EventKind::EStopOpened]);
    assert_eq!(d.control.state(), State::EStop);
}

/// The page for the person at the bench says of every fault what the code does about it.
#[test]
fn every_fault_is_documented_and_the_table_is_what_the_code_does() {
    let page = std::fs::read_to_string(host_tests::root().join("docs/faults.md")).unwrap();
    for &fault in Fault::ALL {
        let told = match response(fault) {
            Response::Hold => "hold",
            Response::HoldByDrive => "hold by drive",
            Response::Silence => "silent",
        };
        let homing = if needs_homing(fault) { "yes" } else { "no" };
        let row = format!("| `{fault}` | {} | {told} | {homing} |", fault.code());
        assert!(page.contains(&row), "docs/faults.md lacks the row {row}");
        let entry = page.split("\n### ").find(|e| e.starts_with(&format!("`{fault}`\n")));
        let entry = entry.unwrap_or_else(|| panic!("docs/faults.md has no entry for {fault}"));
        for part in ["- **Means** ", "- **The rig** ", "- **Check** ", "- **Clear** "] {
            let text = entry.lines().find_map(|line| line.strip_prefix(part));
            assert!(text.is_some_and(|text| text.len() > 10), "{fault}: `{part}` is missing");
        }
    }
    let named = |line: &str| line.strip_prefix("### `").and_then(|rest| rest.strip_suffix('`')).map(String::from);
    for name in page.lines().filter_map(named) {
        assert!(Fault::from_name(&name).is_some(), "docs/faults.md explains {name}, which is no fault");
    }
    for &limit in Limit::ALL {
        assert!(page.contains(&format!("| `{limit}` |")), "docs/faults.md lacks the limit {limit}");
    }
}

/// A function or constant of a source file, from its name to its end.
fn item<'a>(source: &'a str, name: &str) -> Option<&'a str> {
    let start = [format!("\nfn {name}("), format!("\nconst {name}: ")].iter().find_map(|head| source.find(head))?;
    let end = ["\n}\n", "\n];\n"].iter().filter_map(|end| source[start..].find(end)).min()?;
    Some(&source[start..start + end])
}

/// Whether a cell of the table of tests names something that plays or tests the fault, or says why nothing can.
fn is_tested(cell: &str, fault: Fault, fires: bool) -> bool {
    let read = |path: &str| std::fs::read_to_string(host_tests::root().join(path)).unwrap_or_default();
    if let Some(reason) = cell.strip_prefix("not possible: ") {
        return reason.len() > 10;
    }
    let Some(named) = cell.strip_prefix('`').and_then(|rest| rest.split('`').next()) else { return false };
    if let Some((file, name)) = named.split_once("::") {
        let source = read(&format!("host-tests/tests/{file}.rs"));
        return item(&source, name).is_some_and(|body| body.contains(&format!("Fault::{fault:?}")));
    }
    let tests = read("crates/rigctl/tests/faults.rs");
    let played = |body: &str| body.contains(&format!("play(\"{named}\")"));
    // What fires stands in the list of the test that plays the script; what is near may be near in several ways.
    tests.split("\n#[test]\n").any(|body| played(body) && (!fires || body.contains(&format!(", \"{fault}\")"))))
}

#[test]
fn the_page_says_of_every_fault_where_it_is_tested() {
    let page = std::fs::read_to_string(host_tests::root().join("docs/faults.md")).unwrap();
    let (_, table) = page.split_once("## Where each is tested").unwrap();
    for &fault in Fault::ALL {
        let row = table.lines().find_map(|line| line.strip_prefix(&format!("| `{fault}` | ")));
        let row = row.unwrap_or_else(|| panic!("{fault} has no row"));
        let cells: Vec<&str> = row.trim_end_matches(" |").split(" | ").collect();
        assert_eq!(cells.len(), 3, "{fault}: {row}");
        for (k, cell) in cells.into_iter().enumerate() {
            assert!(is_tested(cell, fault, k < 2), "{fault}: {cell}");
        }
    }
    assert!(!is_tested("`faults-homed`", Fault::NotFinite, true) && !is_tested("", Fault::NotFinite, false));
}

/// Row 13. From a heavy load: from a light one the load falls so far behind its set-point that this is said first.
#[test]
fn a_load_beyond_the_table_stops_a_motion_but_not_a_rig_at_rest() {
    let heavy = |load: &str, then: &str, moves: bool| {
        let mut d = Desk::new(&[("load", load), ("twist_at_boot", "5")], 6);
        d.home().unwrap();
        if moves {
            d.tick(Some(Request::Move { target_m: 0.012, speed_m_per_s: 0.001, load: LoadChoice::Auto }));
            d.run(2.0);
        }
        d.rig.set_plant("load", then).unwrap();
        d.run(4.0);
        d
    };
    assert_eq!(heavy("1.7kg", "2.0kg", true).control.fault(), Some(Fault::LoadRange));
    assert_eq!(heavy("1.6kg", "1.75kg", true).control.fault(), None);
    // At rest weights are changed: it is only said.
    let d = heavy("1.7kg", "2.0kg", false);
    assert_eq!((d.control.state(), d.control.fault()), (State::Ready, None));
    assert_eq!(d.last.unwrap().telemetry.limit, Some(Limit::LoadRange));
}
