//! Scene file to firmware: solves the model, fits and certifies the table, writes it and the rig's constants as Rust.

use std::error::Error;
use std::path::PathBuf;
use std::process::Command;
use std::{env, fs};
use tsa_model::Scene;
use tsa_model::scene::Rig;

fn main() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let scene_path = env::var("TSA_SCENE").unwrap_or_else(|_| "scenes/default.toml".into());
    println!("cargo:rerun-if-env-changed=TSA_SCENE");
    println!("cargo:rerun-if-changed={scene_path}");
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rerun-if-changed=.git/HEAD");

    let scene = Scene::load(&scene_path)?;
    let fit = tsa_table::fit::fit(&scene)?;
    let mut source = tsa_table::emit::rust_source(&fit);
    source.push_str(&constants(&scene.rig));
    fs::write(out.join("scene.rs"), source)?;
    if env::var_os("CARGO_FEATURE_COST").is_some() {
        fs::write(out.join("peers.rs"), peers(&scene, &fit)?)?;
    }

    fs::write(out.join("memory.x"), include_str!("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-env=TSA_GIT={}", git().unwrap_or_else(|| "unknown".into()));
    Ok(())
}

fn constants(rig: &Rig) -> String {
    format!(
        "/// The rig's numbers, from the scene's `[rig]`.\n\
         pub const RIG: rig_control::RigConstants = rig_control::RigConstants {{\n\
         \x20   gear_ratio: {:?}f32, counts_per_rad: {:?}f32,\n\
         \x20   motor_speed_max_rad_per_s: {:?}f32, motor_acceleration_max_rad_per_s2: {:?}f32,\n\
         \x20   motor_torque_constant_nm_per_a: {:?}f32, current_limit_ma: {},\n\
         \x20   lvdt_gap_at_code_zero_m: {:?}f32, lvdt_metres_per_code: {:?}f32,\n\
         \x20   drive_group: {}, drive_number: {},\n\
         }};\n",
        rig.gear() as f32,
        rig.counts_per_rad() as f32,
        rig.motor_speed_max_rad_per_s as f32,
        rig.motor_acceleration_max_rad_per_s2 as f32,
        rig.motor_torque_constant_nm_per_a as f32,
        rig.drive_current_limit_ma(),
        rig.lvdt_gap_at_code_zero_m() as f32,
        rig.lvdt_metres_per_code() as f32,
        rig.drive_group,
        rig.drive_number,
    )
}

/// What `src/bin/cost.rs` compares the table with: the best of every other form, and the solver's constants.
fn peers(scene: &Scene, fit: &tsa_table::fit::Fit) -> Result<String, Box<dyn Error>> {
    let mut source = String::new();
    for (name, kind) in [("SERIES", "chebyshev-series"), ("HERMITE", "hermite-bicubic"), ("BILINEAR", "bilinear")] {
        let of_kind = fit.candidates.iter().filter(|c| c.table.numbers.kind() == kind);
        let best = of_kind.min_by(|a, b| {
            a.passes.cmp(&b.passes).reverse().then(a.errors.contraction_max_m.total_cmp(&b.errors.contraction_max_m))
        });
        let best = best.ok_or("a form is missing among the candidates")?;
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
    source += &format!("pub const PARAMETERS: tsa_model::Parameters = tsa_model::{:?};\n", mechanism.parameters())
        .replace("radius_law: ", "radius_law: tsa_model::RadiusLaw::");
    Ok(source)
}

/// Short commit, with `-dirty` if the tree had changes; `None` outside a checkout.
fn git() -> Option<String> {
    let run = |args: &[&str]| {
        let output = Command::new("git").args(args).output().ok().filter(|o| o.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_string())
    };
    let commit = run(&["rev-parse", "--short=10", "HEAD"])?;
    let dirty = run(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|s| !s.is_empty());
    Some(if dirty { format!("{commit}-dirty") } else { commit })
}
