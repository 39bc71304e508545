//! The equilibrium of a step with its tangent as a matrix, for Newton's method.

use super::{BFree, BlockMatrix, Pattern, assemble};
use bfree::material::Law;
use bfree::mechanics::residual::{Equilibrium, Inadmissible};
use bfree::solver::{LinearOperator, NonlinearProblem, Preconditioner};
use bfree::tensor::{Tensor, Vector, identity, inverse};

/// An equilibrium whose tangent is assembled anew at every linearisation, on a given pattern; without follower pressure
/// and damping.
#[derive(Clone, Copy)]
pub struct Assembled<'a, const D: usize, L> {
    /// The equilibrium of the step.
    pub equilibrium: &'a Equilibrium<'a, D, L>,
    /// The pairs of nodes that share a particle.
    pub pattern: &'a Pattern,
}

/// The matrix on the free degrees of freedom, with the inverses of its diagonal blocks as preconditioner.
pub struct Matrix<'a, const D: usize, L> {
    problem: &'a Assembled<'a, D, L>,
    matrix: BlockMatrix<'a, D>,
    inverse_blocks: Vec<Tensor<f64, D>>,
}

impl<const D: usize, L: Law> NonlinearProblem for Assembled<'_, D, L> {
    type Inadmissible = Inadmissible;
    type Tangent<'t>
        = Matrix<'t, D, L>
    where
        Self: 't;

    fn residual(&self, x: &[f64], r: &mut [f64]) -> Result<(), Inadmissible> {
        NonlinearProblem::residual(self.equilibrium, x, r)
    }

    fn magnitude(&self, x: &[f64]) -> Result<f64, Inadmissible> {
        NonlinearProblem::magnitude(self.equilibrium, x)
    }

    fn potential(&self, x: &[f64]) -> Option<Result<(f64, f64), Inadmissible>> {
        NonlinearProblem::potential(self.equilibrium, x)
    }

    fn linearize(&self, x: &[f64]) -> Result<Matrix<'_, D, L>, Inadmissible> {
        let matrix = assemble(self.equilibrium, bytemuck::cast_slice(x), self.pattern, &BFree)?;
        let mut blocks: Vec<_> = (0..self.pattern.rows()).map(|node| matrix.get(node, node)).collect();
        for dof in self.equilibrium.prescribed {
            let (block, i) = (&mut blocks[dof.node], dof.component);
            block.row_mut(i).fill(0.0);
            block.column_mut(i).fill(0.0);
            block[(i, i)] = 1.0;
        }
        // A block that cannot be inverted is left alone: a worse preconditioner, no wrong answer.
        let regular = |inverse: Tensor<f64, D>| inverse.iter().all(|x| x.is_finite()).then_some(inverse);
        let inverse_blocks = blocks.iter().map(|block| regular(inverse(block)).unwrap_or_else(identity)).collect();
        Ok(Matrix { problem: self, matrix, inverse_blocks })
    }
}

impl<const D: usize, L: Law> LinearOperator for Matrix<'_, D, L> {
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let y: &mut [Vector<f64, D>] = bytemuck::cast_slice_mut(y);
        self.matrix.product(bytemuck::cast_slice(x), y);
        self.problem.equilibrium.clear_prescribed(y);
    }
}

impl<const D: usize, L: Law> Preconditioner for Matrix<'_, D, L> {
    fn precondition(&self, r: &[f64], z: &mut [f64]) {
        let (r, z): (&[Vector<f64, D>], &mut [Vector<f64, D>]) = (bytemuck::cast_slice(r), bytemuck::cast_slice_mut(z));
        for ((z, r), inverse) in z.iter_mut().zip(r).zip(&self.inverse_blocks) {
            *z = inverse * r;
        }
    }
}
