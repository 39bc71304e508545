//! Block-Jacobi: the inverses of the blocks on the diagonal.

use super::{DiagonalBlocks, Preconditioner};
use crate::pooled::Pooled;
use crate::solver::vector::Entry;
use crate::solver::{LinearOperator, Linearization};
use crate::tensor::{Tensor, Vector, determinant, inverse};

/// Block-Jacobi: the inverse D×D diagonal blocks of the first tangent it is prepared with, one block for each node. They are made once a
/// step, since they cost as much as a few products and change little in a step. Before that it is the identity.
///
/// Example: [`Preconditioner`].
#[derive(Clone, Debug, Default)]
pub struct BlockJacobi<const D: usize> {
    /// One block after the other, column by column.
    inverse: Pooled<f64>,
}

impl<const D: usize> BlockJacobi<D> {
    /// Number of nodes.
    pub(super) fn len(&self) -> usize {
        self.inverse.len() / D
    }

    /// The inverse blocks.
    pub(super) fn inverses(&self) -> &[Tensor<f64, D>] {
        bytemuck::cast_slice(&self.inverse)
    }

    /// Takes and inverts the blocks of `tangent`, unless it has blocks already.
    pub fn take(&mut self, tangent: &dyn DiagonalBlocks) {
        if self.inverse.is_empty() {
            self.inverse = tangent.diagonal_blocks();
            let blocks: &mut [Tensor<f64, D>] = bytemuck::cast_slice_mut(&mut self.inverse);
            blocks.iter_mut().for_each(|block| *block = invert_block(block));
        }
    }
}

impl<const D: usize> Preconditioner for BlockJacobi<D> {
    fn prepare<'a>(&'a mut self, tangent: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a> {
        self.take(tangent);
        Box::new(&*self)
    }

    fn prepare_single<'a>(&'a mut self, tangent: &'a dyn Linearization<f32>) -> Box<dyn LinearOperator<f32> + 'a> {
        self.take(tangent);
        Box::new(&*self)
    }
}

/// Products are computed in double precision and rounded to the precision of z at the end.
impl<S: Entry, const D: usize> LinearOperator<S> for BlockJacobi<D> {
    fn apply(&self, r: &[S], z: &mut [S]) {
        z.copy_from_slice(r);
        let blocks: &[Tensor<f64, D>] = bytemuck::cast_slice(&self.inverse);
        for (z, inverse) in z.chunks_exact_mut(D).zip(blocks) {
            let product = inverse * Vector::<f64, D>::from_fn(|i, _| z[i].value());
            z.iter_mut().zip(&product).for_each(|(z, &product)| *z = S::lit(product));
        }
    }
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

    /// An operator with the given diagonal blocks.
    struct Given(Vec<Tensor<f64, 2>>);

    impl DiagonalBlocks for Given {
        fn diagonal_blocks(&self) -> Pooled<f64> {
            Pooled::from(self.0.clone()).into_numbers()
        }
    }

    #[test]
    fn the_blocks_of_the_first_tangent_are_kept() {
        let (first, second) = (Tensor::<f64, 2>::new(4.0, 1.0, -2.0, 3.0), Tensor::<f64, 2>::new(1.0, 0.0, 5.0, 2.0));
        let (a, b) = (Vector::<f64, 2>::from([1.0, 2.0]), Vector::<f64, 2>::from([-3.0, 0.5]));
        let mut jacobi = BlockJacobi::<2>::default();
        let applied = |jacobi: &BlockJacobi<2>, a: &Vector<f64, 2>, b: &Vector<f64, 2>| {
            let r = [a[0], a[1], b[0], b[1]];
            let (mut z, mut rough) = ([f64::NAN; 4], [f32::NAN; 4]);
            jacobi.apply(&r, &mut z);
            jacobi.apply(&r.map(|r| r as f32), &mut rough);
            assert!(z.iter().zip(rough).all(|(z, rough)| (z - f64::from(rough)).abs() < 1e-6));
            z
        };
        assert_eq!(applied(&jacobi, &a, &b), [1.0, 2.0, -3.0, 0.5]);
        jacobi.take(&Given(vec![first, second]));
        jacobi.take(&Given(vec![second, first]));
        let z = applied(&jacobi, &(first * a), &(second * b));
        assert!(z.iter().zip([1.0, 2.0, -3.0, 0.5]).all(|(z, exact)| (z - exact).abs() < 1e-14), "{z:?}");
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
