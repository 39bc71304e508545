//! Operations on 3×3 tensors: products, inverse, exponential, eigenvalues, polar decomposition, logarithm of a stretch.

use crate::convention::Tensor;

/// The unit tensor I.
pub const IDENTITY: Tensor = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The zero tensor.
pub const ZERO: Tensor = [[0.0; 3]; 3];

/// The tensor with these entries.
pub fn from_entries(entry: impl Fn(usize, usize) -> f64) -> Tensor {
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// A B.
pub fn product(a: &Tensor, b: &Tensor) -> Tensor {
    from_entries(|i, j| a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j])
}

/// A B C.
pub fn product3(a: &Tensor, b: &Tensor, c: &Tensor) -> Tensor {
    product(&product(a, b), c)
}

/// Aᵀ.
pub fn transposed(a: &Tensor) -> Tensor {
    from_entries(|i, j| a[j][i])
}

/// A + s B.
pub fn sum(a: &Tensor, s: f64, b: &Tensor) -> Tensor {
    from_entries(|i, j| a[i][j] + s * b[i][j])
}

/// s A.
pub fn scaled(s: f64, a: &Tensor) -> Tensor {
    from_entries(|i, j| s * a[i][j])
}

/// ½ (A + Aᵀ).
pub fn symmetric(a: &Tensor) -> Tensor {
    from_entries(|i, j| 0.5 * (a[i][j] + a[j][i]))
}

/// ½ (A − Aᵀ).
pub fn skew(a: &Tensor) -> Tensor {
    from_entries(|i, j| 0.5 * (a[i][j] - a[j][i]))
}

/// A B − B A.
pub fn commutator(a: &Tensor, b: &Tensor) -> Tensor {
    sum(&product(a, b), -1.0, &product(b, a))
}

/// tr A.
pub fn trace(a: &Tensor) -> f64 {
    a[0][0] + a[1][1] + a[2][2]
}

/// √(A : A).
pub fn norm(a: &Tensor) -> f64 {
    a.iter().flatten().map(|entry| entry * entry).sum::<f64>().sqrt()
}

/// Whether all entries are finite.
pub fn finite(a: &Tensor) -> bool {
    a.iter().flatten().all(|entry| entry.is_finite())
}

/// cof A = det A A⁻ᵀ.
pub fn cofactor(a: &Tensor) -> Tensor {
    from_entries(|i, j| {
        let [i1, i2] = [(i + 1) % 3, (i + 2) % 3];
        let [j1, j2] = [(j + 1) % 3, (j + 2) % 3];
        a[i1][j1] * a[i2][j2] - a[i1][j2] * a[i2][j1]
    })
}

/// det A.
pub fn determinant(a: &Tensor) -> f64 {
    let cofactor = cofactor(a);
    (0..3).map(|j| a[0][j] * cofactor[0][j]).sum()
}

/// A⁻¹; `None` if A is singular or not finite.
pub fn inverse(a: &Tensor) -> Option<Tensor> {
    let inverse = scaled(1.0 / determinant(a), &transposed(&cofactor(a)));
    finite(&inverse).then_some(inverse)
}

/// exp A: the Taylor series of A/2ⁿ, squared n times. An entry that is not finite gives NaN.
pub fn exponential(a: &Tensor) -> Tensor {
    let size = norm(a);
    if !size.is_finite() || size > 700.0 {
        return [[f64::NAN; 3]; 3];
    }
    let squarings = (size / 0.5).log2().ceil().max(0.0) as i32;
    let small = scaled(0.5_f64.powi(squarings), a);
    // Horner's scheme; 0.5²⁰/20! is below round-off.
    let mut result = IDENTITY;
    for order in (1..20).rev() {
        result = sum(&IDENTITY, 1.0 / f64::from(order), &product(&small, &result));
    }
    for _ in 0..squarings {
        result = product(&result, &result);
    }
    result
}

/// The eigenvalues λ of a symmetric tensor and the rotation Q whose columns are its axes: A = Q diag(λ) Qᵀ.
/// Jacobi's method; the eigenvalues are in no order.
pub fn eigenvalues(a: &Tensor) -> ([f64; 3], Tensor) {
    let mut diagonal = symmetric(a);
    let mut axes = IDENTITY;
    for _ in 0..12 {
        if diagonal[0][1] == 0.0 && diagonal[0][2] == 0.0 && diagonal[1][2] == 0.0 {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let rotation = jacobi_rotation(&diagonal, p, q);
            diagonal = symmetric(&product3(&transposed(&rotation), &diagonal, &rotation));
            axes = product(&axes, &rotation);
        }
    }
    ([diagonal[0][0], diagonal[1][1], diagonal[2][2]], axes)
}

/// The rotation in the plane p, q that makes entry (p, q) zero.
fn jacobi_rotation(a: &Tensor, p: usize, q: usize) -> Tensor {
    if a[p][q] == 0.0 {
        return IDENTITY;
    }
    let ratio = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let tangent = ratio.signum() / (ratio.abs() + ratio.hypot(1.0));
    let cosine = 1.0 / tangent.hypot(1.0);
    let sine = tangent * cosine;
    let mut rotation = IDENTITY;
    (rotation[p][p], rotation[q][q]) = (cosine, cosine);
    (rotation[p][q], rotation[q][p]) = (sine, -sine);
    rotation
}

/// f(A) of a symmetric tensor.
pub fn function(a: &Tensor, f: impl Fn(f64) -> f64) -> Tensor {
    let (values, axes) = eigenvalues(a);
    let values = values.map(f);
    from_entries(|i, j| (0..3).map(|k| axes[i][k] * values[k] * axes[j][k]).sum())
}

/// The rotation R and the left stretch V of a deformation gradient, F = V R; `None` unless det F > 0 and F is finite.
/// Newton's iteration R ← ½ (R + R⁻ᵀ), accurate to round-off (Higham, Computing the polar decomposition, 1986).
pub fn polar(gradient: &Tensor) -> Option<(Tensor, Tensor)> {
    let determinant = determinant(gradient);
    if !(determinant > 0.0 && finite(gradient)) {
        return None;
    }
    let mut rotation = scaled(determinant.cbrt().recip(), gradient);
    for _ in 0..60 {
        let next = polar_step(&rotation)?;
        let change = norm(&sum(&next, -1.0, &rotation));
        rotation = next;
        // Quadratic convergence: the step after a change of 1e-9 is below round-off.
        if change < 1e-9 {
            break;
        }
    }
    Some((rotation, symmetric(&product(gradient, &transposed(&rotation)))))
}

/// ½ (R + R⁻ᵀ).
fn polar_step(rotation: &Tensor) -> Option<Tensor> {
    Some(scaled(0.5, &sum(rotation, 1.0, &transposed(&inverse(rotation)?))))
}

/// ln A of a symmetric positive definite tensor; NaN if an eigenvalue is not positive.
/// Near I, the logarithm is taken of A − I, so that small strains keep all digits that A has.
pub fn logarithm(stretch: &Tensor) -> Tensor {
    function(&sum(stretch, -1.0, &IDENTITY), f64::ln_1p)
}

/// The rotation by the length of a vector about its direction.
pub fn rotation_about(vector: [f64; 3]) -> Tensor {
    let [x, y, z] = vector;
    exponential(&[[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
}
