//! det F > 0, and P = F S.

use super::{Elastic, Law, Start};
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor};

/// det F ≤ 0 (or not a number): no body can be there.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("det F = {det_f:e} is not positive")]
pub struct NonPositiveJacobian {
    /// The determinant found.
    pub det_f: f64,
}

/// Whether a body can have this det F.
#[inline(always)]
fn possible(det_f: f64) -> bool {
    det_f > 0.0 && det_f.is_finite()
}

impl NonPositiveJacobian {
    /// Checks det F > 0; refuses NaN and infinity.
    ///
    /// ```
    /// use bfree::material::NonPositiveJacobian;
    ///
    /// // A flat body is none, one that is nearly flat is.
    /// assert_eq!(NonPositiveJacobian::check(1e-300), Ok(()));
    /// assert_eq!(NonPositiveJacobian::check(0.0), Err(NonPositiveJacobian { det_f: 0.0 }));
    /// assert!(NonPositiveJacobian::check(f64::NAN).is_err());
    /// ```
    ///
    /// # Errors
    /// `det_f` is none of a body.
    #[inline(always)]
    pub fn check(det_f: f64) -> Result<(), Self> {
        if possible(det_f) { Ok(()) } else { Err(Self { det_f }) }
    }
}

/// Checks det F > 0, on J and never on J²; refuses NaN.
///
/// ```
/// use bfree::material::admissible;
/// use bfree::tensor::Tensor;
///
/// // Turned inside out in both directions, J² = 1 and even J = 1; in one direction J = −1.
/// let turned = Tensor::<f64, 1>::from_element(-2.0);
/// assert_eq!(admissible(turned).map_err(|error| error.det_f).unwrap_err(), -1.0);
/// assert!(admissible(Tensor::<f64, 1>::from_element(-0.999)).is_ok());
/// ```
///
/// # Errors
/// det F ≤ 0.
#[inline(always)]
pub fn admissible<T: Real, const D: usize>(h: Tensor<T, D>) -> Result<Deformation<T, D>, NonPositiveJacobian> {
    let at = Deformation::new(h);
    NonPositiveJacobian::check(at.jacobian.value())?;
    Ok(at)
}

/// The deformation, or that of the body at rest where det F is none of a body; and det F, for the caller to judge.
#[inline(always)]
pub(crate) fn admissible_or_rest<T: Real, const D: usize>(h: Tensor<T, D>) -> (Deformation<T, D>, f64) {
    let at = Deformation::new(h);
    let det_f = at.jacobian.value();
    (if possible(det_f) { at } else { Deformation::new(Tensor::zeros()) }, det_f)
}

/// `P = F S` (eq. 7), F and S of different deformations if derivatives ask for it. The only place that forms P.
#[inline(always)]
pub(crate) fn piola<L: Law, T: Real, const D: usize>(
    law: &L,
    f_left: &Tensor<T, D>,
    at: &Deformation<T, D>,
    start: &Start<'_>,
) -> Tensor<T, D> {
    f_left * law.stress(at, start)
}

/// `P = F S` (eq. 7), with the F on the left and the H = F − I inside S given separately.
///
/// ```
/// use bfree::material::{Elastic, Lame, NeoHookean, first_piola};
/// use bfree::tensor::{Deformation, Tensor, contract};
/// use num_dual::Dual64;
///
/// // P = ∂W/∂F: P : δF is the derivative of W.
/// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
/// let (h, delta) = (Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1), Tensor::<f64, 2>::new(0.5, -1.0, 0.25, 2.0));
/// let piola = first_piola(&law, &Deformation::new(h).f, h)?;
/// let energy = law.energy(&Deformation::new(h.zip_map(&delta, Dual64::new)));
/// assert!((contract(&piola, &delta) - energy.eps).abs() < 1e-14 * piola.norm() * delta.norm());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// det F ≤ 0 of the F inside S.
#[inline(always)]
pub fn first_piola<L: Elastic, T: Real, const D: usize>(
    law: &L,
    f_left: &Tensor<T, D>,
    h_inside: Tensor<T, D>,
) -> Result<Tensor<T, D>, NonPositiveJacobian> {
    Ok(piola(law, f_left, &admissible(h_inside)?, &Start::NONE))
}

/// A D×D tensor as the upper left part of a 3×3 one, the rest zero.
pub(crate) fn embed<T: Real, const D: usize>(a: &Tensor<T, D>) -> Tensor<T, 3> {
    Tensor::from_fn(|i, k| if i < D && k < D { a[(i, k)] } else { T::zero() })
}
