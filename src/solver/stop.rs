//! A request to end a long step, such as Ctrl-C.

use std::fmt::{self, Debug};
use std::sync::Arc;

/// A function that tells whether the step is to end. It is called before every Newton iteration. If it returns true, the step fails and
/// nothing is lost.
#[derive(Clone)]
pub struct Stop(pub Arc<dyn Fn() -> bool + Send + Sync>);

impl Debug for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Stop")
    }
}
