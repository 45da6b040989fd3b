//! Scene files that the operator names.

use crate::failure::Failure;
use rig_config::{Scene, files};
use std::path::Path;

/// Checks that a scene file is there.
///
/// # Errors
/// Naming the file, and what to do if it is the default one.
pub fn check(path: &Path) -> Result<(), Failure> {
    files::check_regular(path).map_err(|e| {
        // The default is in the project's folder only.
        let hint = if path.is_relative() && e.kind() == std::io::ErrorKind::NotFound {
            "; run rigctl in the project's folder, or name a scene with --scene FILE"
        } else {
            ""
        };
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
