//! D×D tensors over nalgebra, and the strain measures computed from H = F − I without cancellation.
//!
//! Shakeri, Ghaffari, Thompson, Stengel, Brown, "Stable numerics for finite-strain elasticity", 2024. nalgebra's own `determinant` and
//! `try_inverse` need a field with ordering by magnitude and do not accept nested dual numbers. The determinant and the cofactor are
//! therefore written out here, once.

use crate::scalar::Real;
use nalgebra::{SMatrix, SVector};
use std::f64::consts::{LN_2, SQRT_2};

/// A vector of `D` components.
pub type Vector<T, const D: usize> = SVector<T, D>;
/// A second-order tensor of `D`×`D` components.
pub type Tensor<T, const D: usize> = SMatrix<T, D, D>;

/// Rows and columns of the six numbers of a symmetric tensor in three dimensions.
pub(crate) const SYMMETRIC: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)];

/// The identity tensor.
///
/// ```
/// use bfree::tensor::{Tensor, identity};
///
/// let (a, one) = (Tensor::<f64, 2>::new(1.0, 2.0, 3.0, 4.0), identity::<f64, 2>());
/// assert_eq!((one * a, a * one), (a, a));
/// ```
#[inline(always)]
pub fn identity<T: Real, const D: usize>() -> Tensor<T, D> {
    Tensor::from_fn(|i, k| if i == k { T::one() } else { T::zero() })
}

/// tr A
///
/// ```
/// use bfree::tensor::{Vector, outer, trace};
///
/// // tr(a ⊗ b) = a·b
/// let (a, b) = (Vector::from([1.0, 2.0, 3.0]), Vector::from([4.0, -5.0, 6.0]));
/// assert_eq!(trace(&outer(&a, &b)), a.dot(&b));
/// ```
#[inline(always)]
pub fn trace<T: Real, const D: usize>(a: &Tensor<T, D>) -> T {
    (0..D).fold(T::zero(), |sum, i| sum + a[(i, i)])
}

/// A : B = Σ Aᵢⱼ Bᵢⱼ
///
/// ```
/// use bfree::tensor::{Tensor, contract, trace};
///
/// // A : B = tr(AᵀB)
/// let (a, b) = (Tensor::<f64, 2>::new(1.0, 2.0, 3.0, 4.0), Tensor::<f64, 2>::new(5.0, 6.0, 7.0, 8.0));
/// assert_eq!(contract(&a, &b), 70.0);
/// assert_eq!(contract(&a, &b), trace(&(a.transpose() * b)));
/// ```
#[inline(always)]
pub fn contract<T: Real, const D: usize>(a: &Tensor<T, D>, b: &Tensor<T, D>) -> T {
    a.as_slice().iter().zip(b.as_slice()).fold(T::zero(), |sum, (&a, &b)| sum + a * b)
}

/// a ⊗ b
///
/// ```
/// use bfree::tensor::{Vector, outer};
///
/// // (a ⊗ b) c = (b·c) a
/// let (a, b, c) = (Vector::from([1.0, 2.0]), Vector::from([3.0, 4.0]), Vector::from([5.0, 6.0]));
/// assert_eq!(outer(&a, &b) * c, a * b.dot(&c));
/// ```
#[inline(always)]
pub fn outer<T: Real, const D: usize>(a: &Vector<T, D>, b: &Vector<T, D>) -> Tensor<T, D> {
    Tensor::from_fn(|i, k| a[i] * b[k])
}

/// ½ (A + Aᵀ)
///
/// ```
/// use bfree::tensor::{Tensor, contract, symmetric};
///
/// // The rest is skew, and its contraction with any symmetric tensor vanishes.
/// let a = Tensor::<f64, 2>::new(1.0, 2.0, 4.0, 8.0);
/// let (sym, skew) = (symmetric(&a), a - symmetric(&a));
/// assert_eq!((sym, skew), (sym.transpose(), -skew.transpose()));
/// assert_eq!(contract(&sym, &skew), 0.0);
/// ```
#[inline(always)]
pub fn symmetric<T: Real, const D: usize>(a: &Tensor<T, D>) -> Tensor<T, D> {
    let half = T::lit(0.5);
    Tensor::from_fn(|i, k| (a[(i, k)] + a[(k, i)]) * half)
}

/// s A
///
/// ```
/// use bfree::tensor::{Tensor, determinant, scaled};
///
/// // det(s A) = s^D det A
/// let a = Tensor::<f64, 3>::new(2.0, 1.0, 0.0, 0.0, 3.0, 1.0, 1.0, 0.0, 1.0);
/// assert_eq!(determinant(&scaled(&a, 2.0)), 8.0 * determinant(&a));
/// ```
#[inline(always)]
pub fn scaled<T: Real, const D: usize>(a: &Tensor<T, D>, s: T) -> Tensor<T, D> {
    a.map(|x| x * s)
}

/// The cofactor, cof A = det(A) A⁻ᵀ, for D = 1, 2, 3; defined for singular A too.
#[inline(always)]
pub(crate) fn cofactor<T: Real, const D: usize>(a: &Tensor<T, D>) -> Tensor<T, D> {
    match D {
        1 => identity(),
        2 => Tensor::from_fn(|i, k| {
            let minor = a[(1 - i, 1 - k)];
            if i == k { minor } else { -minor }
        }),
        3 => Tensor::from_fn(|i, k| {
            let (i1, i2, k1, k2) = ((i + 1) % 3, (i + 2) % 3, (k + 1) % 3, (k + 2) % 3);
            a[(i1, k1)] * a[(i2, k2)] - a[(i1, k2)] * a[(i2, k1)]
        }),
        _ => unreachable!("D is 1, 2 or 3"),
    }
}

/// The derivative of cof A along X. It is linear in X, and defined for singular A too.
#[inline(always)]
pub(crate) fn cofactor_derivative<T: Real, const D: usize>(a: &Tensor<T, D>, x: &Tensor<T, D>) -> Tensor<T, D> {
    match D {
        1 => Tensor::zeros(),
        2 => cofactor(x),
        3 => Tensor::from_fn(|i, k| {
            let (i1, i2, k1, k2) = ((i + 1) % 3, (i + 2) % 3, (k + 1) % 3, (k + 2) % 3);
            let change = |i, k, l, j| a[(i, k)] * x[(l, j)] + x[(i, k)] * a[(l, j)];
            change(i1, k1, i2, k2) - change(i1, k2, i2, k1)
        }),
        _ => unreachable!("D is 1, 2 or 3"),
    }
}

/// det A for D = 1, 2, 3.
///
/// ```
/// use bfree::tensor::{Tensor, determinant};
///
/// // det(AB) = det A det B
/// let (a, b) = (Tensor::<f64, 2>::new(1.0, 2.0, 3.0, 4.0), Tensor::<f64, 2>::new(5.0, 6.0, 7.0, 9.0));
/// assert_eq!(determinant(&(a * b)), determinant(&a) * determinant(&b));
/// ```
#[inline(always)]
pub fn determinant<T: Real, const D: usize>(a: &Tensor<T, D>) -> T {
    match D {
        1 => a[(0, 0)],
        2 => a[(0, 0)] * a[(1, 1)] - a[(0, 1)] * a[(1, 0)],
        3 => {
            a[(0, 0)] * (a[(1, 1)] * a[(2, 2)] - a[(1, 2)] * a[(2, 1)])
                + a[(0, 1)] * (a[(1, 2)] * a[(2, 0)] - a[(1, 0)] * a[(2, 2)])
                + a[(0, 2)] * (a[(1, 0)] * a[(2, 1)] - a[(1, 1)] * a[(2, 0)])
        }
        _ => unreachable!("D is 1, 2 or 3"),
    }
}

/// A⁻¹ = cof(A)ᵀ / det A. The caller makes sure that det A ≠ 0.
///
/// ```
/// use bfree::tensor::{Tensor, identity, inverse};
///
/// let shear = Tensor::<f64, 2>::new(1.0, 0.5, 0.0, 1.0);
/// assert_eq!(inverse(&shear), Tensor::<f64, 2>::new(1.0, -0.5, 0.0, 1.0));
/// assert_eq!(inverse(&shear) * shear, identity::<f64, 2>());
/// ```
#[inline(always)]
pub fn inverse<T: Real, const D: usize>(a: &Tensor<T, D>) -> Tensor<T, D> {
    scaled(&cofactor(a).transpose(), determinant(a).recip())
}

/// A 3×3 tensor with a D×D tensor as its upper left part, and zeros elsewhere.
pub(crate) fn embed<T: Real, const D: usize>(a: &Tensor<T, D>) -> Tensor<T, 3> {
    Tensor::from_fn(|i, k| if i < D && k < D { a[(i, k)] } else { T::zero() })
}

/// The upper left D×D part.
pub(crate) fn cut<T: Real, const D: usize>(a: &Tensor<T, 3>) -> Tensor<T, D> {
    Tensor::from_fn(|i, k| a[(i, k)])
}

/// I₂(A), the sum of the principal 2×2 minors (0 in 1D, det A in 2D).
#[inline(always)]
pub(crate) fn second_invariant<T: Real, const D: usize>(a: &Tensor<T, D>) -> T {
    let mut sum = T::zero();
    for i in 0..D {
        for k in i + 1..D {
            sum += a[(i, i)] * a[(k, k)] - a[(i, k)] * a[(k, i)];
        }
    }
    sum
}

/// det(I + H) − 1, as a sum that loses no digits of a small H.
#[inline(always)]
pub(crate) fn change_of_volume<T: Real, const D: usize>(h: &Tensor<T, D>) -> T {
    match D {
        1 => h[(0, 0)],
        2 => trace(h) + determinant(h),
        _ => trace(h) + second_invariant(h) + determinant(h),
    }
}

/// The deformation at a point, stored as H = F − I, with the measures the laws need.
///
/// Every measure is accurate to a few rounding errors *relative to its own size*, at strains of 1e-15 as at 10.
/// D = 1 is uniaxial strain, D = 2 plane strain: the missing stretches are 1.
#[derive(Clone, Copy, Debug)]
pub struct Deformation<T: Real, const D: usize> {
    /// H = F − I
    pub h: Tensor<T, D>,
    /// F = I + H
    pub f: Tensor<T, D>,
    /// j = J − 1
    pub j: T,
    /// J = det F
    pub jacobian: T,
}

impl<T: Real, const D: usize> Deformation<T, D> {
    /// From H = F − I.
    ///
    /// j = H (1D), tr H + det H (2D), tr H + I₂(H) + det H (3D) while |j| < ½, and det(I+H) − 1 beyond, where the
    /// sum would cancel.
    ///
    /// ```
    /// use bfree::tensor::{Deformation, Tensor, Vector};
    ///
    /// // Stretched by 2 along x and by ½ along y: no change of volume, E = diag(3/2, -3/8).
    /// let at = Deformation::<f64, 2>::new(Tensor::from_diagonal(&Vector::from([1.0, -0.5])));
    /// assert_eq!(at.jacobian, 1.0);
    /// assert_eq!(at.green_lagrange().diagonal(), Vector::from([1.5, -0.375]));
    /// // A strain of 1e-12 has all its digits, which F alone would have lost.
    /// let small = Deformation::<f64, 1>::new(Tensor::from_element(1e-12));
    /// assert_eq!(small.j, 1e-12);
    /// ```
    #[inline(always)]
    pub fn new(h: Tensor<T, D>) -> Self {
        let f = identity::<T, D>() + h;
        let j = change_of_volume(&h);
        let (j, jacobian) = if D == 1 || j.value().abs() < 0.5 {
            (j, T::one() + j)
        } else {
            let jacobian = determinant(&f);
            (jacobian - T::one(), jacobian)
        };
        Self { h, f, j, jacobian }
    }

    /// Green–Lagrange strain, E = sym H + ½ HᵀH
    ///
    /// ```
    /// use bfree::tensor::{Deformation, Tensor, identity, scaled, symmetric};
    ///
    /// // E = (FᵀF − I)/2; a rotation strains nothing, though sym H is not zero.
    /// let (sin, cos) = (0.6, 0.8);
    /// let rotation = Deformation::<f64, 2>::new(Tensor::<f64, 2>::new(cos - 1.0, -sin, sin, cos - 1.0));
    /// assert!(rotation.green_lagrange().norm() < 1e-16 && symmetric(&rotation.h).norm() > 0.2);
    /// let shear = Deformation::<f64, 2>::new(Tensor::<f64, 2>::new(0.0, 0.5, 0.0, 0.0));
    /// assert_eq!(shear.green_lagrange(), scaled(&(shear.f.transpose() * shear.f - identity()), 0.5));
    /// ```
    #[inline(always)]
    pub fn green_lagrange(&self) -> Tensor<T, D> {
        symmetric(&self.h) + scaled(&(self.h.transpose() * self.h), T::lit(0.5))
    }

    /// F⁻ᵀ = cof(F)/J
    ///
    /// ```
    /// use bfree::tensor::{Deformation, Tensor, identity};
    ///
    /// let at = Deformation::<f64, 2>::new(Tensor::<f64, 2>::new(1.0, 0.5, 0.0, -0.5));
    /// assert_eq!(at.inverse_transpose().transpose() * at.f, identity::<f64, 2>());
    /// ```
    #[inline(always)]
    pub fn inverse_transpose(&self) -> Tensor<T, D> {
        scaled(&cofactor(&self.f), self.jacobian.recip())
    }

    /// J² − 1 = j (2 + j)
    ///
    /// ```
    /// use bfree::tensor::{Deformation, Tensor};
    ///
    /// // At a strain of 1e-20, J² = 1 to the last bit, but J² − 1 = 2e-20.
    /// let at = Deformation::<f64, 1>::new(Tensor::from_element(1e-20));
    /// assert_eq!((at.jacobian * at.jacobian - 1.0, at.jacobian_squared_minus_one()), (0.0, 2e-20));
    /// ```
    #[inline(always)]
    pub fn jacobian_squared_minus_one(&self) -> T {
        self.j * (T::lit(2.0) + self.j)
    }

    /// ln J = k ln 2 + 2 artanh s with s = (m − 1)/(m + 1) and m = J/2ᵏ between √½ and √2. Where k = 0, m − 1 = j.
    ///
    /// The evaluation uses arithmetic alone, so that a loop over it is vectorised and all machines give the same digits.
    ///
    /// ```
    /// use bfree::tensor::{Deformation, Tensor};
    ///
    /// // A small dilation, and one of e − 1.
    /// let stretched = |h| Deformation::<f64, 1>::new(Tensor::from_element(h)).log_jacobian();
    /// assert_eq!(stretched(1e-20), 1e-20);
    /// assert!((stretched(1_f64.exp_m1()) - 1.0).abs() < 1e-15);
    /// ```
    #[inline(always)]
    pub fn log_jacobian(&self) -> T {
        // The biased exponent of a positive number, and a power of two from it.
        let biased = ((self.jacobian.value() * SQRT_2).to_bits() >> 52) as i32;
        let scale = f64::from_bits(((2046 - biased).clamp(0, 2046) as u64) << 52);
        let k = biased - 1023;
        let m_minus_one = if k == 0 { self.j } else { self.jacobian * T::lit(scale) - T::one() };
        mutant!("tensor: ln J of small j by its difference": m_minus_one = self.jacobian * T::lit(scale) - T::one());
        let s = m_minus_one / (T::lit(2.0) + m_minus_one);
        let s2 = s * s;
        let mut series = T::zero();
        for n in (0..=11).rev() {
            series = series * s2 + T::lit(2.0 / (2 * n + 1) as f64);
        }
        s * series + T::lit(f64::from(k) * LN_2)
    }

    /// tr E − j, of second order.
    ///
    /// ½ H:H (1D), ½ H:H − det H (2D), ½ H:H − I₂(H) − det H (3D) does not cancel while H is as small as the strain. Where a rotation makes
    /// H much larger than E, these terms do cancel. J² = det(I + 2E) then gives (j tr E − 4 I₂(E) − 8 det E)/(2 + j) in strains alone,
    /// without det E in 2D.
    ///
    /// ```
    /// use bfree::tensor::{Deformation, Tensor, Vector, trace};
    ///
    /// let at = Deformation::<f64, 2>::new(Tensor::from_diagonal(&Vector::from([0.25, -0.5])));
    /// assert_eq!(at.trace_e_minus_j(), trace(&at.green_lagrange()) - at.j);
    /// // Here round-off loses that difference: uniaxial, tr E − j = ½ h².
    /// let small = Deformation::<f64, 1>::new(Tensor::from_element(1e-10));
    /// assert_eq!(small.trace_e_minus_j(), 0.5 * 1e-10 * 1e-10);
    /// ```
    #[inline(always)]
    pub fn trace_e_minus_j(&self) -> T {
        let (h, e) = (&self.h, self.green_lagrange());
        let turned = D > 1 && contract(&e, &e).value() < 0.25 * contract(h, h).value();
        if turned {
            let minors = match D {
                2 => T::lit(4.0) * determinant(&e),
                _ => T::lit(4.0) * second_invariant(&e) + T::lit(8.0) * determinant(&e),
            };
            return (self.j * trace(&e) - minors) / (T::lit(2.0) + self.j);
        }
        let half_hh = contract(h, h) * T::lit(0.5);
        match D {
            1 => half_hh,
            2 => half_hh - determinant(h),
            _ => half_hh - second_invariant(h) - determinant(h),
        }
    }

    /// tr E − ln J, of second order. While J is not large, it is the sum of (tr E − j) and (j − ln J). For large J both would be much
    /// larger than their sum.
    #[inline(always)]
    pub(crate) fn trace_e_minus_log_jacobian(&self) -> T {
        if self.j.value() < 2.0 {
            self.trace_e_minus_j() + self.j_minus_log_jacobian()
        } else {
            trace(&self.green_lagrange()) - self.log_jacobian()
        }
    }

    /// j − ln(1 + j), of second order. With s = j/(2+j), ln(1+j) = 2 artanh s, and j − ln(1+j) = j s − 2 s³ (1/3 + s²/5 + s⁴/7 + …) does
    /// not cancel.
    ///
    /// ```
    /// use bfree::tensor::{Deformation, Tensor};
    ///
    /// // j − ln(1 + j) = ½ j² − ⅓ j³ + …, also where j and ln(1 + j) agree in nearly all digits.
    /// let j = 1e-8;
    /// let at = Deformation::<f64, 1>::new(Tensor::from_element(j));
    /// let series = j * j * (0.5 - j / 3.0 + j * j / 4.0);
    /// assert!((at.j_minus_log_jacobian() / series - 1.0).abs() < 1e-15);
    /// ```
    #[inline(always)]
    pub fn j_minus_log_jacobian(&self) -> T {
        let s = self.j / (T::lit(2.0) + self.j);
        if s.value().abs() >= 0.2 {
            return self.j - self.log_jacobian();
        }
        let s2 = s * s;
        let mut series = T::zero();
        for k in (1..=12).rev() {
            series = series * s2 + T::lit(1.0 / (2 * k + 1) as f64);
        }
        self.j * s - T::lit(2.0) * s2 * s * series
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cofactor_is_defined_for_singular_tensors_too() {
        // cof(A)ᵀ A = det(A) I
        let a = Tensor::<f64, 3>::new(2.0, 1.0, 0.0, 0.0, 3.0, 1.0, 1.0, 0.0, 1.0);
        assert_eq!(cofactor(&a).transpose() * a, identity::<f64, 3>() * determinant(&a));
        // Nanson: cof F maps areas. In a body flattened along x, a face normal to x keeps its area, and a face normal to y loses it.
        let flat = Tensor::<f64, 2>::from_diagonal(&Vector::from([0.0, 1.0]));
        assert_eq!(cofactor(&flat), Tensor::from_diagonal(&Vector::from([1.0, 0.0])));
    }

    #[test]
    fn the_derivative_of_the_cofactor_is_linear_to_the_last_bit() {
        // cof is homogeneous of degree 2 in 3D, so the derivative along A is 2 cof A.
        let a = Tensor::<f64, 3>::new(2.0, 1.0, 0.0, 0.0, 3.0, 1.0, 1.0, 0.0, 1.0);
        assert_eq!(cofactor_derivative(&a, &a), cofactor(&a) * 2.0);
        let (x, small) = (Tensor::<f64, 3>::new(0.1, -0.7, 0.3, 0.2, 0.9, -0.4, 0.8, 0.5, 0.6), 2.0_f64.powi(-60));
        assert_eq!(cofactor_derivative(&a, &(x * small)), cofactor_derivative(&a, &x) * small);
    }
}
