//! Sums over all particles: energies and momentum.

use super::Simulation;
use crate::material::{DISSIPATED, Law, internal_variable};
use crate::parallel::Processes;
use crate::tensor::Vector;

/// Sums over all particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sums<const D: usize> {
    /// Σ ½ m v·v
    pub kinetic: f64,
    /// Σ V₀ W
    pub strain: f64,
    /// Energy dissipated by plastic flow and relaxation since the start.
    pub by_laws: f64,
    /// Σ m v
    pub momentum: Vector<f64, D>,
    /// Σ m |v|
    pub momentum_scale: f64,
}

impl<const D: usize, L: Law, A> Simulation<D, L, A> {
    /// The sums over all particles. All processes make this call, and none needs the particles of the others.
    ///
    /// ```
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// simulation.step()?;
    /// let (sums, particles) = (simulation.sums(), &simulation.particles);
    /// assert_eq!((sums.kinetic, sums.momentum), (particles.kinetic_energy(), particles.momentum()));
    /// assert_eq!((sums.strain, sums.by_laws), (simulation.strain_energy(), 0.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn sums(&self) -> Sums<D> {
        self.sums_of(Some(&self.settings.processes))
    }

    /// [`Self::sums`] of a process that has all particles.
    pub(crate) fn sums_here(&self) -> Sums<D> {
        self.sums_of(None)
    }

    fn sums_of(&self, processes: Option<&Processes>) -> Sums<D> {
        let particles = &self.particles;
        let velocity = |p: usize| particles.velocity.get(particles.local_index(p));
        let kinetic = |p: usize| velocity(p).map_or(0.0, |v| 0.5 * particles.mass[p] * v.norm_squared());
        let all = (processes, particles.len());
        let scale = |p: usize| velocity(p).map_or(0.0, |v| particles.mass[p] * v.norm());
        let [kinetic, momentum_scale] = particles.parts.sum(all, [0.0; 2], |p| [kinetic(p), scale(p)]);
        let momentum =
            particles.parts.sum(all, [0.0; D], |p| velocity(p).map_or([0.0; D], |v| (v * particles.mass[p]).into()));
        let (strain, by_laws) = (self.strain_of(processes), self.dissipated_of(processes));
        Sums { kinetic, strain, by_laws, momentum: momentum.into(), momentum_scale }
    }

    /// Σ V₀ W, the strain energy of all particles.
    ///
    /// ```
    /// use bfree::tensor::Tensor;
    ///
    /// // A small uniaxial strain ε: ½ (Λ + 2G) ε² times the volume; Λ + 2G = 170 + 4/3 · 30 = 210.
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// assert_eq!(simulation.strain_energy(), 0.0);
    /// let strain = 1e-8;
    /// simulation.particles.displacement_gradient.fill(Tensor::<f64, 2>::new(strain, 0.0, 0.0, 0.0));
    /// let linear = 0.5 * 210.0 * strain * strain * simulation.particles.volume.iter().sum::<f64>();
    /// assert!((simulation.strain_energy() / linear - 1.0).abs() < 1e-7);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn strain_energy(&self) -> f64 {
        self.strain_of(None)
    }

    fn strain_of(&self, processes: Option<&Processes>) -> f64 {
        let (particles, bodies) = (&self.particles, &self.bodies);
        let energy = |p: usize| {
            if !particles.is_solid(p) {
                return 0.0;
            }
            let at = particles.state(p, 0.0);
            let body = &bodies[particles.body[p] as usize];
            let [more, _] = body.averaged(particles.dilatation(p), at.j);
            particles.volume[p] * (body.law.energy(&at) + more)
        };
        let [sum] = particles.parts.sum((processes, particles.len()), [-0.0], |p| [energy(p)]);
        sum
    }

    /// Energy dissipated by plastic flow and relaxation since the start: Σ V₀ times the density that each law records.
    pub fn dissipated_by_laws(&self) -> f64 {
        self.dissipated_of(None)
    }

    fn dissipated_of(&self, processes: Option<&Processes>) -> f64 {
        if !self.has_internal_variable(DISSIPATED) {
            return 0.0;
        }
        let (particles, bodies) = (&self.particles, &self.bodies);
        let [sum] = particles.parts.sum((processes, particles.len()), [-0.0], |p| {
            let law = &bodies[particles.body[p] as usize].law;
            [particles.volume[p] * internal_variable(law, &particles.state(p, 0.0), DISSIPATED).unwrap_or(0.0)]
        });
        sum
    }
}
