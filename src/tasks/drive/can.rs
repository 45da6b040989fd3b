//! The drive's bus: CAN1 at 1 Mbit/s.

use super::Transport;
use crate::board::drive_address;
use crate::shared::{self, Task};
use core::sync::atomic::Ordering;
use embassy_stm32::can::{Can, CanRx, CanTx, Frame as CanFrame, Id, Mailbox};
use embassy_stm32::pac;
use embassy_time::{Duration, Timer, with_timeout};
use rmds405::{Frame, Received, Report};

/// How long the controller may wait for a quiet bus before it is tried again.
const ENABLE_WAIT: Duration = Duration::from_millis(200);
/// Pause after a bus error: an unacknowledged bus reports errors without end.
const ERROR_PAUSE: Duration = Duration::from_millis(5);

/// CAN1, on the bus.
pub struct CanTransport {
    tx: CanTx<'static>,
    rx: CanRx<'static>,
    /// Its end would reset the controller under the two halves.
    _whole: Can<'static>,
}

impl CanTransport {
    /// Waits for a quiet bus.
    pub async fn open(mut can: Can<'static>) -> Self {
        // With RX stuck or floating, `enable` waits for ever.
        while with_timeout(ENABLE_WAIT, can.enable()).await.is_err() {
            defmt::warn!("CAN: no quiet bus; transceiver powered and terminated?");
            shared::alive(Task::Drive);
        }
        let (tx, rx) = can.split();
        Self { tx, rx, _whole: can }
    }
}

impl Transport for CanTransport {
    /// Sends now or not at all: a frame that nobody acknowledged must not go out seconds later (hardware.md 7.1).
    async fn send(&mut self, frame: &Frame) {
        if !self.tx.is_idle() {
            for mailbox in [Mailbox::Mailbox0, Mailbox::Mailbox1, Mailbox::Mailbox2] {
                self.tx.abort(mailbox);
            }
        }
        if let Ok(frame) = CanFrame::new_standard(frame.id, &frame.data) {
            let _ = self.tx.try_write(&frame);
        }
    }

    async fn next_report(&mut self) -> Report {
        loop {
            match self.rx.read().await {
                Ok(envelope) => {
                    let (id, extended) = match envelope.frame.id() {
                        Id::Standard(id) => (u32::from(id.as_raw()), false),
                        Id::Extended(id) => (id.as_raw(), true),
                    };
                    let received =
                        Received { id, extended, remote: envelope.frame.header().rtr(), data: envelope.frame.data() };
                    match Report::decode(drive_address(), &received) {
                        Ok(report) => return report,
                        Err(_) => {
                            shared::FOREIGN_FRAMES.fetch_add(1, Ordering::Relaxed);
                        }
                    }
                }
                Err(_) => Timer::after(ERROR_PAUSE).await,
            }
        }
    }

    fn bus_off(&self) -> bool {
        pac::CAN1.esr().read().boff()
    }
}
