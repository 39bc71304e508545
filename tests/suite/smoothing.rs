//! Smoothing of the particle velocities: the quantities it conserves, the energy it dissipates, and its limits.

use crate::support::{Failure, scene};
use bfree::approximation::{Approximation, Bspline, Gimp, Linear, Lme};
use bfree::grid::Grid;
use bfree::mechanics::smoothing::Smoothing;
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::transfer::Nodal;
use bfree::particles::Particles;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;

fn families() -> [Approximation; 5] {
    let gimp = Gimp::particles_per_axis(2);
    [Linear.into(), gimp.into(), Bspline::Quadratic.into(), Bspline::Cubic.into(), Lme::new(1.4, 1e-6).into()]
}

/// Particles of different mass without any symmetry, in [0.2, 0.8]^D of a box of edge 1.
fn cloud<const D: usize>() -> (Grid<D>, Particles<D>) {
    let mut particles = Particles::default();
    for p in 1..=90 {
        let along = |k: usize| (f64::from(p) * [0.618_034, 0.414_214, 0.732_051][k]).fract();
        let velocity = Vector::from_fn(|k, _| (f64::from(p) * (1.7 + k as f64)).sin());
        particles.push(Vector::from_fn(|k, _| 0.2 + 0.6 * along(k)), velocity, 0.01, 0.01 * (1.0 + along(0)), 0);
    }
    (Grid { origin: Vector::zeros(), spacing: 0.125, cells: [8; D] }, particles)
}

/// The change of the velocities by smoothing.
fn velocity_change<const D: usize>(
    smoothing: &Smoothing,
    particles: &Particles<D>,
    connectivity: &Connectivity<D>,
    mass: &[f64],
    dt: f64,
) -> Vec<Vector<f64, D>> {
    let at_kinks = smoothing.shares_at_kinks(particles, connectivity, mass, dt);
    smoothing.change(particles, connectivity, mass, at_kinks.as_deref(), &particles.velocity, dt).to_vec()
}

fn keeps_momentum_and_gains_no_energy<const D: usize>() -> Result<(), Failure> {
    let (grid, particles) = cloud::<D>();
    let scale: f64 = particles.mass.iter().zip(&particles.velocity).map(|(m, v)| m * v.norm()).sum();
    for family in families() {
        let (connectivity, _) = Connectivity::new(&family, &grid, &particles.position)?;
        let nodal = Nodal::project(&particles, &connectivity, 1.0)?;
        let mut energy_before = 0.0;
        let of_order = |order| [3.0, f64::INFINITY].map(|rate| Smoothing::uniform(order, rate));
        let limited = [3.0, f64::INFINITY].map(Smoothing::limited);
        for smoothing in [1, 2, 5, 20].into_iter().flat_map(of_order).chain(limited) {
            let change = velocity_change(&smoothing, &particles, &connectivity, &nodal.mass, 0.1);
            let mut changed = particles.clone();
            changed.velocity.iter_mut().zip(&change).for_each(|(v, change)| *v += change);
            let energy = changed.kinetic_energy();
            assert!((changed.momentum() - particles.momentum()).norm() < 1e-14 * scale, "{family:?} {smoothing:?}");
            // M_L − M has no negative eigenvalue, so each term dissipates energy, and more terms dissipate less.
            assert!(energy < particles.kinetic_energy(), "{family:?} {smoothing:?}");
            if smoothing.rate == f64::INFINITY && smoothing.at_kinks == 0.0 {
                assert!(energy > energy_before, "{family:?} {smoothing:?}");
                energy_before = energy;
            }
        }
    }
    Ok(())
}

#[test]
fn smoothing_keeps_momentum_and_gains_no_energy() -> Result<(), Failure> {
    keeps_momentum_and_gains_no_energy::<1>()?;
    keeps_momentum_and_gains_no_energy::<2>()?;
    keeps_momentum_and_gains_no_energy::<3>()
}

#[test]
fn a_common_velocity_is_kept_and_two_half_steps_are_one_step() -> Result<(), Failure> {
    let (grid, mut particles) = cloud::<2>();
    let smoothing = Smoothing::uniform(2, 4.0);
    let (connectivity, _) = Connectivity::new(&families()[4], &grid, &particles.position)?;
    let nodal = Nodal::project(&particles, &connectivity, 1.0)?;
    // 1 − θ(Δt) is exponential in Δt.
    let left = |dt: f64| 1.0 - smoothing.share(dt);
    assert!((left(0.2) - left(0.1) * left(0.1)).abs() < 1e-15);
    assert_eq!((smoothing.share(0.0), Smoothing::uniform(2, f64::INFINITY).share(0.1)), (0.0, 1.0));
    particles.velocity.fill(Vector::from([3.0, -2.0]));
    for smoothing in [smoothing, Smoothing::limited(4.0)] {
        let change = velocity_change(&smoothing, &particles, &connectivity, &nodal.mass, 0.2);
        assert!(change.iter().all(|change| change.norm() < 1e-14), "{change:?}");
    }
    Ok(())
}

#[test]
fn many_terms_keep_what_the_nodes_can_represent() -> Result<(), Failure> {
    let (grid, particles) = cloud::<1>();
    let (connectivity, nodes) = Connectivity::new(&Approximation::from(Linear), &grid, &particles.position)?;
    let nodal = Nodal::project(&particles, &connectivity, 1.0)?;
    let field: Vec<_> = nodes.positions(&grid).map(|(_, x)| x.map(|x| (7.0 * x).sin())).collect();
    let represented = connectivity.values(&field);
    let size = |field: &[Vector<f64, 1>]| field.iter().map(Vector::norm_squared).sum::<f64>().sqrt();
    let lost = |order| {
        let smoothing = Smoothing::uniform(order, f64::INFINITY);
        size(&smoothing.change(&particles, &connectivity, &nodal.mass, None, &represented, 0.1)) / size(&represented)
    };
    assert!(lost(1) > 0.05 && lost(4) < 0.25 * lost(1) && lost(400) < 1e-4, "{} {} {}", lost(1), lost(4), lost(400));
    Ok(())
}

#[test]
fn limited_smoothing_sees_neither_the_motion_of_the_frame_nor_its_axes() -> Result<(), Failure> {
    let (grid, mut particles) = cloud::<2>();
    let smoothing = Smoothing::limited(4.0);
    for family in families() {
        let (connectivity, _) = Connectivity::new(&family, &grid, &particles.position)?;
        let nodal = Nodal::project(&particles, &connectivity, 1.0)?;
        let still = velocity_change(&smoothing, &particles, &connectivity, &nodal.mass, 0.1);
        let rest = particles.velocity.clone();
        // The same motion in another frame: v' = Q v + c.
        let (sin, cos) = 0.7_f64.sin_cos();
        let turned = |v: &Vector<f64, 2>| Vector::from([cos * v[0] - sin * v[1], sin * v[0] + cos * v[1]]);
        particles.velocity = rest.iter().map(|v| turned(v) + Vector::from([300.0, -20.0])).collect();
        let moving = velocity_change(&smoothing, &particles, &connectivity, &nodal.mass, 0.1);
        for (still, moving) in still.iter().zip(&moving) {
            assert!((turned(still) - moving).norm() < 1e-10, "{family:?}: {still} {moving}");
        }
        particles.velocity = rest;
    }
    Ok(())
}

#[test]
fn kinks_and_extrema_are_told_from_slopes() -> Result<(), Failure> {
    let mut particles = Particles::<1>::default();
    for p in 0..160 {
        particles.push(Vector::from([(f64::from(p) + 0.5) / 160.0]), Vector::zeros(), 1.0, 1.0, 0);
    }
    let grid = Grid { origin: Vector::zeros(), spacing: 0.025, cells: [40] };
    let smoothing = Smoothing::limited(1.0);
    let [.., cubic, lme] = families();
    for family in [cubic, lme] {
        let (connectivity, nodes) = Connectivity::new(&family, &grid, &particles.position)?;
        let nodal = Nodal::project(&particles, &connectivity, 1.0)?;
        let places: Vec<f64> = nodes.positions(&grid).map(|(_, x)| x[0]).collect();
        // min(1, (2q)³), from the shares of a step so short that the shares are proportional to it.
        let mut strength = |velocity: &dyn Fn(f64) -> f64| -> Result<Vec<(f64, f64)>, Failure> {
            particles.velocity = particles.position.iter().map(|x| x.map(velocity)).collect();
            let shares = smoothing.shares_at_kinks(&particles, &connectivity, &nodal.mass, 1e-6);
            let shares = shares.ok_or("limited smoothing has shares")?;
            // Nodes away from the ends of the bar.
            let inside = places.iter().zip(shares.to_vec()).filter(|(x, _)| (0.2..0.8).contains(*x));
            Ok(inside.map(|(&x, share)| (x - 0.5, share / (5.0 * 1e-6))).collect())
        };
        let near = |x: f64| x.abs() < 1e-9;
        for (x, s) in strength(&|x| 3.0 * x)? {
            assert!(s < 1e-6, "{family:?}: a slope has no kink, at {x}: {s}");
        }
        let tent = |x: f64| (x - 0.5).abs();
        let parabola = |x: f64| (x - 0.5).powi(2);
        for (x, s) in strength(&tent)?.into_iter().chain(strength(&parabola)?) {
            // The share is 1 at the vertex and 0 four cells away.
            assert!(!near(x) || s > 0.99, "{family:?}: at the vertex {s}");
            assert!(x.abs() < 0.1 || s < 1e-2, "{family:?}: on the flank, at {x}: {s}");
        }
    }
    Ok(())
}

#[test]
fn the_shipped_jump_lies_in_the_middle_as_that_of_the_study() -> Result<(), Failure> {
    // Half of the mass moves: the node at the jump has the mean velocity, not the velocity of the left side.
    let bar: Simulation<1> = scene("riemann_jump.json", &[])?;
    let mean = bar.particles.momentum()[0] / bar.particles.mass.iter().sum::<f64>();
    assert!((mean - 500.0).abs() < 1e-9, "{mean}");
    Ok(())
}

/// The shipped bar, cut short.
fn bar(transfer: &str) -> Result<Simulation<1>, Failure> {
    let overrides = ["bodies.0.shape.box.min=[48]", "bodies.0.shape.box.max=[52]", "time.lumping=1", transfer];
    scene("riemann_jump.json", &overrides)
}

#[test]
fn with_a_lumped_mass_pic_gives_particles_the_velocity_of_their_nodes() -> Result<(), Failure> {
    let mut pic = bar(r#"transfer={"pic":{}}"#)?;
    pic.step()?;
    let before = pic.clone();
    pic.step()?;
    let mut flip = before.clone();
    flip.settings.smoothing = None;
    flip.step()?;
    let (connectivity, _) = Connectivity::new(&before.approximation, &before.grid, &before.particles.position)?;
    let nodal = Nodal::project(&before.particles, &connectivity, 1.0)?;
    let at_start = connectivity.values(&nodal.velocity);
    let accelerated = connectivity.values(&nodal.acceleration);
    let largest = accelerated.iter().map(Vector::norm).fold(0.0, f64::max);
    assert!(largest > 0.0);
    // The comparison requires that no step has reordered the particles.
    assert!(pic.particles.id == before.particles.id && flip.particles.id == before.particles.id);
    for p in 0..before.particles.len() {
        // v_p = Σ N (v_n + Δv), and FLIP is v_p + Σ N Δv.
        let expected = at_start[p] + (flip.particles.velocity[p] - before.particles.velocity[p]);
        assert!((pic.particles.velocity[p] - expected).norm() < 1e-9, "particle {p}");
        // The acceleration follows the same formula.
        let expected = accelerated[p] + (flip.particles.acceleration[p] - before.particles.acceleration[p]);
        assert!((pic.particles.acceleration[p] - expected).norm() < 1e-9 * largest, "particle {p}");
    }
    Ok(())
}

#[test]
fn a_bar_keeps_its_momentum_and_loses_as_much_energy_in_two_half_steps_as_in_one() -> Result<(), Failure> {
    let run = |step: f64, steps: u32| -> Result<Simulation<1>, Failure> {
        let mut bar = bar(r#"transfer={"blend":{"rate":17300}}"#)?;
        bar.clock = bfree::clock::Clock::new(step, 0);
        for _ in 0..steps {
            bar.step()?;
        }
        Ok(bar)
    };
    let start = bar(r#"transfer="flip""#)?.particles.momentum();
    let energy = |bar: &Simulation<1>| bar.particles.kinetic_energy() + bar.strain_energy();
    let (long, short) = (run(4e-6, 20)?, run(2e-6, 40)?);
    for bar in [&long, &short] {
        assert!((bar.particles.momentum() - start).norm() < 1e-12 * start.norm());
    }
    let total = bar(r#"transfer="flip""#)?.particles.kinetic_energy();
    let (by_long, by_short) = (total - energy(&long), total - energy(&short));
    assert!(by_long > 1e-4 * total && (by_short / by_long - 1.0).abs() < 0.1, "{by_long} {by_short} of {total}");
    Ok(())
}

#[test]
fn a_node_without_mass_does_not_disturb_its_particle() -> Result<(), Failure> {
    // On a face between two cells the far node has N = 0 and ∇N ≠ 0: it is active, but has no mass.
    let grid = Grid::<1> { origin: Vector::zeros(), spacing: 1.0, cells: [3] };
    let mut particles = Particles::default();
    particles.push(Vector::from([1.0]), Vector::from([4.0]), 1.0, 1.0, 0);
    let (connectivity, _) = Connectivity::new(&Approximation::from(Linear), &grid, &particles.position)?;
    let nodal = Nodal::project(&particles, &connectivity, 1.0)?;
    assert!(nodal.mass.contains(&0.0) && nodal.velocity.iter().all(|v| v[0] == 0.0 || v[0] == 4.0));
    for smoothing in [Smoothing::uniform(3, f64::INFINITY), Smoothing::limited(f64::INFINITY)] {
        let change = velocity_change(&smoothing, &particles, &connectivity, &nodal.mass, 0.1);
        assert_eq!(change, [Vector::from([0.0])], "{smoothing:?}");
    }
    Ok(())
}
