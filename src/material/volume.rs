//! The response of a law to a change of volume alone, and the volumetric energies of the shipped laws.

use crate::scalar::Real;
use crate::tensor::Deformation;

/// The part U(θ) of the energy per reference volume that depends on the volume ratio θ alone, and its derivatives with respect to ln θ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeResponse<T> {
    /// U
    pub energy: T,
    /// θ U', the mean Kirchhoff stress.
    pub stress: T,
    /// θ (θ U')'
    pub stiffness: T,
}

/// The volumetric energy U(J) of a solid, for a given Λ. It is a type, so that a loop over particles does not branch on it.
pub(crate) trait Volumetric: Copy + Default + Send + Sync + 'static {
    /// U for Λ = `lambda`.
    fn energy<T: Real, const D: usize>(lambda: f64, at: &Deformation<T, D>) -> T;

    /// J U'(J) for Λ = `lambda`.
    fn stress<T: Real, const D: usize>(lambda: f64, at: &Deformation<T, D>) -> T;

    /// J (J U')' for Λ = `lambda`.
    fn stiffness<T: Real, const D: usize>(lambda: f64, at: &Deformation<T, D>) -> T;

    /// U and its derivatives for Λ = `lambda`.
    fn response<T: Real>(lambda: f64, at: &Deformation<T, 1>) -> VolumeResponse<T> {
        VolumeResponse {
            energy: Self::energy(lambda, at),
            stress: Self::stress(lambda, at),
            stiffness: Self::stiffness(lambda, at),
        }
    }
}

/// Ciarlet: Λ/4 (J²−1) − Λ/2 ln J, the paper's law (appendix B.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ciarlet;

impl Volumetric for Ciarlet {
    /// Λ/2 [½ j² + (j − ln J)]
    #[inline(always)]
    fn energy<T: Real, const D: usize>(lambda: f64, at: &Deformation<T, D>) -> T {
        T::lit(0.5 * lambda) * (T::lit(0.5) * at.j * at.j + at.j_minus_log_jacobian())
    }

    /// Λ/2 (J²−1)
    #[inline(always)]
    fn stress<T: Real, const D: usize>(lambda: f64, at: &Deformation<T, D>) -> T {
        T::lit(0.5) * T::lit(lambda) * at.jacobian_squared_minus_one()
    }

    /// ΛJ²
    #[inline(always)]
    fn stiffness<T: Real, const D: usize>(lambda: f64, at: &Deformation<T, D>) -> T {
        mutant!("laws: J for J² in the bulk stiffness": { return T::lit(lambda) * at.jacobian; });
        T::lit(lambda) * at.jacobian * at.jacobian
    }
}

/// Λ/2 (ln J)², the law most other programs ship.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Logarithmic;

impl Volumetric for Logarithmic {
    /// Λ/2 (ln J)²
    #[inline(always)]
    fn energy<T: Real, const D: usize>(lambda: f64, at: &Deformation<T, D>) -> T {
        T::lit(0.5 * lambda) * (at.log_jacobian() * at.log_jacobian())
    }

    /// Λ ln J
    #[inline(always)]
    fn stress<T: Real, const D: usize>(lambda: f64, at: &Deformation<T, D>) -> T {
        T::lit(lambda) * at.log_jacobian()
    }

    /// Λ
    #[inline(always)]
    fn stiffness<T: Real, const D: usize>(lambda: f64, _at: &Deformation<T, D>) -> T {
        T::lit(lambda)
    }
}
