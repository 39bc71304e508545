//! The varied settings: one knob at a time from the defaults, and a designed set of combinations.

use super::problem::{LEVELS, Problem};
use crate::studies::Effort;
use serde_json::Value;

/// cΔt/h of the base.
pub(super) const COURANT: f64 = 1.0;

/// The level of the spacing of the base.
pub(super) const BASE_LEVEL: usize = 2;

/// The origin of a setting.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Origin {
    /// The defaults of the scene's types.
    Default,
    /// One knob turned: its name, and its value.
    Knob(&'static str, String),
    /// A combination: its shape functions, and ε.
    Design(&'static str, f64),
    /// A value of the key `accuracy`.
    Accuracy(String),
}

/// One way to run a problem.
#[derive(Clone, Debug)]
pub(super) struct Setting {
    pub origin: Origin,
    /// `KEY.PATH=JSON` of the scene.
    pub keys: Vec<String>,
    /// Number of the spacing h in the problem's list; the key `accuracy` may choose it instead.
    pub level: Option<usize>,
    /// cΔt/h; the key `accuracy` may choose it instead.
    pub courant: Option<f64>,
}

impl Setting {
    pub fn base() -> Self {
        Self { origin: Origin::Default, keys: Vec::new(), level: Some(BASE_LEVEL), courant: Some(COURANT) }
    }

    fn turned(knob: &'static str, value: impl Into<String>) -> Self {
        Self { origin: Origin::Knob(knob, value.into()), ..Self::base() }
    }

    /// The name in a table.
    pub fn name(&self) -> String {
        match &self.origin {
            Origin::Default => "defaults".into(),
            Origin::Knob(knob, value) => format!("{knob} = {value}"),
            Origin::Design(shape, lumping) => {
                let (level, courant) = (self.level.unwrap_or(BASE_LEVEL), self.courant.unwrap_or(COURANT));
                format!("{shape}, eps {lumping}, h level {level}, Courant {courant}")
            }
            Origin::Accuracy(value) => format!("accuracy = {value}"),
        }
    }

    /// The value of the knob `name`, if the setting varies that knob.
    pub fn of_knob(&self, name: &str) -> Option<&str> {
        match &self.origin {
            Origin::Knob(knob, value) if *knob == name => Some(value),
            _ => None,
        }
    }
}

/// A knob that is a key of the scene.
pub(super) struct Knob {
    /// Its path.
    pub key: &'static str,
    /// Its values as JSON; `$x` stands for x c/h.
    values: &'static [&'static str],
    /// The number of values tried at short effort.
    short: usize,
    /// The dimensions in which the knob is tried.
    dimensions: std::ops::RangeInclusive<usize>,
}

/// LME with its own defaults.
const LME: &str = r#"{"lme":{}}"#;

/// The knobs that are keys of a scene, without h and Δt. A default value is skipped, since it is the base.
pub(super) const KNOBS: &[Knob] = &[
    Knob {
        key: "approximation",
        values: &[LME, r#""linear""#, r#""gimp""#, r#"{"bspline":{"degree":2}}"#, r#"{"bspline":{"degree":3}}"#],
        short: 2,
        dimensions: 1..=3,
    },
    Knob { key: "approximation.lme.gamma", values: &["1.4", "0.8", "2", "3", "4", "6"], short: 1, dimensions: 1..=3 },
    Knob {
        key: "approximation.lme.tolerance",
        values: &["1e-3", "1e-6", "1e-9", "1e-12"],
        short: 0,
        dimensions: 1..=3,
    },
    Knob { key: "approximation.lme.support", values: &[r#""separable""#, r#""circle""#], short: 0, dimensions: 2..=2 },
    Knob { key: "bodies.0.particles_per_cell", values: &["3", "1", "2"], short: 1, dimensions: 1..=3 },
    Knob { key: "time.lumping", values: &["0.1", "0", "0.02", "0.5", "1"], short: 1, dimensions: 1..=3 },
    Knob { key: "time.gamma", values: &["0.5", "0.6"], short: 0, dimensions: 1..=3 },
    Knob { key: "time.initial_guess", values: &[r#""zero""#, r#""velocity""#], short: 0, dimensions: 1..=3 },
    Knob { key: "time.wall_update", values: &[r#""literal""#, r#""consistent""#], short: 0, dimensions: 2..=3 },
    Knob {
        key: "transfer",
        values: &[
            r#"{"blend":{"rate":$0.1}}"#,
            r#"{"pic":{"order":1}}"#,
            r#"{"pic":{"order":2}}"#,
            r#"{"blend":{"rate":$0.1,"order":2}}"#,
            r#"{"limited":{"rate":$0.8}}"#,
            r#""flip""#,
        ],
        short: 1,
        dimensions: 1..=3,
    },
    Knob {
        key: "solver.newton.tolerance",
        values: &["1e-4", "1e-1", "1e-2", "1e-3", "1e-6", "1e-9", "1e-12"],
        short: 1,
        dimensions: 1..=3,
    },
    Knob {
        key: "solver.krylov.forcing",
        values: &[
            r#""eisenstat_walker""#,
            r#"{"fixed":1e-1}"#,
            r#"{"fixed":1e-2}"#,
            r#"{"fixed":1e-4}"#,
            r#"{"fixed":1e-6}"#,
            r#"{"fixed":1e-8}"#,
            r#"{"fixed":1e-10}"#,
        ],
        short: 1,
        dimensions: 1..=3,
    },
    Knob { key: "solver.krylov.method", values: &[r#"{"gmres":{"restart":30}}"#], short: 1, dimensions: 1..=3 },
];

/// Names of the knobs that are not keys with a default.
pub(super) const SPACING: &str = "grid.spacing";
pub(super) const STEP: &str = "time.step";

/// The shape functions with a knob that the base lacks. The defaults of these functions are the reference for its values.
fn family(knob: &str) -> Option<&'static str> {
    knob.starts_with("approximation.lme.").then_some(LME)
}

/// The reference for the values of a knob: the base, or a value of the knob `approximation`.
pub(super) fn origin(knob: &str) -> Origin {
    family(knob).map_or(Origin::Default, |shape| Origin::Knob("approximation", shown(shape)))
}

/// The setting in which a knob has its default.
fn unturned(knob: &str) -> Setting {
    let keys = family(knob).map(|shape| format!("approximation={shape}"));
    Setting { keys: keys.into_iter().collect(), ..Setting::base() }
}

/// A value without the quotation marks of JSON.
fn shown(value: &str) -> String {
    value.replace('"', "")
}

/// All knobs, each with its value in the base.
pub(super) fn knobs(problem: &dyn Problem) -> Vec<(&'static str, String)> {
    let of_key = |knob: &Knob| {
        let default = problem.value(&unturned(knob.key), knob.key).map_or_else(String::new, |value| value.to_string());
        (knob.key, shown(&default))
    };
    let mut knobs = vec![(SPACING, "× 1".to_owned()), (STEP, "× 1".to_owned())];
    knobs.extend(KNOBS.iter().map(of_key));
    knobs
}

/// The base, and settings with one varied knob each.
pub(super) fn one_at_a_time(problem: &dyn Problem, effort: Effort) -> Vec<Setting> {
    let full = effort == Effort::Full;
    let mut settings = vec![Setting::base()];
    let cells = problem.cells();
    // The finest level takes minutes in three dimensions.
    let finest = if problem.dimension() < 3 { LEVELS } else { LEVELS - 1 };
    for level in if full { 0..finest } else { 1..2 } {
        if level != BASE_LEVEL {
            // The time step stays the same.
            let courant = COURANT * cells[level] / cells[BASE_LEVEL];
            let value = format!("× {:.2}", cells[BASE_LEVEL] / cells[level]);
            let turned = Setting::turned(SPACING, value);
            settings.push(Setting { level: Some(level), courant: Some(courant), ..turned });
        }
    }
    for factor in if full { &[8.0, 4.0, 2.0, 0.5, 0.25][..] } else { &[2.0] } {
        let turned = Setting::turned(STEP, format!("× {factor}"));
        settings.push(Setting { courant: Some(COURANT * factor), ..turned });
    }
    for knob in KNOBS.iter().filter(|knob| knob.dimensions.contains(&problem.dimension())) {
        let default = problem.value(&unturned(knob.key), knob.key);
        for value in knob.values.iter().take(if full { knob.values.len() } else { knob.short }) {
            let label = shown(&value.replace('$', "c/h × "));
            let value = scaled(value, problem.speed() / problem.spacing(BASE_LEVEL));
            if default.as_ref().is_some_and(|default| is(default, &value)) {
                continue;
            }
            let mut setting = Setting { origin: Origin::Knob(knob.key, label), ..unturned(knob.key) };
            setting.keys.push(format!("{}={value}", knob.key));
            if knob.key == "time.gamma" {
                // β = (γ + ½)²/4
                let beta = value.parse().map_or(0.25, |gamma: f64| 0.25 * (gamma + 0.5).powi(2));
                setting.keys.push(format!("time.beta={beta}"));
            }
            settings.push(setting);
        }
    }
    settings
}

/// Whether a value of a scene equals the JSON: 3 is 3.0.
fn is(value: &Value, json: &str) -> bool {
    serde_json::from_str(json)
        .is_ok_and(|other: Value| *value == other || (value.is_f64() && value.as_f64() == other.as_f64()))
}

/// A value in which `$x` has become x c/h.
fn scaled(value: &str, rate: f64) -> String {
    let Some((before, after)) = value.split_once('$') else { return value.to_owned() };
    let end = after.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(after.len());
    let factor: f64 = after[..end].parse().unwrap_or(1.0);
    format!("{before}{:.4e}{}", factor * rate, &after[end..])
}

/// The shape functions of the design.
pub(super) const SHAPES: [(&str, &str); 6] = [
    ("linear", r#""linear""#),
    ("uGIMP", r#""gimp""#),
    ("B-spline 3", r#"{"bspline":{"degree":3}}"#),
    ("LME 0.8", r#"{"lme":{"gamma":0.8}}"#),
    ("LME 1.4", r#"{"lme":{"gamma":1.4}}"#),
    ("LME 3", r#"{"lme":{"gamma":3}}"#),
];

/// Shape functions × ε × h × Δt.
pub(super) fn design(problem: &dyn Problem, effort: Effort) -> Vec<Setting> {
    let (shapes, lumpings, levels, courants): (&[usize], &[f64], &[usize], &[f64]) = match (effort, problem.dimension())
    {
        (Effort::Short, _) => (&[2, 4], &[1.0], &[1, 2], &[1.0]),
        (Effort::Full, 3) => (&[0, 1, 2, 4, 5], &[1.0, 0.1], &[1, 2], &[1.0]),
        (Effort::Full, _) => (&[0, 1, 2, 3, 4, 5], &[1.0, 0.1], &[1, 2, 3], &[2.0, 1.0]),
    };
    let mut settings = Vec::new();
    for &shape in shapes {
        for &lumping in lumpings {
            for &level in levels {
                for &courant in courants {
                    let (name, json) = SHAPES[shape];
                    settings.push(Setting {
                        origin: Origin::Design(name, lumping),
                        keys: vec![format!("approximation={json}"), format!("time.lumping={lumping}")],
                        level: Some(level),
                        courant: Some(courant),
                    });
                }
            }
        }
    }
    settings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_a_multiple_of_c_over_h() {
        assert_eq!(scaled(r#"{"limited":{"rate":$0.8}}"#, 50.0), r#"{"limited":{"rate":4.0000e1}}"#);
        assert_eq!(scaled("0.1", 50.0), "0.1");
    }
}
