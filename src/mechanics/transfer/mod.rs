//! Particles → nodes (eqs. 40–42) and nodes → particles (eqs. 45, 50–52).

mod nodal;
mod update;

pub use nodal::{Nodal, Projection};
pub use update::{Committed, Update, WallUpdate};
