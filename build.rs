//! Scene file to firmware: solves the model, fits and certifies the table, writes it and the rig's constants as Rust.

use rig_config::Scene;
use std::error::Error;
use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::{env, fs};

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
    // Also for the name of the commit, which says whether sources have changed since.
    println!("cargo:rerun-if-changed=src");
    println!("cargo:rerun-if-changed=crates");
    // A commit leaves HEAD itself as it was.
    println!("cargo:rerun-if-changed=.git/logs/HEAD");

    let scene = Scene::load(&scene_path)?;
    let fit = scene.fit_table()?;
    for unusual in scene.check_rig().map_err(|error| error.in_file(&scene_path))? {
        println!("cargo:warning=scene file {scene_path}: {unusual}");
    }
    let mut source = tsa_table::emit::rust_source(&fit);
    source.push_str(&constants(&scene));
    source.push_str(&hashes(&scene));
    fs::write(out.join("scene.rs"), source)?;

    fs::write(out.join("memory.x"), include_str!("src/memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    // The commit goes into the identity that the board reports.
    println!("cargo:rustc-env=TSA_GIT={}", git().unwrap_or_else(|| "unknown".into()));
    Ok(())
}

fn constants(scene: &Scene) -> String {
    format!(
        "/// The rig's numbers, from the scene's `[rig]`.\n\
         pub const RIG: rig_control::RigConstants = rig_control::{:?};\n\
         /// How the board talks to the drive.\n\
         pub const DRIVE_TRANSPORT: rmds405::Transport = rmds405::Transport::{:?};\n",
        scene.constants(),
        scene.rig.drive_transport,
    )
}

/// The hash with which the host compares its `[rig]`.
fn hashes(scene: &Scene) -> String {
    format!(
        "/// Hash of the scene's `[rig]`.\n\
         pub const RIG_HASH: u32 = {:#010x};\n",
        scene.rig_hash(),
    )
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
