//! The whole rig of the control code on a load that hangs by the default scene's table: no chip, and a drive that follows its
//! target. All of it is known exactly, so that what the control code finds out can be compared.

use crate::fixture::{constants, table};
use rig_control::{
    Controller, DriveCommand, DriveReading, Inputs, LvdtBlock, Outputs, RigConstants, SupplyReading, TICK_US,
};
use rig_link::messages::{
    Accepted, Counters, EventKind, Fault, HomingResult, LoadChoice, Refusal, Request, Sensors, State, Telemetry,
};
use std::f32::consts::{PI, TAU};
use std::sync::{Arc, OnceLock};

/// Steps of the load's motion in a tick, and their length (s).
const STEPS: u8 = 20;
const STEP_S: f32 = 1e-6 * TICK_US as f32 / STEPS as f32;
/// The step after which the gap is what the LVDT's newest block shows, and the age of that block's end (µs): with the block's
/// own delay of 3.8 ms it is 6 ms in all, which are 12 steps.
const SEEN_STEP: u8 = 8;
const BLOCK_AGE_US: u64 = 2200;
/// Twist (rad) below which the gap is a parabola.
const PARABOLA_RAD: f32 = 0.5;
const GRAVITY_M_PER_S2: f32 = 9.806_65;
/// Damping of the load's motion on its rail (N s/m).
const DAMPING_N_S_PER_M: f32 = 1.0;
/// Ticks that a start of the drive takes.
const START_TICKS: u8 = 5;

/// Speed of the shaft (rad/s) in open loop, for each 1/5000 of the supply.
const RAD_PER_S_PER_PWM: f32 = 1.7 / 500.0;

/// What the drive counts where it is started.
const DRIVE_COUNTS: i64 = 3000;

/// The drive.
#[derive(Clone, Copy, Debug)]
enum Drive {
    /// Not started yet, or let go: the strings are held by nothing but the gear's friction, which is enough here.
    Off,
    Starting(u8),
    /// Counts from where it was started.
    On {
        origin: i64,
    },
}

/// A move to a position (m) at a speed (m/s) at most.
pub const fn to(target_m: f32, speed_m_per_s: f32) -> Request {
    Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto }
}

/// Changes what the control code sees.
pub type Tamper = Arc<dyn Fn(&mut Inputs) + Send + Sync>;

/// A rig that is made of numbers.
#[derive(Clone)]
pub struct Bench {
    pub rig: Controller,
    pub constants: RigConstants,
    /// Weight of the load and friction of the rail (N).
    pub load_n: f32,
    pub friction_n: f32,
    /// What it takes more to break the load loose (N).
    pub stiction_n: f32,
    /// Twist that counts in the table for each of the strings' own.
    pub twist_scale: f32,
    /// What the LVDT shows too much (m).
    pub offset_m: f32,
    /// Noise of a tick's gap (m, rms).
    pub noise_m: f32,
    /// Time constant of the drive's own position loop (s).
    pub drive_lag_s: f32,
    /// Current of the motor's friction (A).
    pub friction_a: f32,
    /// Twist (rad) at which the strings are closed: the motor cannot turn them further.
    pub closed_at_rad: f32,
    /// Gap that the mechanism has, and its speed (m, m/s).
    pub gap_m: f32,
    pub gap_speed_m_per_s: f32,
    /// True twist (rad).
    pub twist_rad: f32,
    pub now_us: u64,
    pub host_alive: bool,
    pub tamper: Option<Tamper>,
    pub events: Vec<EventKind>,
    pub telemetry: Option<Telemetry>,
    pub sensors: Option<Sensors>,
    pub command: DriveCommand,
    boot_twist_rad: f32,
    pub pull_n: f32,
    measured_gap_m: f32,
    drive: Drive,
    pub speed_rad_per_s: f32,
    heard_us: u64,
    random: u32,
    unrounded_ma: f32,
    /// What a blocked motor draws (mA); 0 for one that turns.
    blocked_ma: f32,
}

impl Bench {
    /// A load (N) on a rail with a friction (N), switched on with the strings at a twist (rad).
    pub fn new(load_n: f32, friction_n: f32, twist_rad: f32) -> Self {
        Self::of(constants(), load_n, friction_n, twist_rad)
    }

    /// The same on a rig with other constants.
    pub fn of(constants: RigConstants, load_n: f32, friction_n: f32, twist_rad: f32) -> Self {
        let mut bench = Self {
            rig: Controller::new(table(), constants, None),
            constants,
            load_n,
            friction_n,
            stiction_n: 0.0,
            twist_scale: 1.0,
            offset_m: 0.0,
            noise_m: 5e-6,
            drive_lag_s: 0.0,
            friction_a: 0.0,
            closed_at_rad: f32::INFINITY,
            gap_m: 0.0,
            gap_speed_m_per_s: 0.0,
            twist_rad,
            now_us: 0,
            host_alive: true,
            tamper: None,
            events: Vec::new(),
            telemetry: None,
            sensors: None,
            command: DriveCommand::Silence,
            boot_twist_rad: twist_rad,
            pull_n: load_n,
            measured_gap_m: 0.0,
            drive: Drive::Off,
            speed_rad_per_s: 0.0,
            heard_us: 0,
            random: 1,
            unrounded_ma: 0.0,
            blocked_ma: 0.0,
        };
        bench.settle();
        bench
    }

    /// Lets the load hang still where its weight is.
    pub fn settle(&mut self) {
        self.gap_m = self.gap_at(self.load_n, self.twist_rad)[0];
        (self.pull_n, self.gap_speed_m_per_s) = (self.load_n, 0.0);
        self.measured_gap_m = self.gap_m;
    }

    /// Gap (m) of strings that pull so much (N) at a twist (rad), and what it grows by for each newton and each radian. The gap
    /// is even in the twist. It follows the table's law below the table's least twist as well, and near zero a parabola.
    pub fn gap_at(&self, pull_n: f32, twist_rad: f32) -> [f32; 3] {
        let mut table = *table();
        table.metadata.twist_min_rad = PARABOLA_RAD;
        let m = &table.metadata;
        let scaled_rad = self.twist_scale * twist_rad.abs();
        let inside_n = pull_n.clamp(m.load_min_n, m.load_max_n);
        let inside_rad = scaled_rad.clamp(PARABOLA_RAD, m.twist_max_rad);
        let point = table.point_inside(inside_n, inside_rad);
        let mut gap_m = point.gap_m + (pull_n - inside_n) * point.dgap_dload_m_per_n;
        let mut by_twist = point.dgap_dtwist_m_per_rad;
        if scaled_rad < PARABOLA_RAD {
            gap_m += by_twist * (scaled_rad * scaled_rad / PARABOLA_RAD - PARABOLA_RAD) / 2.0;
            by_twist *= scaled_rad / PARABOLA_RAD;
        }
        [gap_m, point.dgap_dload_m_per_n, by_twist * self.twist_scale * twist_rad.signum()]
    }

    /// Pull (N) of the strings at the present gap.
    fn pull_at(&self, twist_rad: f32) -> f32 {
        (0..2).fold(self.pull_n, |pull_n, _| {
            let [gap_m, by_load, _] = self.gap_at(pull_n, twist_rad);
            pull_n + (self.gap_m - gap_m) / by_load
        })
    }

    /// One step of the load at a twist (rad): m G'' = W − S − friction − damping.
    fn oscillation(&mut self, twist_rad: f32) {
        self.pull_n = self.pull_at(twist_rad);
        let mass_kg = self.load_n / GRAVITY_M_PER_S2;
        let push_n = self.load_n - self.pull_n - DAMPING_N_S_PER_M * self.gap_speed_m_per_s;
        let speed = self.gap_speed_m_per_s;
        if speed == 0.0 && push_n.abs() <= self.friction_n + self.stiction_n {
            return;
        }
        let direction = if speed == 0.0 { push_n.signum() } else { speed.signum() };
        let next = speed + STEP_S / mass_kg * (push_n - direction * self.friction_n);
        self.gap_speed_m_per_s = if next * direction < 0.0 { 0.0 } else { next };
        self.gap_m += STEP_S * self.gap_speed_m_per_s;
    }

    /// A number that is evenly distributed about 0, with a standard deviation of 1: a linear congruential generator's.
    fn noise(&mut self) -> f32 {
        self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        12f32.sqrt() * (self.random as f32 / u32::MAX as f32 - 0.5)
    }

    /// Counts of the own encoder since it was switched on.
    fn counts(&self) -> i64 {
        ((self.twist_rad - self.boot_twist_rad) * self.constants.counts_per_rad).round() as i64
    }

    /// Turns the strings as the last command says, while the load oscillates.
    fn turn(&mut self) {
        let tick_s = 1e-6 * TICK_US as f32;
        let mut turned_rad = 0.0;
        if let (Drive::On { origin }, DriveCommand::Follow { position_qc, speed_limit_rpm, .. }) =
            (self.drive, self.command)
        {
            let distance_rad = (origin + i64::from(position_qc) - self.counts()) as f32 / self.constants.counts_per_rad;
            let fraction = if self.drive_lag_s > 0.0 { 1.0 - (-tick_s / self.drive_lag_s).exp() } else { 1.0 };
            let max_rad = tick_s * f32::from(speed_limit_rpm) / 60.0 * TAU / self.constants.gear_ratio;
            turned_rad = (fraction * distance_rad).clamp(-max_rad, max_rad);
        }
        if let (Drive::On { .. }, DriveCommand::Voltage { pwm }) = (self.drive, self.command) {
            turned_rad = tick_s * f32::from(pwm) * RAD_PER_S_PER_PWM * self.constants.counts_per_rad.signum();
        }
        let before_rad = self.twist_rad;
        let free_rad = self.closed_at_rad - before_rad;
        self.blocked_ma = if turned_rad > free_rad { self.constants.current_limit_ma.into() } else { 0.0 };
        turned_rad = turned_rad.min(free_rad);
        for step in 1..=STEPS {
            self.oscillation(before_rad + turned_rad * f32::from(step) / f32::from(STEPS));
            if step == SEEN_STEP {
                self.measured_gap_m = self.gap_m;
            }
        }
        self.twist_rad = before_rad + turned_rad;
        self.speed_rad_per_s = turned_rad / tick_s;
    }

    fn reading(&mut self) -> DriveReading {
        match self.drive {
            Drive::Off => DriveReading::Released,
            Drive::Starting(_) => DriveReading::Starting,
            Drive::On { origin } => {
                let [_, _, by_twist] = self.gap_at(self.pull_n, self.twist_rad);
                let newton_metres = -self.pull_n * by_twist;
                let per_a = self.constants.motor_torque_constant_nm_per_a * self.constants.gear_ratio;
                let friction_a =
                    if self.speed_rad_per_s == 0.0 { 0.0 } else { self.friction_a * self.speed_rad_per_s.signum() };
                let sign = self.constants.counts_per_rad.signum();
                let rpm = self.speed_rad_per_s / TAU * 60.0 * self.constants.gear_ratio;
                // What rounding leaves is added to the next reading, so that the mean is exact.
                let exact_ma =
                    1e3 * sign * (newton_metres / per_a + friction_a) + sign * self.blocked_ma + self.unrounded_ma;
                self.unrounded_ma = exact_ma - exact_ma.round();
                DriveReading::Reports {
                    t_us: self.now_us,
                    position_qc: (self.counts() - origin) as i32,
                    speed_rpm: (sign * rpm).round() as i16,
                    current_ma: exact_ma.round() as i16,
                }
            }
        }
    }

    /// One tick, with what the host asks in it.
    pub fn tick(&mut self, request: Option<Request>) -> Outputs {
        self.now_us += TICK_US;
        self.turn();
        if self.host_alive {
            self.heard_us = self.now_us;
        }
        let gap_m = self.measured_gap_m + self.offset_m + self.noise_m * self.noise();
        let mean_code = self.constants.lvdt_mean_code(gap_m);
        let drive = self.reading();
        let motor_v = match drive {
            DriveReading::Reports { speed_rpm, current_ma, .. } => {
                f32::from(current_ma) * 1e-3 * self.constants.motor_resistance_ohm
                    + f32::from(speed_rpm) * (TAU / 60.0) * self.constants.motor_torque_constant_nm_per_a
            }
            _ => 0.0,
        };
        let mut inputs = Inputs {
            now_us: self.now_us,
            encoder_counts: self.counts(),
            lvdt: Some(LvdtBlock { t_us: self.now_us - BLOCK_AGE_US, mean_code, variance: 1.0 }),
            drive,
            drive_stalled: false,
            bus_off: false,
            supply: Some(SupplyReading { t_us: self.now_us, volts: Some(24.0), on_motor: motor_v / 24.0 }),
            upper_limit_open: false,
            lower_limit_open: false,
            estop_open: false,
            host_heard_us: Some(self.heard_us),
            request,
        };
        if let Some(tamper) = &self.tamper {
            tamper(&mut inputs);
        }
        let outputs = self.rig.step(&inputs);
        self.command = outputs.drive;
        self.drive = match (outputs.drive, self.drive) {
            (DriveCommand::Restart | DriveCommand::RestartOpenLoop, _) => Drive::Starting(START_TICKS),
            (DriveCommand::LetGo | DriveCommand::PowerOff, _) => Drive::Off,
            (_, Drive::Starting(0)) => Drive::On { origin: self.counts() - DRIVE_COUNTS },
            (_, Drive::Starting(left)) => Drive::Starting(left - 1),
            (_, drive) => drive,
        };
        self.events.extend(outputs.events.iter().copied());
        self.telemetry = Some(outputs.telemetry);
        self.sensors = Some(self.rig.sensors(&inputs, Counters::default()));
        outputs
    }

    /// The given number of ticks without a request.
    pub fn run(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| drop(self.tick(None)));
    }

    /// Ticks until the state is another one; how many.
    pub fn while_in(&mut self, state: State) -> u32 {
        (1..10_000)
            .find(|_| {
                self.tick(None);
                self.rig.state() != state
            })
            .expect("it goes on for ever")
    }

    /// What the host is answered.
    pub fn ask(&mut self, request: Request) -> Result<Accepted, Refusal> {
        self.tick(Some(request)).reply.expect("an answer")
    }

    /// Asks for a motion that begins at once.
    #[track_caller]
    pub fn begin(&mut self, request: Request) {
        assert_eq!(self.ask(request), Ok(Accepted::Started));
    }

    /// Ticks until a fault; how many, if it comes within a limit.
    pub fn ticks_until_fault(&mut self, max: u32) -> Option<(u32, Fault)> {
        (1..=max).find_map(|tick| {
            self.tick(None);
            self.rig.fault().map(|fault| (tick, fault))
        })
    }

    /// Starts up, and proves the directions.
    pub fn start(&mut self) {
        self.while_in(State::Boot);
        self.begin(Request::CheckDirection);
        self.while_in(State::Moving);
        assert_eq!(core::mem::take(&mut self.events), [EventKind::DirectionProven]);
    }

    /// Starts up and homes.
    pub fn home(&mut self) -> HomingResult {
        if self.rig.state() == State::Boot {
            self.while_in(State::Boot);
        }
        self.begin(Request::Home { load: LoadChoice::Auto });
        self.while_in(State::Homing);
        assert_eq!(self.rig.state(), State::Ready, "{:?} {:?}", self.rig.fault(), self.events);
        self.rig.homed().expect("homed").found
    }

    /// Moves to a position (m) at a speed (m/s) at most, until the move is over; the time that took (s).
    pub fn move_to(&mut self, target_m: f32, speed_m_per_s: f32) -> f32 {
        self.begin(to(target_m, speed_m_per_s));
        let ticks = self.while_in(State::Moving);
        assert_eq!(self.rig.state(), State::Holding, "{:?} {:?}", self.rig.fault(), self.events);
        0.01 * ticks as f32
    }

    /// Zero twist as the encoder counts (rad).
    pub fn zero_rad(&self) -> f32 {
        -self.boot_twist_rad
    }

    /// A homed rig with a load of 5 N and a friction of 0.01 N.
    pub fn homed() -> Self {
        static HOMED: OnceLock<Bench> = OnceLock::new();
        let new = || {
            let mut bench = Self::new(5.0, 0.01, 9.0);
            bench.home();
            bench
        };
        HOMED.get_or_init(new).clone()
    }

    /// Position of the load (m), with zero where it hung at the half-turn pre-twist after its way down.
    pub fn position_m(&self) -> f32 {
        self.gap_at(self.load_n - self.friction_n, PI)[0] - self.gap_m
    }

    /// The latest telemetry.
    pub fn shown(&self) -> &Telemetry {
        self.telemetry.as_ref().expect("after a tick")
    }
}
