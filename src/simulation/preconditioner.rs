//! The choice of the preconditioner. The thresholds were measured on bodies (`docs/src/choosing.md`).

use super::Simulation;
use crate::material::{Law, PLASTIC_STRAIN, p_wave_modulus};
use crate::mechanics::schemes::LONG_STEPS;
use crate::particles::Body;
use crate::solver::{Krylov, Preconditioning};

/// Above this ratio of the volumetric stiffness to Λ + 2G, a body is nearly incompressible, and multigrid is the default preconditioner.
/// The ratio is about that of ν = 0.4998: at 0.4999, no step is found with block-Jacobi.
const ISOCHORIC: f64 = 0.999;

/// Above this ratio, the dilatations of averaged cells are unknowns of their own. The ratio is that of ν = 0.444.
const NEARLY_INCOMPRESSIBLE: f64 = 0.8;

/// Courant number of pressure waves above which the mixed form is faster than the displacement form with block-Jacobi.
const MIXED_STEPS: f64 = 30.0;

/// Numbers of particles in 1D, 2D and 3D from which on multigrid was faster than block-Jacobi in long steps with inertia.
const MANY: [usize; 3] = [500, 20_000, 50_000];

impl<const D: usize, L: Law, A> Simulation<D, L, A> {
    /// The preconditioner of the linear systems, and the reason for the choice.
    ///
    /// ```
    /// use bfree::solver::Preconditioning;
    ///
    /// let mut simulation = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?.build::<2>("scenes".as_ref())?;
    /// assert_eq!(simulation.preconditioner(), (Preconditioning::BlockJacobi, "inertia dominates"));
    /// simulation.settings.preconditioner = Preconditioning::Multigrid;
    /// assert_eq!(simulation.preconditioner(), (Preconditioning::Multigrid, "it was asked for"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn preconditioner(&self) -> (Preconditioning, &'static str) {
        use Preconditioning::{Automatic, BlockJacobi, Multigrid};
        let asked = self.settings.preconditioner;
        if asked != Automatic {
            (asked, "it was asked for")
        } else if self.is_mixed() {
            (Multigrid, "for the motions; a Schur complement for the pressures of averaged cells")
        } else if !self.settings.scheme.has_inertia() {
            (Multigrid, "there is no inertia")
        } else if !self.takes_steps_above(LONG_STEPS) {
            (BlockJacobi, "inertia dominates")
        } else if self.has_internal_variable(PLASTIC_STRAIN) {
            // Near a limit load, multigrid takes a fourth to a sixtieth of the iterations (`docs/src/tutorial/plasticity.md`).
            (Multigrid, "the body may flow")
        } else if !self.takes_steps_above(MIXED_STEPS) && self.bodies.iter().any(suits_mixed_form) {
            (BlockJacobi, "steps are short for a body that averages its dilatation")
        } else if self.bodies.iter().any(|body| stiffness_ratio(body) > ISOCHORIC) {
            (Multigrid, "a body hardly changes its volume")
        } else if self.particles.len() >= MANY[D - 1] {
            (Multigrid, "many particles, and inertia does not dominate")
        } else {
            (BlockJacobi, "few particles")
        }
    }

    /// Whether the dilatations of averaged cells are unknowns of their own: in long steps of a nearly incompressible body, unless the scene
    /// asks for a solver of the displacement form.
    pub(crate) fn is_mixed(&self) -> bool {
        let settings = &self.settings;
        let shortest = match settings.preconditioner {
            Preconditioning::Automatic => MIXED_STEPS,
            Preconditioning::Multigrid => LONG_STEPS,
            _ => return false,
        };
        settings.newton.krylov != Krylov::ConjugateGradient
            && !settings.scheme.follows_path()
            && !self.has_mean_stress()
            && self.takes_steps_above(shortest)
            && self.bodies.iter().any(suits_mixed_form)
    }

    /// Whether steps are load steps, or have Courant numbers above this one.
    fn takes_steps_above(&self, limit: f64) -> bool {
        let across = self.clock.nominal() / self.grid.spacing;
        let courant = |body: &Body<L>| (p_wave_modulus(&body.law) / body.density).sqrt() * across;
        !self.settings.scheme.has_inertia() || self.bodies.iter().any(|body| courant(body) > limit)
    }
}

/// Whether a body is nearly incompressible, and its cells average the dilatation, so that the mixed form can solve it.
fn suits_mixed_form<L: Law>(body: &Body<L>) -> bool {
    body.averages() && stiffness_ratio(body) > NEARLY_INCOMPRESSIBLE
}

/// The volumetric stiffness over Λ + 2G.
fn stiffness_ratio<L: Law>(body: &Body<L>) -> f64 {
    body.response::<f64>(0.0).map_or(0.0, |of| of.stiffness) / p_wave_modulus(&body.law)
}
