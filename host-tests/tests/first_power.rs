//! What a real board meets on its first day and a kind emulated one does not show: wires that are not there, a debugger
//! that no longer reads, clocks that are missing.

use host_tests::board::Bench;
use rig_emulator::soc::can::Line;
use rig_link::messages::{EventKind, Fault, Request, Setting, State};

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
