//! What causes each fault of a rig that moves. What is near and must not is in `crates/rig-control/tests/control/faults.rs` and,
//! on the board, in the scripts of `crates/rigctl/tests/tool/faults.rs`.

use host_tests::ControlBench;
use rig_control::Inputs;
use rig_control::sensors::DriveReading;
use rig_link::messages::{Fault, LoadChoice, Request, State};
use rig_plant::RigFault;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, OnceLock};

/// What happens to a rig that is moving.
pub type Happens = fn(&mut ControlBench);

pub const fn go(target_m: f32, speed_m_per_s: f32) -> Request {
    Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto }
}

/// A homed rig, 2 s into a slow move up.
pub fn moving() -> ControlBench {
    static BENCH: OnceLock<ControlBench> = OnceLock::new();
    let bench = BENCH.get_or_init(|| {
        let mut d = ControlBench::new(&[("load", "0.5kg"), ("twist_at_boot", "5")], 6);
        d.home().unwrap();
        d.tick(Some(go(0.014, 0.001)));
        d.run(2.0);
        assert_eq!(d.control.state(), State::Moving);
        d
    });
    bench.clone()
}

/// From now on, besides what is tampered with already.
pub fn tamper(d: &mut ControlBench, with: impl Fn(&mut Inputs) + Send + Sync + 'static) {
    let before = d.tamper.take();
    d.tamper = Some(Arc::new(move |inputs| {
        if let Some(before) = &before {
            before(inputs);
        }
        with(inputs);
    }));
}

/// The causes go: the host is heard, wires and sensors are whole, supply, friction and load as they were.
pub fn mend(d: &mut ControlBench) {
    (d.host_alive, d.tamper) = (true, None);
    RigFault::ALL.iter().for_each(|fault| d.rig.set_fault(*fault, false));
    for (key, value) in [("supply_voltage", "24V"), ("friction", "0.05N"), ("load", "0.5kg")] {
        d.rig.set_plant(key, value).unwrap();
    }
}

/// Ticks come late by so much: the first of them only, before drive and LVDT are heard again, or every other of twelve.
fn late(d: &mut ControlBench, late_us: u64, again: bool) {
    let ticks = AtomicU32::new(0);
    tamper(d, move |i| {
        let tick = ticks.fetch_add(1, Ordering::Relaxed);
        let late = if again { tick.is_multiple_of(2) && tick < 12 } else { true };
        i.now_us += if late { late_us } else { 0 };
        if !again && tick > 0 {
            if let DriveReading::Reports { t_us, .. } = &mut i.drive {
                *t_us += late_us;
            }
            if let Some(block) = &mut i.lvdt {
                block.t_us += late_us;
            }
        }
    });
}

/// The encoder loses counts from now on: a fifth of all further ones.
fn encoder_slips(d: &mut ControlBench) {
    let start = OnceLock::new();
    tamper(d, move |i| {
        let from = *start.get_or_init(|| i.encoder_counts);
        i.encoder_counts -= (i.encoder_counts - from) / 5;
    });
}

pub fn lvdt_mean(i: &mut Inputs, mean_code: f32) {
    if let Some(block) = &mut i.lvdt {
        block.mean_code = mean_code;
    }
}

pub fn drive_position(i: &mut Inputs, change: impl Fn(&mut i32)) {
    if let DriveReading::Reports { position_qc, .. } = &mut i.drive {
        change(position_qc);
    }
}

/// A block that is 60 ms old.
fn lvdt_stalls(i: &mut Inputs) {
    if let Some(block) = &mut i.lvdt {
        block.t_us = block.t_us.saturating_sub(60_000);
    }
}

/// It starts without a drive.
fn drive_missing(d: &mut ControlBench) {
    *d = ControlBench::new(&[], 6);
    d.rig.set_fault(RigFault::CanSilent, true);
}

/// The fault, within how many seconds, and what causes it.
pub const CASES: [(Fault, f64, Happens); 22] = [
    (Fault::HostSilent, 0.51, |d| d.host_alive = false),
    (Fault::TickLate, 0.05, |d| late(d, 60_000, false)),
    (Fault::TickLate, 0.3, |d| late(d, 7000, true)),
    (Fault::DriveSilent, 0.1, |d| d.rig.set_fault(RigFault::CanSilent, true)),
    (Fault::CanBusOff, 0.02, |d| tamper(d, |i| i.bus_off = true)),
    (Fault::DriveStartUp, 5.0, drive_missing),
    (Fault::DriveStall, 0.2, |d| d.rig.set_fault(RigFault::DriveStall, true)),
    (Fault::EncoderStuck, 0.3, |d| d.rig.set_fault(RigFault::EncoderStuck, true)),
    (Fault::EncoderJump, 0.2, |d| d.rig.set_fault(RigFault::EncoderJump, true)),
    (Fault::EncoderJump, 0.02, |d| tamper(d, |i| i.encoder_counts += 60_000)),
    (Fault::EncoderDisagrees, 1.0, encoder_slips),
    (Fault::LvdtOpen, 0.2, |d| d.rig.set_fault(RigFault::LvdtOpen, true)),
    (Fault::LvdtShort, 0.2, |d| d.rig.set_fault(RigFault::LvdtShort, true)),
    (Fault::LvdtNoisy, 0.3, |d| d.rig.set_fault(RigFault::LvdtNoisy, true)),
    (Fault::LvdtFrozen, 0.6, |d| d.rig.set_fault(RigFault::LvdtFrozen, true)),
    (Fault::LvdtStalled, 0.3, |d| tamper(d, lvdt_stalls)),
    (Fault::StringBreak, 1.0, |d| d.rig.set_fault(RigFault::StringBreak, true)),
    (Fault::FollowingError, 4.0, |d| d.rig.set_plant("friction", "60N").unwrap()),
    (Fault::NotFinite, 0.2, |d| tamper(d, |i| lvdt_mean(i, f32::NAN))),
    (Fault::Supply, 0.4, |d| d.rig.set_plant("supply_voltage", "15V").unwrap()),
    (Fault::Supply, 0.4, |d| d.rig.set_plant("supply_voltage", "30V").unwrap()),
    (Fault::LimitSwitch, 0.05, |d| d.rig.set_fault(RigFault::LimitSwitch, true)),
];
