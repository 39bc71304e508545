//! Finite viscoelasticity: Maxwell branches parallel to an elastic law.

use super::hencky::{Principal, Radial, Strained};
use super::listed::elastic_base;
use super::{DISSIPATED, InternalVariable, Lame, Law, Listed, MaterialState, TangentBlocks, VolumeResponse};
use crate::problems::Problems;
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A Maxwell branch: a spring and a dashpot in series, for deviatoric strain alone.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "MaxwellBranch")]
#[serde(deny_unknown_fields)]
pub struct Branch {
    /// The shear modulus of the spring (stress), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub shear: f64,
    /// The relaxation time: viscosity over shear modulus, > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub relaxation_time: f64,
}

/// The constants of [`Viscoelastic`].
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "Viscoelastic")]
#[serde(deny_unknown_fields)]
pub struct ViscoelasticParameters<P> {
    /// The law that remains when all branches have relaxed. It must be an elastic law.
    pub base: Box<P>,
    /// The Maxwell branches parallel to the base, 1 to 8.
    #[schemars(length(min = 1, max = 8))]
    pub branches: Vec<Branch>,
}

/// An elastic law with parallel Maxwell branches. Each branch has its own C_v: b_e = F C_v⁻¹ Fᵀ and τ = 2G dev ε with ε = ½ ln b_e. It
/// flows by ε̇_v = dev ε/τ_r (Reese and Govindjee, Int. J. Solids Struct. 35, 1998, with Hencky's springs and no volumetric viscosity).
///
/// A step takes the trial strain with C_v⁻¹ held fixed, and relaxes it over Δt by the exponential map: dev ε = e^{−Δt/τ_r} dev ε_trial. The
/// map is exact where F is constant, and of first order in Δt where F changes. The potential of a step is W + Σ G e^{−Δt/τ_r} dev ε_trial :
/// dev ε_trial.
///
/// ```
/// use bfree::material::{Branch, Lame, Law, MaterialState, NeoHookean, Viscoelastic};
/// use bfree::tensor::Tensor;
///
/// // A small shear is held: G∞ + G₁ e^{−t/τ} remains, whatever the number of steps.
/// let base = NeoHookean::ciarlet(Lame::new(10.0, 1.0)?);
/// let law = Viscoelastic::new(base, vec![Branch { shear: 3.0, relaxation_time: 2.0 }]).ok_or("an elastic base")?;
/// let sheared = MaterialState::new(Tensor::<f64, 2>::new(0.0, 1e-6, 0.0, 0.0));
/// let mut internal = vec![0.0; law.internal_variables().len()];
/// for dt in [0.5, 1.5] {
///     law.update_variables(&sheared.in_step(dt, &internal.clone()), &mut internal);
/// }
/// let modulus = law.stress(&sheared.in_step(0.0, &internal))[(0, 1)] / 1e-6;
/// assert!((modulus - (1.0 + 3.0 * (-1.0_f64).exp())).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Viscoelastic<B> {
    base: Box<B>,
    branches: Vec<Branch>,
}

/// The most branches.
const MOST: usize = 8;

/// The number of components of C_v⁻¹ − I.
const SIX: usize = 6;

macro_rules! names {
    ($($branch:literal)*) => {
        [InternalVariable::zero(DISSIPATED), $(
            InternalVariable::zero(concat!("inverse_viscous_", $branch, "_xx")),
            InternalVariable::zero(concat!("inverse_viscous_", $branch, "_yy")),
            InternalVariable::zero(concat!("inverse_viscous_", $branch, "_zz")),
            InternalVariable::zero(concat!("inverse_viscous_", $branch, "_xy")),
            InternalVariable::zero(concat!("inverse_viscous_", $branch, "_yz")),
            InternalVariable::zero(concat!("inverse_viscous_", $branch, "_xz"))
        ),*]
    };
}

/// The dissipated energy, and C_v⁻¹ − I of every branch.
const INTERNAL: [InternalVariable; 1 + SIX * MOST] = names!(1 2 3 4 5 6 7 8);

impl<B: Law> Viscoelastic<B> {
    /// Branches parallel to a law. `None` if the law has internal variables, or if there are more than eight branches.
    pub fn new(base: B, branches: Vec<Branch>) -> Option<Self> {
        (base.internal_variables().is_empty() && branches.len() <= MOST)
            .then(|| Self { base: Box::new(base), branches })
    }

    /// Every branch with its C_v⁻¹ − I at t_n and e^{−Δt/τ_r}. Without internal variables the slice is empty, which means rest.
    fn branches<'a, T: Real, const D: usize>(
        &'a self,
        at: &MaterialState<'a, T, D>,
    ) -> impl Iterator<Item = (&'a Branch, &'a [f64], f64)> {
        let (dt, internal) = (at.dt, at.internal);
        self.branches.iter().enumerate().map(move |(i, branch)| {
            let decay = (-dt / branch.relaxation_time).exp();
            mutant!("laws: Euler's step for the relaxation": decay = 1.0 / (1.0 + dt / branch.relaxation_time));
            (branch, internal.get(1 + SIX * i..).and_then(|rest| rest.get(..SIX)).unwrap_or(&[]), decay)
        })
    }
}

/// τ = 2G e^{−Δt/τ_r} dev ε
fn relaxed<T: Real>(branch: &Branch, decay: f64) -> Radial<T> {
    let (zero, g) = (T::zero(), T::lit(2.0 * branch.shear * decay));
    Radial { p: zero, g, p_v: zero, p_d: zero, t_v: zero, t_d: g }
}

impl<B: Law> Law for Viscoelastic<B> {
    fn internal_variables(&self) -> &[InternalVariable] {
        INTERNAL.get(..1 + SIX * self.branches.len()).unwrap_or(&INTERNAL)
    }

    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        let springs = self.branches(at).map(|(branch, inverse_inelastic, decay)| {
            Strained::new(at, inverse_inelastic).square() * T::lit(branch.shear * decay)
        });
        springs.fold(self.base.energy(at), |sum, energy| sum + energy)
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let mut stress = self.base.stress(at);
        for (branch, inverse_inelastic, decay) in self.branches(at) {
            let radial = relaxed(branch, decay);
            stress += Strained::new(at, inverse_inelastic).stress(radial.p, radial.g);
        }
        stress
    }

    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let mut stress = self.base.elasticity(at, x);
        for (branch, inverse_inelastic, decay) in self.branches(at) {
            stress += Principal::new(at, inverse_inelastic).radial_moduli(&relaxed(branch, decay)).elasticity(x);
        }
        stress
    }

    /// The response of the base, because branches have neither springs nor viscosity in volume.
    fn volumetric<T: Real>(&self, at: &Deformation<T, 1>) -> Option<VolumeResponse<T>> {
        self.base.volumetric(at)
    }

    fn tangent_blocks<const D: usize>(&self, f_r: &Tensor<f64, D>, at: &MaterialState<f64, D>) -> TangentBlocks<D> {
        let mut blocks = self.base.tangent_blocks(f_r, at);
        for (branch, inverse_inelastic, decay) in self.branches(at) {
            Principal::new(at, inverse_inelastic).radial_moduli(&relaxed(branch, decay)).add_blocks(f_r, &mut blocks);
        }
        blocks
    }

    /// The branches dissipate G (1 − e^{−2Δt/τ_r}) dev ε_trial : dev ε_trial.
    fn update_variables<const D: usize>(&self, at: &MaterialState<f64, D>, variables: &mut [f64]) {
        let [dissipated, viscous @ ..] = variables else { return };
        for ((branch, inverse_inelastic, decay), viscous) in self.branches(at).zip(viscous.chunks_mut(SIX)) {
            let principal = Principal::new(at, inverse_inelastic);
            *dissipated += branch.shear * (1.0 - decay * decay) * principal.norm().powi(2);
            principal.flow(principal.deviator().map(|x| x * (1.0 - decay)), inverse_inelastic, viscous);
        }
    }
}

impl<B: Listed> Listed for Viscoelastic<B> {
    type Parameters = ViscoelasticParameters<B::Parameters>;

    fn build(given: &Self::Parameters, problems: &mut Problems, path: &str) -> Option<Self> {
        let branches = format!("{path}.branches");
        let law = elastic_base::<B>(&given.base, problems, path);
        let mut good = problems.one_to(MOST, &branches, &given.branches);
        for (i, branch) in given.branches.iter().enumerate().take(MOST) {
            good &= problems.positive(&format!("{branches}[{i}].shear"), branch.shear);
            good &= problems.positive(&format!("{branches}[{i}].relaxation_time"), branch.relaxation_time);
        }
        law.filter(|_| good).and_then(|law| Self::new(law, given.branches.clone()))
    }

    /// Half of G relaxes.
    fn example(lame: Lame) -> Self {
        let Lame { lambda, shear } = lame;
        let base = B::example(Lame { lambda: lambda + shear / 3.0, shear: 0.5 * shear });
        let branch = |relaxation_time| Branch { shear: 0.25 * shear, relaxation_time };
        Self { base: Box::new(base), branches: vec![branch(0.5), branch(5.0)] }
    }
}
