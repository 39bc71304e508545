//! A block of cells: its groups of particles, their weights, and its box of nodes.

use super::kernel::Window;
use super::lanes::{LANES, SINGLE_LANES};
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector};

/// A cube of cells: its groups, its box of nodes, and which of them are active.
#[derive(Clone, Debug, Default)]
pub(super) struct Block {
    /// The particles.
    pub(super) groups: Groups<f64, LANES>,
    /// The same particles in the same order, for products in single precision.
    pub(super) single: Option<Groups<f32, SINGLE_LANES>>,
    /// Index of the first node of the box along each axis.
    pub(super) origin: [u32; 3],
    /// Nodes of the box along each axis; 1 along axes that do not exist.
    pub(super) size: [usize; 3],
    /// Active numbers of the block's nodes, ascending.
    pub(super) nodes: Vec<u32>,
    /// Their places in the box.
    pub(super) places: Vec<u32>,
    /// Which nodes of the box they are: a bit for each node of a row along x.
    pub(super) active: Vec<u64>,
}

/// Groups of up to `L` particles of a block, with a common window each.
#[derive(Clone, Debug, Default)]
pub(super) struct Groups<X, const L: usize> {
    /// 1, 2 or 3.
    pub(super) dimension: usize,
    /// Nodes of the box from one row to the next, and from one plane to the next.
    pub(super) stride: [usize; 2],
    /// Number of the first group, over all blocks.
    pub(super) first: usize,
    pub(super) windows: Vec<Group>,
    /// Weights of the groups, one after the other, as in [`Window`]; in single precision dN/dx is in units of 1/h.
    pub(super) weights: Vec<[X; L]>,
    /// Particles of each group; the lanes behind them hold zeros.
    pub(super) particles: Vec<[u32; L]>,
}

/// Particles and their common window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    /// Where its weights begin.
    pub(super) weights: u32,
    /// The first node of the window, as a place in the box.
    pub(super) first: u32,
    /// Nodes along each axis; 1 along axes that do not exist.
    pub(super) width: [u8; 3],
    /// Number of particles.
    pub(super) lanes: u8,
}

impl<X, const L: usize> Groups<X, L> {
    /// No groups yet, in the arrays of others.
    pub(super) fn renewed(self, dimension: usize, size: [usize; 3]) -> Self {
        let Self { mut windows, mut weights, mut particles, .. } = self;
        windows.clear();
        weights.clear();
        particles.clear();
        Self { dimension, stride: [size[0], size[0] * size[1]], first: 0, windows, weights, particles }
    }

    /// Number of groups.
    pub(super) fn len(&self) -> usize {
        self.windows.len()
    }

    /// The particles of a group.
    #[inline(always)]
    pub(super) fn particles(&self, group: usize) -> &[u32] {
        &self.particles[group][..usize::from(self.windows[group].lanes)]
    }

    /// Window and weights of a group.
    #[inline(always)]
    pub(super) fn window(&self, group: usize) -> Window<'_, X, L> {
        let Group { weights, first, width, lanes } = self.windows[group];
        let width = width.map(usize::from);
        let rows = 2 * width[..self.dimension].iter().sum::<usize>();
        Window {
            width,
            weights: &self.weights[weights as usize..weights as usize + rows],
            lanes: usize::from(lanes),
            first: first as usize,
            stride: self.stride,
        }
    }

    /// Calls `visit(group, lane, particle)`.
    pub(super) fn each(&self, mut visit: impl FnMut(usize, usize, usize)) {
        for group in 0..self.len() {
            for (lane, &p) in self.particles(group).iter().enumerate() {
                visit(group, lane, p as usize);
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
    /// Nodes of the box.
    pub(super) fn box_nodes(&self) -> usize {
        self.size.iter().product()
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(self)
            + self.groups.bytes()
            + self.single.as_ref().map_or(0, Groups::bytes)
            + size_of_val(self.nodes.as_slice())
            + size_of_val(self.places.as_slice())
            + size_of_val(self.active.as_slice())
    }

    /// Fills the box from a field on the active nodes; zero at the others.
    pub(super) fn fill<X: Real, T: Real, const D: usize>(&self, field: &[Vector<T, D>], nodal: &mut [X]) {
        nodal.fill(X::zero());
        for (&node, &place) in self.nodes.iter().zip(&self.places) {
            for c in 0..D {
                nodal[place as usize * D + c] = X::lit(field[node as usize][c].value());
            }
        }
    }

    /// Adds the part of the box, `numbers` numbers a node, that lies on the active nodes `first ..` of which `out` holds the sums.
    pub(super) fn add<X, O>(
        &self,
        buffer: &[X],
        numbers: usize,
        first: usize,
        out: &mut [O],
        add: impl Fn(&mut O, &[X]),
    ) {
        let start = self.nodes.partition_point(|&node| (node as usize) < first);
        let end = self.nodes.partition_point(|&node| (node as usize) < first + out.len());
        for (&node, &place) in self.nodes[start..end].iter().zip(&self.places[start..end]) {
            let place = place as usize * numbers;
            add(&mut out[node as usize - first], &buffer[place..place + numbers]);
        }
    }

    pub(super) fn boxed<T: Real, const D: usize>(&self, field: &[Vector<T, D>]) -> Vec<Vector<T, D>> {
        let mut nodal = vec![Vector::zeros(); self.box_nodes()];
        for (&node, &place) in self.nodes.iter().zip(&self.places) {
            nodal[place as usize] = field[node as usize];
        }
        nodal
    }

    /// Calls `visit(place in the box, N, ∇N)` for the nodes a particle sees: those with N ≠ 0 or ∇N ≠ 0.
    #[inline(always)]
    pub(super) fn entries<const D: usize>(
        &self,
        group: usize,
        lane: usize,
        mut visit: impl FnMut(usize, f64, Vector<f64, D>),
    ) {
        let window = self.groups.window(group);
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

    /// (Σ u_I N_I, Σ u_I ⊗ ∇_n N_I)
    #[inline(always)]
    pub(super) fn gather<T: Real, const D: usize>(
        &self,
        group: usize,
        lane: usize,
        nodal: &[Vector<T, D>],
    ) -> (Vector<T, D>, Tensor<T, D>) {
        let (mut value, mut gradient) = (Vector::<T, D>::zeros(), Tensor::<T, D>::zeros());
        self.entries::<D>(group, lane, |place, n, grad_n| {
            let (u, n) = (&nodal[place], T::lit(n));
            for i in 0..D {
                value[i] += u[i] * n;
                for k in 0..D {
                    gradient[(i, k)] += u[i] * T::lit(grad_n[k]);
                }
            }
        });
        (value, gradient)
    }
}
