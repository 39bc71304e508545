//! Cells cut by a shape: volumes, areas and moments, and points that integrate polynomials.

use super::*;

/// Volume, centroid, area and ∫ n dA of a solid, summed over the cells of a grid, and ∫ x·n dA / D, which is the volume, too (Gauss).
fn measured<const D: usize>(grid: &Grid<D>, shape: &Shape<D>) -> (f64, Vector<f64, D>, f64, Vector<f64, D>, f64) {
    let (mut volume, mut moment, mut area) = (0.0, Vector::zeros(), 0.0);
    let (mut normals, mut flux): (Vector<f64, D>, f64) = (Vector::zeros(), 0.0);
    for cell in indices(grid.cells.map(u64::from)) {
        let of = GridBox::cell(grid, cell.map(|i| i as u32));
        let (v, centroid) = shape.part(&of);
        volume += v;
        moment += centroid * v;
        for facet in shape.facets(None, &of) {
            area += facet.area;
            normals += facet.normal * facet.area;
            flux += facet.position.dot(&facet.normal) * facet.area / D as f64;
        }
    }
    (volume, moment / volume, area, normals, flux)
}

#[test]
fn flat_faces_are_cut_exactly() {
    // An L; two boxes that overlap and two that touch, which also make the L; a frame. All solids are turned by 27°, too.
    let l = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]
        .map(|x| vector(x) + vector([0.6, 0.7]));
    let at = |x: [f64; 2]| vector(x) + vector([0.6, 0.7]);
    let cube = |a: [f64; 2], b: [f64; 2]| Shape::from(Block { min: at(a), max: at(b) });
    let hole = Box::new(cube([0.25, 0.25], [0.75, 0.75]));
    let cases: [(Shape<2>, f64, f64); 4] = [
        (Polygon::new(l.to_vec()).unwrap().into(), 4.0, 10.0),
        (Shape::union(vec![cube([0.0, 0.0], [3.0, 1.0]), cube([0.0, 0.0], [1.0, 2.0])]), 4.0, 10.0),
        (Shape::union(vec![cube([0.0, 0.0], [3.0, 1.0]), cube([0.0, 1.0], [1.0, 2.0])]), 4.0, 10.0),
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
            // No slivers remain where a neighbour can take them. Volumes of quadrature points only have to be positive.
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
        let of = GridBox { lower, edges: vector([0.5, 0.5]), spacing: 0.5 };
        let facets = disc.facets(Some(&right.clone().into()), &of);
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
            let corner = Shape::intersection(vec![
                block([0.0, 0.0], [3.0, 3.0]),
                HalfSpace { point: vector([size, 0.0]), normal: vector([1.0, 1.0]) }.into(),
            ]);
            let grid = Grid { origin: vector([0.0, 0.0]), spacing: 2.0, cells: [1, 1] };
            let how = Filling { per_axis: 2, layout: Layout::Gauss, degree, ..Filling::default() };
            let seeds = fill(&grid, &corner, how).unwrap();
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

/// ∮ x ⊗ n dA = V I and ∮ x₁² n₁ dA = 2 V c₁ (Gauss). Points of a curved surface have turned normals, which point the other way in a hole.
#[test]
fn points_of_a_curved_surface_integrate_polynomials() {
    fn integrals<const D: usize>(grid: &Grid<D>, shape: &Shape<D>) -> (Tensor<f64, D>, f64) {
        let (mut of_x, mut of_square) = (Tensor::zeros(), 0.0);
        let edges = Vector::repeat(0.5 * grid.spacing);
        for i in indices(grid.cells.map(|n| 2 * u64::from(n))) {
            let lower = Vector::from_fn(|k, _| grid.origin[k] + i[k] as f64 * edges[k]);
            for point in shape.surface_points(None, &GridBox { lower, edges, spacing: grid.spacing }) {
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

/// ∫ s² t² dV with s and t the positions between the middles of cells, over a plate with a hole. The hole touches some cells by less than
/// coarser planes can tell. A sliver of a thousandth of half a cell joins its neighbour: up to 1e-3/4/32² a piece.
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
            // In one of the half cells no points are found.
            let of = GridBox { lower, edges: half, spacing: h };
            plate.quadrature(&of, 3, 2).unwrap_or_else(|| {
                let (volume, position) = plate.part(&of);
                vec![Seed { position, volume }]
            })
        });
        let exact: f64 = halves.map(|seed| seed.volume * square(seed.position[0]) * square(seed.position[1])).sum();
        assert!((found / exact - 1.0).abs() < 1e-5, "{cells}: {found} {exact}");
    }
}

/// A box off the lines of the grid, whose cut cells are boxes. Each cut cell has as many Gauss points as a full cell, symmetric and with
/// all moments.
#[test]
fn parts_of_cells_that_are_boxes_have_gauss_points() {
    fn check<const D: usize>() {
        let (low, high, cells) = (0.03, 0.96, 4_u32);
        let grid = Grid { origin: Vector::zeros(), spacing: 0.25, cells: [cells; D] };
        let cube: Shape<D> = Block { min: Vector::repeat(low), max: Vector::repeat(high) }.into();
        let mirrored: Shape<D> = Block { min: Vector::repeat(1.0 - high), max: Vector::repeat(1.0 - low) }.into();
        for degree in [1, 3] {
            let how = Filling { per_axis: 2, layout: Layout::Gauss, degree, ..Filling::default() };
            let seeds = fill(&grid, &cube, how).unwrap();
            assert_eq!(seeds.len(), (2 * cells as usize).pow(D as u32), "{D}, {degree}");
            // ∫ Π x_k^{n_k} dV; two points an axis are exact up to the third power.
            for powers in indices([4; D]) {
                let found: f64 = seeds
                    .iter()
                    .map(|seed| (0..D).fold(seed.volume, |all, k| all * seed.position[k].powi(powers[k] as i32)))
                    .sum();
                let along = |n: u64| (high.powi(n as i32 + 1) - low.powi(n as i32 + 1)) / (n + 1) as f64;
                let exact: f64 = powers.iter().map(|&n| along(n)).product();
                assert!((found / exact - 1.0).abs() < 1e-13, "{D}, {degree}, {powers:?}: {found} {exact}");
            }
            let images = fill(&grid, &mirrored, how).unwrap();
            for seed in &seeds {
                let image = seed.position.map(|x| 1.0 - x);
                let same = |other: &&Seed<D>| (other.position - image).amax() < 1e-15;
                let other = images.iter().find(same).unwrap();
                assert!((other.volume / seed.volume - 1.0).abs() < 1e-13, "{D}, {degree}");
            }
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

/// Slivers between two larger parts. The choice of the part does not depend on the order of cells, so a mirrored solid has mirrored
/// particles.
#[test]
fn mirrored_solids_have_mirrored_particles_where_slivers_join() {
    let (h, cells) = (0.2, [7, 8]);
    let grid = Grid { origin: Vector::zeros(), spacing: h, cells };
    // Found by the study `symmetry`: two slivers beside each other.
    let (x, y, radius) = (0.925_633_645_731_744_6, 0.8, 0.368_439_178_269_088_4);
    let how = Filling { per_axis: 2, ..Filling::default() };
    let seeds = |x: f64| fill(&grid, &ball([x, y], radius), how).unwrap();
    let (one, other) = (seeds(x), seeds(1.4 - x));
    assert_eq!(one.len(), other.len());
    for seed in &one {
        let image = Vector::from([1.4 - seed.position[0], seed.position[1]]);
        let apart = other.iter().map(|of| (of.position - image).amax()).fold(f64::INFINITY, f64::min);
        assert!(apart < 1e-12, "{} at {}", apart, seed.position);
    }
}
