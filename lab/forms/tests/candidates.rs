//! The other forms on real scenes.

use rig_config::Scene;
use table_forms::fit::{Candidate, candidates};
use table_forms::{Form, LoadMap};

fn candidates_of(scene: &str) -> Vec<Candidate> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let scene = Scene::load(folder.join(format!("{scene}.toml"))).unwrap();
    candidates(&scene.mechanism().unwrap(), &scene.table_spec().unwrap()).unwrap()
}

#[test]
fn every_smooth_form_agrees_with_its_own_gradient() {
    for c in candidates_of("default") {
        let table = c.table.table();
        if matches!(table.form, Form::Bilinear { .. }) || table.load_map == LoadMap::InverseRoot {
            continue; // A bilinear patch has no gradient across its edges; the maps differ only by a chain rule.
        }
        for (load, twist) in [(0.9f32, 5.0f32), (4.0, 20.0), (13.0, 44.0)] {
            let p = table.point_inside(load, twist);
            let gap = |load: f32, twist: f32| table.point_inside(load, twist).gap_m;
            let (df, dt) = (0.02 * load, 0.1);
            let by_load = (gap(load + df, twist) - gap(load - df, twist)) / (2.0 * df);
            let by_twist = (gap(load, twist + dt) - gap(load, twist - dt)) / (2.0 * dt);
            let name = table.form.name();
            assert!((p.dgap_dload_m_per_n / by_load - 1.0).abs() < 0.01, "{name} {load} {twist}");
            assert!((p.dgap_dtwist_m_per_rad / by_twist - 1.0).abs() < 0.01, "{name} {load} {twist}");
        }
    }
}

/// No global polynomial follows the plateau of the stress–strain law.
#[test]
fn no_global_polynomial_is_accurate_enough_for_the_plateau_rod() {
    let all = candidates_of("niti-plateau");
    let series: Vec<_> = all.iter().filter(|c| matches!(c.table.form, Form::Series { .. })).collect();
    assert!(!series.is_empty() && series.iter().all(|c| !c.passes));
}
