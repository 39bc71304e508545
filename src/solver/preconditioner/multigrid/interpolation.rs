//! Interpolation P from a coarse grid to a finer one, and restriction Pᵀ.

use crate::lists::Lists;
use crate::parallel;
use crate::tensor::Vector;
use rustc_hash::FxHashMap;

/// Nodes in one part of the work of a thread.
const PART: usize = 256;

/// P: the value of a finer node is the mean of the coarse nodes around it.
#[derive(Clone, Debug, Default)]
pub(super) struct Interpolation {
    /// The coarse nodes around each finer node.
    around: Lists<u32>,
    /// The finer nodes that are interpolated from each coarse node, in ascending order.
    within: Lists<u32>,
}

/// The nodes of the grid of twice the spacing around the node `index`. Where an index is odd, the node lies halfway between two coarse nodes.
fn between<const D: usize>(index: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    let upper = |corner: u32, k: usize| corner >> k & 1;
    let corners = (0..1 << D).filter(move |&corner| (0..D).all(|k| upper(corner, k) <= index[k] % 2));
    corners.map(move |corner| std::array::from_fn(|k| if k < D { index[k] / 2 + upper(corner, k) } else { 0 }))
}

impl Interpolation {
    /// The interpolation to the nodes with these indices. Returns also the indices of the coarse nodes, and their numbers.
    pub(crate) fn to<const D: usize>(nodes: &[[u32; 3]]) -> (Self, Vec<[u32; 3]>, FxHashMap<[u32; 3], u32>) {
        let (mut coarse, mut numbers) = (Vec::new(), FxHashMap::default());
        let mut around = Lists::default();
        for &index in nodes {
            around.push(between::<D>(index).map(|at| {
                *numbers.entry(at).or_insert_with(|| {
                    coarse.push(at);
                    coarse.len() as u32 - 1
                })
            }));
        }
        let within = around.transposed(coarse.len());
        (Self { around, within }, coarse, numbers)
    }

    /// The coarse nodes around each finer node, and their weight.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (&[u32], f64)> {
        (0..self.around.len()).map(|fine| self.row(fine))
    }

    /// The coarse nodes around each finer node, and the finer nodes of each coarse node.
    pub(crate) fn lists(&self) -> [&Lists<u32>; 2] {
        [&self.around, &self.within]
    }

    /// The finer nodes that are interpolated from a coarse node, ascending.
    pub(crate) fn finer(&self, coarse: usize) -> &[u32] {
        self.within.row(coarse)
    }

    /// The coarse nodes around a finer node, and their weight.
    pub(crate) fn row(&self, fine: usize) -> (&[u32], f64) {
        let list = self.around.row(fine);
        // The number of corners is a power of two.
        (list, 1.0 / list.len() as f64)
    }

    /// x += P y at values that are not `fixed`.
    pub(crate) fn prolong<const D: usize>(&self, fixed: &[bool], y: &[Vector<f64, D>], x: &mut [Vector<f64, D>]) {
        let parts = x.chunks_mut(PART).zip(fixed.chunks(D * PART)).enumerate();
        parallel::for_each(parts, &|(part, (x, fixed)): (usize, (&mut [Vector<f64, D>], &[bool]))| {
            for (node, (x, fixed)) in x.iter_mut().zip(fixed.chunks(D)).enumerate() {
                let (list, weight) = self.row(part * PART + node);
                for &coarse in list {
                    (0..D).filter(|&i| !fixed[i]).for_each(|i| x[i] += weight * y[coarse as usize][i]);
                }
            }
        });
    }

    /// Pᵀ r, with zero for the `fixed` values of r.
    pub(crate) fn restrict<const D: usize>(&self, fixed: &[bool], r: &[Vector<f64, D>]) -> Vec<Vector<f64, D>> {
        let mut out = bytemuck::zeroed_vec::<Vector<f64, D>>(self.within.len());
        parallel::for_each(out.chunks_mut(PART).enumerate(), &|(part, out): (usize, &mut [Vector<f64, D>])| {
            for (node, out) in out.iter_mut().enumerate() {
                for &fine in self.finer(part * PART + node) {
                    let fine = fine as usize;
                    let weight = self.row(fine).1;
                    (0..D).filter(|&i| !fixed[fine * D + i]).for_each(|i| out[i] += weight * r[fine][i]);
                }
            }
        });
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_fields_are_interpolated_exactly_and_restriction_is_the_transpose() {
        let nodes: Vec<[u32; 3]> = (0..5).flat_map(|i| (1..4).map(move |k| [i, k, 0])).collect();
        let (p, coarse, numbers) = Interpolation::to::<2>(&nodes);
        assert!(coarse.iter().zip(0..).all(|(at, number)| numbers[at] == number));
        let fixed: Vec<bool> = (0..2 * nodes.len()).map(|k| k % 7 == 0).collect();
        let at = |index: &[u32; 3]| Vector::from([2.0 * f64::from(index[0]), 1.0 - f64::from(index[1])]);
        let y: Vec<Vector<f64, 2>> = coarse.iter().map(|index| at(&index.map(|i| 2 * i))).collect();
        let mut x = vec![Vector::<f64, 2>::zeros(); nodes.len()];
        p.prolong(&fixed, &y, &mut x);
        for (node, index) in nodes.iter().enumerate() {
            (0..2).for_each(|i| assert_eq!(x[node][i], if fixed[2 * node + i] { 0.0 } else { at(index)[i] }));
        }
        let r: Vec<Vector<f64, 2>> =
            (0..nodes.len()).map(|i| Vector::from([i as f64, 1.0 / (1.0 + i as f64)])).collect();
        let restricted = p.restrict(&fixed, &r);
        let sum = |a: &[Vector<f64, 2>], b: &[Vector<f64, 2>]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
        assert!((sum(&x, &r) - sum(&y, &restricted)).abs() < 1e-12);
    }
}
