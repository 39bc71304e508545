//! The mean stress of a step, a discrete gradient of the strain energy, for the energy–momentum scheme.
//!
//! ```text
//! P̄ = F_½ S̄,  S̄ : ΔE = W_{n+1} − W_n,  ΔE = E_{n+1} − E_n = sym(F_½ᵀ ΔF),  F_½ = ½ (F_n + F_{n+1})
//! ```
//!
//! Then the work of the stress, P̄ : ΔF = S̄ : ΔE, is the change of the strain energy; and P̄ F_½ᵀ is symmetric, so no angular momentum is
//! lost. A rigid rotation has ΔE = 0 and keeps its stress. With s_i and w_i of Gauss,
//!
//! ```text
//! S̄ = S_G + c ΔE,  S_G = Σ w_i S(E_n + s_i ΔE),  c = (W_{n+1} − W_n − S_G : ΔE)/(ΔE : ΔE)
//! ```
//!
//! Gonzalez (Comput. Methods Appl. Mech. Eng. 190, 2000) has one point. His c has no digits left for small ΔE. With three points the quadrature
//! of a smooth law is then exact to round-off, and c is left out. A law without a potential has no c.
//!
//! The unknown is H_½. With δE_{n+1} = sym(F_{n+1}ᵀ δF_{n+1}) and δF_{n+1} = 2 δF_½,
//!
//! ```text
//! δP̄ = δF_½ S̄ + F_½ (δS_G + δc ΔE + c δE_{n+1}),  δS_G = Σ w_i s_i ℂ_i : δE_{n+1}
//! δc = [(S_{n+1} − S_G − 2c ΔE) : δE_{n+1} − δS_G : ΔE]/(ΔE : ΔE)
//! ```
//!
//! F_½ on the left and F_{n+1} on the right differ, so the tangent is not symmetric.

use crate::material::{InternalVariable, Law, MaterialState, TangentBlocks, VolumeResponse};
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector, contract, identity, outer, scaled, symmetric};

/// Gauss points s in [0, 1] and their weights. The integral of a polynomial of degree 5 is exact.
pub(in crate::mechanics) const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_31, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// The error of W and of S_G : ΔE by round-off, relative to their magnitudes.
pub(in crate::mechanics) const ROUND_OFF: f64 = 16.0 * f64::EPSILON;

/// A law whose stress at H_½ is the mean stress S̄ of the step from H_n. W and the internal variables are those of the law.
///
/// Where cells average the dilatation, W lacks its volumetric part U(J), which [`DilatationOfStep`](crate::mechanics::terms) gives cell by cell.
pub(super) struct DiscreteGradient<'a, L> {
    pub law: &'a L,
    /// Whether W lacks U(J).
    pub averages: bool,
    /// The rows of H_n; the first D·D numbers are used.
    pub start: &'a [f64; 9],
}

impl<L: Law> DiscreteGradient<'_, L> {
    /// H_n, of the number type.
    fn start<T: Real, const D: usize>(&self) -> Tensor<T, D> {
        Tensor::from_fn(|i, k| T::lit(self.start[i * D + k]))
    }

    /// ΔE
    fn growth<T: Real, const D: usize>(&self, middle: &MaterialState<'_, T, D>) -> Tensor<T, D> {
        let half = symmetric(&(middle.f.transpose() * (middle.h - self.start::<T, D>())));
        mutant!("discrete gradient: ΔE is that of half the step": { return half; });
        scaled(&half, T::lit(2.0))
    }

    /// The state with the strain E_n + s ΔE. It has no rotation, which S does not feel. A law with a potential takes the same time, half the
    /// step, at all points, so that W is one function; any other law sees the rate of the step.
    fn state<'s, T: Real, const D: usize>(&self, middle: &MaterialState<'s, T, D>, s: f64) -> MaterialState<'s, T, D> {
        let strain = Deformation::new(self.start::<T, D>()).green_lagrange();
        let dt = if self.law.has_potential() { middle.dt } else { 2.0 * s * middle.dt };
        middle.deformed(stretch(&(strain + scaled(&self.growth(middle), T::lit(s))))).in_step(dt, middle.internal)
    }

    /// U at J, if W lacks it.
    fn volumetric<T: Real, const D: usize>(&self, at: &MaterialState<'_, T, D>) -> Option<VolumeResponse<T>> {
        let along = || Deformation::new(Tensor::<T, 1>::from_element(at.j));
        if self.averages { self.law.volumetric(&along()) } else { None }
    }

    /// W, and the magnitude of its parts.
    fn density<T: Real, const D: usize>(&self, at: &MaterialState<'_, T, D>) -> (T, f64) {
        let (whole, volumetric) = (self.law.energy(at), self.volumetric(at).map_or(T::zero(), |of| of.energy));
        (whole - volumetric, whole.value().abs() + volumetric.value().abs())
    }

    /// ∂W/∂E, with ∂U/∂E = J U' C⁻¹.
    fn gradient<T: Real, const D: usize>(&self, at: &MaterialState<'_, T, D>) -> Tensor<T, D> {
        let stress = self.law.stress(at);
        self.volumetric(at).map_or(stress, |of| stress - scaled(&inverse_strain(at), of.stress))
    }

    /// ∂²W/∂E² : X for a symmetric X.
    fn stiffness<const D: usize>(&self, at: &MaterialState<'_, f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let stiffness = self.law.elasticity(at, x);
        self.volumetric(at).map_or(stiffness, |of| {
            let inverse = inverse_strain(at);
            stiffness - inverse * (of.stiffness * contract(&inverse, x)) + inverse * x * inverse * (2.0 * of.stress)
        })
    }

    /// S_G
    fn integral<T: Real, const D: usize>(&self, middle: &MaterialState<'_, T, D>) -> Tensor<T, D> {
        let stress = |(s, weight)| scaled(&self.gradient(&self.state(middle, s)), T::lit(weight));
        GAUSS.into_iter().map(stress).fold(Tensor::zeros(), |sum, stress| sum + stress)
    }

    /// c, from S_G; `None` where it is zero to round-off.
    fn correction<T: Real, const D: usize>(
        &self,
        middle: &MaterialState<'_, T, D>,
        integral: &Tensor<T, D>,
    ) -> Option<T> {
        if !self.law.has_potential() {
            return None;
        }
        let growth = self.growth(middle);
        let work = contract(integral, &growth);
        let [before, after] = [0.0, 1.0].map(|s| self.density(&self.state(middle, s)));
        let missing = after.0 - before.0 - work;
        let mut size = before.1 + after.1 + work.value().abs();
        // A plastic law has its elastic strain from C and the plastic strain, which cancel.
        if !self.law.internal_variables().is_empty() {
            let stretched = contract(&middle.f, &middle.f).value();
            size += contract(integral, integral).value().sqrt() * stretched;
        }
        mutant!("discrete gradient: Gauss's formula is not corrected": { return None; });
        (missing.value().abs() > ROUND_OFF * size).then(|| missing / contract(&growth, &growth))
    }
}

/// C⁻¹
fn inverse_strain<T: Real, const D: usize>(at: &MaterialState<'_, T, D>) -> Tensor<T, D> {
    let inverse = at.inverse_transpose();
    inverse.transpose() * inverse
}

/// The upper triangular H with (I + H)ᵀ(I + H) = I + 2E, by Cholesky's method. A small E loses no digits.
fn stretch<T: Real, const D: usize>(strain: &Tensor<T, D>) -> Tensor<T, D> {
    let mut h = Tensor::<T, D>::zeros();
    for k in 0..D {
        for i in 0..=k {
            // 2 E_ik − Σ_{j<i} R_ji R_jk; the sum never reaches a diagonal entry of R.
            let rest = (0..i).fold(strain[(i, k)] * T::lit(2.0), |rest, j| rest - h[(j, i)] * h[(j, k)]);
            h[(i, k)] = if i < k {
                rest / (T::one() + h[(i, i)])
            } else {
                // √(1 + x) − 1
                rest / (T::one() + (T::one() + rest).sqrt())
            };
        }
    }
    h
}

impl<L: Law> Law for DiscreteGradient<'_, L> {
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        self.law.energy(at)
    }

    /// S̄
    fn stress<T: Real, const D: usize>(&self, middle: &MaterialState<T, D>) -> Tensor<T, D> {
        let integral = self.integral(middle);
        match self.correction(middle, &integral) {
            None => integral,
            Some(c) => integral + scaled(&self.growth(middle), c),
        }
    }

    /// F_½ δS̄ F_rᵀ e_k in column j of the block (k, l), with δF_½ = e_j ⊗ F_rᵀ e_l.
    fn tangent_blocks<const D: usize>(&self, f_r: &Tensor<f64, D>, middle: &MaterialState<f64, D>) -> TangentBlocks<D> {
        // Σ w_i s_i ℂ_i : sym(e_p ⊗ e_q) for p ≤ q
        let mut stiffness = [[Tensor::<f64, D>::zeros(); D]; D];
        for (s, weight) in GAUSS {
            let (at, share) = (self.state(middle, s), weight * s);
            mutant!("discrete gradient: all points move like the middle": share = 0.5 * weight);
            for q in 0..D {
                for p in 0..=q {
                    stiffness[p][q] += self.stiffness(&at, &symmetric(&outer(&unit(p), &unit(q)))) * share;
                }
            }
        }
        let (growth, integral) = (self.growth(middle), self.integral(middle));
        let corrected = self.correction(middle, &integral);
        let slope = corrected.map(|c| self.gradient(&self.state(middle, 1.0)) - integral - growth * (2.0 * c));
        let end = identity::<f64, D>() + middle.h * 2.0 - self.start::<f64, D>();
        mutant!("discrete gradient: the tangent has F of the middle on both sides": end = middle.f);
        let mut blocks: TangentBlocks<D> = [[Tensor::zeros(); D]; D];
        for l in 0..D {
            for j in 0..D {
                let strain = symmetric(&outer(&end.row(j).transpose(), &f_r.row(l).transpose())) * 2.0;
                let mut stress = Tensor::<f64, D>::zeros();
                for q in 0..D {
                    for p in 0..=q {
                        let both = if p < q { 2.0 } else { 1.0 };
                        stress += stiffness[p][q] * (both * strain[(p, q)]);
                    }
                }
                if let (Some(c), Some(slope)) = (corrected, slope) {
                    let change = (slope.dot(&strain) - stress.dot(&growth)) / growth.norm_squared();
                    stress += growth * change + strain * c;
                }
                for (k, row) in blocks.iter_mut().enumerate() {
                    row[l].set_column(j, &(middle.f * stress * f_r.row(k).transpose()));
                }
            }
        }
        blocks
    }

    fn internal_variables(&self) -> &[InternalVariable] {
        self.law.internal_variables()
    }

    fn is_symmetric(&self) -> bool {
        false
    }

    fn has_potential(&self) -> bool {
        false
    }
}

/// e_k
fn unit<const D: usize>(k: usize) -> Vector<f64, D> {
    Vector::from_fn(|i, _| f64::from(i == k))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Lame, Material};
    use crate::tensor::inverse;

    /// S̄ of a step between two deformations, and ΔE.
    fn mean(law: &Material, from: &Tensor<f64, 3>, to: &Tensor<f64, 3>) -> (Tensor<f64, 3>, Tensor<f64, 3>) {
        let rows: [f64; 9] = std::array::from_fn(|n| from[(n / 3, n % 3)]);
        let mean = DiscreteGradient { law, averages: false, start: &rows };
        let middle = MaterialState::new((from + to) * 0.5);
        (mean.stress(&middle), mean.growth(&middle))
    }

    fn elastic() -> Vec<(&'static str, Material)> {
        let lame = Lame { lambda: 2.0, shear: 1.0 };
        Material::examples(lame).into_iter().filter(|(_, law)| law.internal_variables().is_empty()).collect()
    }

    /// H of a start, and of an end that is far from it.
    fn ends() -> [Tensor<f64, 3>; 2] {
        [
            Tensor::<f64, 3>::new(0.2, 0.1, 0.0, -0.3, 0.1, 0.2, 0.1, 0.0, -0.1),
            Tensor::<f64, 3>::new(-0.2, 0.3, 0.1, 0.2, 0.4, -0.1, 0.0, -0.3, 0.2),
        ]
    }

    #[test]
    fn the_work_of_the_mean_stress_is_the_change_of_the_energy() {
        let [from, to] = ends();
        for (name, law) in elastic() {
            // In small steps the energies lose digits, so that the work per |ΔE| is compared.
            for part in [1.0, 0.1, 0.01, 1e-3] {
                let to = from + (to - from) * part;
                let (stress, growth) = mean(&law, &from, &to);
                let [before, after] = [from, to].map(|h| law.energy(&MaterialState::new(h)));
                let error = (contract(&stress, &growth) - (after - before)).abs() / growth.norm();
                assert!(error < 1e-14 / part.min(1e-2), "{name}, {part}: {error:e}");
            }
        }
    }

    #[test]
    fn a_rotation_and_a_tiny_step_keep_the_stress() {
        let [from, to] = ends();
        let (sin, cos) = 2f64.sin_cos();
        let turn = Tensor::<f64, 3>::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        let turned = turn * (identity() + from) - identity();
        for (name, law) in elastic() {
            let at_start = law.stress(&MaterialState::new(from));
            for to in [turned, from + (to - from) * 1e-13] {
                let (stress, _) = mean(&law, &from, &to);
                assert!((stress - at_start).norm() < 1e-11 * at_start.norm(), "{name}: {stress} for {at_start}");
            }
        }
    }

    #[test]
    fn a_small_strain_is_kept_beside_the_identity() {
        let strain = Tensor::<f64, 3>::new(1e-20, 3e-21, 0.0, 3e-21, -2e-20, 1e-21, 0.0, 1e-21, 4e-20);
        let small = stretch(&strain);
        assert!((symmetric(&small) - strain).norm() < 1e-15 * strain.norm());
        let [h, _] = ends();
        let at = Deformation::new(h);
        let r = identity::<f64, 3>() + stretch(&at.green_lagrange());
        assert!((r.transpose() * r - at.f.transpose() * at.f).norm() < 1e-15);
        // R = Qᵀ F with a rotation Q.
        let q = at.f * inverse(&r);
        assert!((q.transpose() * q - identity::<f64, 3>()).norm() < 1e-14);
    }
}
