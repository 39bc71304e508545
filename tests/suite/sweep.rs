//! The fast particle–grid transfer against the plain one, which is its specification.

mod stored;

use crate::support::{Failure, Watched, body, closed_laws, difference, in_threads, irregular};
use bfree::approximation::{Approximation, Linear, Lme, ShapeFunction};
use bfree::grid::Grid;
use bfree::material::{ClosedTangent, Lame, Law, Material, MaterialState, NeoHookean};
use bfree::mechanics::loads::Loads;
use bfree::mechanics::residual::{Equilibrium, Inadmissible};
use bfree::mechanics::schemes::Newmark;
use bfree::mechanics::sweep::{Connectivity, Mode, Points, Weights};
use bfree::mechanics::tangent::tangent_bytes;
use bfree::mechanics::terms::Step;
use bfree::mechanics::transfer::Nodal;
use bfree::particles::{Body, Particles};
use bfree::pooled::Pool;
use bfree::scalar::Real;
use bfree::space::Nodes;
use bfree::tensor::{Tensor, Vector, identity};
use num_dual::Dual64;

/// Irregular numbers, one after the other.
struct Irregular(usize);

impl Irregular {
    fn number(&mut self) -> f64 {
        self.0 += 1;
        irregular(self.0 - 1)
    }

    fn vector<const D: usize>(&mut self) -> Vector<f64, D> {
        Vector::from_fn(|_, _| self.number())
    }
}

fn shapes() -> Vec<Approximation> {
    let products =
        Approximation::examples().into_iter().map(|(_, shape)| shape).filter(|shape| shape.separable().is_some());
    // Weights whose product underflows.
    products.chain([Lme::new(40.0, 1e-100).into()]).collect()
}

/// A small box with a block of jittered particles: some on walls, faces and nodes, some crowded, some alone.
fn case<const D: usize>() -> (Grid<D>, Vec<Vector<f64, D>>) {
    let cells: [u32; D] = std::array::from_fn(|k| [23, 11, 7][k]);
    let grid = Grid { origin: Vector::repeat(-0.3), spacing: 0.1, cells };
    let upper: Vector<f64, D> = grid.position(cells);
    let mut random = Irregular(0);
    let mut positions = Vec::new();
    let inside = |x: Vector<f64, D>| x.zip_map(&grid.origin, f64::max).zip_map(&upper, f64::min);
    // In 3D eight particles per cell, moderately jittered; the order of the particles is not that of the cells.
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
    // Particles anywhere, many per cell, and a crowd in one cell.
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

/// A point function without symmetry that depends on particle and state.
fn point<const D: usize>(
    p: usize,
    u: Vector<f64, D>,
    l: Tensor<f64, D>,
) -> Result<(Vector<f64, D>, Tensor<f64, D>), Inadmissible> {
    let a = Tensor::from_fn(|i, k| 1.0 + 0.3 * (i as f64) - 0.7 * (k as f64) + 1e-3 * p as f64);
    Ok((u * 2.0 + l * u, l * a + a * l.transpose() + a))
}

/// A nonlinear point function.
fn square<T: Real, const D: usize>(
    _: usize,
    u: Vector<T, D>,
    l: Tensor<T, D>,
) -> Result<(Vector<T, D>, Tensor<T, D>), Inadmissible> {
    Ok((l * u, l * l))
}

/// Scalar nodal fields, and sums with |N| and N², against loops over the connectivity of every particle.
fn scalars_and_weights<const D: usize>(
    fast: &Connectivity<D>,
    plain: &Connectivity<D>,
    u: &[Vector<f64, D>],
    case: &str,
) {
    let first: Vec<_> = u.iter().map(|u| Vector::from([u[0]])).collect();
    let value = |p: usize| Vector::from([1.0 - 1e-3 * p as f64]);
    for weights in [Weights::Signed, Weights::Magnitude, Weights::Square] {
        let weigh = |n: f64| match weights {
            Weights::Signed => n,
            Weights::Magnitude => n.abs(),
            Weights::Square => n * n,
        };
        let mut expected = vec![Vector::from([0.0]); u.len()];
        for p in 0..plain.particles() {
            let (mut at, mut gradient) = (0.0, Vector::<f64, D>::zeros());
            for (node, n, grad_n) in plain.of(p) {
                at += first[node][0] * n;
                gradient += grad_n * first[node][0];
            }
            for (node, n, grad_n) in plain.of(p) {
                expected[node][0] += at * value(p)[0] * weigh(n) + gradient.dot(&grad_n.map(weigh));
            }
        }
        for connectivity in [fast, plain] {
            let mut out = vec![Vector::from([0.0]); u.len()];
            connectivity.sweep(Some(&first), Mode { weights, ..Mode::BOTH }, &mut out, |group, at, sums| {
                for (lane, &p) in group.particles.iter().enumerate() {
                    let (u, gradient) = at.lane(lane);
                    sums.value[0][lane] += u[0] * value(p as usize)[0];
                    (0..D).for_each(|k| sums.gradient[0][k][lane] += gradient[k]);
                }
            });
            let worst = difference(&out, &expected);
            assert!(worst < 1e-12, "{case}: one component, {weights:?}: {worst:e}");
        }
    }
    let (of_one, of_all) = (fast.values(&first), fast.values(u));
    assert!(of_one.iter().zip(&of_all).all(|(one, all)| (one[0] - all[0]).abs() < 1e-14), "{case}: values");
}

fn field<const D: usize>(nodes: &Nodes) -> Vec<Vector<f64, D>> {
    let mut random = Irregular(1000);
    (0..nodes.len()).map(|_| random.vector()).collect()
}

fn compare<const D: usize>() {
    let (grid, positions) = case::<D>();
    for shape in shapes() {
        let (fast, nodes) = Connectivity::new(&shape, &grid, &positions).unwrap();
        let (plain, expected) = Connectivity::plain(&shape, &grid, &positions).unwrap();
        assert_eq!(nodes, expected, "{shape:?}");
        assert_eq!(fast.particles(), positions.len());
        for p in 0..positions.len() {
            let (a, b): (Vec<_>, Vec<_>) = (fast.of(p).collect(), plain.of(p).collect());
            assert_eq!(a, b, "{shape:?} at {:?}", positions[p]);
        }
        let u = field::<D>(&nodes);
        let zeros = vec![Vector::zeros(); u.len()];
        let assembled = |connectivity: &Connectivity<D>| {
            let mut out = zeros.clone();
            connectivity.assemble(&u, Weights::Signed, &mut out, point).unwrap();
            out
        };
        let worst = difference(&assembled(&fast), &assembled(&plain));
        assert!(worst < 1e-12, "{D}D {shape:?}: assembled {worst:e}");
        let magnitudes = |connectivity: &Connectivity<D>| {
            let mut out = zeros.clone();
            connectivity.assemble(&u, Weights::Magnitude, &mut out, point).unwrap();
            out
        };
        let worst = difference(&magnitudes(&fast), &magnitudes(&plain));
        assert!(worst < 1e-12, "{D}D {shape:?}: magnitudes {worst:e}");
        let worst = difference(&fast.values(&u), &plain.values(&u));
        assert!(worst < 1e-12, "{D}D {shape:?}: values {worst:e}");
        scalars_and_weights(&fast, &plain, &u, &format!("{D}D {shape:?}"));
        // A dual number is two fields in the same kernels.
        let seeded: Vec<Vector<Dual64, D>> = u.iter().map(|u| u.map(|x| Dual64::new(x, 0.5 - x))).collect();
        let duals = |connectivity: &Connectivity<D>| {
            // Sums that are added to nonzero output.
            let (mut out, mut real) = (seeded.clone(), u.clone());
            connectivity.assemble(&seeded, Weights::Signed, &mut out, square).unwrap();
            connectivity.assemble(&u, Weights::Signed, &mut real, square).unwrap();
            let same = out.iter().flatten().zip(real.iter().flatten()).all(|(a, b)| a.re.to_bits() == b.to_bits());
            assert!(same, "{D}D {shape:?}: the real part of dual numbers");
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

/// Cells of edge 1, `per_axis` particles along each axis of the cells `cells`, counted from the corner.
fn regular<const D: usize>(cells: [u32; D], per_axis: u32) -> (Grid<D>, Vec<Vector<f64, D>>) {
    let side = cells.map(|n| n * per_axis);
    let place = |p: u32, k: usize| p / side[..k].iter().product::<u32>() % side[k];
    let at = |p: u32| Vector::from_fn(|k, _| (f64::from(place(p, k)) + 0.5) / f64::from(per_axis));
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [64; D] };
    (grid, (0..side.iter().product()).map(at).collect())
}

/// One jittered particle in each of the cells, and a law.
fn one_a_cell<const D: usize>(cells: [u32; D]) -> Result<(Grid<D>, Particles<D>, [Body<Material>; 1]), Failure> {
    let (grid, positions) = regular(cells, 1);
    let grid = Grid { cells: cells.map(|n| n + 1), ..grid };
    let (mut random, mut particles) = (Irregular(0), Particles::default());
    for x in positions {
        particles.push(x + random.vector() * 0.3, random.vector(), 1.0, 1.0 + 0.5 * random.number(), 0);
    }
    let law = Material::from(NeoHookean::ciarlet(Lame::new(2.0, 1.0)?));
    Ok((grid, particles, [body(law)]))
}

/// The results of a step that are sums over blocks.
fn computed<const D: usize>(
    connectivity: &Connectivity<D>,
    nodes: &Nodes,
    particles: &Particles<D>,
    bodies: &[Body<Material>],
) -> Result<[(&'static str, Vec<f64>); 8], Failure> {
    let flat = |field: &[Vector<f64, D>]| field.iter().flat_map(|x| x.iter().copied()).collect::<Vec<_>>();
    let nodal = Nodal::project(particles, connectivity, 1.0)?;
    let (alphas, loads) = (Newmark::default().alphas(1.0), Loads::default());
    let (nodal, loads) = (&nodal, &loads);
    let step =
        Step { particles, bodies, loads, connectivity, nodal, alphas, lumping: 0.5, time: 0.0, dt: 1.0, poses: None };
    let equilibrium = Equilibrium::new(step, &[]);
    let u = field::<D>(nodes);
    let dphi: Vec<_> = u.iter().map(|u| u * 0.02).collect();
    let gathered = connectivity.evaluate(&u, |_, value, gradient| value.sum() + gradient.sum());
    let mut product = vec![Vector::zeros(); u.len()];
    let tangent = equilibrium.tangent(None, &dphi)?;
    tangent.product(&u, &mut product);
    let (energy, magnitude) = equilibrium.potential(&dphi).ok_or("a potential")??;
    Ok([
        ("mass", nodal.mass.to_vec()),
        ("momentum", flat(&nodal.velocity)),
        ("values", flat(&connectivity.values(&u))),
        ("values and gradients", gathered),
        ("forces", flat(&equilibrium.residual(&dphi)?)),
        ("product with the tangent", flat(&product)),
        ("diagonal blocks", tangent.diagonal_blocks().iter().flat_map(|block| block.iter().copied()).collect()),
        ("energies and magnitudes", vec![energy, magnitude, equilibrium.magnitude(&dphi)?]),
    ])
}

fn many_blocks<const D: usize>(cells: [u32; D]) -> Result<(), Failure> {
    let (grid, particles, bodies) = one_a_cell(cells)?;
    let (shape, at) = (Approximation::from(Linear), &particles.position);
    let with = |threads: usize| {
        in_threads(threads, || {
            let (connectivity, nodes) = Connectivity::new(&shape, &grid, at)?;
            computed(&connectivity, &nodes, &particles, &bodies)
        })
    };
    let one = with(1)?;
    let (plain, nodes) = Connectivity::plain(&shape, &grid, at)?;
    for ((name, fast), (_, plain)) in one.iter().zip(computed(&plain, &nodes, &particles, &bodies)?) {
        assert_eq!(fast.len(), plain.len(), "{D}D: {name}");
        let largest = plain.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let close = fast.iter().zip(&plain).all(|(a, b)| (a - b).abs() <= 1e-12 * largest);
        assert!(close && largest > 0.0, "{D}D: {name} of the plain sweep differ");
    }
    for threads in [2, 5] {
        for ((name, one), (_, many)) in one.iter().zip(with(threads)?) {
            let same = one.len() == many.len() && one.iter().zip(&many).all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(same, "{D}D: {name} with {threads} threads differ");
        }
    }
    Ok(())
}

/// Blocks have 16² or 4³ cells, and a batch (wave) has 64 blocks: here there are 72 and 150 blocks.
#[test]
fn many_blocks_sum_the_same_bits_and_those_of_the_plain_sweep() -> Result<(), Failure> {
    many_blocks([144, 128])?;
    many_blocks([20, 20, 24])
}

/// Reused memory leaves no trace of the former shape-function values, with other blocks and widths.
fn renewal<const D: usize>() {
    let (grid, after) = case::<D>();
    let mut random = Irregular(7);
    let before: Vec<Vector<f64, D>> =
        after.iter().map(|_| grid.origin + random.vector::<D>().map(|x| (0.5 + 0.4 * x) * 0.7)).collect();
    for shape in shapes() {
        let anew = Connectivity::new(&shape, &grid, &after).unwrap();
        for other in shapes() {
            let (spare, _) = Connectivity::new(&other, &grid, &before).unwrap();
            let renewed =
                Connectivity::rebuilt(Some(spare), &shape, &grid, &Points::at(&after), &Pool::default()).unwrap();
            assert_eq!(renewed.1, anew.1);
            assert_eq!(renewed.0.windows(), anew.0.windows());
            for p in 0..after.len() {
                assert!(renewed.0.of(p).eq(anew.0.of(p)), "{shape:?} after {other:?}: particle {p}");
            }
            // The sum includes every lane, also lanes without a particle.
            let u = field::<D>(&anew.1);
            assert_eq!(sums(&renewed.0, &u), sums(&anew.0, &u));
        }
    }
}

fn sums<const D: usize>(connectivity: &Connectivity<D>, u: &[Vector<f64, D>]) -> Vec<Vector<f64, D>> {
    let mut out = vec![Vector::zeros(); u.len()];
    connectivity.assemble(u, Weights::Signed, &mut out, |_, u, l| Ok::<_, Inadmissible>((u, l))).unwrap();
    out
}

#[test]
fn connectivity_does_not_depend_on_that_whose_memory_it_uses() {
    renewal::<1>();
    renewal::<2>();
    renewal::<3>();
}

#[test]
fn the_first_particle_that_fails_is_named() {
    let (grid, mut positions) = case::<2>();
    for shape in shapes() {
        let (fast, nodes) = Connectivity::new(&shape, &grid, &positions).unwrap();
        let u = field::<2>(&nodes);
        let mut out = vec![Vector::zeros(); u.len()];
        let fails = |p: usize, u, l| if p % 100 == 77 { Err(p) } else { Ok((u, l)) };
        assert_eq!(fast.assemble(&u, Weights::Signed, &mut out, fails), Err(77));
        assert_eq!(fast.interpolate(&u, |p, _, _: Tensor<f64, 2>| if p > 99 { Err(p) } else { Ok(()) }), Err(100));
    }
    positions[300][1] = f64::NAN;
    positions[200][0] = 17.0;
    for shape in shapes() {
        let fast = Connectivity::new(&shape, &grid, &positions).map(|_| ()).unwrap_err();
        let plain = Connectivity::plain(&shape, &grid, &positions).map(|_| ()).unwrap_err();
        assert_eq!((fast.particle, fast.source), (plain.particle, plain.source));
        assert_eq!(plain.particle, 200);
    }
}
