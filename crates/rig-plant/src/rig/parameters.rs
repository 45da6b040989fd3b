//! Constants of the emulated rig, filled from a scene's `[rig]` table in one place.

use super::RigError;
use rig_config::{DriveTransport, Rig};
use rmds405::{Address, Transport};

/// Motor, drive, gear and sensors. A value that no source gives is assumed, and its comment says so.
#[derive(Clone, Debug)]
pub struct RigParameters {
    /// Motor turns for one turn of the output.
    pub gear_ratio: f64,
    /// Quadrature counts for one motor turn, 4 for each line (crates/rmds405/README.md 1).
    pub counts_per_turn: u32,
    /// Torque constant, N m/A; also the back-EMF constant, V s/rad.
    pub torque_constant_nm_per_a: f64,
    /// Winding resistance, ohm.
    pub resistance_ohm: f64,
    /// Rotor and gear inertia at the motor shaft, kg m².
    pub inertia_kg_m2: f64,
    /// Viscous friction at the motor shaft, N m s/rad. Assumed.
    pub viscous_nm_s_per_rad: f64,
    /// Brake resistor across the motor while the e-stop is open, ohm (V-FAQ p20).
    pub brake_ohm: f64,
    /// Address of the drive on the bus.
    pub drive: Address,
    /// The line that the firmware uses; the drive itself listens to both.
    pub transport: Transport,
    /// Drive supply, V.
    pub supply_voltage_v: f64,
    /// Ratio of the divider between the supply and the drive's analog input, if that is wired.
    pub supply_divider: Option<f64>,
    /// LVDT stroke, m.
    pub lvdt_stroke_m: f64,
    /// Volts at the ADC pin at the start and the end of the stroke.
    pub lvdt_volts: [f64; 2],
    /// Gap at the start of the stroke, m.
    pub lvdt_gap_at_zero_m: f64,
    /// LVDT bandwidth (first order, -3 dB), Hz. Assumed: DC types have 100 to 500 Hz (docs/reference/hardware.md 2.2).
    pub lvdt_bandwidth_hz: f64,
    /// ADC full scale, V.
    pub adc_reference_v: f64,
    /// Divided LVDT excitation on ADC channel 1, V. Assumed.
    pub excitation_v: f64,
    /// Internal reference on ADC channel 17, V (typical value of the STM32F446 data sheet).
    pub vrefint_v: f64,
}

impl RigParameters {
    /// From a scene.
    ///
    /// # Errors
    /// [`RigError::Drive`] if the scene's drive has no valid address.
    pub fn new(rig: &Rig) -> Result<Self, RigError> {
        Ok(Self {
            gear_ratio: rig.gear(),
            counts_per_turn: rig.encoder_lines.saturating_mul(4),
            torque_constant_nm_per_a: rig.motor_torque_constant_nm_per_a,
            resistance_ohm: rig.motor_resistance_ohm,
            inertia_kg_m2: rig.rotor_inertia_kg_m2,
            viscous_nm_s_per_rad: 1e-8,
            brake_ohm: 10.0,
            drive: Address::new(rig.drive_group, rig.drive_number)?,
            transport: match rig.drive_transport {
                DriveTransport::Can => Transport::Can,
                DriveTransport::Uart => Transport::Uart,
            },
            supply_voltage_v: rig.supply_voltage_v,
            supply_divider: rig.supply_divider,
            lvdt_stroke_m: rig.lvdt_stroke_m,
            lvdt_volts: [rig.lvdt_volts_at_zero, rig.lvdt_volts_at_stroke],
            lvdt_gap_at_zero_m: rig.lvdt_gap_at_zero_m,
            lvdt_bandwidth_hz: 200.0,
            adc_reference_v: rig.adc_reference_v,
            excitation_v: 3.0,
            vrefint_v: 1.21,
        })
    }
}
