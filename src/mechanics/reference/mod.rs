//! The reference configuration: where the grid was reset last. Updated and total Lagrangian steps take the same road.
//!
//! A *reset* of the grid takes the present configuration as the reference: shape functions are evaluated there, and velocities are projected
//! to the nodes. Between two resets the nodal motion φ adds up (total Lagrangian), and nothing is projected: with x_k and F_k at the reset,
//!
//! ```text
//! x = x_k + Σ φ N,   F = (I + Σ φ ⊗ ∇N) F_k.
//! ```
//!
//! The result then does not depend on the number of steps. With a reset in every step, φ is Δφ, and the formulation is updated Lagrangian.
//! [`Particles`](crate::particles::Particles) store x_k and F_k, and the state of the nodes is a [`Nodal`](crate::mechanics::transfer::Nodal).
//!
//! **Contact.** Bodies that share nodes stick, and on a grid that is not reset a body cannot leave a wall. The grid is therefore reset when
//! a particle reaches a prescribed condition or another body (`contact.rs`). Bodies that touch at the start are *bonded*: in load steps they
//! stay together, and do not cause resets.
//!
//! **Out-of-balance force.** In load steps, a state in balance on the old grid is not in balance on the new one. Its residual R₀ on the new
//! grid is carried over as a force on the nodes (`equilibrium.rs`), or each reset would add an error of its own to the stresses.

mod contact;
mod equilibrium;

pub(crate) use contact::{pairs, reached_body, reached_conditions, touch};
pub(crate) use equilibrium::LastEquilibrium;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt::{Display, Formatter};

/// When the background grid is reset. Between two resets the grid is kept, and its prescribed nodes stay prescribed. The grid is always
/// reset if a body reaches a part of a wall, or of a prescribed region, at which no body was. In load steps the grid is also reset if a
/// body reaches another body, and the two did not touch at the start. With inertia the grid is reset in every step while a body feels the
/// wall that it has reached, or while two bodies touch. In load steps, the out-of-balance force of the last converged state on the new grid
/// is carried over as a force on the nodes of the new grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GridReset {
    /// After every step, as in the paper.
    #[default]
    EveryStep,
    /// Never because of strain. Contact still resets the grid.
    Never,
    /// After a step at whose end ‖½ (F_rᵀ F_r − I)‖ of a particle is larger than this value (no unit). F_r is the deformation of the
    /// particle since the last reset.
    Strain(#[schemars(extend("exclusiveMinimum" = 0))] f64),
}

impl GridReset {
    /// Whether the grid is kept after a step that ends with this strain.
    pub fn keeps(self, strain: f64) -> bool {
        match self {
            Self::EveryStep => false,
            Self::Never => true,
            // NaN resets the grid.
            Self::Strain(most) => strain <= most,
        }
    }
}

impl Display for GridReset {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::EveryStep => f.write_str("reset in every step"),
            Self::Never => f.write_str("never reset"),
            Self::Strain(most) => write!(f, "reset when a particle has strained by {most}"),
        }
    }
}
