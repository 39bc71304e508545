//! The plan of a run in several processes: the bytes that each process holds, and the bytes that it tells the others.

use super::Plan;
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::sweep::ShapeFunctionError;
use crate::simulation::Simulation;
use crate::tensor::Vector;
use indicatif::BinaryBytes;
use std::fmt::{Display, Formatter};

/// Bytes of a particle of another process: its place in a group of at most eight, 44 bytes, and its number of lanes.
const FOREIGN: usize = 6;

/// The requirements of each process of a run in several processes.
#[derive(Clone, Debug, PartialEq)]
pub struct ProcessUse {
    /// The number of processes.
    pub processes: usize,
    /// The largest share of the particles that a process has, of 1.
    pub share: f64,
    /// The most bytes that a process holds.
    pub bytes: u64,
    /// Bytes of the arrays that every process has whole.
    pub whole: u64,
    /// The most bytes that a process tells all others after a product with the tangent.
    pub told: u64,
}

impl ProcessUse {
    /// The requirements of a simulation in its present state, whose plan is given.
    ///
    /// ```
    /// use bfree::plan::{Plan, ProcessUse};
    ///
    /// let scene = bfree::scene::read_file("scenes/block_static.json".as_ref(), &[])?;
    /// let simulation = scene.build::<3>("scenes".as_ref())?;
    /// let plan = Plan::of(&simulation)?;
    /// let of = |processes| ProcessUse::of(&simulation, &plan, processes);
    /// assert_eq!((of(1)?.bytes, of(1)?.told, of(1)?.share), (plan.bytes(), 0, 1.0));
    /// assert!(of(4)?.bytes < of(2)?.bytes && of(2)?.bytes < plan.bytes() && of(4)?.share < 0.3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// A particle has no shape functions.
    pub fn of<const D: usize, L: Law, A: ShapeFunction>(
        simulation: &Simulation<D, L, A>,
        plan: &Plan,
        processes: usize,
    ) -> Result<Self, ShapeFunctionError> {
        let sum = |shared: bool| plan.arrays.iter().filter(|one| one.is_shared == shared).map(|one| one.bytes).sum();
        let (shared, mut whole): (u64, u64) = (sum(true), sum(false));
        if processes <= 1 {
            return Ok(Self { processes: 1, share: 1.0, bytes: shared + whole, whole, told: 0 });
        }
        let connectivity = simulation.new_connectivity(None)?;
        let (count, nodes) = (simulation.particles.len(), connectivity.nodes());
        let [largest, told] = connectivity.largest_shares(processes);
        let vector = size_of::<Vector<f64, D>>();
        // The positions and the places of all particles; the lists of nodes, and the sums of all processes.
        whole += (count * (vector + FOREIGN) + nodes * (2 * size_of::<u32>() + vector)) as u64;
        let shared = shared + (connectivity.box_bytes(processes) - connectivity.box_bytes(1)) as u64;
        let share = largest as f64 / count as f64;
        let bytes = whole + (shared as f64 * share) as u64;
        Ok(Self { processes, share, bytes, whole, told: (told * vector) as u64 })
    }
}

impl Display for ProcessUse {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { processes, share, bytes, whole, told } = *self;
        let [bytes, whole, told] = [bytes, whole, told].map(BinaryBytes);
        write!(f, "processes     {processes}: at most {bytes} each, {whole} of them whole in every process; ")?;
        write!(f, "{:.1} % of the particles, and {told} told to the others after a product", 100.0 * share)
    }
}
