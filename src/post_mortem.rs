//! What a run leaves for the next one, in RAM that the start-up code does not initialise: how often the board booted,
//! whether the drive was being driven, and the panic message.

use core::fmt::{self, Write};
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use heapless::String;

/// Longest panic message (bytes); the rest is cut off.
const TEXT_MAX: usize = 88;
/// Marks a record that this layout has written.
const MAGIC: u32 = 0x7453_4103;

struct Record {
    magic: AtomicU32,
    boots: AtomicU32,
    /// 1 while the drive is commanded to follow positions.
    driving: AtomicU32,
    /// Bytes of the text; 0 if the run did not end in a panic or a hard fault.
    length: AtomicU32,
    text: [AtomicU8; TEXT_MAX],
}

#[unsafe(link_section = ".uninit.POST_MORTEM")]
static RECORD: MaybeUninit<Record> = MaybeUninit::uninit();

fn record() -> &'static Record {
    // SAFETY: any bit pattern is a valid integer; the magic word shows whether this firmware wrote them.
    unsafe { RECORD.assume_init_ref() }
}

/// How the previous run ended.
pub struct PreviousRun {
    /// Boots since power came on, including the present one.
    pub boot_count: u32,
    /// The drive was commanded to follow positions.
    pub was_driving: bool,
    /// The message of its panic or hard fault.
    pub panic: Option<String<TEXT_MAX>>,
}

/// Reads the previous run's record and starts a new one. After `power_on` the RAM holds noise, unless the supply only
/// dipped: then the count of boots restarts, and the rest is the previous run's. Call it once.
pub fn start_record(power_on: bool) -> PreviousRun {
    let record = record();
    let valid = record.magic.load(Ordering::Relaxed) == MAGIC;
    let length = (record.length.load(Ordering::Relaxed) as usize).min(TEXT_MAX);
    let mut previous = PreviousRun { boot_count: 1, was_driving: false, panic: None };
    if valid {
        if !power_on {
            previous.boot_count = record.boots.load(Ordering::Relaxed).wrapping_add(1);
        }
        previous.was_driving = record.driving.load(Ordering::Relaxed) != 0;
        let bytes = record.text.iter().take(length).map(|b| b.load(Ordering::Relaxed));
        // The cut may fall inside a character that is not ASCII, so such bytes become spaces.
        let text = bytes.map(|b| if b.is_ascii_graphic() { char::from(b) } else { ' ' }).collect();
        previous.panic = (length > 0).then_some(text);
    }
    record.length.store(0, Ordering::Relaxed);
    record.driving.store(0, Ordering::Relaxed);
    record.boots.store(previous.boot_count, Ordering::Relaxed);
    record.magic.store(MAGIC, Ordering::Relaxed);
    previous
}

/// Records whether the drive is commanded to follow positions.
pub fn set_driving(driving: bool) {
    record().driving.store(driving.into(), Ordering::Relaxed);
}

/// Appends to the record's text.
struct Text;

impl Write for Text {
    fn write_str(&mut self, s: &str) -> fmt::Result {
        let record = record();
        for byte in s.bytes() {
            let length = record.length.load(Ordering::Relaxed);
            let place = record.text.get(length as usize).ok_or(fmt::Error)?;
            place.store(byte, Ordering::Relaxed);
            record.length.store(length + 1, Ordering::Relaxed);
        }
        Ok(())
    }
}

/// Records the reason and resets the board. The drive holds its last target until the next run's first frame, a Reset.
fn record_and_reset(reason: fmt::Arguments<'_>) -> ! {
    static RESETTING: AtomicBool = AtomicBool::new(false);
    cortex_m::interrupt::disable();
    // A panic while the reason is recorded must not replace the first reason, nor start an endless recursion.
    if !RESETTING.swap(true, Ordering::Relaxed) {
        record().length.store(0, Ordering::Relaxed);
        // The error only means that the text was cut off.
        let _ = Text.write_fmt(reason);
        defmt::error!("{}", defmt::Display2Format(&reason));
    }
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    record_and_reset(format_args!("{info}"))
}

/// # Safety
/// Called by the core alone.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    record_and_reset(format_args!("hard fault at {:#010x}, called from {:#010x}", frame.pc(), frame.lr()))
}
