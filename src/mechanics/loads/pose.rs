//! Rigid motions.

use crate::scalar::Real;
use crate::tensor::{Tensor, Vector};

/// The rigid motion x = b + R X of an obstacle since t = 0. X is a position in the frame of the obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<const D: usize, T = f64> {
    /// R
    pub rotation: Tensor<T, D>,
    /// b
    pub shift: Vector<T, D>,
}

impl<const D: usize> Pose<D> {
    /// The pose as constants of another number type.
    pub(crate) fn lit<T: Real>(&self) -> Pose<D, T> {
        Pose { rotation: self.rotation.map(T::lit), shift: self.shift.map(T::lit) }
    }
}

impl<T: Real, const D: usize> Pose<D, T> {
    /// X = Rᵀ (x − b), a position in the frame of the obstacle.
    pub fn to_frame(&self, x: &Vector<T, D>) -> Vector<T, D> {
        self.rotation.tr_mul(&(x - self.shift))
    }

    /// x = b + R X
    pub(crate) fn to_space(self, x: &Vector<T, D>) -> Vector<T, D> {
        self.shift + self.rotation * x
    }
}
