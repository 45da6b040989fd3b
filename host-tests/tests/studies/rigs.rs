//! The study's harness on two rigs that the firmware is known to manage, and what it makes of a wrong estimate.

use host_tests::rigs::floor::Check;
use host_tests::rigs::report::groups;
use host_tests::rigs::subject::Subject;
use host_tests::rigs::{Plan, Scored, study};
use rig_plant::RigPreset;

fn plan() -> Plan {
    Plan { loads_kg: vec![0.5, 0.6], as_built: false, against_fixed_ratio: true, jobs: 2 }
}

/// Rigs of their own model, held against the floors of well-made ones.
fn scored() -> Vec<Scored> {
    let rig = |seed| Subject { kind: RigPreset::Nominal, ..Subject::new(RigPreset::Ideal, seed) };
    study(&[rig(1), rig(2)], &plan(), &|_, _| ())
}

#[test]
fn a_good_run_meets_every_floor_and_a_wrong_load_is_noticed() {
    let mut scored = scored();
    let results = groups(&scored).remove(0);
    let before = results.failed().count();
    for check in [Check::Zero, Check::RestMeasured, Check::RestTrue, Check::FollowRms, Check::FollowMax, Check::Faults]
    {
        assert_eq!(results.line(check).holds, Some(true), "{check:?}");
    }
    let line = results.line(Check::LoadHomed);
    assert_eq!((line.cases, line.missing), (4, 0), "two rigs, two loads");

    // A load estimate that is 12 % too great, under 0.5 kg (5 % + 0.05 N is 6 %).
    let all = scored[1].findings.iter_mut();
    let estimate = all.into_iter().find(|f| f.check == Check::LoadHomed).expect("homed");
    estimate.value = estimate.value.map(|error| error + 0.12);
    let results = groups(&scored).remove(0);
    let line = results.line(Check::LoadHomed);
    assert_eq!(line.holds, Some(false));
    let failed = results.failures();
    assert_eq!(failed.len(), before + 1);
    let named =
        |text: &&String| text.contains("rig 2") && text.contains("0.5 kg") && text.contains("load after homing");
    assert!(failed.iter().any(|text| named(&text)), "{failed:?}");
}

#[test]
fn a_rig_that_cannot_be_homed_misses_its_floors_by_name() {
    // The LVDT shows a tenth of the way: homing refuses, and so does every sweep.
    let mut subject = Subject::new(RigPreset::Ideal, 1);
    subject.kind = RigPreset::Nominal;
    subject.changes = vec!["lvdt_gain_error=-0.9".parse().expect("a plant key")];
    let scored = study(&[subject], &Plan { as_built: true, against_fixed_ratio: false, ..plan() }, &|_, _| ());
    let results = groups(&scored).remove(0);
    for check in [Check::Zero, Check::RestMeasured, Check::FollowRms] {
        let line = results.line(check);
        assert_eq!((line.cases, line.missing, line.holds), (0, 2, Some(false)), "{check:?}");
    }
    assert!(results.failed().any(|(_, f)| f.note.contains("homing")), "{:?}", scored[0].findings);
}
