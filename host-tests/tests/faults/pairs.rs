//! Every pair of faults, one after the other and in both orders, with requests in between: what the board says of
//! holding and falling is held against the true strings.

use super::cases::*;
use host_tests::ControlBench;
use rig_control::supervisor::fault_policy::{Response, policy};
use rig_link::messages::{Fault, Refusal, Request, State};
use rig_plant::RigFault;

/// Requests that every fault refuses alike; one of them, in turn, between the first fault and the second.
const REFUSED: [(&str, Request); 3] =
    [("home", Request::HOME), ("move", go(0.003, 0.002)), ("jog", Request::Jog { twist_speed_rad_per_s: 2.0 })];
/// What the board may say too late (s): the fault's own checks, the drive's 0.1 s between stall frames.
const TOLD_WITHIN_S: f64 = 0.35;
/// How far the strings may turn (rad) while the board says that they are held: the fault that says otherwise is raised at
/// 0.8 rad for 0.1 s, and a load that falls is fast by then.
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
#[derive(Default)]
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
        d.until(seconds, |d| {
            self.look(d);
            false
        });
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

/// What went wrong in a run.
fn play(first: (Fault, f64, Happens), second: (Fault, f64, Happens), request: Request) -> Vec<String> {
    let mut watch = Watch::default();
    let mut d = moving();
    (first.2)(&mut d);
    let told = d.until(first.1, |d| {
        watch.look(d);
        d.control.fault().is_some()
    });
    if !told {
        watch.say(format!("{} is not told", first.0));
    }
    watch.run(&mut d, 0.3);
    watch.ask(&mut d, request);
    watch.run(&mut d, 0.2);
    (second.2)(&mut d);
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
    let workers = std::thread::available_parallelism().map_or(2, usize::from);
    let next = std::sync::atomic::AtomicUsize::new(0);
    let mut wrong = Vec::new();
    std::thread::scope(|scope| {
        let work = || {
            let mut done = Vec::new();
            loop {
                let row = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                let Some(&first) = causes.get(row) else { return done };
                for (k, &second) in causes.iter().enumerate().filter(|(k, _)| *k != row) {
                    for (name, request) in [("clear", Request::Clear), ("stop", Request::Stop), REFUSED[(row + k) % 3]]
                    {
                        done.push((first.0, second.0, name, play(first, second, request)));
                    }
                }
            }
        };
        let handles: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        for (first, second, name, what) in handles.into_iter().flat_map(|h| h.join().expect("no panic")) {
            wrong.extend(what.into_iter().map(|what| format!("{first}, {name}, {second}: {what}")));
        }
    });
    assert!(wrong.is_empty(), "{} of the runs:\n{}", wrong.len(), wrong.join("\n"));
}
