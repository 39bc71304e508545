//! A block of cells: its groups of particles, their shape-function values along each axis (weights), and its box of nodes.

use super::group::{Group, Window};
use crate::lanes::LANES;
use crate::tensor::Vector;

/// A cube of cells: its groups, its box of nodes, and the active nodes of the box. The up to eight particles of a group share a window of
/// nodes.
#[derive(Debug, Default)]
pub(super) struct Block {
    /// Number of its first group, over all blocks.
    pub(super) first: usize,
    /// Number of its first particle, over all blocks.
    pub(super) start: u32,
    pub(super) windows: Vec<Span>,
    /// Weights of the groups, one after the other, as in [`Window`].
    pub(super) weights: Vec<[f64; LANES]>,
    /// Particles of each group. The weights of unused lanes are zero.
    pub(super) particles: Vec<[u32; LANES]>,
    /// The nodal field of its nodes.
    pub(super) field: u32,
    /// Index of the first node of the box along each axis.
    pub(super) origin: [u32; 3],
    /// Nodes of the box along each axis; 1 along axes that do not exist.
    pub(super) size: [usize; 3],
    /// Active numbers of the block's nodes, ascending.
    pub(super) nodes: Vec<u32>,
    /// Places in the box of these `nodes`.
    pub(super) places: Vec<u32>,
    /// The active number of each place in the box, or [`NONE`]; empty in a block of another process.
    pub(super) numbers: Vec<u32>,
    /// Active nodes of the box, as a bit set for each row along x.
    pub(super) active: Vec<u64>,
}

/// The number of a node that is not active.
pub(super) const NONE: u32 = u32::MAX;

/// The position of a group's window in the box, and of its weights in the array.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// Index of its first row of weights.
    pub(super) weights: u32,
    /// The first node of the window, as a place in the box.
    pub(super) first: u32,
    /// Nodes along each axis; 1 along axes that do not exist.
    pub(super) width: [u8; 3],
    /// Number of particles.
    pub(super) lanes: u8,
}

impl Block {
    /// Number of groups.
    pub(super) fn len(&self) -> usize {
        self.windows.len()
    }

    /// Number of particles.
    pub(super) fn count(&self) -> usize {
        self.windows.iter().map(|group| usize::from(group.lanes)).sum()
    }

    /// Number of particles of each group.
    pub(super) fn lanes(&self) -> impl Iterator<Item = u8> {
        self.windows.iter().map(|group| group.lanes)
    }

    /// Makes this the block of another process: groups of `particles` with these numbers of lanes, without shape functions and nodes.
    pub(super) fn set_foreign(&mut self, field: u32, mut particles: impl Iterator<Item = u32>, lanes: &[u8]) {
        *self = Self { field, size: [1; 3], ..Self::default() };
        for &lanes in lanes {
            self.windows.push(Span { weights: 0, first: 0, width: [0; 3], lanes });
            let mut particle = |lane| if lane < usize::from(lanes) { particles.next() } else { None };
            self.particles.push(std::array::from_fn(|lane| particle(lane).unwrap_or(u32::MAX)));
        }
    }

    #[inline(always)]
    pub(super) fn group(&self, group: usize) -> Group<'_> {
        let lanes = usize::from(self.windows[group].lanes);
        Group { number: self.first + group, particles: &self.particles[group][..lanes] }
    }

    /// Window and weights of a group, in D dimensions.
    #[inline(always)]
    pub(super) fn window<const D: usize>(&self, group: usize) -> Window<'_> {
        let Span { weights: start, first, width, lanes } = self.windows[group];
        let width = width.map(usize::from);
        let rows = 2 * width[..D].iter().sum::<usize>();
        Window {
            dimension: D,
            width,
            weights: &self.weights[start as usize..start as usize + rows],
            lanes: usize::from(lanes),
            first: first as usize,
            stride: [self.size[0], self.size[0] * self.size[1]],
        }
    }

    /// The entries (place in the box, N, ∇N) of one particle, for the nodes with N ≠ 0 or ∇N ≠ 0.
    pub(super) fn entries<const D: usize>(
        &self,
        group: usize,
        lane: usize,
    ) -> impl Iterator<Item = (usize, f64, Vector<f64, D>)> {
        let window = self.window::<D>(group);
        let [wx, wy, wz] = window.width;
        let entry = move |i: usize| {
            let at = [i % wx, i / wx % wy, i / (wx * wy)];
            // N and dN/dx along each axis
            let weights: [[f64; 2]; D] = std::array::from_fn(|k| {
                let (n, dn) = window.axis(k);
                [n[at[k]][lane], dn[at[k]][lane]]
            });
            let n: f64 = weights.iter().map(|w| w[0]).product();
            let grad_n = Vector::<f64, D>::from_fn(|k, _| (0..D).map(|m| weights[m][usize::from(m == k)]).product());
            let place = window.first + at[0] + at[1] * window.stride[0] + at[2] * window.stride[1];
            (place, n, grad_n)
        };
        (0..wx * wy * wz).map(entry).filter(|(_, n, grad_n)| *n != 0.0 || grad_n.iter().any(|&g| g != 0.0))
    }

    /// The index in the grid of a place in the box.
    #[inline]
    pub(super) fn index<const D: usize>(&self, place: usize) -> [u32; D] {
        let [nx, ny, _] = self.size;
        let at = [place % nx, place / nx % ny, place / (nx * ny)];
        std::array::from_fn(|k| self.origin[k] + at[k] as u32)
    }

    /// Number of nodes in the box.
    pub(super) fn box_nodes(&self) -> usize {
        self.size.iter().product()
    }

    /// Bytes of the block with its arrays.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self)
            + size_of_val(self.windows.as_slice())
            + size_of_val(self.weights.as_slice())
            + size_of_val(self.particles.as_slice())
            + size_of_val(self.nodes.as_slice())
            + size_of_val(self.places.as_slice())
            + size_of_val(self.numbers.as_slice())
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
