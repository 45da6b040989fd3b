//! The CAN bus to the drive: CAN1 at 1 Mbit/s.

use super::Transport;
use crate::board::drive_address;
use crate::shared::{self, Task};
use core::sync::atomic::Ordering;
use embassy_futures::poll_once;
use embassy_stm32::can::{Can, CanRx, CanTx, Frame as CanFrame, Id, Mailbox};
use embassy_stm32::pac;
use embassy_time::{Duration, Instant, Timer};
use rig_control::{DriveCommand, DriveReading};
use rmds405::{Frame, Received, Report};

/// Period of the checks whether the controller has seen a quiet bus: 11 recessive bits, 11 µs.
const QUIET_POLL: Duration = Duration::from_millis(5);
/// Time after which a bus that is not quiet counts as a drive that does not start.
const QUIET_WAIT: Duration = Duration::from_secs(3);
/// Pause after a bus error: without a node that acknowledges, the controller reports errors without end.
const ERROR_PAUSE: Duration = Duration::from_millis(5);

/// CAN1, enabled.
pub struct CanTransport {
    tx: CanTx<'static>,
    rx: CanRx<'static>,
    /// Kept, because dropping it would reset the controller under the two halves.
    _whole: Can<'static>,
}

impl CanTransport {
    /// Waits for a quiet bus. A bus that does not become quiet is reported as a drive that does not start. The newest
    /// command that arrives meanwhile and still matters is put back for the conversation with the drive.
    pub async fn open(mut can: Can<'static>) -> Self {
        let mut since = Instant::now();
        let mut commanded = None;
        // `enable().await` would yield without a pause, and at interrupt level thread mode would never run.
        while poll_once(can.enable()).is_pending() {
            Timer::after(QUIET_POLL).await;
            shared::alive(Task::Drive);
            match shared::DRIVE_COMMAND.try_take() {
                Some(command @ (DriveCommand::Restart | DriveCommand::RestartOpenLoop)) => {
                    shared::DRIVE.set(DriveReading::Starting);
                    since = Instant::now();
                    commanded = Some(command);
                }
                Some(command @ (DriveCommand::LetGo | DriveCommand::PowerOff)) => commanded = Some(command),
                Some(DriveCommand::Silence | DriveCommand::Follow { .. } | DriveCommand::Voltage { .. }) | None => {}
            }
            if Instant::now().saturating_duration_since(since) >= QUIET_WAIT {
                defmt::warn!(
                    "CAN: the bus does not become quiet; check the power and the termination of the transceiver"
                );
                shared::DRIVE.set(DriveReading::Failed);
                since = Instant::now();
            }
        }
        if let Some(command) = commanded {
            shared::DRIVE_COMMAND.signal(command);
        }
        let (tx, rx) = can.split();
        Self { tx, rx, _whole: can }
    }
}

impl Transport for CanTransport {
    /// Sends the frame now or not at all: a frame without acknowledgement must not be sent seconds later
    /// (src/README.md section 1.1).
    async fn send(&mut self, frame: &Frame) {
        self.abandon();
        if let Ok(frame) = CanFrame::new_standard(frame.id, &frame.data) {
            let _ = self.tx.try_write(&frame);
        }
    }

    fn abandon(&mut self) {
        if !self.tx.is_idle() {
            for mailbox in [Mailbox::Mailbox0, Mailbox::Mailbox1, Mailbox::Mailbox2] {
                self.tx.abort(mailbox);
            }
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
