//! The drive's serial line: USART1 through an RS232 converter. Experimental, its framing is assumed ([`rmds405::serial`]).

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

/// USART1 and what it has read.
pub struct UartTransport {
    tx: Transmitter<'static>,
    rx: BufferedUartRx<'static>,
    decoder: Decoder<Report>,
    bytes: [u8; 32],
    /// Which of the bytes are not looked at yet, and when the last one was there (µs).
    waiting: core::ops::Range<usize>,
    read_us: u64,
}

impl UartTransport {
    pub fn new(uart: BufferedUart<'static>) -> Self {
        let (tx, rx) = uart.split();
        Self { tx: Transmitter::drive(tx), rx, decoder: Decoder::reports(), bytes: [0; 32], waiting: 0..0, read_us: 0 }
    }
}

impl Transport for UartTransport {
    /// Goes out whether anybody hears it or not: nothing waits on this line, so nothing can go out late.
    async fn send(&mut self, frame: &Frame) {
        self.tx.write_all(&encode(frame)).await;
    }

    async fn next_report(&mut self) -> Report {
        loop {
            while let Some(at) = self.waiting.next() {
                // Read in one go, they came one after the other.
                let came_us = self.read_us.saturating_sub(self.waiting.len() as u64 * BYTE_US);
                if let Some(report) = self.decoder.push(came_us, self.bytes[at]) {
                    return report;
                }
            }
            shared::FOREIGN_FRAMES.store(self.decoder.foreign(), Ordering::Relaxed);
            match self.rx.read(&mut self.bytes).await {
                Ok(count) => {
                    self.waiting = 0..count;
                    self.read_us = Instant::now().as_micros();
                }
                Err(_) => Timer::after(ERROR_PAUSE).await,
            }
        }
    }

    /// There is no bus to leave: a broken line is a silent drive.
    fn bus_off(&self) -> bool {
        false
    }
}
