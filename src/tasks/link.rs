//! The host link: frames in, replies, events and telemetry out.

use crate::board::Start;
use crate::serial::Transmitter;
use crate::shared::{self, TableInUse, Task};
use core::sync::atomic::Ordering;
use embassy_futures::select::{Either, select};
use embassy_stm32::usart::BufferedUartRx;
use embassy_time::{Duration, Instant, with_timeout};
use embedded_io_async::Read;
use heapless::String;
use rig_link::messages::{Accepted, Identity, LoadChoice, Message, Refusal, Request, State, TableIdentity, Versions};
use rig_link::sequence::Newest;
use rig_link::{Decoder, MAX_FRAME, PROTOCOL_HASH, encode};

/// The task waits for bytes no longer than this, so that a silent host does not look like a dead task.
const QUIET: Duration = Duration::from_millis(50);

/// What this firmware greets with.
const VERSIONS: Versions = Versions::own(env!("CARGO_PKG_VERSION"), env!("TSA_GIT"));

#[embassy_executor::task]
pub async fn receive(mut rx: BufferedUartRx<'static>, start: Start) -> ! {
    let mut decoder = Decoder::<Request>::new();
    // Only a host with the same protocol may move anything.
    let mut greeted = false;
    let mut newest = Newest::new();
    let mut bytes = [0; 64];
    loop {
        shared::alive(Task::Link);
        let count = match with_timeout(QUIET, rx.read(&mut bytes)).await {
            Ok(Ok(count)) => count,
            Ok(Err(_)) => {
                decoder.line_error();
                0
            }
            Err(_) => 0,
        };
        for byte in &bytes[..count] {
            if let Some(Ok(frame)) = decoder.push(*byte) {
                shared::HOST_HEARD_US.set(Some(Instant::now().as_micros()));
                take(frame.sequence, frame.body, &mut greeted, &mut newest, &start);
            }
        }
        shared::LINK_ERRORS.store(decoder.errors(), Ordering::Relaxed);
    }
}

fn take(sequence: u16, request: Request, greeted: &mut bool, newest: &mut Newest, start: &Start) {
    let reply = |result| {
        shared::post(Message::Reply { to: sequence, result });
    };
    match request {
        Request::Heartbeat => {}
        Request::Hello(host) => {
            *greeted = host.check_board(&VERSIONS).is_ok();
            newest.begin(sequence);
            // All that a host of another protocol understands.
            shared::post(Message::Hello(VERSIONS));
            reply(if *greeted { Ok(Accepted::Done) } else { Err(Refusal::NotGreeted) });
            if *greeted {
                shared::post(Message::Identity(identity(start)));
            }
        }
        Request::Status => {
            reply(Ok(Accepted::Done));
            shared::post(Message::Identity(identity(start)));
        }
        Request::GetSettings => {
            reply(Ok(Accepted::Done));
            shared::post(Message::Settings(shared::settings_report()));
        }
        Request::ReadSensors => match shared::SENSORS.get() {
            Some(sensors) => {
                reply(Ok(Accepted::Done));
                shared::post(Message::Sensors(sensors));
            }
            // Before the first tick.
            None => reply(Err(Refusal::Busy { state: State::Boot })),
        },
        Request::Stop => {
            // A stop overtakes all that waits, so that nothing moves before it and a full queue cannot refuse it.
            while let Ok((to, waiting)) = shared::REQUESTS.try_receive() {
                let done = matches!(waiting, Request::Stop);
                let result = if done { Ok(Accepted::Done) } else { Err(Refusal::Stopped) };
                shared::post(Message::Reply { to, result });
            }
            queue(sequence, request);
        }
        Request::Move { load: LoadChoice::Auto | LoadChoice::Known(_), .. }
        | Request::Home { load: LoadChoice::Auto | LoadChoice::Known(_) }
        | Request::Track { .. }
        | Request::Jog { .. }
        | Request::Clear
        | Request::CheckDirection
        | Request::TablePart(_)
        | Request::SetSetting { .. }
        | Request::SetSettings(_) => {
            if !*greeted {
                reply(Err(Refusal::NotGreeted));
            } else if newest.is_new(sequence) {
                queue(sequence, request);
            } else {
                reply(Err(Refusal::Repeated));
            }
        }
    }
}

fn queue(sequence: u16, request: Request) {
    if shared::REQUESTS.try_send((sequence, request)).is_err() {
        shared::post(Message::Reply { to: sequence, result: Err(Refusal::TooMany) });
    }
}

/// The part of a text that fits.
fn text<const N: usize>(value: &str) -> String<N> {
    String::try_from(&value[..value.floor_char_boundary(N)]).unwrap_or_default()
}

fn identity(start: &Start) -> Identity {
    let sent = shared::TABLE.get();
    let table = sent.unwrap_or_else(|| TableInUse::of(&crate::scene::TABLE));
    let m = &table.metadata;
    let turns = |twist_rad: f32| (twist_rad - core::f32::consts::PI) / core::f32::consts::TAU;
    Identity {
        version: text(env!("CARGO_PKG_VERSION")),
        git: text(env!("TSA_GIT")),
        protocol_hash: PROTOCOL_HASH,
        scene_hash: m.scene_hash,
        rig_hash: crate::scene::RIG_HASH,
        table: TableIdentity {
            form: text(tsa_table::FORM),
            bytes: table.bytes as u16,
            contraction_error_m: m.contraction_error_m,
            tr_relative_error: m.tr_relative_error,
            load_min_n: m.load_min_n,
            load_max_n: m.load_max_n,
            turns_min: turns(m.twist_min_rad),
            turns_max: turns(m.twist_max_rad),
            crc: table.crc,
            sent: sent.is_some(),
        },
        reset_cause: start.cause,
        clock: start.clock,
        brown_out_level: crate::board::brown_out_level(),
        boot_count: start.boot_count,
        last_panic: start.last_panic.clone(),
    }
}

#[embassy_executor::task]
pub async fn send(mut tx: Transmitter<'static>) -> ! {
    let mut sequence = 0u16;
    let mut buffer = [0; MAX_FRAME];
    // Ends a frame that a reset has cut short, so that our first frame is not lost with it.
    tx.write_all(&[0]).await;
    loop {
        let message = match select(shared::OUTBOX.receive(), shared::TELEMETRY.wait()).await {
            Either::First(message) => message,
            Either::Second(telemetry) => Message::Telemetry(telemetry),
        };
        sequence = sequence.wrapping_add(1);
        match encode(sequence, &message, &mut buffer) {
            Ok(frame) => tx.write_all(frame).await,
            Err(_) => defmt::error!("message longer than a frame"),
        }
    }
}
