//! A table rebuilt from other constants, by the code that the board runs.

use rig_config::Scene;
use std::sync::OnceLock;
use tsa_model::{Correction, Mechanism, Parameters};
use tsa_table::fit::Fit;
use tsa_table::rebuild::{Rebuild, RebuildError, Rebuilt};
use tsa_table::{ArcSeries, Shape, Table, Uncertainty};

/// How well the constants of the rebuilt tables are known.
const KNOWN: Uncertainty = Uncertainty { radius: 0.004, gap_zero_m: 1e-4, load_shape: 0.02, rod_memory: 0.1 };

/// What sweeps at 2 to 15 N left of a hard rig.
const MEASURED: Correction = Correction {
    load_n: [2.0, 15.0],
    turns: [0.0, 7.5],
    coefficients_m: [[3e-5, 6e-5, -3e-5], [3e-5, -3e-5, 1e-5], [2e-5, 1e-5, 0.0]],
};

/// More powers of the twist, and more of the load.
const SPARES: &[Shape] = &[Shape::of(4, 9).unwrap(), Shape::of(6, 7).unwrap()];

fn default_fit() -> &'static (Scene, Fit) {
    static FIT: OnceLock<(Scene, Fit)> = OnceLock::new();
    FIT.get_or_init(|| {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/default.toml");
        let scene = Scene::load(root).unwrap();
        let fit = scene.fit_table().unwrap();
        (scene, fit)
    })
}

/// The scene's constants, changed.
fn parameters(change: impl Fn(&mut Parameters)) -> Parameters {
    let mut p = *default_fit().0.mechanism().unwrap().parameters();
    change(&mut p);
    p
}

fn rebuilt(p: &Parameters, tolerance: [f32; 2]) -> Result<(Rebuilt, u32), RebuildError> {
    let table = default_fit().1.table.table();
    let mut rebuild = Rebuild::new(&table, p, 0x1234_5678, KNOWN, tolerance, SPARES)?;
    loop {
        if let Some(done) = rebuild.step()? {
            let done = done.clone();
            return Ok((done, rebuild.states()));
        }
    }
}

#[test]
fn a_rebuilt_table_is_as_good_as_the_generators() {
    type Change = fn(&mut Parameters);
    let changes: [(&str, Change); 5] = [
        ("the same", |_| {}),
        ("stiffer rods", |p| p.stress_coefficients_pa = p.stress_coefficients_pa.map(|a| 1.1 * a)),
        ("thicker strings", |p| p.k2 *= 1.1),
        ("softer strings", |p| (p.stiffness_n_per_m, p.k1_per_n) = (0.9 * p.stiffness_n_per_m, 0.9 * p.k1_per_n)),
        ("a measured correction", |p| p.correction = Some(MEASURED)),
    ];
    for (name, change) in changes {
        let p = parameters(change);
        let (new, states) = rebuilt(&p, [5e-6, 2e-3]).unwrap();
        let table = new.table();
        assert!(table.is_intact());
        let mechanism = Mechanism::of(p);
        let m = table.metadata;
        let (mut contraction, mut tr) = (0f32, 0f32);
        for i in 0..60 {
            let load = m.load_min_n * (m.load_max_n / m.load_min_n).powf((i as f32 + 0.5) / 60.0);
            let gap = |twist: f32| mechanism.solve(f64::from(load), f64::from(twist)).unwrap();
            let start = (gap(m.twist_min_rad).gap_m, table.look_up(load, m.twist_min_rad).unwrap().gap_m);
            for j in 0..60 {
                let twist = m.twist_min_rad + (m.twist_max_rad - m.twist_min_rad) * (j as f32 + 0.5) / 60.0;
                let (exact, at) = (gap(twist), table.look_up(load, twist).unwrap());
                let error = f64::from(start.1 - at.gap_m) - (start.0 - exact.gap_m);
                contraction = contraction.max(error.abs() as f32);
                tr = tr.max((exact.dgap_dtwist_m_per_rad as f32 / at.dgap_dtwist_m_per_rad - 1.0).abs());
            }
        }
        println!(
            "{name}: {states} states, contraction {contraction:.2e} ({:.2e} claimed), TR {tr:.2e} ({:.2e} claimed)",
            m.contraction_error_m, m.tr_relative_error
        );
        // Each range is fitted at three loads more than it has powers of it, and at twice as many twists; then follow the
        // states of the two checks.
        let series = table.series;
        if series.shape == default_fit().1.table.table().series.shape {
            let [rows, columns] = [series.shape.rows, series.shape.columns].map(u32::from);
            assert_eq!(states, series.patches.len() as u32 * (rows + 3) * 2 * columns + 24 * 14 + 8 * 5, "{name}");
        }
        // The board checks few points, but they find almost the worst error.
        assert!(contraction <= 5e-6 && tr <= 2e-3, "{name}");
        assert!(contraction <= 1.5 * m.contraction_error_m && tr <= 1.5 * m.tr_relative_error, "{name}");
    }
}

#[test]
fn a_stored_table_is_read_back_intact_or_refused() {
    let like = default_fit().1.table.table();
    let (new, _) = rebuilt(&parameters(|p| p.k2 *= 1.05), [5e-6, 2e-3]).unwrap();
    let mut bytes = [0u8; 2048];
    let length = new.write(&mut bytes).unwrap();
    let back = Rebuilt::read(&like, SPARES, &bytes[..length]).unwrap();
    assert_eq!(back.table().crc, new.table().crc);
    assert_eq!(back.metadata.uncertainty, KNOWN);
    assert_eq!(back.table().look_up(5.0, 20.0), new.table().look_up(5.0, 20.0));
    assert!(new.write(&mut [0; 100]).is_none());
    for cut in 0..length {
        assert!(Rebuilt::read(&like, SPARES, &bytes[..cut]).is_none());
    }
    for bit in 0..8 * length {
        // The fourth byte is not used.
        if bit / 8 == 3 {
            continue;
        }
        let mut broken = bytes;
        broken[bit / 8] ^= 1 << (bit % 8);
        assert!(Rebuilt::read(&like, SPARES, &broken[..length]).is_none(), "bit {bit}");
    }
}

#[test]
fn constants_without_a_table_are_refused_by_name() {
    let worse = rebuilt(&parameters(|_| {}), [1e-7, 2e-3]).unwrap_err();
    assert!(matches!(worse, RebuildError::Accuracy { contraction_m, .. } if contraction_m > 1e-7), "{worse}");
    // Strings so thick that light loads have no equilibrium in a part of the envelope.
    let p = parameters(|p| p.diameter_m *= 1.3);
    let thick = rebuilt(&p, [5e-6, 2e-3]).unwrap_err();
    let RebuildError::Model { load_n, twist_rad, kind } = thick else { panic!("{thick}") };
    let solved = Mechanism::of(p).solve(f64::from(load_n), f64::from(twist_rad));
    assert_eq!(solved.unwrap_err().kind(), kind, "{thick}");
    let nan = rebuilt(&parameters(|p| p.k2 = f64::NAN), [5e-6, 2e-3]);
    assert!(nan.is_err(), "NaN gave a table");
    let table = default_fit().1.table.table();
    let many = [table.series.patches[0]; 9];
    let too_large = Table { series: ArcSeries { patches: &many, ..table.series }, ..table };
    let refused = Rebuild::new(&too_large, &parameters(|_| {}), 1, KNOWN, [5e-6, 2e-3], &[]).err();
    assert_eq!(refused, Some(RebuildError::Form));
}
