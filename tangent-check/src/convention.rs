//! Meanings of a tangent: which stress, by which strain, in which order of components.
//!
//! [`convert`] takes a tangent from one meaning to another, exactly.

mod conversion;

pub(crate) use conversion::unit_strain;
pub use conversion::{Configuration, ConversionFailed, cauchy_stress, convert, stress_vector};

use crate::listed::listed;

/// A 3×3 tensor, `t[i][j]`.
pub type Tensor = [[f64; 3]; 3];

listed! {
    /// The stress and strain that a tangent relates.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    Measure, words "The measure in words, with its symbol.":
    PiolaByGradient "∂P/∂F, first Piola–Kirchhoff stress by the deformation gradient",
    SecondPiolaByGreen "∂S/∂E, second Piola–Kirchhoff stress by the Green–Lagrange strain",
    /// Δε = ln ΔV, and ΔR is the rotation of the increment F₁ F₀⁻¹ = ΔV ΔR. The classic small-strain UMAT.
    CauchyByStrain "∂σ/∂Δε, Cauchy stress by the strain increment with its rotation frozen",
    /// Abaqus' DDSDDE for finite strain.
    JaumannKirchhoff "the Jaumann rate of the Kirchhoff stress over J",
    JaumannCauchy "the Jaumann rate of the Cauchy stress",
    /// The Oldroyd rate of the Kirchhoff stress over J, and the spatial tangent c.
    Truesdell "the Truesdell rate of the Cauchy stress",
    GreenNaghdi "the Green–Naghdi rate of the Kirchhoff stress over J",
    /// It has 6 × 9 components.
    CauchyByGradient "∂σ/∂F, Cauchy stress by the deformation gradient",
    /// It has 6 × 9 components.
    KirchhoffByGradient "∂τ/∂F, Kirchhoff stress by the deformation gradient",
}

/// The order of the components of a tensor, and the factors of its shears.
#[derive(Clone, Debug, PartialEq)]
pub struct Components {
    /// The index pairs in order: `[(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]` for Abaqus.
    pub pairs: Vec<(usize, usize)>,
    /// The factor of a shear component: 1 for stresses, 2 for engineering strains, √2 in MFront's vectors.
    pub shear: f64,
}

/// The meaning of a stress vector and of its tangent matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Convention {
    /// The stress and the strain.
    pub measure: Measure,
    /// The rows of the tangent: components of the stress.
    pub stress: Components,
    /// The columns: components of the strain or of F.
    pub strain: Components,
}

/// The orders that a symmetric tensor's components take.
const ABAQUS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
const VOIGT: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)];
const EXPLICIT: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)];

/// The factor of the shears of engineering strains.
const ENGINEERING: f64 = 2.0;

impl Measure {
    /// Whether the columns are components of F, which is not symmetric.
    pub fn by_gradient(self) -> bool {
        matches!(self, Self::PiolaByGradient | Self::CauchyByGradient | Self::KirchhoffByGradient)
    }

    /// Whether it relates a rate of the Cauchy stress to a spatial strain: one of the rates, or the small-strain tangent.
    pub(crate) fn spatial(self) -> bool {
        !self.by_gradient() && self != Self::SecondPiolaByGreen
    }

    /// The symbols of the stress and of the strain: P by F, S by E. Rates have D, the rate of deformation.
    pub fn symbols(self) -> [&'static str; 2] {
        match self {
            Self::PiolaByGradient => ["P", "F"],
            Self::SecondPiolaByGreen => ["S", "E"],
            Self::CauchyByStrain => ["σ", "ε"],
            Self::JaumannKirchhoff | Self::JaumannCauchy | Self::Truesdell | Self::GreenNaghdi => ["σ", "D"],
            Self::CauchyByGradient => ["σ", "F"],
            Self::KirchhoffByGradient => ["τ", "F"],
        }
    }
}

impl Components {
    /// Abaqus/Standard: 11, 22, 33, 12, 13, 23. The factor of the shears is 1 for stresses and 2 for engineering strains.
    pub fn abaqus(shear: f64) -> Self {
        Self { pairs: ABAQUS.to_vec(), shear }
    }

    /// Abaqus/Standard in plane strain: 11, 22, 33, 12.
    pub fn abaqus_plane(shear: f64) -> Self {
        Self { pairs: ABAQUS[..4].to_vec(), shear }
    }

    /// Voigt: 11, 22, 33, 23, 13, 12.
    pub fn voigt(shear: f64) -> Self {
        Self { pairs: VOIGT.to_vec(), shear }
    }

    /// Abaqus/Explicit: 11, 22, 33, 12, 23, 13. Its strains have no engineering shears: the factor is 1.
    pub fn explicit(shear: f64) -> Self {
        Self { pairs: EXPLICIT.to_vec(), shear }
    }

    /// MFront's vectors of stress and strain: 11, 22, 33, 12, 13, 23 with the shears times √2.
    pub fn mfront() -> Self {
        Self::abaqus(std::f64::consts::SQRT_2)
    }

    /// MFront's vectors in plane strain: 11, 22, 33, 12 with the shear times √2.
    pub fn mfront_plane() -> Self {
        Self::abaqus_plane(std::f64::consts::SQRT_2)
    }

    /// All nine components in rows: 11, 12, 13, 21, 22, 23, 31, 32, 33.
    pub fn rows() -> Self {
        Self { pairs: (0..9).map(|index| (index / 3, index % 3)).collect(), shear: 1.0 }
    }

    /// All nine components in MFront's order: 11, 22, 33, 12, 21, 13, 31, 23, 32.
    pub fn mfront_gradient() -> Self {
        let pairs = vec![(0, 0), (1, 1), (2, 2), (0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)];
        Self { pairs, shear: 1.0 }
    }

    /// The components of F in plane strain, in MFront's order: 11, 22, 33, 12, 21.
    pub fn mfront_gradient_plane() -> Self {
        Self { pairs: vec![(0, 0), (1, 1), (2, 2), (0, 1), (1, 0)], shear: 1.0 }
    }

    /// The number of components.
    pub fn count(&self) -> usize {
        self.pairs.len()
    }

    /// The names of the components: "11", "22", "33", "12", …
    pub fn names(&self) -> Vec<String> {
        self.pairs.iter().map(|(i, j)| format!("{}{}", i + 1, j + 1)).collect()
    }

    /// The names of the components of a tensor with this symbol: "σ₁₁", "σ₂₂", …
    pub fn names_of(&self, symbol: &str) -> Vec<String> {
        let index = |i: usize| ['₁', '₂', '₃'].get(i).copied().unwrap_or('?');
        self.pairs.iter().map(|(i, j)| format!("{symbol}{}{}", index(*i), index(*j))).collect()
    }

    /// Whether every component stands for an entry of a 3×3 tensor, none twice, with a factor of the shears that is not zero.
    pub fn valid(&self) -> bool {
        let in_range = self.pairs.iter().all(|(i, j)| *i < 3 && *j < 3);
        let unique = self.pairs.iter().enumerate().all(|(k, pair)| !self.pairs[..k].contains(pair));
        in_range && unique && self.shear.is_finite() && self.shear != 0.0
    }

    /// The factor of a component: that of the shears off the diagonal, otherwise 1.
    pub fn factor(&self, index: usize) -> f64 {
        let (i, j) = self.pairs[index];
        if i == j { 1.0 } else { self.shear }
    }

    /// The vector of a tensor.
    pub fn vector(&self, tensor: &Tensor) -> Vec<f64> {
        (0..self.count()).map(|k| self.factor(k) * tensor[self.pairs[k].0][self.pairs[k].1]).collect()
    }

    /// The symmetric tensor of a vector. Components that the vector does not have are zero.
    pub fn symmetric_tensor(&self, vector: &[f64]) -> Tensor {
        let mut tensor = [[0.0; 3]; 3];
        for (k, value) in vector.iter().enumerate().take(self.count()) {
            let (i, j) = self.pairs[k];
            tensor[i][j] = value / self.factor(k);
            tensor[j][i] = tensor[i][j];
        }
        tensor
    }

    /// The tensor of a vector whose components ij and ji differ. Components that the vector does not have are zero.
    pub fn full_tensor(&self, vector: &[f64]) -> Tensor {
        let mut tensor = [[0.0; 3]; 3];
        for (k, value) in vector.iter().enumerate().take(self.count()) {
            let (i, j) = self.pairs[k];
            tensor[i][j] = value / self.factor(k);
        }
        tensor
    }
}

impl Convention {
    /// A convention with Abaqus' components: stresses 11, 22, 33, 12, 13, 23 and engineering strains.
    pub fn abaqus(measure: Measure) -> Self {
        Self { measure, stress: Components::abaqus(1.0), strain: Components::abaqus(ENGINEERING) }
    }

    /// Abaqus' components in plane strain: 11, 22, 33, 12.
    pub fn abaqus_plane(measure: Measure) -> Self {
        Self { measure, stress: Components::abaqus_plane(1.0), strain: Components::abaqus_plane(ENGINEERING) }
    }

    /// ∂P/∂F with both in rows: 11, 12, 13, 21, …
    pub fn piola_in_rows() -> Self {
        Self { measure: Measure::PiolaByGradient, stress: Components::rows(), strain: Components::rows() }
    }

    /// MFront's components for a measure: symmetric tensors as vectors with √2, F with nine components.
    pub fn mfront(measure: Measure) -> Self {
        let stress = match measure {
            Measure::PiolaByGradient => Components::mfront_gradient(),
            _ => Components::mfront(),
        };
        let strain = if measure.by_gradient() { Components::mfront_gradient() } else { Components::mfront() };
        Self { measure, stress, strain }
    }

    /// Whether the law has the components of plane strain only: no shear 13 or 23.
    pub fn plane(&self) -> bool {
        self.strain.pairs.iter().all(|(i, j)| i == j || i + j == 1)
    }

    /// The convention in words, with the order of its components.
    pub fn words(&self) -> String {
        let rows = self.stress.names().join(", ");
        let columns = self.strain.names().join(", ");
        let shear = self.strain.shear;
        let shears = if self.measure.by_gradient() || shear == 1.0 {
            String::new()
        } else if shear == ENGINEERING {
            "; engineering shear strains".to_string()
        } else {
            format!("; shear strains times {shear:.6}, shear stresses times {:.6}", self.stress.shear)
        };
        format!("{}; rows {rows}; columns {columns}{shears}", self.measure.words())
    }
}
