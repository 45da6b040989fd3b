//! The control tick, every 10 ms: readings in, commands out. All decisions are `rig_control`'s.

use crate::board::{CYCLES_PER_US, Leds, Start, Switches};
use crate::post_mortem;
use crate::scene::{RIG, TABLE};
use crate::shared::{self, TableInUse, Task};
use core::sync::atomic::Ordering;
use cortex_m::peripheral::DWT;
use embassy_stm32::peripherals::TIM3;
use embassy_stm32::timer::qei::Qei;
use embassy_time::{Duration, Instant, Ticker};
use rig_control::sensors::EncoderCount;
use rig_control::{Controller, DriveCommand, Inputs, Outputs, TICK_US};
use rig_link::messages::{Counters, Fault, Message, Request, State};
use static_cell::StaticCell;

/// One tick. Named and kept apart so that its instructions can be counted.
#[unsafe(no_mangle)]
#[inline(never)]
fn control_tick(rig: &mut Controller, inputs: &Inputs) -> Outputs {
    rig.step(inputs)
}

#[embassy_executor::task]
pub async fn run(encoder: Qei<'static, TIM3>, mut switches: Switches, mut leds: Leds, start: Start) -> ! {
    let settings = shared::SETTINGS_CORRUPT.load(Ordering::Relaxed).then_some(Fault::SettingsCorrupt);
    // A wrong clock first, because nothing may clear it. Then settings: the reset cause is also reported in the identity message, corrupt
    // settings only by this fault.
    let clock = start.fault().filter(|fault| *fault == Fault::ClockSource);
    let reset = clock.or(settings).or(start.fault());
    static CONTROL: StaticCell<Controller> = StaticCell::new();
    // The black box keeps the compiler from checking the table's checksum at compile time: the table in flash is checked.
    let rig = CONTROL.init(Controller::new(core::hint::black_box(&TABLE), RIG, reset));
    let (settings, mut settings_count) = shared::SETTINGS.get();
    rig.set_up(&settings);
    let mut count = EncoderCount::new(encoder.count());
    let mut ticker = Ticker::every(Duration::from_micros(TICK_US));
    let mut ticks = 0u32;
    let mut longest_tick_us = 0;
    loop {
        ticker.next().await;
        // A pause for writing flash: the drive holds, and readings are too old to be used. An emergency stop interrupts it for a tick,
        // in which the drive is told to forget its target.
        let estop_open = switches.estop.is_open();
        let new_stop = estop_open && rig.state() != State::EStop;
        let pause = shared::PAUSE_WANTED.load(Ordering::Acquire) && rig.stands() && !new_stop;
        shared::PAUSED.store(pause, Ordering::Release);
        if pause {
            shared::alive(Task::Control);
            rig.pause();
            continue;
        }
        if let Some(table) = shared::NEW_TABLE.try_take() {
            if rig.use_table(&table) {
                shared::TABLE.set(Some(TableInUse::of(&table.table())));
            } else {
                shared::NEW_TABLE.signal(table);
            }
        }
        let request = shared::REQUESTS.try_receive().ok();
        let inputs = Inputs {
            now_us: Instant::now().as_micros(),
            encoder_counts: count.update(encoder.count()),
            lvdt: shared::LVDT.get(),
            drive: shared::DRIVE.get(),
            drive_stalled: shared::DRIVE_STALLED.swap(false, Ordering::Relaxed),
            bus_off: shared::BUS_OFF.swap(false, Ordering::Relaxed),
            supply: shared::SUPPLY.get(),
            upper_limit_open: switches.upper_limit.is_open(),
            lower_limit_open: switches.lower_limit.is_open(),
            estop_open,
            host_heard_us: shared::HOST_HEARD_US.get(),
            request: request.map(|(_, request)| request),
        };
        let before = rig.state();
        let began = DWT::cycle_count();
        let outputs = control_tick(rig, &inputs);
        longest_tick_us = longest_tick_us.max(DWT::cycle_count().wrapping_sub(began) / CYCLES_PER_US);
        let driving = match outputs.drive {
            DriveCommand::Follow { .. } => true,
            DriveCommand::Voltage { pwm } => pwm != 0,
            _ => false,
        };
        post_mortem::set_driving(driving);
        shared::DRIVE_COMMAND.signal(outputs.drive);
        if let (Some((_, Request::TablePart(part))), Some(Ok(_))) = (request, outputs.reply)
            && shared::TABLE_PARTS.try_send(part).is_err()
        {
            defmt::error!("a part of a table came before the last one was taken");
        }
        if outputs.save_settings {
            settings_count += 1;
            let settings = (*rig.settings(), settings_count);
            shared::SETTINGS.set(settings);
            shared::SETTINGS_TO_SAVE.signal(settings);
        }
        if let (Some((to, _)), Some(result)) = (request, outputs.reply) {
            shared::post(Message::Reply { to, result });
        }
        for kind in outputs.events {
            defmt::info!("{}", kind);
            shared::post(Message::Event { t_us: inputs.now_us, kind });
        }
        if rig.state() != before {
            defmt::info!("{} -> {}", before, rig.state());
        }
        let counters = Counters {
            link_errors: shared::LINK_ERRORS.load(Ordering::Relaxed),
            foreign_frames: shared::FOREIGN_FRAMES.load(Ordering::Relaxed),
            late_ticks: rig.late_ticks(),
            unsent: shared::UNSENT.load(Ordering::Relaxed),
            longest_tick_us,
        };
        shared::SENSORS.set(Some(rig.sensors(&inputs, counters)));
        shared::show(outputs.telemetry);
        leds.fault.set_level(matches!(rig.state(), State::Fault | State::EStop).into());
        ticks = ticks.wrapping_add(1);
        if ticks.is_multiple_of(50) {
            leds.heartbeat.toggle();
        }
        shared::alive(Task::Control);
    }
}
