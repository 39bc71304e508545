//! Dual numbers a + b ε with ε² = 0, and 3×3 tensors of them.

use std::ops::{Add, Div, Mul, Neg, Sub};
use tangent_check::convention::Tensor;
use tangent_check::tensor;

/// A value and its derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual(pub f64, pub f64);

impl Add for Dual {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        Self(self.0 + b.0, self.1 + b.1)
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        Self(self.0 - b.0, self.1 - b.1)
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        Self(self.0 * b.0, self.0 * b.1 + self.1 * b.0)
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, b: Self) -> Self {
        let value = self.0 / b.0;
        Self(value, (self.1 - value * b.1) / b.0)
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl Mul<f64> for Dual {
    type Output = Self;
    fn mul(self, b: f64) -> Self {
        Self(self.0 * b, self.1 * b)
    }
}

impl Dual {
    pub fn new(value: f64) -> Self {
        Self(value, 0.0)
    }
    pub fn ln(self) -> Self {
        Self(self.0.ln(), self.1 / self.0)
    }
    pub fn exp(self) -> Self {
        Self(self.0.exp(), self.1 * self.0.exp())
    }
    pub fn sqrt(self) -> Self {
        Self(self.0.sqrt(), 0.5 * self.1 / self.0.sqrt())
    }
    pub fn powf(self, p: f64) -> Self {
        Self(self.0.powf(p), p * self.0.powf(p - 1.0) * self.1)
    }
}

/// A 3×3 tensor of dual numbers.
pub type D3 = [[Dual; 3]; 3];

pub fn of(entry: impl Fn(usize, usize) -> Dual) -> D3 {
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// A + ε B.
pub fn dual(a: &Tensor, b: &Tensor) -> D3 {
    of(|i, j| Dual(a[i][j], b[i][j]))
}

pub fn constant(a: &Tensor) -> D3 {
    dual(a, &tensor::ZERO)
}

pub fn unit() -> D3 {
    constant(&tensor::IDENTITY)
}

pub fn value(a: &D3) -> Tensor {
    tensor::from_entries(|i, j| a[i][j].0)
}

pub fn slope(a: &D3) -> Tensor {
    tensor::from_entries(|i, j| a[i][j].1)
}

pub fn mul(a: &D3, b: &D3) -> D3 {
    of(|i, j| a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j])
}

pub fn t(a: &D3) -> D3 {
    of(|i, j| a[j][i])
}

pub fn add(a: &D3, b: &D3) -> D3 {
    of(|i, j| a[i][j] + b[i][j])
}

pub fn sub(a: &D3, b: &D3) -> D3 {
    of(|i, j| a[i][j] - b[i][j])
}

pub fn times(s: Dual, a: &D3) -> D3 {
    of(|i, j| s * a[i][j])
}

pub fn tr(a: &D3) -> Dual {
    a[0][0] + a[1][1] + a[2][2]
}

pub fn dev(a: &D3) -> D3 {
    sub(a, &times(tr(a) * super::right::literal(1.0 / 3.0), &unit()))
}

/// √(A : A).
pub fn size(a: &D3) -> Dual {
    let square = a.iter().flatten().fold(Dual::new(0.0), |sum, entry| sum + *entry * *entry);
    if square.0 == 0.0 { Dual::new(0.0) } else { square.sqrt() }
}

fn cofactor(a: &D3) -> D3 {
    of(|i, j| {
        let [p, q, r, s] = [(i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3];
        a[p][r] * a[q][s] - a[p][s] * a[q][r]
    })
}

pub fn det(a: &D3) -> Dual {
    let c = cofactor(a);
    a[0][0] * c[0][0] + a[0][1] * c[0][1] + a[0][2] * c[0][2]
}

pub fn inv(a: &D3) -> D3 {
    times(Dual::new(1.0) / det(a), &t(&cofactor(a)))
}

/// f(A) of a symmetric tensor, with its derivative by divided differences (Daleckii and Krein).
fn isotropic(a: &D3, f: impl Fn(f64) -> f64, divided: impl Fn(f64, f64) -> f64) -> D3 {
    let (values, axes) = tensor::eigenvalues(&value(a));
    let rate = tensor::product3(&tensor::transposed(&axes), &slope(a), &axes);
    let rate = tensor::from_entries(|i, j| divided(values[i], values[j]) * rate[i][j]);
    let real = tensor::from_entries(|i, j| (0..3).map(|k| axes[i][k] * f(values[k]) * axes[j][k]).sum());
    dual(&real, &tensor::product3(&axes, &rate, &tensor::transposed(&axes)))
}

pub fn log(a: &D3) -> D3 {
    let divided = |a: f64, b: f64| {
        let x = (a - b) / b;
        if x.abs() < 1e-12 { 1.0 / b } else { x.ln_1p() / x / b }
    };
    isotropic(a, f64::ln, divided)
}

pub fn exp(a: &D3) -> D3 {
    let divided = |a: f64, b: f64| if (a - b).abs() < 1e-12 { b.exp() } else { b.exp() * (a - b).exp_m1() / (a - b) };
    isotropic(a, f64::exp, divided)
}

/// Aᵖ.
pub fn power(a: &D3, p: f64) -> D3 {
    let divided = |a: f64, b: f64| {
        let x = (a - b) / b;
        if x.abs() < 1e-12 { p * b.powf(p - 1.0) } else { b.powf(p) * (p * x.ln_1p()).exp_m1() / (a - b) }
    };
    isotropic(a, |x| x.powf(p), divided)
}
