//! The step on one page: the paper's Algorithm 1.

use super::balance::Balance;
use super::report::Spent;
use super::{AdvanceError, FailedAttempt, Simulation, StepError, StepReport, compiled};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::sweep::Connectivity;
use crate::mechanics::transfer::{Nodal, Update};
use crate::mechanics::trial::Trial;
use crate::parallel;
use crate::phases::Phase;
use crate::solver::NewtonReport;

/// A step grows only if its error is at most this part of the tolerance. A step of twice the length has eight times the error.
const ROOM: f64 = 0.1;

impl<const D: usize, L: Law + 'static, A: ShapeFunction + 'static> Simulation<D, L, A> {
    /// One step of Algorithm 1, from t_n to t_{n+1} = t_n + Δt.
    ///
    /// ```
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let mut simulation = scene.build::<2>("scenes".as_ref())?;
    /// simulation.particles.velocity.iter_mut().for_each(|v| *v *= 1e4);
    /// let before = simulation.particles.by_id();
    /// // A step that would carry particles out of the box fails, and leaves the state as it was.
    /// let error = simulation.step().err().ok_or("out of the box")?;
    /// assert!(error.to_string().contains("leaves the grid"), "{error}");
    /// assert_eq!((simulation.particles.by_id(), simulation.clock.steps()), (before, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// No equilibrium was found, or a particle would leave the grid. The simulation is then as before the call, except for the order of the
    /// particles in memory.
    pub fn step(&mut self) -> Result<StepReport<D>, StepError> {
        compiled::attempt(self, &mut Spent::nothing())
    }

    /// A step like [`Self::step`], compiled where it is called. `spent` counts the work, also if the step fails.
    pub(super) fn attempt_in_this_crate(&mut self, spent: &mut Spent) -> Result<StepReport<D>, StepError> {
        self.particles.make_room_for_internal(&self.bodies);
        let (dt, scheme, watch) = (self.clock.step(), self.settings.scheme.clone(), &mut spent.watch);

        let connectivity = self.connectivity()?;
        self.find_candidates(&connectivity);
        let nodes = connectivity.active().clone();
        let prescribed = self.prescribed(&nodes);
        watch.lap(Phase::ShapeFunctions, connectivity.passes());

        let projected = self.nodal(&connectivity, &prescribed)?;
        spent.projection_iterations = projected.iterations;
        let space = connectivity.space(prescribed.iter().map(PrescribedDof::place));
        let nodal = projected.with_prescribed(&prescribed).extended(&space);
        watch.lap(Phase::Projection, connectivity.passes());

        let Balance { equilibrium, phi, dilatation: [before, after], newton, load, cosine } =
            self.balance(&connectivity, &nodal, &prescribed)?;
        watch.lap(Phase::Newton, connectivity.passes());
        self.check_tangent(&equilibrium, Trial { phi: &phi, dilatation: &after })?;
        // Forces are in balance at t_n + θ Δt. The motion is extrapolated to t_{n+1}.
        let (mut dphi, theta) = (phi, scheme.instant());
        parallel::each(&mut dphi, |node, dphi| *dphi = (*dphi - nodal.moved(node)) / theta);
        // Dilatations that are extrapolated, too, would drift from the motion.
        let after = if theta < 1.0 { Vec::new() } else { after };
        mutant!("step: Δφ is the motion to the balance, not to the end": { dphi.iter_mut().for_each(|dphi| *dphi *= theta); });

        let update = Update::new(&scheme.end(dt), &projected, &nodal, &prescribed, self.settings.wall_update, &dphi);
        let mut update = update.with_dilatation(after).extended(&nodal, &space);
        let error = self.local_error(&update, &connectivity, dt, &newton)?;
        self.smooth_and_check(&mut update, &connectivity, &nodal)?;
        let accounts = self.accounts(&equilibrium, &dphi, &before, &update)?;

        // Nothing fails from here on.
        let (reset, feels_wall) = (self.history.resets_grid(), self.feels_wall(&prescribed));
        let yielding = self.accept(update, &projected, &prescribed, &accounts, &connectivity);
        let shared_nodes = self.shared_nodes(&connectivity);
        if scheme.follows_path() {
            self.path = self.path.after(load, &dphi, dt);
        }
        let passes = connectivity.passes();
        self.store_connectivity(connectivity);
        watch.lap(Phase::Update, passes);
        self.clock.advance_and_grow_if(self.may_grow(error, &newton));
        Ok(StepReport {
            dt,
            active_nodes: nodes.len(),
            newton,
            projection_iterations: projected.iterations,
            reactions: accounts.reactions,
            obstacles: accounts.contacts.obstacles,
            pairs: accounts.contacts.pairs,
            error,
            reset,
            feels_wall,
            shared_nodes,
            cosine,
            yielding,
            seconds: *watch,
            failed: Vec::new(),
        })
    }

    /// Smooths the update, if the settings ask for it.
    ///
    /// # Errors
    /// A particle leaves the grid, or has no state that is a number.
    fn smooth_and_check(
        &self,
        update: &mut Update<'_, D>,
        connectivity: &Connectivity<D>,
        nodal: &Nodal<D>,
    ) -> Result<(), StepError> {
        if let Some(smoothing) = &self.settings.smoothing {
            update.smooth(smoothing, &self.particles, connectivity, &nodal.mass, self.clock.step());
        }
        if let Some((particle, position)) = update.leaving(&self.particles, connectivity, &self.grid) {
            return Err(StepError::LeftGrid { particle, position: position.iter().copied().collect() });
        }
        match update.remember(&self.particles, &self.bodies, connectivity, self.clock.step()) {
            None => Ok(()),
            Some(particle) => Err(StepError::Undefined { particle }),
        }
    }

    /// Stores the shape functions for the next step, or their memory alone if it cannot use them. Refines surfaces that have stretched, because
    /// a new grid is the time for it.
    fn store_connectivity(&mut self, connectivity: Connectivity<D>) {
        self.workspace.connectivity_is_valid = !self.history.resets_grid();
        self.workspace.connectivity = Some(connectivity);
        self.refine_surfaces(self.load() + self.clock.step());
    }

    /// Whether the next step may be twice as long.
    fn may_grow(&self, error: Option<f64>, newton: &NewtonReport) -> bool {
        let small = |error| self.settings.error_tolerance.is_none_or(|most| error <= ROOM * most);
        // A step that took many Newton iterations would take more if it were longer.
        let easy = 2 * newton.history.iterations.len() <= self.settings.newton.max_iterations;
        easy && error.is_none_or(small)
    }

    /// The local error of a step in grid spacings, if a tolerance is set. Fails if the error exceeds the tolerance and the step can be
    /// halved.
    fn local_error(
        &self,
        update: &Update<'_, D>,
        connectivity: &Connectivity<D>,
        dt: f64,
        newton: &NewtonReport,
    ) -> Result<Option<f64>, StepError> {
        let Some(tolerance) = self.settings.error_tolerance else { return Ok(None) };
        let error = update.local_error(&self.particles, connectivity, self.settings.scheme.error_constant(), dt);
        let error = error / self.grid.spacing;
        // NaN is not a small error.
        if (error.is_nan() || error > tolerance) && self.clock.can_halve() {
            return Err(StepError::Inaccurate { error, tolerance, newton: Box::new(newton.history.clone()) });
        }
        Ok(Some(error))
    }

    /// Like [`Self::step`], but halves Δt while Newton's method fails or the error is too large, down to the clock's limit. Δt grows back
    /// afterwards.
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
            let cause = match compiled::attempt(self, &mut spent) {
                Ok(report) => return Ok(StepReport { failed, ..report }),
                Err(cause) => cause,
            };
            failed.push(FailedAttempt::new(dt, spent, &cause));
            if let StepError::SurfaceOpens { bare } = &cause
                && self.cover(bare)
            {
                continue;
            }
            let mended = match cause {
                ref end if end.is_stopped() || end.is_of_device() => false,
                StepError::Newton(_)
                | StepError::LawFailed { .. }
                | StepError::Unbalanced { .. }
                | StepError::EntersObstacle { .. }
                | StepError::EntersBody { .. }
                | StepError::FreeObstacle { .. }
                | StepError::PassesBody { .. }
                | StepError::Undefined { .. }
                | StepError::Inaccurate { .. } => true,
                // The step may be too long to meet a wall, an obstacle or another body.
                StepError::LeftGrid { .. } => self.settings.error_tolerance.is_some() || self.loads.contacts.exist(),
                // Forces are in balance before the end of the step, but det F ≤ 0 at its end.
                StepError::Inadmissible(_) => self.settings.scheme.instant() < 1.0,
                _ => false,
            };
            if !(mended && self.clock.halve()) {
                return Err(AdvanceError { time, dt, cause: Box::new(cause), failed });
            }
        }
    }
}
