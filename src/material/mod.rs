//! Hyperelastic laws: one file a law, one list ([`Material`]).
//!
//! A law gives its energy `W`, the second Piola–Kirchhoff stress `S`, the action `ℂ:X` of its tangent and the B-free
//! tangent density `ℂmat{v,b}` of Planas, Romero, Sancho (the paper's eq. 37). The first Piola–Kirchhoff stress `P = F S` is
//! formed in one place only, [`first_piola`], from F on the left and F inside S given separately: that is what lets
//! dual numbers check the geometric and the material tangent term by term.

mod closed_tangent;
mod from_energy;
mod frozen_general;
mod lame;
mod neo_hookean;
mod st_venant_kirchhoff;

pub use closed_tangent::ClosedTangent;
pub use from_energy::{Energy, FromEnergy};
pub use frozen_general::FrozenGeneral;
pub use lame::{Lame, LameError};
pub use neo_hookean::{NeoHookean, Volumetric};
pub use st_venant_kirchhoff::StVenantKirchhoff;

use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector, outer};

/// det F ≤ 0 (or not a number): no body can be there.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("det F = {det_f:e} is not positive")]
pub struct NonPositiveJacobian {
    /// The determinant found.
    pub det_f: f64,
}

/// A pointwise hyperelastic law in `D` = 1 (uniaxial strain), 2 (plane strain) or 3 dimensions.
///
/// Every method takes the deformation as H = F − I wrapped in a [`Deformation`] whose Jacobian is positive (the callers in this
/// module make sure of it). Stresses have the unit of the law's moduli; `W` is per unit reference volume.
pub trait Law: Send + Sync {
    /// The tangent frozen at one state, see [`FrozenTangent`].
    type Frozen<T: Real, const D: usize>: FrozenTangent<T, D>;

    /// Strain energy density `W`.
    fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> T;

    /// Second Piola–Kirchhoff stress `S = ∂W/∂E`, symmetric.
    fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> Tensor<T, D>;

    /// `ℂ:X = ∂S/∂E : sym X`.
    fn elasticity<T: Real, const D: usize>(&self, at: &Deformation<T, D>, x: &Tensor<T, D>) -> Tensor<T, D>;

    /// The B-free tangent density, `ℂmat{v,b} a = [ℂ:(a ⊗ b)] v` (eq. 37).
    fn tangent_density<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        v: &Vector<T, D>,
        b: &Vector<T, D>,
    ) -> Tensor<T, D> {
        let mut density: Tensor<T, D> = Tensor::zeros();
        for k in 0..D {
            let e_k = Vector::from_fn(|i, _| if i == k { T::one() } else { T::zero() });
            density.set_column(k, &(self.elasticity(at, &outer(&e_k, b)) * v));
        }
        density
    }

    /// Freezes the whole tangent (geometric + material) of a particle of reference volume `volume` at the state `at`,
    /// for gradients taken in the configuration `n` whose deformation gradient is `f_n`.
    fn freeze<T: Real, const D: usize>(
        &self,
        f_n: &Tensor<T, D>,
        at: &Deformation<T, D>,
        volume: T,
    ) -> Self::Frozen<T, D>;

    /// This law as one of the shipped ones, whose loops over particles are compiled in the library, once; `None` for all others.
    fn shipped(&self) -> Option<&Material> {
        None
    }

    /// Out-of-plane Cauchy stress under plane or uniaxial strain, for output; for isotropic laws.
    /// By embedding into 3D.
    fn out_of_plane_stress<const D: usize>(&self, at: &Deformation<f64, D>) -> f64 {
        let embedded = Deformation::new(embed(&at.h));
        // σ_zz = P_zz F_zz / J with F_zz = 1
        self.stress(&embedded)[(2, 2)] / at.jacobian
    }
}

/// Something to be done with a law of whatever type.
pub(crate) trait LawVisitor {
    /// Does it.
    fn visit<L: Law>(self, law: &L);
}

/// The tangent of one particle, frozen: everything its product needs and nothing more.
///
/// With `L = Σ_J u_J ⊗ ∇_n N_J` and δF = L F_n the product is `L ↦ V₀ δP F_nᵀ`, where δP = δF S + F [ℂ : FᵀδF]: the
/// nodal forces are that tensor times `∇_n N_I`.
pub trait FrozenTangent<T: Real, const D: usize>: Clone + Send + Sync {
    /// `V₀ (δF S + F [ℂ : Fᵀ δF]) F_nᵀ` with δF = L F_n.
    fn apply(&self, l: &Tensor<T, D>) -> Tensor<T, D>;

    /// The block `V₀ { F ℂmat{∇N_I, ∇N_J} Fᵀ + (∇N_I · S ∇N_J) I }` (eqs. 34, 38), from gradients in the configuration n.
    fn block(&self, grad_i: &Vector<T, D>, grad_j: &Vector<T, D>) -> Tensor<T, D>;

    /// The same in closed form, which the vectorised product is made for; `None` if there is none.
    fn closed(&self) -> Option<ClosedTangent<T, D>> {
        None
    }
}

/// Whether a body can have this det F.
#[inline(always)]
fn possible(det_f: f64) -> bool {
    det_f > 0.0 && det_f.is_finite()
}

impl NonPositiveJacobian {
    /// Checks det F > 0; refuses NaN and infinity.
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
) -> Tensor<T, D> {
    f_left * law.stress(at)
}

/// `P = F S` (eq. 7), with the F on the left and the H = F − I inside S given separately.
///
/// # Errors
/// det F ≤ 0 of the F inside S.
#[inline(always)]
pub fn first_piola<L: Law, T: Real, const D: usize>(
    law: &L,
    f_left: &Tensor<T, D>,
    h_inside: Tensor<T, D>,
) -> Result<Tensor<T, D>, NonPositiveJacobian> {
    Ok(piola(law, f_left, &admissible(h_inside)?))
}

/// A D×D tensor as the upper left part of a 3×3 one, the rest zero.
pub(crate) fn embed<T: Real, const D: usize>(a: &Tensor<T, D>) -> Tensor<T, 3> {
    Tensor::from_fn(|i, k| if i < D && k < D { a[(i, k)] } else { T::zero() })
}

/// The list of laws. A word here makes a law a variant of [`Material`]; CONTRIBUTING.md says what else a shipped law touches.
macro_rules! materials {
    ($($law:ident),*) => {
        /// Any of the shipped laws.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Material {
            $(#[doc = concat!("See [`", stringify!($law), "`].")] $law($law)),*
        }

        /// The frozen tangent of any of the shipped laws.
        #[derive(Clone, Debug)]
        pub enum FrozenMaterial<T: Real, const D: usize> {
            $(#[doc = concat!("See [`", stringify!($law), "`].")] $law(<$law as Law>::Frozen<T, D>)),*
        }

        impl<T: Real, const D: usize> FrozenTangent<T, D> for FrozenMaterial<T, D> {
            #[inline(always)]
            fn apply(&self, l: &Tensor<T, D>) -> Tensor<T, D> {
                match self { $(Self::$law(frozen) => frozen.apply(l)),* }
            }
            #[inline(always)]
            fn block(&self, grad_i: &Vector<T, D>, grad_j: &Vector<T, D>) -> Tensor<T, D> {
                match self { $(Self::$law(frozen) => frozen.block(grad_i, grad_j)),* }
            }
            #[inline(always)]
            fn closed(&self) -> Option<ClosedTangent<T, D>> {
                match self { $(Self::$law(frozen) => frozen.closed()),* }
            }
        }

        impl Law for Material {
            type Frozen<T: Real, const D: usize> = FrozenMaterial<T, D>;
            #[inline(always)]
            fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> T {
                match self { $(Self::$law(law) => law.energy(at)),* }
            }
            #[inline(always)]
            fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> Tensor<T, D> {
                match self { $(Self::$law(law) => law.stress(at)),* }
            }
            #[inline(always)]
            fn elasticity<T: Real, const D: usize>(&self, at: &Deformation<T, D>, x: &Tensor<T, D>) -> Tensor<T, D> {
                match self { $(Self::$law(law) => law.elasticity(at, x)),* }
            }
            fn tangent_density<T: Real, const D: usize>(
                &self, at: &Deformation<T, D>, v: &Vector<T, D>, b: &Vector<T, D>,
            ) -> Tensor<T, D> {
                match self { $(Self::$law(law) => law.tangent_density(at, v, b)),* }
            }
            fn freeze<T: Real, const D: usize>(
                &self, f_n: &Tensor<T, D>, at: &Deformation<T, D>, volume: T,
            ) -> Self::Frozen<T, D> {
                match self { $(Self::$law(law) => FrozenMaterial::$law(law.freeze(f_n, at, volume))),* }
            }
            fn shipped(&self) -> Option<&Material> {
                Some(self)
            }
        }

        impl Material {
            /// Calls `visitor` with the law, by a type that leaves no branch in a loop over particles.
            pub(crate) fn with(&self, visitor: impl LawVisitor) {
                match self { $(Self::$law(law) => law.with(visitor)),* }
            }
        }

        $(impl From<$law> for Material {
            fn from(law: $law) -> Self {
                Self::$law(law)
            }
        })*
    };
}

materials!(NeoHookean, StVenantKirchhoff);
