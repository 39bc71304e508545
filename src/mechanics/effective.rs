//! Effective shape functions of inner nodes: those of a node itself, plus the weighted ones of the outer nodes that follow it.

use crate::mechanics::sweep::{Connectivity, Quadratic};
use crate::pooled::Pooled;
use crate::space::Space;
use crate::tensor::{Tensor, Vector};

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

impl<const D: usize> Space<D> {
    /// The effective shape functions at a particle, with their nodes.
    pub(crate) fn functions(&self, connectivity: &Connectivity<D>, particle: usize) -> Vec<(usize, Function<D>)> {
        let mut all: Vec<_> =
            connectivity.of(particle).map(|(node, n, grad_n)| (node, Function::of_all(n, grad_n))).collect();
        for (node, n, grad_n) in connectivity.of(particle) {
            let Some((follows, leaders)) = self.followers().row(node) else { continue };
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

    /// For each particle, whether an outer node supports it.
    pub(crate) fn reached(&self, connectivity: &Connectivity<D>) -> Vec<bool> {
        let mut outer: Pooled<Vector<f64, D>> = connectivity.field();
        self.followers().rows().for_each(|(node, ..)| outer[node].fill(1.0));
        connectivity.evaluate(&outer, |_, n, grad_n| n.iter().chain(&grad_n).any(|x| *x != 0.0))
    }

    /// Adds corrections of the diagonal blocks of a quadratic form at one particle: effective shape functions replace N and ∇N.
    pub(crate) fn add_followers(
        &self,
        connectivity: &Connectivity<D>,
        particle: usize,
        form: &Quadratic,
        lane: usize,
        added: &mut Vec<(usize, Tensor<f64, D>)>,
    ) {
        for (node, function) in self.functions(connectivity, particle) {
            let rows: [Tensor<f64, D>; D] =
                std::array::from_fn(|i| form.block(lane, function.value[i], &function.gradient[i]));
            added.push((node, Tensor::from_fn(|i, k| rows[i][(i, k)])));
        }
        for (node, n, grad_n) in connectivity.of(particle) {
            added.push((node, -form.block(lane, n, &grad_n)));
        }
    }
}
