//! One key for speed against accuracy: a measured table sets the keys that a scene does not give.
//!
//! The values are inserted into the JSON of a scene before it becomes a [`Scene`](super::Scene). Every key that the scene gives stays
//! unchanged.

mod spacing;
mod table;

pub use table::{Level, levels};

use super::body::Body;
use super::grid::GridBox;
use super::overrides::next;
use super::place::steps;
use super::time::word;
use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fmt::{self, Display};

/// The wanted accuracy of the results.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Accuracy {
    /// For a first look at whether a scene does what it should.
    Draft,
    /// For everyday work.
    Standard,
    /// For reference results, with which other results are compared.
    Reference,
    /// A target error, relative to the size of the displacement, 0.0014 to 0.035. Smooth problems whose length scale is the size of a body
    /// have met the target; jumps and contact do not.
    Error(#[schemars(range(min = 0.0014, max = 0.035))] f64),
}

impl Accuracy {
    /// The row of the table for this accuracy; `None` for an error outside the table.
    ///
    /// ```
    /// use bfree::scene::accuracy::{Accuracy, levels};
    ///
    /// // An error between those of two rows takes a number of cells between theirs.
    /// let [.., coarse, fine] = levels() else { return Err("two rows") };
    /// let between = Accuracy::Error((coarse.error * fine.error).sqrt()).level().ok_or("in the table")?;
    /// assert!((between.cells / (coarse.cells * fine.cells).sqrt() - 1.0).abs() < 1e-14);
    /// assert!(Accuracy::Error(0.1 * fine.error).level().is_none());
    /// # Ok::<(), &str>(())
    /// ```
    pub fn level(self) -> Option<Level> {
        let named = |word: &str| levels().iter().find(|level| level.name == Some(word)).copied();
        match self {
            Self::Draft => named("draft"),
            Self::Standard => named("standard"),
            Self::Reference => named("reference"),
            Self::Error(error) => table::between(error),
        }
    }
}

/// The accuracy as a scene writes it.
impl Display for Accuracy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&word(self))
    }
}

/// A key set by `accuracy`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Chosen {
    /// The key, such as `grid.spacing`.
    pub key: String,
    /// The value of the key.
    pub value: Value,
}

impl Display for Chosen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.key, self.value)
    }
}

/// Keys that stay unchanged in a scene without inertia. The scene refuses `transfer` and keys of inertia in `time`. The shape functions
/// stay because almost nothing but inertia holds the nodes of LME beside free faces.
const NEED_INERTIA: [&str; 3] = ["time.", "transfer", "approximation"];

/// The number of cells that the fastest pressure wave crosses in `time`; `None` if no wave speed is known.
pub(super) fn courant(bodies: &[Body], spacing: f64, time: f64) -> Option<f64> {
    Some(spacing::speed(bodies).ok()? * time / spacing)
}

/// Inserts the keys set by `accuracy` into a scene. JSON without the types of a scene stays unchanged: reading it as a scene gives the
/// error.
///
/// # Errors
/// The target error is outside the table, or a needed length or speed is not in the scene.
pub(super) fn set_keys(scene: &mut Value) -> Result<Vec<Chosen>, Problems> {
    let Some(accuracy) = part::<Accuracy>(&scene["accuracy"]) else { return Ok(Vec::new()) };
    let mut problems = Problems::default();
    if let Accuracy::Error(error) = accuracy {
        let [least, greatest] = table::range();
        problems.between("accuracy.error", error, least, greatest);
    }
    let Some(level) = accuracy.level() else { return Err(problems) };
    let Some(bodies) = part::<Vec<Body>>(&scene["bodies"]) else { return Ok(Vec::new()) };
    let mut setter = KeySetter { scene, chosen: Vec::new() };
    for (key, value) in level.keys() {
        let refused = has_load_steps(setter.scene) && NEED_INERTIA.iter().any(|word| key.starts_with(word));
        if !refused {
            setter.set(key, value);
        }
    }
    for (i, _) in bodies.iter().enumerate().filter(|(_, body)| body.shape.is_some()) {
        setter.set(&format!("bodies.{i}.particles_per_cell"), level.particles_per_cell.into());
    }
    if setter.lacks("grid", "spacing") {
        let mut with_any = setter.scene["grid"].clone();
        with_any["spacing"] = 1.into();
        let Some(grid) = part::<GridBox>(&with_any) else { return Ok(setter.chosen) };
        let spacing = spacing::fitting(&grid, &bodies, level.cells);
        setter.set("grid.spacing", spacing.map_err(|why| needed("grid.spacing", accuracy, &why))?.into());
    }
    if setter.lacks("time", "step") {
        let spacing = setter.scene["grid"]["spacing"].as_f64().filter(|h| *h > 0.0 && h.is_finite());
        let end = setter.scene["time"]["end"].as_f64().filter(|end| *end > 0.0);
        let (Some(spacing), Some(end)) = (spacing, end) else { return Ok(setter.chosen) };
        if has_load_steps(setter.scene) {
            return Err(needed("time.step", accuracy, "load steps of a scene without inertia have no natural length"));
        }
        let speed = spacing::speed(&bodies).map_err(|why| needed("time.step", accuracy, &why))?;
        let longest = level.courant * spacing / speed;
        // The end is reached in a whole number of steps.
        setter.set("time.step", (end / (end / longest).ceil().max(1.0)).into());
    }
    Ok(setter.chosen)
}

/// Whether the scene asks for load steps, by the key `time.scheme` or by its old name.
fn has_load_steps(scene: &Value) -> bool {
    let time = &scene["time"];
    let scheme = if time["scheme"].is_null() { &time["inertia"] } else { &time["scheme"] };
    scheme == "none"
}

/// A part of a scene; `None` if it does not have the type `T`.
fn part<T: for<'de> Deserialize<'de>>(value: &Value) -> Option<T> {
    T::deserialize(value).ok()
}

fn needed(key: &str, accuracy: Accuracy, why: &str) -> Problems {
    let mut problems = Problems::default();
    problems.refuse("accuracy", accuracy, format_args!("it would choose {key}, but {why}; give {key}"));
    problems
}

/// A scene, and the keys inserted into it.
struct KeySetter<'a> {
    scene: &'a mut Value,
    chosen: Vec<Chosen>,
}

impl KeySetter<'_> {
    /// Whether the section is present as an object without the key.
    fn lacks(&self, section: &str, key: &str) -> bool {
        self.scene.get(section).is_some_and(|section| section.is_object() && section.get(key).is_none())
    }

    /// Sets the key `a.b.c` if it is not given. Absent sections are created. A section that is neither object nor list stays unchanged.
    fn set(&mut self, key: &str, value: Value) {
        if self.scene.pointer(&format!("/{}", key.replace('.', "/"))).is_some() {
            return;
        }
        let Ok(place) = steps(key).iter().try_fold(&mut *self.scene, next) else { return };
        *place = value.clone();
        self.chosen.push(Chosen { key: key.to_owned(), value });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_key_that_is_given_stays_and_so_does_what_holds_it() {
        let mut scene = json!({"time": {"end": 1}, "transfer": "flip", "bodies": [{}]});
        let mut setter = KeySetter { scene: &mut scene, chosen: Vec::new() };
        for key in
            ["time.end", "time.lumping", "transfer.blend.rate", "solver.newton.tolerance", "bodies.0.x", "bodies.7.x"]
        {
            setter.set(key, 7.into());
        }
        let keys: Vec<_> = setter.chosen.iter().map(|chosen| chosen.key.as_str()).collect();
        assert_eq!(keys, ["time.lumping", "solver.newton.tolerance", "bodies.0.x"]);
        let expected = json!({
            "time": {"end": 1, "lumping": 7}, "transfer": "flip", "bodies": [{"x": 7}], "solver": {"newton": {"tolerance": 7}}
        });
        assert_eq!(scene, expected);
    }
}
