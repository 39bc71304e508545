//! The tangent of a whole step against dual numbers, term by term.

use super::regime::{condition, round_off};
use crate::prepared::Prepared;
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::approximation::ShapeFunction;
use bfree::material::Law;
use bfree::mechanics::residual::{Carry, Equilibrium, Inadmissible, compose};
use bfree::mechanics::tangent::Term;
use bfree::simulation::Simulation;
use bfree::tensor::{Vector, identity};
use num_dual::Dual64;

/// Random directions at each state.
const DIRECTIONS: usize = 3;

/// Nodes whose diagonal block is compared.
const BLOCKS: usize = 24;

/// Halvings of an increment until it is admissible.
const HALVINGS: u32 = 30;

/// Name of a term in reports.
pub(crate) fn term_name(term: Term) -> &'static str {
    match term {
        Term::Inertia => "inertia",
        Term::Geometric => "geometric",
        Term::Material => "material",
        Term::Pressure => "follower pressure",
    }
}

/// Checks the tangent of the coming step of a simulation: every term and the whole product against dual numbers through the
/// residual, the blocks of the preconditioner against the product, and, where every load has a potential, symmetry and the
/// residual against the gradient of the potential. Labels are (quantity, Δφ).
///
/// The Δφ are zero, Δt v_n, and a random one of a hundredth of the spacing, shortened until no particle is crushed.
pub fn check_tangent<const D: usize, L: Law, A: ShapeFunction>(simulation: &Simulation<D, L, A>) -> Report {
    let mut report = Report::new("tangent of the coming step", &["quantity", "increment"]);
    let prepared = match Prepared::new(simulation) {
        Ok(prepared) => prepared,
        Err(error) => {
            report.push_error(&["setting up", "-"], &error);
            return report;
        }
    };
    let equilibrium = prepared.equilibrium(simulation);
    let mut random = Random::new(7);
    let count = prepared.nodes.len();
    let size = 0.01 * simulation.grid.spacing;
    let dt = simulation.clock.step();
    let mut increments = vec![
        ("zero", vec![Vector::zeros(); count]),
        ("random", random.field(count).iter().map(|x: &Vector<f64, D>| x * size).collect()),
    ];
    if !prepared.nodal.is_static() {
        increments.push(("dt v_n", prepared.nodal.velocity.iter().map(|v| v * dt).collect()));
    }
    for (name, mut dphi) in increments {
        prepared.prescribe(&mut dphi);
        let mut halvings = 0;
        while halvings < HALVINGS && equilibrium.residual::<f64>(&dphi, Carry::ALL).is_err() {
            dphi.iter_mut().for_each(|x| *x *= 0.5);
            halvings += 1;
        }
        match measure(&equilibrium, &dphi, simulation.grid.spacing, &mut random) {
            Ok(measured) => {
                for Measured { quantity, value, bound } in measured {
                    report.push(&[quantity, name], value, bound);
                }
            }
            Err(error) => report.push_error(&["residual", name], &error),
        }
    }
    report
}

/// One measured value.
pub(crate) struct Measured {
    pub quantity: &'static str,
    pub value: f64,
    pub bound: Bound,
}

/// The name of the asymmetry of the follower pressure.
pub(crate) const PRESSURE_ASYMMETRY: &str = "pressure: u.Kw - w.Ku";

/// Everything that can be asked of the tangent at one Δφ.
pub(crate) fn measure<const D: usize, L: Law>(
    equilibrium: &Equilibrium<'_, D, L>,
    dphi: &[Vector<f64, D>],
    spacing: f64,
    random: &mut Random,
) -> Result<Vec<Measured>, Inadmissible> {
    let bound = Bound::AtMost(round_off(worst_condition(equilibrium, dphi)));
    let tangent = equilibrium.tangent(dphi)?;
    let with_pressure = !equilibrium.pressures.is_empty();
    let directions: Vec<Vec<Vector<f64, D>>> = (0..DIRECTIONS)
        .map(|_| {
            let mut u = random.field(dphi.len());
            equilibrium.clear_prescribed(&mut u);
            u
        })
        .collect();
    let product = |u: &[Vector<f64, D>]| {
        let mut out = vec![Vector::zeros(); u.len()];
        tangent.product(u, &mut out);
        out
    };
    let mut measured = Vec::new();

    for term in Term::ALL {
        if term == Term::Pressure && !with_pressure {
            continue;
        }
        let mut value: f64 = 0.0;
        for u in &directions {
            let analytic = equilibrium.product(term, dphi, u)?;
            let mut scale = norm(&analytic);
            if term == Term::Pressure && D == 1 {
                // cof F = 1: the pressure is a dead load and its two parts cancel.
                scale = equilibrium.pressures.iter().map(|p| p.force.norm()).sum::<f64>() * norm(u) / spacing;
            }
            value = worse(value, relative(&analytic, &equilibrium.dual_product(term, dphi, u)?, scale));
        }
        measured.push(Measured { quantity: term_name(term), value, bound });
    }

    let mut value: f64 = 0.0;
    for u in &directions {
        let seeded: Vec<_> = dphi.iter().zip(u).map(|(x, d)| x.zip_map(d, Dual64::new)).collect();
        let residual = equilibrium.residual(&seeded, Carry::ALL)?;
        let mut dual: Vec<_> = residual.iter().map(|r| r.map(|x| x.eps)).collect();
        equilibrium.clear_prescribed(&mut dual);
        let frozen = product(u);
        value = worse(value, relative(&frozen, &dual, norm(&frozen)));
    }
    measured.push(Measured { quantity: "whole product", value, bound });

    let blocks = tangent.diagonal_blocks();
    let mut value: f64 = 0.0;
    for node in (0..dphi.len()).step_by(dphi.len().div_ceil(BLOCKS).max(1)) {
        let held = |i: usize| equilibrium.prescribed.iter().any(|dof| dof.node == node && dof.component == i);
        for k in (0..D).filter(|&k| !held(k)) {
            let mut unit = vec![Vector::zeros(); dphi.len()];
            unit[node][k] = 1.0;
            let difference = product(&unit)[node] - blocks[node].column(k);
            let size = blocks[node].norm();
            value = worse(value, if difference.norm() == 0.0 { 0.0 } else { difference.norm() / size });
        }
    }
    measured.push(Measured { quantity: "diagonal blocks", value, bound });

    if with_pressure {
        if D > 1 {
            let products = directions.iter().map(|u| equilibrium.product(Term::Pressure, dphi, u));
            let value = asymmetry(&directions, &products.collect::<Result<Vec<_>, _>>()?);
            measured.push(Measured { quantity: PRESSURE_ASYMMETRY, value, bound: Bound::Reported });
        }
        return Ok(measured);
    }
    let products: Vec<_> = directions.iter().map(|u| product(u)).collect();
    measured.push(Measured { quantity: "u.Kw - w.Ku", value: asymmetry(&directions, &products), bound });

    let residual = equilibrium.residual::<f64>(dphi, Carry::ALL)?;
    let scale = equilibrium.magnitude(dphi)?;
    let mut value: f64 = 0.0;
    for u in &directions {
        let seeded: Vec<_> = dphi.iter().zip(u).map(|(x, d)| x.zip_map(d, Dual64::new)).collect();
        if let Some(potential) = equilibrium.potential(&seeded) {
            let difference = (potential?.0.eps - dot(&residual, u)).abs();
            value = worse(value, if difference == 0.0 { 0.0 } else { difference / (scale * norm(u)) });
        }
    }
    measured.push(Measured { quantity: "dual(Pi) - R.u", value, bound });
    Ok(measured)
}

/// |u·Kw − w·Ku| / (‖u‖ ‖Kw‖), the largest of all pairs of directions.
fn asymmetry<const D: usize>(directions: &[Vec<Vector<f64, D>>], products: &[Vec<Vector<f64, D>>]) -> f64 {
    let all: Vec<_> = directions.iter().zip(products).collect();
    let mut value: f64 = 0.0;
    for (k, (u, k_u)) in all.iter().enumerate() {
        for (w, k_w) in &all[..k] {
            let difference = (dot(u, k_w) - dot(w, k_u)).abs();
            let scale = (norm(u) * norm(k_w)).max(norm(w) * norm(k_u));
            value = worse(value, if difference == 0.0 { 0.0 } else { difference / scale });
        }
    }
    value
}

/// The larger one, and NaN if either is.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// The largest κ(F) of all particles.
fn worst_condition<const D: usize, L: Law>(equilibrium: &Equilibrium<'_, D, L>, dphi: &[Vector<f64, D>]) -> f64 {
    let particles = equilibrium.particles;
    (0..particles.len()).fold(1.0, |worst: f64, p| {
        let g = equilibrium.supports.gradient_at(p, dphi);
        worst.max(condition(&(identity::<f64, D>() + compose(&g, &particles.displacement_gradient[p]))))
    })
}

/// ‖a − b‖ / scale, zero where both are zero.
fn relative<const D: usize>(a: &[Vector<f64, D>], b: &[Vector<f64, D>], scale: f64) -> f64 {
    let difference = a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt();
    if difference == 0.0 { 0.0 } else { difference / scale }
}

fn norm<const D: usize>(a: &[Vector<f64, D>]) -> f64 {
    a.iter().map(Vector::norm_squared).sum::<f64>().sqrt()
}

fn dot<const D: usize>(a: &[Vector<f64, D>], b: &[Vector<f64, D>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}
