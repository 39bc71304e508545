//! panels, pull request 8 (17 September 2026): the shear of a bent plate, twice.
//!
//! Our residual: one point of von Kármán's plate. The unknowns are the linear membrane strains e_x, e_y, g and the slopes w,x and w,y:
//!
//! ε = (e_x + ½ w,x², e_y + ½ w,y², g + w,x w,y), n = 𝔸 ε, f = Bᵀ n, B = ∂ε/∂u,
//! K = Bᵀ 𝔸 B + [[n_x, n_xy], [n_xy, n_y]] on the slopes.
//!
//! Before: 2 w,x w,y for w,x w,y in n alone. Bending is not modelled.

use crate::algebra::Version;
use crate::check::{all, assert_consistent, assert_wrong, vector_finding};
use tangent_check::matrix::Matrix;

/// 𝔸 of an unbalanced laminate.
const LAMINATE: [[f64; 3]; 3] = [[10.0, 3.0, 1.0], [3.0, 8.0, 0.5], [1.0, 0.5, 4.0]];

/// e_x, e_y, g, w,x, w,y.
pub type Unknowns = [f64; 5];

/// n.
fn membrane_forces(version: Version, u: Unknowns) -> [f64; 3] {
    let [e_x, e_y, g, w_x, w_y] = u;
    let factor = if version == Version::Before { 2.0 } else { 1.0 };
    let strain = [e_x + 0.5 * w_x * w_x, e_y + 0.5 * w_y * w_y, g + factor * w_x * w_y];
    LAMINATE.map(|row| row.iter().zip(strain).map(|(a, e)| a * e).sum())
}

/// B.
fn gradient(u: Unknowns) -> [[f64; 5]; 3] {
    let [_, _, _, w_x, w_y] = u;
    [[1.0, 0.0, 0.0, w_x, 0.0], [0.0, 1.0, 0.0, 0.0, w_y], [0.0, 0.0, 1.0, w_y, w_x]]
}

/// f where an unknown grows by h.
pub fn force(version: Version, u: Unknowns, component: usize, h: f64) -> Vec<f64> {
    let mut moved = u;
    moved[component] += h;
    let n = membrane_forces(version, moved);
    let b = gradient(moved);
    (0..5).map(|i| (0..3).map(|a| b[a][i] * n[a]).sum()).collect()
}

/// K.
pub fn tangent(version: Version, u: Unknowns) -> Matrix {
    let b = gradient(u);
    let material = |i: usize, j: usize, a: usize| (0..3).map(|c| b[a][i] * LAMINATE[a][c] * b[c][j]).sum::<f64>();
    let mut tangent = Matrix::from_entries(5, 5, |i, j| (0..3).map(|a| material(i, j, a)).sum());
    let [n_x, n_y, n_xy] = membrane_forces(version, u);
    for (row, column, n) in [(3, 3, n_x), (3, 4, n_xy), (4, 3, n_xy), (4, 4, n_y)] {
        tangent[(row, column)] += n;
    }
    tangent
}

const STATE: Unknowns = [0.01, 0.02, -0.03, 0.2, 0.3];

#[test]
fn before_the_columns_of_the_slopes_are_wrong() {
    let claimed = tangent(Version::Before, STATE);
    let finding = vector_finding(&claimed, &mut |k, h| force(Version::Before, STATE, k, h));
    let slopes = all(5, 5).into_iter().filter(|&(_, column)| column >= 3).collect();
    assert_wrong(&finding, &[(2, 3)], &slopes);
    assert!((finding.deviation - 0.12).abs() < 1e-9, "{}", finding.deviation);
}

#[test]
fn after_the_tangent_is_the_derivative_of_the_force() {
    let claimed = tangent(Version::After, STATE);
    assert_consistent(&vector_finding(&claimed, &mut |k, h| force(Version::After, STATE, k, h)));
}
