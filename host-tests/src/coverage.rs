//! How often the stated 90 % errors of load and position hold the truth, over thousands of rigs: as built, and commissioned.

use crate::rigs::commission::{Firmware, commission};
use crate::rigs::subject::Subject;
use crate::scene;
use crate::study::{Rigs, Sorted, Study, each, shown};
use rig_link::messages::Doubt;
use rig_plant::trial::{Moment, Stated, Trial};
use rig_plant::units::STANDARD_GRAVITY;
use rig_plant::{PlantKey, RigPreset};
use std::collections::BTreeMap;

/// Kinds of rigs.
pub const KINDS: [RigPreset; 2] = [RigPreset::Nominal, RigPreset::Hard];
/// Classes of loads, and the load (kg) that each ends at.
const CLASSES: [(&str, f64); 3] = [("light", 0.3), ("middle", 0.9), ("heavy", f64::INFINITY)];
/// How many rigs of each kind as built; how many of the first of these also with their own LVDT's data sheet, where it is not the
/// scene's; and how many also calibrated.
const AS_BUILT: u64 = 5000;
const OWN_LVDT: usize = 1000;
const CALIBRATED: usize = 600;

/// Seed of the first rig. The homing's standard errors were chosen on seeds below.
pub const FIRST_SEED: u64 = 10_001;

/// How often an interval held, and how wide it was.
#[derive(Clone, Debug, Default)]
struct Cover {
    held: u64,
    /// Stated error and size of the true one.
    sizes: Vec<[f64; 2]>,
}

impl Cover {
    fn add(&mut self, held: Option<bool>, stated: Option<f32>, error: Option<f64>) {
        if let (Some(held), Some(stated), Some(error)) = (held, stated, error) {
            self.held += u64::from(held);
            self.sizes.push([f64::from(stated), error.abs()]);
        }
    }

    fn fraction(&self) -> f64 {
        self.held as f64 / self.sizes.len() as f64
    }

    /// The 90 % interval of the fraction (Wilson).
    fn interval(&self) -> [f64; 2] {
        const Z: f64 = 1.645;
        let (n, p) = (self.sizes.len() as f64, self.fraction());
        let (middle, half) = (p + Z * Z / (2.0 * n), Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt());
        [middle - half, middle + half].map(|x| (x / (1.0 + Z * Z / n)).clamp(0.0, 1.0))
    }

    fn cell(&self) -> String {
        if self.sizes.is_empty() {
            return "-".into();
        }
        let [low, high] = self.interval().map(|x| 100.0 * x);
        format!("{:.1} ({low:.1} to {high:.1}) %", 100.0 * self.fraction())
    }

    /// Median of the stated error and the 90th percentile of the true one, each times a factor.
    fn widths(&self, factor: f64, digits: usize) -> String {
        let column = |k: usize| Sorted::new(self.sizes.iter().map(|sizes| factor * sizes[k]));
        format!("{}; {}", shown(column(0).quantile(0.5), digits), shown(column(1).quantile(0.9), digits))
    }
}

/// Whether a load that is wrong is warned of. It is wrong if it is off by more than a fraction of itself, the one from which on
/// the board calls a load unknown by its stated error.
#[derive(Clone, Debug, Default)]
struct Warnings {
    /// Of the right loads and of the wrong ones: stated errors as fractions of the load, and how many were called unknown.
    stated: [Vec<f64>; 2],
    warned: [u64; 2],
}

impl Warnings {
    const WRONG: f64 = 0.3;

    fn add(&mut self, stated: &Stated) {
        let Some((load_n, error_n)) = stated.load_n.zip(stated.load_error_n) else { return };
        let wrong = usize::from((f64::from(load_n) / stated.true_load_n - 1.0).abs() > Self::WRONG);
        self.stated[wrong].push(f64::from(error_n / load_n));
        self.warned[wrong] += u64::from(stated.doubts.split(' ').any(|doubt| doubt == Doubt::LoadUnknown.name()));
    }

    /// Area under the curve of true over false warnings for every threshold of the stated error: how often a wrong load has a
    /// larger one than a right load.
    fn area(&self) -> f64 {
        let [right, wrong] = &self.stated;
        let mut sorted = right.clone();
        sorted.sort_by(f64::total_cmp);
        let below = |x: &f64| {
            let [low, high] = [sorted.partition_point(|y| y < x), sorted.partition_point(|y| y <= x)];
            0.5 * (low + high) as f64
        };
        wrong.iter().map(below).sum::<f64>() / (right.len() * wrong.len()) as f64
    }

    fn text(&self) -> String {
        let of = |k: usize| format!("{} of {}", self.warned[k], self.stated[k].len());
        let area = Some(self.area()).filter(|area| area.is_finite());
        format!("{} wrong and {} right loads, area {}", of(1), of(0), shown(area, 3))
    }
}

/// Load, as a fraction of it, and position (m).
type Covers = [Cover; 2];

/// What the board knows of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Known {
    /// The default scene.
    AsBuilt,
    /// The same with the linearity of this rig's LVDT.
    OwnLvdt,
    /// What the six commands of calibration find.
    Calibrated,
}

impl Known {
    fn name(self) -> &'static str {
        match self {
            Self::AsBuilt => "as built",
            Self::OwnLvdt => "as built, own LVDT in the scene",
            Self::Calibrated => "calibrated",
        }
    }

    fn firmware(self, trial: &Trial) -> Firmware {
        let mut firmware = Firmware::as_built();
        match self {
            Self::AsBuilt => firmware,
            Self::OwnLvdt => {
                firmware.constants.lvdt_linearity_m = (linearity(trial.kind) * scene().rig.lvdt_stroke_m) as f32;
                firmware
            }
            Self::Calibrated => commission(&subject(trial)).0,
        }
    }
}

/// Linearity of the LVDT of this kind of rig by its data sheet, as a fraction of the stroke.
fn linearity(kind: RigPreset) -> f64 {
    kind.extreme(PlantKey::LvdtNonlinearity, 1.0).map_or(0.0, |largest| largest.value)
}

/// One try of a rig.
struct Tried {
    known: Known,
    trial: Trial,
    stated: Vec<Stated>,
    why: String,
}

/// The rig of a trial.
fn subject(trial: &Trial) -> Subject {
    let mut subject = Subject::new(trial.kind, trial.seed);
    subject.changes.extend(trial.constants_off());
    subject
}

fn tried(kind: RigPreset, seed: u64, known: Known) -> Tried {
    let trial = Trial::new(kind, seed);
    let (stated, why) = trial.run(known.firmware(&trial).boot());
    Tried { known, trial, stated, why }
}

/// Name of the class of a load (N).
fn class(load_n: f64) -> usize {
    CLASSES.iter().position(|(_, kg)| load_n < kg * STANDARD_GRAVITY).unwrap_or(CLASSES.len() - 1)
}

/// Tries every rig.
pub fn study(rigs: &Rigs) -> Study {
    let mut items = Vec::new();
    let rigs = Rigs { seed: rigs.seed.or(Some(FIRST_SEED)), ..rigs.clone() };
    for kind in KINDS.into_iter().filter(|kind| rigs.wants(*kind)) {
        let own_lvdt = if linearity(kind) == scene().rig.lvdt_linearity { 0 } else { OWN_LVDT };
        for (known, count) in
            [(Known::AsBuilt, usize::MAX), (Known::OwnLvdt, own_lvdt), (Known::Calibrated, CALIBRATED)]
        {
            items.extend(rigs.seeds(AS_BUILT).take(count).map(|seed| (kind, seed, known)));
        }
    }
    let all = each(rigs.jobs, &items, |(kind, seed, known)| tried(*kind, *seed, *known));
    table(&all)
}

fn table(all: &[Tried]) -> Study {
    let mut covers: BTreeMap<(u8, Known, bool, usize), Covers> = BTreeMap::new();
    let mut reasons: BTreeMap<String, usize> = BTreeMap::new();
    let mut warnings: BTreeMap<(u8, Known), Warnings> = BTreeMap::new();
    for Tried { known, trial, stated, why } in all {
        for s in stated {
            let changed = matches!(s.moment, Moment::Changed | Moment::Moved);
            let key = (trial.kind as u8, *known, changed, class(s.true_load_n));
            let [load, position] = covers.entry(key).or_default();
            warnings.entry((trial.kind as u8, *known)).or_default().add(s);
            let relative = s.load_n.map(|load_n| f64::from(load_n) / s.true_load_n - 1.0);
            load.add(s.holds_load(), s.load_error_n.map(|error_n| error_n / s.true_load_n as f32), relative);
            let error_m = s.position_m.map(|position_m| f64::from(position_m) - s.true_position_m);
            position.add(s.holds_position(), s.position_error_m, error_m);
        }
        if !why.is_empty() {
            // With its numbers each reason would be one of its own.
            let parts: Vec<&str> =
                why.split(|c: char| c.is_ascii_digit() || c == '.').filter(|part| !part.is_empty()).collect();
            *reasons.entry(parts.join("…").replace("-…", "…")).or_default() += 1;
        }
    }
    let head = ["rig", "load", "looked at", "load held by its error", "stated; true, % of the load"];
    let mut study = Study::new(head.into_iter().chain(["position held by its error", "stated; true, µm"]));
    for ((kind, known, changed, class), [load, position]) in &covers {
        let (kind, state) = (RigPreset::ALL[usize::from(*kind)], known.name());
        let (load_class, when) = (CLASSES[*class].0, if *changed { "another load" } else { "homed load" });
        let name =
            format!("{kind}_{}_{}_{load_class}", state.replace(", ", "_").replace(' ', "_"), when.replace(' ', "_"));
        study.value(format!("{name}_load"), Some(load.fraction()).filter(|x| x.is_finite()));
        study.value(format!("{name}_position"), Some(position.fraction()).filter(|x| x.is_finite()));
        study.row([
            format!("{kind}, {state}"),
            format!("{load_class}, {when}"),
            load.sizes.len().to_string(),
            load.cell(),
            load.widths(100.0, 1),
            position.cell(),
            position.widths(1e6, 0),
        ]);
    }
    let of = |known: Known| all.iter().filter(|tried| tried.known == known).count();
    study.value("rigs_as_built", of(Known::AsBuilt) as f64);
    study.value("rigs_calibrated", of(Known::Calibrated) as f64);
    let warned = warnings.iter().map(|((kind, known), warnings)| {
        format!("{}, {}: {}", RigPreset::ALL[usize::from(*kind)], known.name(), warnings.text())
    });
    let warned: Vec<String> = warned.collect();
    let reasons: Vec<String> = reasons.iter().map(|(why, count)| format!("{count} at \"{why}\"")).collect();
    study.notes = vec![
        format!(
            "How often the stated 90 % error holds the truth, with the 90 % interval of that fraction; median of the stated \
             and 90th percentile of the true error. Light is below 0.3 kg, heavy from 0.9 kg. \"Homed load\" is after homing and \
             after a move; \"another load\" is 5 s after it was hung on, and after two moves. Half of the rigs have worked under \
             another load before. The scene's data sheet of the LVDT is that of hard rigs; \"own LVDT in the scene\" has {} % of the stroke \
             for its linearity. The presets have the scene's constants; here the zero of each LVDT, which is measured with callipers, \
             and the radius of the strings, which nobody has identified, are off by as much as the scene's [uncertainty] says: {} mm \
             and {} % (rms).",
            100.0 * linearity(RigPreset::Nominal),
            1e3 * scene().uncertainty.gap_zero_m,
            100.0 * scene().uncertainty.radius,
        ),
        format!(
            "The doubt `load-unknown` was shown for these fractions of the loads that were off by more than {:.0} %, and of the others; \
             the area under the ROC curve is that of the stated error as a warning of them. {}.",
            100.0 * Warnings::WRONG,
            warned.join("; ")
        ),
        format!(
            "{} rigs as built and {} calibrated. Trials that ended early: {}.",
            of(Known::AsBuilt),
            of(Known::Calibrated),
            if reasons.is_empty() { "none".into() } else { reasons.join(", ") }
        ),
    ];
    study
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stated(moment: Moment, true_load_n: f64, load_n: f32, error_n: f32, doubts: &str) -> Stated {
        Stated {
            moment,
            true_load_n,
            load_n: Some(load_n),
            load_error_n: Some(error_n),
            doubts: doubts.into(),
            true_position_m: 0.0,
            position_m: Some(1e-4),
            position_error_m: Some(5e-5),
        }
    }

    #[test]
    fn a_rig_is_calibrated_with_the_constants_that_it_is_tried_with() {
        let trial = Trial::new(RigPreset::Hard, 3);
        let (subject, tried) = (subject(&trial), trial.rig().unwrap().settings().clone());
        assert_eq!(subject.value(PlantKey::LvdtOffset), tried.lvdt_offset_m);
        assert_eq!(subject.value(PlantKey::RadiusScale), tried.radius_scale);
    }

    #[test]
    fn a_rig_is_tried_with_the_linearity_that_its_kind_has() {
        let linearity_m = |known: Known, kind| known.firmware(&Trial::new(kind, 3)).constants.lvdt_linearity_m;
        let [as_built_m, nominal_m, hard_m] = [
            linearity_m(Known::AsBuilt, RigPreset::Nominal),
            linearity_m(Known::OwnLvdt, RigPreset::Nominal),
            linearity_m(Known::OwnLvdt, RigPreset::Hard),
        ];
        assert_eq!((as_built_m, nominal_m, hard_m), (1e-3, 0.5e-3, 1e-3));
    }

    #[test]
    fn a_fraction_has_the_interval_of_its_count() {
        let mut cover = Cover::default();
        (0..100).for_each(|k| cover.add(Some(k < 90), Some(1.0), Some(0.5)));
        cover.add(None, Some(1.0), None);
        let [low, high] = cover.interval();
        // Wilson's interval of 90 in 100 at 90 %.
        assert!((low - 0.8402).abs() < 1e-3 && (high - 0.9390).abs() < 1e-3, "{low} {high}");
        assert_eq!((cover.cell().as_str(), cover.widths(100.0, 0).as_str()), ("90.0 (84.0 to 93.9) %", "100; 50"));
        assert_eq!(Cover::default().cell(), "-");
    }

    #[test]
    fn rows_are_by_rig_load_and_moment_and_what_ended_early_is_counted() {
        let trial = Trial::new(RigPreset::Hard, 1);
        let all = [Tried {
            known: Known::AsBuilt,
            trial,
            stated: vec![stated(Moment::Homed, 5.0, 5.4, 0.5, ""), stated(Moment::Changed, 12.0, 13.0, 0.5, "")],
            why: "move to -4.0 mm: fault lvdt-jump on the way".into(),
        }];
        let study = table(&all);
        assert_eq!(study.table.len(), 3);
        assert_eq!(study.values["hard_as_built_homed_load_middle_load"], 1.0);
        assert_eq!(study.values["hard_as_built_another_load_heavy_load"], 0.0);
        assert_eq!(study.values["hard_as_built_another_load_heavy_position"], 0.0);
        assert!(
            study.notes[1].ends_with("hard, as built: 0 of 0 wrong and 0 of 2 right loads, area -."),
            "{}",
            study.notes[1]
        );
        assert!(study.notes[2].contains("1 at \"move to … mm: fault lvdt-jump on the way\""), "{}", study.notes[2]);
    }

    #[test]
    fn wrong_loads_that_are_warned_of_are_counted_and_the_area_is_the_share_of_pairs_in_order() {
        let mut warnings = Warnings::default();
        for (load_n, error_n, doubts) in [
            (5.0, 0.5, ""),
            (5.2, 1.0, "load-range load-unknown"),
            (8.0, 3.2, "load-unknown"),
            (3.0, 0.3, "load-range"),
        ] {
            warnings.add(&stated(Moment::Homed, 5.0, load_n, error_n, doubts));
        }
        assert_eq!(warnings.text(), "1 of 2 wrong and 1 of 2 right loads, area 0.625");
    }
}
