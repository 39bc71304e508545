//! A law against itself: energy, stress, elasticity, tangent density and frozen tangent must be derivatives of each other.

use super::regime::{Regime, condition, rotation, round_off};
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::material::{FrozenTangent, Law, NonPositiveJacobian, admissible, first_piola};
use bfree::tensor::{Deformation, Tensor, contract, identity, inverse, outer};
use num_dual::Dual64;

/// Deformations tried in each regime.
const TRIES: usize = 8;

/// Checks a law at a point, in 1, 2 and 3 dimensions, from strains of 1e-8 to J = 0.05 and J = 20.
///
/// Every derivative is compared with dual numbers through the function it is the derivative of: S with W, ℂ with S, the frozen
/// product with P; the blocks with the product; and S must not see a rotation. Labels are (quantity, D, regime).
pub fn check_material<L: Law>(law: &L) -> Report {
    let mut report = Report::new("material law", &["quantity", "D", "regime"]);
    dimension::<L, 1>(law, &mut report);
    dimension::<L, 2>(law, &mut report);
    dimension::<L, 3>(law, &mut report);
    report
}

fn dimension<L: Law, const D: usize>(law: &L, report: &mut Report) {
    let name = D.to_string();
    at_rest::<L, D>(law, report);
    for regime in Regime::GENERAL {
        if !regime.exists(D) {
            continue;
        }
        let mut random = Random::new(41);
        let mut worst = [Worst::default(); QUANTITIES.len()];
        for _ in 0..TRIES {
            match quantities::<L, D>(law, regime.displacement_gradient(&mut random), &mut random) {
                Ok((values, bound)) => {
                    for (worst, value) in worst.iter_mut().zip(values) {
                        worst.take(value, bound);
                    }
                }
                Err(error) => report.push_error(&["admissibility", &name, regime.name()], &error),
            }
        }
        for (quantity, worst) in QUANTITIES.iter().zip(worst) {
            report.push(&[quantity, &name, regime.name()], worst.value, Bound::AtMost(worst.bound));
        }
    }
}

/// The value that uses most of its bound.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    value: f64,
    bound: f64,
}

impl Worst {
    fn take(&mut self, value: f64, bound: f64) {
        // NaN is taken and kept.
        let (share, worst) = (value / bound, self.value / self.bound);
        if self.bound == 0.0 || (!self.value.is_nan() && (share.is_nan() || share > worst)) {
            *self = Self { value, bound };
        }
    }
}

/// No stress and no energy at F = I.
fn at_rest<L: Law, const D: usize>(law: &L, report: &mut Report) {
    let at = Deformation::<f64, D>::new(Tensor::zeros());
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

/// Relative errors of all [`QUANTITIES`] at one deformation, and their common bound.
fn quantities<L: Law, const D: usize>(
    law: &L,
    h: Tensor<f64, D>,
    random: &mut Random,
) -> Result<([f64; QUANTITIES.len()], f64), NonPositiveJacobian> {
    let at = admissible(h)?;
    let f = at.f;
    let stress = law.stress(&at);
    let piola = first_piola(law, &f, h)?;
    let (volume, l, m) = (random.between(0.5, 2.0), random.tensor::<D>(), random.tensor::<D>());
    let (a, v, b) = (random.vector::<D>(), random.vector::<D>(), random.vector::<D>());

    // F = ΔF F_n with a ΔF of its own, so that the pull-back by F_n shows.
    let f_n = inverse(&(identity::<f64, D>() + random.tensor() * (0.3 / D as f64))) * f;
    let delta_f = l * f_n;
    let seeded = h.zip_map(&delta_f, Dual64::new);
    let dual_at = admissible(seeded)?;
    let dual_stress = law.stress(&dual_at).map(|s| s.eps);
    let dual_piola = first_piola(law, &dual_at.f, seeded)?.map(|s| s.eps);

    let elasticity = law.elasticity(&at, &(f.transpose() * delta_f));
    // Round-off in F alone changes S by eps times this; near F = I that is more than eps times S.
    let stiffness = law.elasticity(&at, &(f.transpose() * f)).norm();

    let density = law.tangent_density(&at, &v, &b);
    let by_elasticity = law.elasticity(&at, &outer(&a, &b)) * v;

    let frozen = law.freeze(&f_n, &at, volume);
    let (product, other) = (frozen.apply(&l), frozen.apply(&m));
    let expected = dual_piola * f_n.transpose() * volume;
    let block = frozen.block(&v, &b);
    let by_product = frozen.apply(&outer(&a, &b)) * v;

    let turned = law.stress(&Deformation::new(rotation::<D>(random) * f - identity::<f64, D>()));
    let embedded = law.stress(&Deformation::new(upper_left::<D, 3>(&h)));

    let values = [
        (law.energy(&dual_at).eps - contract(&piola, &delta_f)).abs()
            / (piola.norm() * delta_f.norm() + dual_piola.norm()),
        (elasticity - dual_stress).norm() / dual_stress.norm(),
        (density * a - by_elasticity).norm() / (density.norm() * a.norm()),
        (product - expected).norm() / expected.norm(),
        (block * a - by_product).norm() / (block.norm() * a.norm()),
        (stress - stress.transpose()).norm() / (stress.norm() + stiffness),
        (contract(&product, &m) - contract(&other, &l)).abs() / (product.norm() * m.norm()),
        (turned - stress).norm() / (stress.norm() + stiffness),
        (upper_left::<3, D>(&embedded) - stress).norm() / (stress.norm() + stiffness),
    ];
    // The pull-back goes through F_n too.
    Ok((values, round_off(condition(&f).max(condition(&f_n)))))
}

/// A tensor cut to, or filled by zeros to, another dimension.
fn upper_left<const D: usize, const E: usize>(a: &Tensor<f64, D>) -> Tensor<f64, E> {
    Tensor::from_fn(|i, k| if i < D && k < D { a[(i, k)] } else { 0.0 })
}
