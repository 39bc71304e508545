//! Approximate inverses for Krylov methods, one file each.

mod block_jacobi;
mod multigrid;

pub use block_jacobi::BlockJacobi;
pub(crate) use multigrid::bytes as multigrid_bytes;
pub use multigrid::{LocalForm, Multigrid};

use super::{LinearOperator, Linearization};
use crate::pooled::Pooled;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a tangent tells of its entries, in double precision even where its products are not.
pub trait DiagonalBlocks {
    /// The square blocks on the diagonal, one after the other, each column by column, with the identity's row and column at prescribed
    /// degrees of freedom. A positive factor that all have in common does not matter.
    fn diagonal_blocks(&self) -> Pooled<f64>;

    /// The operator as a form on the cells of a grid, from which coarser ones are made; `None` if it has no such form.
    fn local_form(&self) -> Option<LocalForm> {
        None
    }
}

/// What makes approximate inverses of the tangents of a step: `apply` of one is z = M⁻¹ r. A positive factor does not matter.
///
/// ```
/// use bfree::pooled::{Pool, Pooled};
/// use bfree::solver::{BlockJacobi, DiagonalBlocks, GmresSettings, LinearOperator, Preconditioner, gmres};
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
/// impl DiagonalBlocks for Diagonal {
///     fn diagonal_blocks(&self) -> Pooled<f64> {
///         self.0.clone().into()
///     }
/// }
///
/// // Blocks of one row are the whole matrix, M⁻¹A = I: one iteration, however far apart the entries lie.
/// let (matrix, mut inverse, mut x) = (Diagonal(vec![1.0, 1e3, 1e6]), BlockJacobi::<1>::default(), [0.0; 3]);
/// let inverse = inverse.prepare(&matrix);
/// let report = gmres(&matrix, &*inverse, &[1.0, 2e3, 3e6], &mut x, &GmresSettings::default(), &Pool::default())?;
/// assert_eq!(report.iterations, 1);
/// assert!(x.iter().zip([1.0, 2.0, 3.0]).all(|(x, exact)| (x - exact).abs() < 1e-15 * exact));
/// # Ok::<(), bfree::solver::LinearError>(())
/// ```
pub trait Preconditioner {
    /// The approximate inverse of a tangent, from the tangents that came before it if they serve.
    fn prepare<'a>(&'a mut self, tangent: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a>;

    /// As [`Self::prepare`], in single precision.
    fn prepare_single<'a>(&'a mut self, tangent: &'a dyn Linearization<f32>) -> Box<dyn LinearOperator<f32> + 'a>;
}

/// What preconditions the linear systems.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preconditioning {
    /// The inverses of the diagonal blocks: cheap, and enough where inertia dominates.
    #[default]
    BlockJacobi,
    /// One V-cycle of multigrid: iterations hardly grow as the grid is refined. It pays without inertia, and in steps of many wave times, from
    /// some thousand nodes on in 2D, and with linear functions in 3D.
    Multigrid,
    /// Nothing.
    None,
}

impl Preconditioning {
    /// That preconditioner for `D` unknowns a node, prepared with nothing yet.
    ///
    /// ```
    /// use bfree::solver::Preconditioning;
    ///
    /// // What preconditioning saves in a step: on regular nodes little, beside nodes with hardly any mass much.
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
    pub fn anew<const D: usize>(self) -> Box<dyn Preconditioner> {
        match self {
            Self::BlockJacobi => Box::new(BlockJacobi::<D>::default()),
            Self::Multigrid => Box::new(Multigrid::<D>::default()),
            Self::None => Box::new(Identity),
        }
    }
}

/// No preconditioning: M = I.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity;

impl<S: Copy> LinearOperator<S> for Identity {
    fn apply(&self, r: &[S], z: &mut [S]) {
        z.copy_from_slice(r);
    }
}

impl Preconditioner for Identity {
    fn prepare<'a>(&'a mut self, _: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a> {
        Box::new(Self)
    }

    fn prepare_single<'a>(&'a mut self, _: &'a dyn Linearization<f32>) -> Box<dyn LinearOperator<f32> + 'a> {
        Box::new(Self)
    }
}
