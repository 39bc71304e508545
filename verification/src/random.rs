//! Reproducible random numbers, vectors and tensors, the same on every machine and in every version.

use bfree::tensor::{Tensor, Vector};
use tangent_check::states;

/// The generator of the crate `tangent-check`, with vectors and tensors.
#[derive(Clone, Debug)]
pub struct Random(states::Random);

impl Random {
    /// The sequence that belongs to `seed`.
    pub fn new(seed: u64) -> Self {
        Self(states::Random::new(seed))
    }

    /// The next number, uniform in [−1, 1).
    pub fn signed(&mut self) -> f64 {
        self.0.signed()
    }

    /// The next number, uniform between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.between(low, high)
    }

    /// A vector with components in [−1, 1).
    pub fn vector<const D: usize>(&mut self) -> Vector<f64, D> {
        Vector::from_fn(|_, _| self.signed())
    }

    /// A tensor with components in [−1, 1).
    pub fn tensor<const D: usize>(&mut self) -> Tensor<f64, D> {
        Tensor::from_fn(|_, _| self.signed())
    }

    /// `count` vectors with components in [−1, 1).
    pub fn field<const D: usize>(&mut self, count: usize) -> Vec<Vector<f64, D>> {
        (0..count).map(|_| self.vector()).collect()
    }
}
