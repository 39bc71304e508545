//! The keys of a scene, by its schema: the documentation of each key, and all keys and types that do not fit.
//!
//! serde stops at the first key or type that does not fit. The schema then finds the others.

use super::place::Step;
use serde_json::{Map, Value};
use std::sync::LazyLock;
use strsim::damerau_levenshtein;

static SCHEMA: LazyLock<Value> = LazyLock::new(|| super::complete_schema().to_value());

/// All keys and types in `written` that do not fit the schema, with messages in serde's words.
pub(super) fn wrong(written: &Value) -> Vec<(Vec<Step>, String)> {
    let mut audit = Audit::default();
    audit.value(&SCHEMA, written);
    audit.found
}

/// A key of a scene and its documentation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    /// The path, such as `bodies[].density` for all entries of a list. A chosen word follows the path, as in `boundary.left = "sliding"`.
    pub path: String,
    /// The documentation.
    pub about: String,
}

/// The keys written in a scene, each once, with their documentation.
///
/// ```
/// let keys = bfree::scene::keys::documented(&serde_json::json!({"time": {"step": 0.1}, "approximation": "linear"}));
/// let paths: Vec<_> = keys.iter().map(|key| key.path.as_str()).collect();
/// assert_eq!(paths, ["approximation", "approximation = \"linear\"", "time", "time.step"]);
/// assert_eq!(keys[3].about, "The time step Δt (time), > 0.");
/// ```
pub fn documented(scene: &Value) -> Vec<Key> {
    let mut keys = Vec::new();
    describe(&SCHEMA, scene, "", &mut keys);
    keys
}

/// Follows references. Of a key that may be null, takes the alternative that is not null; of a list or an object, the one that `value` is.
fn resolved<'a>(mut schema: &'a Value, value: &Value) -> &'a Value {
    loop {
        let of_type = schema["$ref"].as_str().and_then(|name| name.strip_prefix("#/$defs/"));
        let present = || schema["anyOf"].as_array().into_iter().flatten().filter(|one| one["type"] != "null");
        let fits = |one: &&Value| (resolved(one, value)["type"] == "array") != value.is_object();
        schema = match (of_type, present().find(fits).or_else(|| present().next())) {
            (Some(name), _) => &SCHEMA["$defs"][name],
            (None, Some(present)) => present,
            (None, None) => return schema,
        }
    }
}

fn may_be_null(schema: &Value) -> bool {
    let alternatives = schema["anyOf"].as_array().is_some_and(|any| any.iter().any(|one| one["type"] == "null"));
    alternatives || types(schema).contains(&"null")
}

/// The allowed types, from `"type": "number"` or `"type": ["number", "null"]`.
fn types(schema: &Value) -> Vec<&str> {
    match &schema["type"] {
        Value::String(one) => vec![one],
        several => several.as_array().into_iter().flatten().filter_map(Value::as_str).collect(),
    }
}

/// The alternatives of an enum by name: words, and objects with one key.
fn variants(schema: &Value) -> Option<Vec<(&str, &Value)>> {
    let mut variants = Vec::new();
    for variant in schema["oneOf"].as_array()? {
        let key = variant["properties"].as_object().and_then(|keys| keys.keys().next());
        let name = variant["const"].as_str().or(key.map(String::as_str));
        variants.extend(name.map(|name| (name, variant)));
    }
    Some(variants)
}

/// A walk through a scene and its schema, side by side.
#[derive(Default)]
struct Audit {
    steps: Vec<Step>,
    found: Vec<(Vec<Step>, String)>,
}

impl Audit {
    fn within(&mut self, step: Step, schema: &Value, value: &Value) {
        self.steps.push(step);
        self.value(schema, value);
        self.steps.pop();
    }

    fn say(&mut self, message: String) {
        self.found.push((self.steps.clone(), message));
    }

    fn value(&mut self, schema: &Value, value: &Value) {
        if value.is_null() && may_be_null(schema) {
            return;
        }
        let schema = resolved(schema, value);
        if let Some(variants) = variants(schema) {
            return self.variant(&variants, value);
        }
        let most = if schema["format"] == "uint8" { u8::MAX.into() } else { u32::MAX.into() };
        match (types(schema).first().copied(), value) {
            (Some("object"), Value::Object(object)) => self.object(schema, object),
            (Some("object"), _) => self.mismatch(&an_object(schema), value),
            (Some("array"), Value::Array(list)) => {
                let length = schema["minItems"].as_u64().filter(|_| schema["minItems"] == schema["maxItems"]);
                if let Some(length) = length.filter(|length| *length != list.len() as u64) {
                    return self.say(format!("invalid length {}, expected a list of {length}", list.len()));
                }
                for (i, value) in list.iter().enumerate() {
                    self.within(Step::Index(i), schema["prefixItems"].get(i).unwrap_or(&schema["items"]), value);
                }
            }
            (Some("array"), _) => self.mismatch("a list", value),
            (Some("number"), _) if !value.is_number() => self.mismatch("a number", value),
            (Some("integer"), _) if value.as_u64().is_none_or(|n| n > most) => {
                self.mismatch(&format!("a whole number from 0 to {most}"), value);
            }
            (Some("string"), _) if !value.is_string() => self.mismatch("a string", value),
            (Some("boolean"), _) if !value.is_boolean() => self.mismatch("true or false", value),
            _ => {}
        }
    }

    fn object(&mut self, schema: &Value, object: &Map<String, Value>) {
        let Some(known) = schema["properties"].as_object() else { return };
        for (key, value) in object {
            match known.get(key) {
                Some(schema) => self.within(Step::Key(key.clone()), schema, value),
                None => {
                    self.steps.push(Step::Key(key.clone()));
                    self.unknown("field", key, known.keys().map(String::as_str).collect());
                    self.steps.pop();
                }
            }
        }
        let required = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
        for key in required.filter(|key| !object.contains_key(*key)) {
            self.say(format!("missing field `{key}`"));
        }
    }

    fn variant(&mut self, variants: &[(&str, &Value)], value: &Value) {
        let (word, inner) = match value {
            Value::String(word) => (word, None),
            Value::Object(object) if object.len() != 1 => {
                return self.mismatch("an object with exactly one key", value);
            }
            value => match value.as_object().and_then(|object| object.iter().next()) {
                Some((word, inner)) => (word, Some(inner)),
                None => return self.mismatch("a word or an object with one key", value),
            },
        };
        let Some((_, variant)) = variants.iter().find(|(name, _)| name == word) else {
            return self.unknown("variant", word, variants.iter().map(|(name, _)| *name).collect());
        };
        match (variant["properties"].get(word), inner) {
            (Some(schema), Some(inner)) => self.within(Step::Key(word.clone()), schema, inner),
            (Some(_), None) => self.mismatch(&format!("an object with the key `{word}`"), value),
            (None, Some(_)) => self.mismatch("a word", value),
            (None, None) => {}
        }
    }

    fn unknown(&mut self, kind: &str, word: &str, allowed: Vec<&str>) {
        let meant = nearest(word, &allowed).map_or_else(String::new, |meant| format!("; did you mean `{meant}`?"));
        self.say(format!("unknown {kind} `{word}`, expected one of `{}`{meant}", allowed.join("`, `")));
    }

    fn mismatch(&mut self, expected: &str, value: &Value) {
        let is = match value {
            Value::Null => "null".to_owned(),
            Value::Bool(x) => format!("boolean `{x}`"),
            Value::Number(x) => format!("number `{x}`"),
            Value::String(x) => format!("string {x:?}"),
            Value::Array(_) => "a list".to_owned(),
            Value::Object(_) => "an object".to_owned(),
        };
        self.say(format!("invalid type: {is}, expected {expected}"));
    }
}

/// "An object" with the keys that it must have. If all keys are optional, they are listed as a choice.
fn an_object(schema: &Value) -> String {
    let keys = schema["properties"].as_object().into_iter().flatten().map(|(key, _)| format!("`{key}`"));
    let keys: Vec<String> = keys.collect();
    let required = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
    let required: Vec<String> = required.map(|key| format!("`{key}`")).collect();
    match (keys.is_empty(), required.is_empty()) {
        (true, _) => "an object".to_owned(),
        (_, true) => format!("an object with some of the keys {}", keys.join(", ")),
        _ => format!("an object with the keys {}", required.join(", ")),
    }
}

fn describe(schema: &Value, value: &Value, at: &str, keys: &mut Vec<Key>) {
    let schema = resolved(schema, value);
    let below = |key: &str| if at.is_empty() { key.to_owned() } else { format!("{at}.{key}") };
    let variants = variants(schema).unwrap_or_default();
    let variant = |word: &str| variants.iter().find(|(name, _)| *name == word).map(|(_, variant)| *variant);
    match value {
        Value::String(word) => {
            if let Some(variant) = variant(word) {
                tell(format!("{at} = {word:?}"), variant, keys);
            }
        }
        Value::Object(object) => {
            for (key, value) in object {
                let one = variant(key);
                let property = &one.unwrap_or(schema)["properties"][key];
                tell(below(key), one.unwrap_or(property), keys);
                describe(property, value, &below(key), keys);
            }
        }
        Value::Array(list) => list.iter().for_each(|value| describe(&schema["items"], value, &format!("{at}[]"), keys)),
        _ => {}
    }
}

/// Adds a key, unless it has no documentation or is in the list already.
fn tell(path: String, schema: &Value, keys: &mut Vec<Key>) {
    let about = schema["description"].as_str().unwrap_or_default();
    let key = Key { path, about: about.split_whitespace().collect::<Vec<_>>().join(" ") };
    if !key.about.is_empty() && !keys.contains(&key) {
        keys.push(key);
    }
}

/// Maximum number of letters to change, insert, drop or exchange with a neighbour.
const MAX_EDITS: usize = 2;

/// Maximum length of a word; no key is longer.
const MAX_LETTERS: usize = 64;

/// The word of `allowed` nearest to `word`, if it is at most two letters away and shares at least one. Otherwise the one with `word` among its
/// parts, such as `von_mises` for `mises`.
pub(super) fn nearest<'a>(word: &str, allowed: &[&'a str]) -> Option<&'a str> {
    let letters = word.chars().count();
    if letters > MAX_LETTERS {
        return None;
    }
    allowed
        .iter()
        .map(|candidate| (damerau_levenshtein(word, candidate), *candidate))
        .filter(|(edits, candidate)| *edits <= MAX_EDITS && *edits < letters.min(candidate.len()))
        .min_by_key(|(edits, _)| *edits)
        .map(|(_, candidate)| candidate)
        .or_else(|| allowed.iter().find(|candidate| candidate.split('_').any(|part| part == word)).copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_near_words_are_suggested() {
        assert_eq!(nearest("sape", &["name", "shape"]), Some("shape"));
        assert_eq!(nearest("mises", &["neo_hookean", "von_mises"]), Some("von_mises"));
        assert_eq!(nearest("mass", &["density", "velocity"]), None);
        assert_eq!(nearest("of", &["by"]), None);
    }
}
