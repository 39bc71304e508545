//! Vectors and matrices of tensors, in Abaqus' order 11, 22, 33, 12, 13, 23.

use tangent_check::convention::Tensor;
use tangent_check::law::Step;
use tangent_check::matrix::Matrix;
use tangent_check::tensor::{IDENTITY, ZERO, determinant, inverse, product, transposed};

/// The index pairs in Abaqus' order.
pub const ORDER: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// Which line of the historical code runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    Before,
    After,
}

impl Version {
    /// The name of a law in this version.
    pub fn label(self, law: &str) -> String {
        match self {
            Self::Before => format!("{law}, before"),
            Self::After => format!("{law}, after"),
        }
    }
}

/// The components of a symmetric tensor.
pub fn vector(tensor: &Tensor) -> Vec<f64> {
    ORDER.iter().map(|&(i, j)| tensor[i][j]).collect()
}

/// The symmetric tensor of six components.
pub fn symmetric_tensor(vector: &[f64]) -> Tensor {
    let mut tensor = ZERO;
    for (&(i, j), &entry) in ORDER.iter().zip(vector) {
        (tensor[i][j], tensor[j][i]) = (entry, entry);
    }
    tensor
}

/// The 6×6 matrix of a fourth-order tensor with both minor symmetries. Its columns belong to engineering strains.
pub fn matrix(fourth: impl Fn(usize, usize, usize, usize) -> f64) -> Matrix {
    let mut matrix = Matrix::zeros(6, 6);
    for (row, &(i, j)) in ORDER.iter().enumerate() {
        for (column, &(k, l)) in ORDER.iter().enumerate() {
            matrix[(row, column)] = fourth(i, j, k, l);
        }
    }
    matrix
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

/// A step of length 1 from rest to F, with the strain increment `strain`.
pub fn step(gradient: Tensor, strain: Tensor, state: Vec<f64>) -> Step {
    Step {
        time: 0.0,
        length: 1.0,
        number: 1,
        gradient_before: IDENTITY,
        gradient,
        strain: ZERO,
        strain_increment: strain,
        rotation: IDENTITY,
        stress: vec![0.0; 6],
        state,
    }
}
