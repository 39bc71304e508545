//! A law against itself: energy, stress, elasticity, tangent density and closed tangent must be derivatives of each other.

use super::regime::{Regime, condition, rotation, round_off};
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::material::{ClosedTangent, Law, MaterialState, NonPositiveJacobian};
use bfree::tensor::{Tensor, Vector, contract, identity, inverse, outer, scaled};
use num_dual::Dual64;

/// Deformations tried in each regime.
const TRIES: usize = 8;

/// Checks a law at a point, in 1, 2 and 3 dimensions, from strains of 1e-8 to J = 0.05 and J = 20. A law with internal variables is checked
/// in a step of length 1 from rest.
///
/// Every derivative is compared with dual numbers through its own primitive: S with W, ℂ with S, the closed form of the tangent, if there
/// is one, with P. The blocks of the closed form are compared with its product. S must not change under a rotation.
/// Labels are (quantity, D, regime).
pub fn check_material<L: Law>(law: &L) -> Report {
    let internal: Vec<f64> = law.internal_variables().iter().map(|one| one.at_rest).collect();
    let step = Step { dt: 1.0, internal: &internal };
    let mut report = Report::new("material law", &["quantity", "D", "regime"]);
    at_rest::<L, 1>(law, step, &mut report);
    at_rest::<L, 2>(law, step, &mut report);
    at_rest::<L, 3>(law, step, &mut report);
    dimensions(law, step, &mut report);
    report
}

/// Like [`check_material`], for a law with internal variables in a step of length `dt` that starts with the values `internal`. It omits the
/// check that energy and stress vanish at rest.
///
/// ```
/// use bfree::material::{InternalVariable, Law, MaterialState};
/// use bfree::scalar::Real;
/// use bfree::tensor::{Tensor, contract, symmetric};
///
/// /// S = 2G (1 − d) E with a damage d of the steps before.
/// struct Damaged;
///
/// impl Law for Damaged {
///     fn internal_variables(&self) -> &[InternalVariable] {
///         &[InternalVariable { name: "damage", at_rest: 0.0 }]
///     }
///     fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
///         let e = at.green_lagrange();
///         contract(&e, &e) * T::lit(1.0 - at.internal[0])
///     }
///     fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
///         at.green_lagrange().map(|e| e * T::lit(2.0 * (1.0 - at.internal[0])))
///     }
///     fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
///         symmetric(x) * (2.0 * (1.0 - at.internal[0]))
///     }
/// }
///
/// let report = verification::check_material_from(&Damaged, 0.1, &[0.25]);
/// assert!(report.passed(), "{report}");
/// ```
pub fn check_material_from<L: Law>(law: &L, dt: f64, internal: &[f64]) -> Report {
    let mut report = Report::new("material law from a given start", &["quantity", "D", "regime"]);
    dimensions(law, Step { dt, internal }, &mut report);
    report
}

/// The step whose end is checked: Δt, and the internal variables at t_n.
#[derive(Clone, Copy)]
struct Step<'a> {
    dt: f64,
    internal: &'a [f64],
}

impl<'a> Step<'a> {
    fn to<const D: usize>(self, h: Tensor<f64, D>) -> MaterialState<'a, f64, D> {
        MaterialState::new(h).in_step(self.dt, self.internal)
    }
}

fn dimensions<L: Law>(law: &L, step: Step<'_>, report: &mut Report) {
    dimension::<L, 1>(law, step, report);
    dimension::<L, 2>(law, step, report);
    dimension::<L, 3>(law, step, report);
}

fn dimension<L: Law, const D: usize>(law: &L, step: Step<'_>, report: &mut Report) {
    let name = D.to_string();
    for regime in Regime::GENERAL {
        if !regime.exists(D) {
            continue;
        }
        let mut random = Random::new(41);
        let mut worst: [Option<Worst>; QUANTITIES.len()] = [None; QUANTITIES.len()];
        for _ in 0..TRIES {
            match quantities::<L, D>(law, step.to(regime.displacement_gradient(&mut random)), &mut random) {
                Ok((values, bound)) => {
                    for (worst, value) in worst.iter_mut().zip(values) {
                        if let Some(value) = value {
                            worst.get_or_insert_default().take(value, bound);
                        }
                    }
                }
                Err(error) => report.push_error(&["admissibility", &name, regime.name()], &error),
            }
        }
        for (quantity, worst) in QUANTITIES.iter().zip(worst) {
            if let Some(Worst { value, bound }) = worst {
                report.push(&[quantity, &name, regime.name()], value, Bound::AtMost(bound));
            }
        }
    }
}

/// The value that uses the largest share of its bound.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    value: f64,
    bound: f64,
}

impl Worst {
    fn take(&mut self, value: f64, bound: f64) {
        // The comparison accepts NaN and keeps it.
        let (share, worst) = (value / bound, self.value / self.bound);
        if self.bound == 0.0 || (!self.value.is_nan() && (share.is_nan() || share > worst)) {
            *self = Self { value, bound };
        }
    }
}

/// No stress and no energy at F = I.
fn at_rest<L: Law, const D: usize>(law: &L, step: Step<'_>, report: &mut Report) {
    let at = step.to::<D>(Tensor::zeros());
    let stiffness = law.elasticity(&at, &identity()).norm();
    let bound = Bound::AtMost(round_off(1.0));
    report.push(&["S = 0", &D.to_string(), "F=I"], law.stress(&at).norm() / stiffness, bound);
    report.push(&["W = 0", &D.to_string(), "F=I"], law.energy(&at).abs() / stiffness, bound);
}

const QUANTITIES: [&str; 9] = [
    "S against dual(W)",
    "C:X against dual(S)",
    "Cmat against C:X",
    "frozen product against dual(P)",
    "blocks against frozen product",
    "S symmetric",
    "tangent symmetric",
    "S(QF) = S(F)",
    "S as embedded in 3D",
];

/// Relative errors of all [`QUANTITIES`] that the law has at one deformation, and their common bound.
fn quantities<L: Law, const D: usize>(
    law: &L,
    at: MaterialState<f64, D>,
    random: &mut Random,
) -> Result<([Option<f64>; QUANTITIES.len()], f64), NonPositiveJacobian> {
    let at = at.admissible()?;
    let f = at.f;
    let stress = law.stress(&at);
    let (volume, l, m) = (random.between(0.5, 2.0), random.tensor::<D>(), random.tensor::<D>());
    let (a, v, b) = (random.vector::<D>(), random.vector::<D>(), random.vector::<D>());

    // F = ΔF F_n with a separate ΔF, so that a wrong pull-back by F_n shows.
    let f_n = inverse(&(identity::<f64, D>() + random.tensor() * (0.3 / D as f64))) * f;
    let delta_f = l * f_n;
    let dual_at = at.deformed(at.h.zip_map(&delta_f, Dual64::new)).admissible()?;
    let dual_stress = law.stress(&dual_at);
    let dual_piola = (dual_at.f * dual_stress).map(|s| s.eps);
    let dual_stress = dual_stress.map(|s| s.eps);

    let elasticity = law.elasticity(&at, &(f.transpose() * delta_f));
    // Round-off in F changes S by eps times this stiffness; near F = I that is more than eps times S.
    let stiffness = law.elasticity(&at, &(f.transpose() * f)).norm();

    let density = law.tangent_density(&at, &v, &b);
    let by_elasticity = law.elasticity(&at, &outer(&a, &b)) * v;

    let energy = (law.energy(&dual_at).eps - contract(&(f * stress), &delta_f)).abs();
    let work = (f * stress).norm() * delta_f.norm() + dual_piola.norm();

    let closed = law.closed(&f_n, &at, volume);
    // V₀ (δF S + F [ℂ : Fᵀ δF]) F_nᵀ if there is no closed form.
    let product = |l: &Tensor<f64, D>| match &closed {
        Some(closed) => closed.apply(l),
        None => {
            let delta_f = l * f_n;
            let material = f * law.elasticity(&at, &(f.transpose() * delta_f));
            scaled(&((delta_f * stress + material) * f_n.transpose()), volume)
        }
    };
    let expected = dual_piola * f_n.transpose() * volume;
    let by_blocks = closed.as_ref().map(|closed| blocks_against_product(closed, [&a, &v, &b]));
    let (of_l, of_m) = (product(&l), product(&m));
    let asymmetry = (contract(&of_l, &m) - contract(&of_m, &l)).abs() / (of_l.norm() * m.norm());

    let [symmetry, turned, embedded] = of_stress(law, &at, stiffness, random);
    let values = [
        law.has_potential().then_some(energy / work),
        Some((elasticity - dual_stress).norm() / dual_stress.norm()),
        Some((density * a - by_elasticity).norm() / (density.norm() * a.norm())),
        closed.as_ref().map(|_| (of_l - expected).norm() / expected.norm()),
        by_blocks,
        Some(symmetry),
        law.is_symmetric().then_some(asymmetry),
        Some(turned),
        Some(embedded),
    ];
    // The pull-back adds the condition of F_n.
    Ok((values, round_off(condition(&f).max(condition(&f_n)))))
}

/// The block of the vectors v and b applied to a, against the product with a ⊗ b applied to v.
fn blocks_against_product<const D: usize>(closed: &ClosedTangent<f64, D>, [a, v, b]: [&Vector<f64, D>; 3]) -> f64 {
    let block = closed.block(v, b);
    let by_product = closed.apply(&outer(a, b)) * v;
    (block * a - by_product).norm() / (block.norm() * a.norm())
}

/// The errors of S: its symmetry, its change under a rotation, and its change as embedded in 3D.
fn of_stress<L: Law, const D: usize>(
    law: &L,
    at: &MaterialState<f64, D>,
    stiffness: f64,
    random: &mut Random,
) -> [f64; 3] {
    let stress = law.stress(at);
    let turned = law.stress(&at.deformed(rotation::<D>(random) * at.f - identity::<f64, D>()));
    let embedded = law.stress(&at.deformed(upper_left::<D, 3>(&at.h)));
    let errors = [stress - stress.transpose(), turned - stress, upper_left::<3, D>(&embedded) - stress];
    errors.map(|error| error.norm() / (stress.norm() + stiffness))
}

/// A tensor truncated, or padded with zeros, to another dimension.
fn upper_left<const D: usize, const E: usize>(a: &Tensor<f64, D>) -> Tensor<f64, E> {
    Tensor::from_fn(|i, k| if i < D && k < D { a[(i, k)] } else { 0.0 })
}
