//! Writes the tables that the image compares as Rust: the default scene's own, the best of every other form, and a grid
//! for `interpn`.

use rig_config::Scene;
use std::error::Error;
use std::path::PathBuf;
use std::{env, fs};
use table_forms::considered::peers;

const SCENE: &str = "../../scenes/default.toml";
/// All of the RAM for one stack: collocation takes more stack than the firmware's layout has.
const MEMORY: &str =
    "MEMORY {\n  FLASH : ORIGIN = 0x08000000, LENGTH = 512K\n  RAM : ORIGIN = 0x20000000, LENGTH = 128K\n}\n";

fn main() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    println!("cargo:rerun-if-changed={SCENE}");
    fs::write(out.join("tables.rs"), source(&Scene::load(SCENE)?)?)?;
    fs::write(out.join("memory.x"), MEMORY)?;
    println!("cargo:rustc-link-search={}", out.display());
    Ok(())
}

fn source(scene: &Scene) -> Result<String, Box<dyn Error>> {
    let (mechanism, table_spec, fit) = (scene.mechanism()?, scene.table_spec()?, scene.fit_table()?);
    let parameters = format!("tsa_model::{:?}", mechanism.parameters());
    let parameters = parameters.replace("radius_law: ", "radius_law: tsa_model::RadiusLaw::");
    let parameters = parameters.replace("Some(Correction", "Some(tsa_model::Correction");
    let mut source = tsa_table::emit::rust_source(&fit);
    source += &format!("/// The scene's constants.\npub const PARAMETERS: tsa_model::Parameters = {parameters};\n");
    for (name, peer) in peers(&mechanism, &table_spec, &fit)? {
        source += &peer.rust_source(name);
    }
    #[cfg(feature = "interpn")]
    {
        source += &interpn_grid(&mechanism, &fit.table.metadata, table_spec.accuracy.contraction_m)?;
    }
    Ok(source)
}

#[cfg(feature = "interpn")]
/// The smallest grid in F^(−1/2) and twist on which `interpn`'s cubic interpolation reaches the scene's accuracy of the
/// contraction. It has no gradient.
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
