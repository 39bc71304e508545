//! The space of nodal fields: which nodes exist and how they are numbered, which values are prescribed, and which follow others; sums over
//! fields. Particles and laws it does not know.
//!
//! A nodal field has an entry for every active node. Entries that are no unknowns have no meaning in a field that is read, and are zero in
//! forces.

mod followers;
mod nodes;
pub mod vector;

pub use followers::Followers;
pub use nodes::Nodes;
pub(crate) use nodes::bits;

use crate::aggregation::Extension;
use crate::pooled::{Pool, Pooled};
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector};
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Arc;

/// The nodal fields of a step.
#[derive(Clone, Debug)]
pub(crate) struct Space<const D: usize> {
    /// Number of active nodes.
    nodes: usize,
    /// The prescribed values: (node, component).
    prescribed: Vec<(usize, usize)>,
    /// E, by which outer nodes follow inner ones.
    followers: Followers<D>,
    /// Memory of fields.
    pool: Pool,
}

impl<const D: usize> Space<D> {
    pub(crate) fn new(nodes: usize, extension: Arc<Extension>, prescribed: Vec<(usize, usize)>, pool: &Pool) -> Self {
        let followers = Followers::new(extension, prescribed.iter().copied());
        Self { nodes, prescribed, followers, pool: pool.clone() }
    }

    /// Number of entries of a field of vectors.
    pub(crate) fn entries(&self) -> usize {
        D * self.nodes
    }

    /// Number of unknowns.
    pub(crate) fn unknowns(&self) -> usize {
        let following: usize =
            self.followers.rows().map(|(_, follows, _)| follows.iter().filter(|one| **one).count()).sum();
        self.entries() - self.prescribed.len() - following
    }

    /// The prescribed values: (node, component).
    pub(crate) fn prescribed(&self) -> &[(usize, usize)] {
        &self.prescribed
    }

    /// E, by which outer nodes follow inner ones.
    pub(crate) fn followers(&self) -> &Followers<D> {
        &self.followers
    }

    /// E û
    pub(crate) fn extended<'b, T: Real + Send + Sync>(&self, field: &'b [Vector<T, D>]) -> Cow<'b, [Vector<T, D>]> {
        let mut field = Cow::Borrowed(field);
        if !self.followers.is_empty() {
            self.followers.extend(field.to_mut());
        }
        field
    }

    /// E û in pooled memory; `None` if no node follows others.
    pub(crate) fn extended_in_pool(&self, field: &[Vector<f64, D>]) -> Option<Pooled<Vector<f64, D>>> {
        if self.followers.is_empty() {
            return None;
        }
        let mut extended = self.pool.copy_of(field);
        self.followers.extend(&mut extended);
        Some(extended)
    }

    /// Sets the prescribed values to zero.
    pub(crate) fn clear_prescribed<T: num_traits::Zero + Copy + nalgebra::Scalar>(&self, field: &mut [Vector<T, D>]) {
        mutant!("unknowns: prescribed values are not cleared": { return; });
        for &(node, component) in &self.prescribed {
            field[node][component] = T::zero();
        }
    }

    /// The mask of prescribed values, node by node.
    pub(crate) fn prescribed_mask(&self) -> Vec<bool> {
        let mut mask = vec![false; self.entries()];
        self.prescribed.iter().for_each(|(node, component)| mask[node * D + component] = true);
        mask
    }

    /// The mask of values that follow inner nodes, node by node.
    pub(crate) fn following_mask(&self) -> Vec<bool> {
        let mut mask = vec![false; self.entries()];
        for (outer, follows, _) in self.followers.rows() {
            mask[outer * D..(outer + 1) * D].copy_from_slice(&follows);
        }
        mask
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
        for (node, i) in self.prescribed.iter().copied().chain(following) {
            for k in 0..D {
                blocks[node][(i, k)] = 0.0;
                blocks[node][(k, i)] = 0.0;
            }
            blocks[node][(i, i)] = 1.0;
        }
    }

    /// The nodes whose effective shape functions differ between components.
    pub(crate) fn uncoupled(&self) -> BTreeSet<usize> {
        let apart = |follows: &[bool; D]| follows.iter().any(|one| *one != follows[0]);
        let rows = self.followers.rows().filter(|(_, follows, _)| apart(follows));
        rows.flat_map(|(_, _, leaders)| leaders.map(|(leader, _)| leader)).collect()
    }
}
