//! The condition det F > 0, and the first Piola–Kirchhoff stress P = F S.

use super::{Elastic, Law, Start};
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor};

/// No body can have this deformation: det F is ≤ 0, infinite, or not a number.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("det F = {det_f:e} is not positive")]
pub struct NonPositiveJacobian {
    /// The determinant found.
    pub det_f: f64,
}

/// Whether det F is positive and finite.
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
        if possible(det_f) { Ok(()) } else { Err(Self { det_f }) }
    }
}

/// The deformation of H = F − I, if it is admissible. Checks det F > 0 on J and never on J², and refuses NaN.
///
/// ```
/// use bfree::material::admissible;
/// use bfree::tensor::Tensor;
///
/// // A body turned inside out in one direction has J = −1, but J² = 1.
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

/// The deformation, and det F for the caller to check. If det F is not admissible, the deformation is that of a body at rest.
#[inline(always)]
pub(crate) fn admissible_or_rest<T: Real, const D: usize>(h: Tensor<T, D>) -> (Deformation<T, D>, f64) {
    let at = Deformation::new(h);
    let det_f = at.jacobian.value();
    (if possible(det_f) { at } else { Deformation::new(Tensor::zeros()) }, det_f)
}

/// `P = F S` (eq. 7). No other function forms P. For derivatives, F and S may belong to different deformations.
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
/// The F inside S has det F ≤ 0.
#[inline(always)]
pub fn first_piola<L: Elastic, T: Real, const D: usize>(
    law: &L,
    f_left: &Tensor<T, D>,
    h_inside: Tensor<T, D>,
) -> Result<Tensor<T, D>, NonPositiveJacobian> {
    Ok(piola(law, f_left, &admissible(h_inside)?, &Start::NONE))
}

/// A 3×3 tensor with a D×D tensor as its upper left part, and zeros elsewhere.
pub(crate) fn embed<T: Real, const D: usize>(a: &Tensor<T, D>) -> Tensor<T, 3> {
    Tensor::from_fn(|i, k| if i < D && k < D { a[(i, k)] } else { T::zero() })
}
