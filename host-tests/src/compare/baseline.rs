//! What the firmware's control is held against: the usual ways to drive a twisted string, over the same drive frames
//! (mode 8, a position every 10 ms) on the same rig. They need no homing: they are given the true zero of the twist.

use super::program::Outside;
use crate::rigs::commission::Firmware;
use crate::rigs::subject::Subject;
use crate::{ControlBench, ControlLaw};
use core::f32::consts::PI;
use rig_control::ramp::Ramp;
use rig_control::sensors::Lvdt;
use rig_control::{DriveCommand, DriveReading, Inputs, LvdtReading, RigConstants, TICK_S, settings};
use tsa_table::Table;

/// Longest way to the reference (s).
const START_S: f64 = 30.0;

/// How far the shaft stays behind its set-point, in time (s): one over the gain of the drive's position loop. The
/// firmware measures it when homing; the baselines are given it.
const DRIVE_LAG_S: f32 = 0.05;
/// How far from its reported position the drive may be sent (rad, and seconds of its speed), as the firmware's.
const MAX_LAG: [f32; 2] = [1.0, 0.3];
/// Age of the averaged LVDT block (s), as the firmware's.
const MEASUREMENT_AGE_S: f32 = 0.006;
/// Error (m) below which a load at rest is left alone, as the firmware's.
const AT_REST_M: f32 = 6e-6;
/// How far below the half-turn pre-twist a loop may untwist (rad), as the firmware's.
const BELOW_PRETWIST: f32 = 0.15;
/// Speed of the strings in the paper's experiment, 12.5 rpm (its section 5.2), in rad/s.
pub const PAPER_SPEED: f32 = 12.5 / 60.0 * 2.0 * PI;

/// What it is told each tick: the very set-points that the firmware's planner made on the same plant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wanted {
    /// Where the load should be now (m).
    pub set_point_m: f32,
    /// How fast it should go (m/s).
    pub speed_m_per_s: f32,
    /// The set-point stands at the target.
    pub done: bool,
    /// Where the move ends (m).
    pub target_m: f32,
    /// Speed that the move was asked for (m/s).
    pub asked_m_per_s: f32,
    /// The true load (N).
    pub load_n: f32,
}

/// A loop on the LVDT: θ̇ = TR (v* + K e), as the firmware's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loop {
    /// The transmission ratio (rad/m), one for all loads and twists; `None` is the table's under the true load.
    pub tr_rad_per_m: Option<f32>,
    /// Gain K (1/s).
    pub gain_per_s: f32,
    /// Corner of the two poles that smooth the error (rad/s).
    pub corner_rad_per_s: f32,
    /// Twist (rad) that is turned at once where a move begins against the last one, to take up friction: one for all
    /// loads and twists.
    pub breakaway_rad: f32,
}

/// Fraction of the motor's speed and acceleration that the crossing may take, as the firmware's.
const BREAKAWAY_FRACTION: f32 = 0.7;

/// How the strings' twist is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Feedback from the LVDT.
    Loop(Loop),
    /// The twist at which the table has the wanted gap under the true load. The LVDT is not looked at.
    OpenLoop,
    /// Constant twist speed (rad/s) until the LVDT shows the target.
    ConstantSpeed(f32),
    /// The same at the speed that needs as long as the move was asked to take, by the table and the true load.
    MatchedSpeed,
    /// What a program says that was started with this command.
    Program(&'static str),
}

/// Those without anything to tune.
pub const OTHERS: [(&str, Law); 3] = [
    ("c  open loop by table", Law::OpenLoop),
    ("d  constant speed, matched", Law::MatchedSpeed),
    ("d' constant 12.5 rpm (paper)", Law::ConstantSpeed(PAPER_SPEED)),
];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Waits until the drive reports and the shaft stands.
    Boot { standing: u16 },
    /// To the half-turn pre-twist, then rest and average.
    Approach { rested: u16, sum_m: f32, count: u16 },
    /// Follows what is wanted.
    Ready,
}

/// Ticks that the shaft has to stand, rest at the pre-twist, and of those averaged over.
const STANDING: u16 = 20;
const RESTED: u16 = 140;
const AVERAGED: u16 = 40;
/// Motor speed (rpm) that counts as standing: three quanta of the drive's measurement.
const STANDING_RPM: u16 = 45;

/// The controller.
#[derive(Clone, Debug)]
pub struct Baseline {
    /// How the twist is chosen.
    pub law: Law,
    /// What it is told.
    pub wanted: Wanted,
    /// The program of [`Law::Program`].
    pub program: Option<Outside>,
    /// Position (m) that the LVDT shows, from the reference; `None` before that is taken.
    pub shown_m: Option<f32>,
    table: &'static Table<'static>,
    rig: RigConstants,
    lvdt: Lvdt,
    phase: Phase,
    zero_rad: f32,
    shaft: Ramp,
    drive_offset: i64,
    reference_gap_m: f32,
    smoothed: [f32; 2],
    /// Twist of the crossing so far and its end (rad).
    crossing: Ramp,
    breakaway_end_rad: f32,
    /// Sign of the last move's way; 0 before the first.
    way: f32,
    reference_load_n: f32,
    /// Where a constant speed goes (m), and the twist speed (rad/s); 0 once there.
    trajectory: Option<(f32, f32)>,
    /// The drive was told to start.
    started: bool,
}

impl Baseline {
    /// With the table, the constants and the settings of a firmware. Told that the strings had the half-turn pre-twist at power-up.
    fn new(firmware: &Firmware) -> Self {
        Self {
            law: Law::OpenLoop,
            wanted: Wanted::default(),
            program: None,
            shown_m: None,
            table: firmware.table,
            rig: settings::apply(&firmware.settings, &firmware.constants),
            lvdt: Lvdt::default(),
            phase: Phase::Boot { standing: 0 },
            zero_rad: -PI,
            shaft: Ramp::at(0.0),
            drive_offset: 0,
            reference_gap_m: 0.0,
            smoothed: [0.0; 2],
            crossing: Ramp::at(0.0),
            breakaway_end_rad: 0.0,
            way: 0.0,
            reference_load_n: 0.0,
            trajectory: None,
            started: false,
        }
    }

    fn boot(&mut self, standing: u16, offset: i64, speed_rpm: i16, shaft_rad: f32) {
        if standing == 0 {
            self.drive_offset = offset;
            self.shaft = Ramp::at(shaft_rad);
        }
        // A report is up to a tick old, so counts are compared when the shaft stands.
        let stands = speed_rpm.unsigned_abs() < STANDING_RPM;
        self.phase = if standing >= STANDING {
            self.drive_offset = offset;
            self.shaft = Ramp::at(shaft_rad);
            Phase::Approach { rested: 0, sum_m: 0.0, count: 0 }
        } else {
            Phase::Boot { standing: if stands { standing + 1 } else { 1 } }
        };
    }

    fn approach(&mut self, rested: u16, mut sum_m: f32, mut count: u16, gap_m: f32) {
        let goal = self.zero_rad + PI;
        self.shaft.step(goal, 6.0, 25.0);
        let rested = if self.shaft == Ramp::at(goal) { rested + 1 } else { 0 };
        if rested > RESTED - AVERAGED {
            sum_m += gap_m;
            count += 1;
        }
        self.phase = if rested >= RESTED {
            self.reference_gap_m = sum_m / f32::from(count);
            self.reference_load_n = self.wanted.load_n;
            Phase::Ready
        } else {
            Phase::Approach { rested, sum_m, count }
        };
    }

    fn closed_loop(&mut self, law: Loop, position_m: f32) -> f32 {
        let w = self.wanted;
        let error_m = w.set_point_m - MEASUREMENT_AGE_S * w.speed_m_per_s - position_m;
        let left_alone = w.done && error_m.abs() < AT_REST_M;
        let blend = law.corner_rad_per_s * TICK_S / (1.0 + law.corner_rad_per_s * TICK_S);
        self.smoothed[0] += blend * (if left_alone { 0.0 } else { error_m } - self.smoothed[0]);
        self.smoothed[1] += blend * (self.smoothed[0] - self.smoothed[1]);
        let twist_rad = self.shaft.position - self.zero_rad;
        let by_table = || self.table.point_inside(w.load_n, twist_rad).tr_rad_per_m();
        let tr = law.tr_rad_per_m.unwrap_or_else(by_table);
        tr * (w.speed_m_per_s + law.gain_per_s * self.smoothed[1]) + self.cross(law.breakaway_rad)
    }

    /// Twist speed (rad/s) of the crossing, which begins when the target changes sides: with the firmware's, before the
    /// set-point sets out.
    fn cross(&mut self, breakaway_rad: f32) -> f32 {
        let left_m = self.wanted.target_m - self.wanted.set_point_m;
        if left_m != 0.0 && left_m.signum() != self.way {
            // From rest at the reference the pull is in the middle of the band, not at its other end.
            let fraction = if self.way == 0.0 { 0.5 } else { 1.0 };
            self.way = left_m.signum();
            self.breakaway_end_rad += fraction * self.way * breakaway_rad;
        }
        let before_rad = self.crossing.position;
        let [speed, acceleration] =
            [self.rig.twist_speed_max(), self.rig.twist_limits().acceleration].map(|max| BREAKAWAY_FRACTION * max);
        self.crossing.step(self.breakaway_end_rad, speed, acceleration);
        (self.crossing.position - before_rad) / TICK_S
    }

    /// The twist at which the table has the load at a position (rad).
    fn twist_at(&self, position_m: f32) -> f32 {
        let m = &self.table.metadata;
        let load_n = self.wanted.load_n.clamp(m.load_min_n, m.load_max_n);
        let gap = |twist_rad: f32| self.table.point_inside(load_n, twist_rad).gap_m;
        let gap_m = self.reference_model_gap() - position_m;
        // Past an end of the table's twist its edge is the best that open loop can do.
        self.table
            .twist_from_gap(load_n, gap_m.clamp(gap(m.twist_max_rad), gap(m.twist_min_rad)))
            .unwrap_or(m.twist_min_rad)
    }

    /// Gap at the half-turn pre-twist under the load that the reference was taken with, by the table (m).
    fn reference_model_gap(&self) -> f32 {
        self.table.point_inside(self.reference_load_n, PI).gap_m
    }

    /// Constant speed towards each new target, until the LVDT shows it.
    fn constant_speed(&mut self, speed: Option<f32>, position_m: f32) -> f32 {
        let Wanted { target_m, asked_m_per_s, .. } = self.wanted;
        let speed = match self.trajectory {
            Some((at_m, speed)) if at_m == target_m => speed,
            _ => {
                let seconds = (target_m - position_m).abs().max(1e-6) / asked_m_per_s.max(1e-6);
                let turns = (self.twist_at(target_m) - self.twist_at(position_m)).abs();
                let speed = speed.unwrap_or(turns / seconds).min(self.rig.twist_speed_max());
                speed.copysign(target_m - position_m)
            }
        };
        let left_m = (target_m - position_m) * speed.signum();
        let speed = if left_m > 0.0 { speed } else { 0.0 };
        self.trajectory = Some((target_m, speed));
        speed
    }

    /// Set-point of the shaft for this tick.
    fn follow(&mut self, position_m: f32) {
        let fastest = self.rig.twist_speed_max();
        let wanted = match self.law {
            Law::Loop(law) => self.closed_loop(law, position_m),
            Law::OpenLoop => {
                let twist = self.zero_rad + self.twist_at(self.wanted.set_point_m);
                (twist - self.shaft.position) / TICK_S
            }
            Law::ConstantSpeed(speed) => self.constant_speed(Some(speed), position_m),
            Law::MatchedSpeed => self.constant_speed(None, position_m),
            Law::Program(_) => {
                let twist_rad = self.shaft.position - self.zero_rad;
                self.program.as_mut().map_or(0.0, |program| program.twist_speed(&self.wanted, position_m, twist_rad))
            }
        };
        let next = self.shaft.position + wanted.clamp(-fastest, fastest) * TICK_S;
        let [low, high] = [PI - BELOW_PRETWIST, self.table.metadata.twist_max_rad].map(|t| t + self.zero_rad);
        let position = next.clamp(low, high);
        self.shaft = Ramp { position, speed: (position - self.shaft.position) / TICK_S };
    }

    fn command(&self, here: i64) -> DriveCommand {
        let ahead = self.shaft.position + DRIVE_LAG_S * self.shaft.speed;
        let max_lag = ((MAX_LAG[0] + MAX_LAG[1] * self.shaft.speed.abs()) * self.rig.counts_per_rad) as i64;
        let counts = (f64::from(ahead) * f64::from(self.rig.counts_per_rad)) as i64 - self.drive_offset;
        let speed = (1.3 * self.shaft.speed.abs() + 1.0).min(self.rig.twist_speed_max());
        DriveCommand::Follow {
            position_qc: counts.clamp(here - max_lag, here + max_lag) as i32,
            speed_limit_rpm: self.rig.motor_rpm(speed),
            current_limit_ma: self.rig.current_limit_ma,
        }
    }
}

/// A baseline on a rig that was switched on under a load (N) with the strings at a twist (rad), the half-turn pre-twist: it stands
/// there and has taken its reference.
///
/// # Errors
/// In words, if it does not come there.
pub fn at_reference(
    subject: &Subject,
    firmware: &Firmware,
    [load_n, twist_rad]: [f64; 2],
) -> Result<ControlBench<Baseline>, String> {
    let rig = subject.switched_on_at(load_n, twist_rad).map_err(|e| e.to_string())?;
    let mut bench = ControlBench::on(rig, Baseline::new(firmware));
    bench.control.wanted.load_n = bench.truth().load_n as f32;
    if !bench.until(START_S, |bench| bench.control.phase == Phase::Ready) {
        return Err(format!("a baseline does not come to its reference within {START_S} s"));
    }
    bench.home_gap_m = Some(bench.truth().gap_m);
    Ok(bench)
}

/// One tick with a set-point (m) on a move to a target (m) that was asked for at a speed (m/s).
pub fn follow(bench: &mut ControlBench<Baseline>, set_point_m: f32, target_m: f32, asked_m_per_s: f32) {
    let last_m = bench.control.wanted.set_point_m;
    bench.control.wanted = Wanted {
        set_point_m,
        speed_m_per_s: (set_point_m - last_m) / TICK_S,
        done: set_point_m == target_m,
        target_m,
        asked_m_per_s,
        load_n: bench.truth().load_n as f32,
    };
    bench.tick(None);
}

impl ControlLaw for Baseline {
    type Decision = DriveCommand;

    fn step(&mut self, inputs: &Inputs) -> DriveCommand {
        if !core::mem::replace(&mut self.started, true) {
            return DriveCommand::Restart;
        }
        let lvdt = self.lvdt.read(inputs.now_us, inputs.lvdt, &self.rig);
        let DriveReading::Reports { position_qc, speed_rpm, .. } = inputs.drive else { return DriveCommand::Silence };
        let LvdtReading::Valid { gap_m, .. } = lvdt else { return DriveCommand::Silence };
        let shaft_rad = inputs.encoder_counts as f32 / self.rig.counts_per_rad;
        let here = i64::from(position_qc);
        match self.phase {
            Phase::Boot { standing } => self.boot(standing, inputs.encoder_counts - here, speed_rpm, shaft_rad),
            Phase::Approach { rested, sum_m, count } => self.approach(rested, sum_m, count, gap_m),
            Phase::Ready => {
                let shown_m = self.reference_gap_m - gap_m;
                self.shown_m = Some(shown_m);
                self.follow(shown_m);
            }
        }
        self.command(here)
    }

    fn drive(decision: &DriveCommand) -> DriveCommand {
        *decision
    }
}
