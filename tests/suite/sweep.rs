//! The fast sweep against the plain one, which is its specification.

use bfree::approximation::{Approximation, Linear, Lme, ShapeFunction};
use bfree::grid::Grid;
use bfree::material::{FrozenTangent, Lame, Law, Material};
use bfree::material::{Lame, Law, Material, NeoHookean, StVenantKirchhoff};
use bfree::mechanics::residual::{Carry, Equilibrium};
use bfree::mechanics::sweep::{Laws, Supports};
use bfree::mechanics::sweep::{Laws, Supports};
use bfree::mechanics::tangent::frozen_bytes;
use bfree::mechanics::tangent::{frozen_bytes, has_closed_form};
use bfree::mechanics::time::Newmark;
use bfree::mechanics::transfer::Nodal;
use bfree::nodes::Nodes;
use bfree::particles::{Body, Particles};
use bfree::solver::Precision;
use bfree::tensor::{Deformation, Tensor, Vector, identity};
use num_dual::Dual64;
use std::convert::Infallible;

type Failure = Box<dyn std::error::Error>;

/// Numbers without pattern in (−1, 1): the golden-ratio sequence.
struct Irregular(u32);

impl Irregular {
    fn number(&mut self) -> f64 {
        self.0 += 1;
        2.0 * (f64::from(self.0) * 0.618_033_988_749_894_9).fract() - 1.0
    }

    fn vector<const D: usize>(&mut self) -> Vector<f64, D> {
        Vector::from_fn(|_, _| self.number())
    }
}

fn shapes() -> Vec<Approximation> {
    let products =
        Approximation::examples().into_iter().map(|(_, shape)| shape).filter(|shape| shape.separable().is_some());
    // Weights that underflow in a product.
    products.chain([Lme::new(40.0, 1e-100).into()]).collect()
}

/// A small box with a block of jittered particles in it, some on walls, faces and nodes, some crowded, some alone.
fn case<const D: usize>() -> (Grid<D>, Vec<Vector<f64, D>>) {
    let cells: [u32; D] = std::array::from_fn(|k| [23, 11, 7][k]);
    let grid = Grid { origin: Vector::repeat(-0.3), spacing: 0.1, cells };
    let upper: Vector<f64, D> = grid.position(cells);
    let mut random = Irregular(0);
    let mut positions = Vec::new();
    let inside = |x: Vector<f64, D>| x.zip_map(&grid.origin, f64::max).zip_map(&upper, f64::min);
    // Eight a cell in 3D, moderately jittered; the order of the particles is not that of the cells.
    let side: [usize; D] = std::array::from_fn(|k| if D == 3 { [14, 12, 8][k] } else { [30, 14, 1][k] });
    let count: usize = side.iter().product();
    for i in 0..count {
        let mut rest = (i * 7919) % count;
        let x = Vector::from_fn(|k, _| {
            let at = rest % side[k];
            rest /= side[k];
            grid.origin[k] + 0.1 + 0.05 * at as f64 + 0.025
        });
        positions.push(inside(x + random.vector() * 0.02));
    }
    // Anywhere, many a cell, and a crowd in one cell.
    for i in 0..60 {
        let scale = if i < 30 { 0.35 } else { 0.049 };
        positions.push(inside(grid.origin + Vector::repeat(0.35) + random.vector() * scale));
    }
    // On nodes, walls, edges and faces.
    positions.push(grid.origin);
    positions.push(upper);
    for k in 0..D {
        let mut on_wall: Vector<f64, D> = grid.origin + Vector::repeat(0.234);
        on_wall[k] = upper[k];
        positions.push(on_wall);
        on_wall[k] = grid.position([3; D])[k];
        positions.push(on_wall);
    }
    positions.push(grid.position([2; D]));
    (grid, positions)
}

/// A point function without symmetry, that names particle and state.
fn point<const D: usize>(
    p: usize,
    u: Vector<f64, D>,
    l: Tensor<f64, D>,
) -> Result<(Vector<f64, D>, Tensor<f64, D>), Infallible> {
    let a = Tensor::from_fn(|i, k| 1.0 + 0.3 * (i as f64) - 0.7 * (k as f64) + 1e-3 * p as f64);
    Ok((u * 2.0 + l * u, l * a + a * l.transpose() + a))
}

fn field<const D: usize>(nodes: &Nodes) -> Vec<Vector<f64, D>> {
    let mut random = Irregular(1000);
    (0..nodes.len()).map(|_| random.vector()).collect()
}

/// Largest difference over largest value.
fn difference<const D: usize>(a: &[Vector<f64, D>], b: &[Vector<f64, D>]) -> f64 {
    assert_eq!(a.len(), b.len());
    let largest = b.iter().map(|x| x.amax()).fold(0.0, f64::max);
    a.iter().zip(b).map(|(a, b)| (a - b).amax()).fold(0.0, |worst, d| if d <= worst { worst } else { d }) / largest
}

fn compare<const D: usize>() {
    let (grid, positions) = case::<D>();
    for shape in shapes() {
        let (fast, nodes) = Supports::new(&shape, &grid, &positions).unwrap();
        let (plain, expected) = Supports::plain(&shape, &grid, &positions).unwrap();
        assert_eq!(nodes, expected, "{shape:?}");
        assert_eq!(fast.particles(), positions.len());
        for p in 0..positions.len() {
            let (a, b): (Vec<_>, Vec<_>) = (fast.of(p).collect(), plain.of(p).collect());
            assert_eq!(a, b, "{shape:?} at {:?}", positions[p]);
        }
        let u = field::<D>(&nodes);
        let zeros = vec![Vector::zeros(); u.len()];
        let assembled = |supports: &Supports<D>| {
            let mut out = zeros.clone();
            supports.assemble(&u, &mut out, point).unwrap();
            out
        };
        let worst = difference(&assembled(&fast), &assembled(&plain));
        assert!(worst < 1e-12, "{D}D {shape:?}: assembled {worst:e}");
        let magnitudes = |supports: &Supports<D>| {
            let mut out = zeros.clone();
            supports.assemble_magnitudes(&u, &mut out, point).unwrap();
            out
        };
        let worst = difference(&magnitudes(&fast), &magnitudes(&plain));
        assert!(worst < 1e-12, "{D}D {shape:?}: magnitudes {worst:e}");
        let worst = difference(&fast.values(&u), &plain.values(&u));
        assert!(worst < 1e-12, "{D}D {shape:?}: values {worst:e}");
        let squares = |supports: &Supports<D>| {
            let mut out = zeros.clone();
            supports.scatter(&mut out, |p, n, grad_n| grad_n * (n * n + 1e-3 * p as f64));
            out
        };
        let worst = difference(&squares(&fast), &squares(&plain));
        assert!(worst < 1e-12, "{D}D {shape:?}: scatter {worst:e}");
        // Dual numbers take the plain loops over the fast storage.
        let seeded: Vec<Vector<Dual64, D>> = u.iter().map(|u| u.map(|x| Dual64::new(x, 0.5 - x))).collect();
        let duals = |supports: &Supports<D>| {
            let mut out = vec![Vector::<Dual64, D>::zeros(); u.len()];
            let square = |_, u: Vector<Dual64, D>, l: Tensor<Dual64, D>| Ok::<_, Infallible>((l * u, l * l));
            supports.assemble(&seeded, &mut out, square).unwrap();
            out.iter().map(|x| x.map(|x| x.eps)).collect::<Vec<_>>()
        };
        let worst = difference(&duals(&fast), &duals(&plain));
        assert!(worst < 1e-12, "{D}D {shape:?}: dual numbers {worst:e}");
    }
}

#[test]
fn the_fast_sweep_gives_the_answer_of_the_plain_one() {
    compare::<1>();
    compare::<2>();
    compare::<3>();
}

#[test]
fn any_number_of_threads_sums_the_same_bits() {
    let (grid, positions) = case::<3>();
    for shape in [Approximation::from(Linear), Lme::new(3.0, 1e-6).into()] {
        let sums = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let (supports, nodes) = Supports::new(&shape, &grid, &positions).unwrap();
                let u = field::<3>(&nodes);
                let mut out = vec![Vector::zeros(); u.len()];
                supports.assemble(&u, &mut out, point).unwrap();
                out
            })
        };
        let one = sums(1);
        for threads in [2, 5] {
            let many = sums(threads);
            let same =
                one.iter().zip(&many).all(|(a, b)| a.iter().zip(b.iter()).all(|(a, b)| a.to_bits() == b.to_bits()));
            assert!(same, "{threads} threads");
        }
    }
}

/// A particle in each of the cells, jittered, and a law.
fn one_a_cell<const D: usize>(cells: [u32; D]) -> Result<(Grid<D>, Particles<D>, [Body<Material>; 1]), Failure> {
    let (grid, positions) = regular(cells, 1);
    let grid = Grid { cells: cells.map(|n| n + 1), ..grid };
    let (mut random, mut particles) = (Irregular(0), Particles::default());
    for x in positions {
        particles.push(x + random.vector() * 0.3, random.vector(), 1.0, 1.0 + 0.5 * random.number(), 0);
    }
    let law = Material::from(NeoHookean::ciarlet(Lame::new(2.0, 1.0)?));
    Ok((grid, particles, [Body { name: "body".into(), law, density: 1.0 }]))
}

/// What a step computes by sums over blocks.
fn computed<const D: usize>(
    supports: &Supports<D>,
    nodes: &Nodes,
    particles: &Particles<D>,
    bodies: &[Body<Material>],
) -> Result<[(&'static str, Vec<f64>); 8], Failure> {
    let flat = |field: &[Vector<f64, D>]| field.iter().flat_map(|x| x.iter().copied()).collect::<Vec<_>>();
    let nodal = Nodal::project(particles, supports, nodes.len(), 1.0)?;
    let (alphas, load) = (Newmark::default().alphas(1.0), vec![Vector::zeros(); nodes.len()]);
    let equilibrium = Equilibrium::new(particles, bodies, supports, alphas, 0.5, &nodal, load, vec![], &[]);
    let u = field::<D>(nodes);
    let dphi: Vec<_> = u.iter().map(|u| u * 0.02).collect();
    let mut gathered = vec![0.0; particles.len()];
    supports.each_particle(&u, |_, value, gradient| value.sum() + gradient.sum(), |p, sum| gathered[p] = sum);
    let mut product = vec![Vector::zeros(); u.len()];
    let tangent = equilibrium.tangent(&dphi)?;
    tangent.product(&u, &mut product);
    let (energy, magnitude) = equilibrium.potential(&dphi).ok_or("a potential")??;
    Ok([
        ("mass", nodal.mass.to_vec()),
        ("momentum", flat(&nodal.velocity)),
        ("values", flat(&supports.values(&u))),
        ("values and gradients", gathered),
        ("forces", flat(&equilibrium.residual(&dphi, Carry::ALL)?)),
        ("product with the tangent", flat(&product)),
        ("diagonal blocks", tangent.diagonal_blocks().iter().flat_map(|block| block.iter().copied()).collect()),
        ("energies and magnitudes", vec![energy, magnitude, equilibrium.magnitude(&dphi)?]),
    ])
}

fn several_waves<const D: usize>(cells: [u32; D]) -> Result<(), Failure> {
    let (grid, particles, bodies) = one_a_cell(cells)?;
    let (shape, at) = (Approximation::from(Linear), &particles.position);
    let in_waves = |threads: usize| -> Result<_, Failure> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        pool.install(|| {
            let (supports, nodes) = Supports::new(&shape, &grid, at).map_err(|error| error.to_string())?;
            computed(&supports, &nodes, &particles, &bodies).map_err(|error| error.to_string())
        })
        .map_err(Failure::from)
    };
    let one = in_waves(1)?;
    let (plain, nodes) = Supports::plain(&shape, &grid, at)?;
    for ((name, fast), (_, plain)) in one.iter().zip(computed(&plain, &nodes, &particles, &bodies)?) {
        assert_eq!(fast.len(), plain.len(), "{D}D: {name}");
        let largest = plain.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let close = fast.iter().zip(&plain).all(|(a, b)| (a - b).abs() <= 1e-12 * largest);
        assert!(close && largest > 0.0, "{D}D: {name} of the plain sweep differ");
    }
    for threads in [2, 5] {
        for ((name, one), (_, many)) in one.iter().zip(in_waves(threads)?) {
            let same = one.len() == many.len() && one.iter().zip(&many).all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(same, "{D}D: {name} with {threads} threads differ");
        }
    }
    Ok(())
}

/// Blocks are 16² or 4³ cells, and a wave has 64 of them: here are 72 and 150.
#[test]
fn several_waves_of_blocks_sum_the_same_bits_and_those_of_the_plain_sweep() -> Result<(), Failure> {
    several_waves([144, 128])?;
    several_waves([20, 20, 24])
}

/// What is left of other supports, with other blocks, widths and precision, is not seen.
fn renewal<const D: usize>() {
    let (grid, after) = case::<D>();
    let mut random = Irregular(7);
    let before: Vec<Vector<f64, D>> =
        after.iter().map(|_| grid.origin + random.vector::<D>().map(|x| (0.5 + 0.4 * x) * 0.7)).collect();
    for shape in shapes() {
        let anew = Supports::with_precision(&shape, &grid, &after, Precision::Mixed).unwrap();
        for (other, precision) in shapes().into_iter().zip([Precision::Double, Precision::Mixed].into_iter().cycle()) {
            let (spare, _) = Supports::with_precision(&other, &grid, &before, precision).unwrap();
            let renewed = Supports::renewed(Some(spare), &shape, &grid, &after, None, Precision::Mixed).unwrap();
            assert_eq!(renewed.1, anew.1);
            assert_eq!(renewed.0.windows(), anew.0.windows());
            for p in 0..after.len() {
                assert!(renewed.0.of(p).eq(anew.0.of(p)), "{shape:?} after {other:?}: particle {p}");
            }
            // Every lane is summed here, also those that belong to no particle.
            let u = field::<D>(&anew.1);
            assert_eq!(sums(&renewed.0, &u), sums(&anew.0, &u));
        }
    }
}

fn sums<const D: usize>(supports: &Supports<D>, u: &[Vector<f64, D>]) -> Vec<Vector<f64, D>> {
    let mut out = vec![Vector::zeros(); u.len()];
    supports.assemble(u, &mut out, |_, u, l| Ok::<_, Infallible>((u, l))).unwrap();
    out
}

#[test]
fn supports_do_not_depend_on_those_whose_memory_they_use() {
    renewal::<1>();
    renewal::<2>();
    renewal::<3>();
}

#[test]
fn the_first_particle_that_fails_is_named() {
    let (grid, mut positions) = case::<2>();
    for shape in shapes() {
        let (fast, nodes) = Supports::new(&shape, &grid, &positions).unwrap();
        let u = field::<2>(&nodes);
        let mut out = vec![Vector::zeros(); u.len()];
        let fails = |p: usize, u, l| if p % 100 == 77 { Err(p) } else { Ok((u, l)) };
        assert_eq!(fast.assemble(&u, &mut out, fails), Err(77));
        assert_eq!(fast.interpolate(&u, |p, _, _: Tensor<f64, 2>| if p > 99 { Err(p) } else { Ok(()) }), Err(100));
    }
    positions[300][1] = f64::NAN;
    positions[200][0] = 17.0;
    for shape in shapes() {
        let fast = Supports::new(&shape, &grid, &positions).map(|_| ()).unwrap_err();
        let plain = Supports::plain(&shape, &grid, &positions).map(|_| ()).unwrap_err();
        assert_eq!((fast.particle, fast.source), (plain.particle, plain.source));
        assert_eq!(plain.particle, 200);
    }
}

/// Cells of edge 1, `per_axis` particles along each axis of the cells `cells`, counted from the corner.
fn regular<const D: usize>(cells: [u32; D], per_axis: u32) -> (Grid<D>, Vec<Vector<f64, D>>) {
    let side = cells.map(|n| n * per_axis);
    let place = |p: u32, k: usize| p / side[..k].iter().product::<u32>() % side[k];
    let at = |p: u32| Vector::from_fn(|k, _| (f64::from(place(p, k)) + 0.5) / f64::from(per_axis));
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [64; D] };
    (grid, (0..side.iter().product()).map(at).collect())
}

/// How often each window (nodes along each axis, particles) is there.
fn windows<const D: usize>(cells: [u32; D], per_axis: u32) -> Vec<([usize; 3], usize, usize)> {
    let (grid, positions) = regular(cells, per_axis);
    let (supports, _) = Supports::new(&Approximation::from(Linear), &grid, &positions).unwrap();
    let mut all = supports.windows();
    all.sort_unstable();
    all.chunk_by(|a, b| a == b).map(|same| (same[0].0, same[0].1, same.len())).collect()
}

#[test]
fn a_regular_layout_fills_the_vector_lanes() {
    // Eight particles a cell, 2×2×2 nodes; four a cell, two cells side by side; two a cell, four side by side.
    assert_eq!(windows([6, 5, 4], 2), [([2, 2, 2], 8, 120)]);
    assert_eq!(windows([32, 20], 2), [([3, 2, 1], 8, 320)]);
    assert_eq!(windows([64], 2), [([5, 1, 1], 8, 16)]);
    // One a cell: no more cells side by side than six nodes hold, and none from another block (32 cells in 1D, 16 in 2D,
    // 4 in 3D) or another row.
    assert_eq!(windows([64], 1), [([3, 1, 1], 2, 2), ([6, 1, 1], 5, 12)]);
    assert_eq!(windows([32, 3], 1), [([2, 2, 1], 1, 6), ([6, 2, 1], 5, 18)]);
    assert_eq!(windows([8, 2, 2], 1), [([5, 2, 2], 4, 8)]);
    // Nine or more in a cell: eight, and the rest.
    assert_eq!(windows([3, 1], 3), [([2, 2, 1], 1, 3), ([2, 2, 1], 8, 3)]);
    assert_eq!(windows([2], 9), [([2, 1, 1], 1, 2), ([2, 1, 1], 8, 2)]);
    // Cells apart do not share a window.
    let grid = Grid::<1> { origin: Vector::zeros(), spacing: 1.0, cells: [64] };
    let apart = [0.5, 2.5, 3.5].map(|x| Vector::from([x]));
    let (supports, _) = Supports::new(&Approximation::from(Linear), &grid, &apart).unwrap();
    assert_eq!(supports.windows(), [([2, 1, 1], 1), ([3, 1, 1], 2)]);
    let (plain, _) = Supports::plain(&Approximation::from(Linear), &grid, &apart).unwrap();
    assert!(plain.windows().is_empty());
}

fn bytes_are_those_of_the_arrays<const D: usize>() -> Result<(), Failure> {
    let (grid, positions) = regular([3; D], 2);
    let bytes = |positions: &[Vector<f64, D>]| {
        Supports::plain(&Approximation::from(Linear), &grid, positions).map(|(plain, _)| plain.bytes())
    };
    let (plain, nodes) = Supports::plain(&Approximation::from(Linear), &grid, &positions)?;
    let entries: usize = (0..positions.len()).map(|p| plain.of(p).count()).sum();
    assert!(positions.len() <= 256, "one block");
    // An entry is a place in the list of nodes, N and ∇N; particles say where their entries begin.
    assert_eq!(plain.bytes(), entries * (4 + 8 + 8 * D) + 4 * (nodes.len() + positions.len() + 1));
    let many: Vec<_> = positions.iter().cycle().take(600).copied().collect();
    assert_eq!(bytes(&many)?, bytes(&many[..256])? + bytes(&many[256..512])? + bytes(&many[512..])?);
    // Weights of every window, eight lanes wide; the particles of each lane; a slot of each particle; the nodes twice.
    let (tiled, nodes) = Supports::new(&Approximation::from(Linear), &grid, &positions)?;
    let windows = tiled.windows();
    let weights: usize = windows.iter().map(|(width, _)| 2 * 64 * width[..D].iter().sum::<usize>()).sum();
    let least = weights + windows.len() * (8 * 4 + 12) + 4 * positions.len() + 8 * nodes.len();
    assert!((least..least + 512).contains(&tiled.bytes()), "{} for at least {least}", tiled.bytes());
    Ok(())
}

fn frozen_bytes_are_those_of_the_tangent<const D: usize>(law: &Material) -> Result<(), Failure> {
    let (grid, positions) = regular([3; D], 2);
    let shape = Approximation::from(Linear);
    let bodies = [Body { name: "body".into(), law: law.clone(), density: 1.0 }];
    let (tiled, nodes) = Supports::with_precision(&shape, &grid, &positions, Precision::Mixed)?;
    let field = vec![Vector::zeros(); nodes.len()];
    let mut particles = Particles::default();
    positions.iter().for_each(|&x| particles.push(x, Vector::zeros(), 1.0, 1.0, 0));
    for lumping in [1.0, 0.5] {
        let form = law.freeze(&identity(), &Deformation::new(Tensor::<f64, D>::zeros()), 1.0).closed();
        let both = form.ok_or("no closed form")?.both.is_some();
        let weight = |_: usize| 1.0;
        let inertia: Option<&(dyn Fn(usize) -> f64 + Sync)> = if lumping < 1.0 { Some(&weight) } else { None };
        let laws = Laws { particles: &particles, bodies: &bodies };
        let frozen = tiled.closed_tangents(&laws, &field, both, inertia).ok_or("no vector lanes")?;
        let single = tiled.single_tangents(&laws, &field, both, inertia, 1.0).ok_or("no vector lanes")?;
        let (frozen, single) = (frozen.map_err(|_| "no closed form")?, single.map_err(|_| "no closed form")?);
        assert!(frozen.bytes() > 0 && single.bytes() > 0);
        for (precision, bytes) in [(Precision::Double, frozen.bytes()), (Precision::Mixed, single.bytes())] {
            let counted = frozen_bytes(&bodies, &tiled, lumping, precision);
            assert_eq!(counted, bytes, "{D}D {law:?}, ε = {lumping}, {precision:?}");
        }
        let (plain, _) = Supports::plain(&shape, &grid, &positions)?;
        let each = size_of::<<Material as Law>::Frozen<f64, D>>();
        assert_eq!(frozen_bytes(&bodies, &plain, lumping, Precision::Double), positions.len() * each);
        assert!(plain.closed_bytes(both, lumping < 1.0, Precision::Double).is_none());
    }
    Ok(())
}

#[test]
fn bytes_are_counted_as_they_are_stored() -> Result<(), Failure> {
    bytes_are_those_of_the_arrays::<1>()?;
    bytes_are_those_of_the_arrays::<2>()?;
    bytes_are_those_of_the_arrays::<3>()?;
    let lame = Lame::new(1.0, 1.0)?;
    let closed =
        |law: &Material| has_closed_form::<2, _>(&[Body { name: "body".into(), law: law.clone(), density: 1.0 }]);
    for (_, law) in Material::examples(lame).iter().filter(|(_, law)| closed(law)) {
        frozen_bytes_are_those_of_the_tangent::<1>(law)?;
        frozen_bytes_are_those_of_the_tangent::<2>(law)?;
        frozen_bytes_are_those_of_the_tangent::<3>(law)?;
    }
    Ok(())
}
