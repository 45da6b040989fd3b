//! A load hung from its mechanism at the start: surface, rods and strings.

use super::RigError;
use super::built_in::BuiltIn;
use super::effects::rods::Rods;
use super::effects::strings::Strings;
use super::outside::measured::{Measured, TwoWays};
use super::surface::{GapPoint, SLACK_LOAD_N, Surface};
use crate::PlantSettings;
use rig_config::{RigConfig, Scene};
use tsa_model::{Equilibrium, Mechanism, RadiusLaw, Tier, TierError, twist_from_turns};

/// Maximum load that the surface covers, unless the load or the scene asks for more, N.
const SURFACE_LOAD_N: f64 = 40.0;
/// Turns past the half-turn pre-twist that the surface covers, and how many more than the scene's there are at least.
const SURFACE_TURNS: f64 = 11.0;
const TURNS_BEYOND: f64 = 3.5;
/// How far past the last twist with an equilibrium the strings can be left, rad: strings that lie side by side still
/// give a little. That is ten turns under 0.1 kg. When they are released they throw the rotor to the other side.
pub(super) const CLOSED_GIVE_RAD: f64 = 1.7;
/// The plant has to be this much more accurate than the scene requires of the firmware's table, so that its errors do
/// not show in a test of the table.
const BETTER: f64 = 5.0;
/// Number of loads, and of twists, at which the models estimate their errors.
const ASKED: u32 = 9;

impl PlantSettings {
    /// The scene as this rig really is: its constants differ from those that the firmware's table was built with.
    pub fn distort(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        scene.string.diameter_m *= self.radius_scale;
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

/// The rods' additional stress, where there is any: sampling them takes a while.
pub(super) fn rods_of(mechanism: &Mechanism, settings: &PlantSettings, surface: &Surface) -> Option<Rods> {
    let any = settings.rod_hysteresis_pa > 0.0 || settings.temperature_k != 0.0;
    any.then(|| Rods::new(mechanism, surface, settings.rod_hysteresis_pa)).flatten()
}

/// Ends of the rail, as gaps, m: those of the LVDT's stroke.
pub(super) fn stops_of(parameters: &RigConfig) -> [f64; 2] {
    let stop = parameters.lvdt_gap_at_zero_m;
    [stop, stop + parameters.lvdt_stroke_m]
}

/// The load hung from the scene's mechanism, which differs from it as the settings say.
pub(super) fn built_in(scene: &Scene, settings: &PlantSettings) -> Result<(BuiltIn, Mechanism, Tier), RigError> {
    let real = settings.distort(scene);
    let mechanism = Mechanism::new(&real.geometry, &real.string, &real.material)?;
    let (surface, tier) = surface_for(&mechanism, &real, settings.load_n)?;
    let rods = rods_of(&mechanism, settings, &surface);
    let strings = Strings::new(mechanism.parameters(), settings);
    Ok((hung(scene, surface, strings, rods, settings)?, mechanism, tier))
}

/// The load hung from measured gaps. Its strings are the scene's where the data do not tell: their slow stretch, and the
/// law by which a radius acts as a twist.
pub(super) fn measured(scene: &Scene, data: &Measured, settings: &PlantSettings) -> Result<BuiltIn, RigError> {
    let mechanism = Mechanism::new(&scene.geometry, &scene.string, &scene.material)?;
    let max_n = data.max_load_n();
    if settings.load_n > max_n {
        return Err(RigError::Load { load_n: settings.load_n, max_n });
    }
    let surface = Surface::new(|twist_rad, load_n| data.gap(twist_rad, load_n), max_n, max_twist_rad(scene))?;
    // The exponent of the radius model is that of the data.
    let own = PlantSettings { twist_exponent_shift: 0.0, ..settings.clone() };
    let strings = Strings::new(mechanism.parameters(), &own);
    let two_ways = TwoWays::new(data, strings.twist_rad);
    let mut plant = hung(scene, surface, strings, None, &own)?;
    plant.two_ways = two_ways;
    Ok(plant)
}

/// The load hung from a surface, at the twist of the start.
fn hung(
    scene: &Scene,
    surface: Surface,
    strings: Strings,
    rods: Option<Rods>,
    settings: &PlantSettings,
) -> Result<BuiltIn, RigError> {
    let (load_n, twist_rad) = (settings.load_n, settings.twist_at_boot_rad);
    let max_rad = (10.0 * (surface.last_twist_rad(load_n) + CLOSED_GIVE_RAD)).floor() / 10.0;
    if twist_rad.abs() > max_rad {
        return Err(RigError::Twist { twist_rad, load_n, max_rad });
    }
    Ok(BuiltIn::new(surface, stops_of(&scene.rig), strings, rods, settings))
}

/// Maximum twist of the surface, rad.
fn max_twist_rad(scene: &Scene) -> f64 {
    let turns = scene.envelope.map_or(0.0, |envelope| envelope.turns[1] + TURNS_BEYOND);
    twist_from_turns(turns.max(SURFACE_TURNS))
}

/// The widest surface that the mechanism allows, by the cheapest model that the scene allows: rods at their strain
/// limit end it early in some scenes, and a cheaper model may not reach beyond the envelope.
fn surface_for(mechanism: &Mechanism, scene: &Scene, load_n: f64) -> Result<(Surface, Tier), RigError> {
    let envelope_n = scene.envelope.map_or(0.0, |envelope| envelope.load_n[1]);
    let mut max_n = SURFACE_LOAD_N.max(2.5 * load_n).max(2.5 * envelope_n);
    let max_twist_rad = max_twist_rad(scene);
    let tier = cheapest_tier(mechanism, scene);
    let cheap = |twist_rad: f64, load_n: f64| {
        mechanism.solve_tier(tier, load_n, twist_rad).ok().map(|found| point(&found.equilibrium, twist_rad))
    };
    if tier != Tier::Full
        && let Ok(surface) = Surface::new(cheap, max_n, max_twist_rad)
    {
        return Ok((surface, tier));
    }
    let exact = |twist_rad: f64, load_n: f64| mechanism.solve(load_n, twist_rad).ok().map(|e| point(&e, twist_rad));
    let surface = loop {
        match Surface::new(exact, max_n, max_twist_rad) {
            Ok(surface) => break surface,
            Err(error) if max_n < 2.0 * SLACK_LOAD_N => return Err(error.into()),
            Err(_) => max_n *= 0.85,
        }
    };
    if load_n > max_n {
        return Err(RigError::Load { load_n, max_n });
    }
    Ok((surface, Tier::Full))
}

fn point(solved: &Equilibrium, twist_rad: f64) -> GapPoint {
    GapPoint {
        gap_m: solved.gap_m,
        by_twist_m_per_rad: if twist_rad == 0.0 { 0.0 } else { solved.dgap_dtwist_m_per_rad },
        by_load_m_per_n: solved.dgap_dload_m_per_n,
    }
}

/// The cheapest model whose own error estimate is good enough for the scene, everywhere in its envelope; the full one
/// where the scene requires no accuracy.
fn cheapest_tier(mechanism: &Mechanism, scene: &Scene) -> Tier {
    let Ok((envelope, accuracy)) = scene.table_requirement() else { return Tier::Full };
    let part = |k: u32| f64::from(k) / f64::from(ASKED - 1);
    let [f0, f1] = envelope.load_n;
    let [t0, t1] = envelope.turns;
    let states: Vec<(f64, f64)> = (0..ASKED)
        .flat_map(|i| {
            (0..ASKED).map(move |j| (f0 * (f1 / f0).powf(part(i)), twist_from_turns(t0 + (t1 - t0) * part(j))))
        })
        .collect();
    let good = |e: &TierError| {
        BETTER * e.contraction_m <= accuracy.contraction_m && BETTER * e.tr_relative <= accuracy.tr_relative
    };
    let serves = |tier: &Tier| {
        states.iter().all(|(load, twist)| mechanism.solve_tier(*tier, *load, *twist).is_ok_and(|t| good(&t.error)))
    };
    Tier::ALL.into_iter().find(serves).unwrap_or(Tier::Full)
}
