//! The transmitter of a serial line; reception uses embassy's. Embassy's transmitter, in embassy-stm32 0.6.0, clears
//! the "transmission complete" flag by reading, changing and writing SR: a byte that arrives in between is lost
//! together with its flag (RM0390 section 25.6.1). It does so only while the interrupt of that flag is enabled, and
//! this transmitter never enables it.

use embassy_stm32::interrupt::typelevel::{Handler, USART1, USART2};
use embassy_stm32::pac;
use embassy_stm32::pac::usart::Usart;
use embassy_stm32::usart::BufferedUartTx;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;

/// Queue of bytes to be sent, with room for a few of the longest messages.
type Queue = Pipe<CriticalSectionRawMutex, 512>;

static HOST: Queue = Queue::new();
static DRIVE: Queue = Queue::new();

/// Sends bytes over one USART.
pub struct Transmitter<'d> {
    regs: Usart,
    queue: &'static Queue,
    /// Not used, but kept: dropping it would disconnect the pin from the USART.
    _embassy_tx: BufferedUartTx<'d>,
}

impl<'d> Transmitter<'d> {
    /// The transmitter of USART2, to the host.
    pub fn host(embassy_tx: BufferedUartTx<'d>) -> Self {
        Self { regs: pac::USART2, queue: &HOST, _embassy_tx: embassy_tx }
    }

    /// The transmitter of USART1, to the drive.
    pub fn drive(embassy_tx: BufferedUartTx<'d>) -> Self {
        Self { regs: pac::USART1, queue: &DRIVE, _embassy_tx: embassy_tx }
    }

    /// Queues all bytes in order, and waits while the queue is full.
    pub async fn write_all(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let count = self.queue.write(bytes).await;
            bytes = bytes.get(count..).unwrap_or_default();
            // The interrupt handler changes this register too.
            cortex_m::interrupt::free(|_| self.regs.cr1().modify(|w| w.set_txeie(true)));
        }
    }
}

/// Writes the next byte to the transmit register if it is empty, and enables its interrupt again: embassy's handler,
/// which runs first and has nothing to send, has disabled it.
fn send_next(regs: Usart, queue: &Queue) {
    let mut byte = [0];
    if regs.sr().read().txe() && queue.try_read(&mut byte).is_ok() {
        regs.dr().write(|w| w.set_dr(byte[0].into()));
        regs.cr1().modify(|w| w.set_txeie(true));
    }
}

/// Handler of the host's line. It runs after embassy's handler of the same interrupt.
pub struct ToHost;

impl Handler<USART2> for ToHost {
    unsafe fn on_interrupt() {
        send_next(pac::USART2, &HOST);
    }
}

/// Handler of the drive's line. It runs after embassy's handler of the same interrupt.
pub struct ToDrive;

impl Handler<USART1> for ToDrive {
    unsafe fn on_interrupt() {
        send_next(pac::USART1, &DRIVE);
    }
}
