//! Settings in flash under firmware for another rig.

use super::flash::changes;
use super::{fault, set, standing, with_flash};
use host_tests::board::{Bench, firmware, other_rig};
use rig_config::Scene;
use rig_link::messages::{Fault, Kept, LvdtCurve, Refusal, Request, Setting, SettingValues, State};

/// A board with other firmware on this flash, greeted, and started or in fault.
fn updated(elf: &[u8], scene: &Scene, image: &[u8]) -> Bench {
    let mut b = Bench::with(elf, scene, &[], 1);
    with_flash(&mut b, image);
    b.run(3.0);
    b
}

#[test]
fn an_update_for_another_lvdt_waits_for_the_operator_and_loses_nothing() {
    let mut b = standing(&[], 7);
    let lvdt_curve = LvdtCurve::new(&[[0.09, 1e-4], [0.1, 2e-4], [0.11, 0.0]], 2e-5).ok();
    let old = SettingValues { numbers: [1e-3, 1.01, 2e-3, -1.0, 1.02, 0.003, 0.45, 1.03, 0.5, 9.0], lvdt_curve };
    b.set(&Request::SetSettings(old)).unwrap();
    let (elf, scene) = other_rig();
    let mut b = updated(&elf, &scene, &b.machine.flash_image());
    let dropped = b.settings();
    assert!(dropped.dropped.names().eq(["lvdt-offset", "lvdt-gain", "current-limit", "lvdt-points"]));
    assert_eq!(b.ask(&super::JOG), Err(Refusal::InFault { fault: Fault::SettingsCorrupt }));
    assert_eq!(b.machine.board().truth().motor_energy_j, 0.0, "the drive was commanded");
    // `clear` accepts the defaults for this run only: flash is as it was, and the next start waits again.
    b.ask(&Request::Clear).unwrap();
    assert!(b.until(6.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    assert_eq!(fault(&updated(&elf, &scene, &b.machine.flash_image())), Some(Fault::SettingsCorrupt));
    // Back on the firmware before, everything is there.
    let mut back = updated(&firmware(), host_tests::scene(), &b.machine.flash_image());
    assert_eq!((back.settings().values, back.settings().kept, back.state()), (old, Kept::These, State::Unhomed));
    // Calibrated again, it is a record for this rig.
    b.set(&set(Setting::LvdtGain, 0.99)).unwrap();
    let mut calibrated = updated(&elf, &scene, &b.machine.flash_image());
    let values = dropped.values.with(Setting::LvdtGain, 0.99);
    assert_eq!((calibrated.settings().kept, calibrated.settings().values), (Kept::These, values));
}

/// Power may fail between record and witness, and the update come before the next start.
#[test]
fn an_update_after_a_power_cut_still_names_what_it_drops() {
    let mut b = standing(&[], 9);
    let old = b.settings().defaults.with(Setting::LvdtGain, 1.01).with(Setting::SpeedMax, 0.003);
    b.set(&Request::SetSettings(old)).unwrap();
    let request = Request::SetSettings(old.with(Setting::LvdtGain, 1.02));
    let (elf, scene) = other_rig();
    let mut behind = 0;
    for (k, cut) in changes(&b.machine.flash_image(), &request).iter().enumerate().skip(1) {
        let boots = |image: &[u8]| {
            let mut b = Bench::with(&elf, &scene, &[], 1);
            with_flash(&mut b, image);
            // The witness is written behind what is told first.
            b.run(0.5);
            b
        };
        let mut b = boots(cut);
        behind += usize::from(b.machine.flash_image()[super::STORE] != cut[super::STORE]);
        for _ in 0..2 {
            let report = b.settings();
            assert!(report.dropped.names().eq(["lvdt-gain"]), "after change {k}: {report:?}");
            assert_eq!((report.kept, report.values.get(Setting::SpeedMax)), (Kept::Partly, 0.003));
            assert_eq!(fault(&b), Some(Fault::SettingsCorrupt));
            b = boots(&b.machine.flash_image());
        }
    }
    assert!(behind > 0, "no start wrote the witness again");
}
