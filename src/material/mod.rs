//! Hyperelastic laws: one file a law, with its formulas and what a scene writes of it ([`Listed`]); one list, which makes [`Material`]
//! and [`Parameters`].
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
pub use lame::{Lame, LameError, LameParameters};
pub use neo_hookean::{Ciarlet, Logarithmic, NeoHookean, Volumetric};
pub use st_venant_kirchhoff::StVenantKirchhoff;

use crate::problems::Problems;
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector, outer};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
///
/// ```
/// use bfree::material::{Lame, Law, NeoHookean};
/// use bfree::scalar::Real;
/// use bfree::tensor::{Deformation, Tensor, Vector, contract, outer, symmetric};
/// use num_dual::Dual64;
///
/// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
/// let at = Deformation::<f64, 2>::new(Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1));
/// let delta = Tensor::<f64, 2>::new(0.5, -1.0, 0.25, 2.0);
/// // What δF makes of the strain: δE = sym(Fᵀ δF)
/// let strain = symmetric(&(at.f.transpose() * delta));
/// // S = ∂W/∂E and ℂ:δE = δS, by dual numbers through the law itself.
/// let dual = Deformation::new(at.h.zip_map(&delta, Dual64::new));
/// assert!((law.energy(&dual).eps - contract(&law.stress(&at), &strain)).abs() < 1e-15);
/// let change = law.elasticity(&at, &strain);
/// assert!((law.stress(&dual).map(|s| s.eps) - change).norm() < 1e-14);
/// // ℂmat{v, b} a = [ℂ : (a ⊗ b)] v   (37)
/// let (a, b, v) = (Vector::from([1.0, 2.0]), Vector::from([0.5, -1.0]), Vector::from([3.0, 1.0]));
/// let (left, right) = (law.tangent_density(&at, &v, &b) * a, law.elasticity(&at, &outer(&a, &b)) * v);
/// assert!((left - right).norm() < 1e-14);
/// # Ok::<(), bfree::material::LameError>(())
/// ```
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
    ///
    /// ```
    /// use bfree::material::{FrozenTangent, Lame, Law, NeoHookean, first_piola};
    /// use bfree::tensor::{Deformation, Tensor, identity};
    /// use num_dual::Dual64;
    ///
    /// // V₀ δP, geometric and material together, is the derivative of V₀ P = V₀ F S. Here F_n = I, so that δF = L.
    /// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
    /// let (h, l) = (Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1), Tensor::<f64, 2>::new(0.5, -1.0, 0.25, 2.0));
    /// let frozen = law.freeze(&identity(), &Deformation::new(h), 3.0);
    /// let dual = h.zip_map(&l, Dual64::new);
    /// let delta = first_piola(&law, &Deformation::new(dual).f, dual)?.map(|x| 3.0 * x.eps);
    /// assert!((frozen.apply(&l) - delta).norm() < 1e-14 * delta.norm());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    fn freeze<T: Real, const D: usize>(
        &self,
        f_n: &Tensor<T, D>,
        at: &Deformation<T, D>,
        volume: T,
    ) -> Self::Frozen<T, D>;

    /// This law as one of the shipped ones, whose loops over particles are compiled in the library, once; `None` for all others.
    ///
    /// ```
    /// use bfree::material::{Lame, Law, Material, NeoHookean};
    ///
    /// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
    /// let material = Material::from(law);
    /// // The law in the list is one of the shipped ones: itself.
    /// assert_eq!(material.shipped(), Some(&material));
    /// assert_eq!(law.shipped(), None);
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    fn shipped(&self) -> Option<&Material> {
        None
    }

    /// Out-of-plane Cauchy stress under plane or uniaxial strain, for output; for isotropic laws.
    /// By embedding into 3D.
    ///
    /// ```
    /// use bfree::material::{Lame, Law, StVenantKirchhoff};
    /// use bfree::tensor::{Deformation, Tensor};
    ///
    /// // Uniaxial strain, small: σ_zz = Λ ε = ν (σ_xx + σ_yy)
    /// let law = StVenantKirchhoff { lame: Lame::from_young_poisson(2.5, 0.25)? };
    /// let strain = 1e-9;
    /// let at = Deformation::<f64, 1>::new(Tensor::from_element(strain));
    /// assert!((law.out_of_plane_stress(&at) / (law.lame.lambda * strain) - 1.0).abs() < 1e-8);
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    fn out_of_plane_stress<const D: usize>(&self, at: &Deformation<f64, D>) -> f64 {
        let embedded = Deformation::new(embed(&at.h));
        // σ_zz = P_zz F_zz / J with F_zz = 1
        self.stress(&embedded)[(2, 2)] / at.jacobian
    }
}

/// What a law of the list has beside its formulas.
pub trait Listed: Law + Sized {
    /// What a scene writes of it: the doc comments of the fields are the manual. Isotropic laws share [`LameParameters`].
    type Parameters;

    /// Its name in reports.
    const NAME: &'static str;

    /// The law; or `None`, and `problems` of the keys below `path`.
    fn build(given: &Self::Parameters, problems: &mut Problems, path: &str) -> Option<Self>;

    /// A member that is Hooke's law of Λ and G at small strain, with other constants as it likes: what tests and studies take.
    fn example(lame: Lame) -> Self;
}

/// The largest modulus of pressure waves along an axis of the body at rest, ℂ₁₁₁₁; Λ + 2G of isotropic laws.
///
/// ```
/// use bfree::material::{Lame, NeoHookean, p_wave_modulus};
///
/// let lame = Lame::from_young_poisson(100.0, 0.3)?;
/// assert_eq!(p_wave_modulus(&NeoHookean::logarithmic(lame)), lame.p_wave_modulus());
/// # Ok::<(), bfree::material::LameError>(())
/// ```
pub fn p_wave_modulus<L: Law>(law: &L) -> f64 {
    let rest = Deformation::<f64, 3>::new(Tensor::zeros());
    let along = |k| law.elasticity(&rest, &Tensor::from_fn(|i, j| if i == k && j == k { 1.0 } else { 0.0 }))[(k, k)];
    along(0).max(along(1)).max(along(2))
}

/// Something to be done with a law of whatever type.
pub(crate) trait LawVisitor {
    /// What comes out.
    type Output;
    /// Does it.
    fn visit<L: Law + 'static>(self, law: L) -> Self::Output;
}

/// The tangent of one particle, frozen: everything its product needs and nothing more.
///
/// With `L = Σ_J u_J ⊗ ∇_n N_J` and δF = L F_n the product is `L ↦ V₀ δP F_nᵀ`, where δP = δF S + F [ℂ : FᵀδF]: the
/// nodal forces are that tensor times `∇_n N_I`.
///
/// ```
/// use bfree::material::{FrozenTangent, Lame, Law, NeoHookean};
/// use bfree::tensor::{Deformation, Tensor, Vector, contract, identity, outer};
///
/// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
/// let at = Deformation::<f64, 2>::new(Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1));
/// let frozen = law.freeze(&identity(), &at, 2.0);
/// // A node's displacement u_J makes L = u_J ⊗ ∇N_J, and the force on node I is (V₀ δP) ∇N_I = K_IJ u_J.
/// let (grad_i, grad_j) = (Vector::from([1.0, -0.5]), Vector::from([0.25, 2.0]));
/// let u = Vector::from([3.0, 1.0]);
/// let force = frozen.apply(&outer(&u, &grad_j)) * grad_i;
/// assert!((force - frozen.block(&grad_i, &grad_j) * u).norm() < 1e-14);
/// // The law has an energy, so its tangent is symmetric: A : K B = B : K A.
/// let (a, b) = (Tensor::<f64, 2>::new(1.0, 2.0, 0.5, -1.0), Tensor::<f64, 2>::new(0.0, 1.0, 3.0, 0.5));
/// assert!((contract(&a, &frozen.apply(&b)) - contract(&b, &frozen.apply(&a))).abs() < 1e-14);
/// assert!(frozen.closed().is_some());
/// # Ok::<(), bfree::material::LameError>(())
/// ```
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
) -> Tensor<T, D> {
    f_left * law.stress(at)
}

/// `P = F S` (eq. 7), with the F on the left and the H = F − I inside S given separately.
///
/// ```
/// use bfree::material::{Lame, Law, NeoHookean, first_piola};
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

/// Makes of the list of laws what every law is in.
macro_rules! materials {
    ($($(#[$sentence:meta])+ $key:literal => $law:ident($formula:ty);)*) => {
        /// Any of the shipped laws.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Material {
            $($(#[$sentence])+ $law($formula)),*
        }

        /// A hyperelastic law with its constants.
        #[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
        #[schemars(rename = "Material")]
        pub enum Parameters {
            $($(#[$sentence])+ #[serde(rename = $key)] $law(<$formula as Listed>::Parameters)),*
        }

        impl Parameters {
            /// The law; or `None`, and `problems` of the keys below `path`.
            ///
            /// ```
            /// use bfree::material::{Lame, NeoHookean, Parameters};
            /// use bfree::scene::Problems;
            ///
            /// let written: Parameters = serde_json::from_str(r#"{"neo_hookean": {"lambda": 1, "shear": 2}}"#)?;
            /// let law = written.law(&mut Problems::default(), "material");
            /// assert_eq!(law, Some(NeoHookean::ciarlet(Lame::new(1.0, 2.0)?).into()));
            /// # Ok::<(), Box<dyn std::error::Error>>(())
            /// ```
            pub fn law(&self, problems: &mut Problems, path: &str) -> Option<Material> {
                match self {
                    $(Self::$law(given) => {
                        <$formula>::build(given, problems, &format!("{path}.{}", $key)).map(Material::$law)
                    })*
                }
            }
        }

        /// The frozen tangent of any of the shipped laws.
        #[derive(Clone, Debug)]
        pub enum FrozenMaterial<T: Real, const D: usize> {
            $($(#[$sentence])+ $law(<$formula as Law>::Frozen<T, D>)),*
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
            /// Every law with its name: what tests and studies run over. At small strain all are Hooke's law of Λ and G.
            pub fn examples(lame: Lame) -> Vec<(&'static str, Self)> {
                vec![$((<$formula>::NAME, Self::$law(Listed::example(lame)))),*]
            }

            /// Calls `visitor` with the law, by a type that leaves no branch in a loop over particles.
            pub(crate) fn with<V: LawVisitor>(&self, visitor: V) -> V::Output {
                match self { $(Self::$law(law) => visitor.visit(law.clone())),* }
            }
        }

        $(impl From<$formula> for Material {
            fn from(law: $formula) -> Self {
                Self::$law(law)
            }
        })*
    };
}

// The list of laws: the sentence of the manual, the key of scenes, the type. CONTRIBUTING.md says what else a shipped law touches.
materials! {
    /// Neo-Hookean with Ciarlet's volumetric energy Λ/4 (J² − 1) − Λ/2 ln J: the paper's law.
    "neo_hookean" => NeoHookean(NeoHookean<Ciarlet>);
    /// Neo-Hookean with the volumetric energy Λ/2 (ln J)².
    "neo_hookean_logarithmic" => NeoHookeanLogarithmic(NeoHookean<Logarithmic>);
    /// St. Venant–Kirchhoff: linear in the Green–Lagrange strain; not for strong compression.
    "st_venant_kirchhoff" => StVenantKirchhoff(StVenantKirchhoff);
}
