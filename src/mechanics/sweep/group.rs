//! A group: up to eight particles that share a window of nodes, and the data at these particles, a lane each.

use crate::lanes::LANES;
use crate::scalar::Real;
use crate::tensor::Vector;
use nalgebra::SMatrix;

/// The particles of a group, by their index in memory, and the group's number over all blocks.
#[derive(Clone, Copy, Debug)]
pub struct Group<'a> {
    /// From 0.
    pub number: usize,
    /// Up to eight particles, one a lane.
    pub particles: &'a [u32],
}

/// A group's window of nodes and its weights.
#[derive(Clone, Copy)]
pub struct Window<'a> {
    /// 1, 2 or 3.
    pub dimension: usize,
    /// Nodes along each axis; 1 along axes that do not exist.
    pub width: [usize; 3],
    /// Axis after axis: N of each node, then dN/dx of each node, a lane a particle.
    pub weights: &'a [[f64; LANES]],
    /// Number of particles. The lanes behind them are empty and have zero weights.
    pub lanes: usize,
    /// Place of the first node in the box of the block.
    pub first: usize,
    /// Nodes from one row of the box to the next, and from one plane to the next.
    pub stride: [usize; 2],
}

impl Window<'_> {
    /// N and dN/dx along axis `k`.
    #[inline(always)]
    pub(super) fn axis(&self, k: usize) -> (&[[f64; LANES]], &[[f64; LANES]]) {
        let start: usize = 2 * self.width[..k].iter().sum::<usize>();
        self.weights[start..start + 2 * self.width[k]].split_at(self.width[k])
    }
}

/// The data at the particles of a group, a lane each: values, and gradients by rows.
#[derive(Clone, Copy, Debug)]
pub struct At<X, const C: usize, const D: usize> {
    /// `value[c]`, of each lane
    pub value: [[X; LANES]; C],
    /// `gradient[c][k]`, of each lane
    pub gradient: [[[X; LANES]; D]; C],
}

impl<X: Real, const C: usize, const D: usize> At<X, C, D> {
    /// Zero everywhere.
    #[inline(always)]
    pub(crate) fn zero() -> Self {
        Self { value: [[X::zero(); LANES]; C], gradient: [[[X::zero(); LANES]; D]; C] }
    }

    /// u and L of one particle.
    #[inline(always)]
    pub fn lane(&self, lane: usize) -> (Vector<X, C>, SMatrix<X, C, D>) {
        let value = Vector::from_fn(|c, _| self.value[c][lane]);
        (value, SMatrix::from_fn(|c, k| self.gradient[c][k][lane]))
    }
}
