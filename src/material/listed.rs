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

/// The law at the key `base` below `path`, for a law over an elastic law. If it has a memory, `problems` says so.
pub(super) fn elastic_base<B: Listed>(given: &B::Parameters, problems: &mut Problems, path: &str) -> Option<B> {
    let path = format!("{path}.base");
    let base = B::build(given, problems, &path);
    let elastic = base.as_ref().is_none_or(|law| law.internal_variables().is_empty());
    problems.require(elastic, &path, "a law with memory", "must be an elastic law");
    base
}
