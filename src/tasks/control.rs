//! The control tick, every 10 ms: readings in, commands out. All decisions are `rig_control`'s.

use crate::board::{Leds, Start};
use crate::scene::RIG;
use crate::shared::{self, Task};
use core::sync::atomic::Ordering;
use embassy_stm32::gpio::Input;
use embassy_stm32::peripherals::TIM3;
use embassy_stm32::timer::qei::Qei;
use embassy_time::{Duration, Instant, Ticker};
use rig_control::sensors::EncoderCount;
use rig_control::{Inputs, Outputs, Rig, TICK_US};
use rig_link::messages::{Counters, Fault, Message, Request, ResetCause, State};
use static_cell::StaticCell;

/// One tick. Named and kept apart so that its instructions can be counted.
#[unsafe(no_mangle)]
#[inline(never)]
fn control_tick(rig: &mut Rig<'static>, inputs: &Inputs) -> Outputs {
    rig.step(inputs)
}

#[embassy_executor::task]
pub async fn run(encoder: Qei<'static, TIM3>, estop: Input<'static>, mut leds: Leds, start: Start) -> ! {
    let reset = match start.cause {
        ResetCause::Watchdog => Some(Fault::WatchdogReset),
        ResetCause::BrownOut | ResetCause::LowPower => Some(Fault::UnexpectedReset),
        _ => None,
    };
    static CONTROL: StaticCell<Rig<'static>> = StaticCell::new();
    // The black box keeps the compiler from checking the table's checksum at compile time: flash is what is asked.
    let rig = CONTROL.init(Rig::new(core::hint::black_box(shared::TABLE.get()), RIG, reset));
    let mut count = EncoderCount::new(encoder.count());
    let mut ticker = Ticker::every(Duration::from_micros(TICK_US));
    let mut ticks = 0u32;
    loop {
        ticker.next().await;
        // A pause for flash: the drive holds, and what is old by then says nothing.
        let pause = shared::PAUSE_WANTED.load(Ordering::Acquire) && rig.stands();
        shared::PAUSED.store(pause, Ordering::Release);
        if pause {
            shared::alive(Task::Control);
            continue;
        }
        if let Some(table) = shared::NEW_TABLE.try_take()
            && !rig.use_table(table)
        {
            shared::NEW_TABLE.signal(table);
        }
        let request = shared::REQUESTS.try_receive().ok();
        let inputs = Inputs {
            now_us: Instant::now().as_micros(),
            encoder_counts: count.update(encoder.count()),
            lvdt: shared::LVDT.get(),
            drive: shared::DRIVE.get(),
            drive_stalled: shared::DRIVE_STALLED.swap(false, Ordering::Relaxed),
            estop_open: estop.is_high(),
            host_heard_us: shared::HOST_HEARD_US.get(),
            request: request.map(|(_, request)| request),
            counters: Counters {
                link_errors: shared::LINK_ERRORS.load(Ordering::Relaxed),
                foreign_frames: shared::FOREIGN_FRAMES.load(Ordering::Relaxed),
            },
        };
        let before = rig.state();
        let outputs = control_tick(rig, &inputs);
        shared::DRIVE_COMMAND.signal(outputs.drive);
        if let (Some((_, Request::Rebuild(constants))), Some(Ok(_))) = (request, outputs.reply) {
            shared::REBUILD.signal(constants);
        }
        if let (Some((to, _)), Some(result)) = (request, outputs.reply) {
            // A full outbox means that the host has not read for a while; it will ask again.
            let _ = shared::OUTBOX.try_send(Message::Reply { to, result });
        }
        for kind in outputs.events {
            defmt::info!("{}", kind);
            let _ = shared::OUTBOX.try_send(Message::Event { t_us: inputs.now_us, kind });
        }
        if rig.state() != before {
            defmt::info!("{} -> {}", before, rig.state());
        }
        shared::TELEMETRY.signal(outputs.telemetry);
        leds.fault.set_level(matches!(rig.state(), State::Fault | State::EStop).into());
        ticks = ticks.wrapping_add(1);
        if ticks.is_multiple_of(50) {
            leds.heartbeat.toggle();
        }
        shared::alive(Task::Control);
    }
}
