//! The frozen tangent of a law that has no closed form for it.

use super::{FrozenTangent, Law};
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector, identity, outer, scaled};

/// F_n, F and V₀ times S and the full ℂ: for laws that have nothing better.
#[derive(Clone, Debug)]
pub struct FrozenGeneral<T: Real, const D: usize> {
    f_n: Tensor<T, D>,
    f: Tensor<T, D>,
    stress: Tensor<T, D>,
    /// `elasticity[i][k]` = V₀ ℂ:(e_i ⊗ e_k)
    elasticity: [[Tensor<T, D>; D]; D],
}

impl<T: Real, const D: usize> FrozenGeneral<T, D> {
    /// From the law's stress and `ℂ:X` at one state; the arguments are those of [`Law::freeze`].
    ///
    /// ```
    /// use bfree::material::{FrozenGeneral, FrozenTangent, Lame, Law, NeoHookean};
    /// use bfree::tensor::{Deformation, Tensor, identity};
    ///
    /// // From stress and ℂ alone it has what the law's own closed form has.
    /// let law = NeoHookean::ciarlet(Lame::new(1.0, 1.0)?);
    /// let at = Deformation::<f64, 2>::new(Tensor::<f64, 2>::new(0.3, 0.1, -0.2, 0.1));
    /// let general = FrozenGeneral::new(&law, &identity(), &at, 1.0);
    /// let (closed, l) = (law.freeze(&identity(), &at, 1.0), Tensor::<f64, 2>::new(1.0, 2.0, 3.0, 4.0));
    /// assert!((general.apply(&l) - closed.apply(&l)).norm() < 1e-14 && general.closed().is_none());
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    pub fn new<L: Law>(law: &L, f_n: &Tensor<T, D>, at: &Deformation<T, D>, volume: T) -> Self {
        let unit = |i, k| Tensor::from_fn(|r, c| if (r, c) == (i, k) { T::one() } else { T::zero() });
        let elasticity =
            std::array::from_fn(|i| std::array::from_fn(|k| scaled(&law.elasticity(at, &unit(i, k)), volume)));
        Self { f_n: *f_n, f: at.f, stress: scaled(&law.stress(at), volume), elasticity }
    }

    /// V₀ ℂ:X
    #[inline(always)]
    fn elasticity(&self, x: &Tensor<T, D>) -> Tensor<T, D> {
        let mut sum = Tensor::zeros();
        for i in 0..D {
            for k in 0..D {
                sum += scaled(&self.elasticity[i][k], x[(i, k)]);
            }
        }
        sum
    }
}

impl<T: Real, const D: usize> FrozenTangent<T, D> for FrozenGeneral<T, D> {
    #[inline(always)]
    fn apply(&self, l: &Tensor<T, D>) -> Tensor<T, D> {
        let delta_f = l * self.f_n;
        let delta_s = self.elasticity(&(self.f.transpose() * delta_f));
        (delta_f * self.stress + self.f * delta_s) * self.f_n.transpose()
    }

    /// F ℂmat{v,b} Fᵀ, column by column: ℂmat{v,b} e_k = [ℂ:(e_k ⊗ b)] v
    fn block(&self, grad_i: &Vector<T, D>, grad_j: &Vector<T, D>) -> Tensor<T, D> {
        let (v, b) = (self.f_n.transpose() * grad_i, self.f_n.transpose() * grad_j);
        let mut density: Tensor<T, D> = Tensor::zeros();
        for k in 0..D {
            let e_k = Vector::from_fn(|i, _| if i == k { T::one() } else { T::zero() });
            density.set_column(k, &(self.elasticity(&outer(&e_k, &b)) * v));
        }
        self.f * density * self.f.transpose() + scaled(&identity(), v.dot(&(self.stress * b)))
    }
}
