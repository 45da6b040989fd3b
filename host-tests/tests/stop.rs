//! `stop` goes before everything else that the host has asked.

use host_tests::board::Bench;
use rig_link::messages::{Refusal, Request, State};

#[test]
fn a_stop_is_taken_before_what_waits_and_nothing_of_that_moves_after_it() {
    let mut b = Bench::new(&[("load", "0.5kg")], 1);
    b.greet();
    assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    // More than the board can keep waiting: one is taken in each tick, four come in.
    let jogs: Vec<u16> = (0..40).map(|_| b.post(&Request::Jog { twist_speed_rad_per_s: 2.0 })).collect();
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
    let mut b = Bench::new(&[("load", "0.5kg")], 1);
    b.greet();
    assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    b.prove();
    let mut buffer = [0; rig_link::MAX_FRAME];
    let jog = Request::Jog { twist_speed_rad_per_s: 2.0 };
    let number = b.post(&jog);
    let old = rig_link::encode(number, &jog, &mut buffer).unwrap().to_vec();
    b.run(0.5);
    assert_eq!(b.state(), State::Moving);
    b.ask(&Request::Stop).unwrap();
    assert!(b.until(1.0, |b| b.state() == State::Unhomed));
    b.replies.clear();
    b.raw(old);
    b.run(0.5);
    assert_eq!(b.replies, [(number, Err(Refusal::Repeated))]);
    assert_eq!(b.state(), State::Unhomed, "nothing turns");
    b.ask(&jog).unwrap();
    b.run(0.2);
    assert_eq!(b.state(), State::Moving, "a new one is taken");
}
