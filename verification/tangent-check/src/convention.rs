//! Meanings of a tangent: which stress, by which strain, in which order of components.

/// A 3×3 tensor, `t[i][j]`.
pub type Tensor = [[f64; 3]; 3];

/// The stress and strain that a tangent relates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// ∂P/∂F: first Piola–Kirchhoff stress by the deformation gradient, 9 components each.
    PiolaByGradient,
    /// ∂S/∂E: second Piola–Kirchhoff stress by the Green–Lagrange strain.
    SecondPiolaByGreen,
    /// ∂σ/∂Δε: Cauchy stress by the strain increment, with the rotation frozen; the classic small-strain UMAT.
    CauchyByStrain,
    /// The Jaumann rate of the Kirchhoff stress over J: Abaqus' DDSDDE for finite strain.
    JaumannKirchhoff,
    /// The Jaumann rate of the Cauchy stress.
    JaumannCauchy,
    /// The Truesdell rate of the Cauchy stress, which is the Oldroyd rate of the Kirchhoff stress over J: the spatial tangent c.
    Truesdell,
    /// The Green–Naghdi rate of the Kirchhoff stress over J.
    GreenNaghdi,
    /// ∂σ/∂F: Cauchy stress by the deformation gradient, 6 × 9 components.
    CauchyByGradient,
    /// ∂τ/∂F: Kirchhoff stress by the deformation gradient, 6 × 9 components.
    KirchhoffByGradient,
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
