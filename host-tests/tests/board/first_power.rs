//! What a real board meets on its first day and a kind emulated one does not show: wires that are not there, a debugger
//! that no longer reads, clocks that are missing.

use super::{STORE, fault, identity, set, standing};
use host_tests::board::{Bench, firmware};
use rig_emulator::machine::{Config, ResetCause};
use rig_emulator::soc::can::Line;
use rig_link::messages::{Clock, EventKind, Fault, Kept, Refusal, Request, Setting, State};
use rig_plant::board::Stimulus;

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
    b.set(&set(Setting::SpeedMax, 0.003)).unwrap();
    b.run(3.0);
    assert!(b.machine.stats().resets.is_empty(), "{:?}", b.machine.stats().resets);
}

#[test]
fn on_a_bus_that_is_never_quiet_the_board_lives_and_says_so() {
    let mut b = on_wire(DOMINANT);
    assert!(b.until(4.0, |b| fault(b) == Some(Fault::DriveStartUp)), "{:?}", b.last);
    keeps_settings(&mut b);
    // Cleared too early, it is told again; once the bus is free, the drive starts.
    b.ask(&Request::Clear).unwrap();
    assert!(b.until(4.0, |b| fault(b) == Some(Fault::DriveStartUp)), "{:?}", b.last);
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
    b.ready();
    b.prove();
    // A line every 40 ms: more than the buffer holds.
    b.machine.soc_mut().stall_adc(true);
    b.run(12.0);
    assert!(b.machine.stats().resets.is_empty(), "{:?}", b.machine.stats().resets);
    assert_eq!(fault(&b), Some(Fault::LvdtStalled));
    b.machine.soc_mut().stall_adc(false);
    b.run(0.5);
    b.ask(&Request::Clear).unwrap();
    // Read again, it goes on.
    b.machine.stall_rtt(false);
    assert!(b.until(1.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
}

#[test]
fn the_board_says_what_it_runs_on_and_what_watches_its_supply() {
    // As delivered, and set.
    for level in [0, 2] {
        let mut b = Bench::new(&[], 3);
        b.machine.soc_mut().flash.set_brown_out_level(level);
        b.greet();
        let identity = identity(&mut b);
        assert_eq!((identity.clock, identity.brown_out_level), (Clock::Hse, level));
    }
}

/// The ST-LINK's clock is missing: a solder bridge, or another power source than its USB socket.
#[test]
fn without_the_st_links_clock_the_board_runs_on_its_own_and_says_so() {
    let mut b = Bench::new(&[], 3);
    // Settings that cannot be read are the smaller fault: `clear` accepts them, and nothing may clear the clock's.
    let mut flash = b.machine.flash_image();
    flash[STORE].fill(0x5A);
    b.machine.set_flash_image(&flash).unwrap();
    b.machine.feed_hse(false);
    b.machine.power_cycle();
    // It waits two seconds for the clock.
    b.run(3.0);
    b.greet();
    assert_eq!(identity(&mut b).clock, Clock::Hsi);
    assert_eq!(b.machine.soc_mut().clock.tree().hclk_hz, 168_000_000);
    assert!(matches!(b.machine.stats().resets[..], [(_, ResetCause::PowerCycle)]), "{:?}", b.machine.stats().resets);
    // Its own oscillator is too coarse for the CAN bus.
    assert_eq!((b.state(), fault(&b)), (State::Fault, Some(Fault::ClockSource)));
    assert_eq!(b.ask(&Request::Clear), Err(Refusal::CauseRemains { fault: Fault::ClockSource }));
    // Lost while it runs: the watchdog restarts it on its own.
    let mut b = standing(&[], 3);
    b.machine.feed_hse(false);
    b.run(1.5);
    assert_eq!(b.machine.stats().resets.iter().map(|r| r.1).collect::<Vec<_>>(), [ResetCause::Watchdog]);
    b.greet();
    assert_eq!(fault(&b), Some(Fault::ClockSource));
    assert_eq!(identity(&mut b).clock, Clock::Hsi);
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
    let mut b = Bench::on(
        &firmware(),
        host_tests::scene(),
        Config { lsi_hz: 47_000.0, slow_flash: true, ..Config::default() },
        &[],
        4,
    );
    let mut flash = b.machine.flash_image();
    flash[STORE].fill(0x5A);
    super::with_flash(&mut b, &flash);
    assert_eq!(fault(&b), Some(Fault::SettingsCorrupt));
    let start_s = b.machine.now_s();
    b.ask(&set(Setting::SpeedMax, 0.003)).unwrap();
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
    let mut b = standing(&[], 5);
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

/// The drive's CAN controller starts a while after its power: a Reset that is sent again and again until it is acknowledged
/// would start the drive a second time.
#[test]
fn a_drive_that_acknowledges_late_is_started_once() {
    let b = standing(&[], 3);
    // By power, and by the Reset of the start-up sequence.
    assert_eq!(b.machine.board().drive().counters.restarts, 2, "{:?}", b.machine.board().drive().counters);
}

/// Powered from another source than its USB socket, the ST-LINK gives its clock a while after the board has power.
#[test]
fn a_clock_that_comes_late_is_waited_for() {
    let mut b = Bench::new(&[], 3);
    b.machine.soc_mut().hse_late = true;
    b.machine.power_cycle();
    b.run(0.5);
    b.ready();
    assert_eq!(identity(&mut b).clock, Clock::Hse);
}
