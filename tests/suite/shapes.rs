//! Shapes as drawn, against slow and simple geometry; and the messages for shapes that are drawn wrong.

use crate::support::{Failure, assert_refused, built, cases};
use bfree::shape::{Ball, Block, Cone, Polygon, PolygonError, Shape, Similar, rotation};
use bfree::tensor::Vector;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};

type Point<const D: usize> = Vector<f64, D>;

/// Whether a ray along x from `x` crosses the outline an odd number of times.
fn inside(vertices: &[Point<2>], x: &Point<2>) -> bool {
    let edges = (0..vertices.len()).map(|i| (vertices[i], vertices[(i + 1) % vertices.len()]));
    let crossed = edges
        .filter(|(a, b)| (a[1] > x[1]) != (b[1] > x[1]) && x[0] < a[0] + (b[0] - a[0]) * (x[1] - a[1]) / (b[1] - a[1]));
    crossed.count() % 2 == 1
}

/// Points along the outline, `n` an edge.
fn along(vertices: &[Point<2>], n: u32) -> impl Iterator<Item = Point<2>> {
    let edge = move |i: usize| {
        let (a, b) = (vertices[i], vertices[(i + 1) % vertices.len()]);
        (0..n).map(move |k| a + (b - a) * (f64::from(k) / f64::from(n)))
    };
    (0..vertices.len()).flat_map(edge)
}

/// Whether two edges without a common vertex cross; solves for the position along both.
fn crossing(vertices: &[Point<2>]) -> bool {
    let n = vertices.len();
    let edge = |i: usize| (vertices[i], vertices[(i + 1) % n] - vertices[i]);
    (0..n).any(|i| {
        (0..n).filter(|&k| k != i && (k + 1) % n != i && (i + 1) % n != k).any(|k| {
            let ((a, u), (b, v)) = (edge(i), edge(k));
            let det = u[1] * v[0] - u[0] * v[1];
            let s = ((b - a)[1] * v[0] - (b - a)[0] * v[1]) / det;
            let t = (u[0] * (b - a)[1] - u[1] * (b - a)[0]) / det;
            (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t)
        })
    })
}

/// A star of many points: simple, mostly not convex, in either orientation.
fn star() -> impl Strategy<Value = Vec<Point<2>>> {
    (prop::collection::vec((0.3..2.0, 0.1..1.0), 3..12), any::<bool>()).prop_map(|(points, reversed)| {
        let whole: f64 = points.iter().map(|point| point.1).sum();
        let mut turned = 0.0;
        let mut vertices: Vec<_> = points
            .iter()
            .map(|(radius, part)| {
                turned += TAU * part / whole;
                Vector::from([radius * f64::cos(turned), radius * f64::sin(turned)])
            })
            .collect();
        if reversed {
            vertices.reverse();
        }
        vertices
    })
}

fn point<const D: usize>(size: f64) -> impl Strategy<Value = Point<D>> {
    prop::array::uniform::<_, D>(-size..size).prop_map(Vector::from)
}

/// The foot point of `x` lies on the surface, and the normal is the gradient of d.
fn foot_and_normal<const D: usize>(shape: &Shape<D>, x: &Point<D>) -> Result<(), TestCaseError> {
    let (d, n) = shape.distance_and_normal(x);
    prop_assert!((n.norm() - 1.0).abs() < 1e-13, "{n}");
    prop_assert!(shape.signed_distance(&(x - n * d)).abs() < 1e-12, "{shape:?} at {x}: {d} {n}");
    Ok(())
}

/// The bounding box contains the shape. It also touches the solid, to the resolution `hair` of `surface`.
fn bounded<const D: usize>(shape: &Shape<D>, surface: &[Point<D>], hair: f64) -> Result<(), TestCaseError> {
    let (min, max) = shape.bounding_box();
    for k in 0..D {
        let (low, high) =
            surface.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x[k]), h.max(x[k])));
        prop_assert!(min[k] - 1e-12 <= low && low <= min[k] + hair, "{low} {}", min[k]);
        prop_assert!(max[k] + 1e-12 >= high && high >= max[k] - hair, "{high} {}", max[k]);
    }
    Ok(())
}

/// Volume, centroid, area and ∫ n dA of a solid in the box from −r to r, cut by `cells` cells along each axis.
fn by_cells<const D: usize>(shape: &Shape<D>, r: f64, cells: usize) -> (f64, Vector<f64, D>, f64, Vector<f64, D>) {
    let h = 2.0 * r / cells as f64;
    let (mut volume, mut moment, mut area, mut normals) = (0.0, Vector::zeros(), 0.0, Vector::zeros());
    for id in 0..cells.pow(D as u32) {
        let lower = Vector::from_fn(|k, _| (id / cells.pow(k as u32) % cells) as f64 * h - r);
        let (part, centroid) = shape.part(&lower, &Vector::repeat(h), h);
        volume += part;
        moment += centroid * part;
        for facet in shape.facets(None, &lower, &Vector::repeat(h), h) {
            area += facet.area;
            normals += facet.normal * facet.area;
        }
    }
    (volume, moment / volume, area, normals)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_polygon_is_what_its_outline_encloses(vertices in star(), places in prop::collection::vec(point::<2>(2.5), 40)) {
        // An angle above 180° at the centre may make the edges of a star meet.
        let Ok(polygon) = Polygon::new(vertices.clone()) else { return Ok(()) };
        prop_assert!(!crossing(&vertices));
        let shape = Shape::from(polygon);
        let outline: Vec<_> = along(&vertices, 200).collect();
        for x in &places {
            let d = shape.signed_distance(x);
            prop_assert_eq!(d <= 0.0, inside(&vertices, x), "{} at {}", d, x);
            let nearest = outline.iter().map(|y| (x - y).norm()).fold(f64::INFINITY, f64::min);
            // Points along an edge are at most 4/200 apart.
            prop_assert!(d.abs() <= nearest + 1e-14 && nearest <= d.abs() + 0.01, "{d} {nearest}");
            foot_and_normal(&shape, x)?;
        }
        // The parts in all cells sum to the polygon: area and first moment by the trapezia under its edges, and its circumference.
        let (area, moment) = vertices.iter().zip(vertices.iter().cycle().skip(1)).fold((0.0, Vector::zeros()), |(area, moment), (a, b)| {
            let twice = a[0] * b[1] - a[1] * b[0];
            (area + 0.5 * twice, moment + (a + b) * (twice / 6.0))
        });
        let length: f64 = vertices.iter().zip(vertices.iter().cycle().skip(1)).map(|(a, b)| (b - a).norm()).sum();
        let (cut, centroid, surface, normals) = by_cells(&shape, 3.0, 12);
        prop_assert!((cut - area.abs()).abs() < 1e-9 && (centroid * cut - moment * area.signum()).norm() < 1e-9, "{cut} {area}");
        prop_assert!((surface - length).abs() < 1e-6 && normals.norm() < 1e-6, "{surface} {length}");
        // The same holds at vertices and on edges.
        for x in &outline {
            prop_assert!(shape.signed_distance(x).abs() < 1e-14);
            prop_assert!((shape.normal(x).norm() - 1.0).abs() < 1e-13);
        }
        bounded(&shape, &vertices, 1e-15)?;
    }

    #[test]
    fn what_crosses_itself_is_no_polygon(vertices in prop::collection::vec(point::<2>(1.0), 3..9)) {
        let crosses = crossing(&vertices);
        match Polygon::new(vertices) {
            Ok(_) => prop_assert!(!crosses),
            Err(error) => prop_assert!(crosses && matches!(error, PolygonError::Meeting(..)), "{error}"),
        }
    }

    #[test]
    fn no_vertices_bring_a_polygon_down(vertices in prop::collection::vec(prop::array::uniform2(any::<f64>()), 0..6), x in prop::array::uniform2(any::<f64>())) {
        if let Ok(polygon) = Polygon::new(vertices.into_iter().map(Vector::from).collect()) {
            let shape = Shape::from(polygon);
            shape.facets(None, &Vector::from(x), &Vector::repeat(1.0), 0.1);
            shape.bounding_box();
        }
    }

    #[test]
    fn a_cone_is_what_its_discs_span(from in point::<3>(1.0), to in point::<3>(1.0), radii in prop::array::uniform2(0.0..1.0), tip in 0..3_usize,
                                     places in prop::collection::vec(point::<3>(2.0), 40)) {
        let mut radii = radii;
        if let Some(radius) = radii.get_mut(tip) {
            *radius = 0.0;
        }
        let Some(cone) = Cone::new([from, to], radii) else { return Ok(()) };
        let shape = Shape::from(cone);
        let (length, e) = ((to - from).norm(), (to - from).normalize());
        prop_assume!(length > 0.1);
        // The surface of the cylinder: rings along the side and on both discs.
        let one = e.cross(&if e[0].abs() < 0.7 { Vector::x() } else { Vector::y() }).normalize();
        let other = e.cross(&one);
        let ring = |s: f64, r: f64| {
            (0..96).map(move |k| TAU * f64::from(k) / 96.0).map(move |a| from + e * s + (one * a.cos() + other * a.sin()) * r)
        };
        let parts = (0..=48).map(|k| f64::from(k) / 48.0);
        let surface: Vec<_> = parts.flat_map(|t| {
            let side = ring(t * length, radii[0] + t * (radii[1] - radii[0]));
            side.chain(ring(0.0, t * radii[0])).chain(ring(length, t * radii[1]))
        }).collect();
        for x in &places {
            let d = shape.signed_distance(x);
            let s = (x - from).dot(&e);
            let within = radii[0] + s / length * (radii[1] - radii[0]);
            let contained = (0.0..=length).contains(&s) && (x - from - e * s).norm() <= within;
            prop_assert_eq!(d <= 0.0, contained, "{} at {}", d, x);
            let nearest = surface.iter().map(|y| (x - y).norm()).fold(f64::INFINITY, f64::min);
            prop_assert!(d.abs() <= nearest + 1e-13 && nearest <= d.abs() + 0.06, "{d} {nearest}");
            foot_and_normal(&shape, x)?;
        }
        bounded(&shape, &surface, 3e-3)?;
        // The same holds on the axis, where no radial direction is preferred.
        for k in 0..=20 {
            let x = from + e * (length * (f64::from(k) * 0.1 - 0.5));
            foot_and_normal(&shape, &x)?;
        }
    }

    #[test]
    fn a_cone_of_the_plane_is_a_polygon(from in point::<2>(1.0), to in point::<2>(1.0), radii in prop::array::uniform2(0.1..1.0), x in point::<2>(2.0)) {
        prop_assume!((to - from).norm() > 0.1);
        let e = (to - from).normalize();
        let across = Vector::from([-e[1], e[0]]);
        let [a, b] = radii;
        let corners = vec![from + across * a, from - across * a, to - across * b, to + across * b];
        let (Some(cone), Ok(polygon)) = (Cone::new([from, to], radii), Polygon::new(corners)) else {
            return Err(TestCaseError::fail("neither is wrong"));
        };
        let (cone, polygon) = (Shape::from(cone), Shape::from(polygon));
        prop_assert!((cone.signed_distance(&x) - polygon.signed_distance(&x)).abs() < 1e-14);
        let ((a, b, c, _), (d, e, f, _)) = (by_cells(&cone, 2.5, 7), by_cells(&polygon, 2.5, 7));
        prop_assert!((a - d).abs() < 1e-9 && (b - e).norm() < 1e-9 && (c - f).abs() < 1e-6, "{a} {d}, {c} {f}");
    }

    #[test]
    fn a_shape_turned_and_scaled_takes_its_points_along(about in point::<3>(1.0), axis in point::<3>(1.0), degrees in -720.0..720.0, factor in 0.1..5.0,
                                                         places in prop::collection::vec(point::<3>(1.5), 20)) {
        prop_assume!(axis.norm() > 0.1);
        let Some(rotation) = rotation(degrees, Some(&axis)) else { return Err(TestCaseError::fail("an axis in space")) };
        prop_assert!((rotation.transpose() * rotation - rotation.map(|_| 0.0)).trace() - 3.0 < 1e-14);
        prop_assert!((rotation * axis - axis).norm() < 1e-14 && (rotation.determinant() - 1.0).abs() < 1e-14);
        let across = axis.cross(&if axis[0].abs() < axis[1].abs() { Vector::x() } else { Vector::y() }).normalize();
        let (sin, cos) = degrees.to_radians().sin_cos();
        prop_assert!((rotation * across - across * cos - axis.normalize().cross(&across) * sin).norm() < 1e-12);

        let solid = Shape::from(Block { min: Vector::from([-0.5, -0.25, 0.0]), max: Vector::from([0.5, 1.0, 0.75]) });
        let moved = Shape::from(Similar { of: Box::new(solid.clone()), about, rotation, factor });
        let after = |x: &Point<3>| about + rotation * (x - about) * factor;
        for x in &places {
            let ((d, n), (e, m)) = (solid.distance_and_normal(x), moved.distance_and_normal(&after(x)));
            prop_assert!((d * factor - e).abs() < 1e-13 && (rotation * n - m).norm() < 1e-12, "{d} {e} {n} {m}");
        }
        let (volume, centroid, surface, normals) = by_cells(&moved, 18.0, 11);
        prop_assert!((volume / (0.9375 * factor.powi(3)) - 1.0).abs() < 1e-6, "{volume}");
        prop_assert!((centroid - after(&Vector::from([0.0, 0.375, 0.375]))).norm() < 1e-6);
        prop_assert!((surface / (5.875 * factor.powi(2)) - 1.0).abs() < 1e-6 && normals.norm() < 1e-6 * surface, "{surface}");
        let corner = |i: u32| Vector::from([[-0.5, 0.5][i as usize % 2], [-0.25, 1.0][i as usize / 2 % 2], [0.0, 0.75][i as usize / 4]]);
        let corners: Vec<_> = (0..8).map(|i| after(&corner(i))).collect();
        bounded(&moved, &corners, 1e-12)?;
        // A ball has no orientation: rotated and scaled it is another ball, with an exact bounding box.
        let ball = |center: Point<3>, radius| Shape::from(Ball { center, radius });
        let moved = Shape::from(Similar { of: Box::new(ball(places[0], 0.5)), about, rotation, factor });
        let (expected, found) = (ball(after(&places[0]), 0.5 * factor).bounding_box(), moved.bounding_box());
        prop_assert!((expected.0 - found.0).norm() < 1e-13 && (expected.1 - found.1).norm() < 1e-13);
    }
}

/// A scene with one body of this shape, in a box of edge 4 with `dimension` dimensions.
fn with_shape(dimension: usize, shape: &Value) -> Value {
    json!({
        "grid": {"size": vec![4; dimension], "spacing": 0.25},
        "time": {"step": 1, "end": 1},
        "bodies": [{"name": "body", "shape": shape, "density": 1, "material": {"neo_hookean": {"young": 1, "poisson": 0.3}}}]
    })
}

#[test]
fn bodies_have_the_volume_of_what_is_drawn() -> Result<(), Failure> {
    let drawn = json!({"polygon": [[1, 1], [3, 1], [3, 3], [2, 2], [1, 3]]});
    let half = json!({"scaled": {"of": drawn, "about": [1, 1], "factor": 0.5}});
    let turned = json!({"rotated": {"of": drawn, "about": [2, 2], "angle": 33}});
    for (shape, exact) in [(drawn, 3.0), (half, 0.75), (turned, 3.0)] {
        let volume: f64 = built::<2>(&with_shape(2, &shape))?.particles.volume.iter().sum();
        assert!((volume - exact).abs() < 1e-9, "{shape}: {volume}");
    }
    let cylinder = json!({"cylinder": {"from": [2, 2, 0.5], "to": [2, 2, 3.5], "radius": 1}});
    let lying = json!({"rotated": {"of": cylinder, "about": [2, 2, 2], "angle": 90, "axis": [1, 0, 0]}});
    let cone = json!({"cone": {"from": [0.5, 2, 2], "to": [3.5, 2, 2], "radii": [1, 0]}});
    for (shape, exact) in [(cylinder, 3.0 * PI), (lying, 3.0 * PI), (cone, PI)] {
        let volume: f64 = built::<3>(&with_shape(3, &shape))?.particles.volume.iter().sum();
        assert!((volume / exact - 1.0).abs() < 1e-3, "{shape}: {volume}");
    }
    Ok(())
}

#[test]
fn a_region_that_ends_on_nodes_holds_them_whatever_the_round_off() -> Result<(), Failure> {
    // The row of nodes at −0.3 + 3 · 0.1 = 5.6e-17 belongs to the half-space y ≤ 0, which is held.
    let scene = json!({
        "grid": {"origin": [0, -0.3], "size": [0.4, 0.6], "spacing": 0.1}, "approximation": "linear",
        "time": {"step": 1, "end": 1, "scheme": "none"},
        "bodies": [{"name": "body", "shape": {"box": {"min": [0, 0], "max": [0.4, 0.2]}}, "density": 1,
                    "layout": "regular", "material": {"neo_hookean": {"young": 1, "poisson": 0}}}],
        "prescribed": [{"region": {"half_space": {"point": [0, 0], "normal": [0, 1]}}, "displacement": [[0, [0, 0]]]}],
        "gravity": {"acceleration": [0, -0.01]}
    });
    let mut simulation = built::<2>(&scene)?;
    simulation.advance()?;
    // The body stands, pressed down by ρ g H²/2E = 2e-4 at the top, and does not fall.
    let now = simulation.particles.by_id().position;
    let lowest = now.iter().map(|x| x[1]).fold(f64::INFINITY, f64::min);
    assert!((lowest - 0.025).abs() < 1e-4, "{lowest}");
    Ok(())
}

/// Dimension | shape | key below the shape | words of the message.
const WRONG: &str = r##"
2 | {"polygon": []} | polygon | 0 vertices | at least 3
2 | {"polygon": [[1, 1], [2, 2]]} | polygon | 2 vertices | at least 3
2 | {"polygon": [[1, 1], [2, 1], [2, 1]]} | polygon[2] | vertex 2 at the place of vertex 1
2 | {"polygon": [[1, 1], [2, 2], [3, 3]]} | polygon | without area | not all on a line
2 | {"polygon": [[1, 1], [3, 1], [1, 2], [3, 2]]} | polygon[3] | vertices 3 and 0 | between 1 and 2 | counted from 0
2 | {"polygon": [[1, 1], [3, 1, 1], [1, 2]]} | polygon[1] | length 3 | 2 components
2 | {"polygon": [[1, 1], [5, 1], [1, 2]]} |  | x = 1 to 5 | must lie in the grid
3 | {"polygon": [[1, 1], [3, 1], [1, 2]]} | polygon | 2 dimensions | has 3
3 | {"cylinder": {"from": [1, 1, 1], "to": [1, 1, 1], "radius": 1}} | cylinder.to | differ | axis
3 | {"cylinder": {"from": [2, 2, 1], "to": [2, 2, 3], "radius": 0}} | cylinder.radius | 0 is not | > 0
3 | {"cone": {"from": [2, 2, 1], "to": [2, 2, 3], "radii": [-1, 0]}} | cone.radii[0] | -1 is not | between 0
3 | {"cone": {"from": [2, 2, 1], "to": [2, 2, 3], "radii": [0, 0]}} | cone.radii | [0, 0] | one of the two
1 | {"cylinder": {"from": [1], "to": [2], "radius": 1}} | cylinder | use a box
2 | {"rotated": {"of": {"ball": {"center": [2, 2], "radius": 1}}, "about": [2], "angle": 1}} | rotated.about | 2 components
2 | {"rotated": {"of": {"ball": {"center": [2, 2], "radius": 1}}, "about": [2, 2], "angle": 1e200}} | rotated.angle | 1e200 | at most
2 | {"rotated": {"of": {"ball": {"center": [2, 2], "radius": 1}}, "about": [2, 2], "angle": 1, "axis": [0, 0]}} | rotated.axis | remove it
3 | {"rotated": {"of": {"ball": {"center": [2, 2, 2], "radius": 1}}, "about": [2, 2, 2], "angle": 1}} | rotated | give its "axis"
3 | {"rotated": {"of": {"ball": {"center": [2, 2, 2], "radius": 1}}, "about": [2, 2, 2], "angle": 1, "axis": [0, 0, 0]}} | rotated.axis | zero vector
1 | {"rotated": {"of": {"ball": {"center": [2], "radius": 1}}, "about": [2], "angle": 1}} | rotated | a line
2 | {"scaled": {"of": {"ball": {"center": [2, 2], "radius": 1}}, "about": [2, 2], "factor": 0}} | scaled.factor | 0 is not | > 0
2 | {"scaled": {"of": {"box": {"min": [1, 1.5], "max": [3, 2.5]}}, "about": [2, 2], "factor": 3}} |  | x = -1 to 5 | must lie in the grid
2 | {"scaled": {"of": {"polygon": [[0, 0]]}, "about": [2, 2], "factor": 1}} | scaled.of.polygon | 1 vertices
"##;

#[test]
fn wrong_drawings_are_named_with_what_is_allowed() {
    for case in cases(WRONG) {
        let drawn: Value = serde_json::from_str(case[1]).unwrap();
        let text = serde_json::to_string_pretty(&with_shape(case[0].parse().unwrap(), &drawn)).unwrap();
        let below = if case[2].is_empty() { "" } else { "." };
        assert_refused(&text, &format!("bodies[0].shape{below}{}", case[2]), &case[3..]);
    }
}
