//! What a pass gathers and scatters, and by which weights.

use crate::scalar::Real;

/// What a pass gathers, and scatters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flow {
    /// Σ u_I N_I, and q N_I
    pub value: bool,
    /// Σ u_I ⊗ ∇N_I, and σ ∇N_I
    pub gradient: bool,
    /// The weights of the scatter.
    pub weights: Weights,
}

impl Flow {
    /// Values and gradients.
    pub const BOTH: Self = Self { value: true, gradient: true, weights: Weights::Signed };
    /// Gradients alone.
    pub const GRADIENT: Self = Self { value: false, ..Self::BOTH };
    /// Values alone.
    pub const VALUE: Self = Self { gradient: false, ..Self::BOTH };

    /// What one or the other needs.
    pub fn and(self, other: Self) -> Self {
        Self { value: self.value || other.value, gradient: self.gradient || other.gradient, ..self }
    }
}

/// How N and ∇N enter a scatter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weights {
    /// As they are.
    Signed,
    /// By their magnitude.
    Magnitude,
    /// N²: the diagonal of a mass matrix, since N is a product.
    Square,
}

impl Weights {
    /// What is done to every weight.
    pub(super) fn changed<X: Real>(self) -> Option<fn(X) -> X> {
        match self {
            Self::Signed => None,
            Self::Magnitude => Some(|n| n.abs()),
            Self::Square => Some(|n| n * n),
        }
    }
}
