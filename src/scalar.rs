//! The number type of the kernels: one trait for `f64` and the (nested) dual numbers of `num-dual`.

use num_dual::{DualNumCopy, DualStruct};
use num_traits::{NumCast, ToPrimitive};

/// A number the residual can be evaluated with.
///
/// `f64` for computing, `Dual64`, `HyperDual64`, `Dual<Dual64>`, … for derivatives. Dual numbers compare by their real part, so a branch
/// takes the path `f64` would take; both sides of a branch must therefore be the same analytic function.
///
/// ```
/// use bfree::scalar::Real;
/// use num_dual::Dual64;
///
/// let x = Dual64::lit(2.0).derivative();
/// assert_eq!((x * x).value(), 4.0);
/// assert_eq!((x * x).eps, 4.0);
/// ```
pub trait Real: DualNumCopy {
    /// The constant `x`, with zero derivatives.
    fn lit(x: f64) -> Self;
    /// The real part, as `f64`.
    fn value(self) -> f64;
}

impl<T: DualNumCopy> Real for T {
    #[inline(always)]
    fn lit(x: f64) -> Self {
        // A cast from f64 always succeeds; the fallback is never taken.
        <T::Primitive as NumCast>::from(x).map_or_else(T::zero, T::from)
    }

    #[inline(always)]
    fn value(self) -> f64 {
        DualStruct::re(&self).to_f64().unwrap_or(f64::NAN)
    }
}

/// The root x of r(x) = 0 with all derivatives that `T` carries, by the implicit function theorem. A law that solves an equation needs this
/// function to be differentiable. `root` is the value of x, found by any means, and `slope` is dr/dx there. `residual` captures the
/// quantities that r depends on, with their derivatives, as `T`.
///
/// Each step of Newton's method, with the slope fixed, makes one more order of the derivatives right. The first step polishes the value.
///
/// ```
/// use bfree::scalar::{Real, implicit};
/// use num_dual::Dual64;
///
/// // x³ = a at a = 8: dx/da = 1/(3x²)
/// let a = Dual64::lit(8.0).derivative();
/// let x = implicit(2.0, 12.0, |x: Dual64| x * x * x - a);
/// assert_eq!((x.value(), x.eps), (2.0, 1.0 / 12.0));
/// ```
pub fn implicit<T: Real>(root: f64, slope: f64, residual: impl Fn(T) -> T) -> T {
    let inverse_slope = T::lit(slope.recip());
    (0..=T::NDERIV).fold(T::lit(root), |x, _| x - residual(x) * inverse_slope)
}

/// Sums and products of one kind of number, so that a formula written once serves single numbers and vector lanes.
///
/// ```
/// use bfree::scalar::{Arithmetic, Single};
///
/// /// a·b
/// fn dot<A: Arithmetic>(with: A, a: &[A::N], b: &[A::N]) -> A::N {
///     a.iter().zip(b).fold(with.zero(), |sum, (&a, &b)| with.mul_add(a, b, sum))
/// }
///
/// assert_eq!(dot(Single, &[1.0, 2.0], &[3.0, 4.0]), 11.0);
/// // (a + b)² − 2ab = a² + b², in one formula for numbers and lanes
/// let (a, b) = (3.0, 4.0);
/// let (sum, twice) = (Single.add(a, b), Single.add(a, a));
/// assert_eq!(Single.mul_sub(twice, b, Single.mul(sum, sum)), dot(Single, &[a, b], &[a, b]));
/// ```
pub trait Arithmetic: Copy {
    /// The number, or the lanes.
    type N: Copy;
    /// 0
    fn zero(self) -> Self::N;
    /// a + b
    fn add(self, a: Self::N, b: Self::N) -> Self::N;
    /// a b
    fn mul(self, a: Self::N, b: Self::N) -> Self::N;
    /// a b + c
    fn mul_add(self, a: Self::N, b: Self::N, c: Self::N) -> Self::N;
    /// c − a b
    fn mul_sub(self, a: Self::N, b: Self::N, c: Self::N) -> Self::N;
}

/// The arithmetic of single numbers, every operation rounded.
#[derive(Clone, Copy, Debug)]
pub struct Single;

impl Arithmetic for Single {
    type N = f64;
    #[inline(always)]
    fn zero(self) -> f64 {
        0.0
    }
    #[inline(always)]
    fn add(self, a: f64, b: f64) -> f64 {
        a + b
    }
    #[inline(always)]
    fn mul(self, a: f64, b: f64) -> f64 {
        a * b
    }
    #[inline(always)]
    fn mul_add(self, a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }
    #[inline(always)]
    fn mul_sub(self, a: f64, b: f64, c: f64) -> f64 {
        c - a * b
    }
}
