//! Time schemes in whole steps: properties that each of them has.

use crate::support::{Failure, advance, run_to, scene};
use bfree::mechanics::schemes::{Alphas, Newmark, Scheme};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use std::sync::Arc;

const FALL: &[&str] = &["gravity={\"acceleration\":[0,-0.01]}", "time.beta=null", "time.gamma=null"];

fn generalized(rho: f64) -> String {
    format!(r#"time.scheme={{"generalized_alpha":{{"spectral_radius":{rho}}}}}"#)
}

/// Every scheme is exact for uniform acceleration: x = ½ g t², v = g t, without strain.
#[test]
fn free_fall_is_exact_for_every_spectral_radius() -> Result<(), Failure> {
    for rho in [0.0, 0.5, 1.0] {
        for lumping in [1.0, 0.3] {
            let mut overrides = FALL.to_vec();
            let (key, lumping) = (generalized(rho), format!("time.lumping={lumping}"));
            overrides.extend([&*key, &*lumping]);
            let mut simulation = scene::<2>("rebound.json", &overrides)?;
            let (start, steps) = (simulation.particles.by_id(), 20);
            advance(&mut simulation, steps)?;
            let (end, t, g) = (simulation.particles.by_id(), 0.05 * steps as f64, Vector::from([0.0, -0.01]));
            for p in 0..end.len() {
                let fallen = end.position[p] - start.position[p] - start.velocity[p] * t;
                assert!((fallen - g * (0.5 * t * t)).norm() < 1e-9, "ρ = {rho}: {fallen}");
                assert!((end.velocity[p] - start.velocity[p] - g * t).norm() < 1e-9, "ρ = {rho}");
            }
            assert!(simulation.strain_energy() < 1e-16, "ρ = {rho}");
        }
    }
    Ok(())
}

/// Nodes with the prescribed motion of the body reach their target at the end of the step, not at the instant of the balance.
#[test]
fn a_region_that_moves_with_the_body_strains_nothing() -> Result<(), Failure> {
    let region = r#"prescribed=[{"region":{"box":{"min":[0,0],"max":[15,2.6]}},"velocity":[[0,[0.5,0]]]}]"#;
    for rho in [0.0, 0.5, 1.0] {
        let key = generalized(rho);
        let mut simulation = scene::<2>("rebound.json", &[region, "time.beta=null", "time.gamma=null", &key])?;
        let start = simulation.particles.by_id();
        advance(&mut simulation, 20)?;
        let end = simulation.particles.by_id();
        let moved = |p: usize| end.position[p] - start.position[p] - Vector::from([0.5, 0.0]);
        let most = (0..end.len()).map(|p| moved(p).norm()).fold(0.0, f64::max);
        // The bound is the tolerance of Newton's method.
        assert!(most < 1e-9, "ρ = {rho}: {most}");
        assert!(simulation.strain_energy() < 1e-16, "ρ = {rho}: {}", simulation.strain_energy());
    }
    Ok(())
}

/// A wall reaches its prescribed position at the end of each step, and its work is counted. A block pressed slowly from above is nearly
/// static, so Newmark's method gives the same result.
#[test]
fn a_moving_wall_arrives_and_its_work_is_counted() -> Result<(), Failure> {
    let run = |scheme: &str| -> Result<Simulation<2>, Failure> {
        let wall = r#"boundary.top={"displacement":[[0,[null,0]],[5,[null,-0.1]]]}"#;
        let overrides = ["grid.size=[1,1]", wall, "time.beta=null", "time.gamma=null", scheme];
        let mut simulation = scene::<2>("compaction_confined.json", &overrides)?;
        advance(&mut simulation, 30)?;
        Ok(simulation)
    };
    let newmark = run("time.scheme=\"newmark\"")?;
    let top = |of: &Simulation<2>| of.particles.position.iter().map(|x| x[1]).fold(f64::MIN, f64::max);
    for rho in [0.6, 1.0] {
        let other = run(&generalized(rho))?;
        let (place, work) = (top(&other) - top(&newmark), other.external_work / newmark.external_work - 1.0);
        assert!(place.abs() < 1e-3 * newmark.grid.spacing, "ρ = {rho}: the top is {place} away");
        // Without damping, the jolt of the wall's start keeps ringing.
        assert!(rho < 1.0 || work.abs() < 1e-3, "ρ = {rho}: work differs by {work}");
    }
    Ok(())
}

/// After a jump of the load, the trapezoidal rule keeps the fastest vibrations and ρ∞ = 0 removes them. The slow vibration stays.
#[test]
fn it_damps_what_steps_do_not_resolve() -> Result<(), Failure> {
    let energies = |scheme: &str| -> Result<f64, Failure> {
        let mut simulation =
            scene::<2>("rebound.json", &["time.step=0.2", "time.beta=null", "time.gamma=null", scheme])?;
        run_to(&mut simulation, 30.0)?;
        Ok(simulation.strain_energy() + simulation.particles.kinetic_energy())
    };
    let (none, some, all) = (energies(&generalized(1.0))?, energies(&generalized(0.5))?, energies(&generalized(0.0))?);
    assert!(none > some && some > all && all > 0.5 * none, "{none} {some} {all}");
    Ok(())
}

/// A user's own scheme is one `impl`: here backward Euler.
#[derive(Debug)]
struct BackwardEuler;

impl Scheme for BackwardEuler {
    fn name(&self) -> String {
        "backward Euler".into()
    }

    /// v = Δφ/Δt, a = (v − v_n)/Δt
    fn end(&self, dt: f64) -> Alphas {
        Alphas { dt, a1: 1.0 / (dt * dt), a2: 1.0 / dt, a3: 0.0, a4: 1.0 / dt, a6: 0.0, discrete_gradient: false }
    }

    fn error_constant(&self) -> f64 {
        0.5
    }
}

#[test]
fn a_scheme_of_ones_own_runs_the_step() -> Result<(), Failure> {
    let mut own = scene::<2>("rebound.json", &[])?;
    // Newmark's scheme below is also of order one.
    own.settings.scheme = Arc::new(BackwardEuler);
    let mut newmark = own.clone();
    newmark.settings.scheme = Arc::new(Newmark { beta: 0.5, gamma: 1.0 });
    let energy = own.particles.kinetic_energy();
    advance(&mut own, 100)?;
    advance(&mut newmark, 100)?;
    // Both schemes are exact in free flight.
    assert!((own.particles.kinetic_energy() / energy - 1.0).abs() < 1e-9);
    let (own, newmark) = (own.particles.by_id(), newmark.particles.by_id());
    assert!(own.position.iter().zip(&newmark.position).all(|(a, b)| (a - b).norm() < 1e-9));
    Ok(())
}

#[test]
fn what_is_newmarks_own_is_refused_elsewhere() {
    for (more, words) in [
        ("time.beta=0.25", "time.beta"),
        ("time.gamma=0.5", "time.gamma"),
        ("time.scheme.generalized_alpha.spectral_radius=1.5", "time.scheme.generalized_alpha.spectral_radius"),
        ("time.scheme.generalized_alpha.spectral_radius=-0.1", "must"),
        ("time.scheme.generalized_alpha.radius=0.1", "radius"),
    ] {
        let error = scene::<2>("rebound.json", &["time.beta=null", "time.gamma=null", &generalized(0.5), more])
            .expect_err(more)
            .to_string();
        assert!(error.contains(words), "{more}: {error}");
    }
}
