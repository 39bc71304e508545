//! The deformations at which every law is tried.

use crate::random::Random;
use bfree::tensor::{Tensor, determinant, identity, inverse};

/// A family of deformations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Regime {
    /// F = I + 1e-8
    Small,
    /// Stretches and shears of some tenths.
    Moderate,
    /// Rotated by more than 2 radians, and moderately strained.
    Rotation,
    /// J = 0.05
    Crushed,
    /// J = 20
    Swollen,
    /// Moderate shape changes at nearly constant volume, for laws with ν = 0.499999.
    Isochoric,
}

impl Regime {
    /// The regimes that suit any law.
    pub const GENERAL: [Self; 5] = [Self::Small, Self::Moderate, Self::Rotation, Self::Crushed, Self::Swollen];

    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Small => "F=I+1e-8",
            Self::Moderate => "moderate",
            Self::Rotation => "rotation",
            Self::Crushed => "J=0.05",
            Self::Swollen => "J=20",
            Self::Isochoric => "nu=0.499999",
        }
    }

    /// Whether it exists in `dimension` dimensions: there is no rotation in one.
    pub fn exists(self, dimension: usize) -> bool {
        dimension > 1 || self != Self::Rotation
    }

    /// Size of a further small deformation within the regime.
    pub fn increment(self) -> f64 {
        match self {
            Self::Small => 1e-8,
            Self::Isochoric => 1e-3,
            _ => 0.02,
        }
    }

    /// H = F − I of one random deformation.
    pub fn displacement_gradient<const D: usize>(self, random: &mut Random) -> Tensor<f64, D> {
        match self {
            Self::Small => random.tensor() * 1e-8,
            Self::Moderate => strained(random) - identity::<f64, D>(),
            Self::Rotation => rotation(random) * strained(random) - identity::<f64, D>(),
            Self::Crushed => of_volume(0.05, random),
            Self::Swollen => of_volume(20.0, random),
            Self::Isochoric => {
                let jacobian = 1.0 + 1e-3 * random.signed();
                of_volume(jacobian, random)
            }
        }
    }
}

/// I + 0.3 X, X random: J lies between 0.1 and 2.2.
fn strained<const D: usize>(random: &mut Random) -> Tensor<f64, D> {
    identity::<f64, D>() + random.tensor() * (0.6 / (D as f64 + 1.0))
}

/// A deformation of the given J, with a random rotation.
fn of_volume<const D: usize>(jacobian: f64, random: &mut Random) -> Tensor<f64, D> {
    let f = rotation::<D>(random) * strained(random);
    f * (jacobian / determinant(&f)).powf(1.0 / D as f64) - identity::<f64, D>()
}

/// A rotation by 2 to 3 radians: Cayley's transform (I − A)⁻¹(I + A) of a skew A with |A| = tan(θ/2).
pub(crate) fn rotation<const D: usize>(random: &mut Random) -> Tensor<f64, D> {
    let half_tangent = (0.5 * random.between(2.0, 3.0)).tan();
    let any = random.tensor::<D>();
    let skew = any - any.transpose();
    let length = (0.5 * skew.norm_squared()).sqrt();
    if length == 0.0 {
        return identity();
    }
    let a = skew * (half_tangent / length);
    inverse(&(identity::<f64, D>() - a)) * (identity::<f64, D>() + a)
}

/// κ(F) = ‖F‖ ‖F⁻¹‖ / 3 in Frobenius norms: 1 for a rotation, never more than the condition number in the spectral norm.
///
/// F is the 3×3 tensor: uniaxial strain of 20 is diag(20, 1, 1), whose condition differs from that of the number 20.
pub(crate) fn condition<const D: usize>(f: &Tensor<f64, D>) -> f64 {
    let missing = (3 - D) as f64;
    ((f.norm_squared() + missing) * (inverse(f).norm_squared() + missing)).sqrt() / 3.0
}

/// The bound for every derivative: min(64 eps κ(F)², 1e-10).
pub(crate) fn round_off(condition: f64) -> f64 {
    (64.0 * f64::EPSILON * condition * condition).min(1e-10)
}
