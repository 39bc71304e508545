//! The configuration of the last grid reset. Between two resets, shape functions stay those of this configuration (total Lagrangian). With
//! a reset in every step the formulation is updated Lagrangian.
//!
//! Between two resets nothing is projected. The nodal motion φ since the last reset adds up, and F = (I + Σ φ ⊗ ∇N) F_k, with F_k at that
//! reset. The result does not depend on the number of steps.
//!
//! A step without a reset is thus a step that starts in the configuration of the last reset, and whose unknown is φ, not Δφ.

use crate::grid::{Grid, indices};
use crate::mechanics::loads::Prescribed;
use crate::mechanics::sweep::Supports;
use crate::mechanics::transfer::Nodal;
use crate::nodes::Nodes;
use crate::particles::Particles;
use crate::pooled::Pool;
use crate::tensor::{Tensor, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::fmt::{Display, Formatter};

/// A node belongs to one body if the variance of the body index at that node, relative to its mean square, is below this tolerance.
const ALONE: f64 = 1e-9;

/// When the background grid is reset. Between two resets the grid is kept, and its prescribed nodes stay prescribed. The grid is always
/// reset if a body reaches a part of a wall, or of a prescribed region, at which no body was. In load steps the grid is also reset if a
/// body reaches another body, and the two did not touch at the start. With inertia the grid is reset in every step while a body feels the
/// wall that it has reached, or while two bodies touch. In load steps, the out-of-balance force of the last converged state on the new grid
/// is carried over as a force on the nodes of the new grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Renewal {
    /// After every step, as in the paper.
    #[default]
    EveryStep,
    /// Never.
    Never,
    /// After a step at whose end ‖½ (F_rᵀ F_r − I)‖ of a particle is larger than this value (no unit). F_r is the deformation of the
    /// particle since the last reset.
    Strain(#[schemars(extend("exclusiveMinimum" = 0))] f64),
}

impl Renewal {
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

impl Display for Renewal {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::EveryStep => f.write_str("reset in every step"),
            Self::Never => f.write_str("never reset"),
            Self::Strain(most) => write!(f, "reset when a particle has strained by {most}"),
        }
    }
}

/// The configuration of the last grid reset, and the nodal motion since that reset.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Kept<const D: usize> {
    /// x of the particles at the last grid reset. During a step [`Self::exchange`] puts the present positions here.
    pub(crate) position: Vec<Vector<f64, D>>,
    /// H, stored like `position`.
    pub(crate) displacement_gradient: Vec<Tensor<f64, D>>,
    /// θ − 1, stored like `position`; empty if no body has mean dilatation.
    pub(crate) dilatation: Vec<f64>,
    /// φ of the active nodes.
    pub(crate) motion: Vec<Vector<f64, D>>,
    /// Δφ/Δt of the last step.
    pub(crate) rate: Vec<Vector<f64, D>>,
    /// v of the active nodes; empty without inertia.
    pub(crate) velocity: Vec<Vector<f64, D>>,
    /// a of the active nodes; empty without inertia.
    pub(crate) acceleration: Vec<Vector<f64, D>>,
    /// R₀, the out-of-balance force carried over from the grid before; empty with inertia, and on the first grid.
    pub(crate) unbalanced: Vec<Vector<f64, D>>,
}

impl<const D: usize> Kept<D> {
    /// Moves the particles to the configuration of the last grid reset. A second call moves them back.
    pub(crate) fn exchange(&mut self, particles: &mut Particles<D>) {
        std::mem::swap(&mut self.position, &mut particles.position);
        std::mem::swap(&mut self.displacement_gradient, &mut particles.displacement_gradient);
        std::mem::swap(&mut self.dilatation, &mut particles.dilatation);
    }

    /// Stores the configuration of the last grid reset, in which `particles` are, and the nodal state at the end of a step of length `dt`.
    pub(crate) fn renew(&mut self, particles: &Particles<D>, end: &Nodal<D>, dphi: &[Vector<f64, D>], dt: f64) {
        self.position.clone_from(&particles.position);
        self.displacement_gradient.clone_from(&particles.displacement_gradient);
        self.dilatation.clone_from(&particles.dilatation);
        self.motion = end.motion.to_vec();
        self.velocity = end.velocity.to_vec();
        self.acceleration = end.acceleration.to_vec();
        self.unbalanced = end.unbalanced.to_vec();
        self.rate = dphi.iter().map(|dphi| dphi / dt).collect();
    }

    /// The nodal state at the start of a step, with the mass of `masses`.
    pub(crate) fn state(&self, masses: Nodal<D>, pool: &Pool) -> Nodal<D> {
        let [velocity, acceleration, motion, unbalanced] =
            [&self.velocity, &self.acceleration, &self.motion, &self.unbalanced]
                .map(|field| pool.collect(field.iter().copied()));
        Nodal { velocity, acceleration, motion, unbalanced, ..masses }
    }

    /// Reorders the particle data, see [`Particles::rearrange`].
    pub(crate) fn rearrange(&mut self, order: &[u32]) {
        self.position = order.iter().map(|&from| self.position[from as usize]).collect();
        self.displacement_gradient = order.iter().map(|&from| self.displacement_gradient[from as usize]).collect();
        if !self.dilatation.is_empty() {
            self.dilatation = order.iter().map(|&from| self.dilatation[from as usize]).collect();
        }
    }

    /// The prescribed conditions that a particle has reached. Its cell has a node of the condition that is not active yet. At the last grid
    /// reset, its cell had no node of the condition.
    pub(crate) fn met(
        &self,
        present: &[Vector<f64, D>],
        prescribed: &[Prescribed<D>],
        grid: &Grid<D>,
        nodes: &Nodes,
    ) -> Vec<usize> {
        let holders = |index: [u32; D]| {
            let position = grid.position(index);
            prescribed
                .iter()
                .enumerate()
                .filter(move |(_, one)| one.on.holds(grid, index, &position))
                .map(|(one, _)| one)
        };
        // Pairs (cell, condition) where the condition holds a node of the cell that is not active yet.
        let mut new = HashSet::new();
        for (cell, ()) in cells(present.iter().map(|x| (x, ())), grid) {
            for index in corners(grid.index(cell)).filter(|&index| nodes.number(grid.id(index)).is_none()) {
                new.extend(holders(index).map(|one| (cell, one)));
            }
        }
        if new.is_empty() {
            return Vec::new();
        }
        let was_there = |x: &Vector<f64, D>, one: usize| {
            grid.cell(x).is_some_and(|cell| corners(cell).any(|index| holders(index).any(|holder| holder == one)))
        };
        let comes = |one: usize| {
            present.iter().zip(&self.position).any(|(x, before)| {
                grid.cell(x).is_some_and(|cell| new.contains(&(grid.id(cell), one)) && !was_there(before, one))
            })
        };
        (0..prescribed.len()).filter(|&one| comes(one)).collect()
    }

    /// Whether a particle has reached a body that its own body is not bonded to: its cell has a node of that body. At the last grid reset,
    /// its cell had no node of such a body.
    pub(crate) fn meets(&self, particles: &Particles<D>, joined: &BTreeSet<[u32; 2]>, grid: &Grid<D>) -> bool {
        let body = &particles.body;
        let [now, before] = [&particles.position, &self.position].map(|position| seen(position, body, grid));
        let beside = |x: &Vector<f64, D>, own: u32, seen: &HashMap<u64, BTreeSet<u32>>| {
            let others = |index| seen.get(&grid.id(index)).into_iter().flatten();
            let is_contact = |&other: &u32| other != own && !joined.contains(&pair(own, other));
            grid.cell(x).is_some_and(|cell| corners(cell).flat_map(others).any(is_contact))
        };
        let mut all = particles.position.iter().zip(&self.position).zip(body);
        all.any(|((x, was), &own)| beside(x, own, &now) && !beside(was, own, &before))
    }
}

fn pair(one: u32, other: u32) -> [u32; 2] {
    [one.min(other), one.max(other)]
}

/// The bodies in the cells around each node.
fn seen<const D: usize>(position: &[Vector<f64, D>], body: &[u32], grid: &Grid<D>) -> HashMap<u64, BTreeSet<u32>> {
    let mut seen: HashMap<u64, BTreeSet<u32>> = HashMap::new();
    for (cell, body) in cells(position.iter().zip(body.iter().copied()), grid) {
        for index in corners(grid.index(cell)) {
            seen.entry(grid.id(index)).or_default().insert(body);
        }
    }
    seen
}

/// The pairs of bodies that lie in cells with a common corner.
pub(crate) fn pairs<const D: usize>(position: &[Vector<f64, D>], body: &[u32], grid: &Grid<D>) -> BTreeSet<[u32; 2]> {
    let seen = seen(position, body, grid);
    let of_node = |bodies: &BTreeSet<u32>| {
        let bodies = bodies.clone();
        bodies.clone().into_iter().flat_map(move |one| bodies.clone().into_iter().map(move |other| [one, other]))
    };
    seen.values().flat_map(of_node).filter(|[one, other]| one < other).collect()
}

/// Whether two bodies lie in cells with a common corner now, or shared a node when the shape functions were evaluated.
pub(crate) fn touch<const D: usize>(particles: &Particles<D>, grid: &Grid<D>, supports: &Supports<D>) -> bool {
    if !pairs(&particles.position, &particles.body, grid).is_empty() {
        return true;
    }
    // The variance of the body index, weighted with N.
    let sum = |power: i32| {
        let mut sum: Vec<Vector<f64, 1>> = vec![Vector::zeros(); supports.active().len()];
        supports.spread(&mut sum, |p| Vector::from([f64::from(particles.body[p]).powi(power)]));
        sum
    };
    let [weights, means, squares] = [0, 1, 2].map(sum);
    let mut of_nodes = weights.iter().zip(&means).zip(&squares).map(|((w, m), s)| (w[0], m[0], s[0]));
    of_nodes.any(|(weight, mean, square)| weight * square - mean * mean > ALONE * weight * square)
}

/// The pairs of a cell's id and an item in that cell, sorted, each pair once.
fn cells<'a, const D: usize, T: Ord>(
    held: impl Iterator<Item = (&'a Vector<f64, D>, T)>,
    grid: &Grid<D>,
) -> Vec<(u64, T)> {
    let mut cells: Vec<_> = held.filter_map(|(x, what)| Some((grid.id(grid.cell(x)?), what))).collect();
    cells.sort_unstable();
    cells.dedup();
    cells
}

/// The nodes of a cell.
fn corners<const D: usize>(cell: [u32; D]) -> impl Iterator<Item = [u32; D]> {
    indices([2; D]).map(move |by| std::array::from_fn(|k| cell[k] + by[k] as u32))
}
