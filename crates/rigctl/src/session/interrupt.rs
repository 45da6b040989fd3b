//! Ctrl-C, the end of the terminal, or a polite kill: the board is told to stop before the tool ends. Without it the board
//! would hold as well, but half a second later and in fault.

use std::sync::atomic::{AtomicBool, Ordering};

static WANTED: AtomicBool = AtomicBool::new(false);

/// From now on the first interrupt is left to the session, which stops the board; the second ends the process.
pub fn watch() {
    // A second call finds the first one's handler there, which is as good.
    let _ = ctrlc::set_handler(|| {
        if WANTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
}

/// Whether somebody wants to end it.
pub fn wanted() -> bool {
    WANTED.load(Ordering::Relaxed)
}
