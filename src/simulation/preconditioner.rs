//! The choice of the preconditioner. The thresholds were measured on bodies (`docs/src/choosing.md`).

use super::Simulation;
use crate::approximation::ShapeFunction;
use crate::material::{Law, PLASTIC_STRAIN, p_wave_modulus};
use crate::mechanics::schemes::LONG_STEPS;
use crate::particles::Body;
use crate::solver::Preconditioning;

/// Above this ratio of the volumetric stiffness to Λ + 2G, a body is nearly incompressible, and multigrid is the default preconditioner.
/// The ratio is about that of ν = 0.4998: at 0.4999, no step is found with block-Jacobi.
const ISOCHORIC: f64 = 0.999;

/// Numbers of particles in 1D, 2D and 3D from which on multigrid was faster than block-Jacobi. Block-Jacobi serves splines better: in 3D
/// multigrid was not faster with half a million particles.
const MANY: [usize; 3] = [500, 10_000, 50_000];
const MANY_OF_SPLINES: [usize; 3] = [500, 20_000, usize::MAX];

/// Numbers of particles in 1D, 2D and 3D up to which a direct solve is taken, in programs that have it. It was the fastest in beams, and no
/// slower than the alternative in blocks. In 3D it never was.
const FEW: [usize; 3] = [usize::MAX, 20_000, 0];
const FEW_OF_SPLINES: [usize; 3] = [usize::MAX, 50_000, 0];

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
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
        match self.settings.preconditioner {
            Preconditioning::Automatic => self.best_preconditioner(),
            Preconditioning::Direct if !Preconditioning::HAS_DIRECT => {
                (Preconditioning::BlockJacobi, "this program was built without the feature `direct`")
            }
            asked => (asked, "it was asked for"),
        }
    }

    fn best_preconditioner(&self) -> (Preconditioning, &'static str) {
        use Preconditioning::{BlockJacobi, Direct, Multigrid};
        let particles = self.particles.len();
        // Block-Jacobi is more effective for B-splines than for other functions of equal width.
        let splines = self.approximation.pieces().degree > 1;
        let (few, many) = if splines { (FEW_OF_SPLINES, MANY_OF_SPLINES) } else { (FEW, MANY) };
        if self.settings.scheme.follows_path() {
            (Multigrid, "restarts lose what few iterations keep")
        } else if !self.takes_long_steps() {
            (BlockJacobi, "inertia dominates")
        } else if self.has_internal_variable(PLASTIC_STRAIN) {
            // Near a limit load, multigrid takes a fourth to a sixtieth of the iterations (`docs/src/tutorial/plasticity.md`).
            (Multigrid, "the body may flow")
        } else if Preconditioning::HAS_DIRECT && particles <= few[D - 1] {
            (Direct, "few particles, and inertia does not dominate")
        } else if self.bodies.iter().any(hardly_changes_volume) {
            (Multigrid, "a body hardly changes its volume")
        } else if D == 3 && self.settings.aggregation && self.approximation.pieces().degree == 3 {
            // Block-Jacobi takes up to 30 times the iterations (`scenes/block_static.json`).
            (Multigrid, "outer coefficients follow cubic polynomials")
        } else if particles >= many[D - 1] {
            (Multigrid, "many particles, and inertia does not dominate")
        } else {
            (BlockJacobi, "faster for so many particles and these functions")
        }
    }

    /// Whether inertia does not dominate the steps: load steps, and steps at large Courant numbers.
    fn takes_long_steps(&self) -> bool {
        let across = self.clock.nominal() / self.grid.spacing;
        let courant = |body: &Body<L>| (p_wave_modulus(&body.law) / body.density).sqrt() * across;
        !self.settings.scheme.has_inertia() || self.bodies.iter().any(|body| courant(body) > LONG_STEPS)
    }
}

fn hardly_changes_volume<L: Law>(body: &Body<L>) -> bool {
    let volumetric = body.response::<f64>(0.0).map_or(0.0, |of| of.stiffness);
    volumetric > ISOCHORIC * p_wave_modulus(&body.law)
}
