//! Initial velocities.

use bfree::approximation::ShapeFunction;
use bfree::material::Law;
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::transfer::Nodal;
use bfree::simulation::{Simulation, StepError};
use bfree::tensor::Vector;

/// Gives the particles `velocity(x_p)`, projects it to the nodes by the masses, and interpolates it back once, as the independent program
/// does. So velocities that the nodes cannot represent vanish, and a jump extends equally to both sides.
///
/// # Errors
/// A particle without shape functions.
pub fn velocity_by_masses<const D: usize, L: Law, A: ShapeFunction>(
    simulation: &mut Simulation<D, L, A>,
    velocity: impl Fn(&Vector<f64, D>) -> Vector<f64, D>,
) -> Result<(), StepError> {
    let particles = &mut simulation.particles;
    particles.velocity = particles.position.iter().map(velocity).collect();
    let (connectivity, _) = Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    let nodal = Nodal::project(particles, &connectivity, 1.0)?;
    particles.velocity = connectivity.values(&nodal.velocity).to_vec();
    Ok(())
}
