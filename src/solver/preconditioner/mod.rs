//! Approximate inverses for Krylov methods, one file each.

mod block_jacobi;

pub use block_jacobi::BlockJacobi;

use super::LinearOperator;
use crate::pooled::Pooled;

/// What a tangent tells of its entries, in double precision even where its products are not.
pub trait DiagonalBlocks {
    /// The square blocks on the diagonal, one after the other, each column by column, with the identity's row and column at prescribed
    /// degrees of freedom. A positive factor that all have in common does not matter.
    fn diagonal_blocks(&self) -> Pooled<f64>;
}

/// An approximate inverse M⁻¹ that [`newton()`](super::newton()) keeps up to date: `apply` is z = M⁻¹ r, the same linear map until it is
/// prepared again. A positive factor does not matter.
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
/// inverse.prepare(&matrix);
/// let report = gmres(&matrix, &inverse, &[1.0, 2e3, 3e6], &mut x, &GmresSettings::default(), &Pool::default())?;
/// assert_eq!(report.iterations, 1);
/// assert!(x.iter().zip([1.0, 2.0, 3.0]).all(|(x, exact)| (x - exact).abs() < 1e-15 * exact));
/// # Ok::<(), bfree::solver::LinearError>(())
/// ```
pub trait Preconditioner: LinearOperator<f64> + LinearOperator<f32> {
    /// Told of every tangent before the system with it is solved.
    fn prepare(&mut self, tangent: &dyn DiagonalBlocks);
}

/// The preconditioners to choose from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preconditioning {
    /// [`BlockJacobi`]
    #[default]
    BlockJacobi,
    /// [`Identity`]
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
    fn prepare(&mut self, _: &dyn DiagonalBlocks) {}
}
