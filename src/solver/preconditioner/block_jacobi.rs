//! Block-Jacobi: the inverses of the blocks on the diagonal.

use super::Preconditioner;
use crate::gpu::{Buffer, GpuVector};
use crate::parallel;
use crate::pooled::Pooled;
use crate::solver::{LinearOperator, Linearization, OnDevice};
use crate::tensor::{Tensor, Vector, determinant, inverse};
use std::sync::Arc;

/// Block-Jacobi: the inverse D×D diagonal blocks of the first tangent it is prepared with, one block for each node. They are made once a
/// step, since they cost as much as a few products and change little in a step. Before that it is the identity.
///
/// Example: [`Preconditioner`].
#[derive(Clone, Debug, Default)]
pub struct BlockJacobi<const D: usize> {
    /// One block after the other, column by column.
    inverse: Pooled<f64>,
    /// Its copy on a device.
    on_device: Option<Arc<Buffer<f64>>>,
}

impl<const D: usize> BlockJacobi<D> {
    /// Number of unknowns.
    pub(super) fn len(&self) -> usize {
        self.inverse.len() / D
    }

    /// The inverse blocks.
    pub(super) fn inverses(&self) -> &[Tensor<f64, D>] {
        bytemuck::cast_slice(&self.inverse)
    }

    /// Takes and inverts the blocks of `tangent`, unless it has blocks already.
    pub fn take(&mut self, tangent: &dyn Linearization) {
        mutant!("solver: every tangent has new diagonal blocks": { self.inverse = Pooled::default(); });
        if self.inverse.is_empty() {
            self.inverse = tangent.diagonal_blocks();
            let blocks: &mut [Tensor<f64, D>] = bytemuck::cast_slice_mut(&mut self.inverse);
            parallel::each_by(PART, blocks, |_, block| *block = invert_block(block));
        }
    }
}

impl<const D: usize> Preconditioner for BlockJacobi<D> {
    fn prepare<'a>(&'a mut self, tangent: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a> {
        self.take(tangent);
        Box::new(|r: &[f64], z: &mut [f64]| self.apply(r, z))
    }

    fn prepare_on_device<'a>(
        &'a mut self,
        tangent: &'a dyn Linearization,
        system: &'a dyn OnDevice,
    ) -> Option<Box<dyn LinearOperator<GpuVector> + 'a>> {
        self.take(tangent);
        let (inverse, gpu) = (&self.inverse, system.gpu());
        let inverse = &**self.on_device.get_or_insert_with(|| Arc::new(gpu.copy_of(inverse)));
        Some(Box::new(|r: &GpuVector, z: &mut GpuVector| gpu.multiply_blocks(inverse, D, r, z)))
    }
}

impl<const D: usize> LinearOperator for BlockJacobi<D> {
    fn apply(&self, r: &[f64], z: &mut [f64]) {
        // Without blocks, the preconditioner is the identity.
        let whole = (self.inverse.len() / D).min(r.len());
        z[whole..].copy_from_slice(&r[whole..]);
        multiply_blocks(self.inverses(), r, z);
    }
}

/// Blocks in one part of the work of a thread.
const PART: usize = 512;

/// z = M r for a matrix M of diagonal blocks.
pub(super) fn multiply_blocks<const D: usize>(blocks: &[Tensor<f64, D>], r: &[f64], z: &mut [f64]) {
    let whole = D * blocks.len().min(r.len() / D).min(z.len() / D);
    let r: &[Vector<f64, D>] = bytemuck::cast_slice(&r[..whole]);
    let z: &mut [Vector<f64, D>] = bytemuck::cast_slice_mut(&mut z[..whole]);
    let parts = blocks.chunks(PART).zip(r.chunks(PART)).zip(z.chunks_mut(PART));
    parallel::for_each(parts, &|((blocks, r), z): ((&[_], &[_]), &mut [_])| {
        for ((block, r), z) in blocks.iter().zip(r).zip(z) {
            *z = block * r;
        }
    });
}

/// The inverse of a diagonal block. A node without stiffness and mass has a block that is singular to round-off. Such a block gives the
/// inverse of its diagonal, or the identity where the diagonal is zero too.
fn invert_block<const D: usize>(block: &Tensor<f64, D>) -> Tensor<f64, D> {
    // Rows are scaled to the diagonal first. Entries range over many orders of magnitude, and det may underflow.
    let diagonal = Vector::<f64, D>::from_fn(|i, _| {
        let d = block[(i, i)].abs();
        if d > 0.0 && d.is_finite() { d } else { 1.0 }
    });
    let unit = Tensor::<f64, D>::from_fn(|i, k| block[(i, k)] / diagonal[i]);
    let invertible = determinant(&unit).abs() > 1e-12;
    if invertible {
        let inverse = inverse(&unit);
        Tensor::from_fn(|i, k| inverse[(i, k)] / diagonal[k])
    } else {
        Tensor::from_fn(|i, k| if i == k { 1.0 / diagonal[i] } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_inverted_at_any_size_of_its_rows() {
        // A stiff row beside a nearly empty one: without scaling the determinant underflows.
        for (large, small) in [(1.0, 1.0), (1e12, 1e-9), (1e-150, 1e-200)] {
            let block = Tensor::<f64, 3>::new(
                4.0 * large,
                large,
                0.0,
                small,
                3.0 * small,
                -small,
                0.0,
                0.5 * large,
                2.0 * large,
            );
            let unit = invert_block(&block) * block;
            assert!((unit - Tensor::identity()).norm() < 1e-14, "{unit}");
        }
    }

    /// A block-diagonal matrix.
    struct Given(Vec<Tensor<f64, 2>>);

    impl LinearOperator for Given {
        fn apply(&self, x: &[f64], y: &mut [f64]) {
            for ((y, x), block) in y.chunks_exact_mut(2).zip(x.chunks_exact(2)).zip(&self.0) {
                y.copy_from_slice((block * Vector::<f64, 2>::from_column_slice(x)).as_slice());
            }
        }
    }

    impl Linearization for Given {
        fn diagonal_blocks(&self) -> Pooled<f64> {
            Pooled::from(self.0.clone()).into_numbers()
        }
    }

    #[test]
    fn the_blocks_of_the_first_tangent_are_kept() {
        let (first, second) = (Tensor::<f64, 2>::new(4.0, 1.0, -2.0, 3.0), Tensor::<f64, 2>::new(1.0, 0.0, 5.0, 2.0));
        let (a, b) = (Vector::<f64, 2>::from([1.0, 2.0]), Vector::<f64, 2>::from([-3.0, 0.5]));
        let mut jacobi = BlockJacobi::<2>::default();
        let given = Given(vec![first, second]);
        let exact = [a[0], a[1], b[0], b[1]];
        let (mut r, mut z) = ([f64::NAN; 4], [f64::NAN; 4]);
        jacobi.apply(&exact, &mut z);
        assert_eq!(z, exact);
        jacobi.take(&given);
        jacobi.take(&Given(vec![second, first]));
        given.apply(&exact, &mut r);
        jacobi.apply(&r, &mut z);
        assert!(z.iter().zip(exact).all(|(z, exact)| (z - exact).abs() < 1e-14), "{z:?}");
    }

    #[test]
    fn a_singular_block_gives_the_inverse_of_its_diagonal() {
        let singular = Tensor::<f64, 2>::new(4.0, 8.0, 1.0, 2.0);
        assert_eq!(invert_block(&singular), Tensor::<f64, 2>::new(0.25, 0.0, 0.0, 0.5));
        // A row without entries gives a row of the identity.
        let nothing = Tensor::<f64, 2>::new(0.0, 0.0, 0.0, 8.0);
        assert_eq!(invert_block(&nothing), Tensor::<f64, 2>::new(1.0, 0.0, 0.0, 0.125));
    }
}
