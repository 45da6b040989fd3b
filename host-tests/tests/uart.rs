//! The real firmware on the emulated board with the drive on the serial line. Its framing is assumed: what is tested is that
//! one start-up and one control serve both ways, and that a line without checksums does no harm.

use host_tests::board::{Bench, HELLO, uart_scene};
use rig_link::messages::{Fault, LoadChoice, Request, State};
use rig_plant::RigFault;
use rig_plant::board::Stimulus;
use rmds405::Transport;

const UP: Request = Request::Move { target_m: 0.008, speed_m_per_s: 0.002, load: LoadChoice::Auto };

fn noise(state: &mut u32, count: usize) -> Vec<u8> {
    let mut next = || {
        *state ^= *state << 13;
        *state ^= *state >> 17;
        *state ^= *state << 5;
        (*state >> 24) as u8
    };
    (0..count).map(|_| next()).collect()
}

#[test]
fn homes_and_moves_as_over_the_bus() {
    let mut errors = [0.0; 2];
    for (b, (transport, error)) in [Bench::new(&[], 2), Bench::over_uart(&[], 2)]
        .iter_mut()
        .zip([Transport::Can, Transport::Uart].into_iter().zip(&mut errors))
    {
        let homing = b.home();
        b.ask(&UP).unwrap();
        assert!(b.until(20.0, |b| b.state() == State::Holding), "{:?}", b.last);
        b.run(1.0);
        *error = b.true_position_m() - 0.008;
        let stats = b.machine.stats();
        println!(
            "{transport:?}: homed in {homing:.1} s, {:+.1} um at rest, core busy {:.2} %, tick {:.0} instructions mean, \
             {} at most, stack {} B",
            *error * 1e6,
            stats.core_busy * 100.0,
            stats.tick.instructions_mean,
            stats.tick.instructions_max,
            stats.stack_high_water_bytes
        );
        assert!(error.abs() < 50e-6 && homing < 45.0);
        assert!(stats.core_busy < 0.10);
        assert!(stats.resets.is_empty() && stats.warnings.is_empty(), "{stats:?}");
        assert_eq!(b.machine.board().drive().transport(), Some(transport));
        assert_eq!(b.last.unwrap().counters.foreign_frames, 0);
        if transport == Transport::Uart {
            assert_eq!(b.identity.clone().unwrap().scene_hash, uart_scene().hash());
        }
    }
    assert!((errors[0] - errors[1]).abs() < 20e-6, "{errors:?}");
}

#[test]
fn noise_on_the_line_moves_nothing_and_reports_are_still_heard() {
    let mut b = Bench::over_uart(&[], 3);
    b.home();
    let before = b.machine.board().truth().twist_rad;
    let mut x = 0x2545_f491;
    let mut sent = 0;
    for _ in 0..1000 {
        // At any time between two reports, and into them.
        let wait_s = f64::from(noise(&mut x, 1)[0]) / 255.0 * 0.01;
        let until_s = b.machine.now_s() + wait_s;
        b.machine.run_until(until_s).unwrap();
        let bytes = noise(&mut x, 12);
        sent += bytes.len();
        b.machine.send(Stimulus::Uart { usart: 1, bytes });
        b.step();
        assert_eq!(b.state(), State::Ready, "{:?}", b.last);
    }
    b.run(0.1);
    let foreign = b.last.unwrap().counters.foreign_frames as usize;
    println!("{sent} bytes of noise, {foreign} bytes dropped");
    // All of the noise, and the reports that it ran into.
    assert!((sent - 12..2 * sent).contains(&foreign), "{foreign} of {sent}");
    assert!((b.machine.board().truth().twist_rad - before).abs() < 0.01, "something moved");
    b.ask(&UP).unwrap();
    assert!(b.until(20.0, |b| b.state() == State::Holding));
}

#[test]
fn a_cut_line_and_a_restarted_drive_are_a_silent_drive() {
    for (fault, ends) in [(RigFault::CanSilent, true), (RigFault::DriveReset, false)] {
        let mut b = Bench::over_uart(&[], 6);
        b.run(0.05);
        b.ask(&HELLO).unwrap();
        assert!(b.until(5.0, |b| b.state() == State::Unhomed));
        b.machine.board_mut().set_fault(fault, true);
        assert!(b.until(0.15, |b| b.state() == State::Fault), "{fault:?}");
        assert_eq!(b.last.unwrap().fault, Some(Fault::DriveSilent));
        b.run(1.0);
        if ends {
            b.machine.board_mut().set_fault(fault, false);
        }
        b.ask(&Request::Clear).unwrap();
        assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{fault:?}: {:?}", b.last);
    }
}

#[test]
fn a_drive_that_is_not_there_fails_its_start() {
    let mut b = Bench::over_uart(&[], 8);
    b.machine.board_mut().set_fault(RigFault::CanSilent, true);
    assert!(b.until(6.0, |b| b.state() == State::Fault), "{:?}", b.last);
    assert_eq!(b.last.unwrap().fault, Some(Fault::DriveStartUp));
}

/// The board dies at any time, also in the middle of a command: the drive still understands the Reset that comes first
/// afterwards.
#[test]
fn after_a_crash_the_first_thing_that_the_drive_hears_is_a_reset() {
    let mut b = Bench::over_uart(&[], 9);
    b.run(0.05);
    // A command takes 0.87 ms and goes out every 10 ms: one of the steps ends within it.
    for step in 0..13 {
        b.ask(&HELLO).unwrap();
        assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
        b.ask(&Request::Jog { twist_speed_rad_per_s: 1.0 }).unwrap();
        b.run(0.2);
        let restarts = b.machine.board().drive().counters.restarts;
        let until_s = b.machine.now_s() + 0.8e-3 * f64::from(step);
        b.machine.run_until(until_s).unwrap();
        b.machine.crash().unwrap();
        b.run(0.1);
        assert_eq!(b.machine.stats().resets.len(), 1 + step as usize);
        let drive = b.machine.board().drive();
        assert!(drive.counters.restarts > restarts && drive.mode().is_none(), "{step}: {:?}", drive.counters);
        b.run(3.0);
        b.ask(&HELLO).unwrap();
        b.ask(&Request::Clear).unwrap();
    }
}
