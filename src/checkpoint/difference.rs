//! The first key in which two scenes differ.

use serde_json::Value;

/// Keys that change no step of a run: the schema, the title, the end and the time between checkpoints.
const KEYS_WITHOUT_EFFECT: [&str; 4] = ["$schema", "title", "time.end", "output.checkpoint"];

/// A key with different values. `None` is an absent value.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Difference {
    pub key: String,
    pub then: Option<Value>,
    pub now: Option<Value>,
}

/// The first differing key that changes the steps or the files of a run.
pub(super) fn first(then: &Value, now: &Value) -> Option<Difference> {
    within("", Some(then), Some(now))
}

fn within(key: &str, then: Option<&Value>, now: Option<&Value>) -> Option<Difference> {
    // In a scene, an absent key and null mean the same.
    let present = |value: Option<&Value>| value.is_some_and(|value| !value.is_null());
    match (then, now) {
        _ if then == now || (!present(then) && !present(now)) || KEYS_WITHOUT_EFFECT.contains(&key) => None,
        (Some(Value::Object(then)), Some(Value::Object(now))) => {
            let keys = then.keys().chain(now.keys().filter(|key| !then.contains_key(*key)));
            let path = |name: &str| if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
            keys.filter_map(|name| within(&path(name), then.get(name), now.get(name))).next()
        }
        (Some(Value::Array(then)), Some(Value::Array(now))) => {
            let entries = 0..then.len().max(now.len());
            entries.filter_map(|i| within(&format!("{key}[{i}]"), then.get(i), now.get(i))).next()
        }
        _ => Some(Difference { key: key.to_owned(), then: then.cloned(), now: now.cloned() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_key_is_named_wherever_it_is() {
        let scene = json!({"title": "a", "time": {"step": 0.1, "end": 1}, "bodies": [{"density": 1}, {"density": 2}], "gravity": null});
        let changed = |pointer: &str, value: Value| {
            let mut other = scene.clone();
            *other.pointer_mut(pointer).unwrap() = value;
            first(&scene, &other).map(|difference| difference.key)
        };
        assert_eq!(changed("/time/step", json!(0.2)), Some("time.step".into()));
        assert_eq!(changed("/bodies/1/density", json!(3)), Some("bodies[1].density".into()));
        assert_eq!(changed("/bodies", json!([{"density": 1}])), Some("bodies[1]".into()));
        assert_eq!(changed("/gravity", json!({})), Some("gravity".into()));
        assert_eq!(changed("/time/end", json!(7)), None);
        assert_eq!(changed("/title", json!("b")), None);
        assert_eq!(first(&json!({"a": null}), &json!({})), None);
        assert_eq!(first(&json!({}), &json!({"a": 1})).map(|difference| difference.key), Some("a".into()));
    }
}
