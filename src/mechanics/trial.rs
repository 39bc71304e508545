//! A trial state of the unknowns of a step.

use crate::tensor::Vector;

/// A trial state of the unknowns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trial<'x, T, const D: usize> {
    /// φ, the nodal motion since the last grid reset.
    pub phi: &'x [Vector<T, D>],
    /// The dilatation of every averaged cell in its [unit](crate::mechanics::dilatation::Scale), where it is an unknown of its own;
    /// otherwise empty.
    pub dilatation: &'x [T],
}

impl<'x, T, const D: usize> Trial<'x, T, D> {
    /// A motion that determines the dilatation of the cells.
    pub(crate) fn motion(phi: &'x [Vector<T, D>]) -> Self {
        Self { phi, dilatation: &[] }
    }
}
