//! Wrong laws: a shipped law with one fault in one of its functions.

use super::forecast::{ALL, PLANE_AND_SPACE, Red, judge as compare, red};
use crate::check::regime::Regime;
use crate::random::Random;
use crate::report::Report;
use crate::studies::StudyError;
use crate::studies::tangent::cloud;
use crate::{check_material, check_tangent};
use bfree::approximation::Bspline;
use bfree::material::{ClosedTangent, Lame, Law, Material, MaterialState, NeoHookean, StVenantKirchhoff};
use bfree::scalar::Real;
use bfree::tensor::{Tensor, Vector, contract, identity, outer, scaled, symmetric, trace};

/// The fault of a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    EnergyFactor,
    StressScaled,
    StressSkew,
    StressAtRest,
    StressOfLinearStrain,
    PlaneStress,
    ElasticityScaled,
    ElasticityUnsymmetrised,
    ElasticityHalfShear,
    ElasticitySingleJacobian,
    ElasticityTransposedF,
    DensitySwapped,
    DensitySign,
    ClosedGeometricSign,
    ClosedTransposedF,
    ClosedOfIdentity,
    ClosedWithoutQ,
    NoPotential,
}

/// Relative size of the small faults.
const SMALL: f64 = 1e-6;

/// A law with a fault.
#[derive(Clone, Debug)]
struct Wrong {
    right: Material,
    lame: Lame,
    fault: Fault,
    /// Whether the law has no closed form, so that a step uses ℂmat.
    general: bool,
}

impl Wrong {
    /// The law; for the fault `PlaneStress` and D = 2 with the Λ of plane stress.
    fn law<const D: usize>(&self) -> Material {
        if self.fault == Fault::PlaneStress && D == 2 {
            let Lame { lambda, shear } = self.lame;
            let lambda = 2.0 * lambda * shear / (lambda + 2.0 * shear);
            return StVenantKirchhoff { lame: Lame { lambda, shear } }.into();
        }
        self.right.clone()
    }
}

fn transposed<'a, T: Real, const D: usize>(at: &MaterialState<'a, T, D>) -> MaterialState<'a, T, D> {
    at.deformed(at.h.transpose())
}

/// Λ tr(X) I + 2G X
fn hooke<T: Real, const D: usize>(lame: Lame, x: &Tensor<T, D>) -> Tensor<T, D> {
    scaled(&identity(), T::lit(lame.lambda) * trace(x)) + scaled(x, T::lit(2.0 * lame.shear))
}

/// Λ tr(X) e₁ ⊗ e₁, which belongs to no symmetric ℂ.
fn along_one<T: Real, const D: usize>(lame: Lame, x: &Tensor<T, D>) -> Tensor<T, D> {
    let trace = T::lit(0.01 * lame.lambda) * trace(x);
    Tensor::from_fn(|i, k| if (i, k) == (0, 0) { trace } else { T::zero() })
}

impl Law for Wrong {
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        let right = self.law::<D>().energy(at);
        match self.fault {
            Fault::EnergyFactor => right * T::lit(1.01),
            Fault::StressAtRest => right + T::lit(SMALL * self.lame.shear) * trace(&at.green_lagrange()),
            _ => right,
        }
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let right = self.law::<D>().stress(at);
        let small = T::lit(SMALL * self.lame.shear);
        match self.fault {
            Fault::StressScaled => scaled(&right, T::lit(1.0 + SMALL)),
            Fault::StressSkew => right + Tensor::from_fn(|i, k| if (i, k) == (0, 1) { small } else { T::zero() }),
            Fault::StressAtRest => right + scaled(&identity(), small),
            Fault::StressOfLinearStrain => hooke(self.lame, &symmetric(&at.h)),
            Fault::NoPotential => right + along_one(self.lame, &at.green_lagrange()),
            _ => right,
        }
    }

    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let right = self.law::<D>().elasticity(at, x);
        match self.fault {
            Fault::ElasticityScaled => scaled(&right, 1.0 + SMALL),
            // St. Venant–Kirchhoff's law: X is treated as symmetric; G in place of 2G.
            Fault::ElasticityUnsymmetrised => hooke(self.lame, x),
            Fault::ElasticityHalfShear => right - scaled(&symmetric(x), self.lame.shear),
            // Ciarlet's law: ΛJ in place of ΛJ².
            Fault::ElasticitySingleJacobian => {
                let f_inv_t = at.inverse_transpose();
                let c_inv = f_inv_t.transpose() * f_inv_t;
                let less = self.lame.lambda * (at.jacobian * at.jacobian - at.jacobian);
                right - scaled(&c_inv, less * contract(&c_inv, x))
            }
            Fault::NoPotential => right + along_one(self.lame, x),
            Fault::ElasticityTransposedF => self.right.elasticity(&transposed(at), x),
            _ => right,
        }
    }

    fn tangent_density<const D: usize>(
        &self,
        at: &MaterialState<f64, D>,
        v: &Vector<f64, D>,
        b: &Vector<f64, D>,
    ) -> Tensor<f64, D> {
        let right = |v, b| self.law::<D>().tangent_density(at, v, b);
        match self.fault {
            Fault::DensitySwapped => right(b, v),
            // The last term of St. Venant–Kirchhoff's law, + G b⊗v, with the other sign.
            Fault::DensitySign => right(v, b) - scaled(&outer(b, v), 2.0 * self.lame.shear),
            // Λ (e₁·v) e₁ ⊗ b
            Fault::NoPotential => {
                let e_1 = Vector::from_fn(|i, _| f64::from(i == 0));
                right(v, b) + scaled(&outer(&e_1, b), 0.01 * self.lame.lambda * v[0])
            }
            // ℂmat from ℂ, if the fault is in ℂ.
            _ if self.general => Tensor::from_columns(&std::array::from_fn::<_, D, _>(|k| {
                let e_k = Vector::from_fn(|i, _| f64::from(i == k));
                self.elasticity(at, &outer(&e_k, b)) * v
            })),
            _ => right(v, b),
        }
    }

    fn closed<T: Real, const D: usize>(
        &self,
        f_n: &Tensor<T, D>,
        at: &MaterialState<T, D>,
        volume: T,
    ) -> Option<ClosedTangent<T, D>> {
        if self.general {
            return None;
        }
        let law = self.law::<D>();
        let mut closed = match self.fault {
            Fault::ClosedTransposedF => law.closed(f_n, &transposed(at), volume),
            Fault::ClosedOfIdentity => law.closed(&identity(), at, volume),
            _ => law.closed(f_n, at, volume),
        }?;
        match self.fault {
            Fault::ClosedGeometricSign => {
                let geometric = scaled(&(f_n * law.stress(at) * f_n.transpose()), volume);
                for i in 0..D {
                    for k in 0..D {
                        closed.right[i][k] -= T::lit(2.0) * geometric[(i, k)];
                    }
                }
            }
            Fault::ClosedWithoutQ => closed.q = T::zero(),
            _ => {}
        }
        Some(closed)
    }
}

const S: &str = "S against dual(W)";
const C: &str = "C:X against dual(S)";
const CMAT: &str = "Cmat against C:X";
const FROZEN: &str = "frozen product against dual(P)";

/// At strains of 1e-8 the work of the stress is 1e-8 of the stiffness, which is the scale of round-off.
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
    (
        "S scaled by 1 + 1e-6",
        ciarlet,
        Fault::StressScaled,
        &[red(S, ALL).except(TINY_WORK), red(C, ALL), red(FROZEN, ALL)],
    ),
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
    ("sign of the geometric part", ciarlet, Fault::ClosedGeometricSign, &[red(FROZEN, ALL)]),
    ("transposed F in the closed form", ciarlet, Fault::ClosedTransposedF, &[red(FROZEN, PLANE_AND_SPACE)]),
    ("closed form not pulled back by F_n", ciarlet, Fault::ClosedOfIdentity, &[red(FROZEN, ALL)]),
    ("closed form without q", ciarlet, Fault::ClosedWithoutQ, &[red(FROZEN, ALL)]),
];

/// Faults in laws without a closed form.
const BY_DENSITY: &[Mutant] = &[(
    "no potential, and not symmetric (but in 1D)",
    ciarlet,
    Fault::NoPotential,
    &[red(S, ALL), red("tangent symmetric", PLANE_AND_SPACE)],
)];

/// Every increment of [`check_tangent`].
const INCREMENTS: &[&str] = &["zero", "dt v_n", "random"];

/// The pieces with the material part, and the whole.
macro_rules! material {
    ($($more:expr),*) => {
        &[
            red("stress", INCREMENTS),
            red("material", INCREMENTS),
            red("whole product", INCREMENTS),
            $($more),*
        ]
    };
}

/// Some of the faults in a whole step, with the cells of [`check_tangent`] that must turn red. A law with a closed form acts through it.
const IN_A_STEP: &[Mutant] = &[
    ("W 1% too large, in a step", ciarlet, Fault::EnergyFactor, &[red("dual(Pi) - R.u", INCREMENTS)]),
    ("S scaled by 1 + 1e-6, in a step", ciarlet, Fault::StressScaled, material![red("dual(Pi) - R.u", INCREMENTS)]),
    ("closed form not pulled back, in a step", ciarlet, Fault::ClosedOfIdentity, material![]),
    ("v and b swapped in Cmat, beside a closed form: not called", kirchhoff, Fault::DensitySwapped, &[]),
];

/// Faults in a whole step of laws that use ℂmat.
const IN_A_STEP_BY_DENSITY: &[Mutant] = &[
    ("v and b swapped in Cmat, in a step", kirchhoff, Fault::DensitySwapped, material![]),
    ("C:X scaled by 1 + 1e-6, in a step", ciarlet, Fault::ElasticityScaled, material![]),
    (
        "no potential, in a step",
        ciarlet,
        Fault::NoPotential,
        &[red("u.Kw - w.Ku", INCREMENTS), red("dual(Pi) - R.u", INCREMENTS)],
    ),
];

/// Checks every wrong law.
pub(super) fn judge(report: &mut Report) -> Result<(), StudyError> {
    let lame = Lame::from_young_poisson(1000.0, 0.3)?;
    for (list, general) in [(MUTANTS, false), (BY_DENSITY, true)] {
        for &(name, law, fault, forecast) in list {
            let found = check_material(&Wrong { right: law(lame), lame, fault, general });
            compare(report, name, "check_material", &found, forecast);
        }
    }
    for (list, general) in [(IN_A_STEP, false), (IN_A_STEP_BY_DENSITY, true)] {
        for &(name, law, fault, forecast) in list {
            let wrong = Wrong { right: law(lame), lame, fault, general };
            let (shape, mut random) = (Bspline::Quadratic.into(), Random::new(3));
            let mut simulation = cloud::<2, _>(wrong, shape, Regime::Moderate, &mut random)?;
            simulation.loads.surface.clear();
            compare(report, name, "check_tangent", &check_tangent(&simulation), forecast);
        }
    }
    Ok(())
}
