//! Surfaces of triangles: against the same solids in other forms, against formulas, and invalid files.

use crate::support::{Failure, with};
use bfree::grid::Grid;
use bfree::scene;
use bfree::shape::{Ball, Block, Difference, Filling, GridBox, Shape, Similar, Surface, SurfaceError, fill, rotation};
use bfree::tensor::Vector;
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};
use std::path::Path;

pub type Point = Vector<f64, 3>;
pub type Triangles = (Vec<Point>, Vec<[u32; 3]>);

fn point(x: [f64; 3]) -> Point {
    Vector::from(x)
}

/// A closed sheet of n × m quadrilaterals, each in two triangles. `place` maps two angles to a point, counter-clockwise from outside.
fn sheet(n: u32, m: u32, place: impl Fn(f64, f64) -> Point) -> Triangles {
    let angle = |i: u32, of: u32| TAU * f64::from(i) / f64::from(of);
    let vertices = (0..n * m).map(|i| place(angle(i / m, n), angle(i % m, m))).collect();
    let at = |i: u32, k: u32| (i % n) * m + k % m;
    let both = |i, k| [[at(i, k), at(i + 1, k), at(i + 1, k + 1)], [at(i, k), at(i + 1, k + 1), at(i, k + 1)]];
    (vertices, (0..n * m).flat_map(|i| both(i / m, i % m)).collect())
}

/// A torus about the z-axis through `center`.
fn torus(n: u32, m: u32, center: Point, [large, small]: [f64; 2]) -> Triangles {
    sheet(n, m, move |a, b| {
        let r = large + small * b.cos();
        center + point([r * a.cos(), r * a.sin(), small * b.sin()])
    })
}

/// A globe of rings of triangles between two poles, at each of which `around` triangles meet.
fn globe(rings: u32, around: u32, center: Point, radius: f64) -> Triangles {
    let mut vertices = vec![center - Vector::z() * radius, center + Vector::z() * radius];
    for i in 0..rings * around {
        let (sin, cos) = (PI * f64::from(i / around + 1) / f64::from(rings + 1)).sin_cos();
        let (y, x) = (TAU * f64::from(i % around) / f64::from(around)).sin_cos();
        vertices.push(center + point([x * sin, y * sin, -cos]) * radius);
    }
    let at = |ring: u32, k: u32| 2 + ring * around + k % around;
    let mut triangles = Vec::new();
    for k in 0..around {
        triangles.extend([[0, at(0, k + 1), at(0, k)], [1, at(rings - 1, k), at(rings - 1, k + 1)]]);
        for ring in 0..rings - 1 {
            triangles.push([at(ring, k), at(ring, k + 1), at(ring + 1, k + 1)]);
            triangles.push([at(ring, k), at(ring + 1, k + 1), at(ring + 1, k)]);
        }
    }
    (vertices, triangles)
}

/// A box; the bits of a corner's number give its coordinates, x first.
pub fn cuboid(min: Point, max: Point) -> Triangles {
    let corner = |i: usize| Vector::from_fn(|k, _| if (i >> k) & 1 == 1 { max[k] } else { min[k] });
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    ((0..8).map(corner).collect(), sides.into_iter().flat_map(halves).collect())
}

fn surface((vertices, triangles): Triangles) -> Result<Shape<3>, SurfaceError> {
    Ok(Surface::new(vertices, triangles)?.into())
}

/// Points without any symmetry in a box.
fn points(min: Point, max: Point) -> impl Iterator<Item = Point> {
    let fraction = |i: u32, k: usize| (f64::from(i) * [0.618034, 0.414214, 0.732051][k]).fract();
    (1..500).map(move |i| Vector::from_fn(|k, _| min[k] + (max[k] - min[k]) * fraction(i, k)))
}

fn filled(shape: &Shape<3>, spacing: f64, cells: [u32; 3]) -> Result<(usize, f64, Point), Failure> {
    let grid = Grid { origin: Vector::zeros(), spacing, cells };
    let seeds = fill(&grid, shape, Filling { per_axis: 2, ..Filling::default() })?;
    let volume = seeds.iter().map(|seed| seed.volume).sum::<f64>();
    Ok((seeds.len(), volume, seeds.iter().map(|seed| seed.position * seed.volume).sum::<Point>() / volume))
}

#[test]
fn a_torus_and_a_globe_of_a_hundred_thousand_triangles_have_their_volumes() -> Result<(), Failure> {
    let center = point([1.503, 1.497, 0.601]);
    let ring = torus(500, 100, center, [1.0, 0.4]);
    assert_eq!(ring.1.len(), 100_000);
    let (_, volume, middle) = filled(&surface(ring)?, 0.1, [30, 30, 13])?;
    // 2 π² R r²
    assert!((volume / (2.0 * PI * PI * 0.16) - 1.0).abs() < 1e-3, "{volume}");
    assert!((middle - center).norm() < 1e-9);

    let globe = globe(249, 200, point([0.6, 0.7, 0.65]), 0.5);
    assert_eq!(globe.1.len(), 99_600);
    let (_, volume, _) = filled(&surface(globe)?, 0.05, [26, 28, 26])?;
    assert!((volume / (PI / 6.0) - 1.0).abs() < 1e-3, "{volume}");
    Ok(())
}

#[test]
fn a_box_of_triangles_is_the_box() -> Result<(), Failure> {
    let (min, max) = (point([-0.5, -0.25, 0.125]), point([0.5, 1.0, 0.75]));
    let (drawn, block) = (Surface::new(cuboid(min, max).0, cuboid(min, max).1)?, Shape::from(Block { min, max }));
    let (about, factor) = (point([0.1, 0.2, 0.3]), 1.25);
    let rotation = rotation(50.0, Some(&point([1.0, 2.0, -0.5]))).ok_or("space")?;
    let turned = Shape::from(drawn.moved(&about, &rotation, factor));
    let similar = Shape::from(Similar { of: Box::new(block.clone()), about, rotation, factor });
    for (one, other) in [(Shape::from(drawn), block), (turned, similar)] {
        for x in points(point([-1.0; 3]), point([1.5; 3])) {
            let ((d, n), (e, m)) = (one.distance_and_normal(&x), other.distance_and_normal(&x));
            assert!((d - e).abs() < 1e-14, "{x}: {d} and {e}");
            assert!((n - m).norm() < 1e-12, "{x}: {n} and {m}");
        }
        for lower in points(point([-1.0; 3]), point([1.0; 3])) {
            let edges = point([0.3, 0.2, 0.25]);
            let of = GridBox { lower, edges, spacing: 1.0 };
            let ((v, x), (w, y)) = (one.part(&of), other.part(&of));
            assert!((v - w).abs() < 1e-14, "{lower}: {v} and {w}");
            assert!(w < 1e-6 || (x - y).norm() < 1e-9, "{lower}: {x} and {y}");
            let sums = |shape: &Shape<3>| {
                let facets = shape.facets(None, &of);
                let normals: Point = facets.iter().map(|facet| facet.normal * facet.area).sum();
                (facets.iter().map(|facet| facet.area).sum::<f64>(), normals)
            };
            let ((a, n), (b, m)) = (sums(&one), sums(&other));
            assert!((a - b).abs() < 1e-9 && (n - m).norm() < 1e-9, "{lower}: area {a} and {b}");
        }
    }
    Ok(())
}

#[test]
fn the_side_of_a_point_is_right_at_edges_that_bend_inwards() -> Result<(), Failure> {
    // A cross of two bars with re-entrant corners: the outline of a plus sign, as a prism.
    let outline = [[1, 0], [2, 0], [2, 1], [3, 1], [3, 2], [2, 2], [2, 3], [1, 3], [1, 2], [0, 2], [0, 1], [1, 1]];
    let n = outline.len() as u32;
    let at = |z: f64| outline.map(|[x, y]: [i32; 2]| point([f64::from(x), f64::from(y), z]));
    let vertices = at(0.0).into_iter().chain(at(1.0)).collect();
    let mut triangles: Vec<[u32; 3]> =
        (0..n).flat_map(|i| [[i, (i + 1) % n, n + (i + 1) % n], [i, n + (i + 1) % n, n + i]]).collect();
    // Each arm has the corners k to k + 3, and the middle has the inner corners.
    for [a, b, c, d] in [[11, 0, 1, 2], [2, 3, 4, 5], [5, 6, 7, 8], [8, 9, 10, 11], [11, 2, 5, 8]] {
        for [a, b, c] in [[a, b, c], [a, c, d]] {
            triangles.extend([[n + a, n + b, n + c], [a, c, b]]);
        }
    }
    let cross = surface((vertices, triangles))?;
    let bar = |min, max| Shape::from(Block { min: point(min), max: point(max) });
    let bars = Shape::union(vec![bar([1.0, 0.0, 0.0], [2.0, 3.0, 1.0]), bar([0.0, 1.0, 0.0], [3.0, 2.0, 1.0])]);
    for x in points(point([-1.0; 3]), point([4.0, 4.0, 2.0])) {
        let (d, e) = (cross.signed_distance(&x), bars.signed_distance(&x));
        // Outside, the distance from a union is exact; inside it is no larger.
        assert!(if e > 0.0 { (d - e).abs() < 1e-14 } else { d <= e + 1e-14 }, "{x}: {d} and {e}");
    }
    let (_, volume, center) = filled(&cross, 0.3, [11, 11, 4])?;
    assert!((volume - 5.0).abs() < 1e-12 && (center - point([1.5, 1.5, 0.5])).norm() < 1e-12);
    Ok(())
}

#[test]
fn surfaces_are_combined_with_other_shapes() -> Result<(), Failure> {
    let center = point([1.503, 1.497, 0.601]);
    let ring = surface(torus(60, 30, center, [1.0, 0.4]))?;
    let (_, whole, _) = filled(&ring, 0.1, [30, 30, 13])?;
    let ball = |at: Point, radius| Box::new(Shape::from(Ball { center: at, radius }));
    let hole = Difference { of: Box::new(ring.clone()), minus: ball(center + point([1.0, 0.0, 0.0]), 0.3) };
    let (_, volume, _) = filled(&hole.into(), 0.1, [30, 30, 13])?;
    let of_ball = 4.0 / 3.0 * PI * 0.027;
    assert!(((whole - volume) / of_ball - 1.0).abs() < 1e-3, "{whole} {volume}");
    let beside = Shape::union(vec![ring.clone(), *ball(center, 0.3)]);
    let (_, volume, _) = filled(&beside, 0.1, [30, 30, 13])?;
    assert!(((volume - whole) / of_ball - 1.0).abs() < 1e-3, "{whole} {volume}");
    // Halved by a plane of symmetry, where two surfaces meet.
    let half = Block { min: point([0.0; 3]), max: point([3.0, center[1], 1.3]) };
    let (_, volume, _) = filled(&Shape::intersection(vec![ring, half.into()]), 0.1, [30, 30, 13])?;
    assert!((volume / whole - 0.5).abs() < 1e-4, "{whole} {volume}");
    Ok(())
}

#[test]
fn the_facets_of_a_surface_are_all_of_it() -> Result<(), Failure> {
    let (large, small, center) = (1.0, 0.4, point([1.503, 1.497, 0.601]));
    let (vertices, triangles) = torus(60, 30, center, [large, small]);
    let corner = |i: u32| vertices[i as usize];
    let area_of = |[a, b, c]: &[u32; 3]| 0.5 * (corner(*b) - corner(*a)).cross(&(corner(*c) - corner(*a))).norm();
    let exact: f64 = triangles.iter().map(area_of).sum();
    let ring = surface((vertices, triangles))?;
    let upper = Shape::from(Block { min: point([-9.0, -9.0, center[2]]), max: point([9.0; 3]) });
    for (region, share) in [(None, 1.0), (Some(&upper), 0.5)] {
        let (mut area, mut normals) = (0.0, point([0.0; 3]));
        for i in 0..30 * 30 * 13 {
            let lower = point([f64::from(i % 30), f64::from(i / 30 % 30), f64::from(i / 900)]) * 0.1;
            for facet in ring.facets(region, &GridBox { lower, edges: Vector::repeat(0.1), spacing: 0.1 }) {
                area += facet.area;
                normals += facet.normal * facet.area;
            }
        }
        assert!((area / (share * exact) - 1.0).abs() < 1e-9, "{area} of {exact}");
        // A closed surface has ∫ n dA = 0. The upper half has the integral of the ring's shadow, seen from below.
        let shadow = if share == 1.0 { 0.0 } else { 4.0 * PI * large * small };
        assert!((normals - point([0.0, 0.0, shadow])).norm() < 1e-2 * shadow.max(1e-9), "{normals}");
    }
    Ok(())
}

#[test]
fn surfaces_that_bound_nothing_are_refused_with_the_place() {
    let (vertices, triangles) = cuboid(point([0.0; 3]), point([1.0; 3]));
    let new = |vertices: &[Point], triangles: Vec<[u32; 3]>| Surface::new(vertices.to_vec(), triangles).map(|_| ());
    assert_eq!(new(&vertices, triangles.clone()), Ok(()));
    let inside_out = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    assert_eq!(new(&vertices, inside_out), Ok(()));
    assert_eq!(new(&vertices, triangles[1..].to_vec()), Err(SurfaceError::Open([0.0; 3], [1.0, 1.0, 0.0])));
    let mut turned = triangles.clone();
    turned[0].swap(0, 1);
    assert!(matches!(new(&vertices, turned), Err(SurfaceError::Unorientable(..))));
    let twice = [triangles.clone(), triangles.clone()].concat();
    assert!(matches!(new(&vertices, twice), Err(SurfaceError::Unorientable(..))));
    assert_eq!(new(&vertices, vec![[0, 1, 8]]), Err(SurfaceError::NoVertex { triangle: 0, vertex: 8, vertices: 8 }));
    assert_eq!(new(&vertices, vec![]), Err(SurfaceError::Empty));
    assert_eq!(new(&vertices, vec![[0, 0, 1]]), Err(SurfaceError::Empty));
    assert_eq!(new(&vertices, vec![[0, 1, 2], [0, 2, 1]]), Err(SurfaceError::Flat));
    let mut lost = vertices.clone();
    lost[3][1] = f64::NAN;
    assert!(matches!(new(&lost, triangles.clone()), Err(SurfaceError::NotFinite(_))));
    // Two boxes that overlap, through faces and exactly through a diagonal; apart they are one solid in two parts.
    let both = |by: Point| {
        let (others, more) = cuboid(by, by + point([1.0; 3]));
        let all: Vec<Point> = vertices.iter().copied().chain(others).collect();
        new(&all, triangles.iter().copied().chain(more.iter().map(|triangle| triangle.map(|i| i + 8))).collect())
    };
    assert_eq!(both(point([2.0, 0.0, 0.0])), Ok(()));
    for by in [point([0.5; 3]), point([0.3, 0.4, 0.7])] {
        let Err(SurfaceError::Crossing(at)) = both(by) else { panic!("{:?}", both(by)) };
        let (low, high) = (by.min(), 1.0);
        assert!(
            at.iter().all(|&x| x >= low && x <= high) && at.iter().any(|&x| x == 1.0 || by.iter().any(|&y| y == x)),
            "{at:?}"
        );
    }
}

/// A box in a box is a cavity if its faces point the other way, and otherwise a second solid in the same place.
#[test]
fn parts_of_a_surface_are_inside_and_outside_by_turns() {
    let boxes = |sizes: &[(f64, bool)]| {
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for &(half, outwards) in sizes {
            let first = vertices.len() as u32;
            let (corners, sides) = cuboid(point([-half; 3]), point([half; 3]));
            vertices.extend(corners);
            triangles
                .extend(sides.iter().map(|&[a, b, c]| if outwards { [a, b, c] } else { [a, c, b] }.map(|i| i + first)));
        }
        Surface::<3>::new(vertices, triangles).map(|_| ())
    };
    assert_eq!(boxes(&[(1.0, true), (0.5, false)]), Ok(()));
    assert_eq!(boxes(&[(1.0, true), (0.5, false), (0.25, true)]), Ok(()));
    for wrong in [&[(1.0, true), (0.5, true)][..], &[(1.0, true), (0.5, false), (0.25, false)]] {
        assert!(matches!(boxes(wrong), Err(SurfaceError::Nested(_))), "{wrong:?}");
    }
}

pub fn stl((vertices, triangles): &Triangles, path: &Path) -> Result<(), Failure> {
    let vertex = |i: u32| stl_io::Vertex::new(std::array::from_fn(|k| vertices[i as usize][k] as f32));
    let normal = stl_io::Normal::new([0.0; 3]);
    let faces = triangles.iter().map(|triangle| stl_io::Triangle { normal, vertices: triangle.map(vertex) });
    stl_io::write_stl(&mut std::fs::File::create(path)?, faces)?;
    Ok(())
}

pub fn ascii_stl((vertices, triangles): &Triangles) -> String {
    let vertex = |i: &u32| vertices[*i as usize];
    let facet = |triangle: &[u32; 3]| {
        let corners: String =
            triangle.iter().map(vertex).map(|x| format!("vertex {} {} {}\n", x[0], x[1], x[2])).collect();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    format!("solid box\n{}endsolid box\n", triangles.iter().map(facet).collect::<String>())
}

pub fn ply((vertices, _): &Triangles) -> String {
    let header = "ply\nformat ascii 1.0\nelement vertex 8\nproperty double x\nproperty double y\nproperty double z\n\
                  element face 6\nproperty list uchar int vertex_indices\nend_header\n";
    let places: String = vertices.iter().map(|x| format!("{} {} {}\n", x[0], x[1], x[2])).collect();
    format!("{header}{places}4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n")
}

fn with_shape(shape: &Value) -> Value {
    json!({
        "grid": {"size": [4, 4, 4], "spacing": 0.25}, "time": {"step": 1, "end": 1, "scheme": "none"},
        "bodies": [{"name": "body", "shape": shape, "density": 1, "material": {"neo_hookean": {"young": 100, "poisson": 0.3}}}],
        "prescribed": [{"region": shape, "displacement": [[0, [0, 0, 0]]]}]
    })
}

#[test]
fn a_body_has_the_shape_in_a_file() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let cube = cuboid(point([1.0; 3]), point([2.0, 2.5, 1.75]));
    stl(&cube, &at("cube.stl"))?;
    std::fs::write(at("text.STL"), ascii_stl(&cube))?;
    std::fs::write(at("cube.ply"), ply(&cube))?;
    let build = |shape: &Value| -> Result<_, Failure> {
        Ok(scene::read(&with_shape(shape).to_string(), &[])?.build::<3>(folder.path())?)
    };
    let drawn = build(&json!({"box": {"min": [1, 1, 1], "max": [2, 2.5, 1.75]}}))?;
    for name in ["cube.stl", "text.STL", "cube.ply"] {
        let mut read = build(&json!({"surface": {"file": name}}))?;
        let (one, other) = (&read.particles, &drawn.particles);
        assert_eq!(one.len(), other.len(), "{name}");
        let near = |(x, y): (&Point, &Point)| (x - y).norm() < 1e-12;
        assert!(one.position.iter().zip(&other.position).all(near), "{name}");
        assert!(one.volume.iter().zip(&other.volume).all(|(v, w)| (v - w).abs() < 1e-12));
        // All nodes of the body are held: the surface serves as a region, too.
        let before = read.particles.by_id().position;
        read.advance()?;
        assert_eq!(read.particles.by_id().position, before);
    }
    let doubled = json!({"scaled": {"of": {"surface": {"file": "cube.stl"}}, "about": [1, 1, 1], "factor": 1.5}});
    let turned = json!({"rotated": {"of": doubled, "about": [2, 2, 2], "angle": 20, "axis": [0, 0, 1]}});
    let volume = build(&turned)?.particles.volume.iter().sum::<f64>();
    assert!((volume / (1.125 * 1.5_f64.powi(3)) - 1.0).abs() < 1e-9, "{volume}");
    Ok(())
}

#[test]
fn files_that_are_no_surface_are_named_with_the_key_and_the_place() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let cube = cuboid(point([1.0; 3]), point([2.0; 3]));
    stl(&(cube.0.clone(), cube.1[1..].to_vec()), &at("open.stl"))?;
    stl(&cuboid(point([1.0; 3]), point([5.0; 3])), &at("large.stl"))?;
    std::fs::write(at("short.stl"), [1; 100])?;
    std::fs::write(at("cut.ply"), &ply(&cube).into_bytes()[..230])?;
    std::fs::write(at("lines.ply"), ply(&cube).replace("4 0 2 3 1\n", "2 0 2\n"))?;
    std::fs::write(at("flat.ply"), ply(&cube).replace("property double z", "property double w"))?;
    std::fs::write(at("far.ply"), ply(&cube).replace("4 0 2 3 1\n", "4 0 2 3 99\n"))?;
    std::fs::create_dir(at("folder.stl"))?;
    let wrong = [
        ("open.stl", "open surface: only one triangle has the edge from [1.0, 1.0, 1.0]"),
        ("large.stl", "x = 1 to 5 is not allowed; must lie in the grid, from x = 0 to 4"),
        ("short.stl", "cannot be read"),
        ("cut.ply", "cannot be read"),
        ("lines.ply", "face 0 has 2 corners"),
        ("flat.ply", "has no x, y and z of its vertices"),
        ("far.ply", "holds a triangle with vertex 99, of 8"),
        ("folder.stl", "is no regular file"),
        ("nowhere.stl", "No such file"),
    ];
    for (name, words) in wrong {
        let scene = scene::read(&with_shape(&json!({"union": [{"surface": {"file": name}}]})).to_string(), &[])?;
        let error = scene.build::<3>(folder.path()).err().ok_or(name)?.to_string();
        let key = if name == "large.stl" { "bodies[0].shape: " } else { "bodies[0].shape.union[0].surface.file: " };
        assert!(error.starts_with(key) && error.contains(words), "{name}: {error}");
    }
    let of_file = |file: &str| with_shape(&json!({"surface": {"file": file}}));
    let plane = with(of_file("bone.stl"), &[("/grid/size", json!([4, 4]))]);
    for (scene, words) in [
        (of_file("bone.obj"), "bodies[0].shape.surface.file: \"bone.obj\" is not allowed; must end in .stl or .ply"),
        (plane, "bodies[0].shape.surface: a surface is not allowed; it needs a grid of 3 dimensions"),
    ] {
        let error = scene::read(&scene.to_string(), &[]).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    Ok(())
}
