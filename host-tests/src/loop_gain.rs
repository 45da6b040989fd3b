//! The study of the setting `loop-gain`: margin against speed.

use crate::limit::KINDS;
use crate::load_changes::{self, Outcome};
use crate::margins;
use crate::rigs::subject::Subject;
use crate::study::{Rigs, Sorted, Study, shown};
use anyhow::Result;
use rig_plant::RigPreset;

/// The gains that are compared; the first is the default.
const GAINS: [f32; 4] = [1.0, 0.7, 0.5, 0.3];
/// The measured gain margin that hard rigs should have.
const MEASURED: f64 = 1.5;

/// A row for each gain.
///
/// # Errors
/// If a rig fails.
pub fn study(rigs: &Rigs) -> Result<Study> {
    let head = |(kind, _, within_m): &(RigPreset, u64, f64)| format!("{kind}, to {:.0} µm", within_m * 1e6);
    let computed = ["loop-gain", "gain margin", "peak sensitivity", "further delay", "hard rigs: measured gain margin"];
    let kinds: Vec<_> = KINDS.iter().filter(|(kind, ..)| rigs.wants(*kind)).collect();
    let mut study = Study::new(computed.map(String::from).into_iter().chain(kinds.iter().map(|kind| head(kind))));
    for loop_gain in GAINS {
        let [gain, peak, delay_s] = margins::worst(loop_gain.into())?;
        let hard: Vec<Subject> = rigs.seeds(3).map(|seed| subject(RigPreset::Hard, seed, loop_gain)).collect();
        let measured = Sorted::new(margins::measured_gains(&hard, rigs.jobs)?);
        let enough = measured.iter().filter(|gain| **gain >= MEASURED).count();
        let mut cells = vec![
            loop_gain.to_string(),
            format!("{gain:.2}"),
            format!("{peak:.2}"),
            format!("{:.0} ms", 1e3 * delay_s),
            format!("{}; {enough} of {}", shown(measured.median(), 2), measured.count()),
        ];
        for (kind, count, within_m) in &kinds {
            let subjects = rigs.seeds(*count).map(|seed| subject(*kind, seed, loop_gain));
            let steps: Vec<Outcome> = subjects.flat_map(|subject| load_changes::all(&subject, rigs.jobs)).collect();
            let settled = Sorted::new(steps.iter().filter_map(|o| o.settled_s(*within_m)));
            cells.push(format!("{} s; {} of {}", settled.spread(), settled.count(), steps.len()));
            study.value(format!("{kind}_{loop_gain}_time_s_median"), settled.median());
        }
        study.value(format!("{loop_gain}_gain_margin"), gain);
        study.value(format!("{loop_gain}_hard_gain_margin_median"), measured.median());
        study.row(cells);
    }
    study.notes.push(
        "Gain margin, peak of the sensitivity and further delay are computed, without friction, where they are worst: over the \
         table's range and with the mechanism's constants a tenth off. The gain margin of hard rigs is measured as in the \
         section above on 3 rigs with 3 loads at 3 positions: median, and how many have 1.5 or more. A load that moves by stick-slip \
         without a change of the loop has none. The last columns are the recovery times from changed loads as in the section on \
         speed (median; worst of those that settled), and how many settled within 8 s."
            .into(),
    );
    Ok(study)
}

fn subject(kind: RigPreset, seed: u64, loop_gain: f32) -> Subject {
    Subject { loop_gain, ..Subject::new(kind, seed) }
}
