//! Doors to the outside, each as a function of arbitrary bytes: what `fuzz_targets/door.rs` searches
//! with, and `host-tests/tests/studies/corpus.rs` plays again in every run. Each returns, or panics: that is the finding.
//!
//! - [`files`]: files, command lines and numbers that the host tool and the Python package are given.
//! - [`rigs`]: sensors, set-points and outside plants. The doors to wires and sockets are here.

pub mod files;
pub mod rigs;

use rig_link::messages::{Message, Request};
use rig_link::{Decoder, MAX_FRAME, encode};
use rmds405::{Address, Mode, Received, Report, StartUp, serial};
use std::path::{Path, PathBuf};

/// Takes whatever comes.
pub type Door = fn(&[u8]);

/// How many changed copies of its corpus a test tries in a door, in one that solves, emulates or starts a program, and in one
/// that fits: half a second each.
const MANY: usize = 20_000;
const SOME: usize = 300;
const FEW: usize = 30;

/// Every door, by the name of its corpus, with the number of changed copies that a test tries.
pub const DOORS: &[(&str, Door, usize)] = &[
    ("link", link, MANY),
    ("drive", drive, MANY),
    ("operator", operator, MANY),
    #[cfg(unix)]
    ("serve", serve, MANY),
    ("scene", files::scene_file, MANY),
    ("script", files::script, MANY),
    ("command_line", files::command_line, SOME),
    ("log", files::log, MANY),
    ("stored_settings", files::stored_settings, MANY),
    ("course", files::trajectory, MANY),
    ("python", files::python, SOME),
    ("control", rigs::control, MANY),
    ("stream", rigs::stream, SOME),
    #[cfg(unix)]
    ("plant_program", rigs::plant_program, SOME),
    ("surface", rigs::surface, SOME),
    ("identification", files::identification, FEW),
];

/// Does something with a file of these bytes; `None` if it cannot be written.
fn with_file<T>(name: &str, data: &[u8], work: impl FnOnce(&Path) -> T) -> Option<T> {
    let path: PathBuf = std::env::temp_dir().join(format!("rigctl-{name}-{}.csv", std::process::id()));
    std::fs::write(&path, data).ok()?;
    let result = work(&path);
    let _ = std::fs::remove_file(&path);
    Some(result)
}

/// Bytes on the host link, as board and as host; and a good frame in the midst of them must come through.
pub fn link(data: &[u8]) {
    let mut board = Decoder::<Request>::new();
    let mut host = Decoder::<Message>::new();
    for byte in data {
        if let Some(Ok(frame)) = board.push(*byte) {
            // What was understood can be said again.
            let mut buffer = [0; MAX_FRAME];
            assert!(encode(frame.sequence, &frame.body, &mut buffer).is_ok());
        }
        let _ = host.push(*byte);
    }
    let mut buffer = [0; MAX_FRAME];
    let good = encode(7, &Request::Stop, &mut buffer).expect("fits").to_vec();
    let understood = [0]
        .iter()
        .chain(&good)
        .filter_map(|byte| board.push(*byte))
        .any(|f| f.is_ok_and(|f| f.body == Request::Stop && f.sequence == 7));
    assert!(understood, "a good frame was lost");
}

/// Frames on the bus: ids, lengths and data of any kind, through both transports and the start-up sequence.
pub fn drive(data: &[u8]) {
    let address = Address::new(0, 1).expect("the default scene's");
    let mut start_up = StartUp::new(address, Mode::CurrentVelocityPosition, 10, 0);
    for (k, chunk) in data.chunks(11).enumerate() {
        let (head, body) = chunk.split_at(chunk.len().min(3));
        let at = |i: usize| head.get(i).copied().unwrap_or(0);
        let id = u16::from_le_bytes([at(0), at(1)]) & 0x7FF;
        let received = Received { id: u32::from(id), extended: at(2) & 1 != 0, remote: at(2) & 2 != 0, data: body };
        if let Ok(report) = Report::decode(address, &received) {
            let again = report.encode(address);
            assert_eq!(Report::decode(address, &again.received()), Ok(report), "a report changes when sent again");
            let _ = start_up.step(k as u64, Some(report));
        }
        let _ = start_up.step(k as u64, None);
    }
    // Over the serial line: every byte at any distance from the one before.
    let mut reports = serial::Decoder::reports();
    let mut commands = serial::Decoder::commands();
    let mut now_us = 0;
    for byte in data {
        now_us += if byte & 1 == 0 { serial::BYTE_US } else { 8 * u64::from(*byte) };
        if let Some(report) = reports.push(now_us, *byte) {
            assert_eq!(Report::of(report.function(), &report.data()), Ok(report), "a report changes when sent again");
        }
        let _ = commands.push(now_us, *byte);
    }
}

/// Values that an operator types: quantities, plant keys, load choices.
pub fn operator(data: &[u8]) {
    let Ok(text) = core::str::from_utf8(data) else { return };
    let (first, rest) = text.split_once('=').unwrap_or((text, ""));
    let _ = rig_plant::PlantSettings::default().set(first, rest);
    let _ = rigctl::request::load_choice(text);
    for quantity in [rigctl::units::Quantity::Length, rigctl::units::Quantity::Load, rigctl::units::Quantity::Speed] {
        if let Ok(value) = rigctl::units::parse("--to", quantity, text) {
            assert!(value.is_finite(), "{text} became {value}");
        }
    }
}

/// Lines that a program sends to `rigctl serve`: bounded, and each an order that a frame can hold, or an answer of one line.
#[cfg(unix)]
pub fn serve(data: &[u8]) {
    use rigctl::serve::{answer, client, order};
    // A buffer smaller than a line, so that lines come in pieces.
    let mut input = std::io::BufReader::with_capacity(64, data);
    while let Ok(Some(line)) = client::next(&mut input) {
        let order::Line { id, command } = match line {
            client::Line::Whole(bytes) => {
                assert!(bytes.len() <= client::LONGEST);
                order::Line::read(&bytes)
            }
            client::Line::TooLong => order::Line::too_long(),
        };
        match command {
            Ok(order::Command::Order(request)) => assert!(encode(1, &*request, &mut [0; MAX_FRAME]).is_ok()),
            Ok(order::Command::Status | order::Command::Release) => {}
            Err(refused) => {
                let text = answer(id.as_ref(), Err(refused));
                assert!(!text.contains('\n') && serde_json::from_str::<serde_json::Value>(&text).is_ok(), "{text}");
            }
        }
    }
}
