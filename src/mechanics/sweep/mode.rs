//! The evaluation mode of a pass: values, gradients or both, and the weights of its scatter.

/// The evaluation mode of a pass over the particles. It holds for gather and scatter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mode {
    /// Σ u_I N_I is gathered, and q N_I scattered.
    pub value: bool,
    /// Σ u_I ⊗ ∇N_I is gathered, and σ ∇N_I scattered.
    pub gradient: bool,
    /// The weights of the scatter.
    pub weights: Weights,
}

impl Mode {
    /// Values and gradients.
    pub const BOTH: Self = Self { value: true, gradient: true, weights: Weights::Signed };
    /// Gradients alone.
    pub(crate) const GRADIENT: Self = Self { value: false, ..Self::BOTH };
    /// Values alone.
    pub(crate) const VALUE: Self = Self { gradient: false, ..Self::BOTH };

    /// The mode that serves both `self` and `other`, with the weights of `self`.
    pub(crate) fn and(self, other: Self) -> Self {
        Self { value: self.value || other.value, gradient: self.gradient || other.gradient, ..self }
    }
}

/// The weights of a scatter, made from N and ∇N.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weights {
    /// N and ∇N with their signs.
    Signed,
    /// |N| and |∇N|.
    Magnitude,
    /// N², for the diagonal of a mass matrix. N is a product, so squaring the weights of each axis is enough.
    Square,
}

impl Weights {
    /// The function applied to every weight; `None` where weights stay unchanged.
    pub(super) fn changed(self) -> Option<fn(f64) -> f64> {
        match self {
            Self::Signed => None,
            Self::Magnitude => Some(|n| n.abs()),
            Self::Square => Some(|n| n * n),
        }
    }
}
