//! An RMDS-405 as crates/rmds405/README.md describes it: strict about order and waiting times. It carries out its last
//! command until the next one, because it has no command time-out (crates/rmds405/README.md 2.6).
//!
//! Assumed, because no manual says it:
//! - it boots for 500 ms after power-up and reset alike, and ignores all frames meanwhile; but after power-up it acknowledges
//!   frames from 200 ms on, and a Reset that is then still being sent starts it once more;
//! - the position counts from the moment of the reset, and a reset clears the feedback periods;
//! - a mode or data frame in the wrong state makes it beep and send nothing;
//! - stall is current at its limit without motion for 1 s; it drops the torque and lasts until a reset;
//! - the errors of its current reading are those of its reports: its own regulator and stall detection have an exact
//!   current, so that noise is no stall;
//! - answers take 0.2 ms;
//! - its CAN controller still acknowledges frames when the serial line is the transport in use. The first frame after
//!   power-up or reset decides which transport that is (V-FAQ p24);
//! - the gains of the loops are those of a well-tuned drive.

use std::f64::consts::TAU;

use rmds405::report::{MixedRest, STALL};
use rmds405::serial::Decoder;
use rmds405::{Address, Command, Frame, Milliamps, Mixed, Mode, Pwm, QuadCounts, Received, Report, Rpm, Transport};

use super::encoder::counts_per_turn;
use super::motor::Bridge;
use crate::PlantSettings;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rig_config::RigConfig;

/// Period of the internal loops, s: also the window of the speed measurement (V-FAQ p3).
pub const TICK_S: f64 = 1e-3;
/// Power-up or reset to ready, s (crates/rmds405/README.md 2.5).
pub const BOOT_S: f64 = 0.5;
/// Power-up to the first acknowledged frame, s: its CAN controller starts before its loops. Assumed.
pub const ACKNOWLEDGES_S: f64 = 0.2;
/// Mode to ready for data, s (crates/rmds405/README.md 2.5).
pub const MODE_S: f64 = 0.5;
/// A frame to its answer, s. Assumed.
pub const LATENCY_S: f64 = 2e-4;
/// Between error reports, s (V-CAN p21).
pub const ERROR_PERIOD_S: f64 = 0.1;
/// Current (or voltage) at its limit without motion for this long is a stall, s. Assumed.
pub const STALL_S: f64 = 1.0;
/// Maximum that its analog input measures, V (V-CAN p20: 5 V reads 5000). Assumed to be its range.
const ASIN_V: f64 = 5.0;
/// Below this supply the drive is off, V (V-FAQ p1).
pub const MIN_SUPPLY_V: f64 = 10.0;

/// Crossover of the velocity loop, rad/s. Assumed.
pub const VELOCITY_LOOP_RAD_PER_S: f64 = 150.0;
/// Gain of the position loop, 1/s. Assumed.
pub const POSITION_LOOP_PER_S: f64 = 20.0;
/// Counts by which the position may change in a tick and the motor still counts as standing.
const STANDING_COUNTS: i64 = 1;

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Off,
    /// Until then; it acknowledges frames from the second time on, and then takes a Reset.
    Booting {
        until_s: f64,
        acknowledges_s: f64,
    },
    Unmoded,
    Moded {
        mode: Mode,
        ready_s: f64,
    },
}

/// Counts of frames by what became of them, and of restarts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveCounters {
    /// Frames for another drive, malformed, or on the transport that is not in use.
    pub ignored: u64,
    /// Frames that did not fit the state: the drive "reports an error" (V-CAN p7-16), which here is a beep.
    pub error_beeps: u64,
    /// Restarts, by power, command or brown-out.
    pub restarts: u64,
}

/// The drive.
#[derive(Clone, Debug)]
pub struct Drive {
    address: Address,
    counts_per_turn: f64,
    velocity_gain: f64,
    supply_divider: Option<f64>,
    state: State,
    zero_counts: i64,
    last_counts: i64,
    moved: i64,
    periods_ms: [u8; 2],
    elapsed_ms: [u32; 2],
    command: Option<Command>,
    integral_a: f64,
    pwm: i16,
    standing_s: f64,
    stalled: bool,
    since_error_s: f64,
    transport: Option<Transport>,
    line: Decoder<Command>,
    sent: Vec<(f64, Frame)>,
    /// Statistics.
    pub counters: DriveCounters,
}

/// What the drive measures in a tick.
#[derive(Clone, Copy, Debug)]
pub struct Sensed {
    /// Encoder counts, from any origin.
    pub counts: i64,
    /// Winding current, A, which the drive's own regulator and stall detection see.
    pub current_a: f64,
    /// The current that it reports, A.
    pub reported_current_a: f64,
    /// Supply voltage, V.
    pub supply_v: f64,
    /// Voltage on the motor's leads, V.
    pub bridge_v: f64,
    /// The bridge had no more voltage to give.
    pub saturated: bool,
}

impl Drive {
    /// Without power.
    pub fn new(parameters: &RigConfig, address: Address) -> Self {
        let kt = parameters.motor_torque_constant_nm_per_a;
        Self {
            address,
            counts_per_turn: f64::from(counts_per_turn(parameters)),
            velocity_gain: VELOCITY_LOOP_RAD_PER_S * parameters.rotor_inertia_kg_m2 / kt,
            supply_divider: parameters.supply_divider,
            state: State::Off,
            zero_counts: 0,
            last_counts: 0,
            moved: 0,
            periods_ms: [0; 2],
            elapsed_ms: [0; 2],
            command: None,
            integral_a: 0.0,
            pwm: 0,
            standing_s: 0.0,
            stalled: false,
            since_error_s: 0.0,
            transport: None,
            line: Decoder::commands(),
            sent: Vec::new(),
            counters: DriveCounters::default(),
        }
    }

    /// Switches the supply. Without power everything is lost.
    pub fn set_power(&mut self, on: bool, now_s: f64, counts: i64) {
        match (on, self.state) {
            (true, State::Off) => {
                self.restart(now_s, counts);
                self.state = State::Booting { until_s: now_s + BOOT_S, acknowledges_s: now_s + ACKNOWLEDGES_S };
            }
            (false, _) => {
                self.forget(counts);
                self.state = State::Off;
            }
            (true, _) => {}
        }
    }

    /// Starts over, as on Reset or a brown-out.
    pub fn restart(&mut self, now_s: f64, counts: i64) {
        self.forget(counts);
        self.state = State::Booting { until_s: now_s + BOOT_S, acknowledges_s: now_s };
        self.counters.restarts += 1;
    }

    fn forget(&mut self, counts: i64) {
        self.zero_counts = counts;
        self.periods_ms = [0; 2];
        self.elapsed_ms = [0; 2];
        self.command = None;
        self.integral_a = 0.0;
        self.pwm = 0;
        self.standing_s = 0.0;
        self.stalled = false;
        self.transport = None;
        self.line = Decoder::commands();
        self.sent.clear();
    }

    /// Whether it has power.
    pub fn is_powered(&self) -> bool {
        self.state != State::Off
    }

    /// Whether it acknowledges frames on the bus.
    pub fn acknowledges(&self, now_s: f64) -> bool {
        match self.state {
            State::Off => false,
            State::Booting { acknowledges_s, .. } => now_s >= acknowledges_s,
            State::Unmoded | State::Moded { .. } => true,
        }
    }

    /// The mode, once chosen.
    pub fn mode(&self) -> Option<Mode> {
        match self.state {
            State::Moded { mode, .. } => Some(mode),
            _ => None,
        }
    }

    /// Whether stall protection holds the motor without torque.
    pub fn is_stalled(&self) -> bool {
        self.stalled
    }

    /// Goes into stall protection at once.
    pub fn stall(&mut self) {
        if matches!(self.state, State::Moded { .. }) {
            self.stalled = true;
            self.since_error_s = ERROR_PERIOD_S;
        }
    }

    /// A frame from the bus.
    pub fn receive(&mut self, now_s: f64, received: &Received<'_>, counts: i64) {
        match Command::decode(self.address, received) {
            Ok(command) => self.obey(now_s, Transport::Can, command, counts),
            Err(_) => self.counters.ignored += 1,
        }
    }

    /// A byte from the serial line.
    pub fn receive_byte(&mut self, now_s: f64, byte: u8, counts: i64) {
        if let Some(command) = self.line.push((now_s * 1e6) as u64, byte) {
            self.obey(now_s, Transport::Uart, command, counts);
        }
    }

    fn obey(&mut self, now_s: f64, transport: Transport, command: Command, counts: i64) {
        self.wake(now_s);
        let late_reset = matches!(self.state, State::Booting { until_s, acknowledges_s }
            if command == Command::Reset && acknowledges_s > until_s - BOOT_S);
        if matches!(self.state, State::Off | State::Booting { .. }) && !late_reset {
            return;
        }
        if *self.transport.get_or_insert(transport) != transport {
            self.counters.ignored += 1;
            return;
        }
        match command {
            Command::Reset => self.restart(now_s, counts),
            Command::OnlineCheck => self.send(now_s + LATENCY_S, &Report::Online),
            Command::Config { motion_ms, mixed_ms } => {
                self.periods_ms = [motion_ms, mixed_ms];
                self.elapsed_ms = [0; 2];
            }
            // Nothing is wired to its outputs.
            Command::Outputs { .. } => {}
            Command::ChooseMode(mode) => match self.state {
                State::Unmoded => self.state = State::Moded { mode, ready_s: now_s + MODE_S },
                _ => self.counters.error_beeps += 1,
            },
            data => self.receive_data(now_s, data),
        }
    }

    fn receive_data(&mut self, now_s: f64, data: Command) {
        match self.state {
            State::Moded { mode, ready_s } if mode.data_function() == data.function() => {
                // Earlier it is not listening yet.
                if now_s >= ready_s {
                    self.command = Some(data);
                }
            }
            _ => self.counters.error_beeps += 1,
        }
    }

    fn wake(&mut self, now_s: f64) {
        if let State::Booting { until_s, .. } = self.state
            && now_s >= until_s
        {
            self.state = State::Unmoded;
        }
    }

    /// One run of the internal loops.
    pub fn tick(&mut self, now_s: f64, sensed: Sensed) -> Bridge {
        self.moved = sensed.counts - self.last_counts;
        self.last_counts = sensed.counts;
        self.wake(now_s);
        let State::Moded { ready_s, .. } = self.state else { return Bridge::Open };
        let bridge = match self.command {
            Some(command) if !self.stalled => self.control(&command, sensed),
            // The PWM limit is 0 until the first data (V-FAQ p20); that the motor then coasts is assumed.
            _ => Bridge::Open,
        };
        let full = f64::from(Pwm::MAX.get());
        self.pwm = (sensed.bridge_v / sensed.supply_v * full).clamp(-full, full) as i16;
        if now_s >= ready_s {
            self.report(now_s, sensed);
        }
        bridge
    }

    fn control(&mut self, command: &Command, sensed: Sensed) -> Bridge {
        let supply = sensed.supply_v;
        let volts = |pwm: i16| f64::from(pwm) / f64::from(Pwm::MAX.get()) * supply;
        let amps = |milliamps: i16| f64::from(milliamps) * 1e-3;
        let rad_per_s = |rpm: i16| f64::from(rpm) * TAU / 60.0;
        let toward = |position: QuadCounts| {
            let error = i64::from(position.0) - i64::from(self.position().0);
            POSITION_LOOP_PER_S * error as f64 * TAU / self.counts_per_turn
        };
        let at_most = |speed: f64, limit: f64| speed.clamp(-limit, limit);
        const UNBOUND: f64 = f64::INFINITY;
        let (speed, max_amps, max_volts) = match *command {
            Command::OpenLoop { pwm } => return Bridge::Voltage(volts(pwm.get())),
            Command::Current { pwm_limit, current } => {
                return Bridge::Current { amps: amps(current.0), max_volts: volts(pwm_limit.get()) };
            }
            Command::Velocity { pwm_limit, speed } => (rad_per_s(speed.0), UNBOUND, volts(pwm_limit.get())),
            Command::Position { pwm_limit, position } => (toward(position), UNBOUND, volts(pwm_limit.get())),
            Command::VelocityPosition { pwm_limit, speed_limit, position } => {
                (at_most(toward(position), rad_per_s(speed_limit.get())), UNBOUND, volts(pwm_limit.get()))
            }
            Command::CurrentVelocity { current_limit, speed } => {
                (rad_per_s(speed.0), amps(current_limit.get()), supply)
            }
            Command::CurrentPosition { current_limit, position } => {
                (toward(position), amps(current_limit.get()), supply)
            }
            Command::CurrentVelocityPosition { current_limit, speed_limit, position } => {
                (at_most(toward(position), rad_per_s(speed_limit.get())), amps(current_limit.get()), supply)
            }
            _ => return Bridge::Open,
        };
        let error = speed - self.moved as f64 * TAU / self.counts_per_turn / TICK_S;
        let proportional = self.velocity_gain * error;
        let step = self.velocity_gain * VELOCITY_LOOP_RAD_PER_S / 4.0 * TICK_S * error;
        let wanted = proportional + self.integral_a + step;
        let saturated = sensed.saturated || wanted.abs() > max_amps;
        let at_limit = sensed.saturated || sensed.current_a.abs() >= 0.95 * max_amps;
        // The integral does not grow while it can have no effect, but may always shrink.
        if !saturated || step * self.integral_a < 0.0 {
            self.integral_a += step;
        }
        self.integral_a = self.integral_a.clamp(-max_amps, max_amps);
        let amps = wanted.clamp(-max_amps, max_amps);
        let standing = self.moved.abs() <= STANDING_COUNTS;
        self.standing_s = if at_limit && standing && speed != 0.0 { self.standing_s + TICK_S } else { 0.0 };
        if self.standing_s >= STALL_S {
            self.stall();
            return Bridge::Open;
        }
        Bridge::Current { amps, max_volts }
    }

    fn report(&mut self, now_s: f64, sensed: Sensed) {
        let position = self.position();
        let milliamps =
            (sensed.reported_current_a * 1e3).round().clamp(f64::from(i16::MIN), f64::from(i16::MAX)) as i16;
        let rpm = (self.moved as f64 * 60_000.0 / self.counts_per_turn).round();
        let rpm = rpm.clamp(f64::from(i16::MIN), f64::from(i16::MAX)) as i16;
        let motion = Report::Motion { current: Milliamps(milliamps), speed: Rpm(rpm), position };
        // The other inputs float: CHZ then reads high, the others low.
        let pwm = Pwm::new(self.pwm).unwrap_or_default();
        let asin_mv =
            self.supply_divider.map_or(0.0, |divider| (sensed.supply_v / divider).min(ASIN_V) * 1e3).round() as u16;
        let rest = MixedRest { dsin: false, asin_mv, chz: true, pwm };
        let mixed = Report::Mixed(Mixed { ctl1: false, ctl2: false, rest: Some(rest) });
        for (slot, report) in [motion, mixed].iter().enumerate() {
            self.elapsed_ms[slot] += 1;
            let period = u32::from(self.periods_ms[slot]);
            if period > 0 && self.elapsed_ms[slot] >= period {
                self.elapsed_ms[slot] = 0;
                self.send(now_s + LATENCY_S, report);
            }
        }
        if self.stalled {
            self.since_error_s += TICK_S;
            if self.since_error_s >= ERROR_PERIOD_S {
                self.since_error_s = 0.0;
                self.send(now_s + LATENCY_S, &Report::Error(STALL));
            }
        }
    }

    /// The position as the wire carries it: it wraps at 32 bits.
    fn position(&self) -> QuadCounts {
        QuadCounts((self.last_counts - self.zero_counts) as i32)
    }

    fn send(&mut self, at_s: f64, report: &Report) {
        self.sent.push((at_s, report.encode(self.address)));
    }

    /// The transport in use, once it has received a frame.
    pub fn transport(&self) -> Option<Transport> {
        self.transport
    }

    /// Frames to send on its transport, each with its time. In order of time.
    pub fn take_sent(&mut self) -> Vec<(f64, Frame)> {
        std::mem::take(&mut self.sent)
    }
}

/// What the drive reports of a motor current, A: q round((I + offset + noise) / q). Draws one number of the noise, whatever
/// its size.
pub fn read_current(current_a: f64, settings: &PlantSettings, noise: &mut Pcg64Mcg) -> f64 {
    let normal: f64 = StandardNormal.sample(noise);
    let shown_a = current_a + settings.current_offset_a + settings.current_noise_a * normal;
    let quantum_a = settings.current_quantum_a;
    if quantum_a > 0.0 { quantum_a * (shown_a / quantum_a).round() } else { shown_a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_pcg::rand_core::SeedableRng;

    #[test]
    fn the_readings_lie_on_the_quantum_about_the_offset() {
        let settings = PlantSettings {
            current_offset_a: 5e-3,
            current_noise_a: 10e-3,
            current_quantum_a: 10e-3,
            ..PlantSettings::default()
        };
        let mut noise = Pcg64Mcg::seed_from_u64(1);
        let readings: Vec<f64> = (0..20_000).map(|_| read_current(0.0123, &settings, &mut noise)).collect();
        assert!(readings.iter().all(|r| ((r / 10e-3).round() - r / 10e-3).abs() < 1e-9));
        let mean = readings.iter().sum::<f64>() / readings.len() as f64;
        let rms = (readings.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / readings.len() as f64).sqrt();
        assert!((mean - 0.0173).abs() < 3e-4, "{mean}");
        // Sheppard: the quantum adds q²/12.
        assert!((rms - (1e-4f64 + 1e-4 / 12.0).sqrt()).abs() < 3e-4, "{rms}");
    }

    #[test]
    fn an_exact_reading_is_the_current_and_draws_the_same_numbers() {
        let (mut one, mut other) = (Pcg64Mcg::seed_from_u64(1), Pcg64Mcg::seed_from_u64(1));
        assert_eq!(read_current(0.123, &PlantSettings::default(), &mut one), 0.123);
        read_current(0.123, &PlantSettings { current_noise_a: 1.0, ..PlantSettings::default() }, &mut other);
        assert_eq!(one, other);
    }
}
