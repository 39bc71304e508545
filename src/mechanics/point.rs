//! One particle: its deformation, the stress with which it pulls at the nodes, and its frozen tangent.
//!
//! Written once, for every number. Nothing here returns early: a loop over particles is then arithmetic alone, which the
//! compiler turns into vector instructions where the law is arithmetic alone too.

use crate::material::{Law, NonPositiveJacobian, admissible_or_rest, piola};
use crate::scalar::Real;
use crate::tensor::{Tensor, identity, scaled};

/// A particle whose deformation is impossible.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("particle {particle} cannot be deformed so")]
pub struct Inadmissible {
    /// Id of the particle.
    pub particle: usize,
    /// The determinant found.
    pub source: NonPositiveJacobian,
}

/// Which occurrences of Δφ carry derivatives. In the code that computes `F S`, letting only the left F carry the dual part gives the
/// geometric term of the tangent, only the F inside S the material term, and so on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Carry {
    /// Δφ in the acceleration.
    pub inertia: bool,
    /// F on the left of P = F S.
    pub left: bool,
    /// F inside S.
    pub inside: bool,
    /// F in the follower pressure.
    pub pressure: bool,
}

impl Carry {
    /// All of them: the residual itself.
    pub const ALL: Self = Self { inertia: true, left: true, inside: true, pressure: true };
    /// None of them.
    pub const NONE: Self = Self { inertia: false, left: false, inside: false, pressure: false };
}

/// `x`, or its real part alone.
#[inline(always)]
pub(super) fn carried<T: Real>(x: T, carries: bool) -> T {
    if carries { x } else { T::lit(x.value()) }
}

/// H_{n+1} of F = ΔF F_n with ΔF = I + G: H = G + H_n + G H_n, which loses no digits (eq. 45).
///
/// ```
/// use bfree::mechanics::residual::compose;
/// use bfree::tensor::{Tensor, identity};
///
/// // I + H_{n+1} = (I + G)(I + H_n); and a strain of 1e-20 is kept beside I.
/// let (g, h_n) = (Tensor::<f64, 2>::new(0.5, 0.25, 0.0, -0.5), Tensor::<f64, 2>::new(0.0, 0.5, 0.25, 1.0));
/// assert_eq!(identity() + compose(&g, &h_n), (identity() + g) * (identity() + h_n));
/// assert_eq!(compose(&Tensor::<f64, 1>::zeros(), &Tensor::from_element(1e-20))[(0, 0)], 1e-20);
/// ```
#[inline(always)]
pub fn compose<T: Real, const D: usize>(g: &Tensor<T, D>, h_n: &Tensor<f64, D>) -> Tensor<T, D> {
    let h_n = h_n.map(T::lit);
    g + h_n + g * h_n
}

/// V₀ F S F_nᵀ at ∇u = `g`: times ∇_n N_I it is the internal force on node I. With it det F, which the caller judges: where it is
/// not positive, S is that of the body at rest.
#[inline(always)]
pub(super) fn internal<L: Law, T: Real, const D: usize>(
    law: &L,
    g: &Tensor<T, D>,
    h_n: &Tensor<f64, D>,
    volume: f64,
    carry: Carry,
) -> (Tensor<T, D>, f64) {
    let h = compose(g, h_n);
    let f_left = identity::<T, D>() + h.map(|x| carried(x, carry.left));
    let (at, det_f) = admissible_or_rest(h.map(|x| carried(x, carry.inside)));
    let piola = piola(law, &f_left, &at);
    let f_n_t = (identity::<f64, D>() + h_n).transpose().map(T::lit);
    (scaled(&(piola * f_n_t), T::lit(volume)), det_f)
}

/// The law frozen at ∇u = `g`, and det F as in [`internal`].
#[inline(always)]
pub(super) fn freeze<L: Law, const D: usize>(
    law: &L,
    g: &Tensor<f64, D>,
    h_n: &Tensor<f64, D>,
    volume: f64,
) -> (L::Frozen<f64, D>, f64) {
    let (at, det_f) = admissible_or_rest(compose(g, h_n));
    (law.freeze(&(identity::<f64, D>() + h_n), &at, volume), det_f)
}
