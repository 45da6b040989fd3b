//! Scene files that the operator names.

use crate::failure::Failure;
use clap::builder::{PathBufValueParser, TypedValueParser};
use rig_config::{Scene, files};
use std::path::{Path, PathBuf};

/// What to do if a scene is neither here nor in the program's folder.
const HINT: &str = "; name a scene that is there with --scene FILE";

/// The parser of options that name a scene.
pub(crate) fn parser() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(find)
}

/// The scene of this path. A relative path that does not exist here is one of the folder that the program belongs to: the archive
/// above `bin`, the checkout above `target/release`.
pub fn find(path: PathBuf) -> PathBuf {
    let own = std::env::current_exe().unwrap_or_default();
    let mut places = own.ancestors().skip(2).take(2).map(|folder| folder.join(&path));
    let there = if path.exists() { None } else { places.find(|place| place.exists()) };
    there.unwrap_or(path)
}

/// Checks that a scene file is there.
///
/// # Errors
/// Naming the file, and what to do if it is not there.
pub fn check(path: &Path) -> Result<(), Failure> {
    files::check_regular(path).map_err(|e| {
        let hint = if e.kind() == std::io::ErrorKind::NotFound { HINT } else { "" };
        Failure::failed(format!("scene {}: {e}{hint}", path.display()))
    })
}

/// Reads a scene.
///
/// # Errors
/// Naming the file, and the key or line that is wrong.
pub fn load(path: &Path) -> Result<Scene, Failure> {
    check(path)?;
    Ok(Scene::load(path)?)
}

/// Reads the scene of a rig; what is unusual about it is printed on standard error.
///
/// # Errors
/// As [`load`], or if the rig cannot work.
pub fn load_rig(path: &Path) -> Result<Scene, Failure> {
    let scene = load(path)?;
    check_rig(path, &scene)?;
    Ok(scene)
}

/// Checks that a rig of this scene can work; what is unusual about it is printed on standard error.
///
/// # Errors
/// Naming the file and every key that does not fit.
pub fn check_rig(path: &Path, scene: &Scene) -> Result<(), Failure> {
    for unusual in scene.check_rig().map_err(|error| error.in_file(path))? {
        crate::output::say!("warning: scene file {}: {unusual}", path.display());
    }
    Ok(())
}
