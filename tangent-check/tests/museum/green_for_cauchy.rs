//! MaterialModels.jl, pull request 52 (15 June 2023): ∂S/∂E in place of ∂S/∂C.
//!
//! Our function: S(C) of a neo-Hookean solid. ∂S/∂C = ½ ∂S/∂E, as C = I + 2E. Before: ∂S/∂E.

use crate::algebra::{ORDER, RightCauchyGreen, Version, matrix, vector};
use crate::check::{all, assert_consistent, assert_wrong, vector_finding};
use crate::neo_hooke;
use tangent_check::convention::Tensor;
use tangent_check::matrix::Matrix;

/// The components of S where a component of C grows by h. A shear grows by ½ h on both sides of the diagonal.
pub fn stress(c: &Tensor, component: usize, h: f64) -> Vec<f64> {
    let (i, j) = ORDER[component];
    let mut moved = *c;
    moved[i][j] += 0.5 * h;
    moved[j][i] += 0.5 * h;
    vector(&neo_hooke::second_piola(&RightCauchyGreen::from_c(moved)))
}

/// The claimed ∂S/∂C.
pub fn tangent(version: Version, c: &Tensor) -> Matrix {
    let at = RightCauchyGreen::from_c(*c);
    let factor = if version == Version::Before { 1.0 } else { 0.5 };
    matrix(|i, j, k, l| factor * neo_hooke::green_modulus(&at, [i, j, k, l]))
}

/// A general C.
const C: Tensor = [[1.5, 0.2, 0.1], [0.2, 1.1, -0.2], [0.1, -0.2, 0.8]];

#[test]
fn before_the_tangent_is_twice_the_derivative() {
    let finding = vector_finding(&tangent(Version::Before, &C), &mut |k, h| stress(&C, k, h));
    assert_wrong(&finding, &[(2, 2)], &all(6, 6));
    assert!((finding.deviation - 1.0).abs() < 1e-9, "{}", finding.deviation);
}

#[test]
fn after_the_tangent_is_the_derivative_by_c() {
    let claimed = tangent(Version::After, &C);
    assert_consistent(&vector_finding(&claimed, &mut |k, h| stress(&C, k, h)));
}
