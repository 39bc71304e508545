//! Isotropic functions of a symmetric tensor, Y = f(A). Y has the eigenvectors of A, and f of each eigenvalue.
//!
//! Eigenvectors have no derivatives where eigenvalues coincide, but Y has. A is therefore rotated into D + O by the eigenvectors of its
//! real part. D is diagonal, and O holds only round-off and the derivatives of the number type. Divided differences of f give the expansion
//! of f(D + O) in O to any order (Daleckii and Krein, 1965; Higham, Functions of Matrices, 2008, ch. 3). They are evaluated to full digits,
//! however near the eigenvalues are.

use crate::scalar::Real;
use crate::tensor::Tensor;
use num_dual::Dual;

/// A function of one number, and its divided difference.
pub(super) trait Function {
    /// f(x)
    fn value<T: Real>(&self, x: T) -> T;
    /// f[x, y] = (f(x) − f(y))/(x − y), and f'(x) where they are equal.
    fn difference<T: Real>(&self, x: T, y: T) -> T;
}

/// ½ ln(1 + 2x). Applied to ½ (b − I), it gives Hencky's strain ½ ln b.
pub(super) struct Hencky;

impl Function for Hencky {
    fn value<T: Real>(&self, x: T) -> T {
        (x + x).ln_1p() * T::lit(0.5)
    }

    /// artanh(u)/u / (1 + x + y), with u = (x − y)/(1 + x + y)
    fn difference<T: Real>(&self, x: T, y: T) -> T {
        let mean = T::one() + x + y;
        artanh_over(x, y) / mean
    }
}

/// artanh(u)/u with u = (x − y)/(1 + x + y), the tanh of the difference of the Hencky strains of x and y.
pub(super) fn artanh_over<T: Real>(x: T, y: T) -> T {
    let u = (x - y) / (T::one() + x + y);
    if u.value().abs() > 0.1 {
        let ratio = (T::one() + x + x) / (T::one() + y + y);
        return ratio.ln() / (u + u);
    }
    // Σ u²ⁿ/(2n + 1)
    let (square, mut sum) = (u * u, T::zero());
    for n in (0..=8).rev() {
        sum = sum * square + T::lit(1.0 / f64::from(2 * n + 1));
    }
    sum
}

/// (e^{αx} − 1)/α, with α ≠ 0.
pub(super) struct Power(pub f64);

impl Function for Power {
    fn value<T: Real>(&self, x: T) -> T {
        (x * T::lit(self.0)).exp_m1() / T::lit(self.0)
    }

    /// e^{α(x + y)/2} sinh(z)/z, with z = α(x − y)/2
    fn difference<T: Real>(&self, x: T, y: T) -> T {
        let half = T::lit(0.5 * self.0);
        ((x + y) * half).exp() * sinh_over((x - y) * half)
    }
}

impl Power {
    /// The primitive of the function, (e^{αx} − 1 − αx)/α², which is of second order in x.
    fn primitive<T: Real>(&self, x: T) -> T {
        let z = x * T::lit(self.0);
        let reduced = if z.value().abs() > 0.5 {
            z.exp_m1() - z
        } else {
            // z²/2 (1 + z/3 (1 + z/4 (1 + …)))
            let mut sum = T::one();
            for n in (3..=18).rev() {
                sum = sum * z * T::lit(1.0 / f64::from(n)) + T::one();
            }
            z * z * sum * T::lit(0.5)
        };
        reduced * T::lit(1.0 / (self.0 * self.0))
    }
}

/// tr R(A) of a symmetric A with derivatives up to the second, where R is the primitive of f: Σ R(dᵢ) + Σ_{i<k} f[dᵢ, dₖ] Oᵢₖ² + …
pub(super) fn primitive_trace<T: Real>(f: &Power, a: &Tensor<T, 3>) -> T {
    let axes = principal_axes(&a.map(T::value)).map(T::lit);
    let a = axes.transpose() * a * axes;
    let mut sum = T::zero();
    for i in 0..3 {
        sum += f.primitive(a[(i, i)]);
        for k in i + 1..3 {
            sum += f.difference(a[(i, i)], a[(k, k)]) * a[(i, k)] * a[(k, i)];
        }
    }
    sum
}

/// sinh(z)/z
fn sinh_over<T: Real>(z: T) -> T {
    if z.value().abs() > 0.5 {
        return z.sinh() / z;
    }
    // Σ z²ⁿ/(2n + 1)!
    let (square, mut sum) = (z * z, T::one());
    for n in (1..=9).rev() {
        sum = sum * square * T::lit(1.0 / f64::from(2 * n * (2 * n + 1))) + T::one();
    }
    sum
}

/// Two numbers of size 1 nearer than this count as equal in a second divided difference. At this distance the quotient keeps 11 digits, and
/// the derivative that replaces it is as exact. Only second derivatives need it.
const TOGETHER: f64 = 1e-5;

/// f[x, y, z] = (f[x, y] − f[y, z])/(x − z)
fn second<T: Real>(f: &impl Function, x: T, y: T, z: T) -> T {
    let apart = |a: T, b: T| (a - b).value().abs();
    // The two numbers farthest apart become the ends of the quotient.
    let (x, y, z) = if apart(x, y) > apart(x, z) && apart(x, y) >= apart(y, z) {
        (x, z, y)
    } else if apart(y, z) > apart(x, z) {
        (y, x, z)
    } else {
        (x, y, z)
    };
    if apart(x, z) > TOGETHER {
        (f.difference(x, y) - f.difference(y, z)) / (x - z)
    } else {
        let middle = (x + z) * T::lit(0.5);
        f.difference(Dual::new(middle, T::one()), Dual::new(y, T::zero())).eps
    }
}

/// f(A) of a symmetric A, with derivatives up to the second: f(D + O) = f(D) + f[dᵢ, dⱼ] Oᵢⱼ + Σₖ f[dᵢ, dₖ, dⱼ] Oᵢₖ Oₖⱼ + …
pub(super) fn function<T: Real>(f: &impl Function, a: &Tensor<T, 3>) -> Tensor<T, 3> {
    let axes = principal_axes(&a.map(T::value)).map(T::lit);
    let a = axes.transpose() * a * axes;
    let d = |i: usize| a[(i, i)];
    let mut y = Tensor::zeros();
    for i in 0..3 {
        y[(i, i)] = f.value(d(i));
        for j in 0..i {
            y[(i, j)] = f.difference(d(i), d(j)) * a[(i, j)];
            y[(j, i)] = y[(i, j)];
        }
    }
    if T::NDERIV > 1 {
        for (i, j, k) in (0..27).map(|n| (n / 9, n / 3 % 3, n % 3)).filter(|&(i, j, k)| k != i && k != j) {
            y[(i, j)] += second(f, d(i), d(k), d(j)) * a[(i, k)] * a[(k, j)];
        }
    }
    axes * y * axes.transpose()
}

/// The eigenvalues of a symmetric tensor, the largest first.
pub(crate) fn principal_values(a: &Tensor<f64, 3>) -> [f64; 3] {
    let axes = principal_axes(a);
    let mut values: [f64; 3] = (axes.transpose() * a * axes).diagonal().into();
    values.sort_by(|x, y| y.total_cmp(x));
    values
}

/// The most sweeps of Jacobi's method. It converges quadratically, so four or five are enough.
const SWEEPS: usize = 10;

/// Eigenvectors of a symmetric tensor, in columns, by Jacobi's method (Golub and Van Loan, Matrix Computations, 4th ed., alg. 8.5.2).
///
/// A zero off-diagonal entry causes no rotation. In a plane problem two eigenvectors therefore stay in the plane, and the third is its
/// normal.
pub(super) fn principal_axes(a: &Tensor<f64, 3>) -> Tensor<f64, 3> {
    let (mut a, mut axes) = (*a, Tensor::identity());
    for _ in 0..SWEEPS {
        let mut turned = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = a[(p, q)];
            // An entry below half a rounding of both diagonal entries changes nothing.
            if off.abs() <= 0.25 * f64::EPSILON * a[(p, p)].abs().min(a[(q, q)].abs()) {
                continue;
            }
            turned = true;
            let theta = (a[(q, q)] - a[(p, p)]) / (2.0 * off);
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let c = 1.0 / t.hypot(1.0);
            let s = t * c;
            (a[(p, p)], a[(q, q)]) = (a[(p, p)] - t * off, a[(q, q)] + t * off);
            (a[(p, q)], a[(q, p)]) = (0.0, 0.0);
            let r = 3 - p - q;
            let (rp, rq) = (a[(r, p)], a[(r, q)]);
            (a[(r, p)], a[(r, q)]) = (c * rp - s * rq, s * rp + c * rq);
            (a[(p, r)], a[(q, r)]) = (a[(r, p)], a[(r, q)]);
            for i in 0..3 {
                let (ip, iq) = (axes[(i, p)], axes[(i, q)]);
                (axes[(i, p)], axes[(i, q)]) = (c * ip - s * iq, s * ip + c * iq);
            }
        }
        if !turned {
            break;
        }
    }
    axes
}
