//! A block of cells: its groups of particles, their shape-function values along each axis (weights), and its box of nodes.

use super::kernel::Window;
use crate::lanes::LANES;
use crate::tensor::Vector;

/// A cube of cells: its groups, its box of nodes, and the active nodes of the box.
#[derive(Clone, Debug, Default)]
pub(super) struct Block {
    /// The groups of its particles.
    pub(super) groups: Groups,
    /// Index of the first node of the box along each axis.
    pub(super) origin: [u32; 3],
    /// Nodes of the box along each axis; 1 along axes that do not exist.
    pub(super) size: [usize; 3],
    /// Active numbers of the block's nodes, ascending.
    pub(super) nodes: Vec<u32>,
    /// Places in the box of these `nodes`.
    pub(super) places: Vec<u32>,
    /// Active nodes of the box, as a bit set for each row along x.
    pub(super) active: Vec<u64>,
}

/// The groups of a block. The up to eight particles of a group share a window of nodes.
#[derive(Clone, Debug, Default)]
pub struct Groups {
    /// 1, 2 or 3.
    pub(super) dimension: usize,
    /// Nodes of the box from one row to the next, and from one plane to the next.
    pub(super) stride: [usize; 2],
    /// Number of the first group, over all blocks.
    pub(super) first: usize,
    pub(super) windows: Vec<Span>,
    /// Weights of the groups, one after the other, as in [`Window`].
    pub(super) weights: Vec<[f64; LANES]>,
    /// Particles of each group. The weights of unused lanes are zero.
    pub(super) particles: Vec<[u32; LANES]>,
}

/// The position of a group's window in the box, and of its weights in the array.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    /// Index of its first row of weights.
    pub(super) weights: u32,
    /// The first node of the window, as a place in the box.
    pub(super) first: u32,
    /// Nodes along each axis; 1 along axes that do not exist.
    pub(super) width: [u8; 3],
    /// Number of particles.
    pub(super) lanes: u8,
}

/// The particles of a group, by their index in memory, and the group's number over all blocks.
#[derive(Clone, Copy, Debug)]
pub struct Group<'a> {
    /// From 0.
    pub number: usize,
    /// Up to eight particles, one a lane.
    pub particles: &'a [u32],
}

impl Groups {
    /// An empty list that reuses the arrays of `self`.
    pub(super) fn emptied(mut self, dimension: usize, size: [usize; 3]) -> Self {
        self.windows.clear();
        self.weights.clear();
        self.particles.clear();
        Self { dimension, stride: [size[0], size[0] * size[1]], first: 0, ..self }
    }

    pub(super) fn len(&self) -> usize {
        self.windows.len()
    }

    #[inline(always)]
    pub(super) fn group(&self, group: usize) -> Group<'_> {
        let lanes = usize::from(self.windows[group].lanes);
        Group { number: self.first + group, particles: &self.particles[group][..lanes] }
    }

    /// Window and weights of a group.
    #[inline(always)]
    pub(super) fn window(&self, group: usize) -> Window<'_> {
        let Span { weights: start, first, width, lanes } = self.windows[group];
        let width = width.map(usize::from);
        let rows = 2 * width[..self.dimension].iter().sum::<usize>();
        Window {
            dimension: self.dimension,
            width,
            weights: &self.weights[start as usize..start as usize + rows],
            lanes: usize::from(lanes),
            first: first as usize,
            stride: self.stride,
        }
    }

    /// Calls `visit(place in the box, N, ∇N)` for the nodes with N ≠ 0 or ∇N ≠ 0 at a particle.
    #[inline(always)]
    pub(super) fn entries<const D: usize>(
        &self,
        group: usize,
        lane: usize,
        mut visit: impl FnMut(usize, f64, Vector<f64, D>),
    ) {
        let window = self.window(group);
        let weights = |k: usize, at: usize| {
            let (n, dn) = window.axis(k);
            [n[at][lane], dn[at][lane]]
        };
        // Along an axis that does not exist N = 1.
        let mut w = [[1.0, 0.0]; 3];
        for z in 0..window.width[2] {
            if D > 2 {
                w[2] = weights(2, z);
            }
            for y in 0..window.width[1] {
                if D > 1 {
                    w[1] = weights(1, y);
                }
                let row = window.first + y * window.stride[0] + z * window.stride[1];
                for x in 0..window.width[0] {
                    w[0] = weights(0, x);
                    let n: f64 = (0..D).map(|k| w[k][0]).product();
                    let grad_n: Vector<f64, D> =
                        Vector::from_fn(|k, _| (0..D).map(|m| w[m][usize::from(m == k)]).product());
                    if n != 0.0 || grad_n.iter().any(|&g| g != 0.0) {
                        visit(row + x, n, grad_n);
                    }
                }
            }
        }
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.windows.as_slice())
            + size_of_val(self.weights.as_slice())
            + size_of_val(self.particles.as_slice())
    }
}

impl Block {
    /// Number of nodes in the box.
    pub(super) fn box_nodes(&self) -> usize {
        self.size.iter().product()
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(self)
            + self.groups.bytes()
            + size_of_val(self.nodes.as_slice())
            + size_of_val(self.places.as_slice())
            + size_of_val(self.active.as_slice())
    }

    /// Calls `add(place in the box, node − first)` for the active nodes `first .. end`.
    pub(super) fn each_node(&self, first: usize, end: usize, mut add: impl FnMut(usize, usize)) {
        let place_of = |bound: usize| self.nodes.partition_point(|&node| (node as usize) < bound);
        let range = place_of(first)..place_of(end);
        for (&node, &place) in self.nodes[range.clone()].iter().zip(&self.places[range]) {
            add(place as usize, node as usize - first);
        }
    }
}
