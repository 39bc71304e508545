//! Particle-to-grid transfer (eqs. 40–42).

use crate::mechanics::affine::affine;
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::mass::{Mass, is_light, lumped, restricted};
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::Connectivity;
use crate::parallel;
use crate::particles::Particles;
use crate::pooled::{Pool, Pooled};
use crate::solver::LinearError;
use crate::space::Space;
use crate::tensor::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Lumped mass, velocity and acceleration at the active nodes. Each nodal array has one entry per active node, or is empty if nothing needs
/// it.
///
/// ```
/// use bfree::mechanics::{check::direction, sweep::Connectivity, transfer::Nodal};
/// use bfree::tensor::Vector;
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let mut simulation = scene.build::<2>("scenes".as_ref())?;
/// let particles = &mut simulation.particles;
/// particles.velocity = direction(particles.len(), 1);
/// let (connectivity, _) = Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
/// let momentum = |nodal: &Nodal<2>| nodal.mass.iter().zip(&nodal.velocity).map(|(&m, v)| v * m).sum::<Vector<f64, 2>>();
/// // Mass and momentum are those of the particles, for the lumped and for the consistent mass.
/// let rest = Nodal::at_rest(particles, &connectivity);
/// assert!((rest.mass.iter().sum::<f64>() / particles.mass.iter().sum::<f64>() - 1.0).abs() < 1e-14);
/// let lumped = Nodal::project(particles, &connectivity, 1.0)?;
/// let consistent = Nodal::project(particles, &connectivity, 0.1)?;
/// assert!((momentum(&lumped) - particles.momentum()).norm() < 1e-13);
/// assert!((momentum(&consistent) - particles.momentum()).norm() < 1e-10);
/// assert!(lumped.iterations == 0 && consistent.iterations > 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nodal<const D: usize> {
    /// Σ_p m N_I; empty without inertia and gravity.
    pub mass: Pooled<f64>,
    /// v_n; empty without inertia.
    pub velocity: Pooled<Vector<f64, D>>,
    /// a_n; empty without inertia.
    pub acceleration: Pooled<Vector<f64, D>>,
    /// φ_n, the motion since the last grid reset; empty right after a reset.
    pub motion: Pooled<Vector<f64, D>>,
    /// R₀, the out-of-balance force carried over at the last grid reset; empty on the first grid, and with inertia.
    pub out_of_balance: Pooled<Vector<f64, D>>,
    /// Iterations of the projection; 0 for a lumped mass.
    pub iterations: usize,
}

impl<const D: usize> Nodal<D> {
    /// Projects the particles' velocity and acceleration with M̃ = (1−ε) M + ε lumped(M) onto the active nodes:
    /// M̃ v = Σ_p N m v_p and M̃ a = Σ_p N m a_p (eq. 42).
    ///
    /// # Errors
    /// The projection overflows, because particle velocities are too large.
    pub fn project(
        particles: &Particles<D>,
        connectivity: &Connectivity<D>,
        lumping: f64,
    ) -> Result<Self, LinearError> {
        let lumped = lumped(particles, connectivity);
        let mass = Mass { particles, connectivity, lumped: &lumped, lumping };
        let ([velocity, acceleration], iterations) = mass.project([&particles.velocity, &particles.acceleration])?;
        Ok(Self { mass: lumped, velocity, acceleration, iterations, ..Self::default() })
    }

    /// The lumped mass, and velocity and acceleration by [`Projection::Affine`].
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, sweep::Connectivity, transfer::Nodal};
    /// use bfree::tensor::Vector;
    ///
    /// let linear = r#"approximation="linear""#.parse()?;
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[linear])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let particles = &mut simulation.particles;
    /// particles.velocity = direction(particles.len(), 1);
    /// let (connectivity, _) = Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// // The momentum is that of the particles.
    /// let nodal = Nodal::fit(particles, &connectivity);
    /// let momentum: Vector<f64, 2> = nodal.mass.iter().zip(&nodal.velocity).map(|(&m, v)| v * m).sum();
    /// assert!((momentum - particles.momentum()).norm() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn fit(particles: &Particles<D>, connectivity: &Connectivity<D>) -> Self {
        let mass = lumped(particles, connectivity);
        let mut fields = affine(particles, connectivity, &mass, [&particles.velocity, &particles.acceleration]);
        // E û with the same momentum as u: Eᵀ m û = Eᵀ (m u).
        let space = connectivity.space([]);
        for u in fields.iter_mut().filter(|_| !space.followers().is_empty()) {
            u.iter_mut().zip(&mass).for_each(|(u, &m)| *u *= m);
            divide(particles, &space, &mass, u);
        }
        let [velocity, acceleration] = fields;
        Self { mass, velocity, acceleration, ..Self::default() }
    }

    /// The lumped mass; velocity and acceleration are zero.
    pub fn at_rest(particles: &Particles<D>, connectivity: &Connectivity<D>) -> Self {
        let still: Pooled<Vector<f64, D>> = connectivity.field();
        Self { velocity: still.clone(), acceleration: still, ..Self::mass_alone(particles, connectivity) }
    }

    /// The lumped mass alone, which gravity acts on: there is no inertia.
    pub(crate) fn mass_alone(particles: &Particles<D>, connectivity: &Connectivity<D>) -> Self {
        Self { mass: lumped(particles, connectivity), ..Self::default() }
    }

    /// Whether there is no inertia.
    pub fn is_static(&self) -> bool {
        self.velocity.is_empty()
    }

    /// φ_n of a node; zero right after a grid reset.
    pub(crate) fn moved(&self, node: usize) -> Vector<f64, D> {
        self.motion.get(node).copied().unwrap_or_else(Vector::zeros)
    }

    /// φ_n at so many nodes.
    pub(crate) fn motion_of(&self, nodes: usize, pool: &Pool) -> Pooled<Vector<f64, D>> {
        pool.made(nodes, |node| self.moved(node))
    }

    /// φ_n + Δφ̂ of a node: the motion that ends without acceleration. Only with inertia.
    pub(crate) fn predicted(&self, alphas: &Alphas, node: usize) -> Vector<f64, D> {
        self.moved(node) + alphas.predicted(&self.velocity[node], &self.acceleration[node])
    }

    /// a_I = −R_I / m_I, with R the residual of this state without acceleration.
    ///
    /// ```
    /// use bfree::mechanics::{sweep::Connectivity, transfer::Nodal};
    /// use bfree::tensor::Vector;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let particles = &simulation.particles;
    /// let (connectivity, _) = Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// let mut nodal = Nodal::at_rest(particles, &connectivity);
    /// // An undeformed body under gravity: R_I = −m_I g, and all of it begins to fall.
    /// let g = Vector::from([0.0, -10.0]);
    /// let unbalanced: Vec<_> = nodal.mass.iter().map(|&m| g * -m).collect();
    /// nodal.accelerate(particles, &connectivity, &unbalanced);
    /// assert!(nodal.acceleration.iter().all(|a| (a - g).norm() < 1e-14));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn accelerate(
        &mut self,
        particles: &Particles<D>,
        connectivity: &Connectivity<D>,
        unbalanced: &[Vector<f64, D>],
    ) {
        self.acceleration.iter_mut().zip(unbalanced).for_each(|(a, r)| *a = -r);
        mutant!("transfer: loads at t = 0 push the wrong way": { self.acceleration.iter_mut().for_each(|a| *a = -*a); });
        divide(particles, &connectivity.space([]), &self.mass, &mut self.acceleration);
    }

    /// Applies E to velocity and acceleration, so that outer nodes follow the prescribed values of inner nodes.
    pub(crate) fn extended(mut self, space: &Space<D>) -> Self {
        if !self.is_static() {
            space.followers().extend(&mut self.velocity);
            space.followers().extend(&mut self.acceleration);
        }
        self
    }

    /// This state with ġ(t_n), g̈(t_n) in place of the projected values at prescribed degrees of freedom.
    pub(crate) fn with_prescribed(&self, prescribed: &[PrescribedDof]) -> Self {
        let mut overwritten = self.clone();
        for dof in prescribed.iter().filter(|_| !self.is_static()) {
            overwritten.velocity[dof.node][dof.component] = dof.step.velocity_start;
            overwritten.acceleration[dof.node][dof.component] = dof.step.acceleration_start;
        }
        overwritten
    }
}

/// Replaces p by E û with Eᵀ m û = Eᵀ p; û is zero at light nodes.
fn divide<const D: usize>(particles: &Particles<D>, space: &Space<D>, mass: &[f64], p: &mut [Vector<f64, D>]) {
    let is_light = is_light(particles);
    space.followers().restrict(p);
    parallel::zip(p, &restricted(space, mass), |p, &m| *p = if is_light(m) { Vector::zeros() } else { *p / m });
    space.followers().extend(p);
}

/// The particle-to-grid transfer of velocity and acceleration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Projection {
    /// M̃ v = Σ N m v_p, as in the paper (42). With a lumped mass, a freely spinning body loses some percent of its angular momentum per
    /// radian.
    #[default]
    Mass,
    /// Lumped mass, and an affine field around each particle, with the gradient fitted to the particle's surroundings. The loss of angular
    /// momentum is about a tenth of that of `mass`. Each step needs some more passes over the particles. `time.lumping` then acts on the
    /// inertia alone.
    Affine,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gravity_without_inertia_has_the_mass_alone_and_walls_hold_one_component()
    -> Result<(), Box<dyn std::error::Error>> {
        use crate::mechanics::loads::MotionStep;
        let scene = crate::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
        let simulation = scene.build::<2>("scenes".as_ref())?;
        let particles = &simulation.particles;
        let (connectivity, _) = Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
        let alone = Nodal::mass_alone(particles, &connectivity);
        assert!((alone.mass.iter().sum::<f64>() / particles.mass.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        assert!(alone.is_static() && !Nodal::at_rest(particles, &connectivity).is_static());
        let projected = Nodal::project(particles, &connectivity, 1.0)?;
        let wall = PrescribedDof { node: 3, component: 0, owner: 0, moving: false, step: MotionStep::default() };
        let nodal = projected.with_prescribed(&[wall]);
        assert_eq!((nodal.velocity[3][0], nodal.velocity[3][1]), (0.0, projected.velocity[3][1]));
        assert_eq!(nodal.velocity[4], projected.velocity[4]);
        Ok(())
    }
}
