//! The equilibrium of a step as the problem that Newton's method solves.

use crate::material::Law;
use crate::mechanics::mixed::MixedTangent;
use crate::mechanics::residual::{Equilibrium, Inadmissible};
use crate::solver::{Linearization, NonlinearProblem};

impl<const D: usize, L: Law> NonlinearProblem for Equilibrium<'_, D, L> {
    type Inadmissible = Inadmissible;
    fn residual(&self, x: &[f64], r: &mut [f64]) -> Result<(), Inadmissible> {
        let at = self.trial(x);
        let (nodes, cells) = r.split_at_mut(D * at.phi.len());
        let residual = bytemuck::cast_slice_mut(nodes);
        self.residual_into(at, residual)?;
        self.space.clear_prescribed(residual);
        cells.copy_from_slice(&self.cell_residuals(|_, _| true, at));
        Ok(())
    }

    fn magnitude(&self, x: &[f64]) -> Result<f64, Inadmissible> {
        self.magnitude_at(self.trial(x))
    }

    fn sensitivity(&self, x: &[f64]) -> Result<f64, Inadmissible> {
        self.sensitivity_at(self.trial(x))
    }

    /// None in the mixed form: its solution is a saddle point.
    fn potential(&self, x: &[f64]) -> Option<Result<(f64, f64), Inadmissible>> {
        if self.mixed { None } else { Self::potential::<f64>(self, bytemuck::cast_slice(x)) }
    }

    fn is_symmetric(&self) -> bool {
        Self::is_symmetric(self)
    }

    fn is_stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop.0())
    }

    fn linearize(&self, x: &[f64]) -> Result<Box<dyn Linearization + '_>, Inadmissible> {
        let tangent = self.tangent_at(None, self.trial(x))?;
        Ok(if self.mixed { Box::new(MixedTangent { tangent }) } else { Box::new(tangent) })
    }
}
