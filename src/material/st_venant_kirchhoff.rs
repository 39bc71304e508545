//! St. Venant–Kirchhoff solid (the paper's appendix B.2).

use super::{FrozenTangent, Lame, Law};
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector, contract, identity, outer, scaled, symmetric, trace};

/// W = Λ/2 (tr E)² + G E:E. Softens in compression; for moderate strains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StVenantKirchhoff {
    /// Λ and G.
    pub lame: Lame,
}

/// Λ tr(X) I + 2G X for a symmetric X: S from E, and ℂ:X.
#[inline(always)]
fn hooke<T: Real, const D: usize>(lambda: T, shear: T, x: &Tensor<T, D>) -> Tensor<T, D> {
    scaled(&identity(), lambda * trace(x)) + scaled(x, T::lit(2.0) * shear)
}

impl Law for StVenantKirchhoff {
    type Frozen<T: Real, const D: usize> = FrozenStVenantKirchhoff<T, D>;

    #[inline(always)]
    fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> T {
        let e = at.green_lagrange();
        T::lit(0.5 * self.lame.lambda) * trace(&e) * trace(&e) + T::lit(self.lame.shear) * contract(&e, &e)
    }

    /// S = Λ tr(E) I + 2G E
    #[inline(always)]
    fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> Tensor<T, D> {
        hooke(T::lit(self.lame.lambda), T::lit(self.lame.shear), &at.green_lagrange())
    }

    /// ℂ:X = Λ tr(X) I + 2G sym X   (B9, with 2G)
    #[inline(always)]
    fn elasticity<T: Real, const D: usize>(&self, _at: &Deformation<T, D>, x: &Tensor<T, D>) -> Tensor<T, D> {
        hooke(T::lit(self.lame.lambda), T::lit(self.lame.shear), &symmetric(x))
    }

    /// ℂmat{v,b} = Λ v⊗b + G (v·b) I + G b⊗v
    #[inline(always)]
    fn tangent_density<T: Real, const D: usize>(
        &self,
        _at: &Deformation<T, D>,
        v: &Vector<T, D>,
        b: &Vector<T, D>,
    ) -> Tensor<T, D> {
        let shear = T::lit(self.lame.shear);
        scaled(&outer(v, b), T::lit(self.lame.lambda))
            + scaled(&identity(), shear * v.dot(b))
            + scaled(&outer(b, v), shear)
    }

    fn freeze<T: Real, const D: usize>(
        &self,
        f_n: &Tensor<T, D>,
        at: &Deformation<T, D>,
        volume: T,
    ) -> FrozenStVenantKirchhoff<T, D> {
        FrozenStVenantKirchhoff {
            f_n: *f_n,
            f: at.f,
            stress: scaled(&self.stress(at), volume),
            lambda: T::lit(self.lame.lambda) * volume,
            shear: T::lit(self.lame.shear) * volume,
        }
    }
}

/// F_n, F and V₀ times S, Λ and G.
#[derive(Clone, Copy, Debug)]
pub struct FrozenStVenantKirchhoff<T: Real, const D: usize> {
    f_n: Tensor<T, D>,
    f: Tensor<T, D>,
    stress: Tensor<T, D>,
    lambda: T,
    shear: T,
}

impl<T: Real, const D: usize> FrozenTangent<T, D> for FrozenStVenantKirchhoff<T, D> {
    #[inline(always)]
    fn apply(&self, l: &Tensor<T, D>) -> Tensor<T, D> {
        let delta_f = l * self.f_n;
        let delta_s = hooke(self.lambda, self.shear, &symmetric(&(self.f.transpose() * delta_f)));
        (delta_f * self.stress + self.f * delta_s) * self.f_n.transpose()
    }

    #[inline(always)]
    fn block(&self, grad_i: &Vector<T, D>, grad_j: &Vector<T, D>) -> Tensor<T, D> {
        let (v, b) = (self.f_n.transpose() * grad_i, self.f_n.transpose() * grad_j);
        let (fv, fb) = (self.f * v, self.f * b);
        scaled(&outer(&fv, &fb), self.lambda)
            + scaled(&(self.f * self.f.transpose()), self.shear * v.dot(&b))
            + scaled(&outer(&fb, &fv), self.shear)
            + scaled(&identity(), v.dot(&(self.stress * b)))
    }
}
