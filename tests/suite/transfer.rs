//! Particle-to-grid transfer: the equation of the projection, and nodes whose mass is too small for it.

use crate::support::{Failure, irregular};
use bfree::approximation::{Approximation, Bspline, Linear, Lme};
use bfree::grid::Grid;
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::transfer::Nodal;
use bfree::particles::Particles;
use bfree::tensor::Vector;

fn cloud(velocity: f64, acceleration: f64) -> Particles<2> {
    let mut particles = Particles::default();
    for p in 0..80 {
        let vector = |from: usize, size: f64| Vector::from_fn(|k, _| size * irregular(17 * p + from + k));
        let position = Vector::repeat(2.5) + vector(0, 2.0);
        particles.push(position, vector(2, velocity), 0.1, 0.2 + 0.1 * irregular(17 * p + 4), 0);
        particles.acceleration[p] = vector(5, acceleration);
    }
    particles
}

const GRID: fn() -> Grid<2> = || Grid { origin: Vector::zeros(), spacing: 0.5, cells: [10, 10] };

#[test]
fn the_projection_solves_its_equation_for_every_lumping() -> Result<(), Failure> {
    let particles = cloud(1.0, 50.0);
    let families: [Approximation; 3] = [Linear.into(), Bspline::Quadratic.into(), Lme::new(1.8, 1e-6).into()];
    for family in families {
        let (connectivity, nodes) = Connectivity::new(&family, &GRID(), &particles.position)?;
        for lumping in [1.0, 0.7, 0.1] {
            let nodal = Nodal::project(&particles, &connectivity, lumping)?;
            assert_eq!(nodal.iterations > 0, lumping < 1.0);
            for (projected, field) in
                [(&nodal.velocity, &particles.velocity), (&nodal.acceleration, &particles.acceleration)]
            {
                // Σ_p m N_I [(1−ε) Σ_J N_J v_J + ε v_I − v_p] = 0, node by node (eq. 42).
                let (mut defect, mut size) = (vec![Vector::zeros(); nodes.len()], 0.0);
                for p in 0..particles.len() {
                    let at_particle: Vector<f64, 2> = connectivity.of(p).map(|(node, n, _)| projected[node] * n).sum();
                    for (node, n, _) in connectivity.of(p) {
                        let mixed = at_particle * (1.0 - lumping) + projected[node] * lumping;
                        defect[node] += (mixed - field[p]) * (n * particles.mass[p]);
                        size += (n * particles.mass[p] * field[p].norm()).powi(2);
                    }
                }
                let defect = defect.iter().map(Vector::norm_squared).sum::<f64>().sqrt() / size.sqrt();
                assert!(defect < 1e-11, "{family:?}, ε = {lumping}: {defect:e}");
            }
        }
    }
    Ok(())
}

#[test]
fn the_iterations_of_both_fields_are_counted() -> Result<(), Failure> {
    let iterations = |velocity, acceleration| -> Result<usize, Failure> {
        let particles = cloud(velocity, acceleration);
        let (connectivity, _) = Connectivity::new(&Approximation::from(Linear), &GRID(), &particles.position)?;
        Ok(Nodal::project(&particles, &connectivity, 0.2)?.iterations)
    };
    let (of_v, of_a) = (iterations(1.0, 0.0)?, iterations(0.0, 1.0)?);
    assert!(of_v > 1 && of_a > 1);
    assert_eq!(iterations(1.0, 1.0)?, of_v + of_a);
    Ok(())
}

#[test]
fn only_a_node_of_next_to_no_mass_gets_no_velocity_in_any_unit_of_mass() -> Result<(), Failure> {
    let grid = Grid::<1> { origin: Vector::zeros(), spacing: 1.0, cells: [3] };
    for mass in [1e-9, 1.0, 1e9] {
        for (beyond, light) in [(4e-16, true), (1e-12, false)] {
            let mut particles = Particles::default();
            particles.push(Vector::from([1.0 + beyond]), Vector::from([4.0]), 1.0, mass, 0);
            particles.acceleration[0] = Vector::from([-3.0]);
            let (connectivity, nodes) = Connectivity::new(&Approximation::from(Linear), &grid, &particles.position)?;
            let mut nodal = Nodal::project(&particles, &connectivity, 1.0)?;
            // Node 2 carries the share `beyond` of the particle, node 1 the rest.
            let [near, far] = [1, 2].map(|id| nodes.number(id));
            let (near, far) = (near.ok_or("no node 1")?, far.ok_or("no node 2")?);
            let of = |field: &[Vector<f64, 1>]| [field[near][0], field[far][0]].map(|x| (x * 1e9).round() / 1e9);
            let expected = |x: f64| [x, if light { 0.0 } else { x }];
            assert_eq!(of(&nodal.velocity), expected(4.0), "mass {mass}, {beyond} beyond the node");
            assert_eq!(of(&nodal.acceleration), expected(-3.0));
            // a = −R/m, with R = −2 m.
            let unbalanced: Vec<_> = nodal.mass.iter().map(|&m| Vector::from([-2.0 * m])).collect();
            nodal.accelerate(&particles, &connectivity, &unbalanced);
            assert_eq!(of(&nodal.acceleration), expected(2.0));
        }
    }
    Ok(())
}

/// 1e-300 off a wall, the products of the other nodes' functions have no finite inverse. The study `extremes` has masses lumped in part.
#[test]
fn nodes_with_the_least_mass_there_is_leave_the_projection_finite() -> Result<(), Failure> {
    let velocity = Vector::from([0.0, 0.3, -0.2]);
    let mut particles = Particles::<3>::default();
    particles.push(Vector::from([1e-300, 1.5, 1.5]), velocity, 0.125, 1.0, 0);
    let grid = Grid { origin: Vector::zeros(), spacing: 0.5, cells: [6; 3] };
    let (connectivity, _) = Connectivity::new(&Approximation::from(Lme::new(3.0, 1e-6)), &grid, &particles.position)?;
    let nodal = Nodal::project(&particles, &connectivity, 0.0)?;
    let back: Vector<f64, 3> = connectivity.of(0).map(|(node, n, _)| nodal.velocity[node] * n).sum();
    assert!((back - velocity).norm() < 1e-11, "{back:?}");
    Ok(())
}

/// A rotating square that cuts cells. At its edges the node lies beyond the centre of mass of its particles, so a mean over the particles
/// is too slow. The error is Σ m (v − ω × x)² of the nodes.
#[test]
fn affine_fits_meet_a_rotation_and_keep_momentum() -> Result<(), Failure> {
    let grid = GRID();
    let spun = |x: &Vector<f64, 2>| Vector::from([-(x[1] - 2.5), x[0] - 2.5]);
    let mut square = cloud(0.0, 0.0);
    for (p, x) in square.position.iter_mut().enumerate() {
        *x = Vector::from([1.6 + 0.25 * (p % 8) as f64, 1.3 + 0.25 * (p / 8) as f64]);
    }
    square.velocity = square.position.iter().map(spun).collect();
    square.acceleration = square.position.iter().map(|x| spun(x) * 3.0).collect();
    let families: [Approximation; 4] =
        [Linear.into(), Bspline::Quadratic.into(), Bspline::Cubic.into(), Lme::new(1.8, 1e-12).into()];
    for family in families {
        let (connectivity, nodes) = Connectivity::new(&family, &GRID(), &square.position)?;
        let off = |nodal: &Nodal<2>, field: &[Vector<f64, 2>], size: f64| {
            let off = |(node, (_, x)): (usize, (_, Vector<f64, 2>))| {
                nodal.mass[node] * (field[node] - spun(&x) * size).norm_squared()
            };
            let squares: Vec<f64> = nodes.positions(&grid).enumerate().map(off).collect();
            squares.iter().sum::<f64>().sqrt()
        };
        let (mean, fit) = (Nodal::project(&square, &connectivity, 1.0)?, Nodal::fit(&square, &connectivity));
        let velocity = [&mean, &fit].map(|nodal| off(nodal, &nodal.velocity, 1.0));
        let acceleration = [&mean, &fit].map(|nodal| off(nodal, &nodal.acceleration, 3.0));
        // The remaining error comes from nodes beyond the edges with a single row of particles: their fit has no slope across the row.
        let less = [velocity, acceleration].iter().all(|[mean, fit]| *fit < 0.25 * mean);
        assert!(less, "{family:?}: {velocity:?}, {acceleration:?}");
        // The momentum of any field is conserved.
        let any = cloud(1.0, 50.0);
        let (connectivity, _) = Connectivity::new(&family, &GRID(), &any.position)?;
        let fit = Nodal::fit(&any, &connectivity);
        let momentum = |field: &[Vector<f64, 2>], mass: &[f64]| -> Vector<f64, 2> {
            field.iter().zip(mass).map(|(v, &m)| v * m).sum()
        };
        for (nodes, particles) in [(&fit.velocity, &any.velocity), (&fit.acceleration, &any.acceleration)] {
            let sizes: f64 = particles.iter().zip(&any.mass).map(|(v, m)| v.norm() * m).sum();
            let change = momentum(nodes, &fit.mass) - momentum(particles, &any.mass);
            assert!(change.norm() < 1e-10 * sizes, "{family:?}: {change}");
        }
    }
    Ok(())
}
