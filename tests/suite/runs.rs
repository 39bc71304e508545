//! Whole runs: units, threads, failures.

use crate::support::{Failure, advance, failure, in_threads, scene};
use bfree::simulation::StepError;
use bfree::solver::Stop;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

#[test]
fn any_number_of_threads_gives_the_same_bits() -> Result<(), Failure> {
    let run = |threads| {
        in_threads(threads, || {
            let mut simulation = scene::<3>("ball_drop.json", &[])?;
            advance(&mut simulation, 4)?;
            Ok(simulation.particles)
        })
    };
    let one = run(1)?;
    assert_eq!(one, run(2)?);
    assert_eq!(one, run(5)?);
    Ok(())
}

/// Loops over few nodes or particles stay on one thread. These two scenes have more: load steps with aggregation and multigrid, and dynamics with
/// affine fits, consistent inertia and smoothing.
#[test]
fn long_loops_that_threads_share_give_the_same_bits() -> Result<(), Failure> {
    let load_step = ["grid.spacing=0.25", "solver.newton.tolerance=1e-2"];
    let dynamic = [
        "grid.spacing=0.02",
        "time.step=0.002",
        "time.lumping=0.5",
        "time.projection=\"affine\"",
        "transfer={\"limited\": {\"rate\": 40}}",
    ];
    for (name, overrides) in [("cook.json", &load_step[..]), ("rebound.json", &dynamic)] {
        let run = |threads| {
            in_threads(threads, || {
                let mut simulation = scene::<2>(name, overrides)?;
                let report = simulation.advance()?;
                assert!(report.active_nodes > 8 * 2048, "{} nodes are not cut into parts", report.active_nodes);
                Ok((simulation.particles, report.newton.history.iterations.last().map(|last| last.residual)))
            })
        };
        assert!(run(1)? == run(3)?, "{name}");
    }
    Ok(())
}

#[test]
fn a_step_that_fails_is_halved_and_leaves_the_particles_alone() -> Result<(), Failure> {
    // Three Newton iterations are too few for a whole step of the hard impact, but not for a short one.
    let mut simulation = scene::<2>("rebound_fast.json", &["time.step=0.2", "solver.newton.max_iterations=3"])?;
    let mut halvings = 0;
    let bound = simulation.settings.newton.max_iterations;
    while simulation.clock.time() < 6.0 {
        let before = simulation.particles.clone();
        let time = simulation.clock.time();
        let mut attempt = simulation.clone();
        if attempt.step().is_err() {
            assert_eq!(attempt.particles, before);
            assert_eq!(attempt.clock.time(), time);
        }
        let dt = simulation.clock.step();
        let report = simulation.advance()?;
        halvings += report.failed.len();
        // Every attempt is half as long as the one before, and reports its cause of failure and its work.
        for (k, failed) in report.failed.iter().enumerate() {
            assert_eq!(failed.dt, dt * 0.5_f64.powi(k as i32));
            assert!(failed.why.contains("after the 3 allowed iterations"), "{}", failed.why);
            assert_eq!(failed.newton.iterations.len(), bound);
            assert!(failed.newton.counts.krylov_iterations > 0);
        }
        assert_eq!(report.dt, dt * 0.5_f64.powi(report.failed.len() as i32));
    }
    assert!(halvings > 0, "the test is meant to see a failing step");
    Ok(())
}

/// Ctrl-C in the middle of a step: the step is abandoned at once without halving it, and no particle has moved.
#[test]
fn a_step_that_is_stopped_loses_nothing() -> Result<(), Failure> {
    for (name, overrides) in [("rebound.json", &[][..]), ("elastica.json", &["time.step=0.5"])] {
        let fresh = scene::<2>(name, overrides)?;
        let mut undisturbed = fresh.clone();
        undisturbed.advance()?;
        let (mut stopped, asked) = (fresh.clone(), Arc::new(AtomicUsize::new(0)));
        let count = asked.clone();
        stopped.settings.stop = Some(Stop(Arc::new(move || count.fetch_add(1, Ordering::Relaxed) > 0)));
        let Err(error) = stopped.advance() else { return Err("its second iteration is not made".into()) };
        assert!(error.cause.is_stopped() && error.failed.len() == 1, "{error:?}");
        assert_eq!((asked.load(Ordering::Relaxed), stopped.clock.steps()), (2, 0));
        assert_eq!(stopped.particles.by_id(), fresh.particles.by_id());
        stopped.settings.stop = None;
        stopped.advance()?;
        assert_eq!(stopped.particles, undisturbed.particles);
    }
    Ok(())
}

/// The printed lattice of the rebound lies on cell faces. Shifted by some roundings, its particles must lie on the same side of them.
#[test]
fn round_off_does_not_decide_in_which_cell_a_particle_on_a_face_is() -> Result<(), Failure> {
    for family in [r#"approximation="linear""#, r#"approximation="gimp""#] {
        let energies = [0.0, 1e-13, -1e-13].map(|by| {
            let mut simulation = scene::<2>("rebound.json", &[family])?;
            simulation.particles.position.iter_mut().for_each(|x| x.add_scalar_mut(by));
            while simulation.clock.steps() < 500 {
                simulation.advance()?;
            }
            Ok::<_, Failure>([simulation.strain_energy(), simulation.particles.kinetic_energy()])
        });
        let [plain, above, below] = energies;
        let (plain, above, below) = (plain?, above?, below?);
        assert!(plain[0] > 1e-3 * plain[1], "it has touched the wall: {plain:?}");
        for (moved, rest) in above.iter().zip(&plain).chain(below.iter().zip(&plain)) {
            assert!((moved / rest - 1.0).abs() < 1e-6, "{family}: {above:?} {below:?} {plain:?}");
        }
    }
    Ok(())
}

#[test]
fn a_particle_that_leaves_the_grid_is_named() -> Result<(), Failure> {
    let free = r#"boundary={"bottom":"sliding","top":"sliding"}"#;
    let mut simulation = scene::<2>("rebound.json", &[free, "bodies.0.velocity=[-8,0]"])?;
    let error = failure(&mut simulation);
    let StepError::LeftGrid { particle, position } = &*error.cause else { return Err(error.into()) };
    assert!(*particle < 112 && position[0] < 0.0, "{error}");
    assert!(simulation.particles.position.iter().all(|x| simulation.grid.contains(x)));
    Ok(())
}
