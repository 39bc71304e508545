//! The laws of stories, and vectors and matrices of tensors in Abaqus' order 11, 22, 33, 12, 13, 23.

use std::fmt::Debug;
use tangent_check::convention::{Components, Convention, Measure, Tensor};
use tangent_check::law::{CallFailed, Law, Response, Step};
use tangent_check::matrix::Matrix;
use tangent_check::tensor::{IDENTITY, determinant, inverse, product, transposed};

/// The index pairs in Abaqus' order.
pub const ORDER: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// Which line of the historical code runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    Before,
    After,
}

/// The law of a story. Its versions are those of one line, or of one number.
pub struct Story<V = Version> {
    pub law: &'static str,
    pub measure: Measure,
    /// The internal variables at rest.
    pub rest: fn() -> Vec<f64>,
    pub respond: fn(V, &Step) -> Response,
}

/// A law of a story in one of its versions.
pub struct Told<'a, V = Version>(pub &'a Story<V>, pub V);

impl<V: Copy + Debug> Law for Told<'_, V> {
    fn name(&self) -> String {
        format!("{}, {:?}", self.0.law, self.1)
    }

    fn convention(&self) -> Convention {
        Convention::abaqus(self.0.measure)
    }

    fn state_at_rest(&self) -> Vec<f64> {
        (self.0.rest)()
    }

    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        Ok((self.0.respond)(self.1, step))
    }
}

/// The components of a symmetric tensor.
pub fn vector(tensor: &Tensor) -> Vec<f64> {
    Components::abaqus(1.0).vector(tensor)
}

/// The symmetric tensor of six components.
pub fn symmetric_tensor(vector: &[f64]) -> Tensor {
    Components::abaqus(1.0).symmetric_tensor(vector)
}

/// The 6×6 matrix of a fourth-order tensor with both minor symmetries. Its columns belong to engineering strains.
pub fn matrix(fourth: impl Fn(usize, usize, usize, usize) -> f64) -> Matrix {
    Matrix::from_entries(6, 6, |row, column| {
        let ((i, j), (k, l)) = (ORDER[row], ORDER[column]);
        fourth(i, j, k, l)
    })
}

/// δᵢⱼ.
pub fn delta(i: usize, j: usize) -> f64 {
    IDENTITY[i][j]
}

/// (A ⊙ A)ᵢⱼₖₗ = ½ (Aᵢₖ Aⱼₗ + Aᵢₗ Aⱼₖ).
pub fn square(a: &Tensor, [i, j, k, l]: [usize; 4]) -> f64 {
    0.5 * (a[i][k] * a[j][l] + a[i][l] * a[j][k])
}

/// ½ (δᵢₖ σⱼₗ + σᵢₖ δⱼₗ + δᵢₗ σⱼₖ + σᵢₗ δⱼₖ): what the Jaumann rate adds to the spatial tangent c.
pub fn rotation_term(stress: &Tensor, [i, j, k, l]: [usize; 4]) -> f64 {
    0.5 * (delta(i, k) * stress[j][l]
        + stress[i][k] * delta(j, l)
        + delta(i, l) * stress[j][k]
        + stress[i][l] * delta(j, k))
}

/// Fibres in tension: g = a E exp(b E²) and h = dg/dE = a (1 + 2b E²) exp(b E²); zero in compression.
pub fn tension(stiffness: f64, exponent: f64, strain: f64) -> (f64, f64) {
    if strain <= 0.0 {
        return (0.0, 0.0);
    }
    let growth = stiffness * (exponent * strain * strain).exp();
    (growth * strain, growth * (1.0 + 2.0 * exponent * strain * strain))
}

/// A : B.
pub fn double_dot(a: &Tensor, b: &Tensor) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
}

/// C = Fᵀ F, C⁻¹ and J; NaN where F is singular.
pub struct RightCauchyGreen {
    pub c: Tensor,
    pub inverse: Tensor,
    pub jacobian: f64,
}

impl RightCauchyGreen {
    pub fn new(gradient: &Tensor) -> Self {
        Self::from_c(product(&transposed(gradient), gradient))
    }

    pub fn from_c(c: Tensor) -> Self {
        Self { c, inverse: inverse(&c).unwrap_or([[f64::NAN; 3]; 3]), jacobian: determinant(&c).sqrt() }
    }
}
