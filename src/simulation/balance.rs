//! Newton's method at the heart of a step: forces in balance at t_n + θ Δt, or on a path.

use super::{InitialGuess, Simulation, StepError};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use crate::mechanics::check::direction;
use crate::mechanics::kept::Kept;
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::path::OnPath;
use crate::mechanics::residual::{Equilibrium, Inadmissible};
use crate::mechanics::rigid::loose;
use crate::mechanics::sweep::Supports;
use crate::mechanics::transfer::Nodal;
use crate::pooled::Pooled;
use crate::solver::{NewtonError, NewtonFailure, NewtonReport, newton};
use crate::tensor::Vector;

/// Forces in balance.
pub(super) struct Balance<'a, const D: usize, L> {
    pub equilibrium: Equilibrium<'a, D, L>,
    /// φ_n + θ Δφ
    pub phi: Pooled<Vector<f64, D>>,
    pub newton: NewtonReport,
    /// The time in whose place the loads acted at t_n, and act now.
    pub loads: [f64; 2],
    /// On a path, the cosine of the angle between Δφ and that of the last step.
    pub straight: Option<f64>,
}

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// Finds the motion under which forces are in balance.
    pub(super) fn balance<'a>(
        &'a self,
        supports: &'a Supports<D>,
        nodal: &'a Nodal<D>,
        prescribed: &'a [PrescribedDof],
        kept: Option<&Kept<D>>,
    ) -> Result<Balance<'a, D, L>, StepError> {
        let (t, dt, scheme, settings) =
            (self.clock.time(), self.clock.step(), &*self.settings.scheme, &self.settings.newton);
        let theta = scheme.instant();
        let [from, mut to] =
            if scheme.follows_path() { [self.path.load, self.path.load_step(dt)] } else { [t, t + theta * dt] };
        let under = |load: f64| {
            let equilibrium = self.equilibrium(supports, nodal, prescribed, scheme.balance(dt), load);
            Equilibrium { stop: self.settings.stop.as_ref(), ..equilibrium }
        };
        let mut equilibrium = under(to);
        let mut phi = self.initial_guess(supports, nodal, kept, theta * dt);
        for dof in prescribed {
            phi[dof.node][dof.component] = theta * dof.step.increment;
        }
        phi.iter_mut().zip(&nodal.motion).for_each(|(phi, before)| *phi += before);
        let (mut preconditioner, x) = (self.preconditioner().0.anew::<D>(), bytemuck::cast_slice_mut(&mut phi));
        let mut straight = None;
        let newton = match kept.filter(|_| scheme.follows_path()) {
            None => newton(&equilibrium, &mut *preconditioner, x, settings, supports.pool())
                .map_err(|error| self.explained(error, &equilibrium, supports))?,
            Some(kept) => {
                let start = under(from);
                let force = |load| under(load).free_external_force(&nodal.motion);
                let path = OnPath::new(self.path, &start, &force, &kept.rate, dt)?;
                let report = newton(&path, &mut *preconditioner, x, settings, supports.pool())?;
                to = path.load(&phi);
                straight = Some(path.straight(&phi));
                if path.ends(to)? {
                    return Err(StepError::PathEnds { load: to });
                }
                equilibrium = under(to);
                report
            }
        };
        equilibrium.unknowns.followers.extend(&mut phi);
        Ok(Balance { equilibrium, phi, newton, loads: [from, to], straight })
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
        supports: &Supports<D>,
    ) -> StepError {
        if !equilibrium.step.nodal.is_static() || matches!(error.cause, NewtonFailure::Stopped { .. }) {
            return StepError::Newton(error);
        }
        match loose(&self.grid, equilibrium, supports.active()) {
            Some(loose) => StepError::Loose { loose, source: error },
            None => StepError::Unbalanced { source: error },
        }
    }

    /// The check a run may ask for: the tangent at the solution against dual numbers, in a direction of its own for each step.
    pub(super) fn check_tangent(
        &self,
        equilibrium: &Equilibrium<'_, D, L>,
        dphi: &[Vector<f64, D>],
    ) -> Result<(), StepError> {
        match self.settings.check_tangent {
            Some(every) if self.clock.steps().is_multiple_of(every.get()) => {
                Ok(equilibrium.check_tangent(dphi, &direction(dphi.len(), self.clock.steps()))?)
            }
            _ => Ok(()),
        }
    }
}
