//! A measured derivative.

/// Derivatives that differ by more than this number of errors differ.
pub(crate) const ERRORS: f64 = 10.0;

/// An estimate with an error above this part of its greatest entry is not sharp: a kink may lie between its perturbations.
pub(super) const SHARP: f64 = 1e-7;

/// A measured derivative with the error of each component.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// The derivative; NaN where it could not be measured.
    pub value: Vec<f64>,
    /// The estimated error; infinite where the derivative could not be measured.
    pub error: Vec<f64>,
}

impl Estimate {
    /// No measurement of `size` components.
    pub(crate) fn none(size: usize) -> Self {
        Self { value: vec![f64::NAN; size], error: vec![f64::INFINITY; size] }
    }

    /// The greatest error.
    pub fn greatest_error(&self) -> f64 {
        self.error.iter().fold(0.0, |greatest, error| greatest.max(*error))
    }

    /// Whether all errors are small beside the greatest entry.
    pub(super) fn is_sharp(&self) -> bool {
        let values = self.value.iter().filter(|value| value.is_finite());
        self.greatest_error() <= SHARP * values.fold(0.0_f64, |greatest, value| greatest.max(value.abs()))
    }

    /// Whether a component differs from that of `other` by more than ten of the errors of both.
    pub(super) fn disagrees(&self, other: &Self) -> bool {
        let components = self.value.iter().zip(&self.error).zip(other.value.iter().zip(&other.error));
        components.into_iter().any(|((a, e), (b, f))| (a - b).abs() > ERRORS * (e + f))
    }
}
