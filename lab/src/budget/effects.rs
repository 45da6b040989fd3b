//! What each part of a rig does to the gap, under one load.
//!
//! Each effect is a change of the gap at each state, one standard deviation of it: `homed` while the rig is homed, `later`
//! what it is more when the rig is used ([`SESSION_S`] later, after a visit to the heaviest load). From these follow the
//! errors of load and transmission ratio ([`super::Budget`]).

use super::columns::{Column, State};
use super::homing::Priors;
use super::{BANDWIDTH_PER_S, Part, RigErrors, SESSION_S, SPEED_M_PER_S};
use rig_config::Scene;
use rig_control::TICK_S;
use rig_control::homing;
use rig_control::homing::load_estimate::MIN_GAP_ERROR_M;
use rig_control::limits::rise_s;
use rig_link::messages::LVDT_POINTS_MAX;
use rig_plant::rig::effects::{
    CREEP_TIMES_S, LVDT_GAIN_PER_K, ROD_STRESS_PER_K, ROD_THRESHOLDS, RUN_IN_CYCLES, TURNS_PER_CYCLE, rod_onset,
};
use rig_plant::units::STANDARD_GRAVITY;
use rig_plant::{PlantKey, PlantSettings};
use std::f64::consts::{PI, SQRT_2, TAU};

/// Samples of the LVDT in a tick, and how long they take (s): a block of the board's converter.
const SAMPLES: f64 = 256.0;
const BLOCK_S: f64 = 6e-3;
/// Frequency of the mains (Hz).
const MAINS_HZ: f64 = 50.0;
/// How long a load has been creeping when homing weighs it (s).
const HOMED_S: f64 = 20.0;
/// Time between a set-point and the shaft (ticks): the drive turns to it in the tick after, and it stands for one.
const LAG_TICKS: f64 = 1.5;
/// A change of the gap (m) at each state of a column.
pub(super) struct Effect {
    pub part: Part,
    pub homed: Vec<f64>,
    pub later: Vec<f64>,
    /// The gap itself does not change, but the LVDT misreads it: the position is wrong as well.
    pub misread: bool,
}

impl Effect {
    /// One that does not change after homing.
    pub fn homed(part: Part, homed: Vec<f64>) -> Self {
        Self { part, later: vec![0.0; homed.len()], homed, misread: false }
    }
}

/// Errors that are no change of the gap: of the position (m) and of the load (relative), standard deviations at each state.
pub(super) struct Direct {
    pub part: Part,
    pub position_m: Vec<f64>,
    pub load: Vec<f64>,
}

/// What makes up the errors under one load.
pub(super) struct Effects<'a> {
    pub scene: &'a Scene,
    pub rig: &'a RigErrors<'a>,
    pub column: &'a Column,
    /// The states under the heaviest load.
    pub heaviest: &'a Column,
    /// Minimum and maximum gap of all columns (m).
    pub gaps_m: [f64; 2],
    /// Standard error of the twist's scale, by the scene.
    pub scale_error: f64,
    /// By how much the scene's mechanism may miss the gaps of a homing's sweep (m, rms).
    pub law_error_m: f64,
}

impl Effects<'_> {
    /// Standard deviation of the LVDT's noise in one tick (m).
    fn noise_m(&self) -> f64 {
        let hum = self.rig.size(PlantKey::Hum) / SQRT_2 * (PI * MAINS_HZ * BLOCK_S).sin() / (PI * MAINS_HZ * BLOCK_S);
        let [white, inband] =
            [PlantSettings::default().lvdt_noise_m / SAMPLES.sqrt(), self.rig.size(PlantKey::LvdtNoiseInband)];
        (white * white + inband * inband + hum * hum).sqrt()
    }

    /// Every change of the gap.
    pub fn gaps(&self) -> Vec<Effect> {
        let mut all = self.sensor();
        all.extend(self.memory());
        let shift = self.rig.size(PlantKey::TwistExponentShift);
        all.push(Effect::homed(Part::Law, self.column.each(|s| s.by_arc * s.arc_by_exponent * shift)));
        let temperature = ROD_STRESS_PER_K * self.rig.size(PlantKey::Temperature);
        all.push(Effect::homed(Part::Law, self.column.each(|s| s.by_stress * temperature * rod_onset(s.strain)[0])));
        all
    }

    fn sensor(&self) -> Vec<Effect> {
        let misread = |of: &dyn Fn(f64) -> f64| Effect {
            misread: true,
            ..Effect::homed(Part::Sensor, self.column.each(|s| of(s.gap_m)))
        };
        let rig = &self.scene.rig;
        let gain = LVDT_GAIN_PER_K * self.rig.size(PlantKey::Temperature);
        let mut all = vec![misread(&|gap_m| gain * (gap_m - rig.lvdt_gap_at_zero_m))];
        if let Some(gauge_m) = self.rig.gauge_m {
            // Straight between the points, each wrong by itself.
            let [low_m, high_m] = self.gaps_m;
            let apart_m = (high_m - low_m) / (LVDT_POINTS_MAX - 1) as f64;
            all.extend((0..LVDT_POINTS_MAX).map(|k| {
                let at_m = low_m + k as f64 * apart_m;
                misread(&|gap_m| gauge_m / super::NINETY * (1.0 - (gap_m - at_m).abs() / apart_m).max(0.0))
            }));
            return all;
        }
        // A sine of any phase is a sine and a cosine, each of 1/√2 of its size.
        let size_m = self.rig.size(PlantKey::LvdtNonlinearity) * rig.lvdt_stroke_m / SQRT_2;
        let phase = |gap_m: f64| TAU * (gap_m - rig.lvdt_gap_at_zero_m) / rig.lvdt_stroke_m;
        all.push(misread(&|gap_m| size_m * phase(gap_m).sin()));
        all.push(misread(&|gap_m| size_m * phase(gap_m).cos()));
        // That of the converter goes once up and down over its range.
        let inl_m = self.rig.size(PlantKey::AdcInl) * rig.lvdt_metres_per_code();
        let fraction = |gap_m: f64| (gap_m - rig.lvdt_gap_at_code_zero_m()) / (4095.0 * rig.lvdt_metres_per_code());
        all.push(misread(&|gap_m| inl_m * (TAU * fraction(gap_m)).sin()));
        all
    }

    fn memory(&self) -> Vec<Effect> {
        let column = self.column;
        let none = column.each(|_| 0.0);
        let of = |homed, later| Effect { part: Part::Memory, homed, later, misread: false };
        let width_pa = self.rig.size(PlantKey::RodHysteresis);
        let at_first = column.each(|s| s.by_stress * width_pa * rod_memory(s.strain, s.strain));
        let pairs = column.0.iter().zip(&self.heaviest.0);
        let since = pairs.map(|(s, max)| {
            let change = rod_memory(s.strain, max.strain) - rod_memory(s.strain, s.strain);
            s.by_stress * width_pa * change
        });
        let rods = of(at_first, since.collect());
        let compliance = self.rig.size(PlantKey::StringCreep) * 0.5 / self.scene.string.stiffness_n_per_m;
        let stretch_m = |s: &State, time_s: f64| compliance * s.load_n * crept(time_s);
        let creep = of(
            column.each(|s| stretch_m(s, HOMED_S)),
            column.each(|s| stretch_m(s, HOMED_S + SESSION_S) - stretch_m(s, HOMED_S)),
        );
        let last = column.0.len() - 1;
        let turned_rad =
            (column.0[last].twist_rad - column.0[0].twist_rad) / column.travel_m() * SPEED_M_PER_S * SESSION_S;
        let lost =
            self.rig.size(PlantKey::StringBedding) * -(-turned_rad / (TURNS_PER_CYCLE * TAU * RUN_IN_CYCLES)).exp_m1();
        let bedding = of(none.clone(), column.each(|s| -lost * s.by_arc * s.arc_m));
        // Half the play on either way, of which homing takes for friction what is the same at every twist.
        let half_rad = 0.5 * self.rig.size(PlantKey::TwistPlay);
        let pulls = column.each(|s| half_rad * s.by_twist / s.by_load);
        let friction_n = pulls.iter().sum::<f64>() / pulls.len() as f64;
        let play = of(none, column.each(|s| half_rad * s.by_twist - friction_n * s.by_load));
        vec![rods, creep, bedding, play]
    }

    /// Standard errors of what homing takes from elsewhere.
    pub fn priors(&self) -> Priors {
        let (known, constants) = (&self.scene.uncertainty, self.scene.constants());
        let zero_m = known.gap_zero_m.hypot(constants.lvdt_reading_error_m().into());
        Priors { scale: self.scale_error, zero_m, slope: constants.lvdt_slope_error().into(), law_m: self.law_error_m }
    }

    /// Unknowns of the fit whose prior is wrong because the scene's constants are (`[uncertainty]`), and by how much. What the LVDT
    /// adds to its zero is an effect of its own.
    pub fn wrong_priors(&self) -> [(usize, f64); 3] {
        let known = &self.scene.uncertainty;
        [(1, self.scale_error), (2, known.gap_zero_m), (4, self.scale_error)]
    }

    /// Every error that is no change of the gap.
    pub fn direct(&self) -> Vec<Direct> {
        let column = self.column;
        let noise_m = self.noise_m();
        let noise = Direct {
            part: Part::Sensor,
            position_m: column.each(|_| noise_m),
            load: column.each(|s| noise_m / (s.by_load * s.load_n)),
        };
        vec![noise, self.friction(), self.following(noise_m)]
    }

    /// Stiction lets the load rest anywhere within a fraction of its jump; and it makes friction greater where the load moves
    /// more slowly than while homing.
    fn friction(&self) -> Direct {
        let coulomb_n = |s: &State| {
            let fraction = self.rig.size(PlantKey::FrictionLoadShare);
            self.rig.size(PlantKey::Friction) + fraction * s.load_n
        };
        let more = self.rig.size(PlantKey::StictionRatio);
        let vs = self.rig.size(PlantKey::StribeckSpeed);
        let falls = |v: f64| if vs > 0.0 { (-(v / vs).powi(2)).exp() } else { 0.0 };
        let homing_rad_per_s = f64::from(homing::SPEED);
        Direct {
            part: Part::Friction,
            position_m: self.column.each(|s| {
                let jump_m = 2.0 * more * coulomb_n(s) * s.by_load;
                0.5 * jump_m / 3f64.sqrt()
            }),
            load: self.column.each(|s| {
                let homed = falls(homing_rad_per_s * s.by_twist);
                coulomb_n(s) * more * (falls(SPEED_M_PER_S) - homed).abs() / s.load_n
            }),
        }
    }

    /// The shaft follows its set-point late: while the load gains speed an error builds up, which the loop takes back. At rest
    /// an error within the noise is left alone.
    fn following(&self, noise_m: f64) -> Direct {
        let lag_s = LAG_TICKS * f64::from(TICK_S);
        let move_s = self.column.travel_m() / SPEED_M_PER_S;
        let resting_m = f64::from(homing::NINETY_PERCENT) * noise_m.max(f64::from(MIN_GAP_ERROR_M)) / 3f64.sqrt();
        let rise_s = |s: &State| f64::from(rise_s(s.load_n as f32, s.by_load as f32));
        // At both ends of a move it decays with the loop: the mean square of two exponentials.
        let moving_m = |s: &State| {
            let rise = BANDWIDTH_PER_S * rise_s(s);
            SPEED_M_PER_S * lag_s * -(-rise).exp_m1() / rise / (BANDWIDTH_PER_S * move_s).sqrt()
        };
        let oscillation = |s: &State| {
            let rise_s = rise_s(s);
            2.0 * SPEED_M_PER_S / rise_s / STANDARD_GRAVITY * (2.0 * rise_s / move_s).min(1.0).sqrt()
        };
        Direct {
            part: Part::Loop,
            position_m: self.column.each(|s| moving_m(s).hypot(resting_m)),
            load: self.column.each(oscillation),
        }
    }
}

impl RigErrors<'_> {
    /// Standard deviation of a plant key, from what a rig of its own model has.
    fn size(&self, key: PlantKey) -> f64 {
        let size = (self.sizes)(key);
        if key == PlantKey::Friction && size == 0.0 { PlantSettings::default().friction_n } else { size }
    }
}

/// Fraction of the half width of their loop that rods have as additional stress at a strain, after a greater one.
fn rod_memory(strain: f64, max: f64) -> f64 {
    let elements = ROD_THRESHOLDS.map(|slips| (max.min(slips) - (max - strain)).max(-slips) / slips);
    elements.iter().sum::<f64>() / ROD_THRESHOLDS.len() as f64
}

/// Fraction of the slow stretch that is there after a time (s).
fn crept(time_s: f64) -> f64 {
    CREEP_TIMES_S.iter().map(|own_s| -(-time_s / own_s).exp_m1()).sum::<f64>() / CREEP_TIMES_S.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rods_on_the_way_up_have_their_loop_and_on_the_way_down_the_opposite() {
        assert!((rod_memory(0.02, 0.02) - 1.0).abs() < 1e-12);
        assert!((rod_memory(0.02, 0.04) + 1.0).abs() < 1e-12, "more than twice every threshold below");
        assert!(
            (rod_memory(0.034, 0.04) - (1.0 - 0.006 * (1.0 / 0.005 + 1.0 / 0.0065 + 1.0 / 0.008) / 3.0)).abs() < 1e-12
        );
        assert!(rod_memory(0.0025, 0.0025) > 0.3 && rod_memory(0.0025, 0.0025) < 0.5);
    }

    #[test]
    fn strings_creep_by_all_of_it_in_the_end() {
        assert!(crept(0.0) == 0.0 && (crept(1e6) - 1.0).abs() < 1e-12);
        assert!((crept(30.0) - (1.0 + 1.0 - (-0.5f64).exp() + 0.0165) / 3.0).abs() < 1e-3);
    }
}
