//! No value, text or override, however wrong, makes the reader panic.

use super::{GOOD, overridden};
use bfree::scene::{self, Scene, SceneError};
use proptest::prelude::*;
use serde_json::{Value, json};

/// Values that a scene's author, or a broken program, may write.
fn junk() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        prop::sample::select(vec![0.0, -0.0, -1.0, 0.5, 1e-320, 1e-150, 1e150, 1e308, -1e308, 3.0, 1e9])
            .prop_map(Value::from),
        ".{0,8}".prop_map(Value::from),
        prop::collection::vec(-2.0..5.0, 0..5).prop_map(Value::from),
        prop::sample::select(vec![
            json!({}),
            json!([]),
            json!([[]]),
            json!({"lme": {}}),
            json!("linear"),
            json!("gimp"),
            json!({"union": []}),
            json!({"ball": {"center": [1, 1], "radius": 1e300}}),
            json!([[0, [0, 0]]]),
            json!([[0, 1]]),
            json!("free"),
            json!({"young": 1e308, "poisson": 0.49999999999999994}),
            json!({"velocity": [[0, [null]]]}),
        ]),
    ]
}

/// Replaces, removes or repeats the value that is number `pick` of all values of the scene.
fn mutate(value: &mut Value, pick: &mut usize, junk: &Value, action: u8) -> bool {
    let children: Vec<&mut Value> = match value {
        Value::Object(object) => object.values_mut().collect(),
        Value::Array(list) => list.iter_mut().collect(),
        _ => Vec::new(),
    };
    for child in children {
        if mutate(child, pick, junk, action) {
            return true;
        }
    }
    if *pick > 0 {
        *pick -= 1;
        return false;
    }
    match (value, action) {
        (Value::Object(object), 1) => {
            let key = object.keys().next().cloned().unwrap_or_default();
            object.remove(&key);
        }
        (Value::Object(object), 2) => {
            object.insert("extra".into(), junk.clone());
        }
        (Value::Array(list), 1) => {
            list.pop();
        }
        (Value::Array(list), 2) => {
            let copy = list.first().cloned().unwrap_or_else(|| junk.clone());
            list.push(copy);
        }
        (value, _) => *value = junk.clone(),
    }
    true
}

/// Every refusal must be a message of bounded length, and not empty.
fn refused_well(result: Result<Scene, SceneError>) -> Result<(), TestCaseError> {
    if let Err(error) = result {
        let message = error.to_string();
        prop_assert!(!message.is_empty() && message.len() < 100_000);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_wrong_value_brings_the_reader_down(changes in prop::collection::vec((0..260_usize, junk(), 0..4_u8), 1..4)) {
        let mut scene: Value = serde_json::from_str(GOOD).unwrap();
        for (pick, junk, action) in changes {
            mutate(&mut scene, &mut pick.clone(), &junk, action);
        }
        refused_well(scene::read(&scene.to_string(), &[]))?;
    }

    #[test]
    fn no_broken_text_brings_the_reader_down(
        flips in prop::collection::vec((0..GOOD.len(), any::<u8>()), 0..4), cut in 0..2 * GOOD.len(),
        repeat in (0..GOOD.len(), 0..40_usize),
    ) {
        let mut bytes = GOOD.as_bytes().to_vec();
        for (at, byte) in flips {
            bytes[at] = byte;
        }
        let copy = bytes[repeat.0..(repeat.0 + repeat.1).min(bytes.len())].to_vec();
        bytes.splice(repeat.0..repeat.0, copy);
        bytes.truncate(cut);
        refused_well(scene::read(&String::from_utf8_lossy(&bytes), &[]))?;
    }

    #[test]
    fn no_override_brings_the_reader_down(key in "[a-z0-9.\\[\\]]{0,20}|time\\.[a-z]{1,5}|bodies\\.[0-4]\\.[a-z]{1,8}", value in ".{0,12}", junk in junk()) {
        for argument in [format!("{key}={value}"), format!("{key}={junk}"), key.clone()] {
            refused_well(overridden(&[argument.as_str()]))?;
        }
    }
}
