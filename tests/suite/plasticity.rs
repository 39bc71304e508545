//! Metal and soil up to and beyond their limit loads, against published results. More tests of metals: `tutorial.rs`.

use crate::support::{Failure, failure, run_to, scene};
use bfree::causes;
use bfree::simulation::Simulation;

/// The displacement (m) of the crest of the slope with the strength divided by `factor`: c/F, tan φ/F.
fn sinking(factor: f64) -> Result<f64, Failure> {
    let friction = (20.0_f64.to_radians().tan() / factor).atan().to_degrees();
    let law = "bodies.0.material.drucker_prager";
    let overrides = [format!("{law}.friction={friction}"), format!("{law}.cohesion.initial={}", 10.0 / factor)];
    let mut simulation: Simulation<2> = scene("slope.json", &overrides.each_ref().map(String::as_str))?;
    let start = simulation.particles.by_id().position;
    let distance = |x: &bfree::tensor::Vector<f64, 2>| (x[0] - 12.0).hypot(x[1] - 10.0);
    let crest = (0..start.len()).min_by(|&a, &b| distance(&start[a]).total_cmp(&distance(&start[b])));
    let crest = crest.ok_or("no particles")?;
    run_to(&mut simulation, 1.0)?;
    Ok(start[crest][1] - simulation.particles.by_id().position[crest][1])
}

/// Griffiths and Lane (Géotechnique 49, 1999), example 1: finite elements with Mohr–Coulomb's criterion fail at a factor of 1.4. Bishop and
/// Morgenstern's charts give 1.380. At finite strain every strength has an equilibrium, so failure shows as a sudden growth of the
/// displacement.
#[test]
fn a_slope_fails_at_the_factor_of_griffiths_and_lane() -> Result<(), Failure> {
    let [safe, before, after] = [1.0, 1.35, 1.45].map(sinking);
    let (safe, before, after) = (safe?, before?, after?);
    assert!(before < 2.0 * safe && after > 5.0 * safe, "{safe} m, {before} m, {after} m");
    Ok(())
}

/// The limit pressure of a tube is 2/√3 Y ln(b/a) = 0.1921 GPa (Hill). The error after the last halved step names the possible cause.
#[test]
fn a_pressure_that_a_tube_cannot_bear_is_found_and_said() -> Result<(), Failure> {
    let mut simulation: Simulation<2> = scene("tube.json", &["time.end=1", "grid.spacing=16"])?;
    let error = failure(&mut simulation);
    let borne = 0.2 * error.time / (2.0 / 3.0_f64.sqrt() * 0.24 * 2.0_f64.ln());
    assert!((0.99..1.005).contains(&borne), "{borne}");
    let text = causes::on_one_line(&error);
    assert!(text.contains("larger than the bodies bear") && text.contains("arc_length"), "{text}");
    Ok(())
}

/// Experiments by Nguyen and others with aluminium rods (arXiv:1512.05180): in columns lower than 0.65 times their width, the part at rest
/// keeps its height. The front lies between two measured widths: that of sand (Lube and others, Phys. Rev. E 72, 2005: width (1 + 1.2 a),
/// with a = 0.5), and that of rods with 0.65 < a < 1.5 (width (1 + 3.25 a^0.96)).
#[test]
fn a_column_collapses_and_comes_to_rest() -> Result<(), Failure> {
    let mut simulation: Simulation<2> = scene("collapse.json", &[])?;
    let (width, height, mut fastest) = (0.2, 0.1, 0.0_f64);
    while simulation.clock.time() < 0.6 - 1e-9 {
        let step = simulation.advance()?;
        assert!(step.failed.is_empty(), "{:?}", step.failed);
        fastest = fastest.max(simulation.particles.kinetic_energy());
    }
    let particles = &simulation.particles;
    let largest = |axis: usize| particles.position.iter().map(|x| x[axis]).fold(0.0, f64::max);
    assert!(largest(1) > 0.96 * height, "the top stays: {}", largest(1));
    let front = largest(0) / width;
    assert!(front > 1.0 + 1.2 * 0.5 && front < 1.0 + 3.25 * 0.5_f64.powf(0.96), "{front}");
    assert!(particles.kinetic_energy() < 0.03 * fastest, "{} J of {fastest} J are left", particles.kinetic_energy());
    Ok(())
}
