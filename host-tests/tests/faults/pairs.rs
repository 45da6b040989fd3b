//! Every pair of faults, one after the other and in both orders, with requests in between: what the board says of
//! holding and falling is held against the true strings.

use super::cases::*;
use host_tests::ControlBench;
use rig_control::supervisor::fault_policy::{Response, policy};
use rig_link::messages::{Fault, Refusal, Request, State};
use rig_plant::RigFault;
use rigctl::parallel::parallel;

/// Requests that every fault refuses alike; one of them, in turn, between the first fault and the second.
const REFUSED: [(&str, Request); 3] =
    [("home", Request::HOME), ("move", go(0.003, 0.002)), ("jog", Request::Jog { twist_speed_rad_per_s: 2.0 })];
/// What the board may say too late (s): the fault's own checks, the drive's 0.1 s between stall frames.
const TOLD_WITHIN_S: f64 = 0.35;
/// How far the strings may turn (rad) while the board says that they are held: the fault that says otherwise is raised at
/// 0.8 rad for 80 ms, and a load that falls is fast by then.
const HELD_RAD: f64 = 2.0;
/// Motor speed (rad/s) above which the strings are really turning.
const TURNING_RAD_PER_S: f64 = 10.0;

/// Each fault that can come to a running rig at once, within how many seconds it is told of a moving one, and its cause.
/// Not here: those of a start, which a running rig cannot have; `load-range` and `model-residual`, which need a move of
/// their own to be seen; `twist-range`, since only the drive turns the emulated shaft. The table's own test goes over all.
fn causes() -> Vec<(Fault, f64, Happens)> {
    let mut causes: Vec<(Fault, f64, Happens)> = Vec::new();
    for (fault, within_s, cause) in CASES {
        if fault != Fault::DriveStartUp && causes.iter().all(|(known, ..)| *known != fault) {
            causes.push((fault, within_s, cause));
        }
    }
    causes.extend([
        (Fault::NotHeld, 3.0, (|d| d.rig.set_fault(RigFault::MotorOpen, true)) as Happens),
        (Fault::LvdtJump, 0.2, |d| d.rig.set_plant("lvdt_offset", "-5mm").unwrap()),
        (Fault::DriveReset, 0.2, |d| d.rig.set_fault(RigFault::DriveReset, true)),
    ]);
    causes
}

/// What is watched in every tick of a run.
#[derive(Clone, Default)]
struct Watch {
    /// Since when (s) the drive really gives no torque, or cannot be heard, while the board says that it holds.
    unheld_since_s: Option<f64>,
    /// Where the strings were when the present fault was first said to hold them (rad).
    held_rad: Option<(Fault, f64)>,
    wrong: Vec<String>,
}

impl Watch {
    fn look(&mut self, d: &ControlBench) {
        let truth = d.truth();
        let response = d.control.fault().map(|fault| policy(fault).response);
        let drive = d.rig.drive();
        let dead = drive.is_stalled() || drive.mode().is_none();
        let at_rest = matches!(d.control.state(), State::Ready | State::Holding | State::Unhomed | State::Moving);
        let says_held = at_rest || response.is_some_and(|r| r < Response::HoldIfHeard);
        if !(says_held && dead) {
            self.unheld_since_s = None;
        }
        let since_s = *self.unheld_since_s.get_or_insert(d.time_s());
        if says_held && dead && d.time_s() - since_s > TOLD_WITHIN_S {
            self.say(format!("{:?} is said to hold, and the drive gives no torque", d.control.fault()));
        }
        match (d.control.fault(), self.held_rad) {
            (Some(fault), Some((known, held_rad))) if fault == known => {
                // A hand that turns the shaft is not in the true strings.
                let turned_rad = (truth.twist_rad - held_rad).abs();
                if policy(fault).response < Response::HoldIfHeard && turned_rad > HELD_RAD {
                    self.say(format!("{fault} is said to hold, and the strings turn by {turned_rad:.1} rad"));
                }
            }
            (Some(fault), _) => self.held_rad = Some((fault, truth.twist_rad)),
            (None, _) => self.held_rad = None,
        }
    }

    fn say(&mut self, what: String) {
        if self.wrong.is_empty() {
            self.wrong.push(what);
        }
    }

    fn run(&mut self, d: &mut ControlBench, seconds: f64) {
        d.watch(seconds, |d| self.look(d));
    }

    /// Asks, and looks at the answer to a `clear`: it is refused while the board says held and the strings turn.
    fn ask(&mut self, d: &mut ControlBench, request: Request) {
        let (before, fault) = (d.truth(), d.control.fault());
        let dead = d.rig.drive().is_stalled() || d.rig.drive().mode().is_none();
        let reply = d.tick(Some(request)).reply;
        let taken = reply.is_some_and(|r| r.is_ok());
        let said_held = fault.is_some_and(|fault| policy(fault).response < Response::HoldIfHeard);
        let turning = before.motor_speed_rad_per_s.abs() > TURNING_RAD_PER_S;
        match request {
            Request::Clear if taken && said_held && (turning || dead) => {
                self.say(format!("{fault:?} is cleared while the strings turn or the drive has let go"));
            }
            Request::Home { .. } | Request::Move { .. } | Request::Jog { .. }
                if fault.is_some() && !matches!(reply, Some(Err(Refusal::InFault { .. }))) =>
            {
                self.say(format!("{request:?} in {fault:?}: {reply:?}"));
            }
            Request::Stop if !taken => self.say(format!("stop is refused: {reply:?}")),
            _ => {}
        }
        self.look(d);
    }
}

/// A rig that has been in a fault for 0.3 s.
fn first_fault((fault, within_s, cause): (Fault, f64, Happens)) -> (ControlBench, Watch) {
    let (mut watch, mut d) = (Watch::default(), moving());
    cause(&mut d);
    let told = d.until(within_s, |d| {
        watch.look(d);
        d.control.fault().is_some()
    });
    if !told {
        watch.say(format!("{fault} is not told"));
    }
    watch.run(&mut d, 0.3);
    (d, watch)
}

/// What went wrong, once there is a second fault, and after `clear`.
fn second_fault(mut d: ControlBench, mut watch: Watch, cause: Happens) -> Vec<String> {
    cause(&mut d);
    watch.run(&mut d, 1.0);
    let driven_rad = d.truth().driven_rad;
    for _ in 0..5 {
        watch.ask(&mut d, Request::Clear);
        watch.run(&mut d, 0.2);
    }
    // A start of the drive catches what falls; nothing else turns the strings.
    let driven_rad = d.truth().driven_rad - driven_rad;
    if driven_rad > 0.3 {
        watch.say(format!("the drive turns the strings by {driven_rad:.2} rad after `clear`"));
    }
    watch.wrong
}

#[test]
fn what_is_said_of_holding_is_so_for_every_pair_of_faults() {
    let causes = causes();
    let rows = parallel(&|_, _| {}, causes.len(), |row| {
        let (first, mut wrong) = (causes[row], Vec::new());
        let in_fault = first_fault(first);
        let requests = [("clear", Request::Clear), ("stop", Request::Stop)].into_iter().chain(REFUSED);
        for (k, (name, request)) in requests.enumerate() {
            let (mut d, mut watch) = in_fault.clone();
            watch.ask(&mut d, request);
            watch.run(&mut d, 0.2);
            // Each of those that every fault refuses comes before a third of the others.
            let others = causes.iter().enumerate().filter(|(other, _)| *other != row);
            for (_, (second, _, cause)) in others.filter(|(other, _)| k < 2 || (row + other) % 3 == k - 2) {
                let said = second_fault(d.clone(), watch.clone(), *cause);
                wrong.extend(said.into_iter().map(|what| format!("{}, {name}, {second}: {what}", first.0)));
            }
        }
        wrong
    });
    let wrong = rows.concat();
    assert!(wrong.is_empty(), "{} of the runs:\n{}", wrong.len(), wrong.join("\n"));
}
