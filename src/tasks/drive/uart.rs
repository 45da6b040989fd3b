//! The serial line to the drive: USART1 through an RS232 converter. It is experimental, because the framing is an
//! assumption ([`rmds405::serial`]).

use super::Transport;
use crate::serial::Transmitter;
use crate::shared;
use core::sync::atomic::Ordering;
use embassy_stm32::usart::{BufferedUart, BufferedUartRx};
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::Read;
use rmds405::serial::{BYTE_US, Decoder, encode};
use rmds405::{Frame, Report};

/// Pause after a line error.
const ERROR_PAUSE: Duration = Duration::from_millis(5);

/// USART1 and the bytes that it has received.
pub struct UartTransport {
    tx: Transmitter<'static>,
    rx: BufferedUartRx<'static>,
    decoder: Decoder<Report>,
    bytes: [u8; 32],
    /// Indices of the bytes that are not decoded yet, and the time of the last of them (µs).
    pending: core::ops::Range<usize>,
    read_us: u64,
}

impl UartTransport {
    pub fn new(uart: BufferedUart<'static>) -> Self {
        let (tx, rx) = uart.split();
        Self { tx: Transmitter::drive(tx), rx, decoder: Decoder::reports(), bytes: [0; 32], pending: 0..0, read_us: 0 }
    }
}

impl Transport for UartTransport {
    /// A serial line needs no acknowledgement, so a frame never waits and cannot be late.
    async fn send(&mut self, frame: &Frame) {
        self.tx.write_all(&encode(frame)).await;
    }

    fn abandon(&mut self) {}

    async fn next_report(&mut self) -> Report {
        loop {
            while let Some(at) = self.pending.next() {
                // Bytes that were read together arrived one after the other.
                let came_us = self.read_us.saturating_sub(self.pending.len() as u64 * BYTE_US);
                if let Some(report) = self.decoder.push(came_us, self.bytes[at]) {
                    return report;
                }
            }
            shared::FOREIGN_FRAMES.store(self.decoder.foreign(), Ordering::Relaxed);
            match self.rx.read(&mut self.bytes).await {
                Ok(count) => {
                    self.pending = 0..count;
                    self.read_us = Instant::now().as_micros();
                }
                Err(_) => Timer::after(ERROR_PAUSE).await,
            }
        }
    }

    /// A serial line has no such state: a broken line shows as a silent drive.
    fn bus_off(&self) -> bool {
        false
    }
}
