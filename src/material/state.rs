//! The arguments of a law: the deformation, and the step that leads to it.

use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor};
use std::ops::Deref;

/// The state of a material point that a law evaluates: F at the end of a step, and Δt and the internal variables at the beginning of the
/// step, t_n. The measures of the deformation are those of [`Deformation`], such as `at.f` and `at.green_lagrange()`.
///
/// ```
/// use bfree::material::MaterialState;
/// use bfree::tensor::Tensor;
///
/// let h = Tensor::<f64, 1>::from_element(1.0);
/// let at = MaterialState::new(h).in_step(0.5, &[0.25]);
/// assert_eq!((at.jacobian, at.dt, at.internal), (2.0, 0.5, &[0.25][..]));
/// // Another deformation in the same step
/// assert_eq!(at.deformed(h * 2.0).internal, at.internal);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct MaterialState<'a, T: Real, const D: usize> {
    deformation: Deformation<T, D>,
    /// Δt. It is 0 where a load step on a new grid evaluates the state at t_n, for the out-of-balance force R₀.
    pub dt: f64,
    /// The internal variables at t_n, in the order of [`Law::internal_variables`](super::Law::internal_variables).
    pub internal: &'a [f64],
}

impl<T: Real, const D: usize> MaterialState<'static, T, D> {
    /// The state of H = F − I without internal variables, for elastic laws. Δt = 0.
    #[inline(always)]
    pub fn new(h: Tensor<T, D>) -> Self {
        Self::of(Deformation::new(h))
    }

    /// The state of a deformation.
    #[inline(always)]
    pub(crate) fn of(deformation: Deformation<T, D>) -> Self {
        Self { deformation, dt: 0.0, internal: &[] }
    }
}

impl<'a, T: Real, const D: usize> MaterialState<'a, T, D> {
    /// The same deformation, at the end of a step of length Δt from the internal variables `internal`.
    #[inline(always)]
    pub fn in_step<'b>(self, dt: f64, internal: &'b [f64]) -> MaterialState<'b, T, D> {
        MaterialState { deformation: self.deformation, dt, internal }
    }

    /// Another deformation, H = F − I, at the end of the same step.
    #[inline(always)]
    pub fn deformed<S: Real, const E: usize>(&self, h: Tensor<S, E>) -> MaterialState<'a, S, E> {
        MaterialState { deformation: Deformation::new(h), dt: self.dt, internal: self.internal }
    }

    /// This state, if a body can have it. Checks det F > 0 on J and never on J², and refuses NaN.
    ///
    /// ```
    /// use bfree::material::MaterialState;
    /// use bfree::tensor::Tensor;
    ///
    /// // A body turned inside out in one direction has J = −1, but J² = 1.
    /// let state = |h| MaterialState::new(Tensor::<f64, 1>::from_element(h));
    /// assert_eq!(state(-2.0).admissible().map_err(|error| error.det_f).unwrap_err(), -1.0);
    /// assert!(state(-0.999).admissible().is_ok());
    /// ```
    ///
    /// # Errors
    /// det F ≤ 0.
    #[inline(always)]
    pub fn admissible(self) -> Result<Self, NonPositiveJacobian> {
        NonPositiveJacobian::check(self.jacobian.value())?;
        Ok(self)
    }

    /// The state, and det F for the caller to check. If det F is not admissible, the deformation is that of a body at rest.
    #[inline(always)]
    pub(crate) fn admissible_or_rest(self) -> (Self, f64) {
        let det_f = self.jacobian.value();
        (if NonPositiveJacobian::check(det_f).is_ok() { self } else { self.deformed(Tensor::zeros()) }, det_f)
    }
}

impl<T: Real, const D: usize> Deref for MaterialState<'_, T, D> {
    type Target = Deformation<T, D>;

    #[inline(always)]
    fn deref(&self) -> &Deformation<T, D> {
        &self.deformation
    }
}

/// No body can have this deformation: det F is ≤ 0, infinite, or not a number.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("det F = {det_f:e} is not positive")]
pub struct NonPositiveJacobian {
    /// The determinant found.
    pub det_f: f64,
}

impl NonPositiveJacobian {
    /// Checks det F > 0; refuses NaN and infinity.
    ///
    /// ```
    /// use bfree::material::NonPositiveJacobian;
    ///
    /// // A nearly flat body is admissible, a flat one is not.
    /// assert_eq!(NonPositiveJacobian::check(1e-300), Ok(()));
    /// assert_eq!(NonPositiveJacobian::check(0.0), Err(NonPositiveJacobian { det_f: 0.0 }));
    /// assert!(NonPositiveJacobian::check(f64::NAN).is_err());
    /// ```
    ///
    /// # Errors
    /// `det_f` is not positive, or not finite.
    #[inline(always)]
    pub fn check(det_f: f64) -> Result<(), Self> {
        if det_f > 0.0 && det_f.is_finite() { Ok(()) } else { Err(Self { det_f }) }
    }
}
