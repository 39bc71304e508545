//! The linearised forces of points in contact.

use super::FunctionsAt;
use crate::gpu::{self, Gpu};
use crate::mechanics::contact::{Carrier, FreePoint};
use crate::mechanics::sweep::Connectivity;
use crate::tensor::{Tensor, Vector};
use std::collections::BTreeMap;

/// The points in contact.
#[derive(Debug, Default)]
pub(crate) struct ContactRows<const D: usize> {
    rows: Vec<ContactRow<D>>,
    /// For each point, the end of its nodes in `weights`.
    ends: Vec<usize>,
    /// The nodes that move each point, with their weights.
    weights: Vec<(usize, f64)>,
    /// The number of obstacles.
    obstacles: usize,
}

/// A point in contact.
#[derive(Debug)]
pub(crate) struct ContactRow<const D: usize> {
    pub carriers: Vec<Carrier<D>>,
    /// −∂f/∂x of the force, at fixed poses of all obstacles.
    pub tangent: Tensor<f64, D>,
    /// The number of the free obstacle that the point touches, and how both depend on each other.
    pub on_free: Option<(usize, FreePoint<D>)>,
}

impl<const D: usize> ContactRows<D> {
    pub(crate) fn new(rows: Vec<ContactRow<D>>, obstacles: usize, connectivity: &Connectivity<D>) -> Self {
        let (mut ends, mut weights) = (Vec::with_capacity(rows.len()), Vec::new());
        for row in &rows {
            for carrier in &row.carriers {
                weights.extend(carrier.weights(connectivity).map(|(node, n)| (node, carrier.share * n)));
            }
            ends.push(weights.len());
        }
        Self { rows, ends, weights, obstacles }
    }

    /// Each point, and the nodes that move it.
    fn iter(&self) -> impl Iterator<Item = (&ContactRow<D>, &[(usize, f64)])> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        self.rows.iter().zip(starts.zip(&self.ends)).map(|(row, (start, &end))| (row, &self.weights[start..end]))
    }

    /// A copy on a device; `None` without a point.
    pub(crate) fn on_device(&self, gpu: &Gpu, nodal: usize) -> Option<gpu::Points> {
        let mut arrays = gpu::PointArrays { first: vec![0], obstacles: self.obstacles, ..gpu::PointArrays::default() };
        let has_free = self.rows.iter().any(|row| row.on_free.is_some());
        for (row, weights) in self.iter() {
            arrays.nodes.extend(weights.iter().map(|&(node, _)| node as u32));
            arrays.weights.extend(weights.iter().map(|&(_, weight)| weight));
            arrays.first.push(arrays.nodes.len() as u32);
            arrays.tangents.extend(row.tangent.iter());
            arrays.on_free.push(row.on_free.as_ref().map_or(gpu::NO_OBSTACLE, |&(obstacle, _)| obstacle as u32));
            if has_free {
                let free = row.on_free.as_ref().map_or_else(FreePoint::zero, |(_, free)| *free);
                arrays.of_motion.extend(free.of_motion.iter());
                arrays.motion.extend(free.motion.iter());
            }
        }
        gpu::Points::new(gpu, D, nodal, &arrays)
    }

    pub(crate) fn add_product(&self, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        let moved =
            |weights: &[(usize, f64)]| weights.iter().fold(Vector::zeros(), |sum, &(node, n)| sum + u[node] * n);
        // δq of the free obstacles
        let mut motions = vec![Vector::<f64, 6>::zeros(); self.obstacles];
        for (row, weights) in self.iter() {
            if let Some((obstacle, free)) = &row.on_free {
                motions[*obstacle] += free.motion * moved(weights);
            }
        }
        for (ContactRow { tangent, on_free, .. }, weights) in self.iter() {
            let mut force = tangent * moved(weights);
            if let Some((obstacle, free)) = on_free {
                force -= free.of_motion * motions[*obstacle];
            }
            weights.iter().for_each(|&(node, n)| out[node] += force * n);
        }
    }

    /// W_I² K, with the sum W_I over all places that the node moves. A free obstacle subtracts (Σ W_I ∂f/∂q) (Σ ∂q/∂x W_I).
    pub(crate) fn add_blocks(&self, functions: &FunctionsAt<'_, D>, blocks: &mut [Tensor<f64, D>]) {
        let mut through: BTreeMap<(usize, usize), FreePoint<D>> = BTreeMap::new();
        for ContactRow { carriers, tangent, on_free } in &self.rows {
            let mut of_node: BTreeMap<usize, [f64; D]> = BTreeMap::new();
            for Carrier { particle, share, offset } in carriers {
                for (node, function) in functions(*particle) {
                    let sum = of_node.entry(node).or_insert([0.0; D]);
                    (0..D).for_each(|i| sum[i] += share * (function.value[i] + function.gradient[i].dot(offset)));
                }
            }
            for (node, w) in of_node {
                blocks[node] += Tensor::from_fn(|i, k| w[i] * tangent[(i, k)] * w[k]);
                if let Some((obstacle, free)) = on_free {
                    through.entry((*obstacle, node)).or_insert_with(FreePoint::zero).add(free, &w);
                }
            }
        }
        for ((_, node), FreePoint { of_motion, motion }) in through {
            blocks[node] -= of_motion * motion;
        }
    }
}
