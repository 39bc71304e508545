//! A law that a scene can name.

use super::{Lame, Law};
use crate::problems::Problems;

/// A law that a scene can name: its parameters, its constructor and an example. [`Material`](super::Material) is such a law, too. A composite
/// law can therefore take any law of the list as its base.
pub trait Listed: Law + Sized {
    /// The parameters of the law in a scene. The doc comments of the fields are the manual. Isotropic laws share
    /// [`LameParameters`](super::LameParameters).
    type Parameters;

    /// Builds the law. `None` if a value below the key `path` is not allowed; `problems` then says why.
    fn build(given: &Self::Parameters, problems: &mut Problems, path: &str) -> Option<Self>;

    /// An example for tests and studies. At small strain it is Hooke's law of Λ and G, apart from the stiffness of fibres. Its other
    /// constants are free.
    fn example(lame: Lame) -> Self;
}
