//! The step on one page: the paper's Algorithm 1.

use super::report::Spent;
use super::{AdvanceError, FailedAttempt, InitialGuess, Reaction, Simulation, StepError, StepReport, Workspace};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::check::direction;
use crate::mechanics::kept::{Kept, Renewal, touch};
use crate::mechanics::loads::{PrescribedDof, prescribed_dofs};
use crate::mechanics::path::OnPath;
use crate::mechanics::residual::{Equilibrium, Inadmissible};
use crate::mechanics::rigid::loose;
use crate::mechanics::schemes::Alphas;
use crate::mechanics::sweep::{SupportError, Supports};
use crate::mechanics::terms::{self, Role};
use crate::mechanics::transfer::{Committed, Nodal, Projection, Update};
use crate::nodes::Nodes;
use crate::particles::Particles;
use crate::phases::Phase;
use crate::pooled::Pooled;
use crate::solver::{LinearError, NewtonError, NewtonReport, newton};
use crate::tensor::Vector;

/// A step grows only if its error is at most this part of the tolerance: one of twice the length has eight times the error.
const ROOM: f64 = 0.1;

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// One step of Algorithm 1, from t_n to t_{n+1} = t_n + Δt.
    ///
    /// ```
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// simulation.particles.velocity.iter_mut().for_each(|v| *v *= 1e4);
    /// let before = simulation.particles.clone();
    /// // A step that would carry particles out of the box fails, and leaves the state as it was.
    /// let error = simulation.step().err().ok_or("out of the box")?;
    /// assert!(error.to_string().contains("leaves the grid"), "{error}");
    /// assert_eq!((simulation.particles, simulation.clock.steps()), (before, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// No equilibrium found, or a particle would leave the grid; the simulation is then as before the call.
    pub fn step(&mut self) -> Result<StepReport<D>, StepError> {
        self.attempt(&mut Spent::nothing())
    }

    /// As [`Self::step`]; a step that fails leaves what it has spent.
    fn attempt(&mut self, spent: &mut Spent) -> Result<StepReport<D>, StepError> {
        // Over a grid that is kept, a step starts where that was new.
        let mut kept = self.kept.take();
        kept.iter_mut().for_each(|kept| kept.exchange(&mut self.particles));
        let report = self.attempt_from(&mut kept, spent);
        if report.is_err() {
            kept.iter_mut().for_each(|kept| kept.exchange(&mut self.particles));
            self.kept = kept;
        }
        report
    }

    fn attempt_from(&mut self, kept: &mut Option<Kept<D>>, spent: &mut Spent) -> Result<StepReport<D>, StepError> {
        self.particles.remember(&self.bodies);
        let (t, dt) = (self.clock.time(), self.clock.step());
        let scheme = self.settings.scheme.clone();
        let watch = &mut spent.watch;

        let pool = self.workspace.pool.clone();
        let supports = self.supports(kept.is_some())?;
        let nodes = supports.active().clone();
        let prescribed = self.prescribed_from(&nodes, kept.as_ref());
        watch.lap(Phase::ShapeFunctions, supports.passes());

        let projected = match kept {
            Some(kept) if kept.motion.len() != nodes.len() => {
                return Err(StepError::OtherGrid { kept: kept.motion.len(), nodes: nodes.len() });
            }
            Some(kept) => kept.state(self.masses(&supports), &pool),
            None => self.project(&supports)?,
        };
        spent.projection_iterations = projected.iterations;
        let nodal = projected.with_prescribed(&prescribed);
        watch.lap(Phase::Projection, supports.passes());

        // To t_n + θ Δt, where forces are in balance; for θ = 1 that is the end.
        let theta = scheme.instant();
        let (from, mut to) =
            if scheme.follows_path() { (self.path.load, self.path.load_step(dt)) } else { (t, t + theta * dt) };
        let under = |load: f64| self.equilibrium(&supports, &nodal, &prescribed, scheme.balance(dt), load);
        let mut equilibrium = under(to);
        let mut phi = self.initial_guess(&supports, &nodal, kept.as_ref(), theta * dt);
        for dof in &prescribed {
            phi[dof.node][dof.component] = theta * dof.step.increment;
        }
        phi.iter_mut().zip(&nodal.motion).for_each(|(phi, before)| *phi += before);
        let (mut preconditioner, x) = (self.preconditioner().0.anew::<D>(), bytemuck::cast_slice_mut(&mut phi));
        let settings = &self.settings.newton;
        let newton = match kept.as_ref().filter(|_| scheme.follows_path()) {
            None => newton(&equilibrium, &mut *preconditioner, x, settings, &pool)
                .map_err(|error| self.explained(error, &equilibrium, &nodes))?,
            Some(kept) => {
                let start = under(from);
                let force = |load| under(load).free_external_force(&nodal.motion);
                let path = OnPath::new(self.path, &start, &force, &kept.rate, dt)?;
                let report = newton(&path, &mut *preconditioner, x, settings, &pool)?;
                to = path.load(&phi);
                if path.ends(to)? {
                    return Err(StepError::PathEnds { load: to });
                }
                equilibrium = under(to);
                report
            }
        };
        watch.lap(Phase::Newton, supports.passes());
        self.check_tangent(&equilibrium, &phi)?;
        let mut dphi = phi;
        dphi.iter_mut().zip(nodal.moved(nodes.len())).for_each(|(dphi, before)| *dphi = (*dphi - before) / theta);

        let (end, walls) = (scheme.end(dt), self.settings.wall_update);
        let mut update = Update::new(&end, &projected, &nodal, &prescribed, walls, &dphi);
        let error = self.local_error(&update, &supports, dt, &newton)?;
        if let Some(smoothing) = &self.settings.smoothing {
            update.smooth(smoothing, &self.particles, &supports, &nodal.mass, dt);
        }
        if let Some((particle, position)) = update.leaving(&self.particles, &supports, &self.grid) {
            return Err(StepError::LeftGrid { particle, position: position.iter().copied().collect() });
        }
        let (reactions, work, dissipated) = self.reactions_and_work(&equilibrium, from, dt, &dphi, &update)?;
        let renewed = kept.is_none();
        let mut next = kept.take().unwrap_or_default();
        if self.settings.renewal != Renewal::EveryStep {
            next.renew(&self.particles, &update.end(&projected), &dphi, dt);
        }
        let Committed { strain, yielding } = update.commit(&mut self.particles, &self.bodies, &supports, dt);
        if scheme.follows_path() {
            self.path = self.path.after(to, &dphi, dt);
        }
        let passes = supports.passes();
        self.keep(next, supports, strain, &prescribed);
        watch.lap(Phase::Update, passes);
        self.external_work += work;
        self.dissipated += dissipated;
        let small = |error| self.settings.error_tolerance.is_none_or(|most| error <= ROOM * most);
        // What took Newton's method long would take it longer in a longer step.
        let easy = 2 * newton.history.iterations.len() <= self.settings.newton.max_iterations;
        self.clock.advance_and_grow_if(easy && error.is_none_or(small));
        let active_nodes = nodes.len();
        Ok(StepReport {
            dt,
            active_nodes,
            newton,
            projection_iterations: projected.iterations,
            reactions,
            error,
            renewed,
            yielding,
            seconds: *watch,
            failed: Vec::new(),
        })
    }

    /// As [`Self::step`], halving Δt while Newton fails or the error is too large, down to the clock's limit; Δt grows back afterwards.
    ///
    /// ```
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let step = simulation.advance()?;
    /// assert_eq!((step.dt, simulation.clock.time()), (0.05, 0.05));
    /// // One particle of 112 torn away at 200 times its speed, and Newton's method is not given the time to follow.
    /// simulation.particles.velocity[50] *= 200.0;
    /// simulation.settings.newton.max_iterations = 2;
    /// let step = simulation.advance()?;
    /// assert!(!step.failed.is_empty());
    /// assert_eq!(step.dt, 0.05 / f64::from(1 << step.failed.len()));
    /// assert_eq!(simulation.clock.time(), 0.05 + step.dt);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The last failure, once Δt cannot be halved further, or a failure that a shorter step does not mend.
    pub fn advance(&mut self) -> Result<StepReport<D>, AdvanceError> {
        let mut failed = Vec::new();
        loop {
            let (time, dt) = (self.clock.time(), self.clock.step());
            let mut spent = Spent::nothing();
            let cause = match self.attempt(&mut spent) {
                Ok(report) => return Ok(StepReport { failed, ..report }),
                Err(cause) => cause,
            };
            failed.push(FailedAttempt::new(dt, spent, &cause));
            let mended = match cause {
                StepError::Newton(_) | StepError::Inaccurate { .. } => true,
                // A step too long to see a wall.
                StepError::LeftGrid { .. } => self.settings.error_tolerance.is_some(),
                // In balance before its end, and inside out there.
                StepError::Inadmissible(_) => self.settings.scheme.instant() < 1.0,
                _ => false,
            };
            if !(mended && self.clock.halve()) {
                return Err(AdvanceError { time, dt, cause: Box::new(cause), failed });
            }
        }
    }

    /// The shape functions of a step, those of the last one if the grid is kept.
    fn supports(&mut self, kept: bool) -> Result<Supports<D>, SupportError> {
        let (Workspace { supports, serves, pool }, Particles { position, id, .. }) =
            (&mut self.workspace, &self.particles);
        let spare = supports.take();
        match spare {
            Some(supports) if kept && *serves => Ok(supports.again()),
            spare => {
                let precision = self.settings.newton.precision;
                Ok(Supports::renewed(spare, &self.approximation, &self.grid, position, Some(id), precision, pool)?.0)
            }
        }
    }

    /// Keeps the grid, unless a strain, a wall or another body makes it anew; and its functions, or their memory, with the particles in
    /// their order.
    fn keep(&mut self, kept: Kept<D>, supports: Supports<D>, strain: f64, prescribed: &[PrescribedDof]) {
        if self.clock.steps() == 0 {
            self.held = prescribed.iter().map(|dof| dof.owner).collect();
        }
        let renewal = self.settings.renewal;
        let contact = renewal != Renewal::EveryStep && self.in_contact(&kept, &supports, prescribed);
        let keeps = renewal.keeps(strain) && !contact;
        self.kept = keeps.then_some(kept);
        let leaping = supports.leaping();
        leaping.iter().for_each(|order| self.rearrange(order));
        self.workspace.supports = Some(if leaping.is_some() { supports.rearranged() } else { supports });
        // Those of particles that lie elsewhere now are good for their memory alone.
        self.workspace.serves = keeps && leaping.is_none();
    }

    /// Whether a body has come to a wall; with inertia also whether it feels one still, or another body: on a grid that is kept it would
    /// never leave.
    fn in_contact(&mut self, kept: &Kept<D>, supports: &Supports<D>, prescribed: &[PrescribedDof]) -> bool {
        let Self { particles, grid, loads, held, .. } = self;
        let comes = kept.met(&particles.position, &loads.prescribed, grid, supports.active());
        held.retain(|one| !comes.contains(one));
        let inertia = self.settings.scheme.has_inertia();
        !comes.is_empty()
            || (inertia && prescribed.iter().any(|dof| !held.contains(&dof.owner)))
            || (inertia && self.bodies.len() > 1 && touch(particles, grid, supports))
    }

    /// The degrees of freedom prescribed in the coming step.
    ///
    /// ```
    /// use bfree::mechanics::sweep::Supports;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// let held = |of: &bfree::simulation::Simulation<2>| -> Result<_, Box<dyn std::error::Error>> {
    ///     let (_, nodes) = Supports::new(&of.approximation, &of.grid, &of.particles.position)?;
    ///     Ok(of.prescribed(&nodes))
    /// };
    /// // Only active nodes count: near the right wall, the disc sees nodes of it, and they may slide but not leave.
    /// let before = held(&simulation)?.len();
    /// simulation.particles.position.iter_mut().for_each(|x| x[0] += 11.0);
    /// let at_wall = held(&simulation)?;
    /// assert!(at_wall.len() > before);
    /// assert!(at_wall.iter().any(|dof| dof.component == 0 && dof.step.increment == 0.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn prescribed(&self, nodes: &Nodes) -> Vec<PrescribedDof> {
        self.prescribed_from(nodes, self.kept.as_ref())
    }

    fn prescribed_from(&self, nodes: &Nodes, kept: Option<&Kept<D>>) -> Vec<PrescribedDof> {
        let moved = kept.map_or(&[][..], |kept| &kept.motion);
        prescribed_dofs(&self.loads.prescribed, &self.grid, nodes, moved, self.clock.time(), self.clock.step())
    }

    /// The equilibrium at time `t` on given supports.
    ///
    /// ```
    /// use bfree::mechanics::{sweep::Supports, transfer::Nodal};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid, dt) = (&simulation.particles, &simulation.grid, simulation.clock.step());
    /// let (supports, _) = Supports::new(&simulation.approximation, grid, &particles.position)?;
    /// let nodal = Nodal::project(particles, &supports, simulation.settings.lumping)?;
    /// let alphas = simulation.settings.scheme.end(dt);
    /// let equilibrium = simulation.equilibrium(&supports, &nodal, &[], alphas, dt);
    /// // A body in free flight is in equilibrium at Δφ = Δt v.
    /// let dphi: Vec<_> = nodal.velocity.iter().map(|v| v * dt).collect();
    /// let residual = equilibrium.residual(&dphi)?;
    /// assert!(residual.iter().map(|r| r.norm_squared()).sum::<f64>().sqrt() < 1e-13 * equilibrium.magnitude(&dphi)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn equilibrium<'a>(
        &'a self,
        supports: &'a Supports<D>,
        nodal: &'a Nodal<D>,
        prescribed: &'a [PrescribedDof],
        alphas: Alphas,
        t: f64,
    ) -> Equilibrium<'a, D, L> {
        let Self { particles, bodies, loads, settings, .. } = self;
        // Without inertia nothing is consistent.
        let lumping = if nodal.is_static() { 1.0 } else { settings.lumping };
        // At t_n, too, laws are asked about a step.
        let dt = if alphas.dt > 0.0 { alphas.dt } else { self.clock.step() };
        Equilibrium::new(
            terms::Step {
                particles,
                bodies,
                loads,
                supports,
                nodal,
                alphas,
                lumping,
                time: t,
                dt,
                ghost: settings.ghost,
            },
            prescribed,
        )
    }

    /// What the nodes inherit from the particles; without inertia their mass at most, and that for gravity alone.
    ///
    /// ```
    /// use bfree::mechanics::sweep::Supports;
    /// use bfree::tensor::Vector;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (supports, _) = Supports::new(&simulation.approximation, &simulation.grid, &simulation.particles.position)?;
    /// let nodal = simulation.project(&supports)?;
    /// let momentum: Vector<f64, 2> = nodal.mass.iter().zip(&nodal.velocity).map(|(&m, v)| v * m).sum();
    /// assert!((momentum - simulation.particles.momentum()).norm() < 1e-13);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Particle velocities so large that the projection overflows.
    pub fn project(&self, supports: &Supports<D>) -> Result<Nodal<D>, LinearError> {
        if self.settings.scheme.has_inertia() {
            return match self.settings.projection {
                Projection::Mass => Nodal::project(&self.particles, supports, self.settings.lumping),
                Projection::Affine => Ok(Nodal::fit(&self.particles, supports)),
            };
        }
        Ok(self.masses(supports))
    }

    /// The mass of the nodes, where something asks for it.
    pub(super) fn masses(&self, supports: &Supports<D>) -> Nodal<D> {
        let weighs = self.settings.scheme.has_inertia() || self.loads.gravity.is_some();
        if weighs { Nodal::mass_alone(&self.particles, supports) } else { Nodal::default() }
    }

    /// The Δφ that Newton's method starts from.
    fn initial_guess(
        &self,
        supports: &Supports<D>,
        nodal: &Nodal<D>,
        kept: Option<&Kept<D>>,
        dt: f64,
    ) -> Pooled<Vector<f64, D>> {
        let mut dphi: Pooled<Vector<f64, D>> = supports.field();
        let rate: &[Vector<f64, D>] = match self.settings.initial_guess {
            InitialGuess::Zero => &[],
            InitialGuess::Velocity => &nodal.velocity,
            InitialGuess::LastStep => kept.map_or(&[], |kept| &kept.rate),
        };
        dphi.iter_mut().zip(rate).for_each(|(dphi, rate)| *dphi = rate * dt);
        dphi
    }

    /// Without inertia, a body that nothing holds has no equilibrium; Newton's method can only say that it found none.
    fn explained(
        &self,
        error: NewtonError<Inadmissible>,
        equilibrium: &Equilibrium<'_, D, L>,
        nodes: &Nodes,
    ) -> StepError {
        let loose = equilibrium.step.nodal.is_static().then(|| loose(&self.grid, equilibrium, nodes));
        match loose.flatten() {
            Some(loose) => StepError::Loose { loose, source: error },
            None => StepError::Newton(error),
        }
    }

    /// The error of a step that ends in `update`, where somebody asks for it.
    fn local_error(
        &self,
        update: &Update<'_, D>,
        supports: &Supports<D>,
        dt: f64,
        newton: &NewtonReport,
    ) -> Result<Option<f64>, StepError> {
        let Some(tolerance) = self.settings.error_tolerance else { return Ok(None) };
        let error = update.local_error(&self.particles, supports, self.settings.scheme.error_constant(), dt);
        let error = error / self.grid.spacing;
        // Not a number is no small error.
        if (error.is_nan() || error > tolerance) && self.clock.can_halve() {
            return Err(StepError::Inaccurate { error, tolerance, newton: Box::new(newton.history.clone()) });
        }
        Ok(Some(error))
    }

    /// Reactions at t_{n+1} and impulses J over Δt, summed over each prescribed condition, and the work of the step,
    /// Σ [½ (f_n + f_{n+1}) + J/Δt]·Δφ over all external forces, the reactions of moving walls among them.
    fn reactions_and_work(
        &self,
        balanced: &Equilibrium<'_, D, L>,
        t: f64,
        dt: f64,
        dphi: &[Vector<f64, D>],
        update: &Update<'_, D>,
    ) -> Result<(Vec<Reaction<D>>, f64, f64), StepError> {
        let (terms::Step { supports, nodal, .. }, phi) = (balanced.step, update.motion());
        let mut end = balanced;
        let after;
        if self.settings.scheme.instant() < 1.0 {
            after = self.equilibrium(supports, nodal, balanced.prescribed, self.settings.scheme.end(dt), t + dt);
            // Nothing has asked yet whether this end is possible.
            after.forces(Role::Stores, phi)?;
            end = &after;
        }
        let conditions = &self.loads.prescribed;
        let mut reactions = vec![Reaction { force: Vector::zeros(), torque: 0.0 }; conditions.len()];
        let mut work = 0.0;
        if !end.prescribed.is_empty() {
            let mut residual: Pooled<Vector<f64, D>> = supports.field();
            end.residual_into::<f64>(phi, &mut residual)?;
            for (dof, impulse) in end.prescribed.iter().zip(update.impulses()) {
                let (reaction, blow) = (residual[dof.node][dof.component], impulse / dt);
                reactions[dof.owner].force[dof.component] += reaction + blow;
                if let Some(rotation) = conditions[dof.owner].rotation() {
                    let x = self.grid.position(self.grid.index(supports.active().ids()[dof.node])) + phi[dof.node];
                    reactions[dof.owner].torque += rotation.moment(&x, dof.component, reaction + blow);
                }
                work += (0.5 * reaction + blow) * dof.step.increment;
            }
        }
        // At t_n: a = a_n and Δφ = 0.
        let before = supports.pool().collect(nodal.moved(supports.nodes()));
        let start = self.equilibrium(supports, nodal, end.prescribed, Alphas::START, t);
        if end.prescribed.iter().any(|dof| dof.moving) {
            let mut residual: Pooled<Vector<f64, D>> = supports.field();
            start.residual_into::<f64>(&before, &mut residual)?;
            for dof in end.prescribed {
                work += 0.5 * residual[dof.node][dof.component] * dof.step.increment;
            }
        }
        work += mean_work(&end.external_force(phi)?, &start.external_force(&before)?, dphi);
        let mut dissipated = 0.0;
        if self.damps() {
            let lost = |equilibrium: &Equilibrium<'_, D, L>, phi| equilibrium.forces(Role::Dissipates, phi);
            dissipated = mean_work(&lost(end, phi)?, &lost(&start, &before)?, dphi);
        }
        Ok((reactions, work, dissipated))
    }

    /// The check a run may ask for: the tangent at the solution against dual numbers, in a direction of its own for each step.
    fn check_tangent(&self, equilibrium: &Equilibrium<'_, D, L>, dphi: &[Vector<f64, D>]) -> Result<(), StepError> {
        match self.settings.check_tangent {
            Some(every) if self.clock.steps().is_multiple_of(every.get()) => {
                Ok(equilibrium.check_tangent(dphi, &direction(dphi.len(), self.clock.steps()))?)
            }
            _ => Ok(()),
        }
    }
}

/// The work of a force along Δφ, by the mean of its values at the ends of the step.
fn mean_work<const D: usize>(end: &[Vector<f64, D>], start: &[Vector<f64, D>], dphi: &[Vector<f64, D>]) -> f64 {
    end.iter().zip(start).zip(dphi).map(|((end, start), dphi)| 0.5 * (end + start).dot(dphi)).sum()
}
