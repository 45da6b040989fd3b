//! The rig around the microcontroller: a [`Board`](crate::board::Board) whose wires lead to a drive, a motor, an
//! encoder, an LVDT and the twisted string itself.
//!
//! - [`settings`] and [`parameters`]: what a test may change, what the scene says.
//! - [`transmission`] and [`surface`]: the mechanism's equilibria, exactly and fast.
//! - [`plant`], [`motor`], [`encoder`], [`lvdt`]: the parts that move and measure.
//! - [`drive`]: the RMDS-405 on the bus, or on the serial line.
//! - [`faults`]: what can be broken. [`truth`]: what really happens.
//! - `wires`: what the chip's pins are wired to.
//!
//! Time advances in fixed steps of 0.25 ms from power-up whoever asks, so that the same questions at the same times get
//! the same answers.

pub mod drive;
pub mod effects;
pub mod encoder;
pub mod faults;
pub mod lvdt;
pub mod motor;
pub mod outside;
pub mod parameters;
pub mod plant;
pub mod settings;
pub mod surface;
pub mod transmission;
pub mod truth;
mod wires;

use std::collections::VecDeque;

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use rig_scene::Scene;
use rmds405::Transport;
use tsa_model::{Mechanism, Tier};

use crate::board::Stimulus;
use drive::{Drive, LEAST_SUPPLY_V, Sensed};
use encoder::Encoder;
use faults::{Fault, NotHere};
use lvdt::Lvdt;
use motor::{Bridge, Motor};
use parameters::RigParameters;
use plant::{Plant, Rail};
use settings::{PlantSettings, SettingError};
use surface::{NoSurface, SLACK_LOAD_N, Surface};
use transmission::{Tiered, cheapest_tier};
use truth::Truth;

/// Time step, s.
pub const STEP_S: f64 = 2.5e-4;
/// Steps to a run of the drive's loops, 1 ms.
const STEPS_PER_TICK: u64 = 4;
/// Less than a CPU cycle: times that differ by it are the same.
const SAME_TIME_S: f64 = 2e-8;
/// Greatest load that the surface covers, unless the load or the scene asks for more, N.
const SURFACE_LOAD_N: f64 = 40.0;
/// Ticks between two looks at the full solver for the tension.
const TENSION_TICKS: u64 = 10;
/// Ticks between two bursts of link noise.
const NOISE_TICKS: u64 = 5;
/// USART of the host link (hardware.md 8).
const HOST_USART: u8 = 2;
/// E-stop sense, PB5: high is stop.
const ESTOP: (char, u8) = ('B', 5);
/// Lower and upper limit switch, PC7 and PA8: normally closed to ground, high is open.
const LIMIT_LOW: (char, u8) = ('C', 7);
const LIMIT_HIGH: (char, u8) = ('A', 8);
/// Acknowledge button, PC13: active low.
const BUTTON: (char, u8) = ('C', 13);
/// The limit switches open this far before the ends of the rail, m. Assumed.
const LIMIT_MARGIN_M: f64 = 2e-3;

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

/// How far past the last twist with an equilibrium the strings can be left, rad: what lies side by side still gives.
/// Ten turns under 0.1 kg. Let go, they fling the rotor to the other side.
const CLOSED_GIVE_RAD: f64 = 1.7;

/// Drive, motor, mechanism and sensors on the microcontroller's pins.
#[derive(Clone)]
pub struct Rig {
    parameters: RigParameters,
    settings: PlantSettings,
    mechanism: Mechanism,
    tier: Tier,
    noise: Pcg64Mcg,
    link_noise: Pcg64Mcg,
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
    noisy_link: bool,
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
        let boot_pretwist_gap_m = surface.gap(tsa_model::PRETWIST_RAD, settings.load_n).gap_m;
        let plant = Plant::new(surface, stops_m, twist_rad, settings.load_n);
        let play = 0.5 * settings.gear_backlash_rad;
        let boot_angle_rad = (twist_rad + play.copysign(twist_rad)) * parameters.gear_ratio;
        let encoder = Encoder::new(parameters.counts_per_turn);
        let boot_counts = encoder.counts(boot_angle_rad);
        let mut rig = Self {
            tier,
            lvdt: Lvdt::new(&parameters, &settings, plant.gap_m),
            motor: Motor::new(&parameters, boot_angle_rad),
            drive: Drive::new(&parameters),
            noise: Pcg64Mcg::seed_from_u64(seed),
            link_noise: Pcg64Mcg::seed_from_u64(!seed),
            bridge: Bridge::Open,
            relay_pin: false,
            relay_opens_s: 0.0,
            driven_rad: 0.0,
            estop: false,
            motor_open: false,
            limit_fault: false,
            silent: false,
            can_shorted: false,
            noisy_link: false,
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
        rig.set_pin(BUTTON, true);
        rig.look_at_pins();
        rig.look_at_power();
        Ok(rig)
    }

    /// Changes a plant key while the rig runs; keys that make another mechanism are refused by name.
    pub fn set_plant(&mut self, key: &str, value: &str) -> Result<(), SettingError> {
        self.settings.set_at_run_time(key, value)?;
        self.look_at_power();
        Ok(())
    }

    /// The plant as it is now.
    pub fn settings(&self) -> &PlantSettings {
        &self.settings
    }

    /// Switches a fault, if this rig can have it.
    ///
    /// # Errors
    /// [`NotHere`] for a fault of the bus where the scene's drive is on the serial line.
    pub fn try_fault(&mut self, fault: Fault, on: bool) -> Result<(), NotHere> {
        if fault == Fault::CanBusOff && self.parameters.transport == Transport::Uart {
            return Err(NotHere);
        }
        self.set_fault(fault, on);
        Ok(())
    }

    /// Switches a fault. Events (stall, reset, jump, break, slip) happen when switched on and cannot be taken back.
    pub fn set_fault(&mut self, fault: Fault, on: bool) {
        let angle_rad = self.motor.angle_rad;
        match fault {
            Fault::CanSilent => self.silent = on,
            Fault::CanBusOff => {
                if self.can_shorted && !on {
                    self.pending.push(Stimulus::CanQuiet);
                }
                self.can_shorted = on;
            }
            Fault::DriveStall if on => self.drive.stall(),
            Fault::DriveReset if on && self.drive.is_powered() => {
                self.drive.restart(self.now_s(), self.encoder.counts(angle_rad));
                self.bridge = Bridge::Open;
            }
            Fault::EncoderStuck => self.encoder.set_stuck(on, angle_rad),
            Fault::EncoderSlip => self.encoder.set_slipping(on, angle_rad),
            Fault::EncoderJump if on => self.encoder.jump(),
            Fault::LvdtOpen => self.lvdt.faults.open = on,
            Fault::LvdtShort => self.lvdt.faults.short = on,
            Fault::LvdtNoisy => self.lvdt.faults.noisy = on,
            Fault::LvdtFrozen => self.lvdt.faults.frozen = on,
            Fault::StringBreak if on => self.plant.break_string(),
            Fault::StringSlip if on => self.plant.slip(),
            Fault::Estop => self.estop = on,
            Fault::MotorOpen => self.motor_open = on,
            Fault::LimitSwitch => self.limit_fault = on,
            Fault::LinkNoise => self.noisy_link = on,
            Fault::DriveStall | Fault::DriveReset | Fault::EncoderJump | Fault::StringBreak | Fault::StringSlip => {}
        }
        self.look_at_pins();
    }

    /// The board's supply went off and on. The relay's coil has no current; a drive that loses its own supply later than
    /// that, or not at all, goes on with what it was told. String and load stay as they are.
    pub fn power_cycle(&mut self) {
        self.set_relay(false);
        self.host_bytes.clear();
        self.from_drive.clear();
        // The pins' levels have to be told anew.
        self.pins.clear();
        self.set_pin(BUTTON, true);
        self.look_at_pins();
    }

    /// Time of the state, s; a multiple of [`STEP_S`].
    pub fn now_s(&self) -> f64 {
        self.steps as f64 * STEP_S
    }

    /// The drive, to look at.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The load, to look at.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Bytes that the firmware sent on the host link since last asked.
    pub fn take_host_bytes(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.host_bytes)
    }

    /// Keeps a [`Truth`] every 1 ms from now on, for [`Rig::take_records`].
    pub fn record(&mut self) {
        self.record = true;
        self.look_at_tension();
    }

    /// What was recorded since last asked.
    pub fn take_records(&mut self) -> Vec<Truth> {
        std::mem::take(&mut self.records)
    }

    /// The model that the mechanism runs on: the cheapest that the scene needs.
    pub fn tier(&self) -> Tier {
        self.tier
    }

    /// What really happens now.
    pub fn truth(&self) -> Truth {
        let pull = self.plant.pull();
        Truth {
            t_s: self.now_s(),
            position_m: self.boot_pretwist_gap_m - self.plant.gap_m,
            gap_m: self.plant.gap_m,
            pretwist_gap_m: self.plant.surface().gap(tsa_model::PRETWIST_RAD, self.settings.load_n).gap_m,
            gap_speed_m_per_s: self.plant.speed_m_per_s,
            twist_rad: self.twist_rad(),
            load_n: self.settings.load_n,
            pull_n: pull.force_n,
            tension_n: pull.force_n * self.tension_share,
            string_torque_nm: self.plant.torque_nm(&self.rail()),
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

    fn rail(&self) -> Rail {
        Rail {
            weight_n: self.settings.load_n,
            friction_n: self.settings.friction_n,
            damping_n_s_per_m: self.settings.damping_n_s_per_m,
        }
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

    fn look_at_pins(&mut self) {
        let [upper, lower] = self.plant.stops_m;
        self.set_pin(ESTOP, self.estop);
        self.set_pin(LIMIT_LOW, self.plant.gap_m > lower - LIMIT_MARGIN_M);
        self.set_pin(LIMIT_HIGH, self.limit_fault || self.plant.gap_m < upper + LIMIT_MARGIN_M);
    }

    fn set_pin(&mut self, (port, pin): (char, u8), high: bool) {
        let known = self.pins.iter_mut().find(|(p, n, _)| (*p, *n) == (port, pin));
        match known {
            Some((_, _, level)) if *level == high => return,
            Some((_, _, level)) => *level = high,
            None => self.pins.push((port, pin, high)),
        }
        self.pending.push(Stimulus::Pin { port, pin, high });
    }

    fn look_at_tension(&mut self) {
        let force_n = self.plant.pull().force_n;
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
        let rail = self.rail();
        let bridge = match (self.estop, self.motor_open) {
            (true, _) => Bridge::Resistor(self.parameters.brake_ohm),
            (false, true) => Bridge::Open,
            (false, false) => self.bridge,
        };
        let torque_nm = self.plant.torque_nm(&rail) / self.parameters.gear_ratio;
        let before_rad = self.motor.angle_rad;
        self.motor.step(STEP_S, bridge, torque_nm);
        let on_the_bridge = matches!(bridge, Bridge::Voltage(_) | Bridge::Current { .. });
        if on_the_bridge && self.motor.current_a * self.motor.speed_rad_per_s > 0.0 {
            self.driven_rad += (self.motor.angle_rad - before_rad).abs() / self.parameters.gear_ratio;
        }
        let twist_rad = self.twist_rad();
        self.plant.step(STEP_S, twist_rad, &rail);
        self.lvdt.step(STEP_S, self.plant.gap_m);
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
            let sensed = Sensed {
                counts: self.encoder.counts(self.motor.angle_rad),
                current_a: if self.estop || self.motor_open { 0.0 } else { self.motor.current_a },
                supply_v: self.supply_v(),
                saturated: !self.estop && !self.motor_open && self.motor.saturated,
            };
            self.bridge = self.drive.tick(self.now_s(), sensed);
        }
        self.collect_reports();
        self.look_at_pins();
        if self.noisy_link && ticks.is_multiple_of(NOISE_TICKS) {
            let mut bytes = vec![0; 1 + (self.link_noise.next_u32() % 8) as usize];
            self.link_noise.fill_bytes(&mut bytes);
            self.pending.push(Stimulus::Uart { usart: HOST_USART, bytes });
        }
        // A third of the cost of a rig without the chip, so only for those who keep it.
        if self.record && ticks.is_multiple_of(TENSION_TICKS) {
            self.look_at_tension();
        }
        if self.record {
            self.records.push(self.truth());
        }
    }
}

/// The widest surface that the mechanism allows, by the cheapest model that the scene allows: rods at their strain limit
/// end it early in some scenes, and a cheaper model may not reach beyond the envelope.
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
