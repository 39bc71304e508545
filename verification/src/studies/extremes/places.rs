//! Shape functions from γ̂ = 0.1 to 1e4 at particles on nodes, edges, corners and walls of the box, next to them, and just outside.

use super::{Report, refused, rows, solvable, worse};
use bfree::approximation::{Approximation, ApproximationError, Bspline, Gimp, Linear, Lme, LmeCircle, Scratch, ShapeFunction, Support};
use bfree::grid::Grid;
use bfree::tensor::{Tensor, Vector, identity, outer};

/// Round-off along each axis: a dozen roundings, and one for each node.
const ROUNDINGS: f64 = 12.0;

const SPACING: f64 = 0.5;

/// The number of cells fits γ̂ = 0.1, whose functions reach 12 nodes to each side.
const CELLS: u32 = 26;

/// The smallest distance from a position.
const TINY: f64 = 1e-300;

const GAMMAS: [f64; 9] = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 1e3, 1e4];

fn families() -> Vec<(String, Approximation)> {
    let mut families: Vec<(String, Approximation)> = vec![
        ("linear".into(), Linear.into()),
        ("gimp".into(), Gimp::particles_per_axis(2).into()),
        ("quadratic".into(), Bspline::Quadratic.into()),
        ("cubic".into(), Bspline::Cubic.into()),
    ];
    families.extend(GAMMAS.map(|gamma| (format!("LME {gamma}"), Lme::new(gamma, 1e-6).into())));
    families
}

/// Coordinates with their names. Tiny distances are measured from node 0, where numbers are that dense; elsewhere the next number is used.
fn places() -> [(&'static str, f64); 9] {
    let end = f64::from(CELLS) * SPACING;
    [
        ("on the hull", 0.0),
        ("1e-300 off the hull", TINY),
        ("1e-16 off the hull", 1e-16),
        ("in the first cell", 0.37 * SPACING),
        ("on a node", 12.0 * SPACING),
        ("an ulp below a node", (12.0 * SPACING).next_down()),
        ("in the middle", 12.5 * SPACING),
        ("an ulp below the end", end.next_down()),
        ("on the end", end),
    ]
}

pub(super) fn run() -> Report {
    let mut report = rows("shape functions: errors of sum N = 1, sum N x = x and of their gradients, over their sums of magnitudes");
    for (name, shape) in families() {
        dimension::<1>(&name, &shape, 0.0, &mut report);
        dimension::<2>(&name, &shape, 0.0, &mut report);
        dimension::<3>(&name, &shape, 0.0, &mut report);
    }
    for gamma in [0.3, 1.0, 3.0, 9.0] {
        let (name, circle) = (format!("LME on the circle {gamma}"), LmeCircle::new(gamma, 1e-6).into());
        // A point on a wall is evaluated slightly inside.
        dimension::<1>(&name, &circle, LmeCircle::INSET, &mut report);
        dimension::<2>(&name, &circle, LmeCircle::INSET, &mut report);
    }
    dimension::<3>("LME on the circle 3", &LmeCircle::new(3.0, 1e-6).into(), LmeCircle::INSET, &mut report);
    not_there::<1>(&mut report);
    not_there::<2>(&mut report);
    not_there::<3>(&mut report);
    no_such_shape(&mut report);
    report
}

fn grid<const D: usize>() -> Grid<D> {
    Grid { origin: Vector::zeros(), spacing: SPACING, cells: [CELLS; D] }
}

/// All positions along the first axis. The other coordinates are inside a cell, equal to the first (edges and corners), or on a node.
fn dimension<const D: usize>(name: &str, shape: &Approximation, inset: f64, report: &mut Report) {
    let wide = matches!(shape, Approximation::Lme(lme) if lme.gamma() < 1.0);
    for (place, x) in places() {
        let others: &[f64] = match D {
            1 => &[0.0],
            // Each position has a thousand nodes and more.
            3 if wide => &[x],
            _ => &[x, 5.3 * SPACING, 7.0 * SPACING],
        };
        let mut worst: Result<f64, ApproximationError> = Ok(0.0);
        let (mut nodes, mut moved) = (0, 0.0);
        for &other in others {
            let at = Vector::<f64, D>::from_fn(|k, _| if k == 0 { x } else { other });
            moved = worse(moved, at.map(onto_node).norm());
            let (mut scratch, mut support) = (Scratch::default(), Support::default());
            let errors = shape.evaluate(&grid(), &at, &mut scratch, &mut support).map(|()| errors(&at, &support));
            nodes = nodes.max(support.nodes.len());
            worst = worst.and_then(|worst| Ok(worse(worst, errors?)));
        }
        let along = (nodes as f64).powf(1.0 / D as f64);
        let bound = D as f64 * (ROUNDINGS + along) * f64::EPSILON + inset + moved;
        solvable(report, &format!("{name}, D = {D}"), place, worst, bound);
    }
}

/// The shift of `x`, in spacings: a point within 32 roundings of a node is treated as on the node (`Axis::local`).
fn onto_node(x: f64) -> f64 {
    let s = x / SPACING;
    let distance = (s - s.round()).abs();
    if distance <= 32.0 * f64::EPSILON * s { distance } else { 0.0 }
}

/// The largest error of ΣN = 1, Σ N D = 0, Σ ∇N = 0, Σ D ⊗ ∇N = −I, with D = x − x_I, each over the sum of its magnitudes.
fn errors<const D: usize>(x: &Vector<f64, D>, support: &Support<D>) -> f64 {
    let grid = grid::<D>();
    let (mut one, mut centre, mut zero, mut unit) = (-1.0, Vector::<f64, D>::zeros(), Vector::<f64, D>::zeros(), identity::<f64, D>());
    let (mut distance_size, mut gradient_size, mut unit_size) = (SPACING, 0.0, 1.0);
    for ((&node, &n), gradient) in support.nodes.iter().zip(&support.values).zip(&support.gradients) {
        let (d, g) = (x - grid.position(node), Vector::<f64, D>::from(*gradient));
        one += n;
        centre += d * n;
        zero += g;
        let product: Tensor<f64, D> = outer(&d, &g);
        unit += product;
        distance_size += n.abs() * d.norm();
        gradient_size += g.norm();
        unit_size += product.norm();
    }
    [one.abs(), centre.norm() / distance_size, zero.norm() / gradient_size, unit.norm() / unit_size].into_iter().fold(0.0, worse)
}

/// Particles outside the box.
fn not_there<const D: usize>(report: &mut Report) {
    let end = f64::from(CELLS) * SPACING;
    for (case, x) in [("1e-300 outside", -TINY), ("an ulp outside", end.next_up()), ("not a number", f64::NAN), ("infinite", f64::INFINITY)] {
        let (mut scratch, mut support) = (Scratch::default(), Support::default());
        let answers: Vec<_> = families()
            .into_iter()
            .map(|(_, shape)| shape)
            .chain([LmeCircle::new(3.0, 1e-6).into()])
            .map(|shape| {
                // The point is outside along the last axis only.
                let at = Vector::<f64, D>::from_fn(|k, _| if k == D - 1 { x } else { SPACING });
                shape.evaluate(&grid(), &at, &mut scratch, &mut support)
            })
            .collect();
        let expected = |error: &ApproximationError| matches!(error, ApproximationError::Outside { .. });
        refused(report, &format!("every family, D = {D}"), case, "Outside", answers, expected);
    }
}

/// Invalid parameters.
fn no_such_shape(report: &mut Report) {
    let (mut scratch, mut support) = (Scratch::default(), Support::default());
    let mut at_rest = |shape: Approximation| shape.evaluate(&grid::<2>(), &Vector::repeat(1.3), &mut scratch, &mut support);
    for gamma in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let answers = [at_rest(Lme::new(gamma, 1e-6).into()), at_rest(LmeCircle::new(gamma, 1e-6).into())];
        let expected = |error: &ApproximationError| matches!(error, ApproximationError::Parameter { .. });
        refused(report, "LME, both supports", &format!("gamma = {gamma}"), "Gamma", answers, expected);
    }
    for gamma in [30.0, 1e4] {
        let expected = |error: &ApproximationError| matches!(error, ApproximationError::SupportTooSmall { .. });
        let answers = [at_rest(LmeCircle::new(gamma, 1e-6).into())];
        refused(report, "LME on the circle, too few nodes", &format!("gamma = {gamma}"), "SupportTooSmall", answers, expected);
    }
}
