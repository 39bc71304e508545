//! Hencky's elasticity: the logarithmic strain ε = ½ ln b of b = F C_i⁻¹ Fᵀ, and S and ℂ of isotropic laws in ε.
//!
//! C_i is the inelastic (plastic or viscous) right Cauchy–Green tensor, and I before any flow. It belongs to the reference
//! configuration, so rotations of the body do not change it. A step that flows by Δε multiplies b by e^{−2Δε}, in the same axes: the
//! exponential map (Weber and Anand, 1990; Simo, 1992). All tensors are in three dimensions, and the missing stretches of F are 1.

use super::spectral::{Function, Hencky, artanh_over, function, principal_axes};
use super::{Lame, TangentBlocks};
use crate::scalar::Real;
use crate::tensor::{
    Deformation, SYMMETRIC, Tensor, Vector, contract, cut, embed, identity, outer, scaled, symmetric, trace,
};

/// A symmetric tensor from six numbers. Missing numbers are zero.
fn six(numbers: &[f64]) -> Tensor<f64, 3> {
    let mut a = Tensor::zeros();
    for (&(i, k), &x) in SYMMETRIC.iter().zip(numbers) {
        (a[(i, k)], a[(k, i)]) = (x, x);
    }
    a
}

/// ½ (b − I) = ½ (H + Hᵀ + H Hᵀ + F (C_i⁻¹ − I) Fᵀ), with no digit lost at small strain, from the six numbers of C_i⁻¹ − I.
fn half_b_less_one<T: Real>(at: &Deformation<T, 3>, inverse_inelastic: &[f64]) -> Tensor<T, 3> {
    let inelastic = six(inverse_inelastic).map(T::lit);
    let elastic = at.h + at.h.transpose() + at.h * at.h.transpose();
    scaled(&(elastic + at.f * inelastic * at.f.transpose()), T::lit(0.5))
}

/// The strain ε of a state, split into tr ε and dev ε.
pub(super) struct Strained<T: Real> {
    at: Deformation<T, 3>,
    /// tr ε, the logarithm of the elastic volume ratio.
    pub volume: T,
    /// dev ε
    pub deviator: Tensor<T, 3>,
}

impl<T: Real> Strained<T> {
    /// From F and the six numbers of C_i⁻¹ − I. An empty list means C_i = I.
    pub(crate) fn new<const D: usize>(at: &Deformation<T, D>, inverse_inelastic: &[f64]) -> Self {
        let at = Deformation::new(embed(&at.h));
        let strain = function(&Hencky, &half_b_less_one(&at, inverse_inelastic));
        let volume = trace(&strain);
        Self { at, volume, deviator: strain - scaled(&identity(), volume * T::lit(1.0 / 3.0)) }
    }

    /// dev ε : dev ε
    pub(crate) fn square(&self) -> T {
        contract(&self.deviator, &self.deviator)
    }

    /// ‖dev ε‖. Where it is zero, its derivatives are taken as zero.
    pub(crate) fn norm(&self) -> T {
        let square = self.square();
        if square.value() > 0.0 { square.sqrt() } else { T::zero() }
    }

    /// S = F⁻¹ τ F⁻ᵀ of τ = p I + g dev ε
    pub(crate) fn stress<const D: usize>(&self, p: T, g: T) -> Tensor<T, D> {
        self.pulled_back(&(scaled(&identity(), p) + scaled(&self.deviator, g)))
    }

    /// F⁻¹ τ F⁻ᵀ
    pub(crate) fn pulled_back<const D: usize>(&self, tau: &Tensor<T, 3>) -> Tensor<T, D> {
        let f_inv_t = self.at.inverse_transpose();
        cut(&(f_inv_t.transpose() * tau * f_inv_t))
    }

    /// ε
    pub(crate) fn strain(&self) -> Tensor<T, 3> {
        self.deviator + scaled(&identity(), self.volume * T::lit(1.0 / 3.0))
    }

    /// f(ε)
    pub(crate) fn function(&self, f: &impl Function) -> Tensor<T, 3> {
        function(f, &self.strain())
    }
}

/// A state in the principal axes of b.
pub(super) struct Principal {
    at: Deformation<f64, 3>,
    /// Eigenvectors of b, in columns.
    axes: Tensor<f64, 3>,
    /// Eigenvalues of ½ (b − I).
    x: [f64; 3],
    /// The principal strains εᵢ.
    pub strains: [f64; 3],
}

impl Principal {
    /// From the arguments of [`Strained::new`].
    pub(crate) fn new<const D: usize>(at: &Deformation<f64, D>, inverse_inelastic: &[f64]) -> Self {
        let at = Deformation::new(embed(&at.h));
        let half = half_b_less_one(&at, inverse_inelastic);
        let axes = principal_axes(&half);
        let turned = axes.transpose() * half * axes;
        let x: [f64; 3] = std::array::from_fn(|i| turned[(i, i)]);
        Self { at, axes, x, strains: x.map(|x| Hencky.value(x)) }
    }

    /// tr ε
    pub(crate) fn volume(&self) -> f64 {
        self.strains[0] + self.strains[1] + self.strains[2]
    }

    /// The principal values of dev ε.
    pub(crate) fn deviator(&self) -> [f64; 3] {
        let mean = self.volume() * (1.0 / 3.0);
        self.strains.map(|strain| strain - mean)
    }

    /// ‖dev ε‖
    pub(crate) fn norm(&self) -> f64 {
        let [a, b, c] = self.deviator();
        (a * a + b * b + c * c).sqrt()
    }

    /// ℂ in these axes, from the principal Kirchhoff stresses `tau`, their derivatives ∂τᵢ/∂εⱼ, and the secants (τᵢ − τⱼ)/(εᵢ − εⱼ).
    ///
    /// With L = sym(F⁻ᵀ X F⁻¹), δb = L b + b L makes δεᵢⱼ = (Δ coth Δ) Lᵢⱼ with Δ = εᵢ − εⱼ, so that
    /// F (ℂ:X) Fᵀ = δτ − L τ − τ L is Σⱼ ∂τᵢ/∂εⱼ Lⱼⱼ − 2τᵢ Lᵢᵢ on the diagonal, and [(τᵢ − τⱼ) coth Δ − τᵢ − τⱼ] Lᵢⱼ off it.
    pub(crate) fn moduli(&self, tau: [f64; 3], slopes: Tensor<f64, 3>, secant: impl Fn(usize, usize) -> f64) -> Moduli {
        let mut normal = slopes;
        let mut shear = Tensor::zeros();
        for i in 0..3 {
            normal[(i, i)] -= tau[i] + tau[i];
            for j in (0..3).filter(|&j| j != i) {
                shear[(i, j)] = secant(i, j) * artanh_over(self.x[i], self.x[j]) - tau[i] - tau[j];
                mutant!("laws: Δ for Δ coth Δ in the moduli": { shear[(i, j)] = secant(i, j) - tau[i] - tau[j]; });
            }
        }
        Moduli { f_inv_t: self.at.inverse_transpose(), axes: self.axes, normal, shear }
    }

    /// [`Self::moduli`] for τ = p I + g dev ε, where p and t = g d depend on v = tr ε and d = ‖dev ε‖ alone.
    pub(crate) fn radial_moduli(&self, radial: &Radial<f64>) -> Moduli {
        let Radial { p, g, p_v, p_d, t_v, t_d } = *radial;
        let (deviator, d) = (self.deviator(), self.norm());
        let n = deviator.map(|x| if d > 0.0 { x / d } else { 0.0 });
        let slopes = Tensor::from_fn(|i, j| {
            let turned = if i == j { g } else { 0.0 } - g * (1.0 / 3.0);
            p_v + p_d * n[j] + n[i] * (t_v + (t_d - g) * n[j]) + turned
        });
        self.moduli(deviator.map(|x| p + g * x), slopes, |_, _| g)
    }

    /// Writes the six numbers of C_i⁻¹ − I after a flow with the principal strains `flow`: C_i⁻¹ grows by F⁻¹ [b e^{−2Δε} − b] F⁻ᵀ.
    pub(crate) fn flow(&self, flow: [f64; 3], inverse_inelastic: &[f64], next: &mut [f64]) {
        mutant!("laws: plastic flow of half the size": flow = flow.map(|flow| 0.5 * flow));
        let lost = Tensor::from_diagonal(&Vector::from_fn(|i, _| (1.0 + 2.0 * self.x[i]) * (-2.0 * flow[i]).exp_m1()));
        let back = self.at.inverse_transpose().transpose() * self.axes;
        let after = six(inverse_inelastic) + back * lost * back.transpose();
        next.iter_mut().zip(SYMMETRIC).for_each(|(next, (i, k))| *next = 0.5 * (after[(i, k)] + after[(k, i)]));
    }
}

/// A Kirchhoff stress τ = p I + g dev ε, and the derivatives of p and t = g d with respect to v = tr ε and d = ‖dev ε‖.
#[derive(Clone, Copy, Debug)]
pub struct Radial<T> {
    /// p, positive in tension.
    pub p: T,
    /// g. It is 2G where nothing flows.
    pub g: T,
    /// ∂p/∂v
    pub p_v: T,
    /// ∂p/∂d
    pub p_d: T,
    /// ∂t/∂v
    pub t_v: T,
    /// ∂t/∂d
    pub t_d: T,
}

impl<T: Real> Radial<T> {
    /// Hooke's law in ε: p = K v, g = 2G.
    pub(crate) fn elastic(solid: &Lame, v: T) -> Self {
        let (bulk, twice_shear) = (T::lit(solid.bulk_modulus()), T::lit(2.0 * solid.shear));
        Self { p: bulk * v, g: twice_shear, p_v: bulk, p_d: T::zero(), t_v: T::zero(), t_d: twice_shear }
    }
}

/// ℂ in the principal axes of b.
pub(super) struct Moduli {
    f_inv_t: Tensor<f64, 3>,
    axes: Tensor<f64, 3>,
    normal: Tensor<f64, 3>,
    shear: Tensor<f64, 3>,
}

impl Moduli {
    /// δτ − L τ − τ L, both in the axes.
    fn response(&self, l: &Tensor<f64, 3>) -> Tensor<f64, 3> {
        let mut z = l.component_mul(&self.shear);
        for i in 0..3 {
            for j in 0..3 {
                z[(i, i)] += self.normal[(i, j)] * l[(j, j)];
            }
        }
        z
    }

    /// ℂ:X
    pub(crate) fn elasticity<const D: usize>(&self, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        let back = self.axes.transpose() * self.f_inv_t;
        let l = back * embed(&symmetric(x)) * back.transpose();
        cut(&(back.transpose() * self.response(&l) * back))
    }

    /// Adds F ℂmat{F_rᵀe_k, F_rᵀe_l} Fᵀ of all pairs k, l. Column j is F (ℂ:X) Fᵀ a_k with F⁻ᵀ X F⁻¹ = e_j ⊗ a_l and a = F⁻ᵀ F_rᵀ e.
    pub(crate) fn add_blocks<const D: usize>(&self, f_r: &Tensor<f64, D>, blocks: &mut TangentBlocks<D>) {
        let f_r: Tensor<f64, 3> = Tensor::from_fn(|i, k| if i < D && k < D { f_r[(i, k)] } else { f64::from(i == k) });
        let a = self.axes.transpose() * self.f_inv_t * f_r.transpose();
        for j in 0..D {
            let e_j: Vector<f64, 3> = self.axes.row(j).transpose();
            for l in 0..D {
                let stress = self.response(&symmetric(&outer(&e_j, &a.column(l).into_owned())));
                let stress = self.axes * stress;
                for (k, blocks) in blocks.iter_mut().enumerate() {
                    let column = stress * a.column(k);
                    (0..D).for_each(|i| blocks[l][(i, j)] += column[i]);
                }
            }
        }
    }
}
