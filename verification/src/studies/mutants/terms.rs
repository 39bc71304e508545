//! Wrong terms: the tangent's formulas as misprinted or with a fault, against dual numbers; the residual against its potential.

use super::forecast::{ALL, PLANE_AND_SPACE, Red, judge as compare, red};
use crate::check::regime::Regime;
use crate::check::tangent::term_name;
use crate::prepared::Prepared;
use crate::random::Random;
use crate::report::{Bound, Report};
use crate::studies::StudyError;
use crate::studies::tangent::{SPACING, YOUNG, cloud};
use bfree::approximation::Bspline;
use bfree::material::{Lame, Law, Material, NeoHookean, admissible, first_piola};
use bfree::mechanics::residual::{Carry, Equilibrium, Inadmissible, compose};
use bfree::mechanics::tangent::Term;
use bfree::tensor::{Deformation, Tensor, Vector, contract, identity};
use num_dual::Dual64;

/// What is wrong with a term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    InertiaOfDamping,
    InertiaLumpingSwapped,
    InertiaLumpedOnly,
    GeometricDropped,
    GeometricAndMaterialNegated,
    GradientsOfReference,
    MaterialScaled,
    MaterialSecondGradients,
    MaterialF,
    MaterialSwapped,
    MaterialAsPrinted,
    PressureHalf,
    PressureSign,
    PressureTransposed,
    ResidualWithoutInertia,
    ResidualTractionSign,
    ResidualTractionArea,
    ResidualNotPulledBack,
    ResidualTransposed,
}

/// ‖K u − dual(R) u‖ allowed, relative: the faults are larger than 1e-7.
const BOUND: f64 = 1e-10;

const POTENTIAL: &str = "dual(Pi) - R.u";

const MUTANTS: &[(&str, Fault, &[Red])] = &[
    ("inertia with a4 for a1", Fault::InertiaOfDamping, &[red("inertia", ALL)]),
    ("eps and 1 - eps swapped in the inertia", Fault::InertiaLumpingSwapped, &[red("inertia", ALL)]),
    ("inertia without its consistent part", Fault::InertiaLumpedOnly, &[red("inertia", ALL)]),
    ("no geometric term", Fault::GeometricDropped, &[red("geometric", ALL)]),
    ("minus before the geometric and the material term", Fault::GeometricAndMaterialNegated, &[red("geometric", ALL), red("material", ALL)]),
    ("gradients not pulled back by F_n", Fault::GradientsOfReference, &[red("geometric", ALL), red("material", ALL)]),
    ("material term scaled by 1 + 1e-6", Fault::MaterialScaled, &[red("material", ALL)]),
    ("misprint (34): both gradients J", Fault::MaterialSecondGradients, &[red("material", ALL)]),
    ("misprint (34): F for its transpose (equivalent in 1D)", Fault::MaterialF, &[red("material", PLANE_AND_SPACE)]),
    ("misprint after (37): v and b swapped (equivalent in 1D)", Fault::MaterialSwapped, &[red("material", PLANE_AND_SPACE)]),
    ("misprint after (37), both (equivalent in 1D)", Fault::MaterialAsPrinted, &[red("material", PLANE_AND_SPACE)]),
    ("follower pressure without its second half", Fault::PressureHalf, &[red("follower pressure", ALL)]),
    ("sign of the follower pressure (zero in 1D)", Fault::PressureSign, &[red("follower pressure", PLANE_AND_SPACE)]),
    ("1/F for its transpose in the pressure (equivalent in 1D)", Fault::PressureTransposed, &[red("follower pressure", PLANE_AND_SPACE)]),
    ("R without lumped inertia", Fault::ResidualWithoutInertia, &[red(POTENTIAL, ALL)]),
    ("R with the other sign of the dead load", Fault::ResidualTractionSign, &[red(POTENTIAL, ALL)]),
    ("R with the dead load of 1% more area", Fault::ResidualTractionArea, &[red(POTENTIAL, ALL)]),
    ("R with gradients not pulled back", Fault::ResidualNotPulledBack, &[red(POTENTIAL, ALL)]),
    ("R with S F for F S (equivalent in 1D)", Fault::ResidualTransposed, &[red(POTENTIAL, PLANE_AND_SPACE)]),
];

/// Checks every wrong term.
pub(super) fn judge(report: &mut Report) -> Result<(), StudyError> {
    for &(name, fault, forecast) in MUTANTS {
        let mut found = Report::new(name, &["quantity", "D", "regime"]);
        dimension::<1>(fault, &mut found)?;
        dimension::<2>(fault, &mut found)?;
        dimension::<3>(fault, &mut found)?;
        let check = if forecast.iter().all(|red| red.quantity == POTENTIAL) { "dual(Pi) = R" } else { "tangent" };
        compare(report, name, check, &found, forecast);
    }
    Ok(())
}

fn dimension<const D: usize>(fault: Fault, found: &mut Report) -> Result<(), StudyError> {
    let law = Material::from(NeoHookean::ciarlet(Lame::from_young_poisson(YOUNG, 0.3)?));
    for regime in [Regime::Moderate, Regime::Rotation, Regime::Crushed].into_iter().filter(|regime| regime.exists(D)) {
        let mut random = Random::new(11);
        let mut simulation = cloud::<D, _>(law.clone(), Bspline::Quadratic.into(), regime, &mut random)?;
        // Not a half, where swapping it with 1 − ε would change nothing.
        simulation.settings.lumping = 0.3;
        let labels = |quantity| [quantity, ["0", "1", "2", "3"][D.min(3)], regime.name()];
        for pressed in [true, false] {
            if !pressed {
                simulation.loads.surface.clear();
            }
            let prepared = Prepared::new(&simulation)?;
            let eq = prepared.equilibrium(&simulation);
            let size = regime.increment() * SPACING;
            let dphi: Vec<Vector<f64, D>> = random.field(prepared.nodes.len()).iter().map(|x| x * size).collect();
            let u = random.field(dphi.len());
            if pressed {
                for term in Term::ALL {
                    let (wrong, dual) = (product(fault, &eq, term, &dphi, &u)?, eq.dual_product(term, &dphi, &u)?);
                    // In 1D both halves of the pressure's tangent cancel; each is of this size.
                    let of_pressure = eq.pressures.iter().map(|point| point.force.norm()).sum::<f64>() * norm(&u) / SPACING;
                    let scale = if term == Term::Pressure { of_pressure } else { norm(&dual) };
                    let error = norm(&difference(&wrong, &dual)) / scale;
                    found.push(&labels(term_name(term)), error, Bound::AtMost(BOUND));
                }
            } else if let Some(potential) = eq.potential(&seeded(&dphi, &u)) {
                let r = residual(fault, &eq, &dphi)?;
                let work: f64 = r.iter().zip(&u).map(|(r, u)| r.dot(u)).sum();
                let error = (potential?.0.eps - work).abs() / (eq.magnitude(&dphi)? * norm(&u));
                found.push(&labels(POTENTIAL), error, Bound::AtMost(BOUND));
            }
        }
    }
    Ok(())
}

type Field<const D: usize> = Vec<Vector<f64, D>>;

/// One term of K u with the fault, where it concerns this term.
fn product<const D: usize, L: Law>(
    fault: Fault,
    eq: &Equilibrium<'_, D, L>,
    term: Term,
    dphi: &[Vector<f64, D>],
    u: &[Vector<f64, D>],
) -> Result<Field<D>, Inadmissible> {
    let right = eq.product(term, dphi, u)?;
    let times = |factor: f64| right.iter().map(|x| x * factor).collect::<Field<D>>();
    let f_n = |p: usize| identity::<f64, D>() + eq.particles.displacement_gradient[p];
    Ok(match (fault, term) {
        (Fault::InertiaOfDamping, Term::Inertia) => times(eq.alphas.a4 / eq.alphas.a1),
        (Fault::InertiaLumpingSwapped, Term::Inertia) => inertia(eq, u, 1.0 - eq.lumping, eq.lumping),
        (Fault::InertiaLumpedOnly, Term::Inertia) => inertia(eq, u, eq.lumping, 0.0),
        (Fault::GeometricDropped, Term::Geometric) => times(0.0),
        (Fault::GeometricAndMaterialNegated, Term::Geometric | Term::Material) => times(-1.0),
        (Fault::GradientsOfReference, Term::Geometric | Term::Material) => {
            let states = states(eq, dphi)?;
            let mut out = vec![Vector::zeros(); u.len()];
            eq.supports.assemble(
                u,
                &mut out,
                |p, _, l: Tensor<f64, D>| {
                    let (at, law) = (&states[p], eq.law(p));
                    let delta_piola = match term {
                        Term::Geometric => l * law.stress(at),
                        _ => at.f * law.elasticity(at, &(at.f.transpose() * l)),
                    };
                    Ok::<_, Inadmissible>((Vector::zeros(), delta_piola * eq.particles.volume[p]))
                },
            )?;
            out
        }
        (Fault::MaterialScaled, Term::Material) => times(1.0 + 1e-6),
        (Fault::MaterialSecondGradients, Term::Material) => {
            pairs(eq, dphi, u, |law, at, _, j, u| at.f * law.tangent_density(at, j, j) * at.f.transpose() * u)?
        }
        (Fault::MaterialF, Term::Material) => {
            pairs(eq, dphi, u, |law, at, i, j, u| at.f * law.tangent_density(at, i, j) * at.f * u)?
        }
        (Fault::MaterialSwapped, Term::Material) => {
            pairs(eq, dphi, u, |law, at, i, j, u| at.f * law.tangent_density(at, j, i) * at.f.transpose() * u)?
        }
        (Fault::MaterialAsPrinted, Term::Material) => {
            pairs(eq, dphi, u, |law, at, i, j, u| at.f * law.tangent_density(at, j, i) * at.f * u)?
        }
        (Fault::PressureSign, Term::Pressure) => times(-1.0),
        (Fault::PressureHalf | Fault::PressureTransposed, Term::Pressure) => {
            let states = states(eq, dphi)?;
            let mut out = vec![Vector::zeros(); u.len()];
            for point in &eq.pressures {
                // δ(cof F N) = (A:L) w − A Lᵀ w with A = ΔF⁻ᵀ
                let p = point.particle;
                let f_inv_t = states[p].inverse_transpose();
                let w = f_inv_t * point.force * states[p].jacobian;
                let l = eq.supports.gradient_at(p, u);
                let delta = if fault == Fault::PressureHalf {
                    w * contract(&(f_inv_t * f_n(p).transpose()), &l)
                } else {
                    let a = f_inv_t.transpose() * f_n(p).transpose();
                    w * contract(&a, &l) - a * (l.transpose() * w)
                };
                for (node, n, _) in eq.supports.of(p) {
                    out[node] += delta * n;
                }
            }
            out
        }
        _ => right,
    })
}

/// α₁ [lumped · lumped(M) + consistent · M] u
fn inertia<const D: usize, L: Law>(
    eq: &Equilibrium<'_, D, L>,
    u: &[Vector<f64, D>],
    lumped: f64,
    consistent: f64,
) -> Field<D> {
    let a1 = eq.alphas.a1;
    let mut out: Field<D> = u.iter().zip(&eq.nodal.mass).map(|(u, m)| u * (a1 * lumped * m)).collect();
    let at_particles = eq.supports.values(u);
    eq.supports.scatter(&mut out, |p, n, _| at_particles[p] * (a1 * consistent * eq.particles.mass[p] * n));
    out
}

/// Σ_p V₀ Σ_J force(GRAD N^I, GRAD N^J, u_J) on every node I.
fn pairs<const D: usize, L: Law>(
    eq: &Equilibrium<'_, D, L>,
    dphi: &[Vector<f64, D>],
    u: &[Vector<f64, D>],
    force: impl Fn(&L, &Deformation<f64, D>, &Vector<f64, D>, &Vector<f64, D>, &Vector<f64, D>) -> Vector<f64, D>,
) -> Result<Field<D>, Inadmissible> {
    let mut out = vec![Vector::zeros(); u.len()];
    for (p, at) in states(eq, dphi)?.iter().enumerate() {
        let f_n_t = (identity::<f64, D>() + eq.particles.displacement_gradient[p]).transpose();
        let nodes: Vec<(usize, Vector<f64, D>)> =
            eq.supports.of(p).map(|(node, _, grad_n)| (node, f_n_t * grad_n)).collect();
        for (i, grad_i) in &nodes {
            for (j, grad_j) in &nodes {
                out[*i] += force(eq.law(p), at, grad_i, grad_j, &u[*j]) * eq.particles.volume[p];
            }
        }
    }
    Ok(out)
}

/// R with the fault, where it concerns R.
fn residual<const D: usize, L: Law>(
    fault: Fault,
    eq: &Equilibrium<'_, D, L>,
    dphi: &[Vector<f64, D>],
) -> Result<Field<D>, Inadmissible> {
    let mut r = eq.residual::<f64>(dphi, Carry::ALL)?;
    match fault {
        Fault::ResidualWithoutInertia => {
            for (node, r) in r.iter_mut().enumerate() {
                let (v, a) = (eq.nodal.velocity[node], eq.nodal.acceleration[node]);
                let acceleration = (dphi[node] - eq.alphas.predicted(&v, &a)) * eq.alphas.a1;
                *r -= acceleration * (eq.lumping * eq.nodal.mass[node]);
            }
        }
        Fault::ResidualTractionSign => r.iter_mut().zip(&eq.dead_load).for_each(|(r, load)| *r += load * 2.0),
        Fault::ResidualTractionArea => r.iter_mut().zip(&eq.dead_load).for_each(|(r, load)| *r -= load * 0.01),
        Fault::ResidualNotPulledBack | Fault::ResidualTransposed => {
            let states = states(eq, dphi)?;
            let mut change: Field<D> = vec![Vector::zeros(); r.len()];
            let at_particles: Vec<Tensor<f64, D>> = (states.iter().enumerate())
                .map(|(p, at)| {
                    let piola = first_piola(eq.law(p), &at.f, at.h).map_err(|source| Inadmissible { particle: eq.particles.id[p] as usize, source })?;
                    let f_n_t = (identity::<f64, D>() + eq.particles.displacement_gradient[p]).transpose();
                    let wrong = match fault {
                        Fault::ResidualNotPulledBack => piola,
                        _ => eq.law(p).stress(at) * at.f * f_n_t,
                    };
                    Ok((wrong - piola * f_n_t) * eq.particles.volume[p])
                })
                .collect::<Result<_, Inadmissible>>()?;
            eq.supports.scatter(&mut change, |p, _, grad_n| at_particles[p] * grad_n);
            r.iter_mut().zip(&change).for_each(|(r, change)| *r += change);
        }
        _ => {}
    }
    Ok(r)
}

/// The deformation of every particle at Δφ.
fn states<const D: usize, L: Law>(
    eq: &Equilibrium<'_, D, L>,
    dphi: &[Vector<f64, D>],
) -> Result<Vec<Deformation<f64, D>>, Inadmissible> {
    eq.supports.interpolate(dphi, |p, _, g| {
        admissible(compose(&g, &eq.particles.displacement_gradient[p])).map_err(|source| Inadmissible { particle: eq.particles.id[p] as usize, source })
    })
}

fn seeded<const D: usize>(dphi: &[Vector<f64, D>], u: &[Vector<f64, D>]) -> Vec<Vector<Dual64, D>> {
    dphi.iter().zip(u).map(|(x, d)| x.zip_map(d, Dual64::new)).collect()
}

fn difference<const D: usize>(a: &[Vector<f64, D>], b: &[Vector<f64, D>]) -> Field<D> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn norm<const D: usize>(a: &[Vector<f64, D>]) -> f64 {
    a.iter().map(Vector::norm_squared).sum::<f64>().sqrt()
}
