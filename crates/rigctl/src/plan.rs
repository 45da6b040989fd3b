//! What an actuator can do with a load by table, settings and motor, without a board: how far the load reaches, and whether a
//! trajectory can be followed.

use crate::failure::Failure;
use crate::trajectory::{Trajectory, TrajectoryPoint};
use crate::units::{MM_PER_S, N};
use rig_config::Scene;
use rig_control::RigConstants;
use rig_control::mechanism::Mechanism;
use rig_control::move_check::{MoveRequest, MoveStart};
use rig_control::settings as rig_settings;
use rig_link::gap_curve::GapCurve;
use rig_link::{LoadChoice, Refusal, Setting, SettingValues};
use std::f32::consts::PI;
use tsa_table::Point;
use tsa_table::fit::Fit;

/// Rail friction that a plan assumes (N): that of the emulated rig unless `--plant` changes it. A board measures it when
/// homing.
const FRICTION_N: f32 = 0.05;
/// How much farther (m) and how many times as fast as planned a real actuator may move: its strings, zero and friction are its
/// own. Within that the board decides.
const BEYOND_M: f32 = 2e-3;
const BEYOND: f64 = 1.1;
/// The same of the acceleration: the board smooths what is short, such as a hand's tremor.
const BEYOND_ACCELERATION: f64 = 3.0;

/// A load on an actuator that hangs at the half-turn pre-twist.
pub struct Plan {
    fit: Fit,
    values: SettingValues,
    /// The constants with the settings' corrections.
    pub rig: RigConstants,
    /// The load (N).
    pub load_n: f32,
}

impl Plan {
    /// Of a load (N); without one, of the lightest in the scene's range, which moves farthest and fastest.
    ///
    /// # Errors
    /// If the scene has no table.
    pub fn new(scene: &Scene, values: SettingValues, load_n: Option<f32>) -> Result<Self, Failure> {
        let fit = scene.fit_table()?;
        let load_n = load_n.unwrap_or(fit.table.table().metadata.load_min_n);
        Ok(Self { fit, values, rig: rig_settings::apply(&values, &scene.constants()), load_n })
    }

    /// The table with the settings' scale of the twist.
    pub fn mechanism(&self) -> Mechanism<'_> {
        let twist_scale = self.values.get(Setting::TwistScale);
        Mechanism { table: self.fit.table.table(), twist_scale, curve: GapCurve::constant(0.0) }
    }

    /// Where a move starts: the position (m) of the pre-twist, where zero may be another place by the settings. After homing's
    /// way down the load hangs there with the pull of load less friction.
    pub fn start(&self) -> MoveStart<'_> {
        let (mechanism, position_m) = (self.mechanism(), 0.0 - self.values.get(Setting::PositionZero));
        MoveStart {
            mechanism,
            mechanism_load_n: self.load_n,
            friction_n: FRICTION_N,
            twist_rad: PI,
            position_m,
            zero_gap_m: mechanism.at(self.load_n - FRICTION_N, PI).gap_m + position_m,
            settings: &self.values,
        }
    }

    /// Twist (rad) and point of the table at a position (m).
    ///
    /// # Errors
    /// If the table does not reach it.
    pub fn at(&self, position_m: f32) -> Result<(f32, Point), Failure> {
        let mechanism = self.mechanism();
        let gap_m = mechanism.at(self.load_n, PI).gap_m - (position_m - self.start().position_m);
        let twist_rad = mechanism.table.twist_from_gap(self.load_n, gap_m)? / mechanism.twist_scale;
        Ok((twist_rad, mechanism.at(self.load_n, twist_rad)))
    }

    /// Refuses a move that no actuator of this scene and these settings can make, before it is homed.
    ///
    /// # Errors
    /// As the board's.
    pub fn check_move(&self, request: &MoveRequest) -> Result<(), Refusal> {
        let nearer = MoveRequest { target_m: request.target_m - BEYOND_M.copysign(request.target_m), ..*request };
        // The refusal names the wanted target.
        self.start().check(&nearer).or_else(|_| self.start().check(request))
    }

    /// Refuses a trajectory that leaves the travel, or the speed or acceleration of the motor.
    ///
    /// # Errors
    /// The row to which the load cannot be led, as [`TrajectoryPoint::row`] counts it, and why.
    pub fn check_trajectory(&self, trajectory: &Trajectory) -> Result<(), (usize, String)> {
        let max_m_per_s = self.values.get(Setting::SpeedMax);
        let load = LoadChoice::Known(self.load_n);
        for (point, acceleration_m_per_s2) in trajectory.samples() {
            let TrajectoryPoint { row, position_m, speed_m_per_s, .. } = point;
            let request = MoveRequest { target_m: position_m as f32, speed_m_per_s: max_m_per_s, load };
            self.check_move(&request).map_err(|refusal| (row, refusal.to_string()))?;
            // At an end of the travel the table's own end counts.
            let twist_rad =
                self.at(position_m as f32).map_or(self.mechanism().twist_max_rad(), |(twist_rad, _)| twist_rad);
            let tr_rad_per_m = f64::from(self.mechanism().at(self.load_n, twist_rad).tr_rad_per_m());
            let speed_max = f64::from(max_m_per_s).min(f64::from(self.rig.twist_speed_max()) / tr_rad_per_m);
            let acceleration_max = f64::from(self.rig.twist_limits().acceleration) / tr_rad_per_m;
            let load = N.show(self.load_n);
            if speed_m_per_s.abs() > BEYOND * speed_max {
                let [wanted, max] = [speed_m_per_s.abs(), speed_max].map(|speed| MM_PER_S.show(speed));
                return Err((row, format!("its speed is {wanted}, allowed are {max} there with a load of {load}")));
            }
            if acceleration_m_per_s2.abs() > BEYOND_ACCELERATION * acceleration_max {
                let wanted = acceleration_m_per_s2.abs();
                return Err((
                    row,
                    format!(
                        "its acceleration is {wanted:.3} m/s², the motor allows {acceleration_max:.3} m/s² there with a load of \
                         {load}"
                    ),
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rig_control::move_check::SPEED_MIN_M_PER_S;

    const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

    fn plan(load_n: Option<f32>) -> Plan {
        let scene = Scene::load(format!("{ROOT}/scenes/default.toml")).expect("a scene");
        Plan::new(&scene, rig_settings::defaults(&scene.constants()), load_n).expect("a table")
    }

    #[test]
    fn a_trajectory_that_cannot_be_followed_is_refused_by_its_row() {
        let plan = plan(Some(4.9));
        for (rows, named) in [
            ("0,0.001\n5,0.002\n90,0.1\n", (4, "target is 0.1 m, allowed are 0")),
            ("0,-0.01\n1,0.002\n", (2, "target is -0.01 m")),
            ("0,0.001\n0.02,0.0021\n0.04,0.0032\n1,0.0032\n", (2, "its acceleration is")),
            ("0,0.001\n0.02,0.0011\n0.04,0.001\n1,0.001\n", (2, "its acceleration is")),
        ] {
            let trajectory = Trajectory::parse(&format!("t_s,position_m\n{rows}")).expect("a trajectory");
            let (row, why) = plan.check_trajectory(&trajectory).expect_err(rows);
            assert!(row == named.0 && why.starts_with(named.1), "{rows}: {row}: {why}");
        }
        let fast = "t_s,position_m,speed_m_per_s\n0,0.001,0.015\n1,0.016,0.015\n";
        let fast = plan.check_trajectory(&Trajectory::parse(fast).expect("a trajectory"));
        assert!(
            fast.as_ref().is_err_and(|(row, why)| *row == 2 && why.starts_with("its speed is 15.00 mm/s")),
            "{fast:?}"
        );
        // Between two rows as well.
        let beyond = "t_s,position_m,speed_m_per_s\n0,0.001,0\n20,0.023,0.002\n60,0.023,-0.002\n";
        let beyond = plan.check_trajectory(&Trajectory::parse(beyond).expect("a trajectory"));
        assert!(beyond.as_ref().is_err_and(|(row, why)| *row == 4 && why.starts_with("target")), "{beyond:?}");
        for (name, load_n) in [("sine", 4.9), ("chirp", 4.9), ("hand", 4.9)] {
            let file = std::path::PathBuf::from(format!("{ROOT}/scenarios/{name}.csv"));
            let trajectory = Trajectory::load(&file).expect("a trajectory");
            assert_eq!(self::plan(Some(load_n)).check_trajectory(&trajectory), Ok(()), "{name}");
        }
    }

    #[test]
    fn only_what_no_actuator_of_the_scene_reaches_is_refused_before_homing() {
        let to = |target_m: f32, plan: &Plan| {
            let (speed_m_per_s, load) = (SPEED_MIN_M_PER_S, LoadChoice::Auto);
            plan.check_move(&MoveRequest { target_m, speed_m_per_s, load })
        };
        let (lightest, heavy) = (plan(None), plan(Some(17.0)));
        // The lightest load comes up by 36 mm; what is a little farther is the board's to refuse.
        assert!(to(0.037, &lightest).is_ok() && to(0.037, &heavy).is_err());
        let refused = to(0.1, &lightest).expect_err("it is far").to_string();
        assert!(refused.contains("target is 0.1 m, allowed are 0 to 0.03"), "{refused}");
        assert!(to(-0.001, &lightest).is_ok() && to(-0.01, &lightest).is_err());
    }
}
