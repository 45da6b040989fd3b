//! Numbers that survive the self-test's own resets, in RAM that the start-up code does not initialise (as in
//! src/post_mortem.rs).

use crate::registers::Flags;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicU32, Ordering};

/// The part of the test that this run has to do.
#[derive(Clone, Copy, PartialEq)]
#[repr(u32)]
pub enum Stage {
    /// The first run.
    Begin = 0,
    /// The second run, after the reset by software.
    AfterSoftware = 1,
    /// The third run, after the watchdog's reset.
    AfterWatchdog = 2,
    /// The third run, after any reset.
    Done = 3,
}

/// A number that survives a reset.
#[derive(Clone, Copy)]
pub enum Word {
    /// [`Stage`].
    Stage,
    /// Number of runs that ended in another reset than the expected one.
    UnexpectedResets,
    /// Reset flags after the reset by software.
    SoftwareFlags,
    /// Reset flags after the watchdog's reset.
    WatchdogFlags,
    /// Time from the watchdog's start to its reset (µs).
    WatchdogUs,
    /// [`crate::record::Outcome`].
    Flash,
    /// The value that was written to flash.
    Value,
    /// Checksum of the firmware's records.
    FirmwareRecords,
}

const WORDS: usize = 8;

/// Marks numbers that this very image has written; those of another image are ignored.
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

struct Retained {
    magic: AtomicU32,
    words: [AtomicU32; WORDS],
}

#[unsafe(link_section = ".uninit.SELFTEST")]
static RETAINED: MaybeUninit<Retained> = MaybeUninit::uninit();

fn retained() -> &'static Retained {
    // SAFETY: any bit pattern is a valid integer; the magic word shows whether this image wrote them.
    unsafe { RETAINED.assume_init_ref() }
}

pub fn get(word: Word) -> u32 {
    retained().words[word as usize].load(Ordering::Relaxed)
}

pub fn set(word: Word, value: u32) {
    retained().words[word as usize].store(value, Ordering::Relaxed);
}

/// Sets the stage of the next run.
pub fn set_next_stage(stage: Stage) {
    set(Word::Stage, stage as u32);
}

/// Lets the next run start the test from the beginning.
pub fn clear() {
    retained().magic.store(0, Ordering::Relaxed);
}

/// Number of unexpected resets after which the test starts again: they may come from the reset button or a debugger.
const UNEXPECTED_RESETS_MAX: u32 = 2;

/// The stage of this run, by the retained numbers and the cause of the reset. Call it once.
pub fn stage(flags: Flags) -> Stage {
    let valid = retained().magic.load(Ordering::Relaxed) == MAGIC && !flags.power_on();
    let expected = match get(Word::Stage) {
        1 if valid => Stage::AfterSoftware,
        2 if valid => Stage::AfterWatchdog,
        3 if valid => return Stage::Done,
        _ => {
            initialise();
            return Stage::Begin;
        }
    };
    let is_expected = if expected == Stage::AfterSoftware { flags.software() } else { flags.watchdog() };
    if !is_expected && get(Word::UnexpectedResets) < UNEXPECTED_RESETS_MAX {
        set(Word::UnexpectedResets, get(Word::UnexpectedResets) + 1);
        set_next_stage(Stage::Begin);
        return Stage::Begin;
    }
    if expected == Stage::AfterWatchdog {
        set(Word::WatchdogFlags, flags.0);
        return Stage::Done;
    }
    expected
}

fn initialise() {
    for word in &retained().words {
        word.store(0, Ordering::Relaxed);
    }
    retained().magic.store(MAGIC, Ordering::Relaxed);
}
