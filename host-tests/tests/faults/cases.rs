//! What makes each fault fire, and what is near and must not.

use host_tests::ControlBench;
use rig_control::Inputs;
use rig_control::sensors::DriveReading;
use rig_link::messages::{Fault, LoadChoice, Request, State};
use rig_plant::RigFault;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, OnceLock};

/// What happens to a rig that is moving.
pub type Happens = fn(&mut ControlBench);

/// A homed rig, 2 s into a slow move up.
pub fn moving() -> ControlBench {
    static BENCH: OnceLock<ControlBench> = OnceLock::new();
    let bench = BENCH.get_or_init(|| {
        let mut d = ControlBench::new(&[("load", "0.5kg"), ("twist_at_boot", "5")], 6);
        d.home().unwrap();
        d.tick(Some(Request::Move { target_m: 0.014, speed_m_per_s: 0.001, load: LoadChoice::Auto }));
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

/// For so many seconds, then no more.
pub fn tamper_for(d: &mut ControlBench, seconds: f64, with: impl Fn(&mut Inputs) + Send + Sync + 'static) {
    tamper(d, with);
    d.run(seconds);
    d.tamper = None;
}

pub fn rig_fault_for(d: &mut ControlBench, fault: RigFault, seconds: f64) {
    d.rig.set_fault(fault, true);
    d.run(seconds);
    d.rig.set_fault(fault, false);
}

/// Adds to the time from now on: the next tick comes that much late, before drive and LVDT are heard again.
pub fn late_by(d: &mut ControlBench, late_us: u64) {
    let came = AtomicBool::new(false);
    tamper(d, move |i| {
        i.now_us += late_us;
        if came.swap(true, Ordering::Relaxed) {
            if let DriveReading::Reports { t_us, .. } = &mut i.drive {
                *t_us += late_us;
            }
            if let Some(block) = &mut i.lvdt {
                block.t_us += late_us;
            }
        }
    });
}

/// Every other tick so late, `count` times.
pub fn late_now_and_then(d: &mut ControlBench, late_us: u64, count: u32) {
    let ticks = AtomicU32::new(0);
    tamper(d, move |i| {
        let tick = ticks.fetch_add(1, Ordering::Relaxed);
        i.now_us += if tick.is_multiple_of(2) && tick < 2 * count { late_us } else { 0 };
    });
}

/// The encoder gains or loses counts from now on: `share` of all further ones.
pub fn encoder_slips(d: &mut ControlBench, share: f64) {
    let start = OnceLock::new();
    tamper(d, move |i| {
        let from = *start.get_or_init(|| i.encoder_counts);
        i.encoder_counts -= ((i.encoder_counts - from) as f64 * share) as i64;
    });
}

pub fn lvdt_mean(i: &mut Inputs, mean_code: f32) {
    if let Some(block) = &mut i.lvdt {
        block.mean_code = mean_code;
    }
}

pub fn drive_current(i: &mut Inputs, milliamps: i16) {
    if let DriveReading::Reports { current_ma, .. } = &mut i.drive {
        *current_ma = milliamps;
    }
}

/// A hand turns the shaft by 20 000 counts within 0.1 s: encoder and drive both see it.
pub fn turn_by_hand(i: &mut Inputs, start_us: u64) {
    let turned = (i.now_us.saturating_sub(start_us) as f64 * 0.2).min(20_000.0);
    i.encoder_counts += turned as i64;
    if let DriveReading::Reports { position_qc, .. } = &mut i.drive {
        *position_qc += turned as i32;
    }
}

/// Row of the list of faults to survive, the fault, within how many seconds, what causes it, and what nearly does.
pub const CASES: [(u8, Fault, f64, Happens, Happens); 22] = [
    (
        1,
        Fault::HostSilent,
        0.51,
        |d| d.host_alive = false,
        |d| {
            d.host_alive = false;
            d.run(0.25);
            d.host_alive = true;
        },
    ),
    (2, Fault::TickLate, 0.05, |d| late_by(d, 60_000), |d| late_by(d, 30_000)),
    (2, Fault::TickLate, 0.3, |d| late_now_and_then(d, 7000, 6), |d| late_now_and_then(d, 7000, 3)),
    (
        5,
        Fault::DriveSilent,
        0.1,
        |d| d.rig.set_fault(RigFault::CanSilent, true),
        |d| {
            rig_fault_for(d, RigFault::CanSilent, 0.03);
        },
    ),
    (5, Fault::CanBusOff, 0.02, |d| tamper(d, |i| i.bus_off = true), |d| rig_fault_for(d, RigFault::CanSilent, 0.03)),
    (
        5,
        Fault::DriveStartUp,
        5.0,
        |d| {
            *d = ControlBench::new(&[], 6);
            d.rig.set_fault(RigFault::CanSilent, true);
        },
        |d| {
            // It answers late.
            *d = ControlBench::new(&[], 6);
            rig_fault_for(d, RigFault::CanSilent, 2.4);
            assert!(d.until(4.0, |d| d.control.state() == State::Unhomed), "{:?}", d.control.fault());
        },
    ),
    (
        6,
        Fault::DriveStall,
        0.2,
        |d| d.rig.set_fault(RigFault::DriveStall, true),
        |d| {
            // At its current limit, as for a heavy load, but turning.
            tamper(d, |i| drive_current(i, 500));
        },
    ),
    (
        7,
        Fault::EncoderStuck,
        0.3,
        |d| d.rig.set_fault(RigFault::EncoderStuck, true),
        |d| {
            tamper_for(d, 0.04, {
                let at = OnceLock::new();
                move |i| i.encoder_counts = *at.get_or_init(|| i.encoder_counts)
            });
        },
    ),
    (
        7,
        Fault::EncoderJump,
        0.2,
        |d| d.rig.set_fault(RigFault::EncoderJump, true),
        |d| {
            tamper(d, |i| i.encoder_counts += 1000);
        },
    ),
    (
        7,
        Fault::EncoderJump,
        0.02,
        |d| tamper(d, |i| i.encoder_counts += 60_000),
        |d| {
            tamper(d, |i| i.encoder_counts -= 1000);
        },
    ),
    (7, Fault::EncoderDisagrees, 1.0, |d| encoder_slips(d, 0.2), |d| encoder_slips(d, 0.002)),
    (
        9,
        Fault::LvdtOpen,
        0.2,
        |d| d.rig.set_fault(RigFault::LvdtOpen, true),
        |d| {
            rig_fault_for(d, RigFault::LvdtOpen, 0.05);
        },
    ),
    (
        9,
        Fault::LvdtShort,
        0.2,
        |d| d.rig.set_fault(RigFault::LvdtShort, true),
        |d| {
            tamper_for(d, 0.05, |i| lvdt_mean(i, 4095.0));
        },
    ),
    (
        9,
        Fault::LvdtNoisy,
        0.3,
        |d| d.rig.set_fault(RigFault::LvdtNoisy, true),
        |d| {
            d.rig.set_plant("lvdt_noise", "0.4mm").unwrap();
        },
    ),
    (
        9,
        Fault::LvdtFrozen,
        0.6,
        |d| d.rig.set_fault(RigFault::LvdtFrozen, true),
        |d| {
            rig_fault_for(d, RigFault::LvdtFrozen, 0.2);
        },
    ),
    (
        9,
        Fault::LvdtStalled,
        0.3,
        |d| {
            tamper(d, |i| {
                if let Some(block) = &mut i.lvdt {
                    block.t_us = block.t_us.saturating_sub(60_000)
                }
            })
        },
        |d| {
            tamper_for(d, 0.06, |i| {
                if let Some(block) = &mut i.lvdt {
                    block.t_us = block.t_us.saturating_sub(60_000)
                }
            })
        },
    ),
    (
        10,
        Fault::StringBreak,
        1.0,
        |d| d.rig.set_fault(RigFault::StringBreak, true),
        |d| {
            d.rig.set_plant("load", "0.6kg").unwrap();
        },
    ),
    (
        11,
        Fault::FollowingError,
        4.0,
        |d| d.rig.set_plant("friction", "60N").unwrap(),
        |d| {
            d.rig.set_plant("friction", "0.3N").unwrap();
        },
    ),
    (
        14,
        Fault::NotFinite,
        0.2,
        |d| tamper(d, |i| lvdt_mean(i, f32::NAN)),
        |d| {
            tamper_for(d, 0.01, |i| lvdt_mean(i, f32::NAN));
        },
    ),
    (
        17,
        Fault::Supply,
        0.4,
        |d| d.rig.set_plant("supply_voltage", "15V").unwrap(),
        |d| {
            d.rig.set_plant("supply_voltage", "21V").unwrap();
        },
    ),
    (
        17,
        Fault::Supply,
        0.4,
        |d| d.rig.set_plant("supply_voltage", "30V").unwrap(),
        |d| {
            d.rig.set_plant("supply_voltage", "27V").unwrap();
        },
    ),
    (
        19,
        Fault::LimitSwitch,
        0.05,
        |d| d.rig.set_fault(RigFault::LimitSwitch, true),
        |d| {
            // One tick: contacts bounce.
            tamper(d, |i| i.upper_limit_open = true);
            d.tick(None);
            d.tamper = None;
        },
    ),
];
