//! The equilibrium of a step with an assembled tangent, for Newton's method.

use super::{BFree, BlockMatrix, Pattern, assemble};
use bfree::material::Law;
use bfree::mechanics::residual::{Equilibrium, Inadmissible};
use bfree::pooled::Pooled;
use bfree::solver::{LinearOperator, Linearization, NonlinearProblem};
use bfree::tensor::{Tensor, Vector};

/// An equilibrium whose tangent is assembled at every linearisation, on a given pattern; without follower pressure and damping.
#[derive(Clone, Copy)]
pub struct Assembled<'a, const D: usize, L> {
    /// The equilibrium of the step.
    pub equilibrium: &'a Equilibrium<'a, D, L>,
    /// The pairs of nodes that share a particle.
    pub pattern: &'a Pattern,
}

/// The matrix on the free degrees of freedom.
pub struct Matrix<'a, const D: usize, L> {
    problem: &'a Assembled<'a, D, L>,
    matrix: BlockMatrix<'a, D>,
}

impl<const D: usize, L: Law> NonlinearProblem for Assembled<'_, D, L> {
    type Inadmissible = Inadmissible;

    fn residual(&self, x: &[f64], r: &mut [f64]) -> Result<(), Inadmissible> {
        NonlinearProblem::residual(self.equilibrium, x, r)
    }

    fn magnitude(&self, x: &[f64]) -> Result<f64, Inadmissible> {
        NonlinearProblem::magnitude(self.equilibrium, x)
    }

    fn potential(&self, x: &[f64]) -> Option<Result<(f64, f64), Inadmissible>> {
        NonlinearProblem::potential(self.equilibrium, x)
    }

    fn linearize(&self, x: &[f64]) -> Result<Box<dyn Linearization + '_>, Inadmissible> {
        let matrix = assemble(self.equilibrium, bytemuck::cast_slice(x), self.pattern, &BFree)?;
        Ok(Box::new(Matrix { problem: self, matrix }))
    }
}

impl<const D: usize, L: Law> LinearOperator for Matrix<'_, D, L> {
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let y: &mut [Vector<f64, D>] = bytemuck::cast_slice_mut(y);
        self.matrix.product(bytemuck::cast_slice(x), y);
        self.problem.equilibrium.clear_prescribed(y);
    }
}

impl<const D: usize, L: Law> Linearization for Matrix<'_, D, L> {
    fn diagonal_blocks(&self) -> Pooled<f64> {
        let Assembled { equilibrium, pattern } = self.problem;
        let mut blocks: Vec<Tensor<f64, D>> = (0..pattern.rows()).map(|node| self.matrix.get(node, node)).collect();
        for dof in equilibrium.prescribed {
            let (block, i) = (&mut blocks[dof.node], dof.component);
            block.row_mut(i).fill(0.0);
            block.column_mut(i).fill(0.0);
            block[(i, i)] = 1.0;
        }
        Pooled::from(blocks).into_numbers()
    }
}
