//! One rig as somebody gets it, tried once: homed, moved, given another load, moved again; and at each of these moments what
//! the board states, next to what is true. Thousands of trials show how often the stated errors hold.
//!
//! Everything is drawn from kind and seed: the rig ([`RigPreset`]), its loads, where its strings stand at power-up, the place of
//! the move, whether it has worked under another load before, and where the zero of its LVDT is: as far off as the scene's
//! `[uncertainty]` says that it is known. The presets have no such error.

use crate::bench::{ControlBench, scene};
use crate::preset::{normal, uniform};
use crate::rig::EmulatedRig;
use crate::units::STANDARD_GRAVITY;
use crate::{PlantChange, PlantKey, PlantSettings, RigPreset};
use rig_control::Controller;
use rig_link::Accepted;
use rig_link::messages::{LoadChoice, Parameter, Refusal, Request, State, Telemetry};
use serde::Serialize;

/// Loads (kg), evenly in their logarithm; most of the default scene's range.
const LOADS_KG: [f64; 2] = [0.1, 1.7];
/// Twist at power-up (rad), either way.
const TWIST_RAD: f64 = 12.0;
/// Targets of the first move (m), which every load reaches.
const PLACES_M: [f64; 2] = [0.001, 0.013];
/// Targets of the moves under the other load, and of the moves of a rig that has worked before (m).
const MOVES_M: [f32; 2] = [0.004, 0.010];
/// Speed of every move (m/s).
const SPEED_M_PER_S: f32 = 0.003;
/// How far from the end of its travel a load is brought whose travel does not reach its target (m).
const FROM_END_M: f32 = 0.5e-3;
/// How long a load hangs before it is looked at (s): where a move ends, and where somebody has hung another one.
const REST_S: f64 = 2.0;
const CHANGED_S: f64 = 5.0;
/// How often `clear` is tried after a fault, every 0.2 s.
const CLEARS: u8 = 20;

/// A moment at which board and truth are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Moment {
    /// Homed.
    Homed,
    /// At rest at the end of a move under the homed load.
    Arrived,
    /// Some seconds after another load was hung on.
    Changed,
    /// After two moves under that load.
    Moved,
}

/// What the board states at a moment, and what is true. SI units; nothing where the board states nothing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stated {
    /// When.
    pub moment: Moment,
    /// Weight on the rail (N).
    pub true_load_n: f64,
    /// Load (N) and its 90 % error (N).
    pub load_n: Option<f32>,
    /// See `load_n`.
    pub load_error_n: Option<f32>,
    /// What the board says against relying on the load, separated by blanks.
    pub doubts: String,
    /// How far the load is above where it hung when homing ended (m).
    pub true_position_m: f64,
    /// Position (m) and its 90 % error (m).
    pub position_m: Option<f32>,
    /// See `position_m`.
    pub position_error_m: Option<f32>,
}

impl Stated {
    /// Whether the stated error holds the true load; `None` without a load.
    pub fn holds_load(&self) -> Option<bool> {
        let (load_n, error_n) = self.load_n.zip(self.load_error_n)?;
        Some((f64::from(load_n) - self.true_load_n).abs() <= f64::from(error_n))
    }

    /// Whether the stated error holds the true position; `None` without a position.
    pub fn holds_position(&self) -> Option<bool> {
        let (position_m, error_m) = self.position_m.zip(self.position_error_m)?;
        Some((f64::from(position_m) - self.true_position_m).abs() <= f64::from(error_m))
    }
}

/// What a trial is made on: the control code alone, or the firmware on an emulated board.
pub trait TrialBench {
    /// The plant.
    fn rig(&mut self) -> &mut EmulatedRig;

    /// True position since homing (m).
    fn true_position_m(&self) -> f64;

    /// Newest telemetry.
    fn telemetry(&self) -> Option<Telemetry>;

    /// For the given time (s).
    fn run(&mut self, seconds: f64);

    /// Sends a request; the reply, if there is one.
    fn reply(&mut self, request: Request) -> Option<Result<Accepted, Refusal>>;

    /// Waits for the drive after its start, and homes.
    ///
    /// # Errors
    /// In words.
    fn home(&mut self) -> Result<(), String>;

    /// Moves to a target (m) at a speed (m/s) and waits until the load stands.
    ///
    /// # Errors
    /// In words.
    fn move_to(&mut self, target_m: f32, speed_m_per_s: f32) -> Result<(), String>;
}

impl TrialBench for ControlBench {
    fn rig(&mut self) -> &mut EmulatedRig {
        &mut self.rig
    }

    fn true_position_m(&self) -> f64 {
        self.true_position_m()
    }

    fn telemetry(&self) -> Option<Telemetry> {
        self.telemetry()
    }

    fn run(&mut self, seconds: f64) {
        self.run(seconds);
    }

    fn reply(&mut self, request: Request) -> Option<Result<Accepted, Refusal>> {
        self.tick(Some(request)).reply
    }

    fn home(&mut self) -> Result<(), String> {
        self.home().map(drop)
    }

    fn move_to(&mut self, target_m: f32, speed_m_per_s: f32) -> Result<(), String> {
        self.move_to(target_m, speed_m_per_s, LoadChoice::Auto).map(drop)
    }
}

/// A rig and what is done with it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// Kind of rig.
    pub kind: RigPreset,
    /// Of everything that is drawn.
    pub seed: u64,
    /// Load (N), and the one that is hung on later (N).
    pub loads_n: [f64; 2],
    /// Load of the work before (N), if there was any.
    pub worked_n: Option<f64>,
    /// Twist at power-up (rad).
    pub twist_rad: f64,
    /// Zero of the LVDT (m), normally distributed with the scene's `gap_zero_m` as its standard deviation.
    pub lvdt_offset_m: f64,
    /// Radius of the strings over the scene's, normally distributed about 1 with the scene's `radius` as its standard deviation.
    pub radius_scale: f64,
    /// Target of the first move (m).
    pub place_m: f64,
}

impl Trial {
    /// The trial of a kind that a seed names.
    pub fn new(kind: RigPreset, seed: u64) -> Self {
        let drawn = |name: &str| uniform(seed, name);
        let [min_kg, max_kg] = LOADS_KG;
        let load_n = |name: &str| STANDARD_GRAVITY * min_kg * (max_kg / min_kg).powf(drawn(name));
        Self {
            kind,
            seed,
            loads_n: [load_n("trial load"), load_n("trial other load")],
            worked_n: (drawn("trial worked") < 0.5).then(|| load_n("trial load before")),
            twist_rad: TWIST_RAD * (2.0 * drawn("trial twist") - 1.0),
            lvdt_offset_m: scene().uncertainty.gap_zero_m * normal(seed, "trial lvdt offset"),
            radius_scale: 1.0 + scene().uncertainty.radius * normal(seed, "trial radius"),
            place_m: PLACES_M[0] + (PLACES_M[1] - PLACES_M[0]) * drawn("trial place"),
        }
    }

    /// What the scene's constants miss of the rig, by as much as its `[uncertainty]` says; no preset has it.
    pub fn constants_off(&self) -> [PlantChange; 2] {
        [(PlantKey::LvdtOffset, self.lvdt_offset_m), (PlantKey::RadiusScale, self.radius_scale)]
            .map(|(key, value)| PlantChange { key, value })
    }

    /// The rig, as switched on.
    ///
    /// # Errors
    /// In words, where its strings or its load are out of what the plant can show.
    pub fn rig(&self) -> Result<EmulatedRig, String> {
        let mut settings = PlantSettings::preset(self.kind, self.seed);
        (settings.load_n, settings.twist_at_boot_rad) = (self.worked_n.unwrap_or(self.loads_n[0]), self.twist_rad);
        self.constants_off().into_iter().for_each(|change| settings.put(change));
        EmulatedRig::new(scene(), settings, self.seed).map_err(|e| e.to_string())
    }

    /// Tries the rig with control code that has just booted. Moments that it does not get to are missing; why is the second part,
    /// empty if nothing was in the way.
    pub fn run(&self, control: Controller) -> (Vec<Stated>, String) {
        match self.rig() {
            Ok(rig) => self.run_on(&mut ControlBench::on(rig, control)),
            Err(why) => (Vec::new(), why),
        }
    }

    /// The same on a bench that has just been switched on with this trial's rig.
    pub fn run_on(&self, bench: &mut impl TrialBench) -> (Vec<Stated>, String) {
        let mut stated = Vec::new();
        let why = self.stated(bench, &mut stated).err().unwrap_or_default();
        (stated, why)
    }

    fn stated(&self, bench: &mut impl TrialBench, stated: &mut Vec<Stated>) -> Result<(), String> {
        if self.worked_n.is_some() {
            home(bench)?;
            for target_m in MOVES_M {
                go(bench, target_m)?;
            }
            hang(bench, self.loads_n[0])?;
        }
        home(bench)?;
        look(bench, Moment::Homed, stated);
        go(bench, self.place_m as f32)?;
        bench.run(REST_S);
        look(bench, Moment::Arrived, stated);
        let faults = hang(bench, self.loads_n[1])?;
        look(bench, Moment::Changed, stated);
        if bench.telemetry().is_none_or(|t| t.position_m.is_none()) {
            return Err(format!("another load: {faults}, after which the rig must be homed"));
        }
        for target_m in MOVES_M {
            go(bench, target_m)?;
        }
        bench.run(REST_S);
        look(bench, Moment::Moved, stated);
        Ok(())
    }
}

fn home(bench: &mut impl TrialBench) -> Result<(), String> {
    bench.home().map_err(|why| format!("homing: {why}"))?;
    // The tick that ends homing shows no load yet.
    bench.run(0.05);
    Ok(())
}

/// Moves to a target (m), or as near to it as the strings can bring this load.
fn go(bench: &mut impl TrialBench, target_m: f32) -> Result<(), String> {
    let asked = Request::Move { target_m, speed_m_per_s: SPEED_M_PER_S, load: LoadChoice::Auto };
    let target_m = match bench.reply(asked) {
        Some(Err(Refusal::OutOfRange { parameter: Parameter::Target, min, max, .. })) => {
            let from_end_m = FROM_END_M.min(0.5 * (max - min));
            target_m.max(min + from_end_m).min(max - from_end_m)
        }
        _ => target_m,
    };
    bench.move_to(target_m, SPEED_M_PER_S).map_err(|why| format!("move to {:.1} mm: {why}", 1e3 * target_m))
}

/// Hangs another load on (N), and clears the faults that follow, because a load may spring up or drop. Returns their names.
fn hang(bench: &mut impl TrialBench, load_n: f64) -> Result<String, String> {
    bench.rig().set_plant(PlantKey::Load.name(), &load_n.to_string()).map_err(|e| e.to_string())?;
    bench.run(CHANGED_S);
    let faults = bench.telemetry().map(|t| t.faults.to_string()).unwrap_or_default();
    for _ in 0..CLEARS {
        if bench.telemetry().is_some_and(|t| t.state != State::Fault) {
            return Ok(faults);
        }
        bench.reply(Request::Clear);
        bench.run(0.2);
    }
    Err(format!("another load: {faults} is not cleared"))
}

fn look(bench: &mut impl TrialBench, moment: Moment, stated: &mut Vec<Stated>) {
    let Some(telemetry) = bench.telemetry() else { return };
    stated.push(Stated {
        moment,
        true_load_n: bench.rig().truth().load_n,
        load_n: telemetry.load_n,
        load_error_n: telemetry.load_error_n,
        doubts: telemetry.doubts.iter().map(|doubt| doubt.name()).collect::<Vec<_>>().join(" "),
        true_position_m: bench.true_position_m(),
        position_m: telemetry.position_m,
        position_error_m: telemetry.position_error_m,
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::booted;

    #[test]
    fn a_seed_names_one_trial_and_the_draws_keep_to_their_ranges() {
        let trials: Vec<Trial> = (0..200).map(|seed| Trial::new(RigPreset::Hard, seed)).collect();
        assert_eq!(trials[7], Trial::new(RigPreset::Hard, 7));
        let [min_n, max_n] = LOADS_KG.map(|kg| kg * STANDARD_GRAVITY);
        for trial in &trials {
            assert!(trial.loads_n.iter().chain(&trial.worked_n).all(|n| (min_n..=max_n).contains(n)), "{trial:?}");
            assert!(trial.twist_rad.abs() <= TWIST_RAD && (PLACES_M[0]..=PLACES_M[1]).contains(&trial.place_m));
        }
        let known = &scene().uncertainty;
        let drawn: [&dyn Fn(&Trial) -> f64; 2] =
            [&|trial| trial.lvdt_offset_m / known.gap_zero_m, &|trial| (trial.radius_scale - 1.0) / known.radius];
        for drawn in drawn {
            let squares = trials.iter().map(|trial| drawn(trial).powi(2)).sum::<f64>();
            assert!((0.8..1.2).contains(&(squares / 200.0).sqrt()), "{squares}");
        }
        let settings = trials[7].rig().unwrap().settings().clone();
        assert_eq!(settings.lvdt_offset_m, trials[7].lvdt_offset_m);
        assert_eq!(settings.radius_scale, trials[7].radius_scale);
        let worked = trials.iter().filter(|trial| trial.worked_n.is_some()).count();
        assert!((70..130).contains(&worked), "{worked} of 200 have worked before");
        let light = trials.iter().filter(|trial| trial.loads_n[0] < (min_n * max_n).sqrt()).count();
        assert!((70..130).contains(&light), "{light} of 200 are in the lighter half");
    }

    /// On a rig of its own model every moment is reached and what is stated is near the truth.
    #[test]
    fn a_rig_of_its_own_model_is_known_at_every_moment() {
        let trial = Trial {
            loads_n: [5.0, 8.0],
            worked_n: None,
            place_m: 0.008,
            lvdt_offset_m: 0.0,
            radius_scale: 1.0,
            ..Trial::new(RigPreset::Ideal, 1)
        };
        let (stated, why) = trial.run(booted());
        let moments: Vec<Moment> = stated.iter().map(|s| s.moment).collect();
        assert_eq!(moments, [Moment::Homed, Moment::Arrived, Moment::Changed, Moment::Moved], "{why}");
        for s in &stated {
            assert_eq!(s.true_load_n, if matches!(s.moment, Moment::Homed | Moment::Arrived) { 5.0 } else { 8.0 });
            let error = f64::from(s.load_n.expect("a load")) / s.true_load_n - 1.0;
            assert!(error.abs() < 0.03 && s.holds_load() == Some(true), "{s:?}");
            assert_eq!(s.holds_position(), Some(true), "{s:?}");
        }
        assert!(
            (stated[1].true_position_m - 0.008).abs() < 0.1e-3 && (stated[3].true_position_m - 0.010).abs() < 0.1e-3
        );
    }

    /// 1.4 kg cannot be lifted by 10 mm, and so light a load as 0.15 kg cannot be let down to 4 mm.
    #[test]
    fn targets_beyond_the_travel_of_the_other_load_are_brought_nearer() {
        for loads_n in [[1.5, 14.0], [5.0, 1.5]] {
            let trial = Trial {
                loads_n,
                worked_n: None,
                place_m: 0.008,
                lvdt_offset_m: 0.0,
                ..Trial::new(RigPreset::Ideal, 1)
            };
            let (stated, why) = trial.run(booted());
            assert_eq!((stated.len(), why.as_str()), (4, ""), "{loads_n:?}");
        }
    }

    #[test]
    fn a_trial_that_cannot_be_finished_says_why_and_keeps_what_it_had() {
        let trial = Trial { loads_n: [5.0, 150.0], worked_n: None, ..Trial::new(RigPreset::Ideal, 1) };
        let (stated, why) = trial.run(booted());
        assert!(stated.len() < 4 && !why.is_empty(), "{stated:?} {why}");
        // A light load springs up, and falls back by more than a centimetre.
        let (stated, why) = Trial { kind: RigPreset::Nominal, loads_n: [15.5, 1.5], ..trial.clone() }.run(booted());
        assert_eq!((stated.len(), why.as_str()), (4, ""));
        let (stated, why) = Trial { twist_rad: 1e3, worked_n: None, ..trial }.run(booted());
        assert!(stated.is_empty() && why.contains("twist"), "{why}");
    }

    #[test]
    fn an_error_holds_the_truth_up_to_its_edge() {
        let stated = Stated {
            moment: Moment::Homed,
            true_load_n: 2.0,
            load_n: Some(2.5),
            load_error_n: Some(0.5),
            doubts: String::new(),
            true_position_m: 0.0,
            position_m: None,
            position_error_m: None,
        };
        assert_eq!((stated.holds_load(), stated.holds_position()), (Some(true), None));
        assert_eq!(Stated { load_error_n: Some(0.49), ..stated }.holds_load(), Some(false));
    }
}
