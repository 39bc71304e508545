//! Newton's method of a step: force balance at t_n + θ Δt, or at a point on an equilibrium path.

use super::{Simulation, StepError};
use crate::approximation::ShapeFunction;
use crate::material::{Law, Material};
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::path::OnPath;
use crate::mechanics::residual::{Equilibrium, Inadmissible};
use crate::mechanics::rigid::loose;
use crate::mechanics::sweep::Connectivity;
use crate::mechanics::transfer::Nodal;
use crate::mechanics::trial::Trial;
use crate::parallel;
use crate::particles::Body;
use crate::pooled::Pooled;
use crate::solver::{NewtonError, NewtonFailure, NewtonReport, Saddle, newton};
use crate::tensor::Vector;

/// The converged solution of the force balance.
pub(super) struct Balance<'a, const D: usize, L> {
    pub equilibrium: Equilibrium<'a, D, L>,
    /// φ_n + θ Δφ
    pub phi: Pooled<Vector<f64, D>>,
    /// The dilatations of averaged cells, in the mixed form: at t_n, and with φ_n + θ Δφ. Otherwise empty.
    pub dilatation: [Vec<f64>; 2],
    pub newton: NewtonReport,
    /// The argument of the load curves at the solution: the time, or λ on an equilibrium path.
    pub load: f64,
    /// On an equilibrium path, the cosine of the angle between this Δφ and the last one.
    pub cosine: Option<f64>,
}

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// The argument of the load curves at t_n: the time, or λ on an equilibrium path.
    pub(super) fn load(&self) -> f64 {
        if self.settings.scheme.follows_path() { self.path.load } else { self.clock.time() }
    }

    /// The argument of the load curves where forces are in balance. On an equilibrium path, that of a load step.
    pub(super) fn load_of_balance(&self) -> f64 {
        let (dt, scheme) = (self.clock.step(), &self.settings.scheme);
        if scheme.follows_path() { self.path.load_step(dt) } else { self.clock.time() + scheme.instant() * dt }
    }

    /// Finds the motion under which forces are in balance.
    pub(super) fn balance<'a>(
        &'a self,
        connectivity: &'a Connectivity<D>,
        nodal: &'a Nodal<D>,
        prescribed: &'a [PrescribedDof],
    ) -> Result<Balance<'a, D, L>, StepError> {
        let (dt, scheme, settings) = (self.clock.step(), &*self.settings.scheme, &self.settings.newton);
        let theta = scheme.instant();
        let under = |load| {
            let equilibrium = self.equilibrium(connectivity, nodal, prescribed, scheme.balance(dt), load);
            Equilibrium { stop: self.settings.stop.as_ref(), mixed: self.is_mixed(), ..equilibrium }
        };
        // A law may have refused a trial that the line search mended. Only refusals of this step explain its failure.
        self.bodies.iter().for_each(|body| _ = body.law.last_failure());
        let mut load = self.load_of_balance();
        let mut equilibrium = under(load);
        let mut phi = self.initial_guess(connectivity, nodal, theta * dt);
        for dof in prescribed {
            phi[dof.node][dof.component] = theta * dof.step.increment;
        }
        parallel::zip(&mut phi, &nodal.motion, |phi, before| *phi += before);
        self.meet_what_holds(&equilibrium, prescribed, &mut phi)?;
        let mut preconditioner = self.preconditioner().0.build::<D>();
        let (mut cosine, mut dilatation) = (None, [Vec::new(), Vec::new()]);
        let newton = if scheme.follows_path() && !self.history.resets_grid() {
            let start = under(self.load());
            let force = |load| under(load).free_external_force(&nodal.motion);
            let path = OnPath::new(self.path, &start, &force, &self.history.rate, dt)?;
            let x = bytemuck::cast_slice_mut(&mut phi);
            let report = newton(&path, &mut *preconditioner, x, settings, connectivity.pool())?;
            load = path.load(&phi);
            cosine = Some(path.cosine(&phi));
            if path.ends(load)? {
                return Err(StepError::PathEnds { load });
            }
            equilibrium = under(load);
            report
        } else {
            if let Some(cells) = equilibrium.terms.averaged_cells().filter(|_| equilibrium.mixed) {
                dilatation[0] = cells.unknowns(&self.particles);
                preconditioner = Box::new(Saddle::<D>::over(preconditioner));
            }
            let nodal: &[f64] = bytemuck::cast_slice(&phi);
            let mut x = connectivity.pool().unspecified(nodal.len() + dilatation[0].len());
            let (of_nodes, of_cells) = x.split_at_mut(nodal.len());
            parallel::copy(nodal, of_nodes);
            of_cells.copy_from_slice(&dilatation[0]);
            let report = newton(&equilibrium, &mut *preconditioner, &mut x, settings, connectivity.pool())
                .map_err(|error| self.explained(error, &equilibrium, connectivity))?;
            let at = equilibrium.trial(&x);
            parallel::copy(at.phi, &mut phi);
            dilatation[1] = at.dilatation.to_vec();
            report
        };
        equilibrium.space.followers().extend(&mut phi);
        Ok(Balance { equilibrium, phi, dilatation, newton, load, cosine })
    }

    /// Adds the cause to an error of Newton's method: without inertia, a body that nothing holds has no equilibrium.
    fn explained(
        &self,
        error: NewtonError<Inadmissible>,
        equilibrium: &Equilibrium<'_, D, L>,
        connectivity: &Connectivity<D>,
    ) -> StepError {
        if let Some(sentence) = self.bodies.iter().find_map(|body| body.law.last_failure()) {
            return StepError::LawFailed { sentence, source: error };
        }
        if matches!(error.cause, NewtonFailure::Stopped) || error.cause.is_of_device() {
            return StepError::Newton(error);
        }
        let is_static = equilibrium.step.nodal.is_static();
        // Contact may hold the bodies, and a shorter step may find it.
        let free = is_static && !self.loads.contacts.exist();
        if let Some(loose) = free.then(|| loose(&self.grid, equilibrium, connectivity.active())).flatten() {
            return StepError::Loose { loose, source: error };
        }
        match self.advice(is_static) {
            Some(advice) => StepError::Unbalanced { advice, source: error },
            None => StepError::Newton(error),
        }
    }

    /// The likely causes of a step without equilibrium, with their cures; `None` if nothing is known.
    fn advice(&self, is_static: bool) -> Option<String> {
        let path = if self.loads.contacts.exist() { "" } else { "follow the path (time.scheme = \"arc_length\"), " };
        let load = format!(
            "without inertia there may be none, where a load is larger than the bodies bear: prescribe the motion there, {path}or give the \
             scene inertia"
        );
        let outside = |body: &&Body<L>| {
            let law = body.law.shipped().and_then(|law| law.downcast_ref::<Material>());
            law.is_some_and(|law| matches!(law, Material::Foreign(_)))
        };
        let law = |body: &Body<L>| {
            format!(
                "the law of body {:?} comes from a library, and Newton's method does not converge with a wrong tangent: `bfree check-law` \
                 tells whether it is right",
                body.name
            )
        };
        let law = self.bodies.iter().find(outside).map(law);
        let touch = (is_static && self.loads.contacts.between.is_some()).then(|| {
            "a body that only other bodies hold has no stiffness until it touches them: let them overlap by a thousandth of grid.spacing at \
             the start, hold what may slide away, or take a smaller contact.stiffness"
                .to_owned()
        });
        let all: Vec<String> = is_static.then_some(load).into_iter().chain(touch).chain(law).collect();
        (!all.is_empty()).then(|| all.join("; "))
    }

    /// Compares the tangent at the solution with dual numbers, if the settings ask for it. The direction differs from step to step.
    pub(super) fn check_tangent(
        &self,
        equilibrium: &Equilibrium<'_, D, L>,
        at: Trial<'_, f64, D>,
    ) -> Result<(), StepError> {
        if self.settings.check_tangent.is_some_and(|every| self.clock.steps().is_multiple_of(every.get())) {
            equilibrium.check_tangent_at(at, self.clock.steps())?;
        }
        Ok(())
    }
}
