//! Steps whose length follows an error tolerance.

use crate::damping;
use crate::support::{Failure, scene};
use bfree::clock::Clock;
use bfree::mechanics::loads::Rayleigh;
use bfree::simulation::{Settings, Simulation};
use std::f64::consts::PI;

/// A bar of length 1 and wave speed 1 between two walls. It starts undeformed, with the speed V sin πx. For tiny V it vibrates with u =
/// (V/ω) sin(πx) sin(ωt), ω = π.
const SPEED: f64 = 1e-6;

fn bar(dt: f64) -> Result<Simulation<1>, Failure> {
    let mut simulation = damping::bar(64, dt, Rayleigh { mass: 0.0, stiffness: 0.0 }, SPEED, false)?;
    simulation.loads.damping = None;
    simulation.clock = Clock::new(dt, 10);
    simulation.settings = Settings { lumping: 0.0, error_tolerance: Some(1.0), ..Settings::default() };
    Ok(simulation)
}

/// The error of the trapezoidal rule in one step is Δt³ u‴/12, in the mean square with u‴ = V ω² cos(ωt) √½.
#[test]
fn the_estimate_is_the_local_error_of_an_oscillation() -> Result<(), Failure> {
    let mut last = None;
    for steps in [10, 20, 40] {
        let dt = 0.2 / f64::from(steps);
        let mut simulation = bar(dt)?;
        let mut estimate = 0.0;
        for _ in 0..steps {
            estimate = simulation.advance()?.error.ok_or("no error")? * simulation.grid.spacing;
        }
        let middle = simulation.clock.time() - 0.5 * dt;
        let third = SPEED * PI * PI * (PI * middle).cos() * 0.5_f64.sqrt();
        let effectivity = estimate / (dt.powi(3) * third / 12.0);
        assert!((0.97..1.03).contains(&effectivity), "dt = {dt}: {effectivity}");
        if let Some(last) = last {
            let order = f64::log2(last / estimate);
            assert!((2.9..3.1).contains(&order), "{order}");
        }
        last = Some(estimate);
    }
    Ok(())
}

#[test]
fn a_step_that_errs_too_much_is_taken_back_and_the_next_ones_grow_when_they_may() -> Result<(), Failure> {
    // At first a step of 0.1 has the error 0.1³ V π² √½ / 12 / h = 3.7e-8 spacings, approximately.
    let mut simulation = bar(0.1)?;
    let tolerance = 1e-9;
    simulation.settings.error_tolerance = Some(tolerance);
    let before = simulation.particles.clone();
    assert!(simulation.clone().step().is_err() && simulation.particles == before);
    let (mut shortest, mut longest) = (f64::INFINITY, 0.0_f64);
    while simulation.clock.time() < 1.0 {
        let report = simulation.advance()?;
        assert!(report.error.is_some_and(|error| error <= tolerance), "{:?}", report.error);
        assert!(report.failed.iter().all(|attempt| attempt.inaccurate && attempt.why.contains("grid spacings")));
        (shortest, longest) = (shortest.min(report.dt), longest.max(report.dt));
    }
    // u‴ vanishes at the turning point, t = ½, so steps are longer there. The steps still end at every whole step.
    assert!(longest >= 2.0 * shortest, "{shortest} {longest}");
    assert_eq!(simulation.clock.time(), 1.0);
    // At the limit of halvings the step is accepted and reports its error.
    let mut limited = bar(0.1)?;
    limited.settings.error_tolerance = Some(tolerance);
    limited.clock = Clock::new(0.1, 1);
    assert!(limited.advance()?.error.is_some_and(|error| error > tolerance));
    Ok(())
}

/// Errors fall up to the turning point, so an accepted step length stays admissible and no longer step is rejected. At first a quarter of
/// 0.1 has 0.58 of this tolerance as its error; twice that length would have 4.6 times the tolerance.
#[test]
fn a_step_that_errs_more_than_an_eighth_of_the_tolerance_does_not_grow() -> Result<(), Failure> {
    let tolerance = 1e-9;
    let mut simulation = bar(0.1)?;
    simulation.settings.error_tolerance = Some(tolerance);
    let first = simulation.advance()?;
    let share = first.error.ok_or("no error")? / tolerance;
    assert!((0.2..0.9).contains(&share) && first.dt == 0.025, "{share} in {}", first.dt);
    while simulation.clock.time() < 0.45 {
        let report = simulation.advance()?;
        assert!(report.failed.is_empty(), "taken back after {}: {:?}", simulation.clock.time(), report.failed);
    }
    Ok(())
}

/// An impact needs short steps; the flight before it does not.
#[test]
fn an_impact_takes_fewer_steps_than_short_ones_all_the_way() -> Result<(), Failure> {
    let end = 25.6;
    let run = |overrides: &[&str]| -> Result<(Simulation<2>, usize), Failure> {
        let mut simulation = scene::<2>("rebound.json", overrides)?;
        let mut attempts = 0;
        while simulation.clock.time() < end - 1e-9 {
            attempts += 1 + simulation.advance()?.failed.len();
        }
        Ok((simulation, attempts))
    };
    let distance = |a: &Simulation<2>, b: &Simulation<2>| {
        let (a, b) = (a.particles.by_id(), b.particles.by_id());
        let squares = a.position.iter().zip(&b.position).map(|(x, y)| (x - y).norm_squared());
        (squares.sum::<f64>() / a.len() as f64).sqrt()
    };
    let (exact, _) = run(&["time.step=0.00625"])?;
    let (uniform, all) = run(&["time.step=0.025"])?;
    let adaptive = ["time.step=0.8", r#"time.adaptive={"tolerance":1e-5}"#];
    let (one, few) = run(&adaptive)?;
    let [error, of_uniform] = [&one, &uniform].map(|run| distance(run, &exact));
    println!("uniform {all} {of_uniform:e}, adaptive {few} {error:e}");
    assert!(error <= of_uniform, "{error} {of_uniform}");
    assert!(3 * few < 2 * all, "{few} attempts, {all} steps");
    // A second run gives the same bits.
    let (again, same) = run(&adaptive)?;
    assert_eq!((again.particles, same), (one.particles, few));
    Ok(())
}
