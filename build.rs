//! Scene file to firmware: solves the model, fits and certifies the table, writes it and the rig's constants as Rust.

use std::error::Error;
use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::{env, fs};
use tsa_model::scene::{Accuracy, DriveTransport, Rig};
use tsa_model::{Scene, Tier};

#[cfg(feature = "cost")]
#[path = "build/peers.rs"]
mod peers;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let scene_path = env::var("TSA_SCENE").unwrap_or_else(|_| "scenes/default.toml".into());
    println!("cargo:rerun-if-env-changed=TSA_SCENE");
    println!("cargo:rerun-if-changed={scene_path}");
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rerun-if-changed=.git/HEAD");

    let scene = Scene::load(&scene_path)?;
    let (tier, accuracy) = study()?.unwrap_or((Tier::Full, scene.accuracy));
    let fit = tsa_table::fit::fit_tier(&Scene { accuracy, ..scene.clone() }, tier)?;
    for unusual in scene.check_rig().map_err(|error| error.in_file(&scene_path))? {
        println!("cargo:warning=scene file {scene_path}: {unusual}");
    }
    let mut source = tsa_table::emit::rust_source(&fit);
    source.push_str(&constants(&scene.rig));
    source.push_str(&demand(&scene, &fit)?);
    source.push_str(&hashes(&scene));
    fs::write(out.join("scene.rs"), source)?;
    fs::write(out.join("parameters.rs"), parameters(&scene)?)?;
    #[cfg(feature = "cost")]
    fs::write(out.join("peers.rs"), peers::source(&scene, &fit)?)?;

    fs::write(out.join("memory.x"), include_str!("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-env=TSA_GIT={}", git().unwrap_or_else(|| "unknown".into()));
    Ok(())
}

/// A tier and the accuracy of the table's fit to it.
type Study = (Tier, Option<Accuracy>);

/// What `cargo xtask loop` wants to see the effect of: "tier contraction_m tr_relative" for the table instead of the full
/// model and the scene's accuracy.
fn study() -> Result<Option<Study>, Box<dyn Error>> {
    println!("cargo:rerun-if-env-changed=TSA_STUDY");
    let Ok(text) = env::var("TSA_STUDY") else { return Ok(None) };
    let [name, contraction, tr] = text.split(' ').collect::<Vec<_>>()[..] else {
        return Err(format!("TSA_STUDY: {text:?} is not a tier and two numbers").into());
    };
    let tier = Tier::named(name).ok_or_else(|| format!("TSA_STUDY: no tier is called {name:?}"))?;
    let number = |text: &str| text.parse().map_err(|e| format!("TSA_STUDY: {text:?}: {e}"));
    Ok(Some((tier, Some(Accuracy { contraction_m: number(contraction)?, tr_relative: number(tr)? }))))
}

fn constants(rig: &Rig) -> String {
    format!(
        "/// The rig's numbers, from the scene's `[rig]`.\n\
         pub const RIG: rig_control::RigConstants = rig_control::RigConstants {{\n\
         \x20   gear_ratio: {:?}f32, counts_per_rad: {:?}f32,\n\
         \x20   motor_speed_max_rad_per_s: {:?}f32, motor_acceleration_max_rad_per_s2: {:?}f32,\n\
         \x20   motor_torque_constant_nm_per_a: {:?}f32, current_limit_ma: {},\n\
         \x20   lvdt_gap_at_code_zero_m: {:?}f32, lvdt_metres_per_code: {:?}f32,\n\
         \x20   drive_group: {}, drive_number: {}, supply_limits_v: {:?}, supply_divider: {:?},\n\
         }};\n\
         /// How the board talks to the drive.\n\
         pub const DRIVE_TRANSPORT: rmds405::Transport = rmds405::Transport::{};\n",
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
        rig.supply_limits_v().map(|volts| volts as f32),
        rig.supply_divider.map(|divider| divider as f32),
        match rig.drive_transport {
            DriveTransport::Can => "Can",
            DriveTransport::Uart => "Uart",
        },
    )
}

/// The solver's constants, for the images beside the firmware (`src/bin`).
fn parameters(scene: &Scene) -> Result<String, Box<dyn Error>> {
    let parameters = format!("tsa_model::{:?}", scene.mechanism()?.parameters());
    let parameters = parameters.replace("radius_law: ", "radius_law: tsa_model::RadiusLaw::");
    Ok(format!("/// The scene's constants.\npub const PARAMETERS: tsa_model::Parameters = {parameters};\n"))
}

/// What the host compares its scene with.
fn hashes(scene: &Scene) -> String {
    format!(
        "/// Hash of the scene's `[rig]`.\n\
         pub const RIG_HASH: u32 = {:#010x};\n\
         /// Hash of the scene's `[envelope]` and `[accuracy]`.\n\
         pub const DEMAND_HASH: u32 = {:#010x};\n",
        scene.rig_hash(),
        scene.demand_hash()
    )
}

/// What a table that the board makes for itself must reach, and the shape it may take if the first one does not.
fn demand(scene: &Scene, fit: &tsa_table::fit::Fit) -> Result<String, Box<dyn Error>> {
    let accuracy = scene.table_demand()?.1;
    let spare = match fit.table.table().form {
        tsa_table::Form::Arc(s) => {
            let columns = (s.shape.columns + 2).min(tsa_table::arc::MAX_COLUMNS as u8);
            format!("tsa_table::Shape::of({}, {columns})", s.shape.rows)
        }
        _ => "None".into(),
    };
    Ok(format!(
        "/// The scene's accuracy: contraction (m) and TR (relative).\n\
         pub const ACCURACY: [f32; 2] = [{:?}f32, {:?}f32];\n\
         /// More powers, for constants that ask for them.\n\
         pub const SPARE_SHAPE: Option<tsa_table::Shape> = {spare};\n",
        accuracy.contraction_m as f32, accuracy.tr_relative as f32
    ))
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
