//! Numbers of one lane or many, on which the functions away from walls are evaluated.

use std::ops::{Add, Div, Mul, Sub};

/// A number, or the lanes of a vector. Every operation rounds, so numbers and lanes agree bitwise.
pub(crate) trait Lane:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The constant `x` in the type of `self`.
    fn constant(self, x: f64) -> Self;

    /// `then` where `self` < `other`, and `otherwise` elsewhere.
    fn where_less(self, other: Self, then: Self, otherwise: Self) -> Self;

    /// |x|
    fn abs(self) -> Self;
}

impl Lane for f64 {
    #[inline(always)]
    fn constant(self, x: f64) -> Self {
        x
    }

    #[inline(always)]
    fn where_less(self, other: Self, then: Self, otherwise: Self) -> Self {
        if self < other { then } else { otherwise }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
}
