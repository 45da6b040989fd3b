//! Doors of the host tool: files, command lines, numbers of a Python program.

use super::with_file;
use clap::Parser;
use rig_config::Scene;
use rig_control::settings;
use rig_link::messages::{CorrectedConstants, Kept, Request};
use rig_link::{MAX_FRAME, encode};
use rig_plant::bench::{constants, scene, table};
use rigctl::batch::Query;
use rigctl::identify::compete::Candidate;
use rigctl::identify::laws::Law;
use rigctl::identify::{data::sweeps, identify, plausible};
use rigctl::trajectory::Trajectory;
use tsa_model::{Mechanism, twist_from_turns};

/// A mechanism answers with finite numbers, or refuses by name.
fn solve(mechanism: &Mechanism, load_n: f64, twist_rad: f64) {
    if let Ok(e) = mechanism.solve(load_n, twist_rad) {
        let numbers = [e.gap_m, e.dgap_dtwist_m_per_rad, e.dgap_dload_m_per_n, e.torque_nm];
        assert!(numbers.into_iter().all(f64::is_finite), "{load_n} N, {twist_rad} rad: {e:?}");
    }
}

/// A scene file, or a scene of a Python program (JSON): refused, or a mechanism that answers or refuses by name.
pub fn scene_file(data: &[u8]) {
    let Ok(text) = core::str::from_utf8(data) else { return };
    let json = || serde_json::from_str::<Scene>(text).ok().filter(|scene| scene.validate().is_ok());
    let Some(scene) = Scene::from_toml_str(text).ok().or_else(json) else { return };
    let _ = (scene.hash(), scene.table_requirement(), scene.check_rig());
    if let Ok(mechanism) = scene.mechanism() {
        for (load_n, twist_rad) in [(0.5, 3.2), (5.0, 20.0), (17.0, 50.0)] {
            solve(&mechanism, load_n, twist_rad);
        }
    }
}

/// A script.
pub fn script(data: &[u8]) {
    if let Ok(text) = core::str::from_utf8(data) {
        let _ = rigctl::script::Script::parse(text);
    }
}

/// Words on the command line, one a line.
pub fn command_line(data: &[u8]) {
    if let Ok(text) = core::str::from_utf8(data) {
        let _ = rigctl::cli::Cli::try_parse_from(["rigctl"].into_iter().chain(text.lines()));
    }
}

/// A recorded log or a file of loads and turns.
pub fn log(data: &[u8]) {
    if let Ok(text) = core::str::from_utf8(data)
        && let Ok(log) = rigctl::log::Log::parse(text)
    {
        let _ = rigctl::replay::replay(&log, scene(), table());
        let defaults = settings::defaults(&constants());
        if let Ok((values, _)) = log.settings(&defaults) {
            assert!(values.check(&defaults).is_ok(), "{values:?}");
        }
        let _ = log.constants();
    }
    with_file("log", data, |path| {
        let _ = rigctl::batch::read(path);
        let _ = sweeps(scene(), &[path], true);
    });
}

/// A file of measured equilibria, and what `rigctl identify` makes of it with one candidate. More rows only take longer.
pub fn identification(data: &[u8]) {
    // Without an envelope there is no table to be fitted, which takes longer than all else.
    let scene = Scene { envelope: None, accuracy: None, correction: None, ..scene().clone() };
    let Some(Ok(data)) = with_file("identify", data, |path| sweeps(&scene, &[path], true)) else { return };
    // As the command: a wrong unit is refused before a fit, which could take minutes.
    if data.rows.len() > 40 || plausible::checked(&data, &scene).is_err() {
        return;
    }
    let candidates = Candidate::all(&scene, Some(Law::of(&scene)), data.knows_its_zero());
    if let Ok(found) = identify(&scene, &data, &candidates[..1]) {
        assert!(found.scene.validate().is_ok());
        assert!(found.fit.estimates.iter().all(|e| e.unknown.is_finite() && e.standard_error.is_finite()));
        assert!(found.fit.correlations.iter().flatten().all(|c| c.is_finite()) && found.fit.held_out.rms.is_finite());
    }
}

/// Bytes that flash may hold as settings (witness, then record), the file of a backup, and a file of calibration points.
pub fn stored_settings(data: &[u8]) {
    let rig = constants();
    let defaults = settings::defaults(&rig);
    let (witness, record) = data.split_at(data.len().min(4));
    for (record, witness) in [(Some(record), Some(witness)), (Some(data), None), (None, Some(data))] {
        let loaded = settings::read(record, witness, &rig);
        assert!(loaded.values.check(&defaults).is_ok(), "{loaded:?}");
        assert!(matches!(loaded.kept, Kept::These | Kept::Partly) || loaded.values == defaults, "{loaded:?}");
        assert_eq!(loaded.kept == Kept::Partly, !loaded.dropped.is_empty(), "{loaded:?}");
        // What is used now is kept as it is.
        let again = settings::write(&loaded.values, &rig, loaded.generation);
        assert_eq!(settings::read(Some(&again), None, &rig).values, loaded.values);
    }
    if let Ok(text) = core::str::from_utf8(data)
        && let Ok(backup) = rigctl::backup::from_toml(text, &defaults)
    {
        assert!(backup.values.check(&defaults).is_ok(), "{backup:?}");
        let own = settings::corrected(&rig);
        let from = backup.constants.unwrap_or(CorrectedConstants { gear_ratio: 1.0, ..own });
        let (values, _) = backup.values.carried_over(&from, &own, &defaults, &defaults);
        assert!(values.check(&defaults).is_ok(), "{backup:?}");
    }
    with_file("points", data, |path| {
        if let Ok(curve) = rigctl::lvdt_points::load(path, &scene().rig, 20e-6) {
            assert_eq!(rigctl::lvdt_points::from_text(&rigctl::lvdt_points::text(&curve)), Ok(curve));
        }
    });
}

/// Every set-point of a trajectory can be sent, and its numbers are finite.
fn check_trajectory(trajectory: &Trajectory) {
    // The iterator is lazy: a long course is no problem of its own.
    for (t_s, request) in trajectory.set_points().take(1000) {
        let Request::Track { position_m, speed_m_per_s, for_s } = request else { panic!("{request:?}") };
        assert!(t_s.is_finite() && [position_m, speed_m_per_s, for_s].into_iter().all(f32::is_finite), "{request:?}");
        assert!(encode(1, &request, &mut [0; MAX_FRAME]).is_ok());
    }
}

/// A trajectory for `rigctl track`: refused, or one that can be streamed.
pub fn trajectory(data: &[u8]) {
    if let Ok(text) = core::str::from_utf8(data)
        && let Ok(trajectory) = Trajectory::parse(text)
    {
        check_trajectory(&trajectory);
    }
}

/// Numbers of any kind and lists of any length, as a Python program may pass them: a load and a number of turns, constants
/// of the scene (zero leaves one as it is), and the lists of a trajectory, whose lengths are in the first byte.
pub fn python(data: &[u8]) {
    let Some((lengths, data)) = data.split_first() else { return };
    let (numbers, _) = data.as_chunks();
    let numbers: Vec<f64> = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let third = numbers.len() / 3;
    let (times, rest) = numbers.split_at((third + usize::from(lengths & 3)).min(numbers.len()));
    let (positions, speeds) = rest.split_at((third + usize::from((lengths >> 2) & 3)).min(rest.len()));
    for speeds in [None, Some(speeds)] {
        if let Ok(trajectory) = Trajectory::new(times, positions, speeds) {
            check_trajectory(&trajectory);
        }
    }
    let &[load_n, turns, ref constants @ ..] = numbers.as_slice() else { return };
    let _ = rigctl::commands::lookup::look_up(table(), Query { load_n, turns });
    let mut scene = Scene { correction: None, ..scene().clone() };
    let places = [
        &mut scene.geometry.string_length_m,
        &mut scene.geometry.rod_span_m,
        &mut scene.geometry.clamp_width_m,
        &mut scene.geometry.rod_radius_m,
        &mut scene.string.diameter_m,
        &mut scene.string.stiffness_n_per_m,
        &mut scene.string.k1_per_n,
        &mut scene.string.k2,
        &mut scene.string.k3,
        &mut scene.material.stress_coefficients_pa[0],
        &mut scene.rig.lvdt_stroke_m,
    ];
    for (place, value) in places.into_iter().zip(constants).filter(|(_, value)| **value != 0.0) {
        *place = *value;
    }
    if scene.validate().is_ok()
        && let Ok(mechanism) = scene.mechanism()
    {
        solve(&mechanism, load_n, twist_from_turns(turns));
    }
}
