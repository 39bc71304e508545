//! The compaction of section 4.2 against an independent program. The study `compaction` compares the circular support, to 1e-8.

use crate::support::{Failure, rows, scene};

/// The largest difference of u_y at (0.525, 0.975) from the reference, over its largest value.
fn difference(name: &str, reference: &str) -> Result<f64, Failure> {
    let mut simulation = scene::<2>(name, &[])?;
    assert_eq!(simulation.particles.len(), 400);
    let start = simulation.particles.position.clone();
    let near = |x: &bfree::tensor::Vector<f64, 2>| (x[0] - 0.525).abs() + (x[1] - 0.975).abs() < 1e-9;
    let probe = start.iter().position(near).ok_or("no particle at (0.525, 0.975)")?;
    let (mut largest, mut scale): (f64, f64) = (0.0, 0.0);
    for row in rows(reference) {
        if row[0] > 0.0 {
            simulation.advance()?;
        }
        assert!((simulation.clock.time() - row[0]).abs() < 1e-9);
        let now = simulation.particles.place(probe).ok_or("the particle is lost")?;
        let displacement = simulation.particles.position[now][1] - start[probe][1];
        largest = largest.max((displacement - row[1]).abs());
        scale = scale.max(row[1].abs());
    }
    Ok(largest / scale)
}

const FREE: &str = include_str!("../reference/compaction_free_lme3.csv");
const CONFINED: &str = include_str!("../reference/compaction_confined_lme3.csv");

#[test]
fn the_free_block_follows_the_reference() -> Result<(), Failure> {
    let largest = difference("compaction.json", FREE)?;
    assert!(largest < 1e-3, "differs by {largest:e}");
    Ok(())
}

#[test]
fn the_confined_block_follows_the_reference() -> Result<(), Failure> {
    let largest = difference("compaction_confined.json", CONFINED)?;
    assert!(largest < 1e-3, "differs by {largest:e}");
    Ok(())
}
