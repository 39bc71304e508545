//! The unknowns: nodal values that are neither prescribed nor follow inner nodes.

use crate::aggregation::{Extension, Followers, Occupied, Pieces};
use crate::grid::indices;
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::sweep::{Quadratic, Supports};
use crate::parallel::{self, PART};
use crate::particles::Particles;
use crate::pooled::{Pool, Pooled};
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector, identity};
use rustc_hash::FxHashMap;
use std::borrow::Cow;
use std::collections::BTreeSet;

/// Upper bound of the length of a particle's domain, in cells. Material need not fill the domain of a particle that is stretched further.
const LONGEST: f64 = 2.0;

/// The extension E of the bodies in a grid, from the volumes of the particles at the last grid reset. A particle fills the cells that its domain overlaps.
/// The filled share of a cell thus changes gradually as particles move into the cell. A cell that holds no particle counts as empty.
pub(crate) fn extension<const D: usize>(pieces: Pieces, particles: &Particles<D>, supports: &Supports<D>) -> Extension {
    let parts = (0..supports.field_count()).map(|field| of_field(field, pieces, particles, supports));
    Extension::joined(pieces.degree, parts)
}

/// The extension of one nodal field, and the number of its first node.
fn of_field<const D: usize>(
    field: u32,
    pieces: Pieces,
    particles: &Particles<D>,
    supports: &Supports<D>,
) -> (usize, Extension) {
    let (grid, reference) = (supports.grid(), particles.reference());
    let in_field = |p: usize| supports.field_of(particles.body[p]) == field;
    let local = |p: usize, k: usize| grid.axis(k).local(reference.position[p][k]).unwrap_or(0.0);
    // The cells of the particles, and the volumes in all cells that their domains overlap.
    let add = |p: usize, own: &mut Vec<[u32; D]>, volumes: &mut FxHashMap<[u32; D], f64>| {
        let cell = std::array::from_fn(|k| pieces.cell(local(p, k), grid.cells[k]));
        if own.last() != Some(&cell) {
            own.push(cell);
        }
        // The domain is a box. At F = I the box is a cube of the particle's volume. Its edge along axis k grows with |row k of F|.
        let f = identity::<f64, D>() + reference.displacement_gradient[p];
        let side = (particles.volume[p] / grid.spacing.powi(D as i32)).powf(1.0 / D as f64);
        let length = |k: usize| (side * f.row(k).norm()).min(LONGEST);
        let along: [_; D] = std::array::from_fn(|k| pieces.overlaps(local(p, k), length(k), grid.cells[k]));
        for which in indices::<D>(std::array::from_fn(|k| along[k].len() as u64)) {
            let parts: [(u32, f64); D] = std::array::from_fn(|k| along[k][which[k] as usize]);
            let volume = volumes.entry(parts.map(|(cell, _)| cell)).or_insert(0.0);
            *volume += reference.volume(p) * parts.iter().map(|(_, part)| part).product::<f64>();
        }
    };
    let parts = parallel::map(particles.len().div_ceil(PART), &|part| {
        let (mut own, mut volumes) = (Vec::new(), FxHashMap::default());
        let of_part = part * PART..particles.len().min((part + 1) * PART);
        of_part.filter(|&p| particles.is_solid(p) && in_field(p)).for_each(|p| add(p, &mut own, &mut volumes));
        (own, volumes)
    });
    let mut volumes: FxHashMap<[u32; D], f64> =
        parts.iter().flat_map(|(own, _)| own).map(|&cell| (cell, 0.0)).collect();
    // A cell takes its volumes in the order of the parts.
    for (cell, more) in parts.into_iter().flat_map(|(_, volumes)| volumes) {
        if let Some(volume) = volumes.get_mut(&cell) {
            *volume += more;
        }
    }
    let share = |(cell, volume): (&[u32; D], &f64)| {
        let whole: f64 = (0..D).map(|k| grid.spacing * pieces.within(cell[k], grid.cells[k])).product();
        (padded(*cell), volume / whole)
    };
    let range = supports.nodes_of(field);
    let of_field = supports.active().ids().skip(range.start).take(range.len());
    let nodes: Vec<[u32; 3]> = of_field.map(|id| padded(grid.index(id))).collect();
    let cells = volumes.iter().map(share).collect();
    let occupied = Occupied { dimension: D, grid: padded(grid.cells), nodes: &nodes, cells };
    (range.start, Extension::new(pieces, &occupied))
}

/// The index with zeros for axes that do not exist.
pub(crate) fn padded<const D: usize>(index: [u32; D]) -> [u32; 3] {
    std::array::from_fn(|k| index.get(k).copied().unwrap_or(0))
}

/// The unknowns among the nodal values of a step. Fields have an entry for every active node. Entries that are no unknowns have no meaning
/// in a field that is read, and are zero in forces.
#[derive(Clone, Debug)]
pub(crate) struct Unknowns<'a, const D: usize> {
    pub prescribed: &'a [PrescribedDof],
    pub followers: Followers<D>,
}

/// The effective shape function of a node at a particle, for each component: N and ∇N of the node, plus the weighted N and ∇N of its outer
/// nodes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Function<const D: usize> {
    pub value: [f64; D],
    pub gradient: [Vector<f64, D>; D],
}

impl<const D: usize> Function<D> {
    fn of_all(n: f64, grad_n: Vector<f64, D>) -> Self {
        Self { value: [n; D], gradient: [grad_n; D] }
    }
}

impl<'a, const D: usize> Unknowns<'a, D> {
    pub fn new(supports: &Supports<D>, prescribed: &'a [PrescribedDof]) -> Self {
        let extension = supports.extension().cloned().unwrap_or_default();
        let fixed = prescribed.iter().map(|dof| (dof.node, dof.component));
        Self { prescribed, followers: Followers::new(extension, fixed) }
    }

    /// E û
    pub fn extended<'b, T: Real + Send + Sync>(&self, field: &'b [Vector<T, D>]) -> Cow<'b, [Vector<T, D>]> {
        let mut field = Cow::Borrowed(field);
        if !self.followers.is_empty() {
            self.followers.extend(field.to_mut());
        }
        field
    }

    /// E û in pooled memory; `None` if no node follows others.
    pub fn extended_in(&self, pool: &Pool, field: &[Vector<f64, D>]) -> Option<Pooled<Vector<f64, D>>> {
        if self.followers.is_empty() {
            return None;
        }
        let mut extended = pool.unspecified(field.len(), Vector::zeros());
        parallel::zip(&mut extended, field, |extended, u| *extended = *u);
        self.followers.extend(&mut extended);
        Some(extended)
    }

    /// Sets the prescribed entries to zero.
    pub fn clear_prescribed<T: num_traits::Zero + Copy + nalgebra::Scalar>(&self, field: &mut [Vector<T, D>]) {
        mutant!("unknowns: prescribed values are not cleared": { return; });
        for dof in self.prescribed {
            field[dof.node][dof.component] = T::zero();
        }
    }

    /// The mask of prescribed values, node by node.
    pub(crate) fn prescribed_mask(&self, nodes: usize) -> Vec<bool> {
        let mut mask = vec![false; D * nodes];
        self.prescribed.iter().for_each(|dof| mask[dof.node * D + dof.component] = true);
        mask
    }

    /// The mask of values that follow inner nodes, node by node.
    pub(crate) fn following_mask(&self, nodes: usize) -> Vec<bool> {
        let mut mask = vec![false; D * nodes];
        for (outer, follows, _) in self.followers.rows() {
            mask[outer * D..(outer + 1) * D].copy_from_slice(&follows);
        }
        mask
    }

    /// The effective shape functions at a particle, with their nodes.
    pub fn functions(&self, supports: &Supports<D>, particle: usize) -> Vec<(usize, Function<D>)> {
        let mut all: Vec<_> =
            supports.of(particle).map(|(node, n, grad_n)| (node, Function::of_all(n, grad_n))).collect();
        for (node, n, grad_n) in supports.of(particle) {
            let Some((follows, leaders)) = self.followers.row(node) else { continue };
            let mut add = |node: usize, factor: f64, components: [bool; D]| {
                let place = all.iter().position(|(one, _)| *one == node).unwrap_or_else(|| {
                    all.push((node, Function::of_all(0.0, Vector::zeros())));
                    all.len() - 1
                });
                for i in (0..D).filter(|&i| components[i]) {
                    all[place].1.value[i] += factor * n;
                    all[place].1.gradient[i] += grad_n * factor;
                }
            };
            add(node, -1.0, follows);
            leaders.for_each(|(leader, weight)| add(leader, weight, follows));
        }
        all
    }

    /// The diagonal blocks of Eᵀ B E, for a block-diagonal B.
    pub(crate) fn restrict_blocks(&self, blocks: &mut [Tensor<f64, D>]) {
        for (outer, follows, leaders) in self.followers.rows() {
            let own = blocks[outer];
            let moved = Tensor::from_fn(|i, k| if follows[i] && follows[k] { own[(i, k)] } else { 0.0 });
            blocks[outer] -= moved;
            leaders.for_each(|(leader, weight)| blocks[leader] += moved * (weight * weight));
        }
    }

    /// For each particle, whether an outer node supports it.
    pub fn reached(&self, supports: &Supports<D>) -> Vec<bool> {
        let mut outer: Pooled<Vector<f64, D>> = supports.field();
        self.followers.rows().for_each(|(node, ..)| outer[node].fill(1.0));
        supports.evaluate(&outer, |_, n, grad_n| n.iter().chain(&grad_n).any(|x| *x != 0.0))
    }

    /// Adds corrections of the diagonal blocks of a quadratic form at one particle: effective shape functions replace N and ∇N.
    pub(crate) fn add_followers(
        &self,
        supports: &Supports<D>,
        particle: usize,
        form: &Quadratic,
        lane: usize,
        added: &mut Vec<(usize, Tensor<f64, D>)>,
    ) {
        for (node, function) in self.functions(supports, particle) {
            let rows: [Tensor<f64, D>; D] =
                std::array::from_fn(|i| form.block(lane, function.value[i], &function.gradient[i]));
            added.push((node, Tensor::from_fn(|i, k| rows[i][(i, k)])));
        }
        for (node, n, grad_n) in supports.of(particle) {
            added.push((node, -form.block(lane, n, &grad_n)));
        }
    }

    /// Sets the row and column of each value that is no unknown to those of the identity. Clears the off-diagonal entries of
    /// [`Self::uncoupled`] nodes.
    pub(crate) fn finish_blocks(&self, blocks: &mut [Tensor<f64, D>]) {
        for node in self.uncoupled() {
            blocks[node] = Tensor::from_diagonal(&blocks[node].diagonal());
        }
        let following = self
            .followers
            .rows()
            .flat_map(|(outer, follows, _)| (0..D).filter(move |&i| follows[i]).map(move |i| (outer, i)));
        for (node, i) in self.prescribed.iter().map(|dof| (dof.node, dof.component)).chain(following) {
            for k in 0..D {
                blocks[node][(i, k)] = 0.0;
                blocks[node][(k, i)] = 0.0;
            }
            blocks[node][(i, i)] = 1.0;
        }
    }

    /// The nodes whose effective shape functions differ between components.
    pub fn uncoupled(&self) -> BTreeSet<usize> {
        let apart = |follows: &[bool; D]| follows.iter().any(|one| *one != follows[0]);
        let rows = self.followers.rows().filter(|(_, follows, _)| apart(follows));
        rows.flat_map(|(_, _, leaders)| leaders.map(|(leader, _)| leader)).collect()
    }
}
