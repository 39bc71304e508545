//! A shape function against its required properties: consistency, gradients, the trace at walls.

use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::approximation::{ApproximationError, Scratch, ShapeFunction, Support};
use bfree::grid::Grid;
use bfree::tensor::{Tensor, Vector, identity};

/// Cells along each axis of the grid.
const CELLS: u32 = 7;

/// Number of points tried at each kind of position.
const TRIES: usize = 12;

/// Step of the finite differences over the spacing.
const STEP: f64 = 1e-6;

/// Consistency: sums of a few dozen terms of size one.
const CONSISTENCY: f64 = 1e-12;

/// Differences of step δ h and fourth order: δ⁴ of truncation, and eps/δ of round-off times some tens.
const DIFFERENCES: f64 = 1e-8;

/// The position of a point relative to the nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Inside,
    NearWall,
    Face,
    Node,
    Wall,
    Corner,
}

impl Place {
    const ALL: [(Self, &'static str); 6] = [
        (Self::Inside, "inside a cell"),
        (Self::NearWall, "near a wall"),
        (Self::Face, "on a face"),
        (Self::Node, "on a node"),
        (Self::Wall, "on a wall"),
        (Self::Corner, "in a corner"),
    ];

    /// A point, in units of the spacing; `k` numbers the tries.
    fn point<const D: usize>(self, k: usize, random: &mut Random) -> Vector<f64, D> {
        let last = f64::from(CELLS);
        let mut x = Vector::<f64, D>::from_fn(|_, _| random.between(0.0, last));
        let (axis, upper) = (k % D, (k / D).is_multiple_of(2));
        let wall = |depth: f64| if upper { last - depth } else { depth };
        match self {
            Self::Inside => {}
            Self::NearWall => x[axis] = wall(10.0_f64.powf(random.between(-8.0, 0.0))),
            Self::Face => x[axis] = x[axis].floor(),
            Self::Node => x.apply(|x| *x = x.floor()),
            Self::Wall => x[axis] = wall(0.0),
            Self::Corner => x = Vector::from_fn(|i, _| if (k >> i).is_multiple_of(2) { 0.0 } else { last }),
        }
        x
    }
}

/// Checks a shape function in 1, 2 and 3 dimensions: partition of unity, first-order consistency, their gradients, and ∇N against
/// differences of N. On a wall only the nodes of the wall may have N ≠ 0. Lengths are in units of the spacing, which is not 1.
/// Labels are (quantity, D, place).
///
/// ∇N is compared only where the same nodes are listed on both sides, which excludes the kinks of piecewise functions.
pub fn check_approximation<A: ShapeFunction>(shape: &A) -> Report {
    let mut report = Report::new("shape function", &["quantity", "D", "place"]);
    dimension::<A, 1>(shape, &mut report);
    dimension::<A, 2>(shape, &mut report);
    dimension::<A, 3>(shape, &mut report);
    report
}

fn dimension<A: ShapeFunction, const D: usize>(shape: &A, report: &mut Report) {
    let dimension = D.to_string();
    if let Err(error) = shape.validate(D) {
        report.push_error(&["parameters", &dimension, "-"], &error);
        return;
    }
    // Powers of two: positions on nodes are exact.
    let grid = Grid { origin: Vector::from_fn(|k, _| k as f64 - 1.0), spacing: 0.25, cells: [CELLS; D] };
    for (place, name) in Place::ALL {
        let mut random = Random::new(5);
        let mut worst: [f64; QUANTITIES.len()] = [0.0; QUANTITIES.len()];
        let mut measure = || -> Result<(), ApproximationError> {
            for k in 0..TRIES {
                let x = grid.origin + place.point(k, &mut random) * grid.spacing;
                for (worst, value) in worst.iter_mut().zip(quantities(shape, &grid, &x)?) {
                    if value > *worst || value.is_nan() {
                        *worst = value;
                    }
                }
            }
            Ok(())
        };
        if let Err(error) = measure() {
            report.push_error(&["evaluation", &dimension, name], &error);
            continue;
        }
        for (&(quantity, bound), value) in QUANTITIES.iter().zip(worst) {
            report.push(&[quantity, &dimension, name], value, Bound::AtMost(bound));
        }
    }
}

const QUANTITIES: [(&str, f64); 6] = [
    ("sum N = 1", CONSISTENCY),
    ("sum N x_I = x", CONSISTENCY),
    ("sum grad N = 0", CONSISTENCY),
    ("sum x_I grad N = I", CONSISTENCY),
    ("grad N against differences", DIFFERENCES),
    ("N = 0 off the wall", CONSISTENCY),
];

fn quantities<A: ShapeFunction, const D: usize>(
    shape: &A,
    grid: &Grid<D>,
    x: &Vector<f64, D>,
) -> Result<[f64; QUANTITIES.len()], ApproximationError> {
    let at = evaluate(shape, grid, x)?;
    let (mut sum, mut first) = (-1.0, Vector::<f64, D>::zeros());
    let (mut gradient, mut first_gradient) = (Vector::<f64, D>::zeros(), -identity::<f64, D>());
    let mut off_wall: f64 = 0.0;
    let walls: Vec<(usize, u32)> = (0..D)
        .filter_map(|k| {
            let local = (x[k] - grid.origin[k]) / grid.spacing;
            let on = local == 0.0 || local == f64::from(CELLS);
            on.then_some((k, local as u32))
        })
        .collect();
    for ((&node, &n), grad_n) in at.nodes.iter().zip(&at.values).zip(&at.gradients) {
        let distance = (grid.position(node) - x) / grid.spacing;
        let grad_n = Vector::from(*grad_n) * grid.spacing;
        sum += n;
        first += distance * n;
        gradient += grad_n;
        first_gradient += distance * grad_n.transpose();
        if walls.iter().any(|&(k, wall)| node[k] != wall) {
            off_wall = off_wall.max(n.abs());
        }
    }
    let differences = differences(shape, grid, x, &at)?;
    Ok([sum.abs(), first.amax(), gradient.amax(), largest(&first_gradient), differences, off_wall])
}

/// The largest difference between ∇N and [8 N(x + δ) − 8 N(x − δ) − N(x + 2δ) + N(x − 2δ)]/12δ, in units of 1/h. An axis counts only if all
/// four points lie in the box and list the nodes that x lists.
fn differences<A: ShapeFunction, const D: usize>(
    shape: &A,
    grid: &Grid<D>,
    x: &Vector<f64, D>,
    at: &Support<D>,
) -> Result<f64, ApproximationError> {
    let mut worst: f64 = 0.0;
    for k in 0..D {
        let mut sums = vec![0.0; at.nodes.len()];
        let mut same = true;
        for (place, weight) in [(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)] {
            let mut beside = *x;
            beside[k] += place * STEP * grid.spacing;
            if !same || !grid.contains(&beside) {
                same = false;
                continue;
            }
            let support = evaluate(shape, grid, &beside)?;
            same = support.nodes == at.nodes;
            for (sum, value) in sums.iter_mut().zip(&support.values) {
                *sum += weight * value;
            }
        }
        if !same {
            continue;
        }
        for (gradient, sum) in at.gradients.iter().zip(sums) {
            let error = (gradient[k] * grid.spacing - sum / (12.0 * STEP)).abs();
            if error > worst || error.is_nan() {
                worst = error;
            }
        }
    }
    Ok(worst)
}

fn evaluate<A: ShapeFunction, const D: usize>(
    shape: &A,
    grid: &Grid<D>,
    x: &Vector<f64, D>,
) -> Result<Support<D>, ApproximationError> {
    let mut support = Support::default();
    shape.evaluate(grid, x, &mut Scratch::default(), &mut support)?;
    Ok(support)
}

fn largest<const D: usize>(a: &Tensor<f64, D>) -> f64 {
    a.iter().fold(0.0, |worst: f64, x| if x.abs() > worst || x.is_nan() { x.abs() } else { worst })
}
