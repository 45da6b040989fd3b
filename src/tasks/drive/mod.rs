//! The RMDS-405: start-up, a command every tick, its reports. Over [`can`], or over [`uart`] where the scene says so.

mod can;
mod uart;

use crate::board::drive_address;
use crate::scene::RIG;
use crate::shared::{self, Task};
use core::sync::atomic::Ordering;
use embassy_futures::select::{Either3, select3};
use embassy_stm32::can::Can;
use embassy_stm32::usart::BufferedUart;
use embassy_time::{Duration, Instant, Ticker};
use rig_control::{DriveCommand, DriveReading, SupplyReading};
use rmds405::{Action, Command, Event, Frame, Mode, QuadCounts, Report, StartUp};

/// Period of the drive's motion reports (ms): its recommended data period.
const FEEDBACK_MS: u8 = 10;
/// Period of its reports of the supply (ms); none where it is not wired: drives from before the manual
/// of July 2018 take the number for something else (hardware.md 4).
const SUPPLY_MS: u8 = if RIG.supply_divider.is_some() { 50 } else { 0 };

/// A way to the drive.
trait Transport {
    /// Sends a frame, or drops it: never late.
    async fn send(&mut self, frame: &Frame);

    /// The drive's next report; everything else that comes is counted. May be dropped at any await without loss.
    async fn next_report(&mut self) -> Report;

    /// Whether the controller has left the bus.
    fn bus_off(&self) -> bool;
}

#[embassy_executor::task]
pub async fn over_can(can: Can<'static>) -> ! {
    run(can::CanTransport::open(can).await).await
}

#[embassy_executor::task]
pub async fn over_uart(uart: BufferedUart<'static>) -> ! {
    run(uart::UartTransport::new(uart)).await
}

async fn run(mut line: impl Transport) -> ! {
    let mut start_up = new_start_up();
    let mut ready = false;
    let mut ticker = Ticker::every(Duration::from_millis(10));
    loop {
        let news = select3(ticker.next(), line.next_report(), shared::DRIVE_COMMAND.wait()).await;
        match news {
            Either3::First(()) => {
                shared::alive(Task::Drive);
                // The controller comes back by itself when the bus is quiet again; by then the rig holds.
                if line.bus_off() {
                    shared::BUS_OFF.store(true, Ordering::Relaxed);
                }
                if !ready {
                    ready = start(&mut start_up, Event::Tick, &mut line).await;
                }
            }
            Either3::Second(report) => {
                if !ready {
                    ready = start(&mut start_up, Event::Report(report), &mut line).await;
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
                    Some(frame) => line.send(&frame).await,
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
async fn start(start_up: &mut StartUp, event: Event, line: &mut impl Transport) -> bool {
    match start_up.step(Instant::now().as_millis(), event) {
        Action::Wait => false,
        Action::Send(frame) => {
            line.send(&frame).await;
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
