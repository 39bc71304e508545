//! Pseudo-random numbers, the same from the same seed.

use crate::convention::Tensor;
use crate::tensor::{from_entries, product3, rotation_about, transposed};

/// Pseudo-random numbers: SplitMix64 (Steele, Lea and Flood, 2014).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The numbers of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// A number from −1 to 1.
    pub fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^= bits >> 31;
        (bits >> 11) as f64 * 2.0_f64.powi(-52) - 1.0
    }

    /// A number between two bounds.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + 0.5 * (self.signed() + 1.0) * (high - low)
    }

    /// A rotation about a general axis; in the plane, about axis 3.
    pub fn rotation(&mut self, plane: bool) -> Tensor {
        let vector = [self.signed(), self.signed(), self.signed()].map(|x| 1.5 * x);
        rotation_about(if plane { [0.0, 0.0, vector[2]] } else { vector })
    }

    /// A general strain without volume change whose greatest principal strain is near 1; in the plane, strains 33, 13 and 23 are zero.
    pub fn isochoric(&mut self, plane: bool) -> Tensor {
        let axes = self.rotation(plane);
        let share = self.between(0.15, 0.45);
        let principal = if plane { [1.0, -1.0, 0.0] } else { [1.0, -share, share - 1.0] };
        let diagonal = from_entries(|i, j| if i == j { principal[i] } else { 0.0 });
        product3(&axes, &diagonal, &transposed(&axes))
    }
}
