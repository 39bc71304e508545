//! One sparse direct solve, by faer.

use super::BlockMatrix;
use bfree::mechanics::loads::PrescribedDof;
use bfree::tensor::Vector;
use faer::Col;
use faer::prelude::Solve;
use faer::sparse::{SparseColMat, Triplet};
use std::collections::HashSet;

/// The system could not be solved.
#[derive(Debug, thiserror::Error)]
#[error("the sparse LU factorisation failed: {0}")]
pub struct DirectError(String);

/// Solves K x = b on the free degrees of freedom by sparse LU; x = 0 on the prescribed ones.
///
/// # Errors
/// A singular matrix, or not enough memory.
pub fn solve<const D: usize>(
    matrix: &BlockMatrix<'_, D>,
    prescribed: &[PrescribedDof],
    right: &[Vector<f64, D>],
) -> Result<Vec<Vector<f64, D>>, DirectError> {
    let held: HashSet<usize> = prescribed.iter().map(|dof| dof.node * D + dof.component).collect();
    let mut entries = Vec::new();
    for (row, column, block) in matrix.iter() {
        for i in 0..D {
            for k in 0..D {
                let (row, column) = (row * D + i, column * D + k);
                if held.contains(&row) || held.contains(&column) {
                    if row == column {
                        entries.push(Triplet::new(row, column, 1.0));
                    }
                } else {
                    entries.push(Triplet::new(row, column, block[(i, k)]));
                }
            }
        }
    }
    let n = right.len() * D;
    let sparse = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &entries)
        .map_err(|error| DirectError(format!("{error:?}")))?;
    let factors = sparse.sp_lu().map_err(|error| DirectError(format!("{error:?}")))?;
    let b = Col::from_fn(n, |k| if held.contains(&k) { 0.0 } else { right[k / D][k % D] });
    let x = factors.solve(&b);
    Ok((0..right.len()).map(|node| Vector::from_fn(|i, _| x[node * D + i])).collect())
}
