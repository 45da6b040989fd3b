//! What `src/bin/cost.rs` compares the table with.

use rig_scene::Scene;
use std::error::Error;

/// The best table of every other form, and a grid of `interpn`'s.
pub fn source(scene: &Scene, fit: &tsa_table::fit::Fit) -> Result<String, Box<dyn Error>> {
    let mut source = String::new();
    for (name, best) in tsa_table::fit::peers(fit) {
        let doc = format!(
            "{}, {} bytes, contraction within {:.2e} m, TR within {:.2e} on the selection grid.",
            best.table.numbers.size(),
            best.table.numbers.form().bytes(),
            best.errors.contraction_max_m,
            best.errors.tr_max
        );
        source += &tsa_table::emit::table_source(name, &doc, &best.table);
    }
    let mechanism = scene.mechanism()?;
    source += &interpn_grid(&mechanism, &fit.table.metadata, scene.table_demand()?.1.contraction_m)?;
    Ok(source)
}

/// The smallest grid in F^(−1/2) and twist on which `interpn`'s cubic interpolation gives the contraction as well as the
/// scene asks; it has no gradient.
fn interpn_grid(
    mechanism: &tsa_model::Mechanism,
    m: &tsa_table::Metadata,
    contraction_m: f64,
) -> Result<String, Box<dyn Error>> {
    let [u0, u1] = [m.load_max_n, m.load_min_n].map(|f| 1.0 / f.sqrt());
    let [t0, t1] = [m.twist_min_rad, m.twist_max_rad];
    let gap = |u: f32, t: f32| {
        let load = (1.0 / (f64::from(u) * f64::from(u))).clamp(f64::from(m.load_min_n), f64::from(m.load_max_n));
        mechanism.solve(load, f64::from(t)).map(|e| e.gap_m)
    };
    let checked = |k: usize, n: usize, a: f32, b: f32| a + (b - a) * (k as f32 + 0.37) / (n as f32 + 0.74);
    let mut exact = Vec::new();
    for i in 0..23 {
        let u = checked(i, 22, u0, u1);
        let start = gap(u, t0)?;
        for j in 0..41 {
            let t = checked(j, 40, t0, t1);
            exact.push((u, t, start, start - gap(u, t)?));
        }
    }
    let mut sizes: Vec<[usize; 2]> = (1..=16).flat_map(|n| (1..=16).map(move |m| [4 * n, 4 * m])).collect();
    sizes.sort_by_key(|[a, b]| a * b);
    let mut left = f64::INFINITY;
    for dims in sizes {
        let steps = [(u1 - u0) / (dims[0] - 1) as f32, (t1 - t0) / (dims[1] - 1) as f32];
        let mut values = Vec::with_capacity(dims[0] * dims[1]);
        for i in 0..dims[0] {
            for j in 0..dims[1] {
                values.push(gap(u0 + steps[0] * i as f32, (t0 + steps[1] * j as f32).min(t1))? as f32);
            }
        }
        let grid = interpn::MulticubicRegular::<f32, 2>::new(dims, [u0, t0], steps, &values, false)?;
        let mut worst = 0f64;
        for (u, t, _, contraction) in &exact {
            let found = f64::from(grid.interp_one([*u, t0])?) - f64::from(grid.interp_one([*u, *t])?);
            worst = worst.max((found - contraction).abs());
        }
        left = left.min(worst);
        if worst <= contraction_m {
            let list = |values: &[f32]| {
                values.iter().map(|v| format!("f32::from_bits({})", v.to_bits())).collect::<Vec<_>>().join(", ")
            };
            return Ok(format!(
                "/// Cubic grid, {} bytes, contraction within {worst:.2e} m.\n\
                 pub static INTERPN: [f32; {}] = [{}];\n\
                 pub const INTERPN_DIMS: [usize; 2] = {dims:?};\n\
                 pub const INTERPN_STARTS: [f32; 2] = [{}];\n\
                 pub const INTERPN_STEPS: [f32; 2] = [{}];\n",
                4 * values.len(),
                values.len(),
                list(&values),
                list(&[u0, t0]),
                list(&steps)
            ));
        }
    }
    Err(format!("no grid of interpn reaches {contraction_m} m; {left:.2e} m left").into())
}
