//! The trait of a material law, [`Law`], and P = F S.

use super::{ClosedTangent, MaterialState, VolumeResponse};
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector, outer, symmetric};
use num_dual::Dual;
use std::any::Any;

/// An internal variable of a law: one number that a particle keeps from step to step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InternalVariable {
    /// The name in outputs, checkpoints and `bfree check`.
    pub name: &'static str,
    /// The value in a body at rest.
    pub at_rest: f64,
}

impl InternalVariable {
    /// An internal variable that is 0 at rest.
    pub const fn zero(name: &'static str) -> Self {
        Self { name, at_rest: 0.0 }
    }
}

/// The name of the accumulated plastic strain, a field of the output. A particle is counted as yielding if this variable grows in the step.
pub const PLASTIC_STRAIN: &str = "plastic_strain";

/// The name of the dissipated energy per reference volume, a term of the energy balance.
pub const DISSIPATED: &str = "dissipated";

/// A D×D block for each pair of unit gradients: row k and column l belong to e_k and e_l.
pub type TangentBlocks<const D: usize> = [[Tensor<f64, D>; D]; D];

/// A pointwise law in `D` = 1 (uniaxial strain), 2 (plane strain) or 3 dimensions.
///
/// An elastic law needs two methods, [`energy`](Self::energy) and [`stress`](Self::stress). A law with internal variables also names them
/// ([`internal_variables`](Self::internal_variables)) and updates them ([`update_variables`](Self::update_variables)). All other methods
/// have defaults: [`elasticity`](Self::elasticity) is the derivative of the stress by dual numbers, and the tangents follow from it. A law
/// overrides a default where it has a closed form.
///
/// The contract:
/// - The caller makes sure that det F > 0.
/// - Methods evaluate the law at the [`MaterialState`] and change nothing. Results depend on the arguments alone.
/// - Stresses have the unit of the law's moduli. `W` is per unit reference volume.
/// - Energy and stress are generic over the number `T`: the program calls them with plain numbers, the checks with dual numbers.
///
/// The function `check_material` of the crate `verification` compares all methods of a law with each other.
///
/// ```
/// use bfree::material::{InternalVariable, Law, MaterialState};
/// use bfree::scalar::Real;
/// use bfree::tensor::{Tensor, contract};
///
/// /// S = 2G e^{−d} E, softened by the damage d, the largest |E| up to t_n.
/// struct Softening { shear: f64 }
///
/// impl Softening {
///     fn softened(&self, d: f64) -> f64 {
///         self.shear * (-d).exp()
///     }
/// }
///
/// impl Law for Softening {
///     fn internal_variables(&self) -> &[InternalVariable] {
///         &[InternalVariable { name: "damage", at_rest: 0.0 }]
///     }
///     fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
///         let e = at.green_lagrange();
///         contract(&e, &e) * T::lit(self.softened(at.internal[0]))
///     }
///     fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
///         at.green_lagrange() * T::lit(2.0 * self.softened(at.internal[0]))
///     }
///     fn update_variables<const D: usize>(&self, at: &MaterialState<f64, D>, variables: &mut [f64]) {
///         variables[0] = at.green_lagrange().norm().max(at.internal[0]);
///     }
/// }
///
/// let law = Softening { shear: 1.0 };
/// let stretched = MaterialState::new(Tensor::<f64, 1>::from_element(1.0)); // E = 3/2
/// let before = stretched.in_step(1.0, &[0.5]);
/// let mut next = [0.5];
/// law.update_variables(&before, &mut next);
/// assert_eq!(next, [1.5]);
/// assert!(law.stress(&stretched.in_step(1.0, &next))[(0, 0)] < law.stress(&before)[(0, 0)]);
/// ```
///
/// A state may come without internal variables (`at.internal` is empty): they then have their values at rest.
pub trait Law: Send + Sync {
    /// Whether scenes use this type. Their steps are compiled once, in this crate.
    #[doc(hidden)]
    const IN_SCENES: bool = false;

    /// Strain energy density `W`, or the incremental potential of the step.
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T;

    /// Second Piola–Kirchhoff stress `S = ∂W/∂E`, symmetric.
    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D>;

    /// `ℂ:X = ∂S/∂E : sym X`
    ///
    /// ```
    /// use bfree::material::{Lame, Law, MaterialState, NeoHookean};
    /// use bfree::tensor::{Tensor, contract, symmetric};
    /// use num_dual::Dual64;
    ///
    /// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
    /// let at = MaterialState::new(Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1));
    /// let delta = Tensor::<f64, 2>::new(0.5, -1.0, 0.25, 2.0);
    /// // The change of strain by δF: δE = sym(Fᵀ δF)
    /// let strain = symmetric(&(at.f.transpose() * delta));
    /// // S = ∂W/∂E and ℂ:δE = δS, by dual numbers through the law itself.
    /// let dual = MaterialState::new(at.h.zip_map(&delta, Dual64::new));
    /// assert!((law.energy(&dual).eps - contract(&law.stress(&at), &strain)).abs() < 1e-15);
    /// assert!((law.stress(&dual).map(|s| s.eps) - law.elasticity(&at, &strain)).norm() < 1e-14);
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        // δF = F⁻ᵀ sym X has δE = sym X.
        let delta_f = at.inverse_transpose() * symmetric(x);
        self.stress(&at.deformed(at.h.zip_map(&delta_f, Dual::new))).map(|s| s.eps)
    }

    /// The B-free tangent density, `ℂmat{v,b} a = [ℂ:(a ⊗ b)] v` (eq. 37).
    ///
    /// ```
    /// use bfree::material::{Lame, Law, MaterialState, NeoHookean};
    /// use bfree::tensor::{Tensor, Vector, outer};
    ///
    /// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
    /// let at = MaterialState::new(Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1));
    /// let (a, b, v) = (Vector::from([1.0, 2.0]), Vector::from([0.5, -1.0]), Vector::from([3.0, 1.0]));
    /// let (left, right) = (law.tangent_density(&at, &v, &b) * a, law.elasticity(&at, &outer(&a, &b)) * v);
    /// assert!((left - right).norm() < 1e-14);
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    fn tangent_density<const D: usize>(
        &self,
        at: &MaterialState<f64, D>,
        v: &Vector<f64, D>,
        b: &Vector<f64, D>,
    ) -> Tensor<f64, D> {
        // Column k is [ℂ:(e_k ⊗ b)] v.
        let e = |k: usize| Vector::from_fn(|i, _| f64::from(i == k));
        let column = |k| self.elasticity(at, &outer(&e(k), b)) * v;
        Tensor::from_columns(&std::array::from_fn::<_, D, _>(column))
    }

    /// The material tangent of a law without a closed form, for gradients taken in the configuration of the last grid reset: F ℂmat{F_rᵀe_k, F_rᵀe_l} Fᵀ in row
    /// k and column l. A law that solves equations at each state overrides the default, to solve them once for all pairs.
    fn tangent_blocks<const D: usize>(&self, f_r: &Tensor<f64, D>, at: &MaterialState<f64, D>) -> TangentBlocks<D> {
        let unit = |k: usize| f_r.row(k).transpose();
        let block = |k, l| at.f * self.tangent_density(at, &unit(k), &unit(l)) * at.f.transpose();
        mutant!("laws: v and b are swapped in ℂmat": { return std::array::from_fn(|k| std::array::from_fn(|l| block(l, k))); });
        std::array::from_fn(|k| std::array::from_fn(|l| block(k, l)))
    }

    /// The closed form of the whole tangent (geometric + material) of a particle, if the law has one. `volume` is the reference volume.
    /// Gradients are taken in the configuration of the last grid reset, whose deformation gradient is `f_r`. A law returns `Some` at every state, or `None` at
    /// every state.
    ///
    /// ```
    /// use bfree::material::{Lame, Law, MaterialState, NeoHookean, first_piola};
    /// use bfree::tensor::{Tensor, identity};
    /// use num_dual::Dual64;
    ///
    /// // V₀ δP, geometric and material together, is the derivative of V₀ P = V₀ F S. Here F_r = I, so that δF = L.
    /// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
    /// let (h, l) = (Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1), Tensor::<f64, 2>::new(0.5, -1.0, 0.25, 2.0));
    /// let closed = law.closed(&identity(), &MaterialState::new(h), 3.0).ok_or("closed")?;
    /// let dual = MaterialState::new(h.zip_map(&l, Dual64::new));
    /// let delta = first_piola(&law, &dual.f, &dual).map(|x| 3.0 * x.eps);
    /// assert!((closed.apply(&l) - delta).norm() < 1e-14 * delta.norm());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    fn closed<T: Real, const D: usize>(
        &self,
        _f_r: &Tensor<T, D>,
        _at: &MaterialState<T, D>,
        _volume: T,
    ) -> Option<ClosedTangent<T, D>> {
        None
    }

    /// The part U(θ) of the energy that depends on the volume ratio θ = 1 + `at.h` alone, if it carries the resistance to changes of
    /// volume. A mean dilatation evaluates U at the mean θ of a cell. A law returns `Some` at every θ, or `None` at every θ.
    ///
    /// ```
    /// use bfree::material::{Lame, Law, NeoHookean};
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

    /// The internal variables of the law; none if the law is elastic. Two names have a meaning for output: [`PLASTIC_STRAIN`] and
    /// [`DISSIPATED`].
    fn internal_variables(&self) -> &[InternalVariable] {
        &[]
    }

    /// Overwrites the internal variables at t_n by those at the end of the step, in the order of [`Self::internal_variables`]. The default
    /// keeps them.
    fn update_variables<const D: usize>(&self, _at: &MaterialState<f64, D>, _variables: &mut [f64]) {}

    /// Whether ℂ has major symmetry.
    fn is_symmetric(&self) -> bool {
        true
    }

    /// Whether stresses derive from [`Self::energy`] within a step.
    fn has_potential(&self) -> bool {
        true
    }

    /// Compares the tangent that a law from outside claims with differences of its stress, at one state. Dual numbers check all other laws:
    /// through a law from outside they only carry the claim.
    ///
    /// # Errors
    /// A sentence about the component that is wrong.
    fn check_claim<const D: usize>(&self, _at: &MaterialState<f64, D>) -> Result<(), String> {
        Ok(())
    }

    /// A sentence about the last state at which the law gave no answer, once. Its stress is NaN there.
    fn last_failure(&self) -> Option<String> {
        None
    }

    /// This law as a [`Material`](super::Material), whose loops over particles are compiled once, in the library. `None` for any other type.
    ///
    /// ```
    /// use bfree::material::{Lame, Law, Material, NeoHookean};
    ///
    /// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
    /// let material = Material::from(law);
    /// // A `Material` returns itself.
    /// assert!(material.shipped().is_some_and(|law| law.is::<Material>()));
    /// assert!(law.shipped().is_none());
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    fn shipped(&self) -> Option<&dyn Any> {
        None
    }
}

/// The internal variable `name` of `law` at t_n, if the law has it.
///
/// ```
/// use bfree::material::{Hardening, Lame, MaterialState, PLASTIC_STRAIN, Plastic, VonMises, internal_variable};
/// use bfree::tensor::Tensor;
///
/// let criterion = VonMises { yield_stress: Hardening::perfect(0.1) };
/// let law = Plastic { solid: Lame::new(1.0, 1.0)?, criterion };
/// let at = MaterialState::new(Tensor::<f64, 1>::zeros()).in_step(1.0, &[0.25]);
/// assert_eq!(internal_variable(&law, &at, PLASTIC_STRAIN), Some(0.25));
/// assert_eq!(internal_variable(&law, &at, "temperature"), None);
/// # Ok::<(), bfree::material::LameError>(())
/// ```
pub fn internal_variable<L: Law, T: Real, const D: usize>(
    law: &L,
    at: &MaterialState<T, D>,
    name: &str,
) -> Option<f64> {
    let place = law.internal_variables().iter().position(|one| one.name == name)?;
    at.internal.get(place).copied()
}

/// The names of the internal variables of laws, each once.
pub(crate) fn internal_variable_names<'a, L: Law + 'a>(laws: impl Iterator<Item = &'a L>) -> Vec<&'static str> {
    let mut names = Vec::new();
    for variable in laws.flat_map(|law| law.internal_variables()) {
        if !names.contains(&variable.name) {
            names.push(variable.name);
        }
    }
    names
}

/// `P = F S` (eq. 7). No other function forms P. The F on the left and the F inside S are given separately, for derivatives.
///
/// ```
/// use bfree::material::{Lame, Law, MaterialState, NeoHookean, first_piola};
/// use bfree::tensor::{Tensor, contract};
/// use num_dual::Dual64;
///
/// // P = ∂W/∂F: P : δF is the derivative of W.
/// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
/// let (h, delta) = (Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1), Tensor::<f64, 2>::new(0.5, -1.0, 0.25, 2.0));
/// let at = MaterialState::new(h);
/// let piola = first_piola(&law, &at.f, &at);
/// let energy = law.energy(&MaterialState::new(h.zip_map(&delta, Dual64::new)));
/// assert!((contract(&piola, &delta) - energy.eps).abs() < 1e-14 * piola.norm() * delta.norm());
/// # Ok::<(), bfree::material::LameError>(())
/// ```
#[inline(always)]
pub fn first_piola<L: Law, T: Real, const D: usize>(
    law: &L,
    f_left: &Tensor<T, D>,
    at: &MaterialState<T, D>,
) -> Tensor<T, D> {
    mutant!("laws: P = S F for F S": { return law.stress(at) * f_left; });
    f_left * law.stress(at)
}
