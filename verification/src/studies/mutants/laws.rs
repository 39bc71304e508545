//! Wrong laws: a shipped law with one fault in one of its functions.

use super::forecast::{ALL, PLANE_AND_SPACE, Red, judge as compare, red};
use crate::check::regime::Regime;
use crate::random::Random;
use crate::report::Report;
use crate::studies::StudyError;
use crate::studies::tangent::cloud;
use crate::{check_material, check_tangent};
use bfree::approximation::Bspline;
use bfree::material::{FrozenMaterial, FrozenTangent, Lame, Law, Material, NeoHookean, StVenantKirchhoff};
use bfree::scalar::Real;
use bfree::tensor::{Deformation, Tensor, Vector, contract, identity, outer, scaled, symmetric, trace};

/// What is wrong with a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    EnergyFactor,
    StressScaled,
    StressSkew,
    StressAtRest,
    StressOfLinearStrain,
    PlaneStress,
    ElasticityFactor,
    ElasticityScaled,
    ElasticityUnsymmetrised,
    ElasticityHalfShear,
    ElasticitySingleJacobian,
    ElasticityTransposedF,
    DensitySwapped,
    DensitySign,
    ProductGeometricSign,
    ProductTransposedF,
    ProductOfIdentity,
    ProductAndBlockNegated,
    BlockWithoutGeometric,
    BlockWithoutMaterial,
    BlockSecondGradient,
}

/// Relative size of the small faults.
const SMALL: f64 = 1e-6;

/// A law with a fault.
#[derive(Clone, Debug)]
struct Wrong {
    right: Material,
    lame: Lame,
    fault: Fault,
}

impl Wrong {
    /// The law, with the Λ of plane stress where the fault is that and D = 2.
    fn law<const D: usize>(&self) -> Material {
        if self.fault == Fault::PlaneStress && D == 2 {
            let Lame { lambda, shear } = self.lame;
            let lambda = 2.0 * lambda * shear / (lambda + 2.0 * shear);
            return StVenantKirchhoff { lame: Lame { lambda, shear } }.into();
        }
        self.right.clone()
    }
}

fn transposed<T: Real, const D: usize>(at: &Deformation<T, D>) -> Deformation<T, D> {
    Deformation::new(at.h.transpose())
}

/// Λ tr(X) I + 2G X
fn hooke<T: Real, const D: usize>(lame: Lame, x: &Tensor<T, D>) -> Tensor<T, D> {
    scaled(&identity(), T::lit(lame.lambda) * trace(x)) + scaled(x, T::lit(2.0 * lame.shear))
}

impl Law for Wrong {
    type Frozen<T: Real, const D: usize> = WrongFrozen<T, D>;

    fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> T {
        let right = self.law::<D>().energy(at);
        match self.fault {
            Fault::EnergyFactor => right * T::lit(1.01),
            Fault::StressAtRest => right + T::lit(SMALL * self.lame.shear) * trace(&at.green_lagrange()),
            _ => right,
        }
    }

    fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> Tensor<T, D> {
        let right = self.law::<D>().stress(at);
        let small = T::lit(SMALL * self.lame.shear);
        match self.fault {
            Fault::StressScaled => scaled(&right, T::lit(1.0 + SMALL)),
            Fault::StressSkew => right + Tensor::from_fn(|i, k| if (i, k) == (0, 1) { small } else { T::zero() }),
            Fault::StressAtRest => right + scaled(&identity(), small),
            Fault::StressOfLinearStrain => hooke(self.lame, &symmetric(&at.h)),
            _ => right,
        }
    }

    fn elasticity<T: Real, const D: usize>(&self, at: &Deformation<T, D>, x: &Tensor<T, D>) -> Tensor<T, D> {
        let right = self.law::<D>().elasticity(at, x);
        match self.fault {
            Fault::ElasticityFactor => scaled(&right, T::lit(2.0)),
            Fault::ElasticityScaled => scaled(&right, T::lit(1.0 + SMALL)),
            // Of St. Venant and Kirchhoff: the tensor is taken for symmetric; G in place of 2G.
            Fault::ElasticityUnsymmetrised => hooke(self.lame, x),
            Fault::ElasticityHalfShear => right - scaled(&symmetric(x), T::lit(self.lame.shear)),
            // Of Ciarlet: ΛJ in place of ΛJ².
            Fault::ElasticitySingleJacobian => {
                let f_inv_t = at.inverse_transpose();
                let c_inv = f_inv_t.transpose() * f_inv_t;
                let less = T::lit(self.lame.lambda) * (at.jacobian * at.jacobian - at.jacobian);
                right - scaled(&c_inv, less * contract(&c_inv, x))
            }
            Fault::ElasticityTransposedF => self.right.elasticity(&transposed(at), x),
            _ => right,
        }
    }

    fn tangent_density<T: Real, const D: usize>(
        &self,
        at: &Deformation<T, D>,
        v: &Vector<T, D>,
        b: &Vector<T, D>,
    ) -> Tensor<T, D> {
        match self.fault {
            Fault::DensitySwapped => self.right.tangent_density(at, b, v),
            // The last term of St. Venant and Kirchhoff's, + G b⊗v, with the other sign.
            Fault::DensitySign => {
                self.right.tangent_density(at, v, b) - scaled(&outer(b, v), T::lit(2.0 * self.lame.shear))
            }
            _ => self.law::<D>().tangent_density(at, v, b),
        }
    }

    fn freeze<T: Real, const D: usize>(
        &self,
        f_n: &Tensor<T, D>,
        at: &Deformation<T, D>,
        volume: T,
    ) -> WrongFrozen<T, D> {
        let law = self.law::<D>();
        let right = match self.fault {
            Fault::ProductTransposedF => law.freeze(f_n, &transposed(at), volume),
            Fault::ProductOfIdentity => law.freeze(&identity(), at, volume),
            _ => law.freeze(f_n, at, volume),
        };
        let stress = scaled(&self.right.stress(at), volume);
        WrongFrozen { right, f_n: *f_n, stress, shear: T::lit(self.lame.shear) * volume, fault: self.fault }
    }
}

/// A frozen tangent with a fault.
#[derive(Clone, Debug)]
struct WrongFrozen<T: Real, const D: usize> {
    right: FrozenMaterial<T, D>,
    f_n: Tensor<T, D>,
    /// V₀ S
    stress: Tensor<T, D>,
    /// V₀ G
    shear: T,
    fault: Fault,
}

impl<T: Real, const D: usize> FrozenTangent<T, D> for WrongFrozen<T, D> {
    fn apply(&self, l: &Tensor<T, D>) -> Tensor<T, D> {
        let right = self.right.apply(l);
        match self.fault {
            Fault::ProductGeometricSign => {
                right - scaled(&(l * self.f_n * self.stress * self.f_n.transpose()), T::lit(2.0))
            }
            Fault::ProductAndBlockNegated => -right,
            _ => right,
        }
    }

    fn block(&self, grad_i: &Vector<T, D>, grad_j: &Vector<T, D>) -> Tensor<T, D> {
        let right = self.right.block(grad_i, grad_j);
        let (v, b) = (self.f_n.transpose() * grad_i, self.f_n.transpose() * grad_j);
        let geometric = scaled(&identity(), v.dot(&(self.stress * b)));
        match self.fault {
            Fault::BlockWithoutGeometric => right - geometric,
            Fault::BlockWithoutMaterial => geometric,
            // G GRAD N^J·GRAD N^J where the product has G GRAD N^I·GRAD N^J
            Fault::BlockSecondGradient => right + scaled(&identity(), self.shear * (b.dot(&b) - v.dot(&b))),
            Fault::ProductAndBlockNegated => -right,
            _ => right,
        }
    }
}

const S: &str = "S against dual(W)";
const C: &str = "C:X against dual(S)";
const CMAT: &str = "Cmat against C:X";
const FROZEN: &str = "frozen product against dual(P)";
const BLOCKS: &str = "blocks against frozen product";

/// At strains of 1e-8 the work of the stress is 1e-8 of the stiffness that round-off is relative to.
const TINY_WORK: &[&str] = &["F=I+1e-8"];

/// At strains of 1e-8, FᵀF and FFᵀ differ by their square: less than round-off.
const TINY_STRAIN: &[&str] = &["F=I+1e-8"];

/// A fault, the law it is put into, and the cells of [`check_material`] that must turn red.
type Mutant = (&'static str, fn(Lame) -> Material, Fault, &'static [Red]);

fn ciarlet(lame: Lame) -> Material {
    NeoHookean::ciarlet(lame).into()
}

fn kirchhoff(lame: Lame) -> Material {
    StVenantKirchhoff { lame }.into()
}

const MUTANTS: &[Mutant] = &[
    ("W 1% too large", ciarlet, Fault::EnergyFactor, &[red(S, ALL)]),
    ("S scaled by 1 + 1e-6", ciarlet, Fault::StressScaled, &[red(S, ALL).except(TINY_WORK), red(C, ALL), red(FROZEN, ALL)]),
    (
        "S not symmetric",
        ciarlet,
        Fault::StressSkew,
        &[
            red(S, PLANE_AND_SPACE),
            red(FROZEN, PLANE_AND_SPACE),
            red("S symmetric", PLANE_AND_SPACE),
            red("S = 0", PLANE_AND_SPACE),
        ],
    ),
    ("S at rest is not zero", ciarlet, Fault::StressAtRest, &[red("S = 0", ALL), red(FROZEN, ALL)]),
    (
        "S of the linear strain",
        kirchhoff,
        Fault::StressOfLinearStrain,
        &[red(S, ALL).except(TINY_WORK), red(C, ALL), red(FROZEN, ALL), red("S(QF) = S(F)", PLANE_AND_SPACE)],
    ),
    ("plane stress for plane strain", kirchhoff, Fault::PlaneStress, &[red("S as embedded in 3D", &["2"])]),
    ("C:X twice as large", ciarlet, Fault::ElasticityFactor, &[red(C, ALL), red(CMAT, ALL)]),
    ("C:X scaled by 1 + 1e-6", ciarlet, Fault::ElasticityScaled, &[red(C, ALL), red(CMAT, ALL)]),
    (
        "C:X without sym X",
        kirchhoff,
        Fault::ElasticityUnsymmetrised,
        &[red(C, PLANE_AND_SPACE), red(CMAT, PLANE_AND_SPACE)],
    ),
    ("misprint (B9): G for 2G in C", kirchhoff, Fault::ElasticityHalfShear, &[red(C, ALL), red(CMAT, ALL)]),
    ("J for J^2 in C", ciarlet, Fault::ElasticitySingleJacobian, &[red(C, ALL), red(CMAT, ALL)]),
    (
        "transposed F in C",
        ciarlet,
        Fault::ElasticityTransposedF,
        &[red(C, PLANE_AND_SPACE).except(TINY_STRAIN), red(CMAT, PLANE_AND_SPACE).except(TINY_STRAIN)],
    ),
    ("v and b swapped in Cmat (equivalent in 1D)", kirchhoff, Fault::DensitySwapped, &[red(CMAT, PLANE_AND_SPACE)]),
    ("sign of the last term of Cmat", kirchhoff, Fault::DensitySign, &[red(CMAT, ALL)]),
    ("sign of the geometric part", ciarlet, Fault::ProductGeometricSign, &[red(FROZEN, ALL), red(BLOCKS, ALL)]),
    ("transposed F in the product", ciarlet, Fault::ProductTransposedF, &[red(FROZEN, PLANE_AND_SPACE)]),
    ("Q not pulled back by F_n", ciarlet, Fault::ProductOfIdentity, &[red(FROZEN, ALL)]),
    ("misprint (A7), (A11): minus before both parts", ciarlet, Fault::ProductAndBlockNegated, &[red(FROZEN, ALL)]),
    ("blocks without the geometric part", ciarlet, Fault::BlockWithoutGeometric, &[red(BLOCKS, ALL)]),
    ("blocks without the material part", ciarlet, Fault::BlockWithoutMaterial, &[red(BLOCKS, ALL)]),
    ("misprint (B6): GRAD N^J twice", ciarlet, Fault::BlockSecondGradient, &[red(BLOCKS, ALL)]),
];

/// Every increment of [`check_tangent`].
const INCREMENTS: &[&str] = &["zero", "dt v_n", "random"];

/// The same faults in a whole step, with the cells of [`check_tangent`] that must turn red.
const IN_A_STEP: &[Mutant] = &[
    ("W 1% too large, in a step", ciarlet, Fault::EnergyFactor, &[red("dual(Pi) - R.u", INCREMENTS)]),
    ("C:X twice as large, in a step", ciarlet, Fault::ElasticityFactor, &[red("material", INCREMENTS)]),
    (
        "sign of the geometric part, in a step",
        ciarlet,
        Fault::ProductGeometricSign,
        &[red("whole product", INCREMENTS), red("diagonal blocks", INCREMENTS)],
    ),
    ("blocks without the material part, in a step", ciarlet, Fault::BlockWithoutMaterial, &[red("diagonal blocks", INCREMENTS)]),
    // The same where I = J, but a step sums its blocks from those of unit gradients, e_k and e_l.
    ("misprint (B6), in a step", ciarlet, Fault::BlockSecondGradient, &[red("diagonal blocks", INCREMENTS)]),
    ("v and b swapped in Cmat, in a step: not called by it", kirchhoff, Fault::DensitySwapped, &[]),
];

/// Checks every wrong law.
pub(super) fn judge(report: &mut Report) -> Result<(), StudyError> {
    let lame = Lame::from_young_poisson(1000.0, 0.3)?;
    for &(name, law, fault, forecast) in MUTANTS {
        let found = check_material(&Wrong { right: law(lame), lame, fault });
        compare(report, name, "check_material", &found, forecast);
    }
    for &(name, law, fault, forecast) in IN_A_STEP {
        let wrong = Wrong { right: law(lame), lame, fault };
        let mut simulation = cloud::<2, _>(wrong, Bspline::Quadratic.into(), Regime::Moderate, &mut Random::new(3))?;
        simulation.loads.surface.clear();
        compare(report, name, "check_tangent", &check_tangent(&simulation), forecast);
    }
    Ok(())
}
