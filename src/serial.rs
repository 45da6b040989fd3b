//! The sending half of a serial line. Embassy's own, in embassy-stm32 0.6.0, takes back the "transmission complete" flag by
//! reading SR, changing it and writing it: a byte that arrives in between is lost with its flag (RM0390 section 25.6.1). It
//! does so only while the interrupt of that flag is on, which this half never switches on. Reception stays embassy's.

use embassy_stm32::interrupt::typelevel::{Handler, USART1, USART2};
use embassy_stm32::pac;
use embassy_stm32::pac::usart::Usart;
use embassy_stm32::usart::BufferedUartTx;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;

/// Bytes that wait for the line: a few of the longest messages.
type Waiting = Pipe<CriticalSectionRawMutex, 512>;

static HOST: Waiting = Waiting::new();
static DRIVE: Waiting = Waiting::new();

/// Sends over one USART.
pub struct Transmitter<'d> {
    regs: Usart,
    waiting: &'static Waiting,
    /// Never written to: its end would take the pin from the USART.
    _embassys: BufferedUartTx<'d>,
}

impl<'d> Transmitter<'d> {
    /// Over USART2, to the host.
    pub fn host(embassys: BufferedUartTx<'d>) -> Self {
        Self { regs: pac::USART2, waiting: &HOST, _embassys: embassys }
    }

    /// Over USART1, to the drive.
    pub fn drive(embassys: BufferedUartTx<'d>) -> Self {
        Self { regs: pac::USART1, waiting: &DRIVE, _embassys: embassys }
    }

    /// Hands over all bytes to the line, in order; waits while there is no room.
    pub async fn write_all(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let count = self.waiting.write(bytes).await;
            bytes = bytes.get(count..).unwrap_or_default();
            // The interrupt changes this register too.
            cortex_m::interrupt::free(|_| self.regs.cr1().modify(|w| w.set_txeie(true)));
        }
    }
}

/// The transmit register is empty: the next byte goes in. Embassy's handler, which runs first, has switched this interrupt
/// off, as it has nothing to send.
fn send_next(regs: Usart, waiting: &Waiting) {
    let mut byte = [0];
    if regs.sr().read().txe() && waiting.try_read(&mut byte).is_ok() {
        regs.dr().write(|w| w.set_dr(byte[0].into()));
        regs.cr1().modify(|w| w.set_txeie(true));
    }
}

/// The host's line, behind embassy's handler of the same interrupt.
pub struct ToHost;

impl Handler<USART2> for ToHost {
    unsafe fn on_interrupt() {
        send_next(pac::USART2, &HOST);
    }
}

/// The drive's line, likewise.
pub struct ToDrive;

impl Handler<USART1> for ToDrive {
    unsafe fn on_interrupt() {
        send_next(pac::USART1, &DRIVE);
    }
}
