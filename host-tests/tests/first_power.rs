//! What a real board meets on its first day and a kind emulated one does not show: wires that are not there, a debugger
//! that no longer reads, clocks that are missing.

use host_tests::ControlBench;
use host_tests::board::Bench;
use rig_emulator::machine::{Config, ResetCause};
use rig_emulator::soc::can::Line;
use rig_link::messages::{Clock, EventKind, Fault, Kept, LoadChoice, Refusal, Request, Setting, State};
use rig_plant::RigFault;
use rig_plant::board::{Board, Stimulus};
use rig_plant::rig::rail::DESTROYED_V;

const DOMINANT: Line = Line { dominant: true, open: false };
const OPEN: Line = Line { dominant: false, open: true };

/// A board with a fault of the wire to CAN RX from boot on.
fn on_wire(line: Line) -> Bench {
    let mut b = Bench::new(&[], 1);
    b.machine.soc_mut().set_can_line(line);
    b.greet();
    b
}

/// A setting is taken, written to flash, and the watchdog fed meanwhile and after.
fn keeps_settings(b: &mut Bench) {
    b.set(&Request::SetSetting { setting: Setting::SpeedMax, value: 0.003 }).unwrap();
    b.run(3.0);
    assert!(b.machine.stats().resets.is_empty(), "{:?}", b.machine.stats().resets);
}

#[test]
fn on_a_bus_that_is_never_quiet_the_board_lives_and_says_so() {
    let mut b = on_wire(DOMINANT);
    assert!(b.until(4.0, |b| b.last.is_some_and(|t| t.fault == Some(Fault::DriveStartUp))), "{:?}", b.last);
    keeps_settings(&mut b);
    // Cleared too early, it is told again; once the bus is free, the drive starts.
    b.ask(&Request::Clear).unwrap();
    assert!(b.until(4.0, |b| b.last.is_some_and(|t| t.fault == Some(Fault::DriveStartUp))), "{:?}", b.last);
    b.machine.soc_mut().set_can_line(Line::default());
    b.run(1.0);
    b.ask(&Request::Clear).unwrap();
    assert!(b.until(6.0, |b| b.state() == State::Unhomed), "{:?} {:?}", b.last, b.events);
}

#[test]
fn without_a_transceiver_the_board_joins_the_bus_and_hears_nobody() {
    let mut b = on_wire(OPEN);
    let heard = |e: &EventKind| matches!(e, EventKind::FaultRaised(Fault::DriveStartUp | Fault::CanBusOff));
    assert!(b.until(5.0, |b| b.events.iter().any(heard)), "{:?}", b.events);
    // CAN1 has left initialisation and sleep: MSR.
    assert_eq!(b.machine.soc_mut().read(0x4000_6404, 4) & 3, 0);
    keeps_settings(&mut b);
}

/// `probe-rs run` asks for a log that waits; a laptop that sleeps, or a tool that was killed, then reads no more.
#[test]
fn a_log_that_nobody_reads_stops_nothing() {
    let mut b = Bench::new(&[], 2);
    b.machine.stall_rtt(true);
    b.home();
    // A line every 40 ms: more than the buffer holds.
    b.machine.soc_mut().stall_adc(true);
    b.run(12.0);
    assert!(b.machine.stats().resets.is_empty(), "{:?}", b.machine.stats().resets);
    assert_eq!(b.last.map(|t| t.fault), Some(Some(Fault::LvdtStalled)));
    b.machine.soc_mut().stall_adc(false);
    b.run(0.5);
    b.ask(&Request::Clear).unwrap();
    // Read again, it goes on.
    b.machine.stall_rtt(false);
    assert!(b.until(1.0, |b| b.state() == State::Ready), "{:?}", b.last);
}

#[test]
fn the_board_says_what_it_runs_on_and_what_watches_its_supply() {
    let mut b = Bench::new(&[], 3);
    b.machine.soc_mut().flash.set_brown_out_level(2);
    b.greet();
    assert!(b.until(0.2, |b| b.identity.is_some()));
    let identity = b.identity.clone().unwrap();
    assert_eq!((identity.clock, identity.brown_out_level), (Clock::Hse, 2));
    // As delivered.
    let mut b = Bench::new(&[], 3);
    b.greet();
    assert!(b.until(0.2, |b| b.identity.as_ref().is_some_and(|i| i.brown_out_level == 0)));
}

/// The ST-LINK's clock is missing: a solder bridge, or another power source than its USB socket.
#[test]
fn without_the_st_links_clock_the_board_runs_on_its_own_and_says_so() {
    let mut b = Bench::new(&[], 3);
    b.machine.feed_hse(false);
    // It waits two seconds for the clock.
    b.run(3.0);
    b.greet();
    assert!(b.until(0.2, |b| b.identity.is_some()));
    assert_eq!(b.identity.clone().unwrap().clock, Clock::Hsi);
    assert_eq!(b.machine.soc_mut().clock.tree().hclk_hz, 168_000_000);
    assert!(b.machine.stats().resets.is_empty(), "{:?}", b.machine.stats().resets);
    // Its own oscillator is too coarse for the CAN bus.
    assert_eq!((b.state(), b.last.and_then(|t| t.fault)), (State::Fault, Some(Fault::ClockSource)));
    assert_eq!(b.ask(&Request::Clear), Err(Refusal::CauseRemains { fault: Fault::ClockSource }));
    // Lost while it runs: the watchdog restarts it on its own.
    let mut b = Bench::new(&[], 3);
    b.home();
    b.machine.feed_hse(false);
    b.run(1.5);
    assert_eq!(b.machine.stats().resets.iter().map(|r| r.1).collect::<Vec<_>>(), [ResetCause::Watchdog]);
    b.greet();
    assert_eq!(b.last.and_then(|t| t.fault), Some(Fault::ClockSource));
    b.identity = None;
    b.ask(&Request::Status).unwrap();
    assert!(b.until(0.2, |b| b.identity.as_ref().is_some_and(|i| i.clock == Clock::Hsi)));
}

/// Whatever hangs between the reset and the first task is reset like everything else.
#[test]
fn the_watchdog_runs_before_anything_that_can_hang() {
    let mut b = Bench::new(&[], 3);
    while b.machine.soc_mut().clock.tree().hclk_hz == 16_000_000 {
        let until_s = b.machine.now_s() + 10e-6;
        b.machine.run_until(until_s).unwrap();
    }
    let hung_s = b.machine.now_s();
    println!("clock set up at {hung_s} s");
    b.machine.hang(true);
    b.run(1.0);
    let resets = b.machine.stats().resets;
    assert!(matches!(resets[..], [(t_s, ResetCause::Watchdog)] if t_s < hung_s + 0.6), "{resets:?}");
}

/// Another program's remains fill the store, every sector takes its longest time to erase, and the watchdog's clock runs at
/// its fastest.
#[test]
fn the_watchdog_waits_for_the_slowest_flash() {
    let mut b = Bench::on(Config { lsi_hz: 47_000.0, slow_flash: true, ..Config::default() }, &[], 4);
    let mut flash = b.machine.flash_image();
    // Sectors 1 to 3 (src/flash_store.rs).
    flash[0x4000..0x1_0000].fill(0x5A);
    b.machine.set_flash_image(&flash).unwrap();
    b.machine.power_cycle();
    b.greet();
    assert_eq!(b.last.and_then(|t| t.fault), Some(Fault::SettingsCorrupt));
    let start_s = b.machine.now_s();
    b.ask(&Request::SetSetting { setting: Setting::SpeedMax, value: 0.003 }).unwrap();
    let written = |b: &Bench| b.settings.is_some_and(|s| matches!(s.kept, Kept::These));
    assert!(b.until(5.0, written), "{:?} {:?}", b.settings, b.machine.stats().resets);
    println!("kept after {:.2} s", b.machine.now_s() - start_s);
    // The power cycle.
    assert_eq!(b.machine.stats().resets.len(), 1, "{:?}", b.machine.stats().resets);
    // Three sectors, 32 bits at a time.
    assert!(b.machine.now_s() - start_s < 1.8);
}

/// Registers of which a wrong value stops nothing on the emulated board.
#[test]
fn the_chip_is_set_up_for_a_real_board() {
    let mut b = Bench::new(&[], 1);
    b.run(0.1);
    let mut register = |address| b.machine.soc_mut().read(address, 4);
    // FLASH_ACR: prefetch and instruction cache on, the data cache off.
    assert_eq!(register(0x4002_3C00) >> 8 & 7, 3);
    // TIM3_CCMR1: IC1F and IC2F, eight samples at a quarter of the timer's clock.
    assert_eq!((register(0x4000_0418) >> 4 & 0xF, register(0x4000_0418) >> 12), (7, 7));
    // DBGMCU_APB1_FZ: the watchdog stands still while a debugger holds the core.
    assert_eq!(register(0xE004_2008) >> 12 & 1, 1);
}

/// Pulses on the wire to the stop contact, shorter than a tick, at every phase of it; and then the stop itself.
#[test]
fn a_pulse_on_the_stop_wire_is_no_stop_and_a_stop_is_seen_within_two_ticks() {
    let mut b = Bench::new(&[], 5);
    b.greet();
    assert!(b.until(5.0, |b| b.state() == State::Unhomed));
    let contact = |b: &mut Bench, high| b.machine.send(Stimulus::Pin { port: 'B', pin: 5, high });
    for phase in 0..20 {
        let begins_s = b.machine.now_s() + 0.0005 * f64::from(phase);
        b.machine.run_until(begins_s).unwrap();
        contact(&mut b, true);
        b.machine.run_until(begins_s + 0.009).unwrap();
        contact(&mut b, false);
        b.run(0.05);
        assert_eq!(b.state(), State::Unhomed, "a pulse {phase} half milliseconds late");
    }
    contact(&mut b, true);
    // Telemetry tells of a tick 8 ms later.
    assert!(b.until(0.03, |b| b.state() == State::EStop), "{:?}", b.last);
    contact(&mut b, false);
    b.run(0.05);
    assert_eq!(b.state(), State::EStop);
}

/// An erase masks interrupts for a quarter of a second and more. The board's clock must not lose a wrap of its counter.
#[test]
fn an_erase_leaves_the_boards_clock_right() {
    let mut b = Bench::on(Config { slow_flash: true, ..Config::default() }, &[], 6);
    b.greet();
    assert!(b.until(6.0, |b| b.state() == State::Unhomed));
    let behind_us = |b: &Bench| b.last.map_or(0.0, |t| b.machine.now_s() * 1e6 - t.t_us as f64);
    let before_us = behind_us(&b);
    // Each writes a record; a sector is erased now and then, at another phase of the counter each time.
    let mut erases = 0;
    for k in 0..2000u16 {
        let began_s = b.machine.now_s();
        b.set(&Request::SetSetting { setting: Setting::SpeedMax, value: 0.003 + 1e-6 * f32::from(k) }).unwrap();
        erases += u32::from(b.machine.now_s() - began_s > 0.3);
        b.run(0.02);
        let drift_us = behind_us(&b) - before_us;
        assert!(drift_us.abs() < 11_000.0, "after {erases} erases the board's clock is {drift_us:.0} us behind");
        if erases == 2 {
            break;
        }
    }
    assert_eq!(erases, 2, "too few writes for two erases");
    // Nor does it jump later, when the counter wraps.
    for _ in 0..50 {
        b.run(0.1);
        let drift_us = behind_us(&b) - before_us;
        assert!(drift_us.abs() < 11_000.0, "the board's clock is {drift_us:.0} us behind");
    }
    assert!(b.machine.stats().resets.is_empty() && b.last.unwrap().fault.is_none(), "{:?}", b.last);
}

/// The drive's CAN controller starts a while after its power: a Reset that is sent again and again until it is acknowledged
/// would start the drive a second time.
#[test]
fn a_drive_that_acknowledges_late_is_started_once() {
    let mut b = Bench::new(&[], 3);
    b.greet();
    assert!(b.until(6.0, |b| b.state() == State::Unhomed));
    // By power, and by the Reset of the start-up sequence.
    assert_eq!(b.machine.board().drive().counters.restarts, 2, "{:?}", b.machine.board().drive().counters);
}

/// A reset of the board opens the motor-power relay under a turning motor, which then charges the drive's isolated rail.
#[test]
fn a_relay_that_opens_under_a_turning_motor_leaves_the_rail_below_what_the_drive_bears() {
    let highest_v = |clamp: bool| {
        let mut d = ControlBench::new(&[("load", "1.5kg"), ("relay_release", "0s")], 3);
        d.home().unwrap();
        d.move_to(0.012, 0.01, LoadChoice::Auto).unwrap();
        d.rig.set_fault(RigFault::NoRailClamp, !clamp);
        d.tick(Some(Request::Move { target_m: 0.0, speed_m_per_s: f32::INFINITY, load: LoadChoice::Auto }));
        assert!(d.until(1.0, |d| d.truth().motor_speed_rad_per_s.abs() > 800.0), "{:?}", d.truth());
        let opens_s = d.time_s();
        d.rig.gpio_out(opens_s, 'B', 0);
        let mut highest_v = 0f64;
        for step in 1..2000 {
            d.rig.poll(opens_s + 2.5e-4 * f64::from(step));
            highest_v = highest_v.max(d.rig.rail().volts());
        }
        // The drive lives on its capacitor and on what the motor gives back until the motor is slow.
        assert!(!d.rig.drive().is_powered() && highest_v < DESTROYED_V, "{highest_v} V");
        highest_v
    };
    let [with, without] = [true, false].map(highest_v);
    println!("rail: {with:.1} V with a clamp, {without:.1} V without");
}

/// The stack lies below the variables (memory.x): one that grows too far leaves the RAM, the core locks up, and the watchdog
/// starts the board again. What the run before has left in its variables is whole.
#[test]
fn a_stack_that_overflows_stops_the_core_and_leaves_the_variables() {
    let mut b = Bench::new(&[], 3);
    b.greet();
    assert!(b.until(6.0, |b| b.state() == State::Unhomed));
    b.machine.overflow_stack();
    b.run(1.5);
    assert_eq!(b.machine.stats().resets.iter().map(|r| r.1).collect::<Vec<_>>(), [ResetCause::Watchdog]);
    b.greet();
    assert_eq!(b.last.and_then(|t| t.fault), Some(Fault::WatchdogReset));
    b.ask(&Request::Status).unwrap();
    assert!(b.until(0.2, |b| b.identity.as_ref().is_some_and(|i| i.boot_count == 2)), "{:?}", b.identity);
}

/// Powered from another source than its USB socket, the ST-LINK gives its clock a while after the board has power.
#[test]
fn a_clock_that_comes_late_is_waited_for() {
    let mut b = Bench::new(&[], 3);
    b.machine.soc_mut().hse_late = true;
    b.machine.power_cycle();
    b.run(0.5);
    b.greet();
    assert!(b.until(6.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    assert!(b.until(0.2, |b| b.identity.is_some()));
    assert_eq!(b.identity.clone().unwrap().clock, Clock::Hse);
}
