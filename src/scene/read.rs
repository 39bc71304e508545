//! Reads text into a checked scene.

use super::json::{parse, segments};
use super::overrides::{Override, OverrideError};
use super::place::{Step, locate, path, steps};
use super::{Scene, accuracy, keys};
use crate::problems::{KEPT, Place, Problem, Problems};
use serde_json::Value;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Maximum length of a scene in bytes. Millions of particles belong in a CSV file.
pub const MAX_BYTES: u64 = 16 << 20;

/// The form of a scene, for error messages.
const SHAPE: &str = "a scene is an object: { \"grid\": …, \"time\": …, \"bodies\": … }";

/// A scene that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The text is too long.
    #[error("the scene has {0} bytes or more, and at most {MAX_BYTES} are read; give many particles in a CSV file")]
    TooLong(u64),
    /// The text is not UTF-8.
    #[error("the scene is not UTF-8 text: byte {byte}, in line {line}, cannot be read")]
    NotText {
        /// Bytes before the invalid one.
        byte: usize,
        /// Line of the invalid byte, from 1.
        line: usize,
    },
    /// The text is not JSON, or has keys or types that a scene does not have.
    #[error("{0}")]
    Malformed(Problems),
    /// An override cannot be applied.
    #[error(transparent)]
    Override(#[from] OverrideError),
    /// All values of the scene that are not allowed.
    #[error("{0}")]
    Values(Problems),
}

/// Reads the scene file at `path`, see [`read`].
///
/// ```
/// let path = "scenes/rebound.json".as_ref();
/// let (scene, changed) = (bfree::scene::read_file(path, &[])?, bfree::scene::read_file(path, &["time.end=1".parse()?])?);
/// // The override changes that key, and no other.
/// assert_eq!((scene.time.end, changed.time.end), (80.0, 1.0));
/// assert_eq!(bfree::scene::Scene { time: scene.time.clone(), ..changed }, scene);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The errors of [`read`], and a file that cannot be read or is not UTF-8.
pub fn read_file(path: &Path, overrides: &[Override]) -> Result<Scene, SceneError> {
    read(&text(path)?, overrides)
}

/// The text of a scene file.
pub(crate) fn text(path: &Path) -> Result<String, SceneError> {
    let failed = |source| SceneError::File { path: path.to_owned(), source };
    let about = std::fs::metadata(path).map_err(failed)?;
    // Standard input, below /dev, is open already.
    if !about.is_file() && !path.starts_with("/dev") {
        let message = "it is no regular file, and a named pipe may wait for ever";
        return Err(failed(std::io::Error::new(std::io::ErrorKind::InvalidInput, message)));
    }
    let mut bytes = Vec::new();
    File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes)).map_err(failed)?;
    // Pipes and devices do not tell their length.
    if bytes.len() as u64 > MAX_BYTES {
        return Err(SceneError::TooLong(about.len().max(bytes.len() as u64)));
    }
    String::from_utf8(bytes).map_err(|wrong| {
        let (byte, bytes) = (wrong.utf8_error().valid_up_to(), wrong.as_bytes());
        let line = 1 + bytes.iter().take(byte).filter(|&&byte| byte == b'\n').count();
        SceneError::NotText { byte, line }
    })
}

/// Reads and checks a scene, with `overrides` applied in order.
///
/// 1. The text is parsed as JSON; a duplicate key is an error.
/// 2. The overrides replace values.
/// 3. `accuracy` sets keys that are not given.
/// 4. JSON becomes a [`Scene`]; unknown keys and wrong types are errors.
/// 5. All values are checked.
///
/// ```
/// let text = r#"{"grid": {"size": [1, 1], "spacing": 0.25}, "time": {"step": 0.1, "end": 1},
///     "bodies": [{"name": "block", "shape": {"box": {"min": [0, 0], "max": [1, 0.5]}}, "density": 1,
///                 "material": {"neo_hookean": {"young": 100, "poisson": 0.3}}}]}"#;
/// let scene = bfree::scene::read(text, &["time.step=0.05".parse()?])?;
/// assert_eq!((scene.dimension(), scene.time.step), (2, 0.05));
///
/// let error = bfree::scene::read(&text.replace("density", "densty"), &[]).unwrap_err().to_string();
/// assert!(error.starts_with("bodies[0].densty: unknown field") && error.contains("did you mean `density`?"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The error, its key, and its position in the text or in an override.
pub fn read(text: &str, overrides: &[Override]) -> Result<Scene, SceneError> {
    if text.len() as u64 > MAX_BYTES {
        return Err(SceneError::TooLong(text.len() as u64));
    }
    let text = text.trim_start_matches('\u{feff}');
    let malformed = |list| SceneError::Malformed(Problems { list, more: 0 });
    let no_scene = |message: String, place| malformed(vec![Problem { path: String::new(), message, place }]);
    if text.trim().is_empty() {
        return Err(no_scene(format!("the text is empty; {SHAPE}"), None));
    }
    let mut json = parse(text).map_err(|problem| malformed(vec![problem]))?;
    for replaced in overrides {
        replaced.apply(&mut json)?;
    }
    make_whole(&mut json);
    if !json.is_object() {
        return Err(no_scene(SHAPE.to_owned(), Some(Place::at(text, 0))));
    }

    let place = |steps: &[Step]| find(steps, text, overrides);
    let placed = |mut problems: Problems| {
        for problem in &mut problems.list {
            problem.place = place(&steps(&problem.path));
        }
        SceneError::Values(problems)
    };
    let chosen = accuracy::set_keys(&mut json).map_err(placed)?;
    let problem = |(steps, message): (Vec<Step>, String)| Problem { path: path(&steps), message, place: place(&steps) };
    let wrong = keys::wrong(&json);
    if !wrong.is_empty() {
        let more = wrong.len().saturating_sub(KEPT);
        let list = wrong.into_iter().take(KEPT).map(problem).collect();
        return Err(SceneError::Malformed(Problems { list, more }));
    }
    let scene: Scene = serde_path_to_error::deserialize(&json)
        .map_err(|error| malformed(vec![problem((segments(error.path()), error.inner().to_string()))]))?;
    let problems = scene.check();
    if problems.is_empty() { Ok(Scene { chosen, ..scene.complete() }) } else { Err(placed(problems)) }
}

/// Makes numbers such as 2.0 integers, as JSON Schema counts them.
fn make_whole(json: &mut Value) {
    match json {
        Value::Array(list) => list.iter_mut().for_each(make_whole),
        Value::Object(object) => object.values_mut().for_each(make_whole),
        Value::Number(number) => {
            // Double precision represents all integers below 2⁵³. -0.0 is no integer here.
            let whole = number.as_f64().filter(|x| x.fract() == 0.0 && x.abs() < 9e15 && x.is_sign_positive());
            if let Some(whole) = whole.filter(|_| number.is_f64()) {
                *number = (whole as u64).into();
            }
        }
        Value::Null | Value::Bool(_) | Value::String(_) => {}
    }
}

/// The source of the value at `steps`: the last override that set the value, or the text.
fn find(steps: &[Step], text: &str, overrides: &[Override]) -> Option<Place> {
    let within = |one: &Override| steps.starts_with(&one.steps);
    let found = locate(text, steps);
    let in_text = found.is_some_and(|(_, depth)| depth == steps.len());
    // An override may also have made the object that has the wrong key or lacks one.
    let made = |one: &Override| !in_text && one.steps.starts_with(steps);
    let replaced = overrides.iter().rev().find(|one| within(one) || made(one));
    replaced
        .map(|one| Place::Override(one.argument().to_owned()))
        .or_else(|| found.map(|(offset, _)| Place::at(text, offset)))
}
