//! The scenarios of `scenarios/`: scripts that `rigctl play` plays on an emulated board or a real rig, read here for
//! the control code alone.

use crate::root;
use anyhow::{Context, Result, anyhow};
use rig_control::TICK_S;
use rig_link::messages::Request;
use rig_plant::{PlantChange, PlantKey, PlantSettings};
use rigctl::script::{Action, Script};

/// Every script of the folder by its name without the ending, in alphabetical order.
///
/// # Errors
/// Naming the file that cannot be read, or is no script.
pub fn scripts() -> Result<Vec<(String, Script)>> {
    let folder = root().join("scenarios");
    let mut found = Vec::new();
    for entry in std::fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "script") {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
            found.push((name.clone(), Script::parse_in(&folder, &text).map_err(anyhow::Error::msg).context(name)?));
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(found)
}

/// One move of the load, and what happens to the rig until the next.
#[derive(Clone, Debug)]
pub struct Move {
    /// What is asked of the controller.
    pub request: Request,
    /// Where to (m).
    pub target_m: f32,
    /// How fast (m/s).
    pub speed_m_per_s: f32,
    /// Ticks until the next move, or the end.
    pub ticks: usize,
    /// Changes of the plant, with the tick that they come before.
    pub changes: Vec<(usize, PlantChange)>,
}

/// Moves of a rig that has been homed.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// The script's name.
    pub name: String,
    /// The load at boot (N).
    pub load_n: f64,
    /// The moves. The first follows homing at once: there is nothing to see while the script waits for it.
    pub moves: Vec<Move>,
}

impl Scenario {
    /// From a script that hangs a load on, homes and moves, and does nothing else.
    ///
    /// # Errors
    /// Naming the line that is something else.
    pub fn new(name: &str, script: &Script) -> Result<Self> {
        let mut scenario = Self { name: name.into(), load_n: PlantSettings::default().load_n, moves: Vec::new() };
        let mut homes = false;
        let mut starts_s: Vec<f64> = Vec::new();
        let ticks = |seconds: f64| (seconds / f64::from(TICK_S)).round() as usize;
        for event in &script.events {
            let fail = |what: &str| anyhow!("{name}, line {}: {what}", event.line);
            match (&event.action, starts_s.last()) {
                (Action::Plant(PlantChange { key: PlantKey::Load, value }), None) if event.t_s == 0.0 => {
                    scenario.load_n = *value;
                }
                (Action::Plant(change), Some(start_s)) => {
                    let change = (ticks(event.t_s - start_s), *change);
                    scenario.moves.last_mut().ok_or_else(|| fail("comes before any move"))?.changes.push(change);
                }
                (Action::Command(Request::Home { .. }), None) if !homes => homes = true,
                (Action::Command(request @ Request::Move { target_m, speed_m_per_s, .. }), _) if homes => {
                    let (request, target_m, speed_m_per_s) = (*request, *target_m, *speed_m_per_s);
                    scenario.moves.push(Move { request, target_m, speed_m_per_s, ticks: 0, changes: Vec::new() });
                    starts_s.push(event.t_s);
                }
                _ => return Err(fail("only the load at 0 s, one homing, moves and the plant during them")),
            }
        }
        let ends_s = starts_s.iter().skip(1).copied().chain([script.end_s]);
        for ((m, start_s), end_s) in scenario.moves.iter_mut().zip(&starts_s).zip(ends_s) {
            m.ticks = ticks(end_s - start_s);
        }
        Ok(scenario)
    }
}

/// The scenarios of the comparison, in order of load.
///
/// # Errors
/// Naming file and line.
pub fn comparison() -> Result<Vec<Scenario>> {
    scripts()?.iter().filter(|(name, _)| name.starts_with("compare-")).map(|(n, s)| Scenario::new(n, s)).collect()
}
