//! The rig around the microcontroller: a [`Board`](crate::board::Board) whose wires lead to a drive, a motor, an
//! encoder, an LVDT and the twisted string itself.
//!
//! - [`plant_settings`] and [`parameters`]: what a test may change, what the scene says.
//! - [`transmission`] and [`surface`]: the mechanism's equilibria, exactly and fast.
//! - [`plant`], [`motor`], [`encoder`], [`lvdt`]: the parts that move and measure.
//! - [`effects`]: what real rigs have besides.
//! - [`drive`]: the RMDS-405 on the bus, or on the serial line.
//! - [`faults`]: what can be broken.
//! - `wires`: what the chip's pins are wired to.
//!
//! Time advances in fixed steps of 0.25 ms from power-up, whatever calls come in between, so that the same calls at the
//! same times give the same results.

pub mod drive;
pub mod effects;
pub mod encoder;
pub mod faults;
pub mod lvdt;
pub mod motor;
pub mod parameters;
pub mod plant;
pub mod plant_settings;
pub mod surface;
pub mod transmission;
mod wires;

use std::collections::VecDeque;

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use rig_scene::Scene;
use sim_link::{PlantChange, PlantError, Truth};
use tsa_model::{Mechanism, RadiusLaw, Tier};

use crate::board::Stimulus;
use drive::{Drive, LEAST_SUPPLY_V, Sensed};
use effects::rods::Rods;
use effects::strings::{StringSizes, Strings};
use encoder::Encoder;
use lvdt::Lvdt;
use motor::{Bridge, Motor};
use parameters::RigParameters;
use plant::{Conditions, Plant};
use plant_settings::PlantSettings;
use surface::{NoSurface, SLACK_LOAD_N, Surface};
use transmission::{Tiered, cheapest_tier};

/// Time step, s.
pub const STEP_S: f64 = 2.5e-4;
/// Steps in a run of the drive's loops, 1 ms.
const STEPS_PER_TICK: u64 = 4;
/// Less than a CPU cycle: times that differ by it are the same.
const SAME_TIME_S: f64 = 2e-8;
/// Greatest load that the surface covers, unless the load or the scene asks for more, N.
const SURFACE_LOAD_N: f64 = 40.0;
/// Ticks between two solutions of the full model for the tension.
const TENSION_TICKS: u64 = 10;
/// What tells the seeds of further random numbers from the rig's own, so that none changes the noise of the samples.
const LVDT_SEED: u64 = 0x6c76_6474_0000_0000;
/// As [`LVDT_SEED`].
const CURRENT_SEED: u64 = 0x616d_7065_0000_0000;
/// USART of the host link (hardware.md 8).
pub const HOST_USART: u8 = 2;
/// Why a rig could not be built.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The scene's mechanism.
    #[error(transparent)]
    Mechanism(#[from] tsa_model::ParameterError),
    /// The scene's drive address.
    #[error(transparent)]
    Drive(#[from] rmds405::OutOfRange),
    /// The mechanism does not reach where the rig has to go.
    #[error(transparent)]
    Surface(#[from] NoSurface),
    /// The load would break the rods before the strings touch.
    #[error("plant key `load`: {load_n} N is more than this mechanism can carry, at most {most_n} N")]
    Load {
        /// Asked for.
        load_n: f64,
        /// The surface's end.
        most_n: f64,
    },
    /// The strings would lie far closer than side by side, or the rods be bent far beyond their strain.
    #[error(
        "plant key `twist_at_boot`: {twist_rad} rad is more than the strings can have under {load_n} N, at most {most_rad} rad either way"
    )]
    Twist {
        /// Asked for.
        twist_rad: f64,
        /// Load, N.
        load_n: f64,
        /// The greatest there can be, rounded down.
        most_rad: f64,
    },
}

/// How far past the last twist with an equilibrium the strings can be left, rad: strings that lie side by side still
/// give a little. That is ten turns under 0.1 kg. When they are released they throw the rotor to the other side.
const CLOSED_GIVE_RAD: f64 = 1.7;

/// Drive, motor, mechanism and sensors on the microcontroller's pins.
#[derive(Clone)]
pub struct Rig {
    parameters: RigParameters,
    settings: PlantSettings,
    mechanism: Mechanism,
    tier: Tier,
    noise: Pcg64Mcg,
    current_noise: Pcg64Mcg,
    plant: Plant,
    motor: Motor,
    encoder: Encoder,
    lvdt: Lvdt,
    drive: Drive,
    bridge: Bridge,
    relay_pin: bool,
    /// When the relay's contact opens, s; it stays closed as long as its pin is high.
    relay_opens_s: f64,
    driven_rad: f64,
    estop: bool,
    motor_open: bool,
    limit_fault: bool,
    silent: bool,
    can_shorted: bool,
    steps: u64,
    boot_angle_rad: f64,
    boot_counts: i64,
    boot_pretwist_gap_m: f64,
    tension_share: f64,
    pins: Vec<(char, u8, bool)>,
    polled: bool,
    from_drive: VecDeque<(f64, Stimulus)>,
    pending: Vec<Stimulus>,
    host_bytes: Vec<u8>,
    record: bool,
    records: Vec<Truth>,
}

impl Rig {
    /// A rig at rest, drive without power. `seed` is that of all noise.
    ///
    /// # Errors
    /// [`RigError`] if the scene is no rig, or the mechanism cannot carry the load or have the twist.
    pub fn new(scene: &Scene, settings: PlantSettings, seed: u64) -> Result<Self, RigError> {
        let parameters = RigParameters::new(&scene.rig)?;
        let real = settings.distort(scene);
        let mechanism = Mechanism::new(&real.geometry, &real.string, &real.material)?;
        let (surface, tier) = surface_for(&mechanism, &real, settings.load_n)?;
        let stop = parameters.lvdt_gap_at_zero_m;
        let stops_m = [stop, stop + parameters.lvdt_stroke_m];
        let twist_rad = settings.twist_at_boot_rad;
        let most_rad = (10.0 * (surface.last_twist_rad(settings.load_n) + CLOSED_GIVE_RAD)).floor() / 10.0;
        if twist_rad.abs() > most_rad {
            return Err(RigError::Twist { twist_rad, load_n: settings.load_n, most_rad });
        }
        let rods = rods_of(&mechanism, &settings, &surface);
        let strings = Strings::new(mechanism.parameters(), &string_sizes(&real, &settings), twist_rad, settings.load_n);
        let plant = Plant::new(surface, stops_m, strings, rods, &conditions(&settings));
        let boot_pretwist_gap_m = plant.gap_at(tsa_model::PRETWIST_RAD, &conditions(&settings));
        let play = 0.5 * settings.gear_backlash_rad;
        let boot_angle_rad = (twist_rad + play.copysign(twist_rad)) * parameters.gear_ratio;
        let encoder = Encoder::new(parameters.counts_per_turn);
        let boot_counts = encoder.counts(boot_angle_rad);
        let mut rig = Self {
            tier,
            lvdt: Lvdt::new(&parameters, &settings, plant.gap_m, seed ^ LVDT_SEED),
            motor: Motor::new(&parameters, settings.torque_constant_scale, boot_angle_rad),
            drive: Drive::new(&parameters),
            noise: Pcg64Mcg::seed_from_u64(seed),
            current_noise: Pcg64Mcg::seed_from_u64(seed ^ CURRENT_SEED),
            bridge: Bridge::Open,
            relay_pin: false,
            relay_opens_s: 0.0,
            driven_rad: 0.0,
            estop: false,
            motor_open: false,
            limit_fault: false,
            silent: false,
            can_shorted: false,
            steps: 0,
            tension_share: 0.5,
            pins: Vec::new(),
            polled: false,
            from_drive: VecDeque::new(),
            pending: Vec::new(),
            host_bytes: Vec::new(),
            record: false,
            records: Vec::new(),
            parameters,
            settings,
            mechanism,
            plant,
            encoder,
            boot_angle_rad,
            boot_counts,
            boot_pretwist_gap_m,
        };
        rig.look_at_tension();
        rig.drive_all_pins();
        rig.look_at_power();
        Ok(rig)
    }

    /// Changes the plant while the rig runs.
    ///
    /// # Errors
    /// [`PlantError`] if the key makes another mechanism, or no rig can have the value.
    pub fn change_plant(&mut self, change: PlantChange) -> Result<(), PlantError> {
        change.check_running()?;
        self.settings.apply(change)?;
        if !self.plant.has_rods() {
            let rods = rods_of(&self.mechanism, &self.settings, self.plant.surface());
            self.plant.set_rods(rods);
        }
        self.look_at_power();
        Ok(())
    }

    /// Changes the plant while the rig runs, with a value as an operator types it.
    ///
    /// # Errors
    /// As [`Rig::change_plant`], and if key or value cannot be read.
    pub fn set_plant(&mut self, key: &str, value: &str) -> Result<(), PlantError> {
        self.change_plant(PlantChange::read(key, value)?)
    }

    /// The plant as it is now.
    pub fn settings(&self) -> &PlantSettings {
        &self.settings
    }

    /// The board's supply went off and on. The relay's coil has no current. A drive that loses its own supply later
    /// than that, or not at all, goes on with its last command. String and load stay as they are.
    pub fn power_cycle(&mut self) {
        self.set_relay(false);
        self.host_bytes.clear();
        self.from_drive.clear();
        self.drive_all_pins();
    }

    /// Time of the state, s; a multiple of [`STEP_S`].
    pub fn now_s(&self) -> f64 {
        self.steps as f64 * STEP_S
    }

    /// The drive.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The load on its rail.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Bytes that the firmware has sent on the host link since the last call.
    pub fn take_host_bytes(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.host_bytes)
    }

    /// Keeps a [`Truth`] every 1 ms from now on, for [`Rig::take_records`].
    pub fn record(&mut self) {
        self.record = true;
        self.look_at_tension();
    }

    /// The records since the last call.
    pub fn take_records(&mut self) -> Vec<Truth> {
        std::mem::take(&mut self.records)
    }

    /// The model that the mechanism runs on: the cheapest that the scene needs.
    pub fn tier(&self) -> Tier {
        self.tier
    }

    /// What really happens now.
    pub fn truth(&self) -> Truth {
        let pull_n = self.plant.pull_n();
        Truth {
            t_s: self.now_s(),
            position_m: self.boot_pretwist_gap_m - self.plant.gap_m,
            gap_m: self.plant.gap_m,
            pretwist_gap_m: self.plant.gap_at(tsa_model::PRETWIST_RAD, &conditions(&self.settings)),
            gap_speed_m_per_s: self.plant.speed_m_per_s,
            twist_rad: self.twist_rad(),
            load_n: self.settings.load_n,
            pull_n,
            string_tension_n: pull_n * self.tension_share,
            string_torque_nm: self.plant.torque_nm(&conditions(&self.settings)),
            motor_angle_rad: self.motor.angle_rad - self.boot_angle_rad,
            motor_speed_rad_per_s: self.motor.speed_rad_per_s,
            motor_current_a: self.motor.current_a,
            motor_energy_j: self.motor.energy_j,
            driven_rad: self.driven_rad,
            drive_mode: self.drive.mode().map_or(0, |mode| mode as u8),
        }
    }

    /// The output shaft is light and the strings pull it towards zero twist: it leans on the gear's near face, and
    /// within the play it stands at zero twist.
    fn twist_rad(&self) -> f64 {
        let geared = self.motor.angle_rad / self.parameters.gear_ratio;
        let play = 0.5 * self.settings.gear_backlash_rad;
        geared - geared.clamp(-play, play)
    }

    fn supply_v(&self) -> f64 {
        self.settings.supply_voltage_v.unwrap_or(self.parameters.supply_voltage_v)
    }

    fn set_relay(&mut self, high: bool) {
        if self.relay_pin && !high {
            self.relay_opens_s = self.now_s() + self.settings.relay_release_s;
        }
        self.relay_pin = high;
        self.look_at_power();
    }

    fn look_at_power(&mut self) {
        let closed = !self.settings.relay_fitted || self.relay_pin || self.now_s() < self.relay_opens_s;
        let on = closed && self.supply_v() >= LEAST_SUPPLY_V;
        self.drive.set_power(on, self.now_s(), self.encoder.counts(self.motor.angle_rad));
        if !on {
            self.bridge = Bridge::Open;
        }
    }

    fn look_at_tension(&mut self) {
        let force_n = self.plant.pull_n();
        if let Ok(solved) = self.mechanism.solve(force_n, self.twist_rad()) {
            self.tension_share = solved.tension_n / force_n;
        }
    }

    fn advance(&mut self, t_s: f64) {
        while (self.steps + 1) as f64 * STEP_S <= t_s + SAME_TIME_S {
            self.step();
        }
    }

    fn step(&mut self) {
        let conditions = conditions(&self.settings);
        let bridge = match (self.estop, self.motor_open) {
            (true, _) => Bridge::Resistor(self.parameters.brake_ohm),
            (false, true) => Bridge::Open,
            (false, false) => self.bridge,
        };
        let torque_nm = self.plant.torque_nm(&conditions) / self.parameters.gear_ratio;
        let before_rad = self.motor.angle_rad;
        self.motor.step(STEP_S, bridge, torque_nm, &self.settings.motor_friction);
        let on_the_bridge = matches!(bridge, Bridge::Voltage(_) | Bridge::Current { .. });
        if on_the_bridge && self.motor.current_a * self.motor.speed_rad_per_s > 0.0 {
            self.driven_rad += (self.motor.angle_rad - before_rad).abs() / self.parameters.gear_ratio;
        }
        let twist_rad = self.twist_rad();
        self.plant.step(STEP_S, twist_rad, &conditions);
        self.lvdt.step(STEP_S, self.plant.gap_m, &self.settings);
        self.steps += 1;
        if self.steps.is_multiple_of(STEPS_PER_TICK) {
            self.tick();
        }
    }

    fn tick(&mut self) {
        let ticks = self.steps / STEPS_PER_TICK;
        self.look_at_power();
        if self.drive.is_powered() {
            // The e-stop takes the motor off the bridge, so the drive measures no current.
            let current_a = if self.estop || self.motor_open { 0.0 } else { self.motor.current_a };
            let sensed = Sensed {
                counts: self.encoder.counts(self.motor.angle_rad),
                current_a,
                reported_current_a: self.settings.current_reading.read(current_a, &mut self.current_noise),
                supply_v: self.supply_v(),
                saturated: !self.estop && !self.motor_open && self.motor.saturated,
            };
            self.bridge = self.drive.tick(self.now_s(), sensed);
        }
        self.collect_reports();
        self.look_at_pins();
        // This is a third of the cost of a rig without the chip, so it runs only while records are kept.
        if self.record && ticks.is_multiple_of(TENSION_TICKS) {
            self.look_at_tension();
        }
        if self.record {
            self.records.push(self.truth());
        }
    }
}

/// What acts on load and mechanism from outside.
fn conditions(settings: &PlantSettings) -> Conditions {
    Conditions {
        weight_n: settings.load_n,
        friction: settings.rail_friction(),
        damping_n_s_per_m: settings.damping_n_s_per_m,
        temperature_k: settings.temperature_k,
    }
}

/// The rods' additional stress, where there is any: sampling them takes a while.
fn rods_of(mechanism: &Mechanism, settings: &PlantSettings, surface: &Surface) -> Option<Rods> {
    let any = settings.rod_hysteresis_pa > 0.0 || settings.temperature_k != 0.0;
    any.then(|| Rods::new(mechanism, surface, settings.rod_hysteresis_pa)).flatten()
}

/// How the strings differ from those of the model.
fn string_sizes(real: &Scene, settings: &PlantSettings) -> StringSizes {
    let by_length = real.string.radius_law == RadiusLaw::LengthRatio;
    StringSizes {
        play_rad: settings.twist_play_rad,
        bedding: settings.string_bedding,
        creep: settings.string_creep,
        exponent_shift: if by_length { settings.twist_exponent_shift } else { 0.0 },
    }
}

/// The widest surface that the mechanism allows, by the cheapest model that the scene allows: rods at their strain
/// limit end it early in some scenes, and a cheaper model may not reach beyond the envelope.
fn surface_for(mechanism: &Mechanism, scene: &Scene, load_n: f64) -> Result<(Surface, Tier), RigError> {
    let envelope_n = scene.envelope.map_or(0.0, |envelope| envelope.load_n[1]);
    let mut most_n = SURFACE_LOAD_N.max(2.5 * load_n).max(2.5 * envelope_n);
    let tier = cheapest_tier(mechanism, scene);
    if tier != Tier::Full
        && let Ok(surface) = Surface::new(&Tiered { mechanism, tier }, most_n)
    {
        return Ok((surface, tier));
    }
    let surface = loop {
        match Surface::new(mechanism, most_n) {
            Ok(surface) => break surface,
            Err(error) if most_n < 2.0 * SLACK_LOAD_N => return Err(error.into()),
            Err(_) => most_n *= 0.85,
        }
    };
    if load_n > most_n {
        return Err(RigError::Load { load_n, most_n });
    }
    Ok((surface, Tier::Full))
}

#[cfg(test)]
mod tests;
