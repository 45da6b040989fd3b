//! What a reset does not clear: RAM that the start-up code leaves alone. It tells the next run how this one ended.

use core::fmt::{self, Write};
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use heapless::String;

/// Longest text that is kept; the rest is cut off.
const TEXT: usize = 88;
/// Tells that the rest was written by this layout.
const MAGIC: u32 = 0x7453_4103;

struct Kept {
    magic: AtomicU32,
    boots: AtomicU32,
    /// The drive was being told where to go.
    driving: AtomicU32,
    /// Bytes of the text; 0 if the run did not end by itself.
    length: AtomicU32,
    text: [AtomicU8; TEXT],
}

#[unsafe(link_section = ".uninit.KEPT")]
static KEPT: MaybeUninit<Kept> = MaybeUninit::uninit();

fn kept() -> &'static Kept {
    // SAFETY: any bit pattern is a valid integer; the magic word tells whether these were written by us.
    unsafe { KEPT.assume_init_ref() }
}

/// How the run before this one ended.
pub struct Before {
    /// Boots since power came on, counting this one.
    pub boot_count: u32,
    /// The drive was being told where to go.
    pub driving: bool,
    /// What the run panicked with.
    pub panic: Option<String<TEXT>>,
}

/// Looks at what the last run left, and begins anew. After `power_on` RAM holds noise, unless the supply only dipped: then
/// the boots count anew, and the rest is what the last run left. Call once.
pub fn begin(power_on: bool) -> Before {
    let kept = kept();
    let ours = kept.magic.load(Ordering::Relaxed) == MAGIC;
    let length = (kept.length.load(Ordering::Relaxed) as usize).min(TEXT);
    let mut before = Before { boot_count: 1, driving: false, panic: None };
    if ours {
        if !power_on {
            before.boot_count = kept.boots.load(Ordering::Relaxed).wrapping_add(1);
        }
        before.driving = kept.driving.load(Ordering::Relaxed) != 0;
        let bytes = kept.text.iter().take(length).map(|b| b.load(Ordering::Relaxed));
        // Other than ASCII would need more care at the cut.
        let text = bytes.map(|b| if b.is_ascii_graphic() { char::from(b) } else { ' ' }).collect();
        before.panic = (length > 0).then_some(text);
    }
    kept.length.store(0, Ordering::Relaxed);
    kept.driving.store(0, Ordering::Relaxed);
    kept.boots.store(before.boot_count, Ordering::Relaxed);
    kept.magic.store(MAGIC, Ordering::Relaxed);
    before
}

/// The drive is being told where to go, or not.
pub fn driving(driving: bool) {
    kept().driving.store(driving.into(), Ordering::Relaxed);
}

struct Text;

impl Write for Text {
    fn write_str(&mut self, s: &str) -> fmt::Result {
        let kept = kept();
        for byte in s.bytes() {
            let at = kept.length.load(Ordering::Relaxed);
            let place = kept.text.get(at as usize).ok_or(fmt::Error)?;
            place.store(byte, Ordering::Relaxed);
            kept.length.store(at + 1, Ordering::Relaxed);
        }
        Ok(())
    }
}

/// Ends this run. The drive goes on holding its last target until the next run's first frame, a Reset.
fn end(why: fmt::Arguments<'_>) -> ! {
    static ENDING: AtomicBool = AtomicBool::new(false);
    cortex_m::interrupt::disable();
    // The first reason counts, and writing it down must not go round in circles.
    if !ENDING.swap(true, Ordering::Relaxed) {
        kept().length.store(0, Ordering::Relaxed);
        // Cut off where it does not fit.
        let _ = Text.write_fmt(why);
        defmt::error!("{}", defmt::Display2Format(&why));
    }
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    end(format_args!("{info}"))
}

/// # Safety
/// Called by the core alone.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    end(format_args!("hard fault at {:#010x}, called from {:#010x}", frame.pc(), frame.lr()))
}
