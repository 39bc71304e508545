//! Body forces that vary in space, given in code.

use crate::tensor::Vector;
use std::fmt::{Debug, Formatter};
use std::sync::Arc;

/// A force per mass, as a function of `(id of the particle, its position x_n, t)`.
pub type Field<const D: usize> = dyn Fn(usize, &Vector<f64, D>, f64) -> Vector<f64, D> + Send + Sync;

/// A force per mass that varies in space, evaluated at the particle positions at the beginning of a step.
#[derive(Clone)]
pub struct ForceField<const D: usize>(pub Arc<Field<D>>);

impl<const D: usize> Debug for ForceField<D> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str("ForceField")
    }
}

/// Two fields are equal if they are the same function object.
impl<const D: usize> PartialEq for ForceField<D> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}
