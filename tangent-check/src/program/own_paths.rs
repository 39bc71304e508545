//! Paths of a user: a JSON list of `{"name": …, "length": Δt, "gradients": [F, …]}`.

use crate::convention::Tensor;
use crate::json::{self, Value};
use crate::states::Path;
use crate::tensor::determinant;

/// Reads the paths of a file.
///
/// # Errors
/// A sentence: which path, which step, what is allowed.
pub(super) fn read(file: &std::path::Path) -> Result<Vec<Path>, String> {
    let says = |what: String| format!("The states of {}: {what}", file.display());
    let text = std::fs::read_to_string(file).map_err(|error| says(format!("{error}.")))?;
    let value = json::parse(&text).map_err(says)?;
    let list = value.as_list().ok_or_else(|| says("they must be a list of paths.".to_owned()))?;
    let paths = list.iter().map(path).collect::<Result<Vec<_>, _>>().map_err(says)?;
    if paths.iter().all(|path| path.gradients.is_empty()) {
        return Err(says("there is no path with a step.".to_owned()));
    }
    Ok(paths)
}

/// A path of a user. The error is a sentence without the file.
fn path(value: &Value) -> Result<Path, String> {
    let keys = ["name", "length", "gradients"];
    let known = matches!(value, Value::Object(members) if members.keys().all(|key| keys.contains(&key.as_str())));
    let [name, length, list] = keys.map(|key| value.get(key));
    let parts = (name, length.and_then(Value::as_number), list.and_then(Value::as_list));
    let (true, (Some(Value::Text(name)), Some(length), Some(list))) = (known, parts) else {
        return Err(format!("a path must have a name, a length and gradients, and nothing else, but is {value}."));
    };
    let gradients: Option<Vec<Tensor>> = list.iter().map(tensor).collect();
    let gradients = gradients.ok_or_else(|| format!("path {name:?}: each F must be three rows of three numbers."))?;
    if let Some(step) = gradients.iter().position(|gradient| !(determinant(gradient) > 0.0 && length > 0.0)) {
        let step = step + 1;
        return Err(format!(
            "path {name:?}, step {step}: F needs a positive determinant, and the length of a step must be positive."
        ));
    }
    Ok(Path::new(name, gradients, length))
}

fn tensor(value: &Value) -> Option<Tensor> {
    fn three<T>(value: &Value, each: impl Fn(&Value) -> Option<T>) -> Option<[T; 3]> {
        value.as_list()?.iter().map(each).collect::<Option<Vec<_>>>()?.try_into().ok()
    }
    three(value, |row| three(row, Value::as_number))
}
