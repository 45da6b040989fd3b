//! The rods of the stability map. The map is about methods, not about the operator's scene: the same rods everywhere.

use anyhow::Result;
use rig_config::Scene;
use tsa_model::Mechanism;

const PAPER: &str = include_str!("../../../scenes/paper-identified.toml");
const PLATEAU: &str = include_str!("../../../scenes/niti-plateau.toml");

/// A rod of the map; everything else is as in its scene.
#[derive(Debug)]
pub struct RodCase {
    /// Its name.
    pub title: &'static str,
    scene: &'static str,
    /// D0 (m).
    pub rod_span_m: f64,
    /// R (m).
    pub rod_radius_m: f64,
}

/// From stout to slender; the second has a plateau.
pub const RODS: [RodCase; 4] = [
    RodCase { title: "paper's rod", scene: PAPER, rod_span_m: 0.032, rod_radius_m: 0.0005 },
    RodCase { title: "flat plateau", scene: PLATEAU, rod_span_m: 0.040, rod_radius_m: 0.0004 },
    RodCase { title: "slender", scene: PAPER, rod_span_m: 0.060, rod_radius_m: 0.0003 },
    RodCase { title: "more slender", scene: PAPER, rod_span_m: 0.080, rod_radius_m: 0.0003 },
];

impl RodCase {
    /// The mechanism with this rod.
    ///
    /// # Errors
    /// If the scene cannot have this rod.
    pub fn mechanism(&self) -> Result<Mechanism> {
        let mut scene = Scene::from_toml_str(self.scene)?;
        (scene.geometry.rod_span_m, scene.geometry.rod_radius_m) = (self.rod_span_m, self.rod_radius_m);
        Ok(scene.mechanism()?)
    }

    /// Free length over radius.
    pub fn slenderness(&self) -> f64 {
        0.5 * (self.rod_span_m - 0.006) / self.rod_radius_m
    }
}
