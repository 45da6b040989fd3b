//! Scene file to firmware: solves the model, fits and certifies the table, writes it and the rig's constants as Rust.

use rig_config::{Accuracy, Scene};
use std::error::Error;
use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::{env, fs};
use tsa_model::Tier;
use tsa_table::Demand;

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
    println!("cargo:rerun-if-changed=src/memory.x");
    // A commit leaves HEAD itself as it was.
    println!("cargo:rerun-if-changed=.git/logs/HEAD");

    let scene = Scene::load(&scene_path)?;
    let study = study()?;
    let fit = match &study {
        // Under the scene's own hash, so that the tool accepts the board; its git id tells the image apart.
        Some(study) => {
            let demand = Demand { accuracy: study.accuracy, ..scene.demand()? };
            tsa_table::fit::fit_tier(&scene.mechanism()?, &demand, study.tier)?
        }
        None => scene.fit_table()?,
    };
    for unusual in scene.check_rig().map_err(|error| error.in_file(&scene_path))? {
        println!("cargo:warning=scene file {scene_path}: {unusual}");
    }
    let mut source = tsa_table::emit::rust_source(&fit);
    source.push_str(&constants(&scene));
    source.push_str(&hashes(&scene));
    fs::write(out.join("scene.rs"), source)?;
    fs::write(out.join("parameters.rs"), parameters(&scene)?)?;

    fs::write(out.join("memory.x"), include_str!("src/memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    // The commit goes into the identity that the board reports, so that `rigctl status` and `doctor` show a study
    // image.
    let mark = if study.is_some() { "-study" } else { "" };
    println!("cargo:rustc-env=TSA_GIT={}{mark}", git().unwrap_or_else(|| "unknown".into()));
    Ok(())
}

/// A table of a cheaper model or another accuracy, so that its effect on the closed loop can be measured.
struct Study {
    tier: Tier,
    accuracy: Accuracy,
}

/// The table that `TSA_STUDY` asks for: "tier contraction_m tr_relative". It is refused without the feature `study`,
/// which only `cargo xtask loop` sets: a variable left over in a shell must not put a worse table under the scene's
/// name.
fn study() -> Result<Option<Study>, Box<dyn Error>> {
    println!("cargo:rerun-if-env-changed=TSA_STUDY");
    let Ok(text) = env::var("TSA_STUDY") else { return Ok(None) };
    if !cfg!(feature = "study") {
        return Err("TSA_STUDY is set, which asks for a table of another model or accuracy than the scene's; \
                    unset it (only `cargo xtask loop` builds such images)"
            .into());
    }
    let [name, contraction, tr] = text.split(' ').collect::<Vec<_>>()[..] else {
        return Err(format!("TSA_STUDY: {text:?} is not a tier and two numbers").into());
    };
    let tier = Tier::named(name).ok_or_else(|| format!("TSA_STUDY: no tier is called {name:?}"))?;
    let number = |text: &str| text.parse().map_err(|e| format!("TSA_STUDY: {text:?}: {e}"));
    Ok(Some(Study { tier, accuracy: Accuracy { contraction_m: number(contraction)?, tr_relative: number(tr)? } }))
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

/// The solver's constants, for the images beside the firmware (`src/bin`).
fn parameters(scene: &Scene) -> Result<String, Box<dyn Error>> {
    let parameters = format!("tsa_model::{:?}", scene.mechanism()?.parameters());
    let parameters = parameters.replace("radius_law: ", "radius_law: tsa_model::RadiusLaw::");
    let parameters = parameters.replace("Some(Correction", "Some(tsa_model::Correction");
    Ok(format!("/// The scene's constants.\npub const PARAMETERS: tsa_model::Parameters = {parameters};\n"))
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
