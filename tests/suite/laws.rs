//! Laws evaluated in vector lanes against the same laws evaluated one particle at a time.

use crate::support::{Failure, Watched, body, closed_laws, difference, in_threads, irregular, piola};
use bfree::approximation::{Approximation, Linear, Lme};
use bfree::grid::Grid;
use bfree::material::{Lame, Law, Material, NonPositiveJacobian};
use bfree::mechanics::loads::Loads;
use bfree::mechanics::residual::{Equilibrium, Inadmissible, compose};
use bfree::mechanics::schemes::{Alphas, Newmark};
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::terms::Step;
use bfree::mechanics::transfer::Nodal;
use bfree::particles::{Body, Particles};
use bfree::tensor::{Tensor, Vector, identity};
use num_dual::Dual64;

/// J at the start, and the size of the further deformation.
const REGIMES: [(f64, f64); 4] = [(1.0, 1e-8), (1.0, 0.2), (0.05, 0.02), (20.0, 0.3)];

/// Jittered particles in some cells, in full and partly filled groups. Bodies alternate. Each particle is strained about `REGIMES`.
fn particles<const D: usize>(bodies: u32, regimes: &[(f64, f64)]) -> Particles<D> {
    let mut particles = Particles::default();
    for p in 0..5_usize.pow(D as u32) * 3 {
        let x = Vector::from_fn(|k, _| 2.0 + 2.49 * irregular(7 * p + k).abs());
        let volume = 0.1 + 0.05 * irregular(p);
        let vector = |from: usize| Vector::from_fn(|k, _| irregular(13 * p + from + k));
        particles.push(x, vector(0), volume, volume, p as u32 % bodies);
        particles.acceleration[p] = vector(5);
        let (j, size) = regimes[p % regimes.len()];
        let stretch = j.powf(1.0 / D as f64) - 1.0;
        particles.displacement_gradient[p] = Tensor::from_fn(|i, k| {
            let part = size * irregular(11 * p + 3 * i + k);
            if i == k { stretch + part * (1.0 + stretch) } else { part * (1.0 + stretch) }
        });
    }
    particles
}

fn materials() -> Vec<Material> {
    closed_laws(Lame { lambda: 3.0, shear: 2.0 })
}

fn bodies<L>(laws: impl IntoIterator<Item = L>) -> Vec<Body<L>> {
    laws.into_iter().map(body).collect()
}

fn bits<const D: usize>(field: &[Vector<f64, D>]) -> Vec<u64> {
    field.iter().flatten().map(|x| x.to_bits()).collect()
}

/// Δt and ε.
const DT: f64 = 0.5;
const LUMPING: f64 = 0.3;

fn alphas() -> Alphas {
    Newmark::default().alphas(DT)
}

/// The results of a step that depend on the laws.
#[derive(Debug, PartialEq)]
struct Results<const D: usize> {
    residual: Vec<Vector<f64, D>>,
    product: Vec<Vector<f64, D>>,
    blocks: Vec<Tensor<f64, D>>,
}

/// Computes the results as a step does, and checks that the tangent is the derivative of the residual.
fn results<const D: usize, L: Law>(
    particles: &Particles<D>,
    bodies: &[Body<L>],
    connectivity: &Connectivity<D>,
    dphi: &[Vector<f64, D>],
    u: &[Vector<f64, D>],
    divides: bool,
) -> Result<Results<D>, Failure> {
    let (nodal, loads) = (Nodal::project(particles, connectivity, LUMPING)?, Loads::default());
    let (alphas, lumping) = (alphas(), LUMPING);
    let step = Step {
        particles,
        bodies,
        loads: &loads,
        connectivity,
        nodal: &nodal,
        alphas,
        lumping,
        time: 0.0,
        dt: DT,
        poses: None,
    };
    let equilibrium = Equilibrium::new(step, &[]);
    let residual = equilibrium.residual(dphi)?;
    let seeded: Vec<_> = dphi.iter().zip(u).map(|(x, u)| x.zip_map(u, Dual64::new)).collect();
    let real: Vec<_> = equilibrium.residual(&seeded)?.iter().map(|r| r.map(|x| x.re)).collect();
    // A quotient of dual numbers is a product with the reciprocal: two roundings, where a law divides.
    let (same, apart) = (bits(&real) == bits(&residual), difference(&real, &residual));
    assert!(same || divides && apart < 1e-14, "the real part of dual numbers: {apart:e}");
    equilibrium.check_tangent(dphi, u)?;
    let tangent = equilibrium.tangent(None, dphi)?;
    let mut product = vec![Vector::zeros(); u.len()];
    tangent.product(u, &mut product);
    Ok(Results { residual, product, blocks: tangent.diagonal_blocks().to_vec() })
}

/// The residual by the formulas of one particle, with loops over the connectivity of every particle.
fn by_formulas<const D: usize>(
    particles: &Particles<D>,
    bodies: &[Body<Watched>],
    connectivity: &Connectivity<D>,
    dphi: &[Vector<f64, D>],
) -> Result<Vec<Vector<f64, D>>, Failure> {
    let (nodal, alphas) = (Nodal::project(particles, connectivity, LUMPING)?, alphas());
    let mut residual = vec![Vector::zeros(); dphi.len()];
    // a = α₁ (Δφ − Δφ̂), and the share ε of the mass is lumped.
    let a = |node: usize| (dphi[node] - alphas.predicted(&nodal.velocity[node], &nodal.acceleration[node])) * alphas.a1;
    for (node, m) in nodal.mass.iter().enumerate() {
        residual[node] += a(node) * (LUMPING * m);
    }
    for p in 0..particles.len() {
        let h_n = &particles.displacement_gradient[p];
        // V₀ P F_nᵀ
        let p_k = piola(&bodies[particles.body[p] as usize].law, compose(&connectivity.gradient_at(p, dphi), h_n))?;
        let sigma = p_k * (identity::<f64, D>() + h_n).transpose() * particles.volume[p];
        let mass = (1.0 - LUMPING) * particles.mass[p];
        let acceleration: Vector<f64, D> = connectivity.of(p).map(|(node, n, _)| a(node) * n).sum();
        for (node, n, grad_n) in connectivity.of(p) {
            residual[node] += sigma * grad_n + acceleration * (mass * n);
        }
    }
    Ok(residual)
}

fn compare<const D: usize>() -> Result<(), Failure> {
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [9; D] };
    let lists: Vec<_> = materials().into_iter().map(|law| vec![law]).chain([materials()]).collect();
    let regimes = REGIMES.iter().map(std::slice::from_ref).chain([REGIMES.as_slice()]);
    for (list, regime) in lists.iter().flat_map(|list| regimes.clone().map(move |regime| (list, regime))) {
        let particles = particles::<D>(list.len() as u32, regime);
        // The logarithmic law divides in its ln J.
        let divides = list.iter().any(|law| matches!(law, Material::NeoHookeanLogarithmic(_)));
        let unknown = |closed: &dyn Fn(usize) -> bool| {
            bodies(list.iter().enumerate().map(|(k, law)| Watched::unlisted(law.clone(), closed(k))))
        };
        // Bodies that all have closed forms, bodies without, and both in turn.
        let (known, closed) = (bodies(list.clone()), unknown(&|_| true));
        let others = [unknown(&|_| false), unknown(&|k| k % 2 == 1)];
        for shape in [Approximation::from(Linear), Lme::new(3.0, 1e-6).into()] {
            let case = format!("{D}D {list:?} {regime:?} {shape:?}");
            let (connectivity, nodes) = Connectivity::new(&shape, &grid, &particles.position)?;
            let (plain, _) = Connectivity::plain(&shape, &grid, &particles.position)?;
            assert!(connectivity.is_tiled() && !plain.is_tiled());
            let u: Vec<Vector<f64, D>> =
                (0..nodes.len()).map(|n| Vector::from_fn(|i, _| irregular(5 * n + i))).collect();
            let dphi: Vec<_> = u.iter().map(|u| u * 0.01).collect();
            let of = |bodies: &[Body<Watched>], connectivity: &Connectivity<D>| {
                results(&particles, bodies, connectivity, &dphi, &u, divides)
                    .map_err(|error| format!("{case}: {error}"))
            };
            let in_lanes = results(&particles, &known, &connectivity, &dphi, &u, divides)
                .map_err(|error| format!("{case}: {error}"))?;
            assert!(in_lanes == of(&closed, &connectivity)?, "{case}: in lanes and one by one");
            for bodies in [&closed, &others[0], &others[1]] {
                let (tiled, plain) = (of(bodies, &connectivity)?, of(bodies, &plain)?);
                let residual = by_formulas(&particles, bodies, &connectivity, &dphi)?;
                for (name, found, expected, bound) in [
                    ("residual", &tiled.residual, &residual, 1e-14),
                    ("residual of the plain sweep", &plain.residual, &tiled.residual, 1e-13),
                    ("product of the plain sweep", &plain.product, &tiled.product, 1e-13),
                ] {
                    let apart = difference(found, expected);
                    assert!(apart < bound, "{case}: {name}: {apart:e}");
                }
            }
        }
    }
    Ok(())
}

#[test]
fn a_law_in_lanes_gives_the_bits_of_one_particle_after_the_other() -> Result<(), Failure> {
    compare::<1>()?;
    compare::<2>()?;
    compare::<3>()
}

#[test]
fn the_smallest_particle_that_cannot_be_deformed_is_named() -> Result<(), Failure> {
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [9; 2] };
    for (law, closed) in materials().into_iter().flat_map(|law| [(law.clone(), true), (law, false)]) {
        let mut particles = particles::<2>(1, &REGIMES);
        for (p, det_f) in [(40, -0.5), (17, 0.0), (60, f64::NAN)] {
            particles.displacement_gradient[p] = Tensor::from_diagonal(&Vector::from([det_f - 1.0, 0.0]));
        }
        let (shape, at) = (Approximation::from(Linear), &particles.position);
        let (tiled, nodes) = Connectivity::new(&shape, &grid, at)?;
        let (plain, _) = Connectivity::plain(&shape, &grid, at)?;
        let zero = vec![Vector::zeros(); nodes.len()];
        let (known, unknown) = (bodies([law.clone()]), bodies([Watched::unlisted(law, closed)]));
        let expected = Inadmissible { particle: 17, source: NonPositiveJacobian { det_f: 0.0 } };
        for (connectivity, threads) in [(&tiled, 1), (&tiled, 3), (&plain, 1), (&plain, 3)] {
            in_threads(threads, || {
                fails(&particles, &known, connectivity, &zero, expected);
                fails(&particles, &unknown, connectivity, &zero, expected);
                Ok(())
            })?;
        }
    }
    Ok(())
}

/// Residual, tangent and potential return the same error.
fn fails<L: Law>(
    particles: &Particles<2>,
    bodies: &[Body<L>],
    connectivity: &Connectivity<2>,
    zero: &[Vector<f64, 2>],
    expected: Inadmissible,
) {
    let (nodal, loads, alphas) = (&Nodal::at_rest(particles, connectivity), &Loads::default(), alphas());
    let step =
        Step { particles, bodies, loads, connectivity, nodal, alphas, lumping: 1.0, time: 0.0, dt: DT, poses: None };
    let equilibrium = Equilibrium::new(step, &[]);
    assert_eq!(equilibrium.residual(zero), Err(expected));
    assert_eq!(
        equilibrium.residual(&zero.iter().map(|x| x.map(Dual64::from)).collect::<Vec<_>>()).err(),
        Some(expected)
    );
    assert_eq!(equilibrium.tangent(None, zero).err(), Some(expected));
    assert_eq!(equilibrium.potential(zero).map(|found| found.map(|_| ())), Some(Err(expected)));
}
