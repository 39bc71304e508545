//! Exact conversions of tangents.
//!
//! Every measure says how the Cauchy stress changes with the velocity gradient L = Ḟ F⁻¹ = D + W:
//!
//! | measure | σ̇ |
//! |---|---|
//! | Jaumann rate of Kirchhoff's stress over J | C:D + W σ − σ W − σ tr D |
//! | Jaumann rate of Cauchy's stress | C:D + W σ − σ W |
//! | Truesdell | C:D + L σ + σ Lᵀ − σ tr D |
//! | Green–Naghdi rate of Kirchhoff's stress over J | C:D + Ω σ − σ Ω − σ tr D, Ω = Ṙ Rᵀ |
//! | ∂S/∂E | J⁻¹ F (C:Ė) Fᵀ + L σ + σ Lᵀ − σ tr D, Ė = Fᵀ D F |
//! | ∂P/∂F | J⁻¹ (A:Ḟ) Fᵀ + σ Lᵀ − σ tr D |
//! | ∂σ/∂F | A:Ḟ |
//! | ∂τ/∂F | J⁻¹ A:Ḟ − σ tr D |
//! | ∂σ/∂Δε | C:(ΔR (ln ΔU)˙ ΔRᵀ) + ω σ − σ ω, ω = ΔṘ ΔRᵀ |
//!
//! The spin of a rotation R of F = V R, in the axes of V with stretches λ: Ω_ij = W_ij + (λ_j − λ_i)/(λ_j + λ_i) D_ij.
//! The rate of ln U there: (R (ln U)˙ Rᵀ)_ij = g_ij D_ij with g_ij = y/sinh y, y = ln(λ_i/λ_j).
//! The last line of the table holds for an isotropic law whose tensors at the start of the step turn with ΔR.
//! A tangent is converted column by column: a strain of the target gives L, the source gives σ̇, and the target takes its rate from σ̇.

use super::{Components, Convention, Measure, Tensor};
use crate::matrix::Matrix;
use crate::tensor::{
    commutator, determinant, eigenvalues, finite, from_entries, inverse, norm, polar, product, product3, scaled, skew,
    sum, symmetric, trace, transposed,
};
use std::fmt;

/// The place of a tangent: deformation and Cauchy stress.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// F₀ at the start of the step. Only ∂σ/∂Δε needs it.
    pub gradient_before: Tensor,
    /// F₁ at the end of the step.
    pub gradient: Tensor,
    /// The Cauchy stress σ at the end of the step.
    pub stress: Tensor,
}

/// A conversion that is impossible: a sentence that says why.
#[derive(Clone, Debug, PartialEq)]
pub struct ConversionFailed(pub String);

impl fmt::Display for ConversionFailed {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl std::error::Error for ConversionFailed {}

/// The tangent in another convention, exact to round-off.
///
/// # Errors
/// The matrix does not fit the components of `from`; `to` asks for a component that `from` lacks; det F ≤ 0 or F is not finite.
pub fn convert(
    tangent: &Matrix,
    from: &Convention,
    to: &Convention,
    at: &Configuration,
) -> Result<Matrix, ConversionFailed> {
    let source = Source::new(tangent, from, to)?;
    let from_place = Place::new(at, from.measure)?;
    let to_place = Place::new(at, to.measure)?;
    let column = |column: usize| {
        let velocity = to_place.velocity(to.measure, &unit_strain(to, column));
        let strain_rate = from_place.strain_rate(from.measure, &velocity);
        let rate = source.rate(&strain_rate)?;
        let cauchy_rate = from_place.cauchy_rate(from.measure, &velocity, &rate);
        Ok(to.stress.vector(&to_place.stress_rate(to.measure, &velocity, &cauchy_rate)))
    };
    let columns: Vec<Vec<f64>> = (0..to.strain.count()).map(column).collect::<Result<_, _>>()?;
    Ok(Matrix::from_columns(to.stress.count(), &columns))
}

/// The strain whose component `column` is 1 and whose other components are 0.
pub(crate) fn unit_strain(convention: &Convention, column: usize) -> Tensor {
    let mut vector = vec![0.0; convention.strain.count()];
    vector[column] = 1.0;
    if convention.measure.by_gradient() {
        convention.strain.full_tensor(&vector)
    } else {
        convention.strain.symmetric_tensor(&vector)
    }
}

/// A tangent with its components, checked.
struct Source<'a> {
    tangent: &'a Matrix,
    convention: &'a Convention,
}

impl<'a> Source<'a> {
    fn new(tangent: &'a Matrix, from: &'a Convention, to: &Convention) -> Result<Self, ConversionFailed> {
        let [rows, columns] = [from.stress.count(), from.strain.count()];
        if ![&from.stress, &from.strain, &to.stress, &to.strain].into_iter().all(Components::valid) {
            return Err(ConversionFailed("A convention names a component twice or outside of 11 to 33.".to_string()));
        }
        if (tangent.rows, tangent.columns) != (rows, columns) || tangent.entries.len() != rows * columns {
            let size = format!("{} × {}", tangent.rows, tangent.columns);
            return Err(ConversionFailed(format!(
                "The tangent has {size} entries, but its convention {rows} × {columns}."
            )));
        }
        let symmetric = from.measure != Measure::PiolaByGradient;
        let missing = to.stress.pairs.iter().find(|(i, j)| {
            let given = &from.stress.pairs;
            !(given.contains(&(*i, *j)) || symmetric && given.contains(&(*j, *i)))
        });
        match missing {
            Some((i, j)) => Err(ConversionFailed(format!("The tangent has no row for the stress {}{}.", i + 1, j + 1))),
            None => Ok(Self { tangent, convention: from }),
        }
    }

    /// The tangent times a strain rate, as a tensor.
    fn rate(&self, strain_rate: &Tensor) -> Result<Tensor, ConversionFailed> {
        let strain = &self.convention.strain;
        let vector = strain.vector(strain_rate);
        let by_gradient = self.convention.measure.by_gradient();
        let represented = if by_gradient { strain.full_tensor(&vector) } else { strain.symmetric_tensor(&vector) };
        let lost = norm(&sum(strain_rate, -1.0, &represented));
        if lost > 1e-12 * norm(strain_rate) {
            let text = "The tangent has no column for a strain that the other convention needs (out of plane?).";
            return Err(ConversionFailed(text.to_string()));
        }
        let rate = self.tangent.times(&vector);
        let stress = &self.convention.stress;
        Ok(if self.convention.measure == Measure::PiolaByGradient {
            stress.full_tensor(&rate)
        } else {
            stress.symmetric_tensor(&rate)
        })
    }
}

/// The deformation, the stress, and the axes that a measure needs.
pub(crate) struct Place {
    gradient: Tensor,
    inverse: Tensor,
    jacobian: f64,
    stress: Tensor,
    /// The stretches of F (Green–Naghdi) or of the increment (∂σ/∂Δε), and their axes.
    stretches: ([f64; 3], Tensor),
}

impl Place {
    pub(crate) fn new(at: &Configuration, measure: Measure) -> Result<Self, ConversionFailed> {
        let jacobian = determinant(&at.gradient);
        let failed = || ConversionFailed(format!("det F = {jacobian}, but it must be positive and finite."));
        let inverse_gradient = inverse(&at.gradient).filter(|_| jacobian > 0.0).ok_or_else(failed)?;
        if !finite(&at.stress) {
            return Err(ConversionFailed("The Cauchy stress is not finite.".to_string()));
        }
        let stretches = match measure {
            Measure::GreenNaghdi => stretches(&at.gradient).ok_or_else(failed)?,
            Measure::CauchyByStrain => {
                let before = inverse(&at.gradient_before).ok_or_else(failed)?;
                stretches(&product(&at.gradient, &before)).ok_or_else(failed)?
            }
            _ => ([1.0; 3], crate::tensor::IDENTITY),
        };
        Ok(Self { gradient: at.gradient, inverse: inverse_gradient, jacobian, stress: at.stress, stretches })
    }

    /// The velocity gradient L of a strain rate in this measure.
    fn velocity(&self, measure: Measure, strain: &Tensor) -> Tensor {
        match measure {
            Measure::PiolaByGradient | Measure::CauchyByGradient | Measure::KirchhoffByGradient => {
                product(strain, &self.inverse)
            }
            // D = F⁻ᵀ Ė F⁻¹
            Measure::SecondPiolaByGreen => product3(&transposed(&self.inverse), strain, &self.inverse),
            // D_ij = (ln U)˙_ij/g_ij, and W so that the rotation rests.
            Measure::CauchyByStrain => {
                let rate = self.in_axes(strain, |y| 1.0 / logarithm_factor(y));
                sum(&rate, -1.0, &self.in_axes(&rate, spin_factor))
            }
            _ => *strain,
        }
    }

    /// The strain rate of this measure at a velocity gradient.
    fn strain_rate(&self, measure: Measure, velocity: &Tensor) -> Tensor {
        let rate = symmetric(velocity);
        match measure {
            Measure::PiolaByGradient | Measure::CauchyByGradient | Measure::KirchhoffByGradient => {
                product(velocity, &self.gradient)
            }
            Measure::SecondPiolaByGreen => product3(&transposed(&self.gradient), &rate, &self.gradient),
            Measure::CauchyByStrain => self.in_axes(&rate, logarithm_factor),
            _ => rate,
        }
    }

    /// σ̇ of the rate of this measure.
    fn cauchy_rate(&self, measure: Measure, velocity: &Tensor, rate: &Tensor) -> Tensor {
        let stress_rate = match measure {
            Measure::SecondPiolaByGreen => product3(&self.gradient, rate, &transposed(&self.gradient)),
            Measure::PiolaByGradient => product(rate, &transposed(&self.gradient)),
            _ => *rate,
        };
        let factor = if self.over_jacobian(measure) { 1.0 / self.jacobian } else { 1.0 };
        sum(&self.convected(measure, velocity), factor, &stress_rate)
    }

    /// The rate of this measure, of σ̇.
    fn stress_rate(&self, measure: Measure, velocity: &Tensor, cauchy_rate: &Tensor) -> Tensor {
        let factor = if self.over_jacobian(measure) { self.jacobian } else { 1.0 };
        let rate = scaled(factor, &sum(cauchy_rate, -1.0, &self.convected(measure, velocity)));
        match measure {
            Measure::SecondPiolaByGreen => product3(&self.inverse, &rate, &transposed(&self.inverse)),
            Measure::PiolaByGradient => product(&rate, &transposed(&self.inverse)),
            _ => rate,
        }
    }

    /// Whether the stress of this measure is a Kirchhoff stress, J times as great as Cauchy's.
    fn over_jacobian(&self, measure: Measure) -> bool {
        matches!(measure, Measure::SecondPiolaByGreen | Measure::PiolaByGradient | Measure::KirchhoffByGradient)
    }

    /// The part of σ̇ that is there without a rate of this measure: the stress, convected by L, W, Ω or ω.
    fn convected(&self, measure: Measure, velocity: &Tensor) -> Tensor {
        let stress = &self.stress;
        let dilation = scaled(-trace(velocity), stress);
        match measure {
            Measure::JaumannKirchhoff => sum(&dilation, 1.0, &commutator(&skew(velocity), stress)),
            Measure::JaumannCauchy => commutator(&skew(velocity), stress),
            Measure::Truesdell | Measure::SecondPiolaByGreen => {
                let left = product(velocity, stress);
                sum(&dilation, 2.0, &symmetric(&left))
            }
            Measure::GreenNaghdi => sum(&dilation, 1.0, &commutator(&self.spin(velocity), stress)),
            Measure::CauchyByStrain => commutator(&self.spin(velocity), stress),
            Measure::PiolaByGradient => sum(&dilation, 1.0, &product(stress, &transposed(velocity))),
            Measure::KirchhoffByGradient => dilation,
            Measure::CauchyByGradient => crate::tensor::ZERO,
        }
    }

    /// The spin of the rotation: Ω_ij = W_ij + (λ_j − λ_i)/(λ_j + λ_i) D_ij.
    fn spin(&self, velocity: &Tensor) -> Tensor {
        sum(&skew(velocity), 1.0, &self.in_axes(&symmetric(velocity), spin_factor))
    }

    /// A tensor whose components in the axes of the stretches are multiplied by f(ln(λ_i/λ_j)).
    fn in_axes(&self, tensor: &Tensor, factor: impl Fn(f64) -> f64) -> Tensor {
        let (values, axes) = &self.stretches;
        let inside = product3(&transposed(axes), tensor, axes);
        let inside = from_entries(|i, j| factor((values[i] / values[j]).ln()) * inside[i][j]);
        product3(axes, &inside, &transposed(axes))
    }
}

/// The stretches of F and the axes of V.
fn stretches(gradient: &Tensor) -> Option<([f64; 3], Tensor)> {
    let (_, stretch) = polar(gradient)?;
    let (values, axes) = eigenvalues(&stretch);
    values.iter().all(|value| *value > 0.0).then_some((values, axes))
}

/// (λ_j − λ_i)/(λ_j + λ_i) = −tanh(y/2), y = ln(λ_i/λ_j).
fn spin_factor(y: f64) -> f64 {
    -(0.5 * y).tanh()
}

/// y/sinh y.
fn logarithm_factor(y: f64) -> f64 {
    if y.abs() < 1e-4 { 1.0 / (1.0 + y * y / 6.0) } else { y / y.sinh() }
}

/// The Cauchy stress of a law's stress vector: σ = J⁻¹ P Fᵀ = J⁻¹ F S Fᵀ = J⁻¹ τ.
///
/// # Errors
/// The vector does not fit the convention, or det F ≤ 0.
pub fn cauchy_stress(convention: &Convention, stress: &[f64], gradient: &Tensor) -> Result<Tensor, ConversionFailed> {
    let jacobian = positive_determinant(gradient)?;
    if stress.len() != convention.stress.count() || !convention.stress.valid() {
        let [given, expected] = [stress.len(), convention.stress.count()];
        return Err(ConversionFailed(format!("The stress has {given} components, but its convention {expected}.")));
    }
    let symmetric = convention.stress.symmetric_tensor(stress);
    Ok(match convention.measure {
        Measure::PiolaByGradient => {
            let piola = convention.stress.full_tensor(stress);
            scaled(1.0 / jacobian, &product(&piola, &transposed(gradient)))
        }
        Measure::SecondPiolaByGreen => scaled(1.0 / jacobian, &product3(gradient, &symmetric, &transposed(gradient))),
        Measure::KirchhoffByGradient => scaled(1.0 / jacobian, &symmetric),
        _ => symmetric,
    })
}

/// The stress vector of a convention, of a Cauchy stress: P = J σ F⁻ᵀ, S = J F⁻¹ σ F⁻ᵀ, τ = J σ or σ.
///
/// # Errors
/// det F ≤ 0.
pub fn stress_vector(
    convention: &Convention,
    cauchy: &Tensor,
    gradient: &Tensor,
) -> Result<Vec<f64>, ConversionFailed> {
    let jacobian = positive_determinant(gradient)?;
    let inverse = inverse(gradient).unwrap_or([[f64::NAN; 3]; 3]);
    let stress = match convention.measure {
        Measure::PiolaByGradient => scaled(jacobian, &product(cauchy, &transposed(&inverse))),
        Measure::SecondPiolaByGreen => scaled(jacobian, &product3(&inverse, cauchy, &transposed(&inverse))),
        Measure::KirchhoffByGradient => scaled(jacobian, cauchy),
        _ => *cauchy,
    };
    Ok(convention.stress.vector(&stress))
}

/// det F.
fn positive_determinant(gradient: &Tensor) -> Result<f64, ConversionFailed> {
    let jacobian = determinant(gradient);
    if jacobian > 0.0 && jacobian.is_finite() {
        Ok(jacobian)
    } else {
        Err(ConversionFailed(format!("det F = {jacobian}, but it must be positive and finite.")))
    }
}
