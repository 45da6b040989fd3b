//! The RMDS-405 over CAN: start-up, a command every tick, its reports.

use crate::board::drive_address;
use crate::scene::RIG;
use crate::shared::{self, Task};
use core::sync::atomic::Ordering;
use embassy_futures::select::{Either3, select3};
use embassy_stm32::can::{Can, CanRx, CanTx, Frame as CanFrame, Id, Mailbox};
use embassy_stm32::pac;
use embassy_time::{Duration, Instant, Ticker, Timer, with_timeout};
use rig_control::{DriveCommand, DriveReading, SupplyReading};
use rmds405::{Action, Command, Event, Frame, Mode, QuadCounts, Received, Report, StartUp};

/// Period of the drive's motion reports (ms): its recommended data period.
const FEEDBACK_MS: u8 = 10;
/// Period of its reports of the supply (ms).
const SUPPLY_MS: u8 = 50;
/// How long the controller may wait for a quiet bus before it is tried again.
const ENABLE_WAIT: Duration = Duration::from_millis(200);
/// Pause after a bus error: an unacknowledged bus reports errors without end.
const ERROR_PAUSE: Duration = Duration::from_millis(5);

#[embassy_executor::task]
pub async fn run(mut can: Can<'static>) -> ! {
    // With RX stuck or floating, `enable` waits for ever.
    while with_timeout(ENABLE_WAIT, can.enable()).await.is_err() {
        defmt::warn!("CAN: no quiet bus; transceiver powered and terminated?");
        shared::alive(Task::Drive);
    }
    let (mut tx, mut rx) = can.split();
    let mut start_up = new_start_up();
    let mut ready = false;
    let mut ticker = Ticker::every(Duration::from_millis(10));
    loop {
        match select3(ticker.next(), next_report(&mut rx), shared::DRIVE_COMMAND.wait()).await {
            Either3::First(()) => {
                shared::alive(Task::Drive);
                // The controller comes back by itself when the bus is quiet again; by then the rig holds.
                if pac::CAN1.esr().read().boff() {
                    shared::BUS_OFF.store(true, Ordering::Relaxed);
                }
                if !ready {
                    ready = start(&mut start_up, Event::Tick, &mut tx);
                }
            }
            Either3::Second(report) => {
                if !ready {
                    ready = start(&mut start_up, Event::Report(report), &mut tx);
                }
                if ready {
                    take(report);
                }
            }
            Either3::Third(DriveCommand::Restart) => {
                shared::DRIVE.set(DriveReading::Starting);
                start_up = new_start_up();
                ready = false;
            }
            Either3::Third(DriveCommand::Follow { position_qc, speed_limit_rpm, current_limit_ma }) if ready => {
                match follow(position_qc, speed_limit_rpm, current_limit_ma) {
                    Some(frame) => send(&mut tx, &frame),
                    None => defmt::error!("drive command out of range: {} mA", current_limit_ma),
                }
            }
            Either3::Third(_) => {}
        }
    }
}

fn new_start_up() -> StartUp {
    // The period is a constant other than 0, the only value refused.
    defmt::unwrap!(StartUp::new(drive_address(), Mode::CurrentVelocityPosition, FEEDBACK_MS).ok()).with_mixed(SUPPLY_MS)
}

/// One step of the start-up sequence; true when the drive is ready.
fn start(start_up: &mut StartUp, event: Event, tx: &mut CanTx<'static>) -> bool {
    match start_up.step(Instant::now().as_millis(), event) {
        Action::Wait => false,
        Action::Send(frame) => {
            send(tx, &frame);
            false
        }
        Action::Ready => {
            defmt::info!("drive ready");
            true
        }
        Action::Failed(_) => {
            shared::DRIVE.set(DriveReading::Failed);
            false
        }
    }
}

fn take(report: Report) {
    match report {
        Report::Motion { current, speed, position } => shared::DRIVE.set(DriveReading::Reports {
            t_us: Instant::now().as_micros(),
            position_qc: position.0,
            speed_rpm: speed.0,
            current_ma: current.0,
        }),
        Report::Error(_) => shared::DRIVE_STALLED.store(true, Ordering::Relaxed),
        Report::Mixed(mixed) => {
            // Older drives do not report the analog input; where it is not wired it says nothing.
            if let (Some(rest), Some(divider)) = (mixed.rest, RIG.supply_divider) {
                let volts = f32::from(rest.asin_mv) * 1e-3 * divider;
                shared::SUPPLY.set(Some(SupplyReading { t_us: Instant::now().as_micros(), volts }));
            }
        }
        Report::Online => {}
    }
}

/// Mode 8: a jam is bounded by the current, a lost controller by the position (hardware.md 2.3).
fn follow(position_qc: i32, speed_limit_rpm: i16, current_limit_ma: i16) -> Option<Frame> {
    let command = Command::CurrentVelocityPosition {
        current_limit: rmds405::CurrentLimit::new(current_limit_ma.min(RIG.current_limit_ma)).ok()?,
        speed_limit: rmds405::SpeedLimit::new(speed_limit_rpm).ok()?,
        position: QuadCounts(position_qc),
    };
    Some(command.encode(drive_address()))
}

/// Sends now or not at all: a frame that nobody acknowledged must not go out seconds later (hardware.md 7.1).
fn send(tx: &mut CanTx<'static>, frame: &Frame) {
    if !tx.is_idle() {
        for mailbox in [Mailbox::Mailbox0, Mailbox::Mailbox1, Mailbox::Mailbox2] {
            tx.abort(mailbox);
        }
    }
    if let Ok(frame) = CanFrame::new_standard(frame.id, &frame.data) {
        let _ = tx.try_write(&frame);
    }
}

/// The drive's next report; everything else on the bus is counted.
async fn next_report(rx: &mut CanRx<'static>) -> Report {
    loop {
        match rx.read().await {
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
