//! One particle: its deformation, its stress in the internal force, and its linearised tangent.
//!
//! The code is generic over the number type. No function returns early, so a loop over particles is pure arithmetic. The compiler
//! vectorises this loop if the law is pure arithmetic, too.

use crate::material::{ClosedTangent, Law, MaterialState, first_piola};
use crate::mechanics::kinematics::{compose, to_nodes};
use crate::scalar::Real;
use crate::tensor::{Tensor, identity, scaled};

/// A part of a term's tangent that can be linearised alone. In the code for `F S`, derivatives of the left F alone give the geometric part.
/// Derivatives of the F inside S alone give the material part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Part {
    /// The whole tangent.
    #[default]
    Whole,
    /// δF S, from the F on the left of P = F S.
    Geometric,
    /// F [ℂ : Fᵀ δF], from the F inside S.
    Material,
}

/// `x` with its derivatives, or its real part alone.
#[inline(always)]
fn carried<T: Real>(x: T, carries: bool) -> T {
    if carries { x } else { T::lit(x.value()) }
}

/// V₀ F S F_rᵀ at ∇u = `g`, from the state `at_r`, F of the last grid reset and internal variables at t_n; its product with ∇_r N_I is the internal force on node I. Also returns det F, which the caller must check.
/// Where det F ≤ 0, S is that of the undeformed body. Only the F of `part` carry derivatives.
#[inline(always)]
pub(super) fn internal<L: Law, T: Real, const D: usize>(
    law: &L,
    at_r: &MaterialState<f64, D>,
    g: &Tensor<T, D>,
    volume: f64,
    part: Part,
) -> (Tensor<T, D>, f64) {
    let h = compose(g, &at_r.h);
    let f_left = identity::<T, D>() + h.map(|x| carried(x, part != Part::Material));
    let (at, det_f) = at_r.deformed(h.map(|x| carried(x, part != Part::Geometric))).admissible_or_rest();
    // P = F S (eq. 7)
    (to_nodes(&first_piola(law, &f_left, &at), &at_r.f, volume), det_f)
}

/// δσ = V₀ δP F_rᵀ as a linear map of L = Σ u ⊗ ∇_r N.
pub(super) enum LocalTangent<const D: usize> {
    Closed(ClosedTangent<f64, D>),
    /// The blocks F ℂmat{F_rᵀe_k, F_rᵀe_l} Fᵀ + (F_rᵀe_k · S F_rᵀe_l) I of all pairs of unit gradients (eqs. 37, 38), times V₀.
    General([[[[f64; D]; D]; D]; D]),
}

/// The law linearised at ∇u = `g`, whole or one `part`, and det F as in [`internal`].
#[inline(always)]
pub(super) fn linearize<L: Law, const D: usize>(
    law: &L,
    at_r: &MaterialState<f64, D>,
    g: &Tensor<f64, D>,
    volume: f64,
    part: Part,
) -> (LocalTangent<D>, f64) {
    let (at, det_f) = at_r.deformed(compose(g, &at_r.h)).admissible_or_rest();
    let f_r = at_r.f;
    // δF S F_rᵀ = L B with B = F_r S F_rᵀ
    let geometric = || f_r * law.stress(&at) * f_r.transpose();
    let tangent = match law.closed(&f_r, &at, volume) {
        Some(closed) if part == Part::Whole => LocalTangent::Closed(closed),
        Some(closed) => LocalTangent::Closed(closed.part(&scaled(&geometric(), volume), part == Part::Geometric)),
        None => {
            let mut blocks = match part {
                Part::Geometric => [[Tensor::zeros(); D]; D],
                Part::Whole | Part::Material => law.tangent_blocks(&f_r, &at),
            };
            if part != Part::Material {
                let geometric = geometric();
                mutant!("stress: no geometric part without a closed form": geometric = Tensor::<f64, D>::zeros());
                for k in 0..D {
                    for l in 0..D {
                        blocks[k][l] += scaled(&identity(), geometric[(k, l)]);
                    }
                }
            }
            let entries = |b: Tensor<f64, D>| std::array::from_fn(|i| std::array::from_fn(|j| volume * b[(i, j)]));
            LocalTangent::General(blocks.map(|row| row.map(entries)))
        }
    };
    (tangent, det_f)
}
