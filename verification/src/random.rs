//! Reproducible random numbers: SplitMix64 (Steele, Lea, Flood 2014), the same on every machine and in every version.

use bfree::tensor::{Tensor, Vector};

/// The generator; its state is the seed.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The sequence that belongs to `seed`.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number, uniform in [−1, 1).
    pub fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        // The upper 53 bits, exactly.
        (z >> 11) as f64 * 2.0_f64.powi(-52) - 1.0
    }

    /// The next number, uniform between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * 0.5 * (1.0 + self.signed())
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
