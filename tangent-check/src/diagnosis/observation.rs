//! A checked state, as a diagnosis sees it.

use crate::convention::{Components, Configuration, Convention, Tensor};
use crate::matrix::Matrix;
use crate::tensor::{IDENTITY, determinant, norm, polar, product, sum, transposed};

/// A candidate agrees within this many errors of the measurement.
pub(super) const AGREEMENT: f64 = 60.0;
/// A deviation that is to be explained exceeds this many errors somewhere; below it, every small change would explain it.
pub(super) const VISIBLE: f64 = 600.0;
/// Measured tangents with greater errors than this, relative to their greatest entry, take no part.
const USABLE: f64 = 1e-6;
/// A tangent of the same law elsewhere, which may stand in place of the right one by mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elsewhere {
    /// At the end of the step before.
    StepBefore,
    /// In the same state without plastic or viscous flow.
    Elastic,
    /// In the same state, with flow in a step of length zero.
    Continuum,
    /// At the start of the step, without flow.
    StartOfStep,
    /// At rest, without strain.
    AtRest,
    /// In a state whose strain differs by a multiple of I, the same in all states.
    Heated,
}

/// A measured tangent.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The entries.
    pub tangent: Matrix,
    /// The estimated error of each.
    pub errors: Matrix,
}

/// A checked state.
#[derive(Clone, Debug)]
pub struct Observation {
    /// The name of the state.
    pub name: String,
    /// F₀, F₁ and the Cauchy stress.
    pub at: Configuration,
    /// ΔR.
    pub rotation: Tensor,
    /// The tangent as claimed.
    pub claimed: Matrix,
    /// The right tangent, by differences.
    pub measured: Measured,
    /// Right tangents of the same law elsewhere, where they were measured.
    pub elsewhere: Vec<(Elsewhere, Measured)>,
}

impl Measured {
    /// The greatest error; infinite if an entry or error is not finite or there is none.
    pub fn error(&self) -> f64 {
        let entries = &self.tangent.entries;
        let finite = entries.iter().chain(&self.errors.entries).all(|entry| entry.is_finite());
        if !finite || entries.is_empty() || self.errors.entries.len() != entries.len() {
            return f64::INFINITY;
        }
        // The measurement is no better than the rounding of its greatest entry.
        self.errors.greatest().max(f64::EPSILON * self.tangent.greatest())
    }
}

impl Observation {
    /// The tangent of this law elsewhere.
    pub fn elsewhere(&self, kind: Elsewhere) -> Option<&Measured> {
        self.elsewhere.iter().find(|(found, _)| *found == kind).map(|(_, measured)| measured)
    }

    /// Whether claimed and measured tangents fit the convention and are accurate enough to tell mistakes.
    pub fn usable(&self, convention: &Convention) -> bool {
        let size = |matrix: &Matrix| {
            let [rows, columns] = [convention.stress.count(), convention.strain.count()];
            (matrix.rows, matrix.columns, matrix.entries.len()) == (rows, columns, rows * columns)
        };
        size(&self.claimed)
            && size(&self.measured.tangent)
            && self.claimed.entries.iter().all(|entry| entry.is_finite())
            && self.measured.error() <= USABLE * self.measured.tangent.greatest()
            && self.measured.tangent.greatest() > 0.0
    }

    /// Whether F is rotated, J is not 1, and no axis of strain is aligned.
    pub fn general(&self, plane: bool) -> bool {
        let stretch = product(&self.at.gradient, &transposed(&self.at.gradient));
        let shears = [stretch[0][1], stretch[0][2], stretch[1][2]];
        let sheared = shears.iter().take(if plane { 1 } else { 3 }).all(|shear| shear.abs() > 1e-3);
        let turned = |(rotation, _)| norm(&sum(&rotation, -1.0, &IDENTITY)) > 1e-2;
        let volume = (determinant(&self.at.gradient) - 1.0).abs() > 1e-3;
        sheared && volume && polar(&self.at.gradient).is_some_and(turned)
    }
}

/// The greatest |A − B|; infinite if an entry is not finite.
pub(super) fn distance(a: &Matrix, b: &Matrix) -> f64 {
    let distance = |(a, b): (&f64, &f64)| if (a - b).is_finite() { (a - b).abs() } else { f64::INFINITY };
    a.entries.iter().zip(&b.entries).map(distance).fold(0.0, f64::max)
}

/// Whether a component is a shear.
pub(super) fn is_shear(components: &Components, index: usize) -> bool {
    let (i, j) = components.pairs[index];
    i != j
}
