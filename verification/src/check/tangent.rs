//! The tangent of a whole step against dual numbers, piece by piece, through the products that the solver applies.

use super::regime::{condition, round_off};
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::approximation::ShapeFunction;
use bfree::material::Law;
use bfree::mechanics::residual::{Equilibrium, Inadmissible, compose};
use bfree::mechanics::tangent::Tangent;
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector, identity};
use num_dual::Dual64;
use std::collections::HashSet;

/// Random directions at each state.
const DIRECTIONS: usize = 3;

/// Nodes whose diagonal block is compared.
const BLOCKS: usize = 24;

/// The most halvings of an increment until it is admissible.
const HALVINGS: u32 = 30;

/// The piece whose tangent is not symmetric.
const PRESSURE: &str = "follower pressure";

/// Checks the tangent of the next step of a simulation. Every piece, linearised alone, and the whole tangent are compared with dual numbers
/// through the residual, by the solver's product. The blocks of the preconditioner are compared with the product. If symmetry and a
/// potential exist, symmetry is checked, and the residual against the gradient of the potential. Labels are (quantity, Δφ).
///
/// The Δφ are zero, Δt v_n, and a random one of a hundredth of the spacing, shortened until no particle has det F ≤ 0.
pub fn check_tangent<const D: usize, L: Law + Clone, A: ShapeFunction + Clone>(
    simulation: &Simulation<D, L, A>,
) -> Report {
    let mut report = Report::new("tangent of the coming step", &["quantity", "increment"]);
    let coming = match simulation.next_step() {
        Ok(coming) => coming,
        Err(error) => {
            report.push_error(&["setting up", "-"], &error);
            return report;
        }
    };
    let equilibrium = coming.equilibrium();
    let mut random = Random::new(7);
    let count = coming.nodes().len();
    let size = 0.01 * simulation.grid.spacing;
    let dt = simulation.clock.step();
    let mut increments = vec![
        ("zero", vec![Vector::zeros(); count]),
        ("random", random.field(count).iter().map(|x: &Vector<f64, D>| x * size).collect()),
    ];
    if !coming.nodal().is_static() {
        increments.push(("dt v_n", coming.nodal().velocity.iter().map(|v| v * dt).collect()));
    }
    for (name, mut dphi) in increments {
        coming.prescribe(&mut dphi);
        let mut halvings = 0;
        while halvings < HALVINGS && equilibrium.residual::<f64>(&dphi).is_err() {
            dphi.iter_mut().for_each(|x| *x *= 0.5);
            halvings += 1;
        }
        match measure(&equilibrium, &dphi, &mut random) {
            Ok(measured) => {
                for Measured { quantity, value, bound } in measured {
                    report.push(&[&quantity, name], value, bound);
                }
            }
            Err(error) => report.push_error(&["residual", name], &error),
        }
    }
    report
}

/// One measured value.
pub(crate) struct Measured {
    pub quantity: String,
    pub value: f64,
    pub bound: Bound,
}

impl Measured {
    fn new(quantity: impl Into<String>, value: f64, bound: Bound) -> Self {
        Self { quantity: quantity.into(), value, bound }
    }
}

/// The name of the entry for the asymmetry of the follower pressure.
pub(crate) const PRESSURE_ASYMMETRY: &str = "pressure: u.Kw - w.Ku";

/// The name of the entry for the symmetry of the whole tangent.
pub(crate) const SYMMETRY: &str = "u.Kw - w.Ku";

/// The name of the entry for the residual against the potential.
pub(crate) const POTENTIAL: &str = "dual(Pi) - R.u";

/// All measurements of the tangent at one Δφ.
pub(crate) fn measure<const D: usize, L: Law>(
    equilibrium: &Equilibrium<'_, D, L>,
    dphi: &[Vector<f64, D>],
    random: &mut Random,
) -> Result<Vec<Measured>, Inadmissible> {
    let bound = Bound::AtMost(round_off(worst_condition(equilibrium, dphi)));
    let directions: Vec<Field<D>> = (0..DIRECTIONS)
        .map(|_| {
            let mut u = random.field(dphi.len());
            equilibrium.clear_prescribed(&mut u);
            u
        })
        .collect();
    let Pieces { mut measured, sizes, largest } = measure_pieces(equilibrium, dphi, &directions, bound)?;
    let tangent = equilibrium.tangent(None, dphi)?;
    let mut worst: f64 = 0.0;
    for (u, largest) in directions.iter().zip(largest) {
        let residual = equilibrium.residual(&seeded(dphi, u))?;
        let mut dual: Field<D> = residual.iter().map(|r| r.map(|x| x.eps)).collect();
        equilibrium.clear_prescribed(&mut dual);
        let analytic = product(&tangent, u);
        worst = worse(worst, relative(&analytic, &dual, norm(&analytic).max(largest)));
    }
    measured.push(Measured::new("whole product", worst, bound));
    let columns = columns(equilibrium, &tangent, dphi.len());
    measured.push(Measured::new("diagonal blocks", apart(&tangent.diagonal_blocks(), &columns, &sizes), bound));

    if equilibrium.is_symmetric() {
        let products: Vec<_> = directions.iter().map(|u| product(&tangent, u)).collect();
        measured.push(Measured::new(SYMMETRY, asymmetry(&directions, &products), bound));
    }
    let residual = equilibrium.residual::<f64>(dphi)?;
    let size = equilibrium.magnitude(dphi)?;
    let mut value: Option<f64> = None;
    for u in &directions {
        if let Some(potential) = equilibrium.potential(&seeded(dphi, u)) {
            let difference = (potential?.0.eps - dot(&residual, u)).abs();
            let relative = if difference == 0.0 { 0.0 } else { difference / (size * norm(u)) };
            value = Some(worse(value.unwrap_or(0.0), relative));
        }
    }
    measured.extend(value.map(|value| Measured::new(POTENTIAL, value, bound)));
    Ok(measured)
}

/// Each piece alone against the derivative of its residual. Terms may cancel, so the round-off of their sum is relative to the parts.
struct Pieces {
    measured: Vec<Measured>,
    /// The sum of the norms of all parts of each diagonal block.
    sizes: Vec<f64>,
    /// The largest product of a piece in each direction.
    largest: Vec<f64>,
}

fn measure_pieces<const D: usize, L: Law>(
    equilibrium: &Equilibrium<'_, D, L>,
    dphi: &[Vector<f64, D>],
    directions: &[Field<D>],
    bound: Bound,
) -> Result<Pieces, Inadmissible> {
    let (mut measured, mut sizes, mut largest) = (Vec::new(), vec![0.0; dphi.len()], vec![0.0_f64; directions.len()]);
    let pieces = equilibrium.terms.pieces();
    for &piece in &pieces {
        let frozen = equilibrium.tangent(piece, dphi)?;
        if piece.name != piece.term || pieces.iter().filter(|other| other.term == piece.term).count() == 1 {
            sizes.iter_mut().zip(frozen.diagonal_blocks().iter()).for_each(|(size, block)| *size += block.norm());
        }
        let mut worst: f64 = 0.0;
        let mut products = Vec::new();
        for (u, largest) in directions.iter().zip(&mut largest) {
            let mut dual = equilibrium.derivative(piece, dphi, u)?;
            equilibrium.clear_prescribed(&mut dual);
            let analytic = product(&frozen, u);
            worst = worse(worst, relative(&analytic, &dual, norm(&analytic)));
            *largest = largest.max(norm(&analytic));
            products.push(analytic);
        }
        measured.push(Measured::new(piece.name, worst, bound));
        if piece.name == PRESSURE && D > 1 {
            measured.push(Measured::new(PRESSURE_ASYMMETRY, asymmetry(directions, &products), Bound::Reported));
        }
    }
    Ok(Pieces { measured, sizes, largest })
}

type Field<const D: usize> = Vec<Vector<f64, D>>;

fn product<const D: usize>(tangent: &Tangent<'_, D>, u: &[Vector<f64, D>]) -> Field<D> {
    let mut out = vec![Vector::zeros(); u.len()];
    tangent.solver_product(u, &mut out);
    out
}

/// Columns (node, component, K_II e_k) of some diagonal blocks, by products with unit vectors.
fn columns<const D: usize, L>(
    equilibrium: &Equilibrium<'_, D, L>,
    tangent: &Tangent<'_, D>,
    nodes: usize,
) -> Vec<(usize, usize, Vector<f64, D>)> {
    let held = |node, k| equilibrium.prescribed.iter().any(|dof| dof.node == node && dof.component == k);
    // A node that follows others is no unknown: its block is the identity, and its product vanishes.
    let extension = equilibrium.step.connectivity.extension();
    let followers: HashSet<usize> = extension.into_iter().flat_map(|all| all.rows().map(|(outer, _)| outer)).collect();
    let unknown = |node: &usize| !followers.contains(node);
    let mut columns = Vec::new();
    for node in (0..nodes).step_by(nodes.div_ceil(BLOCKS).max(1)).filter(unknown) {
        for k in (0..D).filter(|&k| !held(node, k)) {
            let mut unit = vec![Vector::zeros(); nodes];
            unit[node][k] = 1.0;
            columns.push((node, k, product(tangent, &unit)[node]));
        }
    }
    columns
}

/// The largest difference between blocks and their columns, relative to their sizes.
fn apart<const D: usize>(blocks: &[Tensor<f64, D>], columns: &[(usize, usize, Vector<f64, D>)], sizes: &[f64]) -> f64 {
    columns.iter().fold(0.0, |value, (node, k, column)| {
        let difference = (column - blocks[*node].column(*k)).norm();
        worse(value, if difference == 0.0 { 0.0 } else { difference / sizes[*node] })
    })
}

/// Δφ + ε u
fn seeded<const D: usize>(dphi: &[Vector<f64, D>], u: &[Vector<f64, D>]) -> Vec<Vector<Dual64, D>> {
    dphi.iter().zip(u).map(|(x, d)| x.zip_map(d, Dual64::new)).collect()
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

/// The larger number, or NaN if either is NaN.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// The largest κ(F) of all particles.
fn worst_condition<const D: usize, L: Law>(equilibrium: &Equilibrium<'_, D, L>, dphi: &[Vector<f64, D>]) -> f64 {
    let particles = equilibrium.step.particles;
    (0..particles.len()).fold(1.0, |worst: f64, p| {
        let g = equilibrium.step.connectivity.gradient_at(p, dphi);
        worst.max(condition(&(identity::<f64, D>() + compose(&g, &particles.displacement_gradient[p]))))
    })
}

/// ‖a − b‖ / scale; zero if both vectors are zero.
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
