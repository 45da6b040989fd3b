//! A load hung from its mechanism at the start: surface, rods and strings.

use super::RigError;
use super::built_in::BuiltIn;
use super::conditions;
use super::effects::rods::Rods;
use super::effects::strings::{StringSizes, Strings};
use super::outside::measured::{Measured, TwoWays};
use super::parameters::RigParameters;
use super::plant_settings::PlantSettings;
use super::surface::{SLACK_LOAD_N, Surface};
use super::transmission::{Tiered, cheapest_tier};
use rig_config::Scene;
use tsa_model::{Mechanism, RadiusLaw, Tier};

/// Greatest load that the surface covers, unless the load or the scene asks for more, N.
const SURFACE_LOAD_N: f64 = 40.0;
/// How far past the last twist with an equilibrium the strings can be left, rad: strings that lie side by side still
/// give a little. That is ten turns under 0.1 kg. When they are released they throw the rotor to the other side.
pub(super) const CLOSED_GIVE_RAD: f64 = 1.7;

/// The rods' additional stress, where there is any: sampling them takes a while.
pub(super) fn rods_of(mechanism: &Mechanism, settings: &PlantSettings, surface: &Surface) -> Option<Rods> {
    let any = settings.rod_hysteresis_pa > 0.0 || settings.temperature_k != 0.0;
    any.then(|| Rods::new(mechanism, surface, settings.rod_hysteresis_pa)).flatten()
}

/// The strings of a mechanism, at the twist and under the load of the start.
pub(super) fn strings_of(mechanism: &Mechanism, real: &Scene, settings: &PlantSettings) -> Strings {
    let by_length = real.string.radius_law == RadiusLaw::LengthRatio;
    let sizes = StringSizes {
        play_rad: settings.twist_play_rad,
        bedding: settings.string_bedding,
        creep: settings.string_creep,
        exponent_shift: if by_length { settings.twist_exponent_shift } else { 0.0 },
    };
    Strings::new(mechanism.parameters(), &sizes, settings.twist_at_boot_rad, settings.load_n)
}

/// Ends of the rail, as gaps, m: those of the LVDT's stroke.
pub(super) fn stops_of(parameters: &RigParameters) -> [f64; 2] {
    let stop = parameters.lvdt_gap_at_zero_m;
    [stop, stop + parameters.lvdt_stroke_m]
}

/// The load hung from a surface, at the twist of the start.
pub(super) fn hung(
    surface: Surface,
    stops_m: [f64; 2],
    strings: Strings,
    rods: Option<Rods>,
    settings: &PlantSettings,
) -> Result<BuiltIn, RigError> {
    let (load_n, twist_rad) = (settings.load_n, settings.twist_at_boot_rad);
    let most_rad = (10.0 * (surface.last_twist_rad(load_n) + CLOSED_GIVE_RAD)).floor() / 10.0;
    if twist_rad.abs() > most_rad {
        return Err(RigError::Twist { twist_rad, load_n, most_rad });
    }
    Ok(BuiltIn::new(surface, stops_m, strings, rods, &conditions(settings)))
}

/// The load hung from measured gaps. Its strings are the scene's where the data do not tell: their slow stretch, and the
/// law by which a radius acts as a twist.
pub(super) fn measured(scene: &Scene, data: &Measured, settings: &PlantSettings) -> Result<BuiltIn, RigError> {
    let mechanism = Mechanism::new(&scene.geometry, &scene.string, &scene.material)?;
    let most_n = data.max_load_n();
    if settings.load_n > most_n {
        return Err(RigError::Load { load_n: settings.load_n, most_n });
    }
    let surface = Surface::new(data, most_n)?;
    // The exponent of the radius law is that of the data.
    let own = PlantSettings { twist_exponent_shift: 0.0, ..settings.clone() };
    let strings = strings_of(&mechanism, scene, &own);
    let two_ways = TwoWays::new(data, strings.twist_rad);
    let plant = hung(surface, stops_of(&RigParameters::new(&scene.rig)?), strings, None, &own)?;
    Ok(match two_ways {
        Some(two_ways) => plant.with_two_ways(two_ways),
        None => plant,
    })
}

/// The widest surface that the mechanism allows, by the cheapest model that the scene allows: rods at their strain
/// limit end it early in some scenes, and a cheaper model may not reach beyond the envelope.
pub(super) fn surface_for(mechanism: &Mechanism, scene: &Scene, load_n: f64) -> Result<(Surface, Tier), RigError> {
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
