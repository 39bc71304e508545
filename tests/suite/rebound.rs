//! The rebound of section 4.3 against an independent program (tests/reference/rebound_lme3.csv).

use crate::support::{Failure, rows, scene};

const REFERENCE: &str = include_str!("../reference/rebound_lme3.csv");
/// The energy at the start.
const ENERGY: f64 = 3.5;

/// The largest difference in kinetic and strain energy up to `end`, over the initial energy.
fn difference(overrides: &[&str], end: f64) -> Result<f64, Failure> {
    let mut simulation = scene::<2>("rebound.json", overrides)?;
    assert_eq!(simulation.particles.len(), 112);
    let mut largest: f64 = 0.0;
    for row in rows(REFERENCE).take_while(|row| row[0] < end + 0.025) {
        if row[0] > 0.0 {
            simulation.advance()?;
        }
        assert!((simulation.clock.time() - row[0]).abs() < 1e-9);
        let (kinetic, strain) = (simulation.particles.kinetic_energy(), simulation.strain_energy());
        largest = largest.max((kinetic - row[1]).abs()).max((strain - row[2]).abs());
    }
    Ok(largest / ENERGY)
}

#[test]
fn the_circular_support_agrees_row_by_row() -> Result<(), Failure> {
    let circle = r#"approximation={"lme":{"gamma":3,"support":"circle"}}"#;
    let largest = difference(&[circle, "solver.newton.tolerance=1e-10"], 40.0)?;
    assert!(largest < 1e-6, "the energies differ by {largest:e} of the initial energy");
    Ok(())
}

#[test]
fn the_separable_support_agrees_to_its_truncation() -> Result<(), Failure> {
    let largest = difference(&[], 40.0)?;
    assert!(largest < 1e-3, "the energies differ by {largest:e} of the initial energy");
    Ok(())
}
