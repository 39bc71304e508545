//! Rigid motions of the last level. A body that nothing holds has a singular matrix, and round-off would move the body by any distance.

use crate::tensor::Vector;
use nalgebra::{DMatrix, DVector};

/// A motion with less energy than this, relative to that of its nodes one by one, is a rigid motion that nothing holds.
const NOTHING: f64 = 1e-12;

/// A motion that differs from earlier ones by less than this part of it is none of its own.
const DEPENDENT: f64 = 1e-6;

/// The rigid motions at the end of an arm: translations along the axes, then rotations about the beginning of the arm.
pub(crate) fn rigid_motions<const D: usize>(arm: &Vector<f64, D>) -> Vec<Vector<f64, D>> {
    let axes = (0..D).map(|k| Vector::from_fn(|i, _| f64::from(i == k)));
    let planes = (0..D).flat_map(|i| (i + 1..D).map(move |k| (i, k)));
    let turns = planes.map(|(i, k)| {
        let mut turn = Vector::zeros();
        (turn[i], turn[k]) = (-arm[k], arm[i]);
        turn
    });
    axes.chain(turns).collect()
}

/// Gives rigid motions that nothing holds a stiffness, and changes no other motion. `fixed` are the values that are no unknowns.
pub(super) fn hold<const D: usize>(matrix: &mut DMatrix<f64>, nodes: &[[u32; 3]], fixed: &[bool]) {
    mutant!("multigrid: motions that nothing holds have no stiffness": { return; });
    let weight = matrix.diagonal();
    let within = |a: &DVector<f64>, b: &DVector<f64>| a.component_mul(&weight).dot(b);
    let sum = |k: usize| nodes.iter().map(|at| f64::from(at[k])).sum::<f64>();
    let middle = Vector::<f64, D>::from_fn(|k, _| sum(k) / nodes.len() as f64);
    let at_node = |at: &[u32; 3]| rigid_motions(&Vector::<f64, D>::from_fn(|k, _| f64::from(at[k]) - middle[k]));
    let at_nodes: Vec<_> = nodes.iter().map(at_node).collect();
    let field = |number: usize| {
        DVector::from_fn(matrix.nrows(), |i, _| if fixed[i] { 0.0 } else { at_nodes[i / D][number][i % D] })
    };
    let mut motions: Vec<DVector<f64>> = Vec::new();
    for mut motion in (0..D * (D + 1) / 2).map(field) {
        let before = within(&motion, &motion).sqrt();
        for other in &motions {
            motion -= other * within(other, &motion);
        }
        let left = within(&motion, &motion).sqrt();
        if left > DEPENDENT * before {
            motions.push(motion / left);
        }
    }
    let energy = DMatrix::from_fn(motions.len(), motions.len(), |i, j| motions[i].dot(&(&*matrix * &motions[j])));
    if motions.is_empty() || energy.iter().any(|x| !x.is_finite()) {
        return;
    }
    let modes = (0.5 * (&energy + energy.transpose())).symmetric_eigen();
    for (energy, shares) in modes.eigenvalues.iter().zip(modes.eigenvectors.column_iter()) {
        if energy.abs() < NOTHING {
            let motion: DVector<f64> = motions.iter().zip(&shares).map(|(motion, share)| motion * *share).sum();
            let force = motion.component_mul(&weight);
            *matrix += &force * force.transpose();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_nothing_holds_is_held() {
        // Two nodes and a spring: the difference has a stiffness, the common motion has none.
        let free = DMatrix::from_row_slice(2, 2, &[1.0, -1.0, -1.0, 1.0]);
        let nodes = [[0, 0, 0], [1, 0, 0]];
        let mut held = free.clone();
        hold::<1>(&mut held, &nodes, &[false; 2]);
        assert!(
            (&held * DVector::from_vec(vec![1.0, -1.0]) - &free * DVector::from_vec(vec![1.0, -1.0])).amax() < 1e-15
        );
        assert!((held * DVector::from_vec(vec![1.0, 1.0]) - DVector::from_vec(vec![1.0, 1.0])).amax() < 1e-15);
        // A spring to the ground, no unknown at all, and a matrix without positive diagonal stay as they are.
        for (diagonal, fixed) in
            [([2.0, 1.0], false), ([1.0, 1.0], true), ([-1.0, -1.0], false), ([f64::NAN, 1.0], false)]
        {
            let mut matrix = free.clone();
            matrix.set_diagonal(&DVector::from_column_slice(&diagonal));
            let before = matrix.clone();
            hold::<1>(&mut matrix, &nodes, &[fixed; 2]);
            assert!(matrix.iter().zip(&before).all(|(a, b)| a.to_bits() == b.to_bits()), "{diagonal:?}");
        }
    }
}
