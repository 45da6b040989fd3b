//! How the control code on the fast bench agrees with the firmware on the emulated board: both try the first plants of the study
//! of coverage, and the fast bench tries them once more a little later, which shows what other samples of the same noise change.

use crate::board::{Bench, firmware};
use crate::coverage::{FIRST_SEED, KINDS};
use crate::study::{Rigs, Sorted, Study, each, shown};
use crate::{ControlBench, booted};
use rig_emulator::machine::Config;
use rig_plant::RigPreset;
use rig_plant::trial::{Stated, Trial};

/// How many plants of each kind.
const PLANTS: u64 = 50;
/// By how much the homing is later (s), as late as the firmware hears of it by its host link.
const LATER_S: f64 = 0.03;
/// Who tries a plant.
const WHO: [&str; 3] = ["fast bench", "fast bench later", "emulated board"];

/// What one of them states at each moment, and why it ended early; empty if it did not.
type Tried = (Vec<Stated>, String);

/// A trial by each of [`WHO`].
fn tried(elf: &[u8], kind: RigPreset, seed: u64) -> [Tried; 3] {
    let trial = Trial::new(kind, seed);
    let on_bench = |wait_s: f64| match trial.rig() {
        Ok(rig) => {
            let mut bench = ControlBench::on(rig, booted());
            bench.run(wait_s);
            trial.run_on(&mut bench)
        }
        Err(why) => (Vec::new(), why),
    };
    let on_board = match trial.rig() {
        Ok(rig) => trial.run_on(&mut Bench::wired(elf, rig, Config::default())),
        Err(why) => (Vec::new(), why),
    };
    // The drive has started after two seconds.
    [on_bench(3.0), on_bench(3.0 + LATER_S), on_board]
}

/// Tries the plants.
pub fn study(rigs: &Rigs) -> Study {
    let rigs = Rigs { seed: rigs.seed.or(Some(FIRST_SEED)), ..rigs.clone() };
    let kinds = KINDS.into_iter().filter(|kind| rigs.wants(*kind));
    let items: Vec<_> = kinds.flat_map(|kind| rigs.seeds(PLANTS).map(move |seed| (kind, seed))).collect();
    let elf = firmware();
    let all = each(rigs.jobs, &items, |(kind, seed)| tried(&elf, *kind, *seed));
    table(&items.into_iter().zip(all).collect::<Vec<_>>())
}

/// What is compared: its name, the name of the value that is kept, unit, digits after the point, and how a statement shows it.
type Compared = (&'static str, &'static str, &'static str, usize, fn(&Stated) -> Option<f64>);

const COMPARED: [Compared; 3] = [
    ("load", "load_p95_percent", "% of it", 2, |s| s.load_n.map(|load_n| 100.0 * f64::from(load_n) / s.true_load_n)),
    ("stated error of the load", "stated_p95_percent", "% of the load", 2, |s| {
        s.load_error_n.map(|error_n| 100.0 * f64::from(error_n) / s.true_load_n)
    }),
    ("true position", "position_p95_um", "µm", 0, |s| Some(1e6 * s.true_position_m)),
];

fn table(all: &[((RigPreset, u64), [Tried; 3])]) -> Study {
    let mut study = Study::new([
        "plants",
        "compared",
        "moments",
        "emulated board and fast bench: median; 95th percentile; maximum",
        "fast bench and itself later",
    ]);
    let mut notes = vec![
        "How far both are apart at the same moment of the same trial: homed, moved, 5 s after another load was hung on, and \
         after two more moves."
            .to_owned(),
    ];
    for kind in KINDS {
        let of: Vec<_> = all.iter().filter(|((of, _), _)| *of == kind).map(|(_, tried)| tried).collect();
        for (name, kept, unit, digits, of_stated) in COMPARED {
            let apart = |k: usize| {
                let pairs = of.iter().flat_map(|tried| tried[0].0.iter().zip(&tried[k].0));
                Sorted::new(pairs.filter_map(|(a, b)| Some((of_stated(a)? - of_stated(b)?).abs())))
            };
            let cell = |sorted: &Sorted| {
                let of = [sorted.quantile(0.5), sorted.quantile(0.95), sorted.max()];
                format!("{} {unit}", of.map(|value| shown(value, digits)).join("; "))
            };
            let (board, later) = (apart(2), apart(1));
            study.value(format!("{kind}_{kept}"), board.quantile(0.95));
            study.row([kind.to_string(), name.to_owned(), board.count().to_string(), cell(&board), cell(&later)]);
        }
        let held = |k: usize, holds: fn(&Stated) -> Option<bool>| {
            let holds: Vec<bool> = of.iter().flat_map(|tried| &tried[k].0).filter_map(holds).collect();
            (holds.iter().filter(|held| **held).count(), holds.len())
        };
        for (what, holds) in
            [("load", Stated::holds_load as fn(&Stated) -> Option<bool>), ("position", Stated::holds_position)]
        {
            let counts: Vec<String> = WHO
                .iter()
                .enumerate()
                .map(|(k, who)| {
                    let (held, n) = held(k, holds);
                    let name = format!("{kind}_{what}_held_{}", who.replace(' ', "_"));
                    study.value(name, Some(held as f64 / n as f64).filter(|x| x.is_finite()));
                    format!("{held} of {n} ({who})")
                })
                .collect();
            notes.push(format!("{kind} plants: the stated error holds the {what} in {}.", counts.join(", ")));
        }
    }
    for ((kind, seed), tried) in all {
        let ended: Vec<String> = WHO
            .iter()
            .zip(tried)
            .filter(|(_, (_, why))| !why.is_empty())
            .map(|(who, (_, why))| format!("{who}: {why}"))
            .collect();
        if !ended.is_empty() {
            notes.push(format!("Ended early: {kind} plant, seed {seed}. {}.", ended.join("; ")));
        }
    }
    study.notes = notes;
    study
}

#[cfg(test)]
mod tests {
    use super::*;
    use rig_plant::trial::Moment;

    fn stated(load_n: f32, true_position_m: f64) -> Stated {
        Stated {
            moment: Moment::Homed,
            true_load_n: 5.0,
            load_n: Some(load_n),
            load_error_n: Some(0.2),
            doubts: String::new(),
            true_position_m,
            position_m: None,
            position_error_m: None,
        }
    }

    #[test]
    fn the_same_moments_are_compared_and_what_ended_early_is_named() {
        let tried = [
            (vec![stated(5.0, 0.0), stated(5.0, 1e-3)], String::new()),
            (vec![stated(5.05, 0.0), stated(5.0, 1e-3)], String::new()),
            (vec![stated(5.3, 2e-6)], "move to 4.0 mm: refused".to_owned()),
        ];
        let study = table(&[((RigPreset::Hard, 7), tried)]);
        let row = study.table.iter().find(|row| row[0] == "hard" && row[1] == "load").expect("a row");
        assert_eq!(row[2..], ["1", "6.00; 6.00; 6.00 % of it", "0.00; 1.00; 1.00 % of it"]);
        assert!((study.values["hard_position_p95_um"] - 2.0).abs() < 1e-9);
        let held =
            study.notes.iter().find(|note| note.contains("hard plants") && note.contains("the load")).expect("a note");
        assert!(held.contains("2 of 2 (fast bench), 2 of 2 (fast bench later), 0 of 1 (emulated board)"), "{held}");
        let ended = study.notes.last().expect("a note");
        assert_eq!(ended, "Ended early: hard plant, seed 7. emulated board: move to 4.0 mm: refused.");
    }

    /// A plant of its own model, whose friction is small: only the samples of the noise differ.
    #[test]
    fn the_firmware_on_the_emulated_board_states_what_the_control_code_does() {
        let [(bench, why), _, (board, why_board)] = tried(&firmware(), RigPreset::Ideal, 10_001);
        assert_eq!((bench.len(), board.len()), (4, 4), "{why} {why_board}");
        for (a, b) in bench.iter().zip(&board) {
            let apart_n = (a.load_n.expect("a load") - b.load_n.expect("a load")).abs();
            let much_n = 0.1 * a.load_error_n.expect("an error");
            assert!(apart_n < much_n && (a.true_position_m - b.true_position_m).abs() < 30e-6, "{a:?} {b:?}");
        }
    }
}
