//! The scenes that come with the program.

use bfree::scene::{self, Override, Scene};
use std::io;
use std::path::PathBuf;

/// Why a shipped scene cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ShippedError {
    /// The folder of scenes cannot be listed.
    #[error("cannot list {folder}")]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// A scene is not valid.
    #[error("the scene `{name}` cannot be read")]
    Scene {
        /// Its name.
        name: String,
        /// The cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// The folder of the scenes.
pub fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

/// Names of all scenes, sorted.
///
/// # Errors
/// The folder cannot be listed.
pub fn names() -> Result<Vec<String>, ShippedError> {
    let failed = |source| ShippedError::Folder { folder: folder(), source };
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder()).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
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
pub fn scene(name: &str, overrides: &[&str]) -> Result<Scene, ShippedError> {
    let failed = |source: Box<dyn std::error::Error + Send + Sync>| ShippedError::Scene { name: name.into(), source };
    let overrides: Vec<Override> =
        overrides.iter().map(|text| text.parse()).collect::<Result<_, _>>().map_err(|error| failed(Box::new(error)))?;
    scene::read_file(&folder().join(format!("{name}.json")), &overrides).map_err(|error| failed(Box::new(error)))
}
