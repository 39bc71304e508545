//! The linearised forces of surface points on a device (`kernels/points.h`).

use super::device::{Buffer, Gpu, arguments};
use super::vectors::GpuVector;
use crate::lists::Lists;

/// Components of the motion of a free obstacle.
const MOTION: usize = 6;

/// The entry of a point that touches no free obstacle.
pub(crate) const NO_OBSTACLE: u32 = u32::MAX;

/// The points of loaded surfaces, or those in contact, as plain arrays. Matrices are stored column by column.
#[derive(Debug, Default)]
pub(crate) struct PointArrays {
    /// Of each point, and at the end: the first of its nodes.
    pub first: Vec<u32>,
    /// The nodes that move the points and take their forces, with weights.
    pub nodes: Vec<u32>,
    pub weights: Vec<f64>,
    /// For pressures, the change of the force with each of these nodes.
    pub blocks: Vec<f64>,
    /// For contact, the change of each point's force with its place, and the free obstacle that it touches.
    pub tangents: Vec<f64>,
    pub on_free: Vec<u32>,
    /// ∂f/∂q and ∂q/∂x of each point; empty without free obstacles.
    pub of_motion: Vec<f64>,
    pub motion: Vec<f64>,
    /// Number of obstacles, of which some may be free.
    pub obstacles: usize,
}

/// The points on a device.
#[derive(Debug)]
pub(crate) struct Points {
    dimension: usize,
    obstacles: usize,
    first: Buffer<u32>,
    nodes: Buffer<u32>,
    on_free: Buffer<u32>,
    /// Weights, blocks, tangents, ∂f/∂q and ∂q/∂x. Empty arrays have the address 0.
    numbers: [Buffer<f64>; 5],
    motions: Buffer<f64>,
    forces: Buffer<f64>,
    /// For each node, the first of its points, and the points with weights.
    by_node: [Buffer<u32>; 2],
    weights_by_node: Buffer<f64>,
}

/// `PointSums` of `kernels/data.h`.
#[derive(Clone, Copy, Default)]
#[repr(C)]
pub(super) struct PointSums {
    first: u64,
    points: u64,
    weights: u64,
    forces: u64,
}

impl PointArrays {
    /// For each of `nodal` nodes its points, in their order, and the weights of all these points.
    fn by_node(&self, nodal: usize) -> (Lists<u32>, Vec<f64>) {
        let entries = Lists::of_places(&self.nodes, nodal);
        let bounds = self.first.windows(2).zip(0..);
        let points: Vec<u32> = bounds.flat_map(|(bounds, point)| (bounds[0]..bounds[1]).map(move |_| point)).collect();
        let weights = entries.arrays()[1].iter().map(|&entry| self.weights[entry as usize]).collect();
        (entries.map(|entry| points[entry as usize]), weights)
    }
}

impl Points {
    /// The points, which act on some of `nodal` nodes; `None` without a point.
    pub(crate) fn new(gpu: &Gpu, dimension: usize, nodal: usize, arrays: &PointArrays) -> Option<Self> {
        let count = arrays.first.len().saturating_sub(1);
        if count == 0 {
            return None;
        }
        let (by_node, weights_by_node) = arrays.by_node(nodal);
        let PointArrays { weights, blocks, tangents, of_motion, motion, .. } = arrays;
        let obstacles = if motion.is_empty() { 0 } else { arrays.obstacles };
        Some(Self {
            dimension,
            obstacles,
            first: gpu.copy_of(&arrays.first),
            nodes: gpu.copy_of(&arrays.nodes),
            on_free: gpu.copy_of(&arrays.on_free),
            numbers: [weights, blocks, tangents, of_motion, motion].map(|list| gpu.copy_of(list)),
            motions: gpu.memory_for(obstacles * MOTION),
            forces: gpu.memory_for(count * dimension),
            by_node: by_node.arrays().map(|list| gpu.copy_of(list)),
            weights_by_node: gpu.copy_of(&weights_by_node),
        })
    }

    /// Computes the changes of the forces by a nodal field, and returns where they are.
    pub(super) fn forces(&self, gpu: &Gpu, u: &GpuVector) -> PointSums {
        let n = self.first.len() - 1;
        let address = |of: &Buffer<f64>| if of.len() == 0 { 0 } else { of.address() };
        let [weights, blocks, tangents, of_motion, motion] = self.numbers.each_ref().map(address);
        // `Points` of `kernels/points.h`.
        let arguments = arguments! {
            first: self.first.address(),
            nodes: self.nodes.address(),
            weights,
            blocks,
            tangents,
            on_free: self.on_free.address(),
            of_motion,
            motion,
            motions: address(&self.motions),
            obstacles: self.obstacles as i64,
            u: u.address(),
            forces: self.forces.address(),
            n: n as i64,
            dimension: self.dimension as i32,
        };
        gpu.launch_for("point_motions", self.obstacles * MOTION, &arguments);
        gpu.launch_for("point_forces", n, &arguments);
        let [first, points] = self.by_node.each_ref().map(Buffer::address);
        PointSums { first, points, weights: self.weights_by_node.address(), forces: self.forces.address() }
    }
}
