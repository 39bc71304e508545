//! A grid that is kept: over several steps shape functions stay those of the configuration in which the grid was new. Nothing is projected
//! between them, the motion φ of the nodes since then adds up, and F = (I + Σ φ ⊗ ∇N) F_k, with F_k of that configuration: what comes out
//! does not depend on the number of steps.
//!
//! A step over a kept grid is thus one that starts where the grid was new, and whose unknown is φ and not Δφ.

use crate::grid::{Grid, indices};
use crate::mechanics::loads::Prescribed;
use crate::mechanics::transfer::Nodal;
use crate::nodes::Nodes;
use crate::particles::Particles;
use crate::pooled::Pool;
use crate::tensor::{Tensor, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::fmt::{Display, Formatter};

/// When the background grid is renewed. While a grid is kept, its held nodes stay held. It is renewed in any case where a body comes to a
/// part of a wall, or of a prescribed region, at which no body was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Renewal {
    /// After every step, as in the paper.
    #[default]
    EveryStep,
    /// Never.
    Never,
    /// After a step at whose end ‖½ (F_rᵀ F_r − I)‖ of a particle is larger than this (no unit), with F_r its deformation since.
    Strain(#[schemars(extend("exclusiveMinimum" = 0))] f64),
}

impl Renewal {
    /// Whether the grid stays after a step that ends with such a strain.
    pub fn keeps(self, strain: f64) -> bool {
        match self {
            Self::EveryStep => false,
            Self::Never => true,
            // Not a number is not small.
            Self::Strain(most) => strain <= most,
        }
    }
}

impl Display for Renewal {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::EveryStep => f.write_str("new in every step"),
            Self::Never => f.write_str("kept"),
            Self::Strain(most) => write!(f, "kept until a particle has strained by {most}"),
        }
    }
}

/// Where the grid was new, and the motion of its nodes since.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Kept<const D: usize> {
    /// x of the particles when the grid was new; where they are now while a step is under way.
    pub(crate) position: Vec<Vector<f64, D>>,
    /// H, likewise.
    pub(crate) displacement_gradient: Vec<Tensor<f64, D>>,
    /// φ of the active nodes.
    pub(crate) motion: Vec<Vector<f64, D>>,
    /// Δφ/Δt of the last step.
    pub(crate) rate: Vec<Vector<f64, D>>,
    /// v of the active nodes; none without inertia.
    pub(crate) velocity: Vec<Vector<f64, D>>,
    /// a
    pub(crate) acceleration: Vec<Vector<f64, D>>,
}

impl<const D: usize> Kept<D> {
    /// Takes the particles back to where the grid was new, or again to where they are.
    pub(crate) fn exchange(&mut self, particles: &mut Particles<D>) {
        std::mem::swap(&mut self.position, &mut particles.position);
        std::mem::swap(&mut self.displacement_gradient, &mut particles.displacement_gradient);
    }

    /// Remembers where the particles were when the grid was new, and what has become of the nodes in a step of length `dt`.
    pub(crate) fn renew(&mut self, particles: &Particles<D>, end: &Nodal<D>, dphi: &[Vector<f64, D>], dt: f64) {
        self.position.clone_from(&particles.position);
        self.displacement_gradient.clone_from(&particles.displacement_gradient);
        self.motion = end.motion.to_vec();
        self.velocity = end.velocity.to_vec();
        self.acceleration = end.acceleration.to_vec();
        self.rate = dphi.iter().map(|dphi| dphi / dt).collect();
    }

    /// What the nodes are at the start of a step, with their masses.
    pub(crate) fn state(&self, masses: Nodal<D>, pool: &Pool) -> Nodal<D> {
        let [velocity, acceleration, motion] =
            [&self.velocity, &self.acceleration, &self.motion].map(|field| pool.collect(field.iter().copied()));
        Nodal { velocity, acceleration, motion, ..masses }
    }

    /// As [`Particles::rearrange`].
    pub(crate) fn rearrange(&mut self, order: &[u32]) {
        self.position = order.iter().map(|&from| self.position[from as usize]).collect();
        self.displacement_gradient = order.iter().map(|&from| self.displacement_gradient[from as usize]).collect();
    }

    /// Whether a particle has come into a cell with a prescribed node that feels nothing yet, from one without such a node of that condition.
    pub(crate) fn meets(
        &self,
        present: &[Vector<f64, D>],
        prescribed: &[Prescribed<D>],
        grid: &Grid<D>,
        nodes: &Nodes,
    ) -> bool {
        let corners = |cell: [u32; D]| indices([2; D]).map(move |by| std::array::from_fn(|k| cell[k] + by[k] as u32));
        let holders = |index: [u32; D]| {
            let position = grid.position(index);
            prescribed
                .iter()
                .enumerate()
                .filter(move |(_, one)| one.on.holds(grid, index, &position))
                .map(|(one, _)| one)
        };
        // Conditions that hold a new node, by the lower corner of its cells.
        let mut cells: Vec<_> = present.iter().filter_map(|x| Some(grid.id(grid.cell(x)?))).collect();
        cells.sort_unstable();
        cells.dedup();
        let mut met = HashSet::new();
        for cell in cells {
            for index in corners(grid.index(cell)).filter(|&index| nodes.number(grid.id(index)).is_none()) {
                met.extend(holders(index).map(|one| (cell, one)));
            }
        }
        if met.is_empty() {
            return false;
        }
        let was_there = |x: &Vector<f64, D>, one: usize| {
            grid.cell(x).is_some_and(|cell| corners(cell).any(|index| holders(index).any(|holder| holder == one)))
        };
        present.iter().zip(&self.position).any(|(x, before)| {
            let Some(cell) = grid.cell(x).map(|cell| grid.id(cell)) else { return false };
            (0..prescribed.len()).any(|one| met.contains(&(cell, one)) && !was_there(before, one))
        })
    }
}
