//! The fields of the particles, computed on demand.

use super::{OutputError, Reference};
use crate::field::Field;
use crate::material::{
    DISSIPATED, Law, PLASTIC_STRAIN, internal_variable, internal_variable_names, out_of_plane_stress, principal_values,
};
use crate::simulation::Simulation;
use crate::tensor::{SYMMETRIC, Tensor, Vector, embed, identity};

impl Field {
    /// Appends the components at the particle `id` to `out`.
    ///
    /// ```
    /// use bfree::{field::Field, output::Reference, tensor::Tensor};
    ///
    /// // Uniaxial strain ε = 1e-9 in a plane: σ_xx = (Λ + 2G) ε, and Λ ε in the other two directions.
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// simulation.particles.displacement_gradient[0] = Tensor::<f64, 2>::new(1e-9, 0.0, 0.0, 0.0);
    /// let mut stress = Vec::new();
    /// Field::Stress.append(&simulation, &Reference::of(&simulation), 0, &mut stress)?;
    /// for (component, modulus) in [210.0, 150.0, 150.0, 0.0, 0.0, 0.0].into_iter().enumerate() {
    ///     assert!((stress[component] / 1e-9 - modulus).abs() < 1e-5);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The particle does not exist. The reference has another number of particles. A stress is asked for where det F ≤ 0. A velocity or
    /// acceleration is asked for without inertia, or an internal variable that no law has.
    pub fn append<const D: usize, L: Law, A>(
        &self,
        simulation: &Simulation<D, L, A>,
        reference: &Reference<D>,
        id: usize,
        out: &mut Vec<f64>,
    ) -> Result<(), OutputError> {
        reference.check(simulation)?;
        let particles = &simulation.particles;
        let place = particles.place(id).ok_or(OutputError::NoParticle { particle: id, particles: particles.len() })?;
        self.check(simulation)?;
        self.append_at(simulation, reference, place, out)
    }

    /// Whether the field needs more of a particle than every process has.
    pub(super) fn needs_state(&self) -> bool {
        !matches!(self, Self::Position | Self::Displacement | Self::Mass | Self::Volume | Self::Body)
    }

    /// Refuses an internal variable that no law has, and velocities and accelerations without inertia.
    pub(super) fn check<const D: usize, L: Law, A>(&self, simulation: &Simulation<D, L, A>) -> Result<(), OutputError> {
        // A process may have no particles of its own.
        let moves = simulation.settings.scheme.has_inertia() || !simulation.particles.velocity.is_empty();
        if matches!(self, Self::Velocity | Self::Acceleration) && !moves {
            return Err(OutputError::Inertia(self.clone()));
        }
        let Self::Internal(name) = self else { return Ok(()) };
        let known = internal_variable_names(simulation.bodies.iter().map(|body| &body.law));
        let found = known.contains(&name.as_str());
        found.then_some(()).ok_or_else(|| OutputError::Internal { name: name.clone(), known: known.join(", ") })
    }

    /// Appends the components at the particle with index `place` in memory, see [`Self::append`].
    fn append_at<const D: usize, L: Law, A>(
        &self,
        simulation: &Simulation<D, L, A>,
        reference: &Reference<D>,
        place: usize,
        out: &mut Vec<f64>,
    ) -> Result<(), OutputError> {
        let particles = &simulation.particles;
        let id = particles.id[place] as usize;
        let at = || particles.state(place, 0.0);
        let body = &simulation.bodies[particles.body[place] as usize];
        let law = &body.law;
        let averaged = || body.averaged(particles.dilatation(place), at().j);
        let stress = || -> Result<Tensor<f64, 3>, OutputError> {
            let stress = simulation.cauchy_stress(place);
            let mut stress = embed(&stress.map_err(|source| OutputError::Inadmissible { particle: id, source })?);
            for i in D..3 {
                stress[(i, i)] = out_of_plane_stress(law, &at()) + averaged()[1];
            }
            Ok(stress)
        };
        let symmetric = |tensor: Tensor<f64, 3>| SYMMETRIC.map(|component| tensor[component]);
        let rate = |rates: &[Vector<f64, D>]| {
            rates.get(particles.local_index(place)).map(padded).ok_or_else(|| OutputError::Inertia(self.clone()))
        };
        let recalled = |name| internal_variable(law, &at(), name).unwrap_or(0.0);
        match self {
            Self::Position => out.extend(padded(&particles.position[place])),
            Self::Displacement => {
                let particles_then = reference.position.len();
                let then = reference.position.get(id);
                let then = then.ok_or(OutputError::NoParticle { particle: id, particles: particles_then })?;
                out.extend(padded(&(particles.position[place] - then)));
            }
            Self::Velocity => out.extend(rate(&particles.velocity)?),
            Self::Acceleration => out.extend(rate(&particles.acceleration)?),
            Self::DeformationGradient => out.extend(&(identity::<f64, 3>() + embed(&at().h)).transpose()),
            Self::Jacobian => out.push(at().jacobian),
            Self::Strain => out.extend(symmetric(embed(&at().green_lagrange()))),
            Self::Stress => out.extend(symmetric(stress()?)),
            Self::PrincipalStress => out.extend(principal_values(&stress()?)),
            Self::Pressure => out.push(-stress()?.trace() / 3.0),
            Self::VonMises => out.push(von_mises(&stress()?)),
            Self::EnergyDensity => out.push(law.energy(&at()) + averaged()[0]),
            Self::PlasticStrain => out.push(recalled(PLASTIC_STRAIN)),
            Self::DissipatedDensity => out.push(recalled(DISSIPATED)),
            Self::Internal(name) => out.push(recalled(name)),
            Self::Mass => out.push(particles.mass[place]),
            Self::Volume => out.push(particles.volume[place]),
            Self::Body => out.push(f64::from(particles.body[place])),
        }
        Ok(())
    }

    /// The components at all particles, by their ids.
    ///
    /// ```
    /// use bfree::{field::Field, output::Reference};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let reference = Reference::of(&simulation);
    /// simulation.step()?;
    /// // In free flight every particle is displaced by v Δt = 0.025 along x.
    /// let displacements = Field::Displacement.values(&simulation, &reference)?;
    /// assert_eq!(displacements.len(), 3 * 112);
    /// assert!(displacements.chunks(3).all(|u| (u[0] - 0.025).abs() < 1e-12 && u[1].abs() < 1e-12 && u[2] == 0.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`Self::append`].
    pub fn values<const D: usize, L: Law, A>(
        &self,
        simulation: &Simulation<D, L, A>,
        reference: &Reference<D>,
    ) -> Result<Vec<f64>, OutputError> {
        reference.check(simulation)?;
        self.check(simulation)?;
        let places = simulation.particles.solid_places();
        let mut out = Vec::with_capacity(places.len() * self.kind().components().len());
        self.append_at_all(simulation, reference, &places, &mut out)?;
        Ok(out)
    }

    /// Appends the components at some places in memory, after [`Self::check`].
    pub(super) fn append_at_all<const D: usize, L: Law, A>(
        &self,
        simulation: &Simulation<D, L, A>,
        reference: &Reference<D>,
        places: &[u32],
        out: &mut Vec<f64>,
    ) -> Result<(), OutputError> {
        places.iter().try_for_each(|&place| self.append_at(simulation, reference, place as usize, out))
    }
}

/// A vector with zeros for the missing components.
pub(crate) fn padded<const D: usize>(v: &Vector<f64, D>) -> [f64; 3] {
    std::array::from_fn(|i| if i < D { v[i] } else { 0.0 })
}

/// Von Mises stress √(3/2 s:s) with the deviator s. Differences of the normal stresses make a pressure cancel exactly.
fn von_mises(s: &Tensor<f64, 3>) -> f64 {
    let normal = (s[(0, 0)] - s[(1, 1)]).powi(2) + (s[(1, 1)] - s[(2, 2)]).powi(2) + (s[(2, 2)] - s[(0, 0)]).powi(2);
    let shear = s[(0, 1)].powi(2) + s[(1, 2)].powi(2) + s[(0, 2)].powi(2);
    (0.5 * normal + 3.0 * shear).sqrt()
}
