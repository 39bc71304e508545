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
