//! What solids promise, of each and of all together.

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
        Union(vec![a.clone(), b.clone()]).into(),
        Difference { of: Box::new(a.clone()), minus: Box::new(b) }.into(),
        Intersection(vec![a, plane]).into(),
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

/// Voxels with a hole and a notch, of which a layer at each end of the first axis is empty.
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

/// The places of the particles.
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
    for lost in [ball([7.0; 3], 0.1), ball([0.5; 3], 1e-5), Union(vec![]).into()] {
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
    // Filled with one particle a cell, whose centres are on the edge to within round-off, in any units.
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
    // A half-space turned so stays bounded on its side.
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
    // Straight on through a vertex is no fault.
    assert!(Polygon::new([a, [1.0, 0.0], b, c, d].map(vector).to_vec()).is_ok());
}

/// Volume, centroid, area and ∫ n dA of a solid by the cells of a grid, and ∫ x·n dA / D, which is the volume too (Gauss).
fn measured<const D: usize>(grid: &Grid<D>, shape: &Shape<D>) -> (f64, Vector<f64, D>, f64, Vector<f64, D>, f64) {
    let (mut volume, mut moment, mut area) = (0.0, Vector::zeros(), 0.0);
    let (mut normals, mut flux): (Vector<f64, D>, f64) = (Vector::zeros(), 0.0);
    let edges = Vector::repeat(grid.spacing);
    for cell in indices(grid.cells.map(u64::from)) {
        let lower = grid.position(cell.map(|i| i as u32));
        let (v, centroid) = shape.part(&lower, &edges, grid.spacing);
        volume += v;
        moment += centroid * v;
        for facet in shape.facets(None, &lower, &edges, grid.spacing) {
            area += facet.area;
            normals += facet.normal * facet.area;
            flux += facet.position.dot(&facet.normal) * facet.area / D as f64;
        }
    }
    (volume, moment / volume, area, normals, flux)
}

#[test]
fn flat_faces_are_cut_exactly() {
    // An L and the two boxes that make it, one that overlaps and one that touches; a frame; all turned by 27° too.
    let l = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]
        .map(|x| vector(x) + vector([0.6, 0.7]));
    let at = |x: [f64; 2]| vector(x) + vector([0.6, 0.7]);
    let cube = |a: [f64; 2], b: [f64; 2]| Shape::from(Block { min: at(a), max: at(b) });
    let hole = Box::new(cube([0.25, 0.25], [0.75, 0.75]));
    let cases: [(Shape<2>, f64, f64); 4] = [
        (Polygon::new(l.to_vec()).unwrap().into(), 4.0, 10.0),
        (Union(vec![cube([0.0, 0.0], [3.0, 1.0]), cube([0.0, 0.0], [1.0, 2.0])]).into(), 4.0, 10.0),
        (Union(vec![cube([0.0, 0.0], [3.0, 1.0]), cube([0.0, 1.0], [1.0, 2.0])]).into(), 4.0, 10.0),
        (Difference { of: Box::new(cube([0.0, 0.0], [1.0, 1.0])), minus: hole }.into(), 0.75, 6.0),
    ];
    for spacing in [0.5, 0.3, 0.17] {
        let grid = Grid { origin: vector([-1.5, -1.5]), spacing, cells: [(7.0 / spacing) as u32; 2] };
        for (shape, volume, area) in &cases {
            for degrees in [0.0, 27.0, 90.0] {
                let rotation = rotation(degrees, None).unwrap();
                let turned = Similar { of: Box::new(shape.clone()), about: vector([2.0, 2.0]), rotation, factor: 1.0 };
                let (v, _, a, normals, flux) = measured(&grid, &turned.into());
                let worst = (v - volume).abs().max((a - area).abs()).max(normals.norm()).max((flux - volume).abs());
                assert!(worst < 1e-9, "{shape:?} by {degrees}° at h = {spacing}: {v}, {a}, {normals}, {flux}");
            }
        }
    }
    // A cube in general position: volume, centroid, area.
    let cube = block([-0.5; 3], [0.5; 3]);
    let turned = Similar {
        of: Box::new(cube),
        about: vector([0.0; 3]),
        rotation: rotation(40.0, Some(&vector([1.0, 2.0, 3.0]))).unwrap(),
        factor: 1.3,
    };
    let grid = Grid { origin: vector([-1.3; 3]), spacing: 0.26, cells: [10; 3] };
    let (v, centroid, a, normals, flux) = measured(&grid, &turned.into());
    assert!((v - 1.3_f64.powi(3)).abs() < 1e-9 && centroid.norm() < 1e-9 && (a - 6.0 * 1.69).abs() < 1e-9, "{v} {a}");
    assert!(normals.norm() < 1e-9 && (flux - v).abs() < 1e-9);
}

#[test]
fn curved_faces_are_cut_to_a_thousandth_at_four_cells_across() {
    use std::f64::consts::PI;
    let near = |found: f64, exact: f64, what: &str| {
        assert!((found / exact - 1.0).abs() < 1e-3, "{what}: {found} against {exact}");
    };
    for offset in [0.0, 0.13, 0.37] {
        let center = [2.5 + offset; 2];
        let grid = Grid { origin: vector([0.0, 0.0]), spacing: 0.5, cells: [11, 11] };
        let ring = Difference { of: Box::new(ball(center, 2.0)), minus: Box::new(ball(center, 1.0)) }.into();
        for (shape, volume, area) in [(ball(center, 1.0), PI, 2.0 * PI), (ring, 3.0 * PI, 6.0 * PI)] {
            let (v, centroid, a, normals, _) = measured(&grid, &shape);
            near(v, volume, "disc");
            near(a, area, "circle");
            assert!((centroid - vector(center)).norm() < 1e-3 && normals.norm() < 1e-3 * a);
        }
        let center = [1.5 + offset; 3];
        let grid = Grid { origin: vector([0.0; 3]), spacing: 0.5, cells: [7; 3] };
        let (v, _, a, normals, _) = measured(&grid, &ball(center, 1.0));
        near(v, 4.0 / 3.0 * PI, "ball");
        near(a, 4.0 * PI, "sphere");
        assert!(normals.norm() < 1e-3 * a);
        let ends = [vector(center) - vector([0.4, 0.5, 0.6]), vector(center) + vector([0.4, 0.5, 0.6])];
        let length = (ends[1] - ends[0]).norm();
        let (v, _, a, ..) = measured(&grid, &Cone::new(ends, [0.8, 0.8]).unwrap().into());
        near(v, PI * 0.64 * length, "cylinder");
        near(a, 2.0 * PI * 0.8 * (length + 0.8), "surface of a cylinder");
        let (v, _, a, ..) = measured(&grid, &Cone::new(ends, [1.0, 0.0]).unwrap().into());
        near(v, PI / 3.0 * length, "cone");
        near(a, PI * (1.0 + (1.0 + length * length).sqrt()), "surface of a cone");
    }
}

#[test]
fn particles_have_the_volume_and_the_first_moments_of_the_shape() {
    let grid = Grid { origin: vector([0.0, 0.0]), spacing: 1.0, cells: [60, 60] };
    let cook = Polygon::new([[0.0, 0.0], [48.0, 44.0], [48.0, 60.0], [0.0, 44.0]].map(vector).to_vec()).unwrap().into();
    // A plate of a quarter of a cell, and a sliver of a hundredth beside a whole cell.
    let plate = block([3.0, 7.13], [40.0, 7.39]);
    let beside = block([3.0, 7.0], [40.0, 8.01]);
    for (shape, volume, center) in [
        (cook, 48.0 * 30.0, vector([48.0 * 19.0 / 45.0, 0.0])),
        (plate, 37.0 * 0.26, vector([21.5, 7.26])),
        (beside, 37.0 * 1.01, vector([21.5, 7.505])),
    ] {
        for (layout, degree) in [(Layout::Regular, 1), (Layout::Gauss, 1), (Layout::Gauss, 2), (Layout::Gauss, 3)] {
            let seeds = fill(&grid, &shape, Filling { per_axis: 2, layout, degree, ..Filling::default() }).unwrap();
            let found: f64 = seeds.iter().map(|seed| seed.volume).sum();
            let moment: Vector<f64, 2> = seeds.iter().map(|seed| seed.position * seed.volume).sum();
            assert!((found / volume - 1.0).abs() < 1e-9, "{shape:?}: {found}");
            assert!((moment[0] / found - center[0]).abs() < 1e-8, "{shape:?}: {}", moment / found);
            assert!(center[1] == 0.0 || (moment[1] / found - center[1]).abs() < 1e-8);
            // No crumbs, where there is something to join them to; volumes of points that integrate are what they must be.
            let least = seeds.iter().map(|seed| seed.volume).fold(f64::INFINITY, f64::min);
            assert!(least > if layout == Layout::Regular { 0.1 / 16.0 } else { 0.0 }, "{least}");
        }
    }
}

#[test]
fn gauss_points_integrate_polynomials_of_degree_2_n_minus_1() {
    for n in 1..9 {
        let points = Layout::Gauss.points(n);
        for degree in 0..2 * n as i32 {
            let sum: f64 = points.iter().map(|(x, w)| w * x.powi(degree)).sum();
            assert!((sum * f64::from(degree + 1) - 1.0).abs() < 1e-13, "{n}, {degree}: {sum}");
        }
    }
}

#[test]
fn between_middles_gauss_points_integrate_polynomials_of_degree_2_n_minus_1() {
    // Cells 1 to 5 of 7: half a piece, four, and half a piece.
    let grid = Grid { origin: vector([0.0]), spacing: 1.0, cells: [7] };
    for per_axis in 1..7 {
        let how = Filling { per_axis, layout: Layout::Gauss, degree: 2, ..Filling::default() };
        let seeds = fill(&grid, &block([1.0], [6.0]), how).unwrap();
        assert_eq!(seeds.len() as u32, 6 * per_axis + 4 * (per_axis % 2), "those on a node are two");
        for degree in 0..2 * per_axis as i32 {
            let integrand = |x: f64| (x + 0.5).fract().powi(degree);
            let sum: f64 = seeds.iter().map(|seed| seed.volume * integrand(seed.position[0])).sum();
            assert!((sum * f64::from(degree + 1) / 5.0 - 1.0).abs() < 1e-13, "{per_axis}, {degree}: {sum}");
        }
    }
}

#[test]
fn a_region_cuts_the_surface_where_it_ends() {
    let grid = Grid { origin: vector([0.0, 0.0]), spacing: 0.5, cells: [8, 8] };
    let (disc, right) = (ball([2.0, 2.0], 1.2), HalfSpace { point: vector([2.3, 0.0]), normal: vector([-1.0, 0.0]) });
    let mut area = 0.0;
    for cell in indices(grid.cells.map(u64::from)) {
        let lower = grid.position(cell.map(|i| i as u32));
        let facets = disc.facets(Some(&right.clone().into()), &lower, &vector([0.5, 0.5]), 0.5);
        area += facets.iter().map(|facet| facet.area).sum::<f64>();
    }
    // The arc beyond x = 2.3, of 2 acos(0.3/1.2).
    assert!((area / (2.4 * 0.25_f64.acos()) - 1.0).abs() < 1e-3, "{area}");
}

#[test]
fn edges_that_are_nearly_one_are_counted_once() {
    // A square with a vertex 1e-6 beside the middle of a side.
    let vertices =
        [[0.0, 0.0], [1.0, -1e-6], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(|x| vector(x) + vector([0.31, 0.32]));
    let shape = Polygon::new(vertices.to_vec()).unwrap().into();
    let grid = Grid { origin: vector([0.0, 0.0]), spacing: 0.5, cells: [6, 6] };
    let (volume, _, area, normals, _) = measured(&grid, &shape);
    assert!(
        (volume - 4.0 - 1e-6).abs() < 1e-9 && (area - 8.0).abs() < 1e-9 && normals.norm() < 1e-9,
        "{volume} {area}"
    );
}

#[test]
fn in_cells_that_are_cut_gauss_points_integrate_products_of_polynomials() {
    // x + y < size in a corner of the grid: ∫∫ xⁱ yʲ = i! j! / (i + j + 2)! sizeⁱ⁺ʲ⁺² (Dirichlet).
    let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
    for degree in [1, 2, 3] {
        for size in [0.45, 0.999, 2.0] {
            let corner = Intersection(vec![
                block([0.0, 0.0], [3.0, 3.0]),
                HalfSpace { point: vector([size, 0.0]), normal: vector([1.0, 1.0]) }.into(),
            ]);
            let grid = Grid { origin: vector([0.0, 0.0]), spacing: 2.0, cells: [1, 1] };
            let how = Filling { per_axis: 2, layout: Layout::Gauss, degree, ..Filling::default() };
            let seeds = fill(&grid, &corner.into(), how).unwrap();
            assert!(
                seeds.iter().all(|seed| seed.volume > 0.0 && seed.position.min() > 0.0 && seed.position.sum() < size)
            );
            for (i, j) in (0..=degree).flat_map(|i| (0..=degree).map(move |j| (i, j))) {
                let sum: f64 = seeds
                    .iter()
                    .map(|seed| seed.volume * seed.position[0].powi(i as i32) * seed.position[1].powi(j as i32))
                    .sum();
                let exact = factorial(i) * factorial(j) / factorial(i + j + 2) * size.powi((i + j + 2) as i32);
                assert!((sum / exact - 1.0).abs() < 1e-12, "{degree}, {size}, {i}, {j}: {sum} {exact}");
            }
        }
    }
}

/// ∮ x ⊗ n dA = V I and ∮ x₁² n₁ dA = 2 V c₁ (Gauss): points of a curved surface have turned normals, in a hole the other way.
#[test]
fn points_of_a_curved_surface_integrate_polynomials() {
    fn integrals<const D: usize>(grid: &Grid<D>, shape: &Shape<D>) -> (Tensor<f64, D>, f64) {
        let (mut of_x, mut of_square) = (Tensor::zeros(), 0.0);
        let edges = Vector::repeat(0.5 * grid.spacing);
        for i in indices(grid.cells.map(|n| 2 * u64::from(n))) {
            let lower = Vector::from_fn(|k, _| grid.origin[k] + i[k] as f64 * edges[k]);
            for point in shape.surface_points(None, &lower, &edges, grid.spacing) {
                of_x += point.position * point.normal.transpose() * point.area;
                of_square += point.position[0].powi(2) * point.normal[0] * point.area;
            }
        }
        (of_x, of_square)
    }
    let plane = Grid { origin: vector([0.0, 0.0]), spacing: 1.0, cells: [6, 6] };
    let disc = || ball([3.1, 2.9], 2.0);
    let hole = Difference { of: Box::new(block([0.0; 2], [6.0; 2])), minus: Box::new(disc()) };
    let pi = std::f64::consts::PI;
    for (shape, volume, first) in
        [(disc(), 4.0 * pi, 3.1 * 4.0 * pi), (hole.into(), 36.0 - 4.0 * pi, 108.0 - 3.1 * 4.0 * pi)]
    {
        let (of_x, of_square) = integrals(&plane, &shape);
        assert!((of_x - Tensor::<f64, 2>::identity() * volume).amax() < 1e-4 * volume, "{of_x}");
        assert!((of_square - 2.0 * first).abs() < 1e-4 * first, "{of_square}");
    }
    let space = Grid { origin: vector([0.0; 3]), spacing: 1.0, cells: [5; 3] };
    let (of_x, of_square) = integrals(&space, &ball([2.6, 2.5, 2.4], 2.0));
    let volume = 32.0 / 3.0 * pi;
    assert!((of_x - Tensor::<f64, 3>::identity() * volume).amax() < 1e-4 * volume, "{of_x}");
    assert!((of_square - 5.2 * volume).abs() < 1e-4 * 5.2 * volume, "{of_square}");
}

/// ∫ s² t² dV with s and t the places between middles, over a plate with a hole that touches cells by less than
/// coarser planes tell. A sliver of a thousandth of half a cell joins its neighbour: up to 1e-3/4/32² a piece.
#[test]
fn cells_beside_a_cut_agree_on_which_of_them_is_whole() {
    for cells in [16, 32, 64] {
        let h = f64::from(cells).recip();
        let grid = Grid { origin: vector([0.0, 0.0]), spacing: h, cells: [cells; 2] };
        let plate: Shape<2> =
            Difference { of: Box::new(block([0.0; 2], [1.0; 2])), minus: Box::new(ball([0.47, 0.52], 0.23)) }.into();
        let how = Filling { per_axis: 2, layout: Layout::Gauss, degree: 2, ..Filling::default() };
        let square = |x: f64| (x / h + 0.5).fract().powi(2);
        let found: f64 = fill(&grid, &plate, how)
            .unwrap()
            .iter()
            .map(|seed| seed.volume * square(seed.position[0]) * square(seed.position[1]))
            .sum();
        let half = Vector::repeat(0.5 * h);
        let halves = indices([2 * u64::from(cells); 2]).flat_map(|i| {
            let lower = Vector::from_fn(|k, _| i[k] as f64 * half[k]);
            plate.quadrature(&lower, &half, h, 3).unwrap()
        });
        let exact: f64 = halves.map(|seed| seed.volume * square(seed.position[0]) * square(seed.position[1])).sum();
        assert!((found / exact - 1.0).abs() < 1e-5, "{cells}: {found} {exact}");
    }
}
