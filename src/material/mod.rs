//! Hyperelastic laws: one file a law, with its formulas and what a scene writes of it ([`Listed`]); one list, which makes [`Material`]
//! and [`Parameters`].
//!
//! A law gives its energy `W`, the second Piola–Kirchhoff stress `S`, the action `ℂ:X` of its tangent and the B-free
//! tangent density `ℂmat{v,b}` of Planas, Romero, Sancho (the paper's eq. 37). The first Piola–Kirchhoff stress `P = F S` is
//! formed in one place only, [`first_piola`], from F on the left and F inside S given separately: that is what lets
//! dual numbers check the geometric and the material tangent term by term.

mod closed_tangent;
mod from_energy;
mod lame;
mod neo_hookean;
mod st_venant_kirchhoff;

pub use closed_tangent::ClosedTangent;
pub use from_energy::{Energy, FromEnergy};
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

/// What a particle remembers of a law from step to step: one number, by name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remembered {
    /// As in outputs, checkpoints and `bfree check`.
    pub name: &'static str,
    /// Its value in a body at rest.
    pub at_rest: f64,
}

/// What a law is given beside F: how long the step is, and what the particle remembers at its beginning.
#[derive(Clone, Copy, Debug)]
pub struct Start<'a> {
    /// Δt
    pub dt: f64,
    /// The numbers that [`Law::memory`] names, at t_n.
    pub memory: &'a [f64],
}

impl Start<'_> {
    /// Nothing to remember, and no time: all that an elastic law needs.
    pub const NONE: Self = Self { dt: 0.0, memory: &[] };
}

/// A pointwise law in `D` = 1 (uniaxial strain), 2 (plane strain) or 3 dimensions, as the residual asks it. An elastic law is written as
/// [`Elastic`], and is one; a law with memory says here what it remembers and what becomes of that in a step.
///
/// ```
/// use bfree::material::{Law, Remembered, Start};
/// use bfree::scalar::Real;
/// use bfree::tensor::{Deformation, Tensor, symmetric};
///
/// /// S = 2G e^{−d} E, softer by the largest |E| met so far, d.
/// struct Softening { shear: f64 }
///
/// impl Softening {
///     fn damage<const D: usize>(&self, e: f64, start: &Start<'_>) -> f64 {
///         start.memory[0].max(e)
///     }
/// }
///
/// impl Law for Softening {
///     fn memory(&self) -> &[Remembered] {
///         &[Remembered { name: "damage", at_rest: 0.0 }]
///     }
///     fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>, start: &Start<'_>) -> T {
///         let e = at.green_lagrange();
///         bfree::tensor::contract(&e, &e) * T::lit(self.shear * (-start.memory[0]).exp())
///     }
///     fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>, start: &Start<'_>) -> Tensor<T, D> {
///         at.green_lagrange().map(|e| e * T::lit(2.0 * self.shear * (-start.memory[0]).exp()))
///     }
///     fn elasticity<T: Real, const D: usize>(
///         &self, _: &Deformation<T, D>, start: &Start<'_>, x: &Tensor<T, D>,
///     ) -> Tensor<T, D> {
///         symmetric(x).map(|x| x * T::lit(2.0 * self.shear * (-start.memory[0]).exp()))
///     }
///     fn remember<const D: usize>(&self, at: &Deformation<f64, D>, start: &Start<'_>, next: &mut [f64]) {
///         next[0] = self.damage::<D>(at.green_lagrange().norm(), start);
///     }
/// }
///
/// let (law, mut next) = (Softening { shear: 1.0 }, [0.0]);
/// let at = Deformation::<f64, 1>::new(Tensor::from_element(1.0)); // E = 3/2
/// law.remember(&at, &Start { dt: 1.0, memory: &[0.5] }, &mut next);
/// assert_eq!(next, [1.5]);
/// assert!(law.stress(&at, &Start { dt: 1.0, memory: &next })[(0, 0)] < law.stress(&at, &Start { dt: 1.0, memory: &[0.5] })[(0, 0)]);
/// ```
pub trait Law: Send + Sync {
    /// What a particle remembers; nothing of an elastic law.
    fn memory(&self) -> &[Remembered] {
        &[]
    }

    /// Whether ℂ has major symmetry.
    fn is_symmetric(&self) -> bool {
        true
    }

    /// Whether stresses derive from [`Self::energy`] within a step.
    fn has_potential(&self) -> bool {
        true
    }

    /// Strain energy density `W`, or the incremental potential of the step.
    fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>, start: &Start<'_>) -> T;

    /// Second Piola–Kirchhoff stress `S`, symmetric.
    fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>, start: &Start<'_>) -> Tensor<T, D>;

    /// `ℂ:X = ∂S/∂E : sym X`.
    fn elasticity<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        start: &Start<'_>,
        x: &Tensor<T, D>,
    ) -> Tensor<T, D>;

    /// The B-free tangent density, `ℂmat{v,b} a = [ℂ:(a ⊗ b)] v` (eq. 37).
    fn tangent_density<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        start: &Start<'_>,
        v: &Vector<T, D>,
        b: &Vector<T, D>,
    ) -> Tensor<T, D> {
        density(v, |a| self.elasticity(at, start, &outer(a, b)))
    }

    /// As [`Elastic::closed`].
    fn closed<const D: usize>(
        &self,
        _f_n: &Tensor<f64, D>,
        _at: &Deformation<f64, D>,
        _volume: f64,
    ) -> Option<ClosedTangent<f64, D>> {
        None
    }

    /// What is remembered at the end of a step that ends at `at`.
    fn remember<const D: usize>(&self, _at: &Deformation<f64, D>, _start: &Start<'_>, _next: &mut [f64]) {}

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
    /// use bfree::material::{Lame, Law, Start, StVenantKirchhoff};
    /// use bfree::tensor::{Deformation, Tensor};
    ///
    /// // Uniaxial strain, small: σ_zz = Λ ε = ν (σ_xx + σ_yy)
    /// let law = StVenantKirchhoff { lame: Lame::from_young_poisson(2.5, 0.25)? };
    /// let strain = 1e-9;
    /// let at = Deformation::<f64, 1>::new(Tensor::from_element(strain));
    /// assert!((law.out_of_plane_stress(&at, &Start::NONE) / (law.lame.lambda * strain) - 1.0).abs() < 1e-8);
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    fn out_of_plane_stress<const D: usize>(&self, at: &Deformation<f64, D>, start: &Start<'_>) -> f64 {
        let embedded = Deformation::new(embed(&at.h));
        // σ_zz = P_zz F_zz / J with F_zz = 1
        self.stress(&embedded, start)[(2, 2)] / at.jacobian
    }
}

/// ℂmat{v, b}, column by column from what ℂ makes of a ⊗ b.
fn density<T: Real, const D: usize>(
    v: &Vector<T, D>,
    elasticity: impl Fn(&Vector<T, D>) -> Tensor<T, D>,
) -> Tensor<T, D> {
    let mut density: Tensor<T, D> = Tensor::zeros();
    for k in 0..D {
        let e_k = Vector::from_fn(|i, _| if i == k { T::one() } else { T::zero() });
        density.set_column(k, &(elasticity(&e_k) * v));
    }
    density
}

/// A pointwise hyperelastic law in `D` = 1 (uniaxial strain), 2 (plane strain) or 3 dimensions: a [`Law`] that remembers nothing.
///
/// Every method takes the deformation as H = F − I wrapped in a [`Deformation`] whose Jacobian is positive (the callers in this
/// module make sure of it). Stresses have the unit of the law's moduli; `W` is per unit reference volume.
///
/// ```
/// use bfree::material::{Elastic, Lame, NeoHookean};
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
pub trait Elastic: Send + Sync {
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
        density(v, |a| self.elasticity(at, &outer(a, b)))
    }

    /// The whole tangent (geometric + material) of a particle of reference volume `volume` at the state `at`, for gradients taken in the
    /// configuration `n` whose deformation gradient is `f_n`, if it has this form; the same answer at every state.
    ///
    /// ```
    /// use bfree::material::{Elastic, Lame, NeoHookean, first_piola};
    /// use bfree::tensor::{Deformation, Tensor, identity};
    /// use num_dual::Dual64;
    ///
    /// // V₀ δP, geometric and material together, is the derivative of V₀ P = V₀ F S. Here F_n = I, so that δF = L.
    /// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
    /// let (h, l) = (Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1), Tensor::<f64, 2>::new(0.5, -1.0, 0.25, 2.0));
    /// let closed = law.closed(&identity(), &Deformation::new(h), 3.0).ok_or("closed")?;
    /// let dual = h.zip_map(&l, Dual64::new);
    /// let delta = first_piola(&law, &Deformation::new(dual).f, dual)?.map(|x| 3.0 * x.eps);
    /// assert!((closed.apply(&l) - delta).norm() < 1e-14 * delta.norm());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    fn closed<const D: usize>(
        &self,
        _f_n: &Tensor<f64, D>,
        _at: &Deformation<f64, D>,
        _volume: f64,
    ) -> Option<ClosedTangent<f64, D>> {
        None
    }
}

/// An elastic law as the residual asks it.
impl<E: Elastic> Law for E {
    #[inline(always)]
    fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>, _: &Start<'_>) -> T {
        Elastic::energy(self, at)
    }
    #[inline(always)]
    fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>, _: &Start<'_>) -> Tensor<T, D> {
        Elastic::stress(self, at)
    }
    #[inline(always)]
    fn elasticity<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        _: &Start<'_>,
        x: &Tensor<T, D>,
    ) -> Tensor<T, D> {
        Elastic::elasticity(self, at, x)
    }
    #[inline(always)]
    fn tangent_density<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        _: &Start<'_>,
        v: &Vector<T, D>,
        b: &Vector<T, D>,
    ) -> Tensor<T, D> {
        Elastic::tangent_density(self, at, v, b)
    }
    #[inline(always)]
    fn closed<const D: usize>(
        &self,
        f_n: &Tensor<f64, D>,
        at: &Deformation<f64, D>,
        volume: f64,
    ) -> Option<ClosedTangent<f64, D>> {
        Elastic::closed(self, f_n, at, volume)
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
    let memory: Vec<f64> = law.memory().iter().map(|one| one.at_rest).collect();
    let start = Start { dt: 0.0, memory: &memory };
    let along =
        |k| law.elasticity(&rest, &start, &Tensor::from_fn(|i, j| if i == k && j == k { 1.0 } else { 0.0 }))[(k, k)];
    along(0).max(along(1)).max(along(2))
}

/// Something to be done with a law of whatever type.
pub(crate) trait LawVisitor {
    /// What comes out.
    type Output;
    /// Does it.
    fn visit<L: Law + 'static>(self, law: L) -> Self::Output;
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

        impl Law for Material {
            fn memory(&self) -> &[Remembered] {
                match self { $(Self::$law(law) => law.memory()),* }
            }
            fn is_symmetric(&self) -> bool {
                match self { $(Self::$law(law) => law.is_symmetric()),* }
            }
            fn has_potential(&self) -> bool {
                match self { $(Self::$law(law) => law.has_potential()),* }
            }
            fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>, start: &Start<'_>) -> T {
                match self { $(Self::$law(law) => Law::energy(law, at, start)),* }
            }
            fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>, start: &Start<'_>) -> Tensor<T, D> {
                match self { $(Self::$law(law) => Law::stress(law, at, start)),* }
            }
            fn elasticity<T: Real, const D: usize>(
                &self, at: &Deformation<T, D>, start: &Start<'_>, x: &Tensor<T, D>,
            ) -> Tensor<T, D> {
                match self { $(Self::$law(law) => Law::elasticity(law, at, start, x)),* }
            }
            fn tangent_density<T: Real, const D: usize>(
                &self, at: &Deformation<T, D>, start: &Start<'_>, v: &Vector<T, D>, b: &Vector<T, D>,
            ) -> Tensor<T, D> {
                match self { $(Self::$law(law) => Law::tangent_density(law, at, start, v, b)),* }
            }
            fn closed<const D: usize>(
                &self, f_n: &Tensor<f64, D>, at: &Deformation<f64, D>, volume: f64,
            ) -> Option<ClosedTangent<f64, D>> {
                match self { $(Self::$law(law) => Law::closed(law, f_n, at, volume)),* }
            }
            fn remember<const D: usize>(&self, at: &Deformation<f64, D>, start: &Start<'_>, next: &mut [f64]) {
                match self { $(Self::$law(law) => law.remember(at, start, next)),* }
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
