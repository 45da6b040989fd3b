//! The RMDS-405 drive: its start-up, a command in every tick, and its reports, over [`can`] or [`uart`] as the scene
//! says. The conversation itself is [`rmds405::Conversation`]; this task gives it the time, the line and the
//! motor-power pin.

mod can;
mod uart;

use crate::board::drive_address;
use crate::scene::RIG;
use crate::shared::{self, Task};
use core::sync::atomic::Ordering;
use embassy_futures::select::{Either3, select3};
use embassy_stm32::can::Can;
use embassy_stm32::gpio::Output;
use embassy_stm32::usart::BufferedUart;
use embassy_time::{Duration, Instant, Ticker};
use rmds405::{Conversation, Frame, Report};

/// A line to the drive.
trait Transport {
    /// Sends a frame at once, or drops it: a late frame could move the drive unexpectedly.
    async fn send(&mut self, frame: &Frame);

    /// Withdraws a frame that nobody has acknowledged. A drive that starts late would take a Reset for a new one.
    fn abandon(&mut self);

    /// The drive's next report; everything else that arrives is counted. Dropping the future at any await loses
    /// nothing.
    async fn next_report(&mut self) -> Report;

    /// Whether the CAN controller is in the bus-off state.
    fn bus_off(&self) -> bool;
}

#[embassy_executor::task]
pub async fn over_can(can: Can<'static>, motor_power: Output<'static>) -> ! {
    run(can::CanTransport::open(can).await, motor_power).await
}

#[embassy_executor::task]
pub async fn over_uart(uart: BufferedUart<'static>, motor_power: Output<'static>) -> ! {
    run(uart::UartTransport::new(uart), motor_power).await
}

async fn run(mut line: impl Transport, mut motor_power: Output<'static>) -> ! {
    let mut drive = Conversation::new(drive_address(), RIG.supply_divider);
    let mut ticker = Ticker::every(Duration::from_millis(10));
    loop {
        let news = select3(ticker.next(), line.next_report(), shared::DRIVE_COMMAND.wait()).await;
        let now_us = Instant::now().as_micros();
        let frame = match news {
            Either3::First(()) => {
                shared::alive(Task::Drive);
                line.abandon();
                // The controller leaves the bus-off state by itself when the bus is quiet; by then the rig holds.
                if line.bus_off() {
                    shared::BUS_OFF.store(true, Ordering::Relaxed);
                }
                drive.tick(now_us)
            }
            Either3::Second(report) => drive.hear(now_us, report),
            Either3::Third(command) => drive.command(now_us, command).unwrap_or_else(|_| {
                defmt::error!("drive command out of range");
                None
            }),
        };
        if let Some(frame) = frame {
            line.send(&frame).await;
        }
        // Set after the frame is sent: the drive must drop its old target before the motor gets power.
        motor_power.set_level(drive.motor_power().into());
        shared::DRIVE.set(drive.reading());
        shared::SUPPLY.set(drive.supply());
        if drive.take_stall() {
            shared::DRIVE_STALLED.store(true, Ordering::Relaxed);
        }
    }
}
