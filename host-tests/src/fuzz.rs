//! Doors to the outside, each as a function of arbitrary bytes: what `fuzz/` searches with, and what
//! `tests/corpus.rs` plays again in every run. Each returns, or panics: that is the finding.

use crate::{constants, table};
use rig_control::{DriveCommand, DriveReading, Inputs, LvdtBlock, Rig, SupplyReading, settings};
use rig_link::messages::{Counters, Kept, LoadChoice, Message, Request, Setting};
use rig_link::{Decoder, MAX_FRAME, encode};
use rig_scene::Scene;
use rmds405::{Address, Event, Mode, QuadCounts, Received, Report, StartUp, serial};
use std::path::PathBuf;

/// Takes whatever comes.
pub type Door = fn(&[u8]);

/// Every door, by the name of its corpus.
pub const DOORS: [(&str, Door); 8] = [
    ("link", link),
    ("drive", drive),
    ("scene", scene),
    ("script", script),
    ("operator", operator),
    ("log", log),
    ("control", control),
    ("stored_settings", stored_settings),
];

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
    let mut start_up = StartUp::new(address, Mode::CurrentVelocityPosition, 10).expect("a period above 0");
    for (k, chunk) in data.chunks(11).enumerate() {
        let (head, body) = chunk.split_at(chunk.len().min(3));
        let at = |i: usize| head.get(i).copied().unwrap_or(0);
        let id = u16::from_le_bytes([at(0), at(1)]) & 0x7FF;
        let received = Received { id: u32::from(id), extended: at(2) & 1 != 0, remote: at(2) & 2 != 0, data: body };
        if let Ok(report) = Report::decode(address, &received) {
            let again = report.encode(address);
            assert_eq!(Report::decode(address, &again.received()), Ok(report), "a report changes when sent again");
            let _ = start_up.step(k as u64, Event::Report(report));
        }
        let _ = start_up.step(k as u64, Event::Tick);
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

/// A scene file: refused, or a mechanism that answers or refuses by name.
pub fn scene(data: &[u8]) {
    let Ok(text) = core::str::from_utf8(data) else { return };
    let Ok(scene) = Scene::from_toml_str(text) else { return };
    let _ = (scene.hash(), scene.table_demand(), scene.check_rig());
    if let Ok(mechanism) = scene.mechanism() {
        for (load, twist) in [(0.5, 3.2), (5.0, 20.0), (17.0, 50.0)] {
            if let Ok(e) = mechanism.solve(load, twist) {
                assert!(e.gap_m.is_finite() && e.dgap_dtwist_m_per_rad.is_finite(), "{e:?}");
            }
        }
    }
}

/// A script.
pub fn script(data: &[u8]) {
    if let Ok(text) = core::str::from_utf8(data) {
        let _ = rigctl::script::Script::parse(text);
    }
}

/// Values that an operator types: quantities, plant keys, load choices.
pub fn operator(data: &[u8]) {
    let Ok(text) = core::str::from_utf8(data) else { return };
    let (first, rest) = text.split_once('=').unwrap_or((text, ""));
    let _ = rig_emulator::rig::plant_settings::PlantSettings::default().set(first, rest);
    let _ = rigctl::script::load_choice(text);
    for quantity in [rigctl::units::Quantity::Length, rigctl::units::Quantity::Load, rigctl::units::Quantity::Speed] {
        if let Ok(value) = rigctl::units::parse("--to", quantity, text) {
            assert!(value.is_finite(), "{text} became {value}");
        }
    }
}

/// A recorded log or a file of loads and turns.
pub fn log(data: &[u8]) {
    if let Ok(text) = core::str::from_utf8(data)
        && let Ok(log) = rigctl::log::Log::parse(text)
    {
        let _ = rigctl::replay::replay(&log, crate::scene(), table());
    }
    let path: PathBuf = std::env::temp_dir().join(format!("rigctl-log-{}.csv", std::process::id()));
    if std::fs::write(&path, data).is_ok() {
        let _ = rigctl::batch::read(&path);
        let _ = rigctl::identify::data::sweeps(crate::scene(), &[&path], true);
        let _ = std::fs::remove_file(&path);
    }
}

/// Bytes that flash may hold as settings (witness, then record), and the file of a backup.
pub fn stored_settings(data: &[u8]) {
    let rig = constants();
    let defaults = settings::defaults(&rig);
    let (witness, record) = data.split_at(data.len().min(4));
    for (record, witness) in [(Some(record), Some(witness)), (Some(data), None), (None, Some(data))] {
        let loaded = settings::read(record, witness, &rig);
        assert!(loaded.values.check(&defaults).is_ok(), "{loaded:?}");
        assert!(matches!(loaded.kept, Kept::These | Kept::Partly) || loaded.values == defaults, "{loaded:?}");
        assert_eq!(loaded.kept == Kept::Partly, !loaded.dropped.is_empty(), "{loaded:?}");
    }
    if let Ok(text) = core::str::from_utf8(data)
        && let Ok(backup) = rigctl::backup::from_toml(text, &defaults)
    {
        assert!(backup.values.check(&defaults).is_ok(), "{backup:?}");
    }
}

/// What sensors, drive and host may say in any order, to the control code: it never sends the drive far from where it
/// says it is, and every number that it tells is finite.
pub fn control(data: &[u8]) {
    let mut rig = Rig::new(table(), constants(), None);
    let (mut now_us, mut counts, mut position) = (0u64, 0i64, 0i32);
    for chunk in data.chunks_exact(16) {
        let word = |k: usize| i32::from_le_bytes([chunk[k], chunk[k + 1], chunk[k + 2], chunk[k + 3]]);
        let value = f32::from_bits(word(8) as u32);
        now_us += 10_000;
        counts = counts.wrapping_add(i64::from(word(0) >> (chunk[12] & 31)));
        position = position.wrapping_add(word(4) >> (chunk[13] & 31));
        let drive = match chunk[14] & 7 {
            0 => DriveReading::Starting,
            1 => DriveReading::Failed,
            _ => DriveReading::Reports {
                t_us: now_us.saturating_sub(u64::from(chunk[15]) * 300),
                position_qc: position,
                speed_rpm: word(4) as i16,
                current_ma: word(0) as i16,
            },
        };
        let codes: Vec<u16> = (0..256u16).map(|k| (word(0) as u16 & 0xFFF).wrapping_add(k & 3) & 0xFFF).collect();
        let request = match chunk[15] >> 4 {
            1 => Some(Request::HOME),
            2 => Some(Request::Move { target_m: value, speed_m_per_s: 0.002, load: LoadChoice::Auto }),
            3 => Some(Request::Move { target_m: 0.004, speed_m_per_s: value, load: LoadChoice::Known(value) }),
            4 => Some(Request::Jog { twist_speed_rad_per_s: value }),
            5 | 6 => Some(Request::Stop),
            7 => Some(Request::Clear),
            8 => Setting::from_code(chunk[12] & 7).map(|setting| Request::SetSetting { setting, value }),
            // Some that are good: the other way round, another gear, a lower current.
            9 => Some(Request::SetSetting { setting: Setting::TwistSign, value: 1f32.copysign(value) }),
            10 => Some(Request::SetSetting { setting: Setting::GearScale, value: f32::from(chunk[12] & 127) / 64.0 }),
            11 => Some(Request::SetSetting { setting: Setting::CurrentLimit, value: f32::from(chunk[12]) / 500.0 }),
            _ => None,
        };
        let inputs = Inputs {
            now_us,
            encoder_counts: counts,
            lvdt: (chunk[14] & 8 == 0).then(|| LvdtBlock::from_codes(now_us, &codes)).flatten(),
            drive,
            drive_stalled: chunk[14] & 16 != 0 && chunk[12] == 0,
            bus_off: chunk[14] & 128 != 0 && chunk[12] == 1,
            supply: (chunk[14] & 128 != 0).then_some(SupplyReading { t_us: now_us, volts: value }),
            upper_limit_open: chunk[14] & 128 != 0 && chunk[12] == 2,
            lower_limit_open: chunk[14] & 128 != 0 && chunk[12] == 3,
            estop_open: chunk[14] & 32 != 0 && chunk[13] == 0,
            host_heard_us: (chunk[14] & 64 == 0).then_some(now_us),
            request,
        };
        let outputs = rig.step(&inputs);
        if let DriveCommand::Follow { position_qc, speed_limit_rpm, current_limit_ma } = outputs.drive {
            // Half a turn of the strings, and what the fastest move covers while the drive answers.
            let leash = (constants().counts_per_rad * 30.0) as i64;
            assert!(
                (i64::from(position_qc) - i64::from(position)).abs() <= leash,
                "sent {position_qc} from {position}"
            );
            assert!(speed_limit_rpm >= 0 && (50..=constants().current_limit_ma).contains(&current_limit_ma));
            assert!(QuadCounts(position_qc).0 == position_qc);
        }
        let t = rig.telemetry(&inputs, Counters::default());
        let told = [t.target_m, t.setpoint_m, t.position_m, t.twist_rad, t.load_n, t.tr_rad_per_m];
        assert!(told.into_iter().flatten().all(f32::is_finite), "{t:?}");
    }
}
