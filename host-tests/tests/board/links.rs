//! Host link and the drive's lines: noise, strangers, another tool, stops and repeated requests; and the drive on the serial
//! line, whose framing is assumed: what is tested is that a line without checksums does no harm.

use super::{JOG, counters, fault, noise, standing};
use host_tests::board::{Bench, HELLO};
use rig_link::messages::{Fault, Refusal, Request, ResetCause, State};
use rig_link::{PROTOCOL_HASH, Versions};
use rig_plant::RigFault;
use rig_plant::board::{CanFrame, Stimulus};

#[test]
fn noise_on_the_link_and_strangers_on_the_bus_are_ignored_and_counted() {
    let mut b = standing(&[], 3);
    b.prove();
    let before = b.machine.board().truth().twist_rad;
    let mut x = 0x2545_f491;
    for k in 0..300 {
        b.raw(noise(&mut x, 20));
        // Ours by its id but too short, somebody else's, and one with 29 bits that looks like ours.
        for (id, extended, dlc) in [(0x01B, false, 4), (0x123, false, 8), (0x01B, true, 8)] {
            b.machine.send(Stimulus::Can(CanFrame { id, extended, remote: false, dlc, data: [k as u8; 8] }));
        }
        b.step();
        if k % 50 == 49 {
            // A delimiter ends whatever the noise began; the next good message is not lost.
            b.raw(vec![0]);
            assert!(b.ask(&Request::Status).is_ok());
        }
    }
    let counters = counters(&mut b);
    assert!(counters.link_errors > 10, "{counters:?}");
    assert!(counters.foreign_frames >= 250, "{counters:?}");
    assert_eq!(b.state(), State::Unhomed);
    assert!((b.machine.board().truth().twist_rad - before).abs() < 0.01, "something moved");
    turns(&mut b);
}

/// Drive and link still do what they are asked.
fn turns(b: &mut Bench) {
    let before = b.machine.board().truth().twist_rad;
    b.ask(&JOG).unwrap();
    b.run(1.0);
    let turned_rad = b.machine.board().truth().twist_rad - before;
    assert!(b.state() == State::Moving && (turned_rad - 2.0).abs() < 0.3, "{turned_rad} rad: {:?}", b.last);
}

#[test]
fn a_tool_of_another_build_is_refused_politely_but_may_stop() {
    let mut b = Bench::new(&[], 4);
    assert!(b.until(5.0, |b| b.state() == State::Unhomed));
    let mismatch = Err(Refusal::NotGreeted);
    let another = Versions::new(PROTOCOL_HASH ^ 1, "9.8.7", "");
    assert_eq!(b.ask(&Request::HOME), mismatch);
    assert_eq!(b.ask(&Request::Hello(another)), mismatch);
    let board = b.versions.expect("it greets every tool");
    let message = another.check_board(&board).expect_err("another protocol").to_string();
    assert!(message.contains("9.8.7") && message.contains(board.git()) && !board.git().is_empty(), "{message}");
    assert!(b.identity.is_none(), "nothing that another tool could misread");
    assert_eq!(b.ask(&Request::HOME), mismatch);
    assert!(b.ask(&Request::Stop).is_ok());
    assert!(b.ask(&HELLO).is_ok());
    b.run(0.1);
    let identity = b.identity.clone().unwrap();
    assert_eq!(identity.scene_hash, host_tests::scene().hash());
    assert_eq!(identity.reset_cause, ResetCause::PowerOn);
    assert_eq!(identity.table.crc, host_tests::table().crc, "firmware and desktop have the same table");
    assert!(b.ask(&Request::HOME).is_ok());
}

/// `stop` goes before everything else that the host has asked.
#[test]
fn a_stop_is_taken_before_what_waits_and_nothing_of_that_moves_after_it() {
    let mut b = standing(&[("load", "0.5kg")], 1);
    // More than the board can keep waiting: one is taken in each tick, four come in.
    let jogs: Vec<u16> = (0..40).map(|_| b.post(&JOG)).collect();
    let stop = b.post(&Request::Stop);
    b.run(0.3);
    let result = |number: u16| b.replies.iter().find(|(to, _)| *to == number).map(|(_, result)| *result);
    assert!(matches!(result(stop), Some(Ok(_))), "{:?}", result(stop));
    let replies: Vec<_> = jogs.iter().filter_map(|number| result(*number)).collect();
    assert_eq!(replies.len(), jogs.len(), "every request is answered");
    let refused = |why: Refusal| replies.iter().filter(|r| **r == Err(why)).count();
    let (stopped, too_many) = (refused(Refusal::Stopped), refused(Refusal::TooMany));
    let taken = replies.iter().filter(|r| r.is_ok()).count();
    println!("{taken} taken, {too_many} too many, {stopped} stopped before they were begun");
    assert!(taken >= 1 && too_many >= 1 && stopped >= 5, "{replies:?}");
    assert!(b.until(1.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    let twist_rad = b.machine.board().truth().twist_rad;
    b.run(0.5);
    let turned_rad = b.machine.board().truth().twist_rad - twist_rad;
    assert!(b.state() == State::Unhomed && turned_rad.abs() < 0.05, "turned by {turned_rad} rad: {:?}", b.last);
}

/// Old bytes come out of a buffer on the way: what they ask is not done again. `stop` always is.
#[test]
fn a_request_that_comes_once_more_is_not_carried_out_again() {
    let mut b = standing(&[("load", "0.5kg")], 1);
    b.prove();
    let mut buffer = [0; rig_link::MAX_FRAME];
    let number = b.post(&JOG);
    let old = rig_link::encode(number, &JOG, &mut buffer).unwrap().to_vec();
    b.run(0.5);
    assert_eq!(b.state(), State::Moving);
    b.ask(&Request::Stop).unwrap();
    assert!(b.until(1.0, |b| b.state() == State::Unhomed));
    b.replies.clear();
    b.raw(old);
    b.run(0.5);
    assert_eq!(b.replies, [(number, Err(Refusal::Repeated))]);
    assert_eq!(b.state(), State::Unhomed, "nothing turns");
    b.ask(&JOG).unwrap();
    b.run(0.2);
    assert_eq!(b.state(), State::Moving, "a new one is taken");
}

#[test]
fn noise_on_the_line_moves_nothing_and_reports_are_still_heard() {
    let mut b = Bench::over_uart(&[], 3);
    b.ready();
    b.prove();
    let before = b.machine.board().truth().twist_rad;
    let mut x = 0x2545_f491;
    let mut sent = 0;
    for _ in 0..600 {
        // At any time between two reports, and into them.
        let wait_s = f64::from(noise(&mut x, 1)[0]) / 255.0 * 0.01;
        let until_s = b.machine.now_s() + wait_s;
        b.machine.run_until(until_s).unwrap();
        let bytes = noise(&mut x, 12);
        sent += bytes.len();
        b.machine.send(Stimulus::Uart { usart: 1, bytes });
        b.step();
        assert_eq!(b.state(), State::Unhomed, "{:?}", b.last);
    }
    b.run(0.1);
    let foreign = counters(&mut b).foreign_frames as usize;
    println!("{sent} bytes of noise, {foreign} bytes dropped");
    // All of the noise, and the reports that it ran into.
    assert!((sent - 12..2 * sent).contains(&foreign), "{foreign} of {sent}");
    assert!((b.machine.board().truth().twist_rad - before).abs() < 0.01, "something moved");
    turns(&mut b);
}

/// A cut line and a restarted drive are a silent drive, and one that is not there fails its start.
#[test]
fn over_the_serial_line_a_drive_that_is_not_heard_is_a_fault() {
    for (cause, ends) in [(RigFault::CanSilent, true), (RigFault::DriveReset, false)] {
        // A motor that holds the strings even without power.
        let mut b = Bench::over_uart(&[("motor_friction", "0.3mNm")], 6);
        b.ready();
        b.machine.board_mut().set_fault(cause, true);
        assert!(b.until(0.15, |b| b.state() == State::Fault), "{cause:?}");
        assert_eq!(fault(&b), Some(Fault::DriveSilent));
        b.run(1.0);
        if ends {
            b.machine.board_mut().set_fault(cause, false);
        }
        b.ask(&Request::Clear).unwrap();
        assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{cause:?}: {:?}", b.last);
    }
    let mut b = Bench::over_uart(&[], 8);
    b.machine.board_mut().set_fault(RigFault::CanSilent, true);
    assert!(b.until(6.0, |b| b.state() == State::Fault), "{:?}", b.last);
    assert_eq!(fault(&b), Some(Fault::DriveStartUp));
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
        // The drive is left alone until somebody clears what has happened.
        b.run(0.3);
        b.ask(&HELLO).unwrap();
        b.ask(&Request::Clear).unwrap();
    }
}
