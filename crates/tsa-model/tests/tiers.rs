//! Each tier's estimate of its own error against the full tier, over the envelope of every scene.

use rig_config::Scene;
use tsa_model::{Tier, TierError, twist_from_turns};

fn scenes() -> Vec<(String, Scene)> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut scenes: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .map(|path| (path.file_stem().unwrap().to_string_lossy().into_owned(), Scene::load(&path).unwrap()))
        .collect();
    scenes.sort_by(|a, b| a.0.cmp(&b.0));
    assert!(scenes.len() >= 5);
    scenes
}

/// Loads and turns over the scene's envelope from 1 N on, or over the published range.
fn states(scene: &Scene) -> Vec<(f64, f64)> {
    let [f0, f1] = scene.envelope.map_or([1.0, 17.0], |e| [e.load_n[0].max(1.0), e.load_n[1].min(17.0)]);
    let turns = scene.envelope.map_or(7.5, |e| e.turns[1]);
    let part = |k: u32| f64::from(k) / 15.0;
    (0..16).flat_map(|i| (0..16).map(move |j| (f0 * (f1 / f0).powf(part(i)), turns * part(j)))).collect()
}

#[test]
fn every_estimate_holds() {
    for (name, scene) in scenes() {
        let m = scene.mechanism().unwrap();
        for tier in Tier::ALL {
            let (mut worst, mut worst_tr, mut loosest) = (0.0f64, 0.0f64, 0.0f64);
            for (load, turns) in states(&scene) {
                let twist = twist_from_turns(turns);
                let full = m.solve_tier(Tier::Full, load, twist).unwrap();
                let Ok(t) = m.solve_tier(tier, load, twist) else {
                    // Only the beam-column has an end, and only near buckling.
                    assert!(tier == Tier::BeamColumn && load > 10.0, "{name} {} {load} N {turns}", tier.name());
                    continue;
                };
                let error = (t.contraction_m() - full.contraction_m()).abs();
                let tr = (t.equilibrium.tr_rad_per_m() / full.equilibrium.tr_rad_per_m() - 1.0).abs();
                if tier == Tier::Full {
                    assert_eq!((error, tr, t.error), (0.0, 0.0, TierError::default()));
                    continue;
                }
                // A first-order estimate of a gross error is only a warning.
                let trusted = t.error.tr_relative < 0.05;
                if trusted {
                    worst = worst.max(error / t.error.contraction_m.max(1e-12));
                    worst_tr = worst_tr.max(tr / t.error.tr_relative);
                } else {
                    assert!(error > 1e-5 || tr > 2e-3, "{name} {} {load} N {turns}: cries wolf", tier.name());
                }
                if error > 2e-5 && trusted {
                    loosest = loosest.max(t.error.contraction_m / error);
                }
            }
            println!("{name} {}: error/estimate {worst:.2}, TR {worst_tr:.2}; loosest {loosest:.1}", tier.name());
            assert!(worst <= 1.0 && worst_tr <= 1.0, "{name} {}: {worst} {worst_tr}", tier.name());
        }
    }
}

#[test]
fn auto_takes_the_cheapest_that_is_good_enough_and_is() {
    for (name, scene) in scenes() {
        let m = scene.mechanism().unwrap();
        let mut last = [0usize; 6];
        for (wanted_m, wanted_tr) in [(1e-3, 0.2), (1e-4, 0.02), (2.4e-5, 0.005), (5e-6, 0.002), (1e-7, 1e-5)] {
            let wanted = TierError { contraction_m: wanted_m, tr_relative: wanted_tr };
            let mut taken = [0usize; 6];
            for (load, turns) in states(&scene) {
                let twist = twist_from_turns(turns);
                let full = m.solve_tier(Tier::Full, load, twist).unwrap();
                let t = m.solve_auto(load, twist, wanted).unwrap();
                let error = (t.contraction_m() - full.contraction_m()).abs();
                assert!(error <= wanted_m, "{name} {} {load} N {turns}: {error} m", t.tier.name());
                let tr = (t.equilibrium.tr_rad_per_m() / full.equilibrium.tr_rad_per_m() - 1.0).abs();
                assert!(tr <= wanted_tr, "{name} {} {load} N {turns}: TR {tr}", t.tier.name());
                taken[Tier::ALL.iter().position(|x| *x == t.tier).unwrap()] += 1;
            }
            println!("{name} {wanted_m} m, TR {wanted_tr}: {taken:?}");
            // A tighter demand never takes a cheaper tier.
            for k in 1..=6 {
                let cheap = |counts: &[usize; 6]| counts[..k].iter().sum::<usize>();
                assert!(last == [0; 6] || cheap(&taken) <= cheap(&last), "{name}: {taken:?} after {last:?}");
            }
            last = taken;
        }
        // Only the full model is accurate to a tenth of a micrometre everywhere, unless the rods hardly bend.
        assert!(last[5] > if name == "finger" { 20 } else { 100 }, "{name}: {last:?}");
    }
}
