//! A law given by its energy alone; stress and tangent come from dual numbers.

use super::{Law, MaterialState};
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector, embed, outer, symmetric};
use num_dual::Dual;

/// The strain energy of a new law. A user writes this one function.
///
/// `E` is the 3×3 Green–Lagrange strain ½(FᵀF − I), also in plane and uniaxial strain (the missing components are zero). Treat `E` as
/// symmetric. Avoid spectral functions (eigenvalues), and `sqrt` and `powf` at zero: their dual parts are wrong or NaN at E = 0. Use
/// invariants.
///
/// ```
/// use bfree::material::{Energy, FromEnergy, Law, MaterialState};
/// use bfree::scalar::Real;
/// use bfree::tensor::{Tensor, contract, trace};
///
/// struct Hooke { lambda: f64, shear: f64 }
///
/// impl Energy for Hooke {
///     fn energy<T: Real>(&self, e: &Tensor<T, 3>) -> T {
///         T::lit(0.5 * self.lambda) * trace(e) * trace(e) + T::lit(self.shear) * contract(e, e)
///     }
/// }
///
/// let law = FromEnergy(Hooke { lambda: 1.0, shear: 1.0 });
/// // Stretched to twice the length, E = (F² − 1)/2 = 3/2: W = ½ (Λ + 2G) E², S = (Λ + 2G) E.
/// let at = MaterialState::new(Tensor::<f64, 1>::from_element(1.0));
/// assert_eq!((law.energy(&at), law.stress(&at)[(0, 0)]), (0.5 * 3.0 * 1.5 * 1.5, 3.0 * 1.5));
/// ```
pub trait Energy: Send + Sync {
    /// Strain energy per unit reference volume.
    fn energy<T: Real>(&self, e: &Tensor<T, 3>) -> T;
}

/// The law whose energy is `W`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FromEnergy<W>(pub W);

/// The symmetric unit direction (e_i ⊗ e_k + e_k ⊗ e_i)/2.
fn direction<T: Real>(i: usize, k: usize) -> Tensor<T, 3> {
    symmetric(&outer(&Vector::ith(i, T::one()), &Vector::ith(k, T::one())))
}

impl<W: Energy> FromEnergy<W> {
    /// S_ik = dW(E + ε direction_ik)/dε
    fn stress_at<T: Real, const D: usize>(&self, e: &Tensor<T, 3>) -> Tensor<T, D> {
        let mut stress = Tensor::zeros();
        for i in 0..D {
            for k in i..D {
                stress[(i, k)] = self.0.energy(&e.zip_map(&direction(i, k), Dual::new)).eps;
                stress[(k, i)] = stress[(i, k)];
            }
        }
        stress
    }
}

impl<W: Energy> Law for FromEnergy<W> {
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        self.0.energy(&embed(&at.green_lagrange()))
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        self.stress_at(&embed(&at.green_lagrange()))
    }

    /// ℂ:X = dS(E + ε X)/dε
    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let e = embed(&at.green_lagrange()).zip_map(&embed(&symmetric(x)), Dual::new);
        self.stress_at::<_, D>(&e).map(|s| s.eps)
    }
}
