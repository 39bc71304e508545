//! The parts of a family that a scene needs.

use super::shape_function::ShapeFunction;
use crate::problems::Problems;

/// The parts of a listed family besides its functions: its keys, constructor and examples. `A` stands for
/// [`Approximation`](super::Approximation), which contains every family.
pub trait Listed: ShapeFunction + Sized {
    /// The keys of the family in a scene; `()` if it has only its name. The doc comments of the fields are the manual.
    type Parameters;

    /// A second type that the keys may select; `Self` if there is none.
    type Other;

    /// Whether the functions depend on the width of particles. If so, all bodies must have particles of one width.
    const ONE_HALF_WIDTH: bool = false;

    /// Makes the functions. If keys below `path` are wrong, the result is `None` and `problems` lists them.
    fn build<A: From<Self> + From<Self::Other>>(
        given: &Self::Parameters,
        cells: Cells,
        problems: &mut Problems,
        path: &str,
    ) -> Option<A>;

    /// Named members of the family, for tests and studies.
    fn examples<A: From<Self> + From<Self::Other>>() -> Vec<(&'static str, A)>;
}

/// The data of a scene on which shape functions depend, besides their own parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cells {
    /// The number of dimensions D.
    pub dimension: usize,
    /// Particles along each axis of a cell.
    pub particles_per_axis: u32,
    /// Whether the particles are Gauss points, so that sums over particles are integrals, and no mass is lumped.
    pub integrated: bool,
}
