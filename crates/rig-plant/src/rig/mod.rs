//! The rig around the microcontroller: a [`Board`](crate::board::Board) whose wires lead to a drive, a motor, an
//! encoder, an LVDT and the twisted string itself.
//!
//! - [`plant`]: load and mechanism, [`built_in`] or from [`outside`]; [`surface`]: the mechanism's equilibria, fast.
//! - `hung`: a load hung from its mechanism at the start; [`errors`]: why there is no such rig.
//! - [`motor`], [`encoder`], [`lvdt`]: the parts that move and measure.
//! - [`rail`]: the drive's supply while the relay is open.
//! - [`effects`]: what real rigs have besides.
//! - [`drive`]: the RMDS-405 on the bus, or on the serial line.
//! - [`faults`]: what can be broken.
//! - `wires`: what the chip's pins are wired to.
//!
//! Time advances in fixed steps of 0.25 ms from power-up, whatever calls come in between, so that the same calls at the
//! same times give the same results.

pub mod built_in;
pub mod drive;
pub mod effects;
pub mod encoder;
pub mod errors;
pub mod faults;
mod hung;
pub mod lvdt;
pub mod motor;
pub mod outside;
pub mod plant;
pub mod rail;
pub mod surface;
mod wires;

use std::collections::VecDeque;

use crate::{PlantChange, PlantKey, PlantSettings, RigPreset, Truth};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use rig_config::{RigConfig, Scene};
use rmds405::Address;
use tsa_model::{Mechanism, Tier};

use crate::board::Stimulus;
use drive::{Drive, MIN_SUPPLY_V, Sensed, read_current};
use encoder::{Encoder, counts_per_turn};
pub use errors::{ChangeError, RigError};
use hung::{built_in, measured, rods_of, stops_of};
use lvdt::Lvdt;
use motor::{BRAKE_OHM, Bridge, Motor};
use outside::Outside;
use outside::program::ProgramError;
use outside::programmed::Programmed;
use plant::{Plant, PlantState};
use rail::Rail;

/// Time step, s.
pub const STEP_S: f64 = 2.5e-4;
/// Steps in a run of the drive's loops, 1 ms.
const STEPS_PER_TICK: u64 = 4;
/// Less than a CPU cycle: times that differ by it are the same.
const SAME_TIME_S: f64 = 2e-8;
/// Ticks between two solutions of the full model for the tension.
const TENSION_TICKS: u64 = 10;
/// What tells the seeds of further random numbers from the rig's own, so that none changes the noise of the samples.
const LVDT_SEED: u64 = 0x6c76_6474_0000_0000;
/// As [`LVDT_SEED`].
const CURRENT_SEED: u64 = 0x616d_7065_0000_0000;
/// USART of the host link (docs/reference/hardware.md 3).
pub const HOST_USART: u8 = 2;

/// Drive, motor, mechanism and sensors on the microcontroller's pins.
#[derive(Clone)]
pub struct EmulatedRig {
    /// What the scene says of its parts.
    parameters: RigConfig,
    settings: PlantSettings,
    /// The scene's mechanism; `None` where the plant is from outside.
    mechanism: Option<Mechanism>,
    tier: Tier,
    /// Ends of the rail, as gaps, m.
    stops_m: [f64; 2],
    noise: Pcg64Mcg,
    current_noise: Pcg64Mcg,
    plant: Plant,
    motor: Motor,
    encoder: Encoder,
    lvdt: Lvdt,
    drive: Drive,
    bridge: Bridge,
    rail: Rail,
    relay_pin: bool,
    /// When the relay's contact opens, s; it stays closed as long as its pin is high.
    relay_opens_s: f64,
    driven_rad: f64,
    estop: bool,
    motor_open: bool,
    motor_swapped: bool,
    limit_fault: bool,
    silent: bool,
    can_shorted: bool,
    steps: u64,
    boot_angle_rad: f64,
    boot_counts: i64,
    boot_pretwist_gap_m: Option<f64>,
    tension_fraction: f64,
    pins: Vec<(char, u8, bool)>,
    polled: bool,
    from_drive: VecDeque<(f64, Stimulus)>,
    pending: Vec<Stimulus>,
    host_bytes: Vec<u8>,
    record: bool,
    records: Vec<Truth>,
}

impl EmulatedRig {
    /// A rig at rest, drive without power. `seed` is that of all noise.
    ///
    /// # Errors
    /// [`RigError`] if the scene is no rig, or the mechanism cannot carry the load or have the twist.
    pub fn new(scene: &Scene, settings: PlantSettings, seed: u64) -> Result<Self, RigError> {
        let (plant, mechanism, tier) = built_in(scene, &settings)?;
        Self::around(scene, settings, seed, Plant::BuiltIn(Box::new(plant)), Some(mechanism), tier)
    }

    /// As [`EmulatedRig::new`] with a plant from outside in the place of the built-in one. The rig has the preset's keys and then
    /// the given ones; a plant from outside need not know those of the preset.
    ///
    /// # Errors
    /// As [`EmulatedRig::new`], and [`ChangeError`] for a program that fails and a given key that such a plant has not.
    pub fn from_outside(
        scene: &Scene,
        preset: RigPreset,
        given: &[PlantChange],
        seed: u64,
        outside: &Outside,
    ) -> Result<Self, RigError> {
        let mut settings = PlantSettings::preset(preset, seed);
        for change in given {
            settings.apply(*change).map_err(ChangeError::from)?;
        }
        let plant = match outside {
            Outside::Program(command) => {
                let load = PlantChange { key: PlantKey::Load, value: settings.load_n };
                let offered = [vec![load], preset.changes(seed)].concat();
                let twist_rad = settings.twist_at_boot_rad;
                let program = Programmed::start(command, twist_rad, seed, &offered, given);
                Plant::Program(Box::new(program.map_err(ChangeError::from)?))
            }
            Outside::Measured(data) => {
                if let Some(change) = given.iter().find(|change| change.key.is_of_the_law()) {
                    return Err(ChangeError::Measured(change.key).into());
                }
                Plant::BuiltIn(Box::new(measured(scene, data, &settings)?))
            }
        };
        Self::around(scene, settings, seed, plant, None, Tier::Full)
    }

    fn around(
        scene: &Scene,
        settings: PlantSettings,
        seed: u64,
        plant: Plant,
        mechanism: Option<Mechanism>,
        tier: Tier,
    ) -> Result<Self, RigError> {
        let parameters = scene.rig.clone();
        let address = Address::new(parameters.drive_group, parameters.drive_number)?;
        let stops_m = stops_of(&parameters);
        let twist_rad = settings.twist_at_boot_rad;
        let boot_pretwist_gap_m = plant.built_in().map(|_| plant.pretwist_gap_m());
        let play = 0.5 * settings.gear_backlash_rad;
        let boot_angle_rad = (twist_rad + play.copysign(twist_rad)) * parameters.gear();
        let encoder = Encoder::new(counts_per_turn(&parameters));
        let boot_counts = encoder.counts_at_mcu(boot_angle_rad);
        let mut rig = Self {
            tier,
            lvdt: Lvdt::new(&parameters, &settings, plant.gap_m(), seed ^ LVDT_SEED),
            motor: Motor::new(&parameters, settings.torque_constant_scale, boot_angle_rad),
            drive: Drive::new(&parameters, address),
            noise: Pcg64Mcg::seed_from_u64(seed),
            current_noise: Pcg64Mcg::seed_from_u64(seed ^ CURRENT_SEED),
            bridge: Bridge::Open,
            rail: Rail::at(0.0),
            relay_pin: false,
            relay_opens_s: 0.0,
            driven_rad: 0.0,
            estop: false,
            motor_open: false,
            motor_swapped: false,
            limit_fault: false,
            silent: false,
            can_shorted: false,
            steps: 0,
            tension_fraction: 0.5,
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
            stops_m,
            plant,
            encoder,
            boot_angle_rad,
            boot_counts,
            boot_pretwist_gap_m,
        };
        rig.look_at_tension();
        rig.drive_all_pins();
        rig.rail.step(0.0, rig.connected_v(), 0.0);
        rig.look_at_power();
        Ok(rig)
    }

    /// Changes the plant while the rig runs.
    ///
    /// # Errors
    /// [`ChangeError`] if the key makes another mechanism, no rig can have the value, or a plant from outside refuses it.
    pub fn change_plant(&mut self, change: PlantChange) -> Result<(), ChangeError> {
        match &mut self.plant {
            Plant::Program(program) if change.key.is_of_the_plant() => {
                change.check()?;
                program.set(change)?;
            }
            _ => change.check_running()?,
        }
        self.settings.apply(change)?;
        if let Plant::BuiltIn(plant) = &mut self.plant {
            plant.settings = self.settings.clone();
            if let (Some(mechanism), None) = (&self.mechanism, &plant.rods) {
                plant.rods = rods_of(mechanism, &self.settings, &plant.surface);
            }
        }
        self.look_at_power();
        Ok(())
    }

    /// Why the plant's program cannot go on.
    pub fn plant_failure(&self) -> Option<&ProgramError> {
        match &self.plant {
            Plant::Program(program) => program.failure(),
            Plant::BuiltIn(_) => None,
        }
    }

    /// Changes the plant while the rig runs, with a value as an operator types it.
    ///
    /// # Errors
    /// As [`EmulatedRig::change_plant`], and if key or value cannot be read.
    pub fn set_plant(&mut self, key: &str, value: &str) -> Result<(), ChangeError> {
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

    /// What the scene says of its parts.
    pub fn parameters(&self) -> &RigConfig {
        &self.parameters
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

    /// Keeps a [`Truth`] every 1 ms from now on, for [`EmulatedRig::take_records`].
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
        let PlantState { gap_m, speed_m_per_s, pull_n, torque_nm } = self.plant.state();
        let pretwist_gap_m = self.plant.pretwist_gap_m();
        Truth {
            t_s: self.now_s(),
            position_m: self.boot_pretwist_gap_m.unwrap_or(pretwist_gap_m) - gap_m,
            gap_m,
            pretwist_gap_m,
            gap_speed_m_per_s: speed_m_per_s,
            twist_rad: self.twist_rad(),
            load_n: self.settings.load_n,
            pull_n,
            string_tension_n: pull_n * self.tension_fraction,
            string_torque_nm: torque_nm,
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
        let geared = self.motor.angle_rad / self.parameters.gear();
        let play = 0.5 * self.settings.gear_backlash_rad;
        geared - geared.clamp(-play, play)
    }

    /// What the drive's encoder input counts now.
    fn drive_counts(&self) -> i64 {
        self.encoder.counts(self.motor.angle_rad, self.steps / STEPS_PER_TICK)
    }

    /// The drive's supply rail.
    pub fn rail(&self) -> &Rail {
        &self.rail
    }

    /// Voltage of the supply, where the relay connects it to the drive.
    fn connected_v(&self) -> Option<f64> {
        let closed = self.settings.relay_fitted < 0.5 || self.relay_pin || self.now_s() < self.relay_opens_s;
        closed.then(|| self.supply_v())
    }

    fn supply_v(&self) -> f64 {
        self.settings.supply_voltage_v.unwrap_or(self.parameters.supply_voltage_v)
    }

    fn set_relay(&mut self, high: bool) {
        if self.relay_pin && !high {
            self.relay_opens_s = self.now_s() + self.settings.relay_release_s;
        }
        self.relay_pin = high;
        if let Some(volts) = self.connected_v() {
            self.rail.step(0.0, Some(volts), 0.0);
        }
        self.look_at_power();
    }

    fn look_at_power(&mut self) {
        let on = self.rail.volts() >= MIN_SUPPLY_V && !self.rail.has_destroyed();
        self.drive.set_power(on, self.now_s(), self.drive_counts());
        if !on {
            self.bridge = Bridge::Open;
        }
    }

    fn look_at_tension(&mut self) {
        let force_n = self.plant.state().pull_n;
        // Of a plant from outside nobody knows the strings' angle: half the pull each.
        let solved = self.mechanism.as_ref().map(|mechanism| mechanism.solve(force_n, self.twist_rad()));
        if let Some(Ok(solved)) = solved {
            self.tension_fraction = solved.tension_n / force_n;
        }
    }

    fn advance(&mut self, t_s: f64) {
        while (self.steps + 1) as f64 * STEP_S <= t_s + SAME_TIME_S {
            self.step();
        }
    }

    fn step(&mut self) {
        let bridge = match (self.estop, self.motor_open) {
            (true, _) => Bridge::Resistor(BRAKE_OHM),
            (false, true) => Bridge::Open,
            (false, false) if self.motor_swapped => self.bridge.reversed(),
            (false, false) => self.bridge,
        };
        let torque_nm = self.plant.state().torque_nm / self.parameters.gear();
        let before_rad = self.motor.angle_rad;
        self.motor.step(STEP_S, bridge, torque_nm, &self.settings);
        let motor_w = if self.drive.is_powered() { self.motor.bridge_w } else { 0.0 };
        self.rail.step(STEP_S, self.connected_v(), motor_w);
        let on_the_bridge = matches!(bridge, Bridge::Voltage(_) | Bridge::Current { .. });
        if on_the_bridge && self.motor.current_a * self.motor.speed_rad_per_s > 0.0 {
            self.driven_rad += (self.motor.angle_rad - before_rad).abs() / self.parameters.gear();
        }
        let twist_rad = self.twist_rad();
        self.plant.step(STEP_S, twist_rad);
        self.steps += 1;
        self.lvdt.step(STEP_S, self.now_s(), self.plant.gap_m(), &self.settings);
        if self.steps.is_multiple_of(STEPS_PER_TICK) {
            self.tick();
        }
    }

    fn tick(&mut self) {
        let ticks = self.steps / STEPS_PER_TICK;
        self.look_at_power();
        if self.drive.is_powered() {
            // The e-stop takes the motor off the bridge, so the drive measures no current, and its regulator ends at full voltage.
            let sign = if self.motor_swapped { -1.0 } else { 1.0 };
            let off = self.estop || self.motor_open;
            let current_a = if off { 0.0 } else { sign * self.motor.current_a };
            let bridge_v = match self.bridge {
                Bridge::Current { amps, max_volts } if off => max_volts * amps.signum(),
                _ => sign * self.motor.bridge_v,
            };
            let sensed = Sensed {
                counts: self.drive_counts(),
                current_a,
                reported_current_a: read_current(current_a, &self.settings, &mut self.current_noise),
                supply_v: self.rail.volts(),
                bridge_v,
                saturated: !off && self.motor.saturated,
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

#[cfg(test)]
mod tests;
