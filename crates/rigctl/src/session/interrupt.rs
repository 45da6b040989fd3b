//! Ctrl-C, the end of the terminal, or a polite kill: the board is told to stop before the tool ends. Without it the board
//! would hold as well, but half a second later and in fault.

use std::process::Child;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

/// Longest that the tool goes on after the first interrupt, whatever it is waiting for.
const GRACE: Duration = Duration::from_millis(1500);
/// Exit code of who was interrupted, as shells have it for Ctrl-C.
const INTERRUPTED: i32 = 130;

static WANTED: AtomicBool = AtomicBool::new(false);
/// Processes that must not outlive this one.
static CHILDREN: Mutex<Vec<Weak<Mutex<Child>>>> = Mutex::new(Vec::new());

/// From now on the first interrupt is left to the session, which stops the board. The second one ends the process, and so
/// does the end of a grace of 1.5 s: the session may be waiting for an emulated board that does not answer.
pub fn watch() {
    // A second call finds the first one's handler there, which is as good.
    let _ = ctrlc::set_handler(|| {
        if WANTED.swap(true, Ordering::Relaxed) {
            end();
        }
        std::thread::spawn(|| {
            std::thread::sleep(GRACE);
            eprintln!("error: interrupted while it waited");
            end();
        });
    });
}

/// Whether somebody wants to end it.
pub fn wanted() -> bool {
    WANTED.load(Ordering::Relaxed)
}

/// Has this child killed where the process ends before the child's owner can do it.
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

/// Ends a child that need not be asked, and waits until it has gone.
pub fn kill(child: &Mutex<Child>) {
    let mut child = child.lock().unwrap_or_else(PoisonError::into_inner);
    let _ = child.kill();
    let _ = child.wait();
}
