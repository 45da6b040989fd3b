//! What the self-test's own resets must not clear, in RAM that the start-up code leaves alone (as in src/keep.rs).

use crate::chip::Flags;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicU32, Ordering};

/// Which of the three runs comes next.
#[derive(Clone, Copy, PartialEq)]
#[repr(u32)]
pub enum Stage {
    Begin = 0,
    /// The second, after the reset by software.
    AfterSoftware = 1,
    /// The third, after the watchdog's bite.
    AfterWatchdog = 2,
    /// The third, whichever way it came about.
    Done = 3,
}

/// A number that is kept.
#[derive(Clone, Copy)]
pub enum Word {
    /// [`Stage`].
    Stage,
    /// Runs that ended in another reset than the one that was wanted.
    Strays,
    /// Reset flags after the reset by software, and after the bite.
    SoftwareFlags,
    WatchdogFlags,
    /// Time from the watchdog's start to its bite (µs).
    BiteUs,
    /// [`crate::record::Outcome`].
    Flash,
    /// What was written to flash.
    Value,
    /// Checksum of the firmware's records.
    Others,
}

const WORDS: usize = 8;

/// Tells that the rest was written by this very image: of another one, kept in flash or in the head of a debugger, nothing is
/// taken over.
const MAGIC: u32 = {
    let git = env!("TSA_GIT").as_bytes();
    let mut hash = 0x7453_4151;
    let mut i = 0;
    while i < git.len() {
        hash = (hash ^ git[i] as u32).wrapping_mul(0x0100_0193);
        i += 1;
    }
    hash
};

struct Kept {
    magic: AtomicU32,
    words: [AtomicU32; WORDS],
}

#[unsafe(link_section = ".uninit.SELFTEST")]
static KEPT: MaybeUninit<Kept> = MaybeUninit::uninit();

fn kept() -> &'static Kept {
    // SAFETY: any bit pattern is a valid integer; the magic word tells whether these were written by us.
    unsafe { KEPT.assume_init_ref() }
}

pub fn get(word: Word) -> u32 {
    kept().words[word as usize].load(Ordering::Relaxed)
}

pub fn set(word: Word, value: u32) {
    kept().words[word as usize].store(value, Ordering::Relaxed);
}

/// The stage after this one.
pub fn next(stage: Stage) {
    set(Word::Stage, stage as u32);
}

/// Begins anew at the next reset.
pub fn forget() {
    kept().magic.store(0, Ordering::Relaxed);
}

/// Strays that are taken for a hand on the reset button, or a debugger's reset.
const STRAYS: u32 = 2;

/// The stage of this run, by what was kept and how it was reset. Call once.
pub fn stage(flags: Flags) -> Stage {
    let ours = kept().magic.load(Ordering::Relaxed) == MAGIC && !flags.power_on();
    let wanted = match get(Word::Stage) {
        1 if ours => Stage::AfterSoftware,
        2 if ours => Stage::AfterWatchdog,
        3 if ours => return Stage::Done,
        _ => {
            begin();
            return Stage::Begin;
        }
    };
    let as_wanted = if wanted == Stage::AfterSoftware { flags.software() } else { flags.watchdog() };
    if !as_wanted && get(Word::Strays) < STRAYS {
        set(Word::Strays, get(Word::Strays) + 1);
        next(Stage::Begin);
        return Stage::Begin;
    }
    if wanted == Stage::AfterWatchdog {
        set(Word::WatchdogFlags, flags.0);
        return Stage::Done;
    }
    wanted
}

fn begin() {
    for word in &kept().words {
        word.store(0, Ordering::Relaxed);
    }
    kept().magic.store(MAGIC, Ordering::Relaxed);
}
