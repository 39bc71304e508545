//! The eigenvalues of the mass matrix and of the whole tangent.

use crate::prepared::Prepared;
use bfree::material::Law;
use bfree::mechanics::residual::{Equilibrium, Inadmissible};
use bfree::particles::Particles;
use bfree::tensor::Vector;
use nalgebra::{DMatrix, SymmetricEigen};

/// An eigenvalue below this fraction of the largest one counts as zero.
const NULL: f64 = 1e-13;

/// A summary of the eigenvalues.
pub(super) struct Spectrum {
    pub largest: f64,
    pub smallest: f64,
    /// Largest over smallest nonzero eigenvalue.
    pub condition: f64,
    pub null_modes: usize,
    /// The condition number of D^(−½) M̃ D^(−½), with the diagonal D: it governs a Jacobi-preconditioned method.
    pub scaled_condition: f64,
    pub scaled_null_modes: usize,
}

/// The spectrum of M̃ = (1−ε) M + ε lumped(M), M_IJ = Σ_p m N_I N_J, on all active nodes.
pub(super) fn spectrum<const D: usize>(particles: &Particles<D>, prepared: &Prepared<D>, lumping: f64) -> Spectrum {
    let count = prepared.nodes.len();
    let mut mass = DMatrix::<f64>::zeros(count, count);
    for p in 0..particles.len() {
        let m = particles.mass[p];
        for (i, n_i, _) in prepared.supports.of(p) {
            mass[(i, i)] += lumping * m * n_i;
            for (j, n_j, _) in prepared.supports.of(p) {
                mass[(i, j)] += (1.0 - lumping) * m * n_i * n_j;
            }
        }
    }
    let diagonal: Vec<f64> = (0..count).map(|i| mass[(i, i)]).collect();
    // A node with ∇N ≠ 0 but N = 0 has no mass: its row stays zero.
    let scale = |i: usize| if diagonal[i] > 0.0 { diagonal[i].sqrt().recip() } else { 0.0 };
    let scaled = DMatrix::from_fn(count, count, |i, j| mass[(i, j)] * scale(i) * scale(j));
    let (largest, smallest, condition, null_modes) = summary(mass);
    let (_, _, scaled_condition, scaled_null_modes) = summary(scaled);
    Spectrum { largest, smallest, condition, null_modes, scaled_condition, scaled_null_modes }
}

/// Condition number and null modes of D^(−½) K D^(−½) on the free degrees of freedom, with the diagonal D of K. K is symmetric, since there
/// is no follower pressure.
pub(super) fn tangent<L: Law>(
    equilibrium: &Equilibrium<'_, 2, L>,
    dphi: &[Vector<f64, 2>],
) -> Result<(f64, usize), Inadmissible> {
    let tangent = equilibrium.tangent(dphi)?;
    let held = |node: usize, i: usize| equilibrium.prescribed.iter().any(|dof| dof.node == node && dof.component == i);
    let all = (0..dphi.len()).flat_map(|node| (0..2).map(move |i| (node, i)));
    let free: Vec<(usize, usize)> = all.filter(|&(node, i)| !held(node, i)).collect();
    let mut matrix = DMatrix::<f64>::zeros(free.len(), free.len());
    for (column, &(node, i)) in free.iter().enumerate() {
        let mut unit = vec![Vector::zeros(); dphi.len()];
        unit[node][i] = 1.0;
        let mut product = vec![Vector::zeros(); dphi.len()];
        tangent.product(&unit, &mut product);
        for (row, &(node, i)) in free.iter().enumerate() {
            matrix[(row, column)] = product[node][i];
        }
    }
    let scale: Vec<f64> = (0..free.len()).map(|k| matrix[(k, k)].abs().sqrt().recip()).collect();
    let scaled = DMatrix::from_fn(free.len(), free.len(), |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let (_, _, condition, null_modes) = summary(scaled);
    Ok((condition, null_modes))
}

fn summary(matrix: DMatrix<f64>) -> (f64, f64, f64, usize) {
    let mut values: Vec<f64> = SymmetricEigen::new(matrix).eigenvalues.iter().copied().collect();
    values.sort_by(f64::total_cmp);
    let largest = values.last().copied().unwrap_or(0.0);
    let smallest = values.first().copied().unwrap_or(0.0);
    let null_modes = values.iter().filter(|&&value| value < NULL * largest).count();
    let least = values.get(null_modes).copied().unwrap_or(f64::NAN);
    (largest, smallest, largest / least, null_modes)
}
