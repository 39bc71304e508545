//! The scenes that come with the program.

use crate::device;
use crate::studies::StudyError;
use bfree::scene::{self, Override, Scene};
use bfree::simulation::Simulation;
use std::path::PathBuf;

/// The folder of the scenes.
pub fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

/// Names of all scenes, sorted.
///
/// # Errors
/// The folder cannot be listed.
pub fn names() -> Result<Vec<String>, StudyError> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder())? {
        let path = entry?.path();
        if let (Some("json"), Some(name)) = (path.extension().and_then(|e| e.to_str()), path.file_stem()) {
            names.push(name.to_string_lossy().into_owned());
        }
    }
    names.sort();
    Ok(names)
}

/// The scene `name`, with keys replaced, each `KEY.PATH=JSON`.
///
/// # Errors
/// No such scene, or an override that does not fit it.
pub fn scene(name: &str, overrides: &[impl AsRef<str>]) -> Result<Scene, StudyError> {
    let overrides: Result<Vec<Override>, _> = overrides.iter().map(|text| text.as_ref().parse()).collect();
    Ok(scene::read_file(&folder().join(format!("{name}.json")), &overrides?)?)
}

/// The simulation of the scene `name`, with keys replaced.
///
/// # Errors
/// As for [`scene()`], or a scene that cannot be built.
pub fn simulation<const D: usize>(name: &str, overrides: &[impl AsRef<str>]) -> Result<Simulation<D>, StudyError> {
    let mut simulation = scene(name, overrides)?.build(&folder())?;
    simulation.settings.gpu = device::used();
    Ok(simulation)
}
