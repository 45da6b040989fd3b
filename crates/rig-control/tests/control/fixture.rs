//! A load that hangs on the default scene's mechanism, as the code that controls it sees it in one tick.

use rig_config::Scene;
use rig_control::RigConstants;
use rig_control::homing::load_estimate::MIN_GAP_ERROR_M;
use rig_control::load_motion::LoadMotion;
use rig_control::load_state::LoadState;
use rig_control::mechanism::Mechanism;
use rig_control::observer::Observation;
use rig_link::messages::{GapCurve, HomingResult};
use std::path::Path;
use std::sync::OnceLock;
use tsa_table::Table;
use tsa_table::owned::OwnedTable;

/// Two numbers are the same, within an error.
#[track_caller]
pub fn near(found: f32, expected: f32, error: f32) {
    assert!((found - expected).abs() <= error, "{found} instead of {expected}, within {error}");
}

fn scene() -> &'static Scene {
    static SCENE: OnceLock<Scene> = OnceLock::new();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/default.toml");
    SCENE.get_or_init(|| Scene::load(path).expect("the default scene is good"))
}

/// The table of the default scene.
pub fn table() -> &'static Table<'static> {
    static OWNED: OnceLock<OwnedTable> = OnceLock::new();
    static TABLE: OnceLock<Table<'static>> = OnceLock::new();
    TABLE.get_or_init(|| OWNED.get_or_init(|| scene().fit_table().expect("it has a table").table).table())
}

/// The constants of the default scene's rig.
pub fn constants() -> RigConstants {
    scene().constants()
}

/// What homing finds on a rig like its own model, on a rail without friction.
pub const HOMED: HomingResult = HomingResult {
    zero_error_rad: 0.0,
    load_n: 5.0,
    load_error_n: 0.25,
    friction_n: 0.0,
    reference_gap_m: 0.095,
    gap_noise_m: MIN_GAP_ERROR_M,
    jump_m: 0.0,
    twist_scale: 1.0,
    curve: GapCurve::constant(0.0),
    covariance: [1e-6, 0.0, 0.0, 0.0, 0.0, 0.0],
    drive_lag_s: 0.01,
};

/// A load (N) at rest at position 0 with the strings at a twist (rad), on a rail with a friction (N), last moved upwards.
pub fn hanging(load_n: f32, friction_n: f32, twist_rad: f32) -> LoadState<'static> {
    let mechanism = Mechanism { table: *table(), twist_scale: 1.0, curve: GapCurve::constant(0.0) };
    let pull_n = load_n + friction_n;
    let point = mechanism.at(pull_n, twist_rad);
    let motion = LoadMotion::at_rest(&mechanism, point.gap_m, twist_rad, pull_n);
    let observation = Observation {
        mechanism_load_n: load_n,
        pull_n,
        shown_n: load_n,
        point,
        moved_m: 0.0,
        at_range_end: false,
        load_error_n: 0.1,
        friction_n,
        changing: false,
        confirmed: true,
    };
    LoadState {
        mechanism,
        observation,
        position_m: 0.0,
        motion,
        twist_rad,
        found: Box::leak(Box::new(HomingResult { load_n, friction_n, reference_gap_m: point.gap_m, ..HOMED })),
        rig: Box::leak(Box::new(constants())),
    }
}
