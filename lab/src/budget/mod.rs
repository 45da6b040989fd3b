//! The error budget: what each part of a rig contributes to the errors of position and load in a scene, and how accurate a
//! table is worth having (docs/explanation/accuracy.md has the equations).
//!
//! A figure is 1.645 times a standard error, the half width of an interval that is meant to hold the truth in 90 of 100
//! cases. A case is a rig of the kind at a state of the scene's envelope. The sizes are those from which the emulated rig
//! draws ([`rig_plant::preset`], [`rig_plant::rig::effects`]); homing, loop and rest are the firmware's own constants
//! ([`rig_control`]).
//!
//! The position is measured. So what changes the gap by itself is taken back by the loop, and only what makes the measurement
//! or the transmission ratio wrong remains: a ratio that is wrong by the fraction ε lets a move at the speed v lag by ε v/K, where
//! K is the bandwidth of the loop.

mod columns;
mod effects;
mod homing;
pub mod report;

use columns::{Column, State};
use effects::{Direct, Effect, Effects};
use homing::{Homing, Taken};
use rig_config::{Scene, SceneError};
use rig_control::homing::load_estimate;
use rig_control::position_loop::{FULL_PER_S, POLES};
use rig_plant::PlantKey;
use tsa_model::{Mechanism, Tier};
use tsa_table::{Accuracy, Table};

/// Speed of the moves that the budget is for (m/s): that of `rigctl move` unless its option says another.
pub const SPEED_M_PER_S: f64 = 2e-3;
/// Slowest pole of the position loop where its gains are full (1/s).
const BANDWIDTH_PER_S: f64 = POLES[0] as f64 * FULL_PER_S as f64;
/// How long after homing the rig is used, without a break (s).
pub const SESSION_S: f64 = 600.0;
/// Half width of the interval that holds 90 of 100 cases, over the standard error.
const NINETY: f64 = rig_control::homing::NINETY_PERCENT as f64;
const NINETY_FRACTION: f64 = 0.9;
/// Fraction by which the error of a table, or of a cheaper model, may raise the total of all others.
pub const WORTH: f64 = 0.05;
/// Maximum relative error of a table's TR, however little it adds: it is an error of the position loop's gain, and with one that is
/// a tenth too large every measured rig still comes to rest (docs/explanation/control.md 6).
pub const MAX_TR_ERROR: f64 = 0.1;

/// A part of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// LVDT and converter.
    Sensor,
    /// Rail, motor and gear.
    Friction,
    /// What rods and strings remember.
    Memory,
    /// Constants and law of the strings.
    Law,
    /// A cheaper model in place of the full one.
    Tier,
    /// The table in place of the model.
    Table,
    /// The position loop.
    Loop,
}

impl Part {
    /// All parts.
    pub const ALL: [Self; 7] =
        [Self::Sensor, Self::Friction, Self::Memory, Self::Law, Self::Tier, Self::Table, Self::Loop];

    /// The name in the output of `tsa-lab budget`.
    pub const fn name(self) -> &'static str {
        ["sensor", "friction", "memory", "law", "tier", "table", "loop"][self as usize]
    }
}

/// What the budget is computed for.
pub struct RigErrors<'a> {
    /// Standard deviation of each plant key, SI units: [`rig_plant::RigPreset::rms`] of a kind of rig.
    pub sizes: &'a dyn Fn(PlantKey) -> f64,
    /// Error of the gauges (m, half the width of the interval that holds 90 of 100 readings), where the LVDT is calibrated at
    /// points; else its own non-linearity counts.
    pub gauge_m: Option<f64>,
}

/// What a part contributes: 90 % half widths over all rigs and states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fraction {
    /// To the error of the position (m).
    pub position_m: f64,
    /// To that of the load, as a fraction of the load.
    pub load: f64,
}

/// Variances of position (m²) and load (relative, squared).
type Variances = [f64; 2];

/// A load of the budget.
struct Under {
    column: Column,
    homing: Homing,
    /// By part, at each state.
    parts: [Vec<Variances>; Part::ALL.len()],
}

/// The budget of a scene on a kind of rig.
pub struct Budget<'a> {
    scene: &'a Scene,
    under: Vec<Under>,
}

impl<'a> Budget<'a> {
    /// Everything but tier and table.
    ///
    /// # Errors
    /// [`SceneError`]: the scene has no envelope, or a state of it no equilibrium.
    pub fn new(scene: &'a Scene, rig: &RigErrors<'_>) -> Result<Self, SceneError> {
        let columns = Column::all(scene)?;
        let gaps = || columns.iter().flat_map(|column| column.0.iter().map(|s| s.gap_m));
        let gaps_m = [gaps().fold(f64::INFINITY, f64::min), gaps().fold(0.0, f64::max)];
        let (heaviest, scale_error) = (&columns[columns.len() - 1], scene.twist_scale_error()?);
        let law_error_m = Homing::law_error_m(&columns[columns.len() / 2], scene.uncertainty.load_shape);
        let effects =
            columns.iter().map(|column| Effects { scene, rig, column, heaviest, gaps_m, scale_error, law_error_m });
        let under = effects.map(|effects| Under::new(&effects));
        Ok(Self { scene, under: under.collect() })
    }

    /// With the model of a tier in place of the full one; `false`, and nothing changed, where the tier has no answer.
    pub fn set_tier(&mut self, tier: Tier) -> bool {
        let Ok(mechanism) = self.scene.mechanism() else { return false };
        let changes: Option<Vec<Vec<f64>>> =
            self.under.iter().map(|under| cheaper(&mechanism, tier, &under.column)).collect();
        let Some(changes) = changes else { return false };
        for (under, homed) in self.under.iter_mut().zip(changes) {
            under.clear(Part::Tier);
            under.add_gap(&Effect::homed(Part::Tier, homed));
        }
        true
    }

    /// With a table in place of the model.
    pub fn set_table(&mut self, table: &Table<'_>) {
        for under in &mut self.under {
            under.clear(Part::Table);
            let gap_m = |s: &State| f64::from(table.point_inside(s.load_n as f32, s.twist_rad as f32).gap_m) - s.gap_m;
            let homed = under.column.each(gap_m);
            under.add_gap(&Effect::homed(Part::Table, homed));
        }
    }

    /// What a part contributes.
    pub fn fraction(&self, part: Part) -> Fraction {
        self.spread(&[part])
    }

    /// All parts together.
    pub fn total(&self) -> Fraction {
        self.spread(&Part::ALL)
    }

    /// The accuracy of a table beyond which more bytes and instructions buy nothing: its errors raise those of all other
    /// parts by [`WORTH`]; of TR at most [`MAX_TR_ERROR`]. The errors of a table are taken as even up to its largest. Two digits.
    pub fn worth(&self) -> Accuracy {
        let [position, load] = self.variances(&others());
        let by_gap = |error_m: f64| {
            let under = |under: &Under| {
                let errors = under.table_load(error_m);
                under.used(self.scene).map(move |k| errors[k]).collect::<Vec<_>>()
            };
            self.under.iter().flat_map(under).collect::<Vec<_>>()
        };
        let by_ratio = |error: f64| vec![error * per_ratio_m(); position.len()];
        let largest = 3f64.sqrt();
        Accuracy {
            contraction_m: two_digits(largest * max_added(&load, by_gap)),
            tr_relative: two_digits(largest * max_added(&position, by_ratio)).min(MAX_TR_ERROR),
        }
    }

    /// The cheapest tier of the model that raises the errors of all other parts by no more than [`WORTH`]; the budget has it
    /// then.
    pub fn choose_tier(&mut self) -> Tier {
        let without = self.spread(&others());
        let enough = |budget: &Self| {
            let with = budget.spread(&[&others()[..], &[Part::Tier]].concat());
            with.position_m <= (1.0 + WORTH) * without.position_m && with.load <= (1.0 + WORTH) * without.load
        };
        let cheapest = Tier::ALL.into_iter().find(|tier| self.set_tier(*tier) && enough(self));
        cheapest.unwrap_or(Tier::Full)
    }

    /// The envelope's states.
    fn states(&self) -> impl Iterator<Item = (&Under, usize)> {
        self.under.iter().flat_map(|under| under.used(self.scene).map(move |k| (under, k)))
    }

    /// Variances of position (m²) and load at each of the envelope's states, of these parts together.
    fn variances(&self, parts: &[Part]) -> [Vec<f64>; 2] {
        [0, 1].map(|which| {
            let sum =
                |(under, k): (&Under, usize)| parts.iter().map(|part| under.parts[*part as usize][k][which]).sum();
            self.states().map(sum).collect()
        })
    }

    fn spread(&self, parts: &[Part]) -> Fraction {
        let [position_m, load] = self.variances(parts).map(|variances| half_width(&variances));
        Fraction { position_m, load }
    }
}

impl Under {
    fn new(effects: &Effects<'_>) -> Self {
        let column = effects.column.clone();
        let (gaps, priors) = (effects.gaps(), effects.priors());
        // As in the firmware, from a residual that is far too large: from a small one the fit would follow the gap whatever that
        // takes, and find little residual again.
        let mut residual_m = f64::INFINITY;
        let mut homing = Homing::new(&column, residual_m, priors);
        for _ in 1..load_estimate::STEPS {
            residual_m = gaps.iter().map(|effect| homing.residual_m(&effect.homed).powi(2)).sum::<f64>().sqrt();
            homing = Homing::new(&column, residual_m, priors);
        }
        let none = vec![[0.0; 2]; column.0.len()];
        let mut under = Self { column, homing, parts: std::array::from_fn(|_| none.clone()) };
        gaps.iter().for_each(|effect| under.add_gap(effect));
        effects.direct().iter().for_each(|direct| under.add(direct));
        for (prior, error) in effects.wrong_priors() {
            let taken = under.homing.prior(prior, error);
            under.add_taken(Part::Law, &taken, &vec![0.0; under.column.0.len()], None);
        }
        // How the radius depends on the load, which the scale of the twist cannot take up.
        let shape = under.column.each(|_| effects.scene.uncertainty.load_shape);
        under.add(&Direct { part: Part::Law, position_m: under.column.each(|_| 0.0), load: shape });
        under
    }

    /// Places of the states that the scene's envelope has.
    fn used(&self, scene: &Scene) -> impl Iterator<Item = usize> + use<> {
        let first = scene.envelope.map_or(0.0, |envelope| envelope.turns[0]);
        let from = self.column.0.iter().position(|s| s.turns() >= first - 1e-9).unwrap_or(0);
        from..self.column.0.len()
    }

    fn clear(&mut self, part: Part) {
        self.parts[part as usize].fill([0.0; 2]);
    }

    fn add(&mut self, direct: &Direct) {
        let errors = direct.position_m.iter().zip(&direct.load);
        for (sum, (position_m, load)) in self.parts[direct.part as usize].iter_mut().zip(errors) {
            sum[0] += position_m * position_m;
            sum[1] += load * load;
        }
    }

    fn add_gap(&mut self, effect: &Effect) {
        let taken = self.homing.gap(&effect.homed);
        self.add_taken(effect.part, &taken, &effect.later, effect.misread.then_some(&effect.homed));
    }

    /// What homing took a gap for, a gap that came later, and what the LVDT misreads.
    fn add_taken(&mut self, part: Part, (taken, left_m): &Taken, later_m: &[f64], misread_m: Option<&Vec<f64>>) {
        let left_m: Vec<f64> = left_m.iter().zip(later_m).map(|(left, later)| left + later).collect();
        let slopes = self.column.by_twist(&left_m);
        let states = self.column.0.iter().zip(left_m.iter().zip(slopes));
        let load = states.clone().map(|(s, (left_m, _))| taken + left_m / (s.by_load * s.load_n)).collect();
        let lag_m = states.map(|(s, (_, slope))| slope / s.by_twist * per_ratio_m()).collect();
        let none = self.column.each(|_| 0.0);
        self.add(&Direct { part, position_m: lag_m, load });
        if let Some(misread_m) = misread_m {
            // From where the load hung when it was homed.
            let position_m = misread_m.iter().map(|gap_m| gap_m - misread_m[0]).collect();
            self.add(&Direct { part, position_m, load: none });
        }
    }

    /// Relative error of the load at each state for a table whose gap is wrong by `error_m` rms, in stretches that the fit
    /// takes for independent: by what homing takes it for, and where it is looked up. Homing weights the gap as without the
    /// table's error, so that the error of the load grows with that of the table in proportion.
    fn table_load(&self, error_m: f64) -> Vec<f64> {
        let homed = self.homing.load_of_stretches();
        self.column.each(|s| error_m * homed.hypot(1.0 / (s.by_load * s.load_n)))
    }
}

/// Every part but tier and table.
fn others() -> [Part; 5] {
    [Part::Sensor, Part::Friction, Part::Memory, Part::Law, Part::Loop]
}

/// How far a move lags (m) for a transmission ratio that is wrong by all of it.
fn per_ratio_m() -> f64 {
    SPEED_M_PER_S / BANDWIDTH_PER_S
}

/// Change of the gap by a cheaper tier; `None` where it has no answer.
fn cheaper(mechanism: &Mechanism, tier: Tier, column: &Column) -> Option<Vec<f64>> {
    let gap = |s: &State| Some(mechanism.formal_tier(tier, s.load_n, s.twist_rad).ok()?.gap_m - s.gap_m);
    column.0.iter().map(gap).collect()
}

/// Half the width about 0 that holds 90 of 100 cases, each normal with one of these variances.
fn half_width(variances: &[f64]) -> f64 {
    let max = variances.iter().fold(0.0f64, |max, v| max.max(*v)).sqrt();
    // A state without an error always lies inside.
    let inside = |width: f64, v: &f64| if *v > 0.0 { libm::erf(width / (2.0 * v).sqrt()) } else { 1.0 };
    let fraction = |width: f64| variances.iter().map(|v| inside(width, v)).sum::<f64>() / variances.len() as f64;
    min(2.0 * max, |width| fraction(width) >= NINETY_FRACTION)
}

/// The size, at most 1, from which on what it adds (standard errors at each state) raises the half width of variances by
/// [`WORTH`].
fn max_added(variances: &[f64], adds: impl Fn(f64) -> Vec<f64>) -> f64 {
    const STEPS: i32 = 20;
    let wanted = (1.0 + WORTH) * half_width(variances);
    let with =
        |size: f64| half_width(&variances.iter().zip(adds(size)).map(|(v, add)| v + add * add).collect::<Vec<_>>());
    // Not bisected from the start: what is added may fall again on the way.
    let sizes = (-9 * STEPS..0).map(|k| 10f64.powf(f64::from(k) / f64::from(STEPS)));
    let above = sizes.into_iter().find(|size| with(*size) >= wanted).unwrap_or(1.0);
    let below = above * 10f64.powf(-1.0 / f64::from(STEPS));
    below + min(above - below, |more| with(below + more) >= wanted)
}

/// The least number up to `max` from which on something holds, to 12 digits of `max`.
fn min(max: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, max);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if holds(middle) { high = middle } else { low = middle }
    }
    high
}

/// A positive number cut to two digits: the scene's hash does not depend on the last bits of a solve.
fn two_digits(value: f64) -> f64 {
    let exponent = value.log10().floor() as i32 - 1;
    // Through text, so that the number is the nearest to its two digits.
    let digits = (value / 10f64.powi(exponent)).floor();
    format!("{digits}e{exponent}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests;
