//! Preconditioners: approximate inverses for Krylov methods, one file each.

mod block_jacobi;
mod chebyshev;
mod hats;
mod multigrid;
mod saddle;

pub use block_jacobi::BlockJacobi;
pub use multigrid::{LocalForm, Multigrid};
pub(crate) use multigrid::{bytes as multigrid_bytes, rigid_motions};
pub use saddle::PressureCells;
pub(crate) use saddle::{Saddle, bytes as saddle_bytes};

use super::{LinearOperator, Linearization, OnDevice};
use crate::gpu::GpuVector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt::{Display, Formatter};

/// A preconditioner for the tangents of a step. It makes approximate inverses M⁻¹, whose `apply` is z = M⁻¹ r. A positive factor of M
/// does not matter.
///
/// ```
/// use bfree::pooled::{Pool, Pooled};
/// use bfree::solver::{BlockJacobi, GmresSettings, LinearOperator, Linearization, Preconditioner, System};
///
/// /// A diagonal matrix.
/// struct Diagonal(Vec<f64>);
///
/// impl LinearOperator for Diagonal {
///     fn apply(&self, x: &[f64], y: &mut [f64]) {
///         y.iter_mut().zip(x).zip(&self.0).for_each(|((y, x), a)| *y = a * x);
///     }
/// }
///
/// impl Linearization for Diagonal {
///     fn diagonal_blocks(&self) -> Pooled<f64> {
///         self.0.clone().into()
///     }
/// }
///
/// // Blocks of one row are the whole matrix, so M⁻¹A = I takes one iteration, however different the entries are.
/// let (matrix, mut inverse, mut x) = (Diagonal(vec![1.0, 1e3, 1e6]), BlockJacobi::<1>::default(), [0.0; 3]);
/// let inverse = inverse.prepare(&matrix);
/// let system = System { vectors: &Pool::default(), operator: &matrix, inverse: &*inverse };
/// let settings = GmresSettings { relative_tolerance: 1e-8, max_iterations: 10, restart: 30 };
/// let report = settings.solve(&system, &[1.0, 2e3, 3e6], &mut x)?;
/// assert_eq!(report.iterations, 1);
/// assert!(x.iter().zip([1.0, 2.0, 3.0]).all(|(x, exact)| (x - exact).abs() < 1e-15 * exact));
/// # Ok::<(), bfree::solver::LinearError>(())
/// ```
pub trait Preconditioner {
    /// The approximate inverse of a tangent. It may be made from an earlier tangent of the step.
    fn prepare<'a>(&'a mut self, tangent: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a>;

    /// [`Self::prepare`] on the device of `system`, which is the tangent there; `None` if this preconditioner has no form for devices.
    fn prepare_on_device<'a>(
        &'a mut self,
        _tangent: &'a dyn Linearization,
        _system: &'a dyn OnDevice,
    ) -> Option<Box<dyn LinearOperator<GpuVector> + 'a>> {
        None
    }
}

/// The preconditioner of the linear systems.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preconditioning {
    /// Multigrid without inertia, and in steps at Courant numbers above 10 for bodies that are large, may flow plastically or hardly change their
    /// volume, above 30 where they average that change by cell. Otherwise block-Jacobi.
    #[default]
    Automatic,
    /// Block-Jacobi: the inverses of the diagonal blocks. It is cheap, and enough where inertia dominates.
    BlockJacobi,
    /// One V-cycle of multigrid. Iterations hardly grow as the grid is refined.
    Multigrid,
    /// No preconditioner.
    None,
}

impl Preconditioning {
    /// A new preconditioner of this kind for `D` unknowns a node, not yet prepared with a tangent.
    ///
    /// ```
    /// use bfree::solver::Preconditioning;
    ///
    /// // Preconditioning saves iterations in a step: few on regular nodes, many beside nodes with hardly any mass.
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &["boundary.left=fixed".parse()?])?;
    /// let iterations = |preconditioner| {
    ///     let mut simulation = scene.build::<2>("scenes".as_ref())?;
    ///     simulation.settings.preconditioner = preconditioner;
    ///     simulation.particles.velocity[0] *= 2.0;
    ///     let step = simulation.step()?;
    ///     Ok::<_, Box<dyn std::error::Error>>(step.newton.history.counts.krylov_iterations)
    /// };
    /// assert!(iterations(Preconditioning::BlockJacobi)? < iterations(Preconditioning::None)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn build<const D: usize>(self) -> Box<dyn Preconditioner> {
        match self {
            Self::Automatic | Self::BlockJacobi => Box::new(BlockJacobi::<D>::default()),
            Self::Multigrid => Box::new(Multigrid::<D>::default()),
            Self::None => Box::new(Identity),
        }
    }
}

impl Display for Preconditioning {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Automatic => "automatic",
            Self::BlockJacobi => "diagonal blocks",
            Self::Multigrid => "multigrid",
            Self::None => "none",
        })
    }
}

/// No preconditioning: M = I.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity;

impl LinearOperator for Identity {
    fn apply(&self, r: &[f64], z: &mut [f64]) {
        z.copy_from_slice(r);
    }
}

impl Preconditioner for Identity {
    fn prepare<'a>(&'a mut self, _: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a> {
        Box::new(Self)
    }

    fn prepare_on_device<'a>(
        &'a mut self,
        _: &'a dyn Linearization,
        system: &'a dyn OnDevice,
    ) -> Option<Box<dyn LinearOperator<GpuVector> + 'a>> {
        let gpu = system.gpu();
        Some(Box::new(|r: &GpuVector, z: &mut GpuVector| gpu.copy(&r.0, &mut z.0)))
    }
}
