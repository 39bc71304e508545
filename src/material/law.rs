//! The traits of a material law, [`Law`] and [`Elastic`], as the residual calls them.

use super::{ClosedTangent, Material, VolumeResponse, embed};
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector, outer, symmetric};
use nalgebra::SMatrix;
use num_dual::Dual;

/// An internal variable of a law: one number that a particle keeps from step to step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remembered {
    /// The name in outputs, checkpoints and `bfree check`.
    pub name: &'static str,
    /// The value in a body at rest.
    pub at_rest: f64,
}

/// The name of the accumulated plastic strain, a field of the output. A particle is counted as yielding if this variable grows in the step.
pub const PLASTIC_STRAIN: &str = "plastic_strain";

/// The name of the dissipated energy per reference volume, a term of the energy balance.
pub const DISSIPATED: &str = "dissipated";

/// The arguments of a law beside F: the length of the step, and the internal variables at its beginning, t_n.
#[derive(Clone, Copy, Debug)]
pub struct Start<'a> {
    /// Δt. It is 0 where a load step on a new grid evaluates the state at t_n, for the out-of-balance force R₀.
    pub dt: f64,
    /// The internal variables that [`Law::memory`] names, at t_n.
    pub memory: &'a [f64],
}

impl Start<'_> {
    /// No internal variables and Δt = 0, for elastic laws.
    pub const NONE: Self = Self { dt: 0.0, memory: &[] };

    /// The internal variable `name` of `law`, if the law has it.
    pub fn recall<L: Law>(&self, law: &L, name: &str) -> Option<f64> {
        self.memory.get(law.memory().iter().position(|one| one.name == name)?).copied()
    }
}

/// A pointwise law in `D` = 1 (uniaxial strain), 2 (plane strain) or 3 dimensions, as the residual calls it. An elastic law implements
/// [`Elastic`], which provides this trait. A law with internal variables implements this trait: it names the variables and updates them in
/// a step.
///
/// ```
/// use bfree::material::{Law, Remembered, Start};
/// use bfree::scalar::Real;
/// use bfree::tensor::{Deformation, Tensor, symmetric};
///
/// /// S = 2G e^{−d} E, softened by the damage d, the largest |E| so far.
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
    /// The internal variables of the law; none if the law is elastic. Two names have a meaning for output: [`PLASTIC_STRAIN`] and
    /// [`DISSIPATED`].
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

    /// `ℂ:X = ∂S/∂E : sym X`. By default dual numbers differentiate [`Self::stress`], so that a law needs no derivatives of its own.
    fn elasticity<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        start: &Start<'_>,
        x: &Tensor<T, D>,
    ) -> Tensor<T, D> {
        derivative(at, x, |at| self.stress(at, start))
    }

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

    /// See [`Elastic::volumetric`].
    fn volumetric<T: Real>(&self, _at: &Deformation<T, 1>) -> Option<VolumeResponse<T>> {
        None
    }

    /// See [`Elastic::closed`].
    fn closed<const D: usize>(
        &self,
        _f_n: &Tensor<f64, D>,
        _at: &Deformation<f64, D>,
        _volume: f64,
    ) -> Option<ClosedTangent<f64, D>> {
        None
    }

    /// The material tangent of a law without a closed form, for gradients taken in the configuration n: F ℂmat{F_nᵀe_k, F_nᵀe_l} Fᵀ in row
    /// k and column l. The default calls [`Self::tangent_density`] for every pair. A law that solves equations at each state overrides it,
    /// to solve them once for all pairs.
    fn tangent_blocks<const D: usize>(
        &self,
        f_n: &Tensor<f64, D>,
        at: &Deformation<f64, D>,
        start: &Start<'_>,
    ) -> [[Tensor<f64, D>; D]; D] {
        let unit = |k: usize| f_n.row(k).transpose();
        let block = |k, l| at.f * self.tangent_density(at, start, &unit(k), &unit(l)) * at.f.transpose();
        std::array::from_fn(|k| std::array::from_fn(|l| block(k, l)))
    }

    /// Writes the internal variables at the end of the step into `next`, which holds the variables at t_n before. `at` is the deformation
    /// at the end.
    fn remember<const D: usize>(&self, _at: &Deformation<f64, D>, _start: &Start<'_>, _next: &mut [f64]) {}

    /// This law as a [`Material`], whose loops over particles are compiled once, in the library. `None` for any other type.
    ///
    /// ```
    /// use bfree::material::{Lame, Law, Material, NeoHookean};
    ///
    /// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
    /// let material = Material::from(law);
    /// // A `Material` returns itself.
    /// assert_eq!(material.shipped(), Some(&material));
    /// assert_eq!(law.shipped(), None);
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    fn shipped(&self) -> Option<&Material> {
        None
    }

    /// The out-of-plane Cauchy stress under plane or uniaxial strain, for output. The deformation is embedded in 3D, which is valid for
    /// isotropic laws.
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

/// ∂S/∂E : sym X by dual numbers through `stress`: δF = F⁻ᵀ sym X has δE = sym X.
pub(super) fn derivative<T: Real, const D: usize>(
    at: &Deformation<T, D>,
    x: &Tensor<T, D>,
    stress: impl Fn(&Deformation<Dual<T>, D>) -> Tensor<Dual<T>, D>,
) -> Tensor<T, D> {
    let delta_f = at.inverse_transpose() * symmetric(x);
    stress(&Deformation::new(at.h.zip_map(&delta_f, Dual::new))).map(|s| s.eps)
}

/// ℂmat{v, b}, column by column: column k is `[ℂ:(e_k ⊗ b)] v`.
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

/// A pointwise hyperelastic law in `D` = 1 (uniaxial strain), 2 (plane strain) or 3 dimensions: a [`Law`] without internal variables.
///
/// Every method takes the deformation as H = F − I wrapped in a [`Deformation`]. Its Jacobian is positive; the callers in this module make
/// sure of it. Stresses have the unit of the law's moduli; `W` is per unit reference volume.
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
/// // The change of strain by δF: δE = sym(Fᵀ δF)
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

    /// `ℂ:X = ∂S/∂E : sym X`. By default dual numbers differentiate [`Self::stress`], so that a law needs no derivatives of its own.
    fn elasticity<T: Real, const D: usize>(&self, at: &Deformation<T, D>, x: &Tensor<T, D>) -> Tensor<T, D> {
        derivative(at, x, |at| self.stress(at))
    }

    /// The B-free tangent density, `ℂmat{v,b} a = [ℂ:(a ⊗ b)] v` (eq. 37).
    fn tangent_density<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        v: &Vector<T, D>,
        b: &Vector<T, D>,
    ) -> Tensor<T, D> {
        density(v, |a| self.elasticity(at, &outer(a, b)))
    }

    /// The part U(θ) of the energy that depends on the volume ratio θ = 1 + `at.h` alone, if it carries the resistance to changes of
    /// volume. A mean dilatation evaluates U at the mean θ of a cell. A law returns `Some` at every θ, or `None` at every θ.
    ///
    /// ```
    /// use bfree::material::{Elastic, Lame, NeoHookean};
    /// use bfree::tensor::{Deformation, Tensor};
    /// use num_dual::Dual64;
    ///
    /// // θ U' and θ (θ U')' are derivatives with respect to ln θ.
    /// let law = NeoHookean::ciarlet(Lame::new(3.0, 1.0)?);
    /// let at = Deformation::<Dual64, 1>::new(Tensor::from_element(Dual64::new(0.25, 1.25)));
    /// let of = law.volumetric(&at).ok_or("it has one")?;
    /// assert!((of.energy.eps - of.stress.re).abs() < 1e-15 && (of.stress.eps - of.stiffness.re).abs() < 1e-15);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    fn volumetric<T: Real>(&self, _at: &Deformation<T, 1>) -> Option<VolumeResponse<T>> {
        None
    }

    /// The closed form of the whole tangent (geometric + material) of a particle, if the law has one. `volume` is the reference volume and
    /// `at` the state. Gradients are taken in the configuration n with the deformation gradient `f_n`. A law returns `Some` at every state,
    /// or `None` at every state.
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

/// An elastic law has no internal variables and ignores Δt.
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
    fn volumetric<T: Real>(&self, at: &Deformation<T, 1>) -> Option<VolumeResponse<T>> {
        Elastic::volumetric(self, at)
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

/// The largest Poisson's ratio of the body at rest, ℂ₁₁₂₂/(ℂ₁₁₁₁ + ℂ₁₁₂₂) over the axes. For isotropic laws it is ν.
///
/// ```
/// use bfree::material::{Lame, NeoHookean, poissons_ratio};
///
/// let law = NeoHookean::logarithmic(Lame::from_young_poisson(100.0, 0.45)?);
/// assert!((poissons_ratio(&law) - 0.45).abs() < 1e-12);
/// # Ok::<(), bfree::material::LameError>(())
/// ```
pub fn poissons_ratio<L: Law>(law: &L) -> f64 {
    let of = |k: usize| {
        let stress = stress_along(law, k);
        let across = (0..3).filter(|&i| i != k).map(|i| stress[(i, i)]).fold(f64::NEG_INFINITY, f64::max);
        across / (across + stress[(k, k)])
    };
    of(0).max(of(1)).max(of(2))
}

/// The least and the largest eigenvalue of ℂ of the body at rest, for strains of size 1. If the least one is negative, the body is
/// unstable.
///
/// ```
/// use bfree::material::{Energy, FromEnergy, Lame, NeoHookean, stiffness_at_rest};
/// use bfree::scalar::Real;
/// use bfree::tensor::{Tensor, contract};
///
/// // 2G in shear, 3Λ + 2G under pressure.
/// let [least, largest] = stiffness_at_rest(&NeoHookean::logarithmic(Lame::new(1.0, 2.0)?));
/// assert!((least - 4.0).abs() < 1e-12 && (largest - 7.0).abs() < 1e-12);
///
/// /// W = −E:E
/// struct Wrong;
///
/// impl Energy for Wrong {
///     fn energy<T: Real>(&self, e: &Tensor<T, 3>) -> T {
///         -contract(e, e)
///     }
/// }
///
/// assert!(stiffness_at_rest(&FromEnergy(Wrong)).iter().all(|stiffness| (stiffness + 2.0).abs() < 1e-12));
/// # Ok::<(), bfree::material::LameError>(())
/// ```
pub fn stiffness_at_rest<L: Law>(law: &L) -> [f64; 2] {
    // An orthonormal basis of the symmetric strains.
    let basis = |k: usize| {
        let (i, j) = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)][k];
        let mut strain = Tensor::<f64, 3>::zeros();
        (strain[(i, j)], strain[(j, i)]) = if i == j { (1.0, 1.0) } else { (0.5_f64.sqrt(), 0.5_f64.sqrt()) };
        strain
    };
    let mut stiffness = SMatrix::<f64, 6, 6>::zeros();
    for column in 0..6 {
        let stress = stress_of(law, &basis(column));
        (0..6).for_each(|row| stiffness[(row, column)] = stress.dot(&basis(row)));
    }
    let values = ((stiffness + stiffness.transpose()) * 0.5).symmetric_eigenvalues();
    [values.min(), values.max()]
}

/// ℂ : X of the body at rest.
fn stress_of<L: Law>(law: &L, strain: &Tensor<f64, 3>) -> Tensor<f64, 3> {
    let rest = Deformation::<f64, 3>::new(Tensor::zeros());
    let memory: Vec<f64> = law.memory().iter().map(|one| one.at_rest).collect();
    law.elasticity(&rest, &Start { dt: 0.0, memory: &memory }, strain)
}

/// ℂ : e_k ⊗ e_k of the body at rest.
fn stress_along<L: Law>(law: &L, k: usize) -> Tensor<f64, 3> {
    stress_of(law, &Tensor::from_fn(|i, j| if i == k && j == k { 1.0 } else { 0.0 }))
}

/// The largest modulus of pressure waves along an axis of the body at rest, ℂ₁₁₁₁. For isotropic laws it is Λ + 2G.
///
/// ```
/// use bfree::material::{Lame, NeoHookean, p_wave_modulus};
///
/// let lame = Lame::from_young_poisson(100.0, 0.3)?;
/// assert_eq!(p_wave_modulus(&NeoHookean::logarithmic(lame)), lame.p_wave_modulus());
/// # Ok::<(), bfree::material::LameError>(())
/// ```
pub fn p_wave_modulus<L: Law>(law: &L) -> f64 {
    let along = |k| stress_along(law, k)[(k, k)];
    along(0).max(along(1)).max(along(2))
}
