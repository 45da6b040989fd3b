//! Doors that lead to a rig: what sensors and drive say, what a host asks, what an outside plant answers.

use super::with_file;
use rig_control::{DriveCommand, DriveReading, Inputs, LvdtBlock, SupplyReading};
use rig_link::messages::{LoadChoice, Request, Setting, Telemetry};
use rig_plant::RigPreset;
use rig_plant::bench::{ControlBench, booted, constants, scene, table};
use rig_plant::rig::EmulatedRig;
use rig_plant::rig::outside::Outside;
use rig_plant::rig::outside::measured::Measured;
use rmds405::QuadCounts;
use std::sync::OnceLock;

/// Half a turn of the strings, and what the fastest move covers while the drive answers (motor counts).
fn max_lag() -> i64 {
    (constants().counts_per_rad * 30.0) as i64
}

fn check_telemetry(t: &Telemetry) {
    let told = [t.target_m, t.setpoint_m, t.position_m, t.twist_rad, t.load_n, t.tr_rad_per_m];
    assert!(told.into_iter().flatten().all(f32::is_finite), "{t:?}");
}

/// What sensors, drive and host may say in any order, to the control code: it never sends the drive far from where it
/// says it is, and every number that it tells is finite.
pub fn control(data: &[u8]) {
    let mut rig = booted();
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
            supply: (chunk[14] & 128 != 0).then_some(SupplyReading {
                t_us: now_us,
                volts: Some(value),
                on_motor: f32::from(word(4) as i16) / 5000.0,
            }),
            upper_limit_open: chunk[14] & 128 != 0 && chunk[12] == 2,
            lower_limit_open: chunk[14] & 128 != 0 && chunk[12] == 3,
            estop_open: chunk[14] & 32 != 0 && chunk[13] == 0,
            host_heard_us: (chunk[14] & 64 == 0).then_some(now_us),
            request,
        };
        let outputs = rig.step(&inputs);
        if let DriveCommand::Follow { position_qc, speed_limit_rpm, current_limit_ma } = outputs.drive {
            assert!(
                (i64::from(position_qc) - i64::from(position)).abs() <= max_lag(),
                "sent {position_qc} from {position}"
            );
            assert!(speed_limit_rpm >= 0 && (50..=constants().current_limit_ma).contains(&current_limit_ma));
            assert!(QuadCounts(position_qc).0 == position_qc);
        }
        check_telemetry(&outputs.telemetry);
    }
}

/// A rig of its own model that was homed.
fn homed() -> ControlBench {
    static HOMED: OnceLock<ControlBench> = OnceLock::new();
    let home = || {
        let mut bench = ControlBench::new(&[("load", "0.5kg"), ("twist_at_boot", "3.5")], 5);
        bench.home().unwrap_or_else(|e| panic!("{e}"));
        bench
    };
    HOMED.get_or_init(home).clone()
}

/// Set-points that a program streams to a homed rig, good and bad ones, at any distance in time, and other requests among
/// them: the strings never leave the twists of the table, and every number that the board tells is finite.
pub fn stream(data: &[u8]) {
    let mut bench = homed();
    let metadata = &table().metadata;
    for chunk in data.chunks_exact(8).take(40) {
        let half = |k: usize| f32::from(i16::from_le_bytes([chunk[k], chunk[k + 1]]));
        let raw = f32::from_le_bytes([chunk[2], chunk[3], chunk[4], chunk[5]]);
        // Up to 33 mm and 66 mm/s either way: the travel of the default scene is half of that.
        let (position_m, speed_m_per_s, for_s) = (1e-6 * half(2), 2e-6 * half(4), f32::from(chunk[6]) / 200.0);
        let request = match chunk[0] & 15 {
            0 => Request::Stop,
            1 => Request::Clear,
            2 => Request::HOME,
            3 => Request::Jog { twist_speed_rad_per_s: raw },
            4 => Request::Move { target_m: position_m, speed_m_per_s, load: LoadChoice::Auto },
            5 => Request::Move { target_m: position_m, speed_m_per_s: f32::INFINITY, load: LoadChoice::Known(raw) },
            6 => Request::Track { position_m: raw, speed_m_per_s: 0.0, for_s },
            7 => Request::Track { position_m, speed_m_per_s: raw, for_s },
            8 => Request::Track { position_m, speed_m_per_s, for_s: raw },
            _ => Request::Track { position_m, speed_m_per_s, for_s },
        };
        bench.host_alive = chunk[0] & 16 == 0;
        bench.tick(Some(request));
        for _ in 0..chunk[7] & 31 {
            let tick = bench.tick(None);
            check_telemetry(&tick.telemetry);
            if let DriveCommand::Follow { speed_limit_rpm, .. } = tick.drive {
                assert!(speed_limit_rpm >= 0);
            }
            let truth = bench.truth();
            assert!(
                truth.twist_rad.abs() <= f64::from(metadata.twist_max_rad) + 0.5 && truth.gap_m.is_finite(),
                "{request:?}: {truth:?}"
            );
        }
    }
}

/// What a plant program prints, whatever it is asked: the run ends with an error, or the rig has finite numbers.
#[cfg(unix)]
pub fn plant_program(data: &[u8]) {
    // Once `start` and `set` are answered, the last lines come again and again.
    let lines: Vec<&[u8]> = data.split_inclusive(|byte| *byte == b'\n').collect();
    let mut text = data.to_vec();
    let last = &lines[lines.len().min(2)..];
    while !last.is_empty() && text.len() < 20_000 {
        last.iter().for_each(|line| text.extend_from_slice(line));
    }
    with_file("plant-program", &text, |path| {
        let program = Outside::Program(format!("cat {}", path.display()));
        let Ok(rig) = EmulatedRig::from_outside(scene(), RigPreset::Ideal, &[], 1, &program) else { return };
        let mut bench = ControlBench::on(rig, booted());
        for k in 0..100 {
            let jog = Request::Jog { twist_speed_rad_per_s: 2.0 };
            let tick = bench.tick((k == 60).then_some(jog));
            check_telemetry(&tick.telemetry);
            let t = bench.truth();
            let true_numbers = [t.gap_m, t.gap_speed_m_per_s, t.twist_rad, t.pull_n, t.string_torque_nm];
            let motor = [t.motor_angle_rad, t.motor_speed_rad_per_s, t.motor_current_a, t.motor_energy_j];
            assert!(true_numbers.into_iter().chain(motor).all(f64::is_finite), "{t:?}");
            if bench.rig.plant_failure().is_some() {
                return;
            }
        }
    });
}

/// A file of measured gaps: refused, or a rig that hangs from them, with finite numbers.
pub fn surface(data: &[u8]) {
    let Ok(text) = core::str::from_utf8(data) else { return };
    let (up, down) = text.split_once("\n\n").unwrap_or((text, text));
    let _ = Measured::parse_two([up, down]);
    let Ok(measured) = Measured::parse(text) else { return };
    for (load_n, twist_rad) in [(0.1, 0.0), (0.5, 3.2), (5.0, 20.0), (17.0, 50.0)] {
        if let Some(point) = measured.gap(twist_rad, load_n) {
            let numbers = [point.gap_m, point.by_twist_m_per_rad, point.by_load_m_per_n];
            assert!(numbers.into_iter().all(f64::is_finite), "{load_n} N, {twist_rad} rad: {point:?}");
        }
    }
    let outside = Outside::Measured(measured);
    let Ok(rig) = EmulatedRig::from_outside(scene(), RigPreset::Hard, &[], 1, &outside) else { return };
    let mut bench = ControlBench::on(rig, booted());
    for _ in 0..10 {
        check_telemetry(&bench.tick(None).telemetry);
    }
    let t = bench.truth();
    assert!([t.gap_m, t.twist_rad, t.pull_n, t.string_torque_nm].into_iter().all(f64::is_finite), "{t:?}");
}
