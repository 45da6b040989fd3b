//! What a test or an operator may change about the rig without telling the firmware: the value of every plant key.

use rig_scene::Scene;
use sim_link::units::STANDARD_GRAVITY;
use sim_link::{PlantChange, PlantError, PlantKey};

/// Everything that plant keys set. SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantSettings {
    /// Weight on the rail, N; its inertia is load / g.
    pub load_n: f64,
    /// Coulomb friction on the rail, N.
    pub friction_n: f64,
    /// Viscous damping on the rail, N s/m.
    pub damping_n_s_per_m: f64,
    /// LVDT noise of one sample, m rms.
    pub lvdt_noise_m: f64,
    /// LVDT offset, m.
    pub lvdt_offset_m: f64,
    /// LVDT gain error, a fraction.
    pub lvdt_gain_error: f64,
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
    /// Scales the string's stiffness K.
    pub stiffness_scale: f64,
    /// Scales all coefficients of the rods' stress-strain law.
    pub modulus_scale: f64,
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
            friction_n: 0.05,
            damping_n_s_per_m: 1.0,
            lvdt_noise_m: 60e-6,
            lvdt_offset_m: 0.0,
            lvdt_gain_error: 0.0,
            hum_m: 0.0,
            adc_inl: 0.0,
            twist_at_boot_rad: 1.0,
            k2_scale: 1.0,
            k3_scale: 1.0,
            stiffness_scale: 1.0,
            modulus_scale: 1.0,
            gear_backlash_rad: 0.0,
            supply_voltage_v: None,
            relay_fitted: true,
            // The release time of a small power relay with a flyback diode. Assumed.
            relay_release_s: 0.02,
        }
    }
}

impl PlantSettings {
    /// Changes one of them.
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`] if no rig can have the value.
    pub fn apply(&mut self, change: PlantChange) -> Result<(), PlantError> {
        change.check()?;
        let PlantChange { key, value } = change;
        let place = match key {
            PlantKey::Load => &mut self.load_n,
            PlantKey::Friction => &mut self.friction_n,
            PlantKey::Damping => &mut self.damping_n_s_per_m,
            PlantKey::LvdtNoise => &mut self.lvdt_noise_m,
            PlantKey::LvdtOffset => &mut self.lvdt_offset_m,
            PlantKey::LvdtGainError => &mut self.lvdt_gain_error,
            PlantKey::Hum => &mut self.hum_m,
            PlantKey::AdcInl => &mut self.adc_inl,
            PlantKey::TwistAtBoot => &mut self.twist_at_boot_rad,
            PlantKey::K2Scale => &mut self.k2_scale,
            PlantKey::K3Scale => &mut self.k3_scale,
            PlantKey::StiffnessScale => &mut self.stiffness_scale,
            PlantKey::ModulusScale => &mut self.modulus_scale,
            PlantKey::GearBacklash => &mut self.gear_backlash_rad,
            PlantKey::SupplyVoltage => self.supply_voltage_v.insert(value),
            PlantKey::RelayRelease => &mut self.relay_release_s,
            PlantKey::RelayFitted => {
                self.relay_fitted = value >= 0.5;
                return Ok(());
            }
        };
        *place = value;
        Ok(())
    }

    /// Changes one of them as an operator types it: a number with or without a unit.
    ///
    /// # Errors
    /// [`PlantError`] naming the key and what it takes.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), PlantError> {
        self.apply(PlantChange::read(key, value)?)
    }

    /// The scene as this rig really is: its constants differ from those that the firmware's table was built with.
    pub fn distort(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        scene.string.k2 *= self.k2_scale;
        scene.string.k3 *= self.k3_scale;
        scene.string.stiffness_n_per_m *= self.stiffness_scale;
        for coefficient in &mut scene.material.stress_coefficients_pa {
            *coefficient *= self.modulus_scale;
        }
        scene
    }
}
