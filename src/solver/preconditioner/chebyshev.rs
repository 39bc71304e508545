//! Chebyshev polynomials over block-Jacobi, and the largest eigenvalue that they need.

use crate::solver::LinearOperator;
use crate::space::vector::{Vectors, axpy, dot, xpby};
use nalgebra::DMatrix;

/// A Chebyshev polynomial.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chebyshev {
    pub degree: usize,
    /// The polynomial damps eigenvalues between λ/part and λ.
    pub part: f64,
    /// λ, the largest eigenvalue of D⁻¹K.
    pub largest: f64,
}

impl Chebyshev {
    /// The smoother of multigrid.
    pub(crate) fn smoother(largest: f64) -> Self {
        Self { degree: 5, part: 30.0, largest }
    }
}

/// Iterations that estimate the largest eigenvalue λ of D⁻¹K, each with a product.
const ESTIMATE: usize = 10;
/// The estimate is a lower bound and is multiplied by this factor.
const MARGIN: f64 = 1.15;

/// The largest eigenvalue of D⁻¹K, with a margin. Conjugate gradients with the preconditioner D have the coefficients of the Lanczos method
/// (Saad, Iterative Methods for Sparse Linear Systems, 2nd ed., section 6.7.3). These coefficients are ratios: units of length, mass and
/// time do not change their bits.
pub(super) fn largest(operator: &dyn LinearOperator, jacobi: &dyn LinearOperator, n: usize) -> f64 {
    let start: Vec<f64> = (1..=n).map(|i| 2.0 * (i as f64 * 0.618_033_988_749_894_9).fract() - 1.0).collect();
    let (mut r, mut z, mut w) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    // A product clears the entries at prescribed unknowns. It comes first, because there D is 1 in any units.
    operator.apply(&start, &mut w);
    jacobi.apply(&w, &mut z);
    operator.apply(&z, &mut r);
    jacobi.apply(&r, &mut z);
    let mut p = z.clone();
    let mut r_z = dot(&r, &z);
    let mut matrix = DMatrix::<f64>::zeros(ESTIMATE, ESTIMATE);
    let mut carried = 0.0;
    for step in 0..ESTIMATE {
        operator.apply(&p, &mut w);
        let alpha = r_z / dot(&p, &w);
        if !alpha.is_normal() {
            break;
        }
        matrix[(step, step)] = 1.0 / alpha + carried;
        axpy(-alpha, &w, &mut r);
        jacobi.apply(&r, &mut z);
        let r_z_next = dot(&r, &z);
        let beta = r_z_next / r_z;
        if beta.is_nan() || beta <= 0.0 {
            break;
        }
        if step + 1 < ESTIMATE {
            (matrix[(step, step + 1)], matrix[(step + 1, step)]) = (beta.sqrt() / alpha, beta.sqrt() / alpha);
        }
        xpby(&z, beta, &mut p);
        carried = beta / alpha;
        r_z = r_z_next;
    }
    let finite = matrix.iter().all(|x| x.is_finite());
    let largest = if finite { MARGIN * matrix.symmetric_eigenvalues().max() } else { 0.0 };
    if largest > 0.0 { largest } else { 1.0 }
}

/// Smooths: x ← x + p(D⁻¹K) D⁻¹ (b − K x) with a Chebyshev polynomial p. `zero` tells that x = 0 at the start, which saves a product.
pub(super) fn smooth<S: Vectors>(
    Chebyshev { degree, part, largest }: Chebyshev,
    vectors: &S,
    operator: &dyn LinearOperator<S::Vector>,
    jacobi: &dyn LinearOperator<S::Vector>,
    b: &S::Vector,
    x: &mut S::Vector,
    zero: bool,
) {
    let (upper, lower) = (largest, largest / part);
    let (theta, delta) = (0.5 * (upper + lower), 0.5 * (upper - lower));
    let sigma = theta / delta;
    let [mut r, mut z, mut p] = [(); 3].map(|()| vectors.unspecified(vectors.len(b)));
    if zero {
        vectors.copy(b, &mut r);
    } else {
        operator.apply(x, &mut r);
        vectors.xpby(b, -1.0, &mut r);
    }
    jacobi.apply(&r, &mut z);
    vectors.divided(&z, theta, &mut p);
    let mut rho = 1.0 / sigma;
    for _ in 1..degree {
        operator.apply(&p, &mut z);
        vectors.move_along(&p, &z, x, &mut r);
        jacobi.apply(&r, &mut z);
        let next = 1.0 / (2.0 * sigma - rho);
        vectors.axpby(2.0 * next / delta, &z, next * rho, &mut p);
        rho = next;
    }
    vectors.axpy(1.0, &p, x);
}
