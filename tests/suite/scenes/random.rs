//! No override, however wrong, makes the reader panic. `hostile.rs` has wrong values and broken texts.

use super::overridden;
use proptest::prelude::*;
use serde_json::json;

/// Values that a scene's author, or a broken program, may write.
const JUNK: [&str; 12] =
    ["null", "true", "-1", "1e308", "1e-320", "1e999", "\"\"", "[]", "[[]]", "{}", "{\"union\":[]}", "[[0,[0,null]]]"];

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_override_brings_the_reader_down(
        key in "[a-z0-9.\\[\\]]{0,20}|time\\.[a-z]{1,5}|bodies\\.[0-4]\\.[a-z]{1,8}",
        value in ".{0,12}",
        junk in prop::sample::select(JUNK.to_vec()),
        number in any::<f64>(),
    ) {
        for argument in [format!("{key}={value}"), format!("{key}={junk}"), format!("{key}={}", json!(number)), key] {
            if let Err(error) = overridden(&[argument.as_str()]) {
                let message = error.to_string();
                prop_assert!(!message.is_empty() && message.len() < 100_000);
            }
        }
    }
}
