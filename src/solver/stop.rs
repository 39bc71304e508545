//! The wish that a step that takes long should end: Ctrl-C.

use std::fmt::{self, Debug};
use std::sync::Arc;

/// Whether somebody wants a step to end, asked before every iteration of Newton's method. The step then fails, and loses nothing.
#[derive(Clone)]
pub struct Stop(pub Arc<dyn Fn() -> bool + Send + Sync>);

impl Debug for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Stop")
    }
}
