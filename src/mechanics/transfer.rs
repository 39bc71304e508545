//! Particles → nodes (eqs. 40–42) and nodes → particles (eqs. 45, 50–52).

use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::residual::compose;
use crate::mechanics::smoothing::Smoothing;
use crate::mechanics::sweep::Supports;
use crate::mechanics::time::Alphas;
use crate::particles::Particles;
use crate::solver::{ConjugateGradientSettings, LinearError, LinearOperator, Preconditioner, conjugate_gradient};
use crate::tensor::{Tensor, Vector};

/// A node lighter than this fraction of the heaviest particle gets no projected velocity: its Δφ comes from the stiffness.
const LIGHT: f64 = 1e-14;

/// Tolerance of the projection (42) when ε < 1.
const PROJECTION_TOLERANCE: f64 = 1e-12;

/// Lumped mass, velocity and acceleration at the active nodes: each array as long as there are nodes, or empty where nothing
/// needs it.
///
/// ```
/// use bfree::mechanics::{check::direction, sweep::Supports, transfer::Nodal};
/// use bfree::tensor::Vector;
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let mut simulation = scene.build::<2>("scenes".as_ref())?;
/// let particles = &mut simulation.particles;
/// particles.velocity = direction(particles.len(), 1);
/// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
/// let momentum = |nodal: &Nodal<2>| nodal.mass.iter().zip(&nodal.velocity).map(|(&m, v)| v * m).sum::<Vector<f64, 2>>();
/// // Mass and momentum are those of the particles, with the lumped mass as with the consistent one.
/// let rest = Nodal::at_rest(particles, &supports, nodes.len());
/// assert!((rest.mass.iter().sum::<f64>() / particles.mass.iter().sum::<f64>() - 1.0).abs() < 1e-14);
/// let lumped = Nodal::project(particles, &supports, nodes.len(), 1.0)?;
/// let consistent = Nodal::project(particles, &supports, nodes.len(), 0.1)?;
/// assert!((momentum(&lumped) - particles.momentum()).norm() < 1e-13);
/// assert!((momentum(&consistent) - particles.momentum()).norm() < 1e-10);
/// assert!(lumped.iterations == 0 && consistent.iterations > 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nodal<const D: usize> {
    /// Σ_p m N_I; empty without inertia and gravity.
    pub mass: Vec<f64>,
    /// v_n; empty without inertia.
    pub velocity: Vec<Vector<f64, D>>,
    /// a_n; empty without inertia.
    pub acceleration: Vec<Vector<f64, D>>,
    /// Iterations the projection took (0 for a lumped mass).
    pub iterations: usize,
}

impl<const D: usize> Nodal<D> {
    /// Projects the particles' velocity and acceleration with M̃ = (1−ε) M + ε lumped(M) onto `count` active nodes:
    /// M̃ v = Σ_p N m v_p and M̃ a = Σ_p N m a_p (eq. 42).
    ///
    /// # Errors
    /// Particle velocities so large that the projection overflows.
    pub fn project(
        particles: &Particles<D>,
        supports: &Supports<D>,
        count: usize,
        lumping: f64,
    ) -> Result<Self, LinearError> {
        let Self { mass, .. } = Self::at_rest(particles, supports, count);
        let right = |field: &[Vector<f64, D>]| {
            let mut out = vec![Vector::zeros(); count];
            supports.spread(&mut out, |p| field[p] * particles.mass[p]);
            out
        };
        let (mut velocity, mut acceleration) = (right(&particles.velocity), right(&particles.acceleration));
        let light = light(particles);
        let mut iterations = 0;
        if lumping < 1.0 {
            let effective = EffectiveMass::new(particles, supports, &mass, lumping);
            iterations += effective.solve(&mut velocity)? + effective.solve(&mut acceleration)?;
        } else {
            for (field, m) in velocity.iter_mut().zip(&mut acceleration).zip(&mass) {
                *field.0 /= *m;
                *field.1 /= *m;
            }
        }
        for (node, &m) in mass.iter().enumerate() {
            if m < light {
                velocity[node] = Vector::zeros();
                acceleration[node] = Vector::zeros();
            }
        }
        Ok(Self { mass, velocity, acceleration, iterations })
    }

    /// The lumped mass, and no motion.
    pub fn at_rest(particles: &Particles<D>, supports: &Supports<D>, count: usize) -> Self {
        let still = vec![Vector::zeros(); count];
        Self { velocity: still.clone(), acceleration: still, ..Self::mass_alone(particles, supports, count) }
    }

    /// The lumped mass, which gravity acts on, and no inertia.
    ///
    /// ```
    /// use bfree::mechanics::{sweep::Supports, transfer::Nodal};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let particles = &simulation.particles;
    /// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// // The mass is there, and no motion that it could resist.
    /// let nodal = Nodal::mass_alone(particles, &supports, nodes.len());
    /// assert!((nodal.mass.iter().sum::<f64>() / particles.mass.iter().sum::<f64>() - 1.0).abs() < 1e-14);
    /// assert!(nodal.is_static() && !Nodal::at_rest(particles, &supports, nodes.len()).is_static());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn mass_alone(particles: &Particles<D>, supports: &Supports<D>, count: usize) -> Self {
        let mut mass = vec![Vector::<f64, D>::zeros(); count];
        supports.spread(&mut mass, |p| Vector::from_fn(|i, _| if i == 0 { particles.mass[p] } else { 0.0 }));
        Self { mass: mass.iter().map(|m| m[0]).collect(), ..Self::default() }
    }

    /// Whether there is no inertia.
    ///
    /// Example: [`Self::mass_alone`].
    pub fn is_static(&self) -> bool {
        self.velocity.is_empty()
    }

    /// a_I = −R_I / m_I, from the residual of the same state at rest.
    ///
    /// ```
    /// use bfree::mechanics::{sweep::Supports, transfer::Nodal};
    /// use bfree::tensor::Vector;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let particles = &simulation.particles;
    /// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// let mut nodal = Nodal::at_rest(particles, &supports, nodes.len());
    /// // An undeformed body under gravity: R_I = −m_I g, and all of it begins to fall.
    /// let g = Vector::from([0.0, -10.0]);
    /// let unbalanced: Vec<_> = nodal.mass.iter().map(|&m| g * -m).collect();
    /// nodal.accelerate(particles, &unbalanced);
    /// assert!(nodal.acceleration.iter().all(|a| (a - g).norm() < 1e-14));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn accelerate(&mut self, particles: &Particles<D>, unbalanced: &[Vector<f64, D>]) {
        let light = light(particles);
        for ((a, r), &m) in self.acceleration.iter_mut().zip(unbalanced).zip(&self.mass) {
            *a = if m >= light { -r / m } else { Vector::zeros() };
        }
    }

    /// The same with ġ(t_n), g̈(t_n) in place of the projected values at prescribed degrees of freedom.
    ///
    /// ```
    /// use bfree::mechanics::{loads::{MotionStep, PrescribedDof}, sweep::Supports, transfer::Nodal};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let particles = &simulation.particles;
    /// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// let projected = Nodal::project(particles, &supports, nodes.len(), 1.0)?;
    /// // A wall holds the x component of node 3.
    /// let wall = PrescribedDof { node: 3, component: 0, owner: 0, moving: false, step: MotionStep::default() };
    /// let nodal = projected.with_prescribed(&[wall]);
    /// assert_eq!((nodal.velocity[3][0], nodal.velocity[3][1]), (0.0, projected.velocity[3][1]));
    /// assert_eq!(nodal.velocity[4], projected.velocity[4]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn with_prescribed(&self, prescribed: &[PrescribedDof]) -> Self {
        let mut overwritten = self.clone();
        for dof in prescribed.iter().filter(|_| !self.is_static()) {
            overwritten.velocity[dof.node][dof.component] = dof.step.velocity_start;
            overwritten.acceleration[dof.node][dof.component] = dof.step.acceleration_start;
        }
        overwritten
    }
}

/// The mass below which a node counts as light.
fn light<const D: usize>(particles: &Particles<D>) -> f64 {
    LIGHT * particles.mass.iter().fold(0.0, |max: f64, &m| max.max(m))
}

/// M̃ u = Σ_p (1−ε) m N_I (Σ_J N_J u_J) + ε m_I u_I, with its diagonal as preconditioner.
struct EffectiveMass<'a, const D: usize> {
    particles: &'a Particles<D>,
    supports: &'a Supports<D>,
    mass: &'a [f64],
    lumping: f64,
    inverse_diagonal: Vec<f64>,
}

impl<'a, const D: usize> EffectiveMass<'a, D> {
    fn new(particles: &'a Particles<D>, supports: &'a Supports<D>, mass: &'a [f64], lumping: f64) -> Self {
        let mut diagonal: Vec<f64> = mass.iter().map(|m| lumping * m).collect();
        supports.scatter(&mut diagonal, |p, n, _| (1.0 - lumping) * particles.mass[p] * n * n);
        // Of the least numbers above 0 there is no inverse.
        let inverse = |d: f64| if d > 0.0 && d.recip().is_finite() { d.recip() } else { 0.0 };
        let inverse_diagonal = diagonal.into_iter().map(inverse).collect();
        Self { particles, supports, mass, lumping, inverse_diagonal }
    }

    /// Overwrites the right-hand side by the solution; from zero, so that a singular M gives the answer of least norm.
    fn solve(&self, field: &mut [Vector<f64, D>]) -> Result<usize, LinearError> {
        let right = field.to_vec();
        field.fill(Vector::zeros());
        let settings = ConjugateGradientSettings {
            relative_tolerance: PROJECTION_TOLERANCE,
            max_iterations: 10 * right.len() + 100,
        };
        let (right, solution) = (bytemuck::cast_slice(&right), bytemuck::cast_slice_mut(field));
        Ok(conjugate_gradient(self, self, right, solution, &settings)?.iterations)
    }
}

impl<const D: usize> LinearOperator for EffectiveMass<'_, D> {
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let (x, y): (&[Vector<f64, D>], &mut [Vector<f64, D>]) = (bytemuck::cast_slice(x), bytemuck::cast_slice_mut(y));
        for ((y, x), m) in y.iter_mut().zip(x).zip(self.mass) {
            *y = x * (self.lumping * m);
        }
        let at_particles = self.supports.values(x);
        self.supports.spread(y, |p| at_particles[p] * ((1.0 - self.lumping) * self.particles.mass[p]));
    }
}

impl<const D: usize> Preconditioner for EffectiveMass<'_, D> {
    fn precondition(&self, r: &[f64], z: &mut [f64]) {
        for (k, (z, r)) in z.iter_mut().zip(r).enumerate() {
            *z = r * self.inverse_diagonal[k / D];
        }
    }
}

/// What resting walls do to the velocity of the particles near them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WallUpdate {
    /// Δv = Δa = 0 at a resting wall: Algorithm 1 read literally, as the paper's authors ran it.
    #[default]
    Literal,
    /// Δv = −v_projected, Δa = −a_projected at a resting wall, as at a moving one.
    Consistent,
}

/// Where the particles are after the step: computed first, checked, and only then committed.
///
/// ```
/// use bfree::mechanics::{smoothing::Smoothing, sweep::Supports, transfer::{Moved, Nodal, WallUpdate}};
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let mut simulation = scene.build::<2>("scenes".as_ref())?;
/// let (mut particles, dt) = (simulation.particles.clone(), 0.05);
/// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
/// let nodal = Nodal::project(&particles, &supports, nodes.len(), 1.0)?;
/// // The cylinder flies with v = ½ and meets nothing: Δφ = v Δt at every node.
/// let dphi: Vec<_> = nodal.velocity.iter().map(|v| v * dt).collect();
/// let alphas = simulation.settings.newmark.alphas(dt);
/// let mut moved = Moved::new(&particles, &supports, &alphas, &nodal, &nodal, &[], WallUpdate::Literal, &dphi);
/// moved.smooth(&Smoothing::limited(40.0), &particles, &supports, &nodal.mass, dt);
/// assert!((moved.positions()[7] - particles.position[7] - particles.velocity[7] * dt).norm() < 1e-14);
/// assert!(moved.impulses().is_empty()); // no walls
/// moved.commit(&mut particles);
/// assert!((particles.kinetic_energy() / simulation.particles.kinetic_energy() - 1.0).abs() < 1e-12);
/// assert!(particles.displacement_gradient.iter().all(|h| h.norm() < 1e-13));
/// // That is what the whole step finds.
/// simulation.step()?;
/// let apart = simulation.particles.position.iter().zip(&particles.position).map(|(a, b)| (a - b).norm());
/// assert!(apart.fold(0.0, f64::max) < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Moved<const D: usize> {
    position: Vec<Vector<f64, D>>,
    delta_velocity: Vec<Vector<f64, D>>,
    delta_acceleration: Vec<Vector<f64, D>>,
    displacement_gradient: Vec<Tensor<f64, D>>,
    impulses: Vec<f64>,
}

impl<const D: usize> Moved<D> {
    /// The particle updates, with `projected` the nodal state before, `nodal` after the prescribed values were put in.
    ///
    /// a_p += Σ N Δa,  Δa = α₁(Δφ − Δt v_n) − (α₃+1)a_n      (50)
    /// v_p += Σ N Δv,  Δv = α₄(Δφ − Δt v_n) + α₆a_n           (51), both as in [`Alphas`]
    /// x_p += Σ N Δφ                                           (52)
    /// F_p  = (I + Σ Δφ ⊗ ∇_n N) F_p                            (45)
    #[allow(clippy::too_many_arguments)] // the ingredients of four formulas
    pub fn new(
        particles: &Particles<D>,
        supports: &Supports<D>,
        alphas: &Alphas,
        projected: &Nodal<D>,
        nodal: &Nodal<D>,
        prescribed: &[PrescribedDof],
        walls: WallUpdate,
        dphi: &[Vector<f64, D>],
    ) -> Self {
        let mut position = particles.position.clone();
        let mut displacement_gradient = particles.displacement_gradient.clone();
        let moved = |p: usize, delta_x, g| (delta_x, compose(&g, &particles.displacement_gradient[p]));
        supports.each_particle(dphi, moved, |p, (delta_x, h)| {
            position[p] += delta_x;
            displacement_gradient[p] = h;
        });
        let (delta_velocity, delta_acceleration) = (Vec::new(), Vec::new());
        let impulses = vec![0.0; prescribed.len()];
        let moved = Self { position, delta_velocity, delta_acceleration, displacement_gradient, impulses };
        if nodal.is_static() {
            return moved;
        }
        let state = dphi.iter().zip(&nodal.velocity).zip(&nodal.acceleration);
        let (mut delta_v, mut delta_a): (Vec<_>, Vec<_>) =
            state.map(|((dphi, v), a)| alphas.increments(dphi, v, a)).unzip();
        let mut impulses = Vec::with_capacity(prescribed.len());
        for dof in prescribed {
            let (node, i) = (dof.node, dof.component);
            let literal = !dof.moving && walls == WallUpdate::Literal;
            let by_forces = delta_v[node][i];
            (delta_v[node][i], delta_a[node][i]) = if literal {
                (0.0, 0.0)
            } else {
                (
                    dof.step.velocity_end - projected.velocity[node][i],
                    dof.step.acceleration_end - projected.acceleration[node][i],
                )
            };
            impulses.push(nodal.mass[node] * (delta_v[node][i] - by_forces));
        }
        let (delta_velocity, delta_acceleration) = (supports.values(&delta_v), supports.values(&delta_a));
        Self { delta_velocity, delta_acceleration, impulses, ..moved }
    }

    /// The local error of the displacement, as Zienkiewicz and Xie (1991) estimate it: what Newmark's step differs from Taylor's series
    /// with a third derivative ȧ = Δa/Δt, e = (β − 1/6) Δt² Δa. The root of its mean square over the mass; exact to leading order in
    /// Δt. Where a resting wall leaves the particles' acceleration alone, it counts as none. To be asked before smoothing.
    ///
    /// ```
    /// use bfree::mechanics::{sweep::Supports, transfer::{Moved, Nodal, WallUpdate}};
    /// use bfree::tensor::Vector;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, dt) = (&simulation.particles, 0.05);
    /// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
    /// let (nodal, alphas) = (Nodal::at_rest(particles, &supports, nodes.len()), simulation.settings.newmark.alphas(dt));
    /// // From rest to the acceleration a within the step: Δφ = β Δt² a, and a third derivative a/Δt.
    /// let (a, beta) = (Vector::from([3.0, 4.0]), simulation.settings.newmark.beta);
    /// let dphi = vec![a * (beta * dt * dt); nodes.len()];
    /// let moved = Moved::new(particles, &supports, &alphas, &nodal, &nodal, &[], WallUpdate::Literal, &dphi);
    /// let error = moved.local_error(beta, dt, &particles.mass);
    /// assert!((error / ((beta - 1.0 / 6.0) * dt * dt * a.norm()) - 1.0).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn local_error(&self, beta: f64, dt: f64, mass: &[f64]) -> f64 {
        let squares = self.delta_acceleration.iter().zip(mass).map(|(a, m)| m * a.norm_squared());
        let mean = squares.fold(0.0, |sum, one| sum + one) / mass.iter().sum::<f64>();
        (beta - 1.0 / 6.0).abs() * dt * dt * mean.sqrt()
    }

    /// Adds to both increments what `smoothing` makes of the fields they start from; `mass` is the lumped one of the nodes.
    pub fn smooth(
        &mut self,
        smoothing: &Smoothing,
        particles: &Particles<D>,
        supports: &Supports<D>,
        mass: &[f64],
        dt: f64,
    ) {
        if self.delta_velocity.is_empty() {
            return;
        }
        let at_kinks = smoothing.shares_at_kinks(particles, supports, mass, dt);
        let fields =
            [(&mut self.delta_velocity, &particles.velocity), (&mut self.delta_acceleration, &particles.acceleration)];
        for (delta, field) in fields {
            let changes = smoothing.change(particles, supports, mass, at_kinks.as_deref(), field, dt);
            for (delta, change) in delta.iter_mut().zip(changes) {
                *delta += change;
            }
        }
    }

    /// m_I (Δv − Δv_Newmark) at every prescribed degree of freedom: the momentum a wall gives beyond the reactions, where
    /// it finds nodes that do not move with it yet.
    pub fn impulses(&self) -> &[f64] {
        &self.impulses
    }

    /// The new positions.
    pub fn positions(&self) -> &[Vector<f64, D>] {
        &self.position
    }

    /// Writes to the particles: the only place that does, once per step.
    pub fn commit(self, particles: &mut Particles<D>) {
        for (v, delta) in particles.velocity.iter_mut().zip(&self.delta_velocity) {
            *v += delta;
        }
        for (a, delta) in particles.acceleration.iter_mut().zip(&self.delta_acceleration) {
            *a += delta;
        }
        particles.position = self.position;
        particles.displacement_gradient = self.displacement_gradient;
    }
}
