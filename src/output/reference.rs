//! Reference of the output: the state at the start of the run.

use super::OutputError;
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::loads::Added;
use crate::simulation::Simulation;
use crate::tensor::Vector;

/// Positions, energy and momentum at the start of the run. A restarted run keeps the reference of the first run.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference<const D: usize> {
    /// Position of every particle by its id; displacements are measured from here.
    pub position: Vec<Vector<f64, D>>,
    /// Kinetic, strain, contact and dissipated energy, less the external work done so far.
    pub energy: f64,
    /// Σ m v
    pub momentum: Vector<f64, D>,
}

impl<const D: usize> Reference<D> {
    /// The present state as reference.
    ///
    /// ```
    /// use bfree::output::Reference;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let reference = Reference::of(&simulation);
    /// assert_eq!((reference.energy, reference.momentum), (3.5, simulation.particles.momentum()));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of<L: Law, A: ShapeFunction>(simulation: &Simulation<D, L, A>) -> Self {
        let particles = &simulation.particles;
        Self {
            position: particles.places().iter().map(|&p| particles.position[p as usize]).collect(),
            energy: particles.kinetic_energy()
                + simulation.strain_energy()
                + simulation.contact_energy()
                + simulation.dissipated
                + simulation.dissipated_by_laws()
                - simulation.external_work,
            momentum: particles.momentum(),
        }
    }

    /// A reference without particles, for fields that do not depend on the start.
    pub(super) fn unknown() -> Self {
        Self { position: Vec::new(), energy: 0.0, momentum: Vector::zeros() }
    }

    /// Checks that the reference has the particles of `simulation`. Points that were added to its surfaces since the start are not in the reference.
    pub(crate) fn check<L, A>(&self, simulation: &Simulation<D, L, A>) -> Result<(), OutputError> {
        let is_half = |added: &&Added<D>| matches!(added, Added::Half { .. });
        let added = simulation.loads.contacts.added.iter().filter(is_half).count();
        let (reference, particles) = (self.position.len(), simulation.particles.len() - added);
        if reference == particles { Ok(()) } else { Err(OutputError::Reference { reference, particles }) }
    }
}
