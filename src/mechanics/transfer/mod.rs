//! Particle-to-grid transfer (eqs. 40–42) and grid-to-particle transfer (eqs. 45, 50–52).

mod nodal;
mod update;

pub use nodal::{Nodal, Projection};
pub use update::{Committed, Update, WallUpdate};
