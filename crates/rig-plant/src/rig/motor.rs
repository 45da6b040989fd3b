//! A brushed DC motor with friction, and what the drive's bridge does to it.
//!
//! The winding's inductance is left out: its time constant, about 0.1 ms, is below the time step.

use crate::PlantSettings;
use rig_config::RigConfig;

/// Viscous friction at the motor shaft, N m s/rad. Assumed.
const VISCOUS_NM_S_PER_RAD: f64 = 1e-8;
/// Brake resistor across the motor while the e-stop is open, ohm (V-FAQ p20).
pub const BRAKE_OHM: f64 = 10.0;

/// What the motor's leads are connected to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bridge {
    /// Nothing: the motor coasts.
    Open,
    /// A voltage, V.
    Voltage(f64),
    /// A current regulator, A, which has at most this voltage, V.
    Current {
        /// Wanted.
        amps: f64,
        /// Size of the maximum voltage.
        max_volts: f64,
    },
    /// A brake resistor, ohm.
    Resistor(f64),
}

impl Bridge {
    /// The same with the motor's leads swapped.
    #[must_use]
    pub fn reversed(self) -> Self {
        match self {
            Self::Voltage(volts) => Self::Voltage(-volts),
            Self::Current { amps, max_volts } => Self::Current { amps: -amps, max_volts },
            Self::Open | Self::Resistor(_) => self,
        }
    }
}

/// Maximum friction of motor and gear (N m) at the motor's shaft under a load's torque (N m), against motion to positive and to
/// negative angles. When the gear with its efficiency η lifts a load, the teeth rub with (1/η − 1) times the load's torque, in
/// either direction: below 0.5 no load drives the motor back.
fn friction_limits_nm(settings: &PlantSettings, load_nm: f64) -> [f64; 2] {
    let rubbing = (1.0 / settings.gear_efficiency - 1.0) * load_nm.abs();
    [1.0, -1.0]
        .map(|direction| settings.motor_friction_nm * (1.0 + direction * settings.motor_friction_asymmetry) + rubbing)
}

/// Rotor and winding.
#[derive(Clone, Debug)]
pub struct Motor {
    torque_constant: f64,
    resistance: f64,
    inertia: f64,
    /// Angle of the shaft, rad.
    pub angle_rad: f64,
    /// Speed of the shaft, rad/s.
    pub speed_rad_per_s: f64,
    /// Winding current, A; positive drives towards positive angles.
    pub current_a: f64,
    /// Electrical energy that the leads have taken from the bridge, J. Energy that the motor gives back while it brakes
    /// is not subtracted: nothing on the supply rail stores it.
    pub energy_j: f64,
    /// Voltage that the bridge puts on the leads now, V.
    pub bridge_v: f64,
    /// Electrical power that the leads take from the bridge now, W; negative while the motor brakes.
    pub bridge_w: f64,
    /// The regulator wanted more voltage than there is.
    pub saturated: bool,
}

impl Motor {
    /// At rest at an angle, its torque constant the scene's times a factor.
    pub fn new(parameters: &RigConfig, torque_constant_scale: f64, angle_rad: f64) -> Self {
        Self {
            torque_constant: parameters.motor_torque_constant_nm_per_a * torque_constant_scale,
            resistance: parameters.motor_resistance_ohm,
            inertia: parameters.rotor_inertia_kg_m2,
            angle_rad,
            speed_rad_per_s: 0.0,
            current_a: 0.0,
            energy_j: 0.0,
            bridge_v: 0.0,
            bridge_w: 0.0,
            saturated: false,
        }
    }

    /// One step of `h` seconds with `torque_nm` from the load at the shaft.
    pub fn step(&mut self, h: f64, bridge: Bridge, torque_nm: f64, settings: &PlantSettings) {
        let limits = friction_limits_nm(settings, torque_nm);
        self.saturated = false;
        match bridge {
            Bridge::Open => {
                self.current_a = 0.0;
                self.advance(h, torque_nm, 0.0, limits);
            }
            Bridge::Voltage(volts) => self.drive_voltage(h, volts, self.resistance, torque_nm, limits),
            Bridge::Resistor(ohm) => self.drive_voltage(h, 0.0, self.resistance + ohm, torque_nm, limits),
            Bridge::Current { amps, max_volts } => {
                let volts = amps * self.resistance + self.torque_constant * self.speed_rad_per_s;
                if volts.abs() > max_volts {
                    self.drive_voltage(h, max_volts.copysign(volts), self.resistance, torque_nm, limits);
                    self.saturated = true;
                } else {
                    self.current_a = amps;
                    self.advance(h, torque_nm + self.torque_constant * amps, 0.0, limits);
                }
            }
        }
        // A brake resistor is across the leads, not across the bridge.
        self.bridge_v = match bridge {
            Bridge::Voltage(_) | Bridge::Current { .. } => {
                self.current_a * self.resistance + self.torque_constant * self.speed_rad_per_s
            }
            Bridge::Open | Bridge::Resistor(_) => 0.0,
        };
        self.bridge_w = self.bridge_v * self.current_a;
        self.energy_j += h * self.bridge_w.max(0.0);
    }

    /// Back-EMF is a damping, taken at the end of the step: stable for any step.
    fn drive_voltage(&mut self, h: f64, volts: f64, ohm: f64, torque_nm: f64, limits: [f64; 2]) {
        let drive = self.torque_constant * volts / ohm;
        self.advance(h, torque_nm + drive, self.torque_constant * self.torque_constant / ohm, limits);
        self.current_a = (volts - self.torque_constant * self.speed_rad_per_s) / ohm;
    }

    /// Backward Euler; friction as a set-valued force, so that a shaft at rest stays until the torque exceeds it.
    fn advance(&mut self, h: f64, torque_nm: f64, damping: f64, limits: [f64; 2]) {
        let push = self.inertia * self.speed_rad_per_s / h + torque_nm;
        let limit = limits[usize::from(push < 0.0)];
        let free = (push.abs() - limit).max(0.0).copysign(push);
        self.speed_rad_per_s = free / (self.inertia / h + VISCOUS_NM_S_PER_RAD + damping);
        self.angle_rad += h * self.speed_rad_per_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motor() -> Motor {
        Motor::new(&RigConfig::default(), 1.0, 0.0)
    }

    /// A lossless gear, and 0.02 mN m of friction.
    fn ideal() -> PlantSettings {
        PlantSettings::default()
    }

    #[test]
    fn friction_holds_and_lets_go() {
        let mut motor = motor();
        for _ in 0..4000 {
            motor.step(2.5e-4, Bridge::Open, 1.9e-5, &ideal());
        }
        assert_eq!((motor.angle_rad, motor.speed_rad_per_s), (0.0, 0.0));
        motor.step(2.5e-4, Bridge::Open, 2.1e-5, &ideal());
        assert!(motor.speed_rad_per_s > 0.0);
    }

    #[test]
    fn friction_grows_with_the_load_and_differs_by_direction() {
        let friction = PlantSettings {
            motor_friction_nm: 2e-4,
            motor_friction_asymmetry: 0.1,
            gear_efficiency: 0.75,
            ..PlantSettings::default()
        };
        // Lifting takes the load over the efficiency; 1/0.75 - 1 is a third.
        let [up, down] = friction_limits_nm(&friction, -6e-5);
        assert!((up - (2.2e-4 + 2e-5)).abs() < 1e-12 && (down - (1.8e-4 + 2e-5)).abs() < 1e-12, "{up} {down}");
        for (drive_nm, moves) in [(up + 6e-5 + 1e-6, true), (up + 6e-5 - 1e-6, false), (6e-5 - down + 1e-6, false)] {
            let mut motor = motor();
            motor.step(2.5e-4, Bridge::Current { amps: drive_nm / 0.0229, max_volts: 24.0 }, -6e-5, &friction);
            assert_eq!(motor.speed_rad_per_s != 0.0, moves, "{drive_nm}");
        }
        let mut motor = motor();
        for _ in 0..4000 {
            motor.step(2.5e-4, Bridge::Open, -6e-5, &friction);
        }
        assert_eq!(motor.angle_rad, 0.0, "such a load does not drive the motor back");
    }

    #[test]
    fn no_load_speed_and_voltage_bound() {
        let mut motor = motor();
        for _ in 0..4000 {
            motor.step(2.5e-4, Bridge::Current { amps: 0.5, max_volts: 24.0 }, 0.0, &ideal());
            let volts = motor.current_a * 10.0 + 0.0229 * motor.speed_rad_per_s;
            assert!(volts.abs() <= 24.0 + 0.0229 * 30.0, "{volts}");
        }
        let friction_a = (2e-5 + 1e-8 * motor.speed_rad_per_s) / 0.0229;
        let expected = (24.0 - friction_a * 10.0) / 0.0229;
        assert!((motor.speed_rad_per_s - expected).abs() < 1.0, "{}", motor.speed_rad_per_s);
    }

    #[test]
    fn a_stronger_magnet_turns_slower_at_the_same_voltage() {
        let speed = |scale: f64| {
            let mut motor = Motor::new(&RigConfig::default(), scale, 0.0);
            (0..4000).for_each(|_| motor.step(2.5e-4, Bridge::Voltage(12.0), 0.0, &ideal()));
            motor.speed_rad_per_s
        };
        assert!((speed(1.1) * 1.1 - speed(1.0)).abs() < 1.0, "{} and {} rad/s", speed(1.1), speed(1.0));
    }

    #[test]
    fn energy_goes_into_the_winding_the_load_and_friction() {
        let mut motor = motor();
        let (amps, load_nm) = (0.2, -2e-3);
        let mut spent_j = 0.0;
        for _ in 0..2000 {
            let angle = motor.angle_rad;
            motor.step(2.5e-4, Bridge::Current { amps, max_volts: 24.0 }, load_nm, &ideal());
            let turned = motor.angle_rad - angle;
            let lost_w = 10.0 * motor.current_a.powi(2) + 1e-8 * motor.speed_rad_per_s.powi(2);
            spent_j += lost_w * 2.5e-4 + turned * (2e-5 - load_nm);
        }
        spent_j += 0.5 * 1.2e-7 * motor.speed_rad_per_s.powi(2);
        assert!(spent_j > 1.0 && (motor.energy_j / spent_j - 1.0).abs() < 0.01, "{} of {spent_j} J", motor.energy_j);
        // Driven by its load the motor gives energy back, which does not count.
        let before = motor.energy_j;
        motor.speed_rad_per_s = 900.0;
        motor.step(2.5e-4, Bridge::Current { amps: -0.2, max_volts: 24.0 }, 0.0, &ideal());
        motor.step(2.5e-4, Bridge::Resistor(10.0), 0.0, &ideal());
        assert_eq!(motor.energy_j, before);
    }

    #[test]
    fn brake_resistor_slows_it() {
        let mut coasting = motor();
        coasting.speed_rad_per_s = 500.0;
        let mut braked = coasting.clone();
        for _ in 0..40 {
            coasting.step(2.5e-4, Bridge::Open, 0.0, &ideal());
            braked.step(2.5e-4, Bridge::Resistor(10.0), 0.0, &ideal());
        }
        assert!(coasting.speed_rad_per_s > 490.0);
        assert!(braked.speed_rad_per_s < 100.0);
    }
}
