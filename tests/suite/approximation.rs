//! The properties that every shape function must have, for every family in 1, 2 and 3 dimensions.

use bfree::approximation::{
    Approximation, ApproximationError, AxisWeights, Bspline, Gimp, Linear, Lme, LmeCircle, NotAKnotBspline, Scratch,
    Separable, ShapeFunction, Support, Validate,
};
use bfree::grid::{Axis, Grid};
use bfree::mechanics::sweep::Connectivity;
use bfree::tensor::Vector;
use proptest::prelude::*;

const H: f64 = 0.5;

fn families(dimension: usize) -> Vec<Approximation> {
    let mut list: Vec<_> = Approximation::examples().into_iter().map(|(_, family)| family).collect();
    list.extend([0.5, 0.3, 0.01].map(|half_width| Gimp { half_width }.into()));
    list.extend([0.1, 4.0, 10.0].map(|gamma| Lme::new(gamma, 1e-6).into()));
    list.extend([0.4, 0.8, 4.0, 9.0, 11.0].map(|gamma| LmeCircle::new(gamma, 1e-6).into()));
    list.retain(|family| family.validate(dimension).is_ok());
    list
}

fn support<const D: usize>(
    family: &Approximation,
    grid: &Grid<D>,
    x: &Vector<f64, D>,
) -> Result<Support<D>, ApproximationError> {
    let mut found = Support::default();
    family.evaluate(grid, x, &mut Scratch::default(), &mut found)?;
    Ok(found)
}

/// The largest error in Σ N = 1, Σ N (x_I − x) = 0, Σ h∇N = 0, Σ (x_I − x) ⊗ ∇N = I, with lengths in units of h.
fn inconsistency<const D: usize>(grid: &Grid<D>, x: &Vector<f64, D>, found: &Support<D>) -> f64 {
    let mut errors = vec![found.values.iter().sum::<f64>() - 1.0];
    let arm = |i: usize, k: usize| (grid.position(found.nodes[i])[k] - x[k]) / grid.spacing;
    let all = 0..found.nodes.len();
    for k in 0..D {
        errors.push(all.clone().map(|i| found.values[i] * arm(i, k)).sum());
        errors.push(all.clone().map(|i| found.gradients[i][k] * grid.spacing).sum());
        for m in 0..D {
            let sum: f64 = all.clone().map(|i| arm(i, k) * found.gradients[i][m] * grid.spacing).sum();
            errors.push(sum - if k == m { 1.0 } else { 0.0 });
        }
    }
    errors.iter().map(|e| if e.is_nan() { f64::INFINITY } else { e.abs() }).fold(0.0, f64::max)
}

/// N of `node`, zero if it is not listed.
fn value<const D: usize>(found: &Support<D>, node: [u32; D]) -> f64 {
    found.nodes.iter().position(|&other| other == node).map_or(0.0, |i| found.values[i])
}

fn walls_have_the_limit<const D: usize>() {
    let grid = Grid::<D> { origin: Vector::zeros(), spacing: H, cells: [4; D] };
    for family in families(D) {
        for (wall, inward) in [(0.0, 1.0), (4.0 * H, -1.0)] {
            let mut x: Vector<f64, D> = Vector::repeat(0.71);
            x[0] = wall;
            let on_wall = support(&family, &grid, &x).expect("inside the box");
            let step = 1e-7 * H;
            x[0] = wall + inward * step;
            let inside = support(&family, &grid, &x).expect("inside the box");
            for (i, node) in on_wall.nodes.iter().enumerate() {
                let difference = inward * (value(&inside, *node) - on_wall.values[i]) / step;
                let error = H * (difference - on_wall.gradients[i][0]).abs();
                // For GIMP the curvature next to a wall is 2/l.
                assert!(error < 5e-5, "{D}D {family:?}: node {node:?} at the wall {wall}: {error:e}");
            }
        }
    }
}

#[test]
fn the_normal_derivative_at_a_wall_is_its_one_sided_limit() {
    walls_have_the_limit::<1>();
    walls_have_the_limit::<2>();
    walls_have_the_limit::<3>();
}

/// Splines reproduce x² and x³, with the coefficients x² − h²/4 and x³ − h² x; at the walls the coefficients are the values.
#[test]
fn splines_without_a_knot_at_walls_reproduce_polynomials_of_their_degree() {
    let axis = Axis { origin: 0.0, spacing: H, cells: 9 };
    let mut weights = AxisWeights::default();
    for (spline, degree, less) in [(Bspline::Quadratic, 2, 0.25 * H * H), (Bspline::Cubic, 3, H * H)] {
        let coefficient = |node: u32| {
            let x = f64::from(node) * H;
            x.powi(degree) - if node.is_multiple_of(axis.cells) { 0.0 } else { less * x.powi(degree - 2) }
        };
        for i in 0..=900 {
            let x = f64::from(i) * 0.01 * H;
            NotAKnotBspline(spline).axis(&axis, x, &mut weights).expect("on the axis");
            let sum = |list: &[f64]| (weights.first..).zip(list).map(|(node, n)| n * coefficient(node)).sum::<f64>();
            let (value, slope) = (sum(&weights.values), sum(&weights.derivatives));
            assert!((value - x.powi(degree)).abs() < 1e-12, "{spline:?} at {x}: {value}");
            assert!((slope - f64::from(degree) * x.powi(degree - 1)).abs() < 1e-11, "{spline:?} at {x}: {slope}");
        }
    }
}

#[test]
fn a_node_without_value_but_with_gradient_is_kept() {
    let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: H, cells: [4, 4] };
    // On a face of the cell: the two far nodes have N = 0 and a finite gradient.
    let on_face = support(&Linear.into(), &grid, &Vector::from([H, 0.6])).expect("inside the box");
    assert_eq!(on_face.nodes, [[1, 1], [2, 1], [1, 2], [2, 2]]);
    assert_eq!(on_face.values[1], 0.0);
    assert!((on_face.gradients[1][0] - 0.8 / H).abs() < 1e-14);
    // On a node, the node diagonally opposite has neither value nor gradient.
    let on_node = support(&Linear.into(), &grid, &Vector::from([H, H])).expect("inside the box");
    assert_eq!(on_node.nodes, [[1, 1], [2, 1], [1, 2]]);
}

/// A support that ends on a node up to round-off ends there. Such a node would have N ~ ε² and h|∇N| ~ ε, and nothing to hold it.
#[test]
fn round_off_does_not_decide_which_nodes_are_active() -> Result<(), Box<dyn std::error::Error>> {
    let families: [(Approximation, f64); 3] = [
        (Gimp::particles_per_axis(2).into(), 0.25),
        (Gimp::particles_per_axis(3).into(), 1.0 / 6.0),
        (Bspline::Quadratic.into(), 0.5),
    ];
    for (family, edge) in families {
        for origin in [0.0, -7.0 * 0.3, 1000.1] {
            let grid = Grid { origin: Vector::from([origin]), spacing: 0.3, cells: [9] };
            for place in [edge, 1.0 - edge] {
                let x = origin + (4.0 + place) * grid.spacing;
                let count = |by: f64| -> Result<usize, Box<dyn std::error::Error>> {
                    let positions = [Vector::from([x + by * x.abs().max(1.0) * f64::EPSILON])];
                    let (connectivity, nodes) = Connectivity::new(&family, &grid, &positions)?;
                    assert!(connectivity.of(0).all(|(_, n, _)| n.abs() > 1e-3), "{family:?}, {origin}, {place}, {by}");
                    assert_eq!(support(&family, &grid, &positions[0])?.nodes.len(), nodes.len());
                    Ok(nodes.len())
                };
                assert_eq!([-4.0, -1.0, 0.0, 1.0, 4.0].map(count).into_iter().collect::<Result<Vec<_>, _>>()?, [2; 5]);
            }
        }
    }
    Ok(())
}

#[test]
fn box_and_circle_differ_by_the_truncation() {
    let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: H, cells: [12, 12] };
    for (gamma, bound) in [(0.8, 1e-6), (1.8, 5e-6), (4.0, 4e-5)] {
        let mut largest: f64 = 0.0;
        for i in 0..400_u32 {
            let x = Vector::from([0.618_034 * f64::from(i) % 1.0 * 6.0, 0.754_878 * f64::from(i) % 1.0 * 6.0]);
            let on_box = support(&Lme::new(gamma, 1e-6).into(), &grid, &x).expect("inside the box");
            let on_circle = support(&LmeCircle::new(gamma, 1e-6).into(), &grid, &x).expect("inside the box");
            for (node, n) in on_box.nodes.iter().zip(&on_box.values) {
                largest = largest.max((n - value(&on_circle, *node)).abs());
            }
        }
        println!("γ {gamma}: {largest:.1e}");
        assert!(largest < bound && largest > 0.05 * bound, "γ {gamma}: {largest:e}");
    }
}

#[test]
fn no_axis_is_wider_than_announced() {
    let axis = Grid { origin: Vector::from([0.0]), spacing: 1.0, cells: [40] }.axis(0);
    for family in families(1) {
        let Some(separable) = family.separable() else { continue };
        let mut weights = AxisWeights::default();
        let mut widest = 0;
        for i in 0..=4000 {
            separable.axis(&axis, f64::from(i) * 0.01, &mut weights).expect("on the axis");
            widest = widest.max(weights.values.len());
        }
        assert_eq!(widest, separable.width(), "{family:?}");
    }
}

#[test]
fn outside_the_box_is_an_error_that_names_it() {
    let grid = Grid { origin: Vector::from([0.0, 1.0]), spacing: H, cells: [4, 2] };
    for family in families(2) {
        for x in [[-1e-300, 1.5], [0.3, 2.0_f64.next_up()], [-1e-9, 1.5], [f64::NAN, 1.5], [0.3, f64::INFINITY]] {
            match support(&family, &grid, &Vector::from(x)) {
                Err(ApproximationError::Outside { position, lower, upper }) => {
                    assert_eq!(position[1].to_bits(), x[1].to_bits());
                    assert_eq!((lower, upper), (vec![0.0, 1.0], vec![2.0, 2.0]));
                }
                other => panic!("{family:?} at {x:?}: {other:?}"),
            }
        }
        let empty = Grid { cells: [0, 2], ..grid };
        assert!(matches!(
            support(&family, &empty, &Vector::from([0.0, 1.5])),
            Err(ApproximationError::Grid { cells: 0, .. })
        ));
    }
}

#[test]
fn impossible_parameters_are_refused() {
    let refused = |answer: Result<(), ApproximationError>, name: &str| {
        assert!(matches!(answer, Err(ApproximationError::Parameter { parameter, .. }) if parameter == name));
    };
    for gamma in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        refused(Lme::new(gamma, 1e-6).validate(2), "the locality γ of max-ent");
        refused(LmeCircle::new(gamma, 1e-6).validate(2), "the locality γ of max-ent");
    }
    for tolerance in [0.0, -1e-6, 1.0, f64::NAN, 1e-200] {
        refused(Lme::new(3.0, tolerance).validate(2), "the support tolerance of max-ent");
    }
    for half_width in [0.0, -0.1, 0.5001, f64::NAN] {
        refused(Gimp { half_width }.validate(2), "the half-width of a GIMP particle over the spacing");
    }
    // −ln 1e-6 / 1.25 = 11.05, the limit that the reference program found in 2D.
    assert!(LmeCircle::new(11.05, 1e-6).validate(2).is_ok());
    let too_local = LmeCircle::new(11.06, 1e-6);
    assert!(matches!(too_local.validate(2), Err(ApproximationError::SupportTooSmall { dimension: 2, .. })));
    let grid = Grid { origin: Vector::from([0.0, 0.0]), spacing: H, cells: [4, 4] };
    let error = support(&too_local.into(), &grid, &Vector::from([0.6, 0.7])).expect_err("too few nodes");
    assert!(error.to_string().contains("γ must be < 11.05"), "{error}");
    assert!(LmeCircle::new(10.0, 1e-6).validate(3).is_err() && LmeCircle::new(10.0, 1e-6).validate(1).is_ok());
}

/// A coordinate of an axis 0 … `length`, often on a node, or extremely close to a node or a wall.
fn coordinate(cells: u32) -> impl Strategy<Value = f64> {
    let length = f64::from(cells);
    prop_oneof![
        0.0..=length,
        (0..=cells).prop_map(f64::from),
        (0..=cells, -300.0..0.0_f64).prop_map(move |(node, e)| (f64::from(node) + 10_f64.powf(e)).min(length)),
        (0..=cells, -17.0..0.0_f64).prop_map(move |(node, e)| (f64::from(node) - 10_f64.powf(e)).max(0.0)),
    ]
}

/// Consistency at a point of a box with its lower corner at the origin, or of its mirror image, with its upper one.
fn consistent<const D: usize>(
    family: &Approximation,
    cells: u32,
    x: [f64; 3],
    mirrored: bool,
    bound: f64,
) -> Result<(), TestCaseError> {
    if family.validate(D).is_err() {
        return Ok(());
    }
    let x = Vector::from_fn(|k, _| if mirrored { -x[k] } else { x[k] });
    let origin = Vector::repeat(if mirrored { -f64::from(cells) } else { 0.0 });
    let grid = Grid::<D> { origin, spacing: 1.0, cells: [cells; D] };
    let found = support(family, &grid, &x)?;
    let error = inconsistency(&grid, &x, &found);
    prop_assert!(error < bound, "{D}D {family:?} at {x:?} of {cells} cells: {error:e}");
    // Max-ent functions are positive; on the circle they have round-off.
    let (separable, circle) = (matches!(family, Approximation::Lme(_)), matches!(family, Approximation::LmeCircle(_)));
    let most = if separable { 1.0 } else { 1.0 + 1e-14 };
    prop_assert!(!(separable || circle) || found.values.iter().all(|n| (0.0..=most).contains(n)), "{family:?}");
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_family_is_consistent_everywhere(
        (cells, x) in (1..30_u32).prop_flat_map(|cells| (Just(cells), prop::array::uniform3(coordinate(cells)))),
        listed in prop::sample::select(families(1)),
        (log_gamma, log_tolerance, gamma) in (-4.0..4.0_f64, -100.0..-0.01_f64, 0.4..11.05_f64),
        (usual, mirrored) in any::<(bool, bool)>(),
    ) {
        let bound = if cells > 6 { 1e-12 } else { 1e-13 };
        consistent::<1>(&listed, cells, x, mirrored, bound)?;
        consistent::<2>(&listed, cells, x, mirrored, bound)?;
        consistent::<3>(&listed, cells, x, mirrored, bound)?;
        let tolerance = if usual { 1e-6 } else { 10_f64.powf(log_tolerance) };
        consistent::<2>(&Lme::new(10_f64.powf(log_gamma), tolerance).into(), cells, x, mirrored, 1e-12)?;
        consistent::<2>(&LmeCircle::new(gamma, 1e-6).into(), cells, x, mirrored, 1e-12)?;
    }
}

/// Cubic splines that claim the reach of quadratic splines.
#[derive(Clone)]
struct Understated;

impl Validate for Understated {
    fn validate(&self, _dimension: usize) -> Result<(), ApproximationError> {
        Ok(())
    }
}

impl Separable for Understated {
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        Bspline::Cubic.axis(axis, x, out)
    }

    fn width(&self) -> usize {
        3
    }
}

#[test]
fn a_family_that_lists_more_nodes_than_it_says_is_refused() {
    let grid = Grid { origin: Vector::zeros(), spacing: H, cells: [8, 8] };
    // Next to the walls there are at most three nodes along each axis.
    let positions = [[0.2, 0.3], [0.3, 0.2], [2.1, 2.2], [2.2, 2.1]].map(Vector::from);
    for connectivity in [Connectivity::new, Connectivity::plain] {
        assert!(connectivity(&Understated, &grid, &positions[..2]).is_ok());
        let error = connectivity(&Understated, &grid, &positions).map(|_| ()).unwrap_err();
        assert_eq!((error.particle, &error.source), (2, &ApproximationError::TooManyNodes { listed: 4, allowed: 3 }));
        assert!(error.source.to_string().contains("4 nodes") && error.source.to_string().contains("reach 3"));
    }
}
