//! Ctrl-C, the end of the terminal, or SIGTERM: the board is stopped before the tool ends. Without it the board would hold
//! as well, but half a second later and in fault.

use std::process::Child;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

/// Longest time that the tool goes on after the first interrupt, whatever it waits for.
const GRACE: Duration = Duration::from_secs(5);
/// Exit code of an interrupted program, as in shells.
const INTERRUPTED: i32 = 130;

static WANTED: AtomicBool = AtomicBool::new(false);
/// Processes that must not outlive this one.
static CHILDREN: Mutex<Vec<Weak<Mutex<Child>>>> = Mutex::new(Vec::new());

/// From now on the first interrupt is left to the session, which stops the board. The second one ends the process, and so
/// does the end of a grace of 5 s: the session may be waiting for an emulated board that does not answer.
pub fn watch() {
    // A second call finds the handler of the first one installed, which does the same.
    let _ = ctrlc::set_handler(|| {
        if WANTED.swap(true, Ordering::Relaxed) {
            end();
        }
        std::thread::spawn(|| {
            std::thread::sleep(GRACE);
            crate::output::say!("error: interrupted while it waited: whether the board was stopped is not known");
            end();
        });
    });
}

/// Where the end of the terminal was ignored when the tool began, as under `nohup`, it is no interrupt. Call it before the first
/// thread begins: the others inherit it.
#[cfg(target_os = "linux")]
pub fn bear_hang_ups() {
    use nix::sys::signal::{SigSet, Signal};
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).map(str::trim);
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask, 16).ok()).unwrap_or(0);
    if ignored >> (Signal::SIGHUP as u32 - 1) & 1 == 1 {
        let _ = SigSet::from(Signal::SIGHUP).thread_block();
    }
}

/// Whether the operator has interrupted the tool.
pub fn wanted() -> bool {
    WANTED.load(Ordering::Relaxed)
}

/// Asks the session to stop the board, for a program that hears of interrupts itself.
pub fn ask() {
    WANTED.store(true, Ordering::Relaxed);
}

/// The board has been stopped, and the program goes on.
pub fn forget() {
    WANTED.store(false, Ordering::Relaxed);
}

/// Kills this child, too, if the process ends before the child's owner can do it.
pub fn takes_along(child: &Arc<Mutex<Child>>) {
    let mut children = CHILDREN.lock().unwrap_or_else(PoisonError::into_inner);
    children.retain(|other| other.strong_count() > 0);
    children.push(Arc::downgrade(child));
}

fn end() -> ! {
    for child in CHILDREN.lock().unwrap_or_else(PoisonError::into_inner).iter().filter_map(Weak::upgrade) {
        kill(&child);
    }
    std::process::exit(INTERRUPTED)
}

/// Kills a child and waits for its end.
pub fn kill(child: &Mutex<Child>) {
    let mut child = child.lock().unwrap_or_else(PoisonError::into_inner);
    let _ = child.kill();
    let _ = child.wait();
}
