//! Tests of the contracts of solids, one by one and all together.

mod filling;

use super::*;
use crate::grid::Grid;
use crate::grid::indices;
use crate::tensor::Tensor;

fn vector<const D: usize>(x: [f64; D]) -> Vector<f64, D> {
    Vector::from_column_slice(&x)
}

fn ball<const D: usize>(center: [f64; D], radius: f64) -> Shape<D> {
    Ball { center: vector(center), radius }.into()
}

fn block<const D: usize>(min: [f64; D], max: [f64; D]) -> Shape<D> {
    Block { min: vector(min), max: vector(max) }.into()
}

fn oblique_cone(radii: [f64; 2]) -> Cone<3> {
    Cone::new([vector([-0.4, 0.3, -0.5]), vector([0.5, -0.2, 0.3])], radii).unwrap()
}

fn turned_and_scaled(of: Shape<3>) -> Shape<3> {
    let rotation = rotation(50.0, Some(&vector([1.0, 2.0, -0.5]))).unwrap();
    Similar { of: Box::new(of), about: vector([0.1, 0.2, 0.3]), rotation, factor: 1.2 }.into()
}

fn solids() -> Vec<Shape<3>> {
    let (a, b) = (block([-1.0, -0.5, -0.25], [1.0, 0.75, 0.5]), ball([0.8, 0.1, 0.2], 0.45));
    let plane = Shape::from(HalfSpace { point: vector([0.1, 0.2, 0.0]), normal: vector([2.0, -1.0, 0.5]) });
    vec![
        a.clone(),
        b.clone(),
        plane.clone(),
        Shape::union(vec![a.clone(), b.clone()]),
        Difference { of: Box::new(a.clone()), minus: Box::new(b) }.into(),
        Shape::intersection(vec![a, plane]),
        oblique_cone([0.7, 0.3]).into(),
        oblique_cone([0.0, 0.5]).into(),
        turned_and_scaled(block([-0.5, -0.25, -0.125], [0.5, 0.25, 0.75])),
        Surface::new(
            [[-0.9, -0.4, -0.6], [0.8, -0.5, -0.3], [-0.1, 0.9, -0.2], [0.2, 0.1, 0.7]].map(vector).to_vec(),
            vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        )
        .unwrap()
        .into(),
        Pixels::new(vector([-0.9, -0.8, -0.7]), vector([0.9, 0.7, 0.8]), mask()).unwrap().into(),
    ]
}

/// Voxels with a hole and a notch. A layer at each end of the first axis is empty.
fn mask() -> Mask {
    let inside = |i: usize| ![0, 5].contains(&(i % 6)) && i % 11 != 3;
    Mask::new([6, 4, 3], (0..72).map(inside)).unwrap()
}

/// Points without any symmetry, in [−1.5, 1.5]³.
fn points() -> impl Iterator<Item = Vector<f64, 3>> {
    (1..400).map(|i| Vector::from_fn(|k, _| 3.0 * (f64::from(i) * [0.618034, 0.414214, 0.732051][k]).fract() - 1.5))
}

fn regular(per_axis: u32, rule: Fill) -> Filling {
    Filling { per_axis, rule, ..Filling::default() }
}

/// The positions of the particles.
fn filled<const D: usize>(grid: &Grid<D>, shape: &Shape<D>, per_axis: u32, rule: Fill) -> Vec<Vector<f64, D>> {
    fill(grid, shape, regular(per_axis, rule)).unwrap().iter().map(|seed| seed.position).collect()
}

#[test]
fn the_paper_s_disc_has_112_particles() {
    let grid = Grid { origin: vector([0.0, 0.0]), spacing: 0.5, cells: [30, 10] };
    let disc = ball([2.5, 2.5], 1.5);
    // ½ ρ v² V₀ n = 3.5, the energy of the reference, with ρ = 4, v = ½, V₀ = h²/4
    assert_eq!(filled(&grid, &disc, 2, Fill::Particles).len(), 112);
    // whole cells: centres at (¼, ¾, 5/4)², all but the four corners of the 6×6 square
    let particles = filled(&grid, &disc, 2, Fill::Cells);
    assert_eq!(particles.len(), (36 - 4) * 4);
    // quarter points, the first axis fastest
    assert_eq!(particles[1] - particles[0], vector([0.25, 0.0]));
    assert_eq!(((particles[0][0] / 0.5).fract(), (particles[0][1] / 0.5).fract()), (0.25, 0.25));
}

#[test]
fn a_filled_box_has_its_volume_and_its_center() {
    let grid = Grid { origin: vector([-0.3, 0.2, 0.0]), spacing: 0.1, cells: [10, 12, 9] };
    let shape = block([-0.1, 0.4, 0.2], [0.5, 0.8, 0.5]);
    for rule in [Fill::Cut, Fill::Particles, Fill::Cells] {
        let particles = filled(&grid, &shape, 3, rule);
        assert_eq!(particles.len(), 6 * 4 * 3 * 27, "{rule:?}");
        let center = particles.iter().sum::<Vector<f64, 3>>() / particles.len() as f64;
        assert!((center - vector([0.2, 0.6, 0.35])).norm() < 1e-12);
    }
}

#[test]
fn the_volume_of_a_filled_ball_converges() {
    let shape = ball([0.5, 0.5, 0.5], 0.4);
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 0.4_f64.powi(3);
    for (cells, bound) in [(8, 0.03), (32, 0.003)] {
        let h = 1.0 / f64::from(cells);
        let grid = Grid { origin: vector([0.0; 3]), spacing: h, cells: [cells; 3] };
        let volume = filled(&grid, &shape, 2, Fill::Particles).len() as f64 * (h / 2.0).powi(3);
        assert!((volume / exact - 1.0).abs() < bound, "{cells} cells: {volume} against {exact}");
    }
}

#[test]
fn mirrored_and_turned_solids_have_mirrored_and_turned_particles() {
    let grid = Grid { origin: vector([0.0, 0.0]), spacing: 0.25, cells: [8, 8] };
    let cut = |shape: &Shape<2>| fill(&grid, shape, regular(2, Fill::Cut)).unwrap();
    let at = |[x, y]: [f64; 2]| vector([1.0 + x, 1.0 + y]);
    let outline = [[0.31, 0.12], [-0.22, 0.57], [-0.41, -0.36]];
    let solid = |image: fn([f64; 2]) -> [f64; 2]| -> [Shape<2>; 2] {
        let vertices = outline.map(|x| at(image(x))).to_vec();
        [Polygon::new(vertices).unwrap().into(), Ball { center: at(image([0.07, 0.21])), radius: 0.53 }.into()]
    };
    let images: [fn([f64; 2]) -> [f64; 2]; 3] = [|[x, y]| [y, x], |[x, y]| [-x, y], |[x, y]| [-y, x]];
    for image in images {
        for (solid, other) in solid(|x| x).iter().zip(solid(image)) {
            let (seeds, others) = (cut(solid), cut(&other));
            assert_eq!(seeds.len(), others.len());
            for seed in &seeds {
                let x = at(image([seed.position[0] - 1.0, seed.position[1] - 1.0]));
                let near =
                    |one: &&Seed<2>| (one.position - x).norm() < 1e-9 && (one.volume - seed.volume).abs() < 1e-12;
                assert!(others.iter().any(|one| near(&one)), "no particle at {x}");
            }
        }
    }
}

#[test]
fn an_unbounded_shape_is_clipped_to_the_grid() {
    let grid = Grid { origin: vector([0.0, 0.0]), spacing: 1.0, cells: [4, 3] };
    let tilted = Shape::from(HalfSpace { point: vector([0.0, 3.0]), normal: vector([1.0, 1.0]) });
    let particles = filled(&grid, &tilted, 1, Fill::Particles);
    // x + y ≤ 3 over the centres (½, ½), (1½, ½), …
    assert_eq!(particles.len(), 6);
}

#[test]
fn too_many_or_no_particles_are_refused() {
    let grid = Grid { origin: vector([0.0; 3]), spacing: 1e-3, cells: [1000; 3] };
    let all = Shape::from(HalfSpace { point: vector([1.0; 3]), normal: vector([1.0; 3]) });
    assert!(
        matches!(fill(&grid, &all, regular(2, Fill::Cut)), Err(FillError::TooMany { candidates }) if candidates == 8e9)
    );
    for lost in [ball([7.0; 3], 0.1), ball([0.5; 3], 1e-5), Shape::union(vec![])] {
        assert!(matches!(fill(&grid, &lost, regular(2, Fill::Particles)), Err(FillError::Empty { .. })), "{lost:?}");
    }
}

#[test]
fn the_normal_is_the_unit_gradient_of_the_distance() {
    for shape in solids() {
        for x in points() {
            let (_, n) = shape.distance_and_normal(&x);
            assert!((n.norm() - 1.0).abs() < 1e-14);
            let step = 1e-6;
            let gradient: Vector<f64, 3> = Vector::from_fn(|k, _| {
                (shape.signed_distance(&(x + axis(k, step))) - shape.signed_distance(&(x - axis(k, step))))
                    / (2.0 * step)
            });
            assert!((gradient - n).norm() < 1e-5, "{shape:?} at {x}: {gradient} against {n}");
        }
    }
}

#[test]
fn the_foot_point_lies_on_the_surface_of_a_primitive() {
    let combined = 3..6;
    for (_, shape) in solids().iter().enumerate().filter(|(i, _)| !combined.contains(i)) {
        for x in points() {
            let (d, n) = shape.distance_and_normal(&x);
            assert!(shape.signed_distance(&(x - n * d)).abs() < 1e-14, "{shape:?} at {x}");
        }
    }
}

#[test]
fn combinations_are_the_set_operations_and_lie_in_their_bounding_box() {
    let solids = solids();
    let (a, b, plane) = (&solids[0], &solids[1], &solids[2]);
    for x in points() {
        assert_eq!(solids[3].contains(&x), a.contains(&x) || b.contains(&x));
        assert_eq!(solids[4].contains(&x), a.contains(&x) && !b.contains(&x));
        assert_eq!(solids[5].contains(&x), a.contains(&x) && plane.contains(&x));
        for shape in &solids {
            let (min, max) = shape.bounding_box();
            assert!(!shape.contains(&x) || (0..3).all(|k| min[k] <= x[k] && x[k] <= max[k]), "{shape:?} at {x}");
        }
    }
}

#[test]
fn at_a_hole_the_normal_points_into_the_hole() {
    let ring = Shape::from(Difference { of: Box::new(ball([0.0, 0.0], 2.0)), minus: Box::new(ball([0.0, 0.0], 1.0)) });
    assert!((ring.normal(&vector([1.2, 0.0])) - vector([-1.0, 0.0])).norm() < 1e-15);
    assert!((ring.normal(&vector([0.0, 1.9])) - vector([0.0, 1.0])).norm() < 1e-15);
    assert!((ring.signed_distance(&vector([1.2, 0.0])) + 0.2).abs() < 1e-15);
}

#[test]
fn an_axis_parallel_half_space_is_bounded_on_its_side() {
    let left: Shape<2> = Shape::from(HalfSpace { point: vector([0.5, 9.0]), normal: vector([3.0, 0.0]) });
    let (min, max) = left.bounding_box();
    assert_eq!((min[0], max[0], min[1], max[1]), (f64::NEG_INFINITY, 0.5, f64::NEG_INFINITY, f64::INFINITY));
}

#[test]
fn what_round_off_puts_beside_an_edge_lies_in_the_shape() {
    // The node at y = 5.6e-17, as −0.3 + 3 · 0.1 gives it, and the half-space y ≤ 0.
    let grid = Grid { origin: vector([0.0, -0.3]), spacing: 0.1, cells: [4, 6] };
    let below: Shape<2> = HalfSpace { point: vector([0.0, 0.0]), normal: vector([0.0, 1.0]) }.into();
    let node = grid.position([2, 3]);
    assert!(node[1] > 0.0 && !below.contains(&node) && below.holds(&node, grid.spacing));
    assert!(!below.holds(&(node + vector([0.0, 1e-9])), grid.spacing));
    // With one particle a cell, centres of cells lie on the edge to within round-off, in any units.
    for unit in [1e-6, 1.0, 1e6] {
        let grid = Grid { origin: vector([0.0, -0.35 * unit]), spacing: 0.1 * unit, cells: [4, 6] };
        assert_eq!(filled(&grid, &below, 1, Fill::Particles).len(), 4 * 4, "{unit}");
    }
}

#[test]
fn a_right_angle_is_one_to_the_last_bit() {
    for quarters in -9..9_i32 {
        let turned: Tensor<f64, 2> = rotation(90.0 * f64::from(quarters), None).unwrap();
        let (cos, sin) = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][quarters.rem_euclid(4) as usize];
        assert_eq!(turned, Tensor::<f64, 2>::new(cos, -sin, sin, cos), "{quarters}");
    }
    // A half-space turned by a right angle stays bounded on its side.
    let left = HalfSpace { point: vector([0.5, 9.0]), normal: vector([3.0, 0.0]) }.into();
    let rotation = rotation(90.0, None).unwrap();
    let below: Shape<2> = Similar { of: Box::new(left), about: vector([0.0, 0.0]), rotation, factor: 2.0 }.into();
    assert_eq!((below.bounding_box().1[1], below.bounding_box().0[1]), (1.0, f64::NEG_INFINITY));
}

#[test]
fn outlines_that_bound_no_polygon_are_refused_with_the_vertices() {
    let refused = |vertices: &[[f64; 2]]| Polygon::new(vertices.iter().map(|&x| vector(x)).collect()).unwrap_err();
    let (a, b, c, d) = ([0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]);
    assert_eq!(refused(&[a, b]), PolygonError::TooFew(2));
    assert_eq!(refused(&[a, b, c, b]), PolygonError::Repeated(3, 1));
    assert_eq!(refused(&[a, b, [1.0, 1e-12]]), PolygonError::Flat);
    assert_eq!(refused(&[a, b, d, c]), PolygonError::Meeting([3, 0], [1, 2]));
    // a vertex on an edge; an edge that runs back on the one before; and one along another
    assert_eq!(refused(&[a, b, c, [1.0, 0.0], d]), PolygonError::Meeting([2, 3], [0, 1]));
    assert_eq!(refused(&[a, b, [1.0, 0.0], d]), PolygonError::Meeting([1, 2], [0, 1]));
    assert_eq!(refused(&[a, [4.0, 0.0], [4.0, 1.0], [3.0, 0.0], b, c]), PolygonError::Meeting([2, 3], [0, 1]));
    assert_eq!(refused(&[[f64::NAN; 2]; 3]), PolygonError::Flat);
    assert_eq!(Polygon::new(vec![vector([0.0; 3]); 3]), Err(PolygonError::Dimension(3)));
    // A vertex on a straight line is no fault.
    assert!(Polygon::new([a, [1.0, 0.0], b, c, d].map(vector).to_vec()).is_ok());
}
