//! The residual R(Δφ) of one step, coded once, generic over the number type (eqs. 17, 33, with the signs corrected).

use crate::material::{Law, NonPositiveJacobian, admissible};
use crate::mechanics::loads::{PrescribedDof, PressurePoint};
use crate::mechanics::point::{self, carried};
use crate::mechanics::sweep::{Inertia, Laws, Supports};
use crate::mechanics::time::Alphas;
use crate::mechanics::transfer::Nodal;
use crate::particles::{Body, Particles};
use crate::pooled::Pooled;
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector, cofactor, identity};

pub use crate::mechanics::point::{Carry, Inadmissible, compose};

/// The equilibrium of one step: everything R(Δφ) needs besides Δφ. It cannot touch the particles.
///
/// R_I = Σ_J M̃_IJ a_J + Σ_p V₀ F S ∇N_I − Σ_p m b N_I − Σ_Γ T N_I A,  a = α₁ (Δφ − Δφ̂) = α₁ Δφ − α₂ v_n − α₃ a_n
///
/// ```
/// use bfree::mechanics::{residual::{Carry, Equilibrium}, sweep::Supports, transfer::Nodal};
/// use bfree::tensor::Vector;
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let simulation = scene.build::<2>("scenes".as_ref())?;
/// let (particles, bodies) = (&simulation.particles, &simulation.bodies);
/// let (supports, nodes) = Supports::new(&simulation.approximation, &simulation.grid, &particles.position)?;
/// let nodal = Nodal::at_rest(particles, &supports, nodes.len());
/// // Dropped: what Δφ = β Δt² g makes of a = α₁ Δφ is g, and all forces are in balance.
/// let (newmark, dt, g) = (simulation.settings.newmark, 0.05, Vector::from([0.0, -10.0]));
/// let weight: Vec<_> = nodal.mass.iter().map(|&m| g * m).collect();
/// let equilibrium =
///     Equilibrium::new(particles, bodies, &supports, newmark.alphas(dt), 1.0, &nodal, weight, vec![], &[]);
/// let dphi = vec![g * (newmark.beta * dt * dt); nodes.len()];
/// let residual = equilibrium.residual(&dphi, Carry::ALL)?;
/// let largest = residual.iter().map(|r| r.norm()).fold(0.0, f64::max);
/// assert!(largest < 1e-14 * equilibrium.magnitude(&dphi)?);
/// // The law of each particle is that of its body.
/// assert_eq!(equilibrium.law(0), &bodies[0].law);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Equilibrium<'a, const D: usize, L> {
    /// The particles at t_n.
    pub particles: &'a Particles<D>,
    /// Their laws.
    pub bodies: &'a [Body<L>],
    /// Shape functions at x_n.
    pub supports: &'a Supports<D>,
    /// Newmark's parameters of this step.
    pub alphas: Alphas,
    /// ε of M̃ = (1−ε) M + ε lumped(M).
    pub lumping: f64,
    /// Lumped mass, v_n and a_n at the nodes, prescribed values in place; without v_n and a_n there is no inertia.
    pub nodal: &'a Nodal<D>,
    /// Nodal dead loads at t_{n+1}.
    pub dead_load: Pooled<Vector<f64, D>>,
    /// Follower pressure at t_{n+1}.
    pub pressures: Vec<PressurePoint<D>>,
    /// Prescribed degrees of freedom.
    pub prescribed: &'a [PrescribedDof],
    /// Σ_J N_J Δφ̂_J at the particles; empty when ε = 1.
    predicted: Pooled<Vector<f64, D>>,
}

impl<'a, const D: usize, L: Law> Equilibrium<'a, D, L> {
    /// Gathers what the residual needs at the particles.
    #[allow(clippy::too_many_arguments)] // the ingredients of one equation
    pub fn new(
        particles: &'a Particles<D>,
        bodies: &'a [Body<L>],
        supports: &'a Supports<D>,
        alphas: Alphas,
        lumping: f64,
        nodal: &'a Nodal<D>,
        dead_load: impl Into<Pooled<Vector<f64, D>>>,
        pressures: Vec<PressurePoint<D>>,
        prescribed: &'a [PrescribedDof],
    ) -> Self {
        // Without inertia nothing is weighed, and nothing is consistent.
        let (alphas, lumping) = if nodal.is_static() { (Alphas::NONE, 1.0) } else { (alphas, lumping) };
        let predicted = if lumping < 1.0 {
            let state = nodal.velocity.iter().zip(&nodal.acceleration);
            let of_nodes = supports.pool().collect(state.map(|(v, a)| alphas.predicted(v, a)));
            let mut predicted = supports.pool().filled(particles.len(), Vector::zeros());
            supports.each_value(&of_nodes, |p, value| predicted[p] = value);
            predicted
        } else {
            Pooled::default()
        };
        Self {
            particles,
            bodies,
            supports,
            alphas,
            lumping,
            nodal,
            dead_load: dead_load.into(),
            pressures,
            prescribed,
            predicted,
        }
    }

    /// The law of particle `p`.
    #[inline(always)]
    pub fn law(&self, p: usize) -> &L {
        &self.bodies[self.particles.body[p] as usize].law
    }

    /// What to say of a particle at `p` in memory that cannot be deformed so.
    pub(crate) fn inadmissible(&self, p: usize) -> impl Fn(NonPositiveJacobian) -> Inadmissible {
        let particle = self.particles.id[p] as usize;
        move |source| Inadmissible { particle, source }
    }

    /// Weight of the consistent inertia at particle `p`, (1−ε) m; `None` when the mass is lumped.
    #[inline(always)]
    pub(crate) fn consistent_mass(&self, p: usize) -> Option<f64> {
        (self.lumping < 1.0).then(|| (1.0 - self.lumping) * self.particles.mass[p])
    }

    /// ε m_I and a_I = α₁ (Δφ − Δφ̂); `None` without inertia.
    #[inline(always)]
    fn motion<T: Real>(&self, node: usize, dphi: &Vector<T, D>) -> Option<(T, Vector<T, D>)> {
        let (v, a) = (self.nodal.velocity.get(node)?, self.nodal.acceleration.get(node)?);
        let predicted = self.alphas.predicted(v, a);
        let a = Vector::from_fn(|i, _| T::lit(self.alphas.a1) * (dphi[i] - T::lit(predicted[i])));
        Some((T::lit(self.lumping * self.nodal.mass[node]), a))
    }

    /// α₁ ε m_I of every node; none without inertia.
    pub(super) fn lumped_weights(&self) -> impl Iterator<Item = f64> {
        let weight = |m| self.alphas.a1 * self.lumping * m;
        self.nodal.mass.iter().take(self.nodal.velocity.len()).map(weight)
    }

    /// (1−ε) m a at particle `p`, from Δφ there.
    #[inline(always)]
    fn consistent_inertia<T: Real>(&self, p: usize, dphi: &Vector<T, D>) -> Vector<T, D> {
        self.consistent_mass(p).map_or_else(Vector::zeros, |m| {
            Vector::from_fn(|i, _| T::lit(self.alphas.a1 * m) * (dphi[i] - T::lit(self.predicted[p][i])))
        })
    }

    /// V₀ F S F_nᵀ of particle `p`: times ∇_n N_I it is the internal force on node I.
    #[inline(always)]
    pub(crate) fn internal<T: Real>(
        &self,
        p: usize,
        g: &Tensor<T, D>,
        carry: Carry,
    ) -> Result<Tensor<T, D>, Inadmissible> {
        let (h_n, volume) = (&self.particles.displacement_gradient[p], self.particles.volume[p]);
        let (stress, det_f) = point::internal(self.law(p), g, h_n, volume, carry);
        NonPositiveJacobian::check(det_f).map_err(self.inadmissible(p))?;
        Ok(stress)
    }

    /// The laws of the particles, for the sweep.
    pub(super) fn laws(&self) -> Laws<'_, D, L> {
        Laws { particles: self.particles, bodies: self.bodies }
    }

    /// Σ N p A cof(F) N: adds minus the force of the follower pressure, T = −p J F⁻ᵀ N (reference normal N).
    fn add_pressure<T: Real>(&self, dphi: &[Vector<T, D>], carry: Carry, out: &mut [Vector<T, D>]) {
        for point in &self.pressures {
            let g = self.supports.gradient_at(point.particle, dphi);
            let h = compose(&g, &self.particles.displacement_gradient[point.particle]);
            let f = identity::<T, D>() + h.map(|x| carried(x, carry.pressure));
            let force = cofactor(&f) * point.force.map(T::lit);
            for (node, n, _) in self.supports.of(point.particle) {
                out[node] += force * T::lit(n);
            }
        }
    }

    /// R(Δφ) on every active node, prescribed ones included (there it is the reaction).
    ///
    /// `carry` chooses which occurrences of Δφ keep their derivatives; with a plain number it changes nothing.
    ///
    /// # Errors
    /// The first particle with det F ≤ 0.
    pub fn residual<T: Real>(&self, dphi: &[Vector<T, D>], carry: Carry) -> Result<Vec<Vector<T, D>>, Inadmissible> {
        let mut out = vec![Vector::zeros(); dphi.len()];
        self.residual_into(dphi, carry, &mut out)?;
        Ok(out)
    }

    /// As [`Self::residual`], in `out`.
    pub(crate) fn residual_into<T: Real>(
        &self,
        dphi: &[Vector<T, D>],
        carry: Carry,
        out: &mut [Vector<T, D>],
    ) -> Result<(), Inadmissible> {
        for (node, (out, dphi)) in out.iter_mut().zip(dphi).enumerate() {
            let motion = self.motion(node, &dphi.map(|x| carried(x, carry.inertia)));
            *out = motion.map_or_else(Vector::zeros, |(m, a)| a * m) - self.dead_load[node].map(T::lit);
        }
        let inertia = |p: usize, u: &Vector<f64, D>| self.consistent_inertia(p, u);
        let inertia: Option<Inertia<'_, D>> = if self.lumping < 1.0 { Some(&inertia) } else { None };
        match self.supports.forces(&self.laws(), dphi, inertia, out) {
            Some(done) => done?,
            None => self.supports.assemble(dphi, out, |p, u, g| {
                Ok((self.consistent_inertia(p, &u.map(|x| carried(x, carry.inertia))), self.internal(p, &g, carry)?))
            })?,
        }
        self.add_pressure(dphi, carry, out);
        Ok(())
    }

    /// f_ext: gravity, tractions and follower pressure at Δφ.
    ///
    /// ```
    /// use bfree::mechanics::{sweep::Supports, transfer::Nodal};
    ///
    /// let falling = "gravity={\"acceleration\": [0, -10]}".parse()?;
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[falling])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid, dt) = (&simulation.particles, &simulation.grid, simulation.clock.step());
    /// let (supports, nodes) = Supports::new(&simulation.approximation, grid, &particles.position)?;
    /// let nodal = Nodal::project(particles, &supports, nodes.len(), 1.0)?;
    /// let equilibrium = simulation.equilibrium(&supports, &nodal, &[], simulation.settings.newmark.alphas(dt), dt);
    /// let force = equilibrium.external_force(&nodal.velocity);
    /// let weight = -10.0 * particles.mass.iter().sum::<f64>();
    /// assert!((force.iter().map(|f| f[1]).sum::<f64>() / weight - 1.0).abs() < 1e-13);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn external_force(&self, dphi: &[Vector<f64, D>]) -> Pooled<Vector<f64, D>> {
        let mut force = self.supports.field();
        self.add_pressure(dphi, Carry::ALL, &mut force);
        force.iter_mut().zip(&self.dead_load).for_each(|(force, dead)| *force = dead - *force);
        force
    }

    /// The norm, over the free degrees of freedom, of the sum of the magnitudes of all contributions to R: what
    /// round-off is relative to.
    ///
    /// # Errors
    /// The first particle with det F ≤ 0.
    pub fn magnitude(&self, dphi: &[Vector<f64, D>]) -> Result<f64, Inadmissible> {
        Ok(self.free_norm(self.magnitudes(dphi)?))
    }

    /// As [`Self::magnitude`], with what a rounding of H, and of the Δφ it is made from, changes in the stresses: nearly incompressible
    /// bodies, and stiff ones that move far, make much of the last bit of F.
    ///
    /// # Errors
    /// The first particle with det F ≤ 0.
    pub fn sensitivity(&self, dphi: &[Vector<f64, D>]) -> Result<f64, Inadmissible> {
        let mut out = self.magnitudes(dphi)?;
        self.supports.assemble_magnitudes(dphi, &mut out, |p, _, g| {
            let h_n = &self.particles.displacement_gradient[p];
            let at = admissible(compose(&g, h_n)).map_err(self.inadmissible(p))?;
            let f_n = (identity::<f64, D>() + h_n).norm();
            let moved: f64 = self.supports.of(p).map(|(node, _, grad_n)| dphi[node].norm() * grad_n.norm()).sum();
            // ‖δP‖ ≤ ‖F‖ ‖ℂ : Fᵀ δF‖, the response to a change of volume standing for all, and δF of size ‖H‖ + Σ |Δφ| |∇_n N| ‖F_n‖
            let response = self.law(p).elasticity(&at, &(at.f.transpose() * at.f)).norm();
            let change = response * (at.h.norm() + moved * f_n) * f_n * self.particles.volume[p];
            Ok((Vector::zeros(), Tensor::repeat(change)))
        })?;
        Ok(self.free_norm(out))
    }

    /// The norm over the free degrees of freedom.
    fn free_norm(&self, mut field: Pooled<Vector<f64, D>>) -> f64 {
        self.clear_prescribed(&mut field);
        field.iter().map(Vector::norm_squared).sum::<f64>().sqrt()
    }

    /// The magnitudes of all contributions to R, summed at each node.
    fn magnitudes(&self, dphi: &[Vector<f64, D>]) -> Result<Pooled<Vector<f64, D>>, Inadmissible> {
        let Alphas { a1, a2, a3, .. } = self.alphas;
        let mut out = self.supports.field();
        for (node, (out, dphi)) in out.iter_mut().zip(dphi).enumerate() {
            let motion = self.nodal.velocity.get(node).zip(self.nodal.acceleration.get(node));
            // The whole mass, also for ε < 1: the consistent part is of the same size.
            let inertia = motion.map_or_else(Vector::zeros, |(v, a)| {
                (dphi.abs() * a1 + v.abs() * a2 + a.abs() * a3.abs()) * self.nodal.mass[node]
            });
            *out = inertia + self.dead_load[node].abs();
        }
        match self.supports.force_magnitudes(&self.laws(), dphi, &mut out) {
            Some(done) => done?,
            None => self.supports.assemble_magnitudes(dphi, &mut out, |p, _, g| {
                Ok((Vector::zeros(), self.internal(p, &g, Carry::ALL)?.abs()))
            })?,
        }
        for point in &self.pressures {
            for (node, n, _) in self.supports.of(point.particle) {
                out[node] += point.force.abs() * n.abs();
            }
        }
        Ok(out)
    }

    /// Π(Δφ) and the sum of the magnitudes of its contributions:
    /// Π = ½/α₁ a·M̃a + Σ_p V₀ W(F) − f_ext·Δφ, whose gradient is the residual. `None` under follower pressure.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, residual::Carry, sweep::Supports, transfer::Nodal};
    /// use num_dual::Dual64;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid, dt) = (&simulation.particles, &simulation.grid, simulation.clock.step());
    /// let (supports, nodes) = Supports::new(&simulation.approximation, grid, &particles.position)?;
    /// let nodal = Nodal::project(particles, &supports, nodes.len(), 1.0)?;
    /// let equilibrium = simulation.equilibrium(&supports, &nodal, &[], simulation.settings.newmark.alphas(dt), dt);
    /// // R = ∂Π/∂Δφ: along any u, the derivative of Π by dual numbers is R·u.
    /// let u = direction::<2>(nodes.len(), 2);
    /// let dphi: Vec<_> = direction::<2>(nodes.len(), 1).iter().map(|x| x * 0.01).collect();
    /// let seeded: Vec<_> = dphi.iter().zip(&u).map(|(x, u)| x.zip_map(u, Dual64::new)).collect();
    /// let slope = equilibrium.potential(&seeded).ok_or("a follower pressure has no potential")??.0.eps;
    /// let residual = equilibrium.residual(&dphi, Carry::ALL)?;
    /// let work: f64 = residual.iter().zip(&u).map(|(r, u)| r.dot(u)).sum();
    /// assert!((slope - work).abs() < 1e-11 * equilibrium.magnitude(&dphi)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The first particle with det F ≤ 0: there Π = +∞.
    pub fn potential<T: Real>(&self, dphi: &[Vector<T, D>]) -> Option<Result<(T, f64), Inadmissible>> {
        self.pressures.is_empty().then(|| {
            let half_over_a1 = T::lit(0.5 / self.alphas.a1);
            let per_particle = self.supports.interpolate(dphi, |p, u, g| {
                let at =
                    admissible(compose(&g, &self.particles.displacement_gradient[p])).map_err(self.inadmissible(p))?;
                let strain = T::lit(self.particles.volume[p]) * self.law(p).energy(&at);
                let inertia = self.consistent_mass(p).map_or_else(T::zero, |m| {
                    let momentum = self.consistent_inertia(p, &u);
                    half_over_a1 * momentum.dot(&momentum) / T::lit(m)
                });
                Ok(strain + inertia)
            })?;
            let (mut sum, mut magnitude) = (T::zero(), 0.0);
            for contribution in per_particle {
                sum += contribution;
                magnitude += contribution.value().abs();
            }
            for (node, dphi) in dphi.iter().enumerate() {
                let inertia = self.motion(node, dphi).map_or_else(T::zero, |(m, a)| half_over_a1 * m * a.dot(&a));
                let work = self.dead_load[node].map(T::lit).dot(dphi);
                sum += inertia - work;
                magnitude += inertia.value().abs() + work.value().abs();
            }
            Ok((sum, magnitude))
        })
    }

    /// Zero at every prescribed degree of freedom.
    ///
    /// ```
    /// use bfree::mechanics::{loads::{MotionStep, PrescribedDof}, residual::Carry, sweep::Supports, transfer::Nodal};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid, dt) = (&simulation.particles, &simulation.grid, simulation.clock.step());
    /// let (supports, nodes) = Supports::new(&simulation.approximation, grid, &particles.position)?;
    /// let nodal = Nodal::project(particles, &supports, nodes.len(), 1.0)?;
    /// let wall = [PrescribedDof { node: 30, component: 0, owner: 0, moving: false, step: MotionStep::default() }];
    /// let equilibrium = simulation.equilibrium(&supports, &nodal, &wall, simulation.settings.newmark.alphas(dt), dt);
    /// // Held where the body would fly on, the node meets a reaction; no unknown belongs to it.
    /// let mut residual = equilibrium.residual::<f64>(&vec![Default::default(); nodes.len()], Carry::ALL)?;
    /// assert!(residual[30][0] < 0.0);
    /// equilibrium.clear_prescribed(&mut residual);
    /// assert!(residual[30][0] == 0.0 && residual[31][0] < 0.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn clear_prescribed<T: Real>(&self, field: &mut [Vector<T, D>]) {
        for dof in self.prescribed {
            field[dof.node][dof.component] = T::zero();
        }
    }
}
