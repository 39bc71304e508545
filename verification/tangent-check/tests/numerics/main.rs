//! False alarms and the smallest errors seen, over seeded states of laws with consistent tangents.
//!
//! The suite takes 30 states a law. The full table: `STATES=250 cargo test --release -p tangent-check --test numerics -- --nocapture table`

mod cases;
mod laws;
mod table;
mod tensor;
mod verdicts;

use cases::Case;
use tangent_check::finding::Finding;
use tangent_check::judge::check_columns;

/// The check of a state.
fn check(case: &Case) -> Finding {
    check_columns(case.law, &case.claimed, &case.value, &mut |k, h| Ok((case.respond)(k, h)))
}

/// The number of states a law.
fn states() -> usize {
    std::env::var("STATES").ok().and_then(|states| states.parse().ok()).unwrap_or(30)
}
