//! The rig against the vendor's rules for the drive, and against the solver for the mechanism.

use super::hung::CLOSED_GIVE_RAD;
use super::*;
use crate::RigFault;
use crate::bench::{address, scene, settings};
use crate::board::{Board, CanFrame, CanOutcome};
use rmds405::serial::{BYTE_US, Decoder};
use rmds405::{Command, CurrentLimit, Milliamps, Mode, QuadCounts, Report, Rpm, SpeedLimit};
use rmds405::{Received, serial};

/// A rig whose motor-power relay is on since power-up.
fn rig(keys: &[(&str, &str)]) -> EmulatedRig {
    let mut rig = EmulatedRig::new(scene(), settings(keys), 1).unwrap_or_else(|e| panic!("{e}"));
    rig.gpio_out(0.0, 'B', 1 << 10);
    rig
}

fn send(rig: &mut EmulatedRig, t_s: f64, command: Command) -> CanOutcome {
    let frame = command.encode(address());
    rig.can_tx(t_s, &CanFrame { id: frame.id.into(), extended: false, remote: false, dlc: 8, data: frame.data })
}

/// What the drive says until `t_s`.
pub(super) fn listen(rig: &mut EmulatedRig, t_s: f64) -> Vec<Report> {
    let own = address();
    let reports = rig.poll(t_s).into_iter().filter_map(|stimulus| match stimulus {
        Stimulus::Can(f) => {
            Report::decode(own, &Received { id: f.id, extended: f.extended, remote: false, data: &f.data }).ok()
        }
        _ => None,
    });
    reports.collect()
}

fn hold(position: i32) -> Command {
    Command::CurrentVelocityPosition {
        current_limit: CurrentLimit::new(500).unwrap_or_else(|e| panic!("{e}")),
        speed_limit: SpeedLimit::new(6000).unwrap_or_else(|e| panic!("{e}")),
        position: QuadCounts(position),
    }
}

/// Through Reset, mode and feedback, each with its 500 ms; holding from about 1.1 s.
pub(super) fn start(rig: &mut EmulatedRig) -> f64 {
    send(rig, 0.55, Command::ChooseMode(Mode::CurrentVelocityPosition));
    send(rig, 1.06, Command::Config { motion_ms: 10, mixed_ms: 0 });
    let counts = rig.drive_counts() - rig.boot_counts;
    send(rig, 1.07, hold(counts as i32));
    1.08
}

#[test]
fn an_un_moded_drive_takes_no_data_and_reports_nothing() {
    let mut r = rig(&[]);
    send(&mut r, 0.1, Command::ChooseMode(Mode::CurrentVelocity));
    assert_eq!(r.drive.mode(), None, "not within 500 ms of power-up");
    send(&mut r, 0.6, Command::Config { motion_ms: 10, mixed_ms: 0 });
    send(&mut r, 0.61, hold(1000));
    assert!(listen(&mut r, 1.0).iter().all(|report| !matches!(report, Report::Motion { .. })));
    send(&mut r, 1.0, Command::OnlineCheck);
    assert_eq!(listen(&mut r, 1.01), [Report::Online]);
    send(&mut r, 1.1, Command::ChooseMode(Mode::CurrentVelocityPosition));
    assert_eq!(r.drive.mode(), Some(Mode::CurrentVelocityPosition));
    let reports = listen(&mut r, 2.6);
    // It takes its 500 ms, then reports every 10 ms.
    assert!((95..=105).contains(&reports.len()), "{} reports in 1 s", reports.len());
}

#[test]
fn a_frame_of_another_mode_is_an_error_and_changes_nothing() {
    let mut r = rig(&[]);
    let t = start(&mut r);
    let before = r.drive.counters.error_beeps;
    let stranger = Command::CurrentVelocity {
        current_limit: CurrentLimit::new(500).unwrap_or_else(|e| panic!("{e}")),
        speed: Rpm(3000),
    };
    send(&mut r, t, stranger);
    send(&mut r, t + 0.01, Command::ChooseMode(Mode::Velocity));
    assert_eq!(r.drive.counters.error_beeps, before + 2);
    assert_eq!(r.drive.mode(), Some(Mode::CurrentVelocityPosition));
}

#[test]
fn the_drive_runs_on_its_last_command_for_ever_and_reset_forgets_the_position() {
    let mut r = rig(&[("twist_at_boot", "4")]);
    let t = start(&mut r);
    let target = r.truth().twist_rad + 10.0;
    let counts = (10.0 * 62.0 * 4096.0 / std::f64::consts::TAU) as i64;
    let now = r.drive_counts() - r.boot_counts;
    send(&mut r, t, hold((now + counts) as i32));
    r.poll(t + 20.0);
    assert!((r.truth().twist_rad - target).abs() < 0.5, "{} for {target}", r.truth().twist_rad);
    r.poll(t + 60.0);
    assert!((r.truth().twist_rad - target).abs() < 0.5, "no command for a minute, and it holds");
    let before = r.truth();
    send(&mut r, t + 60.0, Command::Reset);
    assert_eq!(r.drive.mode(), None);
    r.poll(t + 62.0);
    let after = r.truth();
    assert!(after.twist_rad < before.twist_rad - 0.5, "torque-off lets the strings untwist");
    assert!(after.gap_m > before.gap_m + 0.1e-3, "and the load drops");
}

#[test]
fn the_drives_speed_comes_in_whole_counts_of_a_millisecond() {
    let mut r = rig(&[("twist_at_boot", "4")]);
    let t = start(&mut r);
    let now = r.drive_counts() - r.boot_counts;
    send(&mut r, t, hold((now + 400_000) as i32));
    for report in listen(&mut r, t + 3.0) {
        if let Report::Motion { speed: Rpm(rpm), .. } = report {
            // 60 000/4096 rpm for one count, rounded to whole rpm on the wire (docs/reference/hardware.md 1).
            let quanta = f64::from(rpm) * 4096.0 / 60_000.0;
            assert!((quanta - quanta.round()).abs() < 0.06, "{rpm} rpm");
        }
    }
}

#[test]
fn at_rest_the_plant_is_the_solver() {
    const LOADS_KG: [f64; 3] = [0.1, 0.5, 1.5];
    let twists = [0.3, 2.0, 3.2, 12.0, -30.0, 48.0];
    for (k, twist_rad) in twists.into_iter().enumerate() {
        let load_n = 9.80665 * LOADS_KG[k % 3];
        let r = rig(&[("load", &load_n.to_string()), ("twist_at_boot", &twist_rad.to_string()), ("friction", "0")]);
        let exact = |load_n, twist_rad: f64| {
            let mechanism = r.mechanism.as_ref().expect("built in");
            mechanism.solve(load_n, twist_rad).unwrap_or_else(|e| panic!("{e}")).gap_m
        };
        let error = r.truth().gap_m - exact(load_n, r.truth().twist_rad);
        assert!(error.abs() < 1e-6, "{load_n} N at {twist_rad} rad: {error} m");
        // The surface that it hangs from, under the other loads.
        for load_n in LOADS_KG.map(|load_kg| 9.80665 * load_kg) {
            let gap_m = r.plant.built_in().expect("built in").surface.gap(twist_rad, load_n).gap_m;
            assert!((gap_m - exact(load_n, twist_rad)).abs() < 1e-6, "{load_n} N at {twist_rad} rad: {gap_m} m");
        }
    }
}

#[test]
fn a_load_that_is_let_go_swings_and_comes_to_rest() {
    let mut r = rig(&[("load", "1kg"), ("twist_at_boot", "20"), ("friction", "0"), ("damping", "0.2")]);
    start(&mut r);
    r.poll(3.0);
    let rest = r.truth().gap_m;
    r.set_plant("load", "1.2kg").unwrap_or_else(|e| panic!("{e}"));
    let mut oscillations = Vec::new();
    let mut last_speed = 0.0;
    for k in 1..=4000 {
        r.poll(3.0 + 1e-3 * f64::from(k));
        let truth = r.truth();
        if last_speed > 0.0 && truth.gap_speed_m_per_s <= 0.0 {
            oscillations.push(truth.gap_m);
        }
        last_speed = truth.gap_speed_m_per_s;
    }
    assert!(oscillations.len() >= 3, "{} swings", oscillations.len());
    assert!(oscillations.windows(2).all(|pair| pair[1] < pair[0]), "a swing grew: {oscillations:?}");
    let exact = r
        .mechanism
        .as_ref()
        .expect("built in")
        .solve(1.2 * 9.80665, r.truth().twist_rad)
        .unwrap_or_else(|e| panic!("{e}"));
    r.poll(12.0);
    assert!((r.truth().gap_m - exact.gap_m).abs() < 20e-6 && r.truth().gap_m > rest);
}

#[test]
fn backlash_is_turned_through_before_the_strings_follow_on_the_other_side() {
    let oscillation = |backlash: &str| {
        let mut r = rig(&[("load", "0.1kg"), ("twist_at_boot", "2"), ("gear_backlash", backlash)]);
        let t = start(&mut r);
        let here = r.drive_counts() - r.boot_counts;
        r.poll(t + 1.0);
        let from = (r.motor.angle_rad, r.truth().twist_rad);
        // Across zero twist, where the strings pull to the other side.
        send(&mut r, t + 1.0, hold((here - 4 * 40_416) as i32));
        r.poll(t + 5.0);
        (from.0 - r.motor.angle_rad, from.1, r.truth().twist_rad)
    };
    let (turned, from, to) = oscillation("0.1");
    assert!(from > 0.1 && to < -1.0, "{from} to {to} rad");
    assert!((turned / 62.0 - (from - to) - 0.1).abs() < 1e-9, "the shaft turned by the play more than the strings");
    let (turned, from, to) = oscillation("0");
    assert!((turned / 62.0 - (from - to)).abs() < 1e-9);
}

#[test]
fn the_supply_bounds_the_motors_speed() {
    let fastest = |supply: &str| {
        let mut r = rig(&[("twist_at_boot", "4"), ("supply_voltage", supply)]);
        let t = start(&mut r);
        let now = r.drive_counts() - r.boot_counts;
        let far = Command::CurrentVelocityPosition {
            current_limit: CurrentLimit::new(500).unwrap_or_else(|e| panic!("{e}")),
            speed_limit: SpeedLimit::new(12_000).unwrap_or_else(|e| panic!("{e}")),
            position: QuadCounts((now + 1_500_000) as i32),
        };
        send(&mut r, t, far);
        r.poll(t + 1.0);
        let truth = r.truth();
        // Back-EMF and the winding's drop make up the supply.
        let parameters = &r.parameters;
        let volts = parameters.motor_torque_constant_nm_per_a * truth.motor_speed_rad_per_s
            + parameters.motor_resistance_ohm * truth.motor_current_a;
        (truth.motor_speed_rad_per_s, volts)
    };
    for (supply, volts) in [("24V", 24.0), ("18V", 18.0), ("12V", 12.0)] {
        let (speed, seen) = fastest(supply);
        assert!((seen - volts).abs() < 0.05, "{supply}: {seen} V at {speed} rad/s");
        assert!(speed < volts / 0.0229, "{supply}: {speed} rad/s");
    }
}

#[test]
fn friction_holds_a_load_that_is_nearly_balanced() {
    let mut r = rig(&[("load", "5N"), ("twist_at_boot", "20"), ("friction", "0.3")]);
    start(&mut r);
    r.poll(3.0);
    let rest = r.truth().gap_m;
    // It sank to where it hangs while the drive started, so friction already carries it: less load, not more.
    r.set_plant("load", "4.8N").unwrap_or_else(|e| panic!("{e}"));
    r.poll(5.0);
    assert_eq!(r.truth().gap_m, rest, "0.2 N less does not lift it against 0.3 N");
    r.set_plant("load", "6N").unwrap_or_else(|e| panic!("{e}"));
    r.poll(7.0);
    assert!(r.truth().gap_m > rest + 0.2e-3, "1 N more does");
}

#[test]
fn a_shorted_bus_and_a_silent_drive_are_told_apart() {
    let mut r = rig(&[]);
    let t = start(&mut r);
    // What was on its way when the drive fell silent still arrives.
    listen(&mut r, t + 0.002);
    r.set_fault(RigFault::CanSilent, true);
    assert_eq!(send(&mut r, t, Command::OnlineCheck), CanOutcome::Unacknowledged);
    assert!(listen(&mut r, t + 0.1).is_empty());
    r.set_fault(RigFault::CanSilent, false);
    r.set_fault(RigFault::CanBusOff, true);
    assert_eq!(send(&mut r, t + 0.1, Command::OnlineCheck), CanOutcome::BitError);
    r.set_fault(RigFault::CanBusOff, false);
    assert_eq!(send(&mut r, t + 0.2, Command::OnlineCheck), CanOutcome::Acknowledged);
}

/// A command on the serial line, its last byte ending at `t_s`.
fn send_bytes(rig: &mut EmulatedRig, t_s: f64, command: Command) {
    let bytes = serial::encode(&command.encode(address()));
    for (k, byte) in bytes.into_iter().enumerate() {
        rig.uart_tx(t_s - 1e-6 * (9 - k) as f64 * BYTE_US as f64, 1, byte);
    }
}

/// What the drive says on the serial line until `t_s`; anything else it says is an error.
fn listen_bytes(rig: &mut EmulatedRig, t_s: f64) -> Vec<Report> {
    let mut decoder = Decoder::reports();
    let mut found = Vec::new();
    let mut now_us = 0;
    for stimulus in rig.poll(t_s) {
        match stimulus {
            Stimulus::Uart { usart: 1, bytes } => {
                for byte in bytes {
                    now_us += BYTE_US;
                    found.extend(decoder.push(now_us, byte));
                }
            }
            Stimulus::Pin { .. } => {}
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(decoder.foreign(), 0);
    found
}

#[test]
fn the_transport_that_was_used_first_wins_until_a_restart() {
    let mut r = rig(&[]);
    send_bytes(&mut r, 0.6, Command::OnlineCheck);
    assert_eq!(listen_bytes(&mut r, 0.61), [Report::Online]);
    // Acknowledged by its controller, heard by nobody.
    assert_eq!(send(&mut r, 0.62, Command::ChooseMode(Mode::Velocity)), CanOutcome::Acknowledged);
    assert_eq!((r.drive.mode(), r.drive.counters.ignored), (None, 1));
    send_bytes(&mut r, 0.63, Command::ChooseMode(Mode::CurrentVelocityPosition));
    assert_eq!(r.drive.mode(), Some(Mode::CurrentVelocityPosition));
    send_bytes(&mut r, 1.2, Command::Config { motion_ms: 10, mixed_ms: 0 });
    let reports = listen_bytes(&mut r, 2.2);
    assert!((95..=105).contains(&reports.len()), "{} reports in 1 s", reports.len());
    r.set_fault(RigFault::CanSilent, true);
    listen_bytes(&mut r, 2.21);
    send_bytes(&mut r, 2.3, Command::Reset);
    assert!(listen_bytes(&mut r, 2.4).is_empty());
    assert!(r.drive.mode().is_some(), "the line is cut both ways");
    r.set_fault(RigFault::CanSilent, false);
    send_bytes(&mut r, 2.5, Command::Reset);
    assert_eq!(r.drive.mode(), None);
    send(&mut r, 3.1, Command::OnlineCheck);
    assert_eq!(listen(&mut r, 3.11), [Report::Online]);
    send_bytes(&mut r, 3.2, Command::OnlineCheck);
    assert!(listen(&mut r, 3.3).is_empty());
}

#[test]
fn a_rig_without_a_bus_cannot_have_it_shorted() {
    let mut scene = scene().clone();
    scene.rig.drive_transport = rig_config::DriveTransport::Uart;
    let mut r = EmulatedRig::new(&scene, PlantSettings::default(), 1).unwrap_or_else(|e| panic!("{e}"));
    let refused = r.try_fault(RigFault::CanBusOff, true).expect_err("no bus").to_string();
    assert!(refused.contains("can-bus-off") && refused.contains("drive_transport"), "{refused}");
    assert_eq!(r.try_fault(RigFault::CanSilent, true), Ok(()));
    assert_eq!(rig(&[]).try_fault(RigFault::CanBusOff, true), Ok(()));
}

#[test]
fn sensors_show_what_they_should_and_their_faults() {
    let mut r = rig(&[("lvdt_noise", "0")]);
    let expected = r.truth().gap_m / 0.2 * 3.0 / 3.3 * 4095.0;
    assert!((f64::from(r.adc(0.001, 0)) - expected).abs() <= 1.0);
    r.set_fault(RigFault::LvdtOpen, true);
    assert!(r.adc(0.002, 0) < 41);
    r.set_fault(RigFault::LvdtOpen, false);
    r.set_fault(RigFault::LvdtShort, true);
    assert!(r.adc(0.003, 0) > 4054);
    assert_eq!(r.quadrature(0.004, 2), 0, "no encoder on another timer");
}

#[test]
fn a_running_rig_takes_what_makes_no_other_mechanism() {
    let mut r = rig(&[]);
    let error = r.set_plant("k2_scale", "1.1").expect_err("another mechanism").to_string();
    assert!(error.contains("k2_scale"), "{error}");
    assert!(r.set_plant("friction", "-1N").is_err() && r.set_plant("friction", "0.1").is_ok());
    assert_eq!(r.settings().friction_n, 0.1);
}

#[test]
fn thicker_strings_have_a_thicker_radius_and_are_otherwise_the_scenes() {
    let scene = scene();
    let real = PlantSettings { radius_scale: 1.1, ..PlantSettings::default() }.distort(scene);
    assert!((real.string.diameter_m / scene.string.diameter_m - 1.1).abs() < 1e-12);
    assert_eq!((real.string.k2, real.string.stiffness_n_per_m), (scene.string.k2, scene.string.stiffness_n_per_m));
}

#[test]
fn a_mechanism_without_an_equilibrium_names_the_keys_that_may_be_too_extreme() {
    let settings = PlantSettings { radius_scale: 10.0, ..PlantSettings::default() };
    let error = EmulatedRig::new(scene(), settings, 1).err().expect("strings as thick as their distance").to_string();
    assert!(error.contains("0.30 N and 3.14 rad") && error.contains("radius_scale, k2_scale"), "{error}");
    assert!(!error.contains("friction"), "not of the mechanism: {error}");
}

#[test]
fn a_twist_that_the_strings_cannot_have_is_refused_with_its_limit() {
    let new = |load_n, twist_at_boot_rad| {
        EmulatedRig::new(scene(), PlantSettings { load_n, twist_at_boot_rad, ..PlantSettings::default() }, 1)
    };
    for (load_n, sign) in [(0.05, 1.0), (1.0, -1.0), (18.0, -1.0), (40.0, 1.0)] {
        let error = new(load_n, sign * 75.0).err().expect("past eleven turns").to_string();
        assert!(error.contains("`twist_at_boot`"), "{error}");
        let max: f64 =
            error.split("at most ").nth(1).and_then(|end| end.split(' ').next()?.parse().ok()).expect("the limit");
        assert!(new(load_n, sign * (max + 0.1)).is_err(), "{error}");
        assert!(new(load_n, sign * max).is_ok(), "{error}");
        let max = max - CLOSED_GIVE_RAD;
        let mut r = new(load_n, sign * max).unwrap_or_else(|e| panic!("{e}"));
        // Without power they unwind, and after half a second the rotor has not yet swung through to the other side.
        r.poll(0.5);
        let twist = sign * r.truth().twist_rad;
        assert!(twist > -0.1 && twist < max + 0.01, "{error}: {twist}");
    }
}

#[test]
fn a_pressed_emergency_stop_brakes_the_motor_and_shows_on_its_pin() {
    let mut r = rig(&[("twist_at_boot", "20")]);
    start(&mut r);
    r.poll(2.0);
    r.set_fault(RigFault::Estop, true);
    assert!(r.poll(2.001).contains(&Stimulus::Pin { port: 'B', pin: 5, high: true }));
    let braked = r.truth().twist_rad;
    r.poll(2.2);
    let Some(report) = listen(&mut r, 2.3).pop() else { panic!("the drive lives on") };
    assert!(matches!(report, Report::Motion { current: Milliamps(0), .. }), "{report:?}");
    assert!((r.truth().twist_rad - braked).abs() < 20.0);
}

#[test]
fn the_plant_runs_on_the_cheapest_model_that_its_scene_needs() {
    for (name, tier) in [("finger", Tier::Rigid), ("default", Tier::Full)] {
        let file = format!("{}/../../scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let scene = Scene::load(file).unwrap_or_else(|e| panic!("{e}"));
        let rig = EmulatedRig::new(&scene, PlantSettings::default(), 1).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(rig.tier(), tier, "{name}");
        let (envelope, accuracy) = scene.table_requirement().unwrap_or_else(|e| panic!("{e}"));
        let exact = scene.mechanism().unwrap_or_else(|e| panic!("{e}"));
        let gap = |load: f64, turns: f64| {
            let twist = tsa_model::twist_from_turns(turns);
            let solved = exact.solve(load, twist).unwrap_or_else(|e| panic!("{e}"));
            (rig.plant.built_in().expect("built in").surface.gap(twist, load).gap_m, solved.gap_m)
        };
        for k in 0..60 {
            let part = f64::from(k) / 59.0;
            let load = envelope.load_n[0] + (envelope.load_n[1] - envelope.load_n[0]) * part;
            let ((here, truth), (start, true_start)) = (gap(load, envelope.turns[1] * (1.0 - part)), gap(load, 0.0));
            let error = (start - here) - (true_start - truth);
            assert!(error.abs() <= accuracy.contraction_m / 5.0, "{name}: {error} m at {load} N");
        }
    }
}
