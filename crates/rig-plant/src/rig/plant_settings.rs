//! What a test or an operator may change about the rig without telling the firmware: the value of every plant key.

use crate::effects::{LVDT_NOISE_M, RAIL_FRICTION_N};
use crate::units::STANDARD_GRAVITY;
use crate::{PlantChange, PlantError, PlantKey, RigPreset};
use rig_config::Scene;
use tsa_model::RadiusLaw;

use super::effects::current::CurrentReading;
use super::effects::stribeck::RailFriction;
use super::motor::MotorFriction;

/// Everything that plant keys set. SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantSettings {
    /// Weight on the rail, N; its inertia is load / g.
    pub load_n: f64,
    /// Coulomb friction on the rail, N.
    pub friction_n: f64,
    /// Friction on the rail that grows with the load, as a share of the load.
    pub friction_load_share: f64,
    /// Static friction on the rail over Coulomb friction.
    pub stiction_ratio: f64,
    /// Speed over which the rail's friction falls from static to Coulomb friction, m/s.
    pub stribeck_speed_m_per_s: f64,
    /// How far the rail gives before it breaks loose, m.
    pub presliding_m: f64,
    /// Viscous damping on the rail, N s/m.
    pub damping_n_s_per_m: f64,
    /// LVDT noise of one sample, m rms.
    pub lvdt_noise_m: f64,
    /// LVDT offset, m.
    pub lvdt_offset_m: f64,
    /// LVDT gain error, a fraction.
    pub lvdt_gain_error: f64,
    /// Amplitude of the LVDT's curve, as a share of its stroke.
    pub lvdt_nonlinearity: f64,
    /// LVDT noise that averaging over a block leaves, m rms.
    pub lvdt_noise_inband_m: f64,
    /// Hum of the mains in the LVDT's signal, m, peak.
    pub hum_m: f64,
    /// Integral non-linearity of the converter, codes, peak.
    pub adc_inl: f64,
    /// Twist of the strings at power-up, rad.
    pub twist_at_boot_rad: f64,
    /// Scales k2 of the string's radius law.
    pub k2_scale: f64,
    /// Scales k3.
    pub k3_scale: f64,
    /// Scales k4.
    pub k4_scale: f64,
    /// Scales the string's stiffness K.
    pub stiffness_scale: f64,
    /// Scales all coefficients of the rods' stress-strain law.
    pub modulus_scale: f64,
    /// Added to the exponent of the string's radius law.
    pub twist_exponent_shift: f64,
    /// Half width of the loop of the rods' stress over strain, Pa.
    pub rod_hysteresis_pa: f64,
    /// What the strings stretch slowly, as a share of their elastic stretch.
    pub string_creep: f64,
    /// Share of their radius that new strings lose.
    pub string_bedding: f64,
    /// Width of the loop between the twist of the shaft and that of the strings, rad.
    pub twist_play_rad: f64,
    /// Temperature of rods and LVDT, less that of the calibration, K.
    pub temperature_k: f64,
    /// Friction of motor and gear.
    pub motor_friction: MotorFriction,
    /// True torque constant over the scene's.
    pub torque_constant_scale: f64,
    /// The drive's reading of the current.
    pub current_reading: CurrentReading,
    /// Play of the gear at its output, rad.
    pub gear_backlash_rad: f64,
    /// Drive supply, V; `None` is the scene's.
    pub supply_voltage_v: Option<f64>,
    /// Whether a motor-power relay is fitted. Without one the drive has power whatever the board does.
    pub relay_fitted: bool,
    /// How long that relay goes on feeding the drive once its pin is low, s.
    pub relay_release_s: f64,
}

impl Default for PlantSettings {
    fn default() -> Self {
        Self {
            load_n: 0.5 * STANDARD_GRAVITY,
            friction_n: RAIL_FRICTION_N,
            friction_load_share: 0.0,
            stiction_ratio: 1.0,
            stribeck_speed_m_per_s: 0.0,
            presliding_m: 0.0,
            damping_n_s_per_m: 1.0,
            lvdt_noise_m: LVDT_NOISE_M,
            lvdt_offset_m: 0.0,
            lvdt_gain_error: 0.0,
            lvdt_nonlinearity: 0.0,
            lvdt_noise_inband_m: 0.0,
            hum_m: 0.0,
            adc_inl: 0.0,
            twist_at_boot_rad: 1.0,
            k2_scale: 1.0,
            k3_scale: 1.0,
            k4_scale: 1.0,
            stiffness_scale: 1.0,
            modulus_scale: 1.0,
            twist_exponent_shift: 0.0,
            rod_hysteresis_pa: 0.0,
            string_creep: 0.0,
            string_bedding: 0.0,
            twist_play_rad: 0.0,
            temperature_k: 0.0,
            motor_friction: MotorFriction::default(),
            torque_constant_scale: 1.0,
            current_reading: CurrentReading::default(),
            gear_backlash_rad: 0.0,
            supply_voltage_v: None,
            relay_fitted: true,
            // The release time of a small power relay with a flyback diode. Assumed.
            relay_release_s: 0.02,
        }
    }
}

impl PlantSettings {
    /// The rig of a preset that a seed names.
    pub fn preset(preset: RigPreset, seed: u64) -> Self {
        let mut settings = Self::default();
        preset.changes(seed).into_iter().for_each(|change| settings.put(change));
        settings
    }

    /// Changes one of them.
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`] if no rig can have the value.
    pub fn apply(&mut self, change: PlantChange) -> Result<(), PlantError> {
        change.check()?;
        self.put(change);
        Ok(())
    }

    fn put(&mut self, PlantChange { key, value }: PlantChange) {
        let place = match key {
            PlantKey::Load => &mut self.load_n,
            PlantKey::Friction => &mut self.friction_n,
            PlantKey::FrictionLoadShare => &mut self.friction_load_share,
            PlantKey::StictionRatio => &mut self.stiction_ratio,
            PlantKey::StribeckSpeed => &mut self.stribeck_speed_m_per_s,
            PlantKey::Presliding => &mut self.presliding_m,
            PlantKey::Damping => &mut self.damping_n_s_per_m,
            PlantKey::LvdtNoise => &mut self.lvdt_noise_m,
            PlantKey::LvdtOffset => &mut self.lvdt_offset_m,
            PlantKey::LvdtGainError => &mut self.lvdt_gain_error,
            PlantKey::LvdtNonlinearity => &mut self.lvdt_nonlinearity,
            PlantKey::LvdtNoiseInband => &mut self.lvdt_noise_inband_m,
            PlantKey::Hum => &mut self.hum_m,
            PlantKey::AdcInl => &mut self.adc_inl,
            PlantKey::TwistAtBoot => &mut self.twist_at_boot_rad,
            PlantKey::K2Scale => &mut self.k2_scale,
            PlantKey::K3Scale => &mut self.k3_scale,
            PlantKey::K4Scale => &mut self.k4_scale,
            PlantKey::StiffnessScale => &mut self.stiffness_scale,
            PlantKey::ModulusScale => &mut self.modulus_scale,
            PlantKey::TwistExponentShift => &mut self.twist_exponent_shift,
            PlantKey::RodHysteresis => &mut self.rod_hysteresis_pa,
            PlantKey::StringCreep => &mut self.string_creep,
            PlantKey::StringBedding => &mut self.string_bedding,
            PlantKey::TwistPlay => &mut self.twist_play_rad,
            PlantKey::Temperature => &mut self.temperature_k,
            PlantKey::MotorFriction => &mut self.motor_friction.coulomb_nm,
            PlantKey::MotorFrictionAsymmetry => &mut self.motor_friction.asymmetry,
            PlantKey::GearEfficiency => &mut self.motor_friction.gear_efficiency,
            PlantKey::TorqueConstantScale => &mut self.torque_constant_scale,
            PlantKey::CurrentOffset => &mut self.current_reading.offset_a,
            PlantKey::CurrentNoise => &mut self.current_reading.noise_a,
            PlantKey::CurrentQuantum => &mut self.current_reading.quantum_a,
            PlantKey::GearBacklash => &mut self.gear_backlash_rad,
            PlantKey::SupplyVoltage => self.supply_voltage_v.insert(value),
            PlantKey::RelayRelease => &mut self.relay_release_s,
            PlantKey::RelayFitted => {
                self.relay_fitted = value >= 0.5;
                return;
            }
        };
        *place = value;
    }

    /// Changes one of them as an operator types it: a number with or without a unit.
    ///
    /// # Errors
    /// [`PlantError`] naming the key and what it takes.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), PlantError> {
        self.apply(PlantChange::read(key, value)?)
    }

    /// Friction of the rail under the load.
    pub fn rail_friction(&self) -> RailFriction {
        RailFriction {
            coulomb_n: self.friction_n + self.friction_load_share * self.load_n,
            stiction_ratio: self.stiction_ratio,
            stribeck_m_per_s: self.stribeck_speed_m_per_s,
            presliding_m: self.presliding_m,
        }
    }

    /// The scene as this rig really is: its constants differ from those that the firmware's table was built with.
    pub fn distort(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        scene.string.k2 *= self.k2_scale;
        scene.string.k3 *= self.k3_scale;
        scene.string.k4 *= self.k4_scale;
        scene.string.stiffness_n_per_m *= self.stiffness_scale;
        // The law by the length has no exponent; there the plant's strings shift it (`effects::strings`).
        if let (RadiusLaw::TwistPower, Some(exponent)) = (scene.string.radius_law, &mut scene.string.twist_exponent) {
            *exponent += self.twist_exponent_shift;
        }
        for coefficient in &mut scene.material.stress_coefficients_pa {
            *coefficient *= self.modulus_scale;
        }
        scene
    }
}
