//! A mistake, which turns a right tangent into a wrong one. The list of all mistakes is in `list.rs`.

use super::observation::{Elsewhere, Measured, Observation, is_shear};
use crate::convention::{Configuration, Convention, Measure, Tensor, convert, unit_strain};
use crate::matrix::Matrix;
use crate::tensor::{ZERO, determinant, polar, product3, transposed};

/// A mistake that may explain a wrong tangent.
pub(super) struct Candidate {
    mistake: Mistake,
    /// The mistake in a few words: "shear components 13 and 23 exchanged in rows".
    pub name: String,
    /// A sentence about a tangent with this mistake.
    pub sentence: String,
    shows_in: &'static str,
}

pub(super) enum Mistake {
    /// Row r is that of another component, `rows[r]`; so for the columns.
    Reordered {
        rows: Vec<usize>,
        columns: Vec<usize>,
    },
    /// Shear rows and columns are multiplied by factors.
    ShearFactors {
        rows: f64,
        columns: f64,
    },
    /// Entries in both a shear row and a shear column are multiplied.
    ShearBlock(f64),
    Transposed,
    Symmetrised,
    /// The entries on this side of the diagonal are copies of those on the other.
    Copied(Side),
    /// The block of these kinds of components, normal or shear, is transposed within itself.
    BlockTransposed {
        shear: bool,
    },
    /// All entries are cut to whole numbers.
    WholeNumbers,
    /// In axes that are turned by the rotation R of F or by ΔR, or back.
    Turned {
        increment: bool,
        back: bool,
    },
    /// The term by which two rates differ, too much.
    RateTerm([Measure; 2]),
    /// Multiplied by Jⁿ.
    VolumeRatio(i32),
    Sign,
    /// The part with the stress is missing: the tangent belongs to c = 0 subtracted.
    NoGeometricPart,
    /// The numbers are those of another measure.
    OtherMeasure(Measure),
    /// The tangent is built from the numbers of another rate, taken for the Truesdell rate.
    TakenForTruesdell(Measure),
    /// The tangent of another rate times sym(dF F⁻¹), without the spin's part.
    WithoutSpin(Measure),
    Elsewhere(Elsewhere),
}

/// A side of the diagonal.
pub(super) enum Side {
    Below,
    Above,
}

/// The beginning of all sentences.
pub(super) const YOURS: &str = "Your tangent is ";

/// The round-off of an entry that is cut to a whole number.
const ROUND_OFF: f64 = 1e-9;

/// States in which most mistakes show.
pub(super) const GENERAL: &str = "general strains along no axis";
/// In general states, isotropic linear elasticity still hides wrong orders and factors.
const OTHER_LAW: &str = "an anisotropic or nonlinear law";

impl Candidate {
    /// A mistake whose tangent is the right one with something: "Your tangent is the right one with {name}."
    pub(super) fn new(mistake: Mistake, name: &str, shows_in: &'static str) -> Self {
        let sentence = format!("{YOURS}the right one with {name}.");
        Self { mistake, name: name.to_string(), sentence, shows_in }
    }

    /// A mistake whose tangent is another one: "Your tangent is {name}."
    pub(super) fn other(mistake: Mistake, name: &str, shows_in: &'static str) -> Self {
        Self { mistake, name: name.to_string(), sentence: format!("{YOURS}{name}."), shows_in }
    }

    /// States or laws in which the mistake shows. `general` says whether the states are general already.
    pub(super) fn shows_in(&self, general: bool) -> &'static str {
        if general && self.shows_in == GENERAL { OTHER_LAW } else { self.shows_in }
    }

    /// The right tangent with this mistake; `None` if it cannot be applied in this state.
    pub(super) fn applied(&self, convention: &Convention, observation: &Observation) -> Option<Measured> {
        let right = &observation.measured;
        if let Mistake::Elsewhere(kind) = self.mistake {
            return observation.elsewhere(kind).cloned();
        }
        let tangent = match &self.mistake {
            Mistake::Reordered { .. } | Mistake::ShearFactors { .. } | Mistake::ShearBlock(_) => {
                self.rearranged(convention, &right.tangent)
            }
            Mistake::Transposed | Mistake::Symmetrised | Mistake::Copied(_) | Mistake::BlockTransposed { .. } => {
                self.mirrored(convention, &right.tangent)?
            }
            Mistake::WholeNumbers => {
                let whole = right.tangent.mapped(|row, column| observation.claimed[(row, column)].trunc());
                let near = |(whole, right): (&f64, &f64)| (whole - right).abs() < 1.0 + right.abs() * ROUND_OFF;
                let all = whole.entries.iter().zip(&right.tangent.entries).all(near);
                all.then_some(whole)?
            }
            Mistake::Turned { increment, back } => {
                let rotation = if *increment { observation.rotation } else { polar(&observation.at.gradient)?.0 };
                turned(convention, &right.tangent, &if *back { transposed(&rotation) } else { rotation })
            }
            Mistake::Sign => right.tangent.mapped(|row, column| -right.tangent[(row, column)]),
            Mistake::VolumeRatio(power) => {
                let factor = determinant(&observation.at.gradient).powi(*power);
                right.tangent.mapped(|row, column| factor * right.tangent[(row, column)])
            }
            _ => self.converted(convention, observation)?,
        };
        // Converted errors: a greater tangent has greater errors.
        let growth = (tangent.greatest() / right.tangent.greatest()).max(1.0);
        let error = growth * right.error();
        let errors = tangent.mapped(|_, _| error);
        Some(Measured { tangent, errors })
    }

    fn rearranged(&self, convention: &Convention, right: &Matrix) -> Matrix {
        let row_is_shear = |row: usize| is_shear(&convention.stress, row);
        let column_is_shear = |column: usize| is_shear(&convention.strain, column);
        right.mapped(|row, column| match &self.mistake {
            Mistake::Reordered { rows, columns } => right[(rows[row], columns[column])],
            Mistake::ShearFactors { rows, columns } => {
                let row_factor = if row_is_shear(row) { *rows } else { 1.0 };
                let column_factor = if column_is_shear(column) { *columns } else { 1.0 };
                row_factor * column_factor * right[(row, column)]
            }
            Mistake::ShearBlock(factor) if row_is_shear(row) && column_is_shear(column) => {
                factor * right[(row, column)]
            }
            _ => right[(row, column)],
        })
    }

    fn mirrored(&self, convention: &Convention, right: &Matrix) -> Option<Matrix> {
        if right.rows != right.columns {
            return None;
        }
        let transposed = |row: usize, column: usize| right[(column, row)];
        let only = |here: &dyn Fn(usize, usize) -> bool| {
            right.mapped(|i, j| if here(i, j) { transposed(i, j) } else { right[(i, j)] })
        };
        Some(match &self.mistake {
            Mistake::Copied(Side::Below) => only(&|row, column| row > column),
            Mistake::Copied(Side::Above) => only(&|row, column| row < column),
            Mistake::BlockTransposed { shear } => {
                only(&|row, column| [row, column].iter().all(|k| is_shear(&convention.stress, *k) == *shear))
            }
            Mistake::Symmetrised => right.mapped(|row, column| 0.5 * (right[(row, column)] + transposed(row, column))),
            _ => right.mapped(transposed),
        })
    }

    fn converted(&self, convention: &Convention, observation: &Observation) -> Option<Matrix> {
        let at = &observation.at;
        let right = &observation.measured.tangent;
        let without_stress = Configuration { stress: ZERO, ..at.clone() };
        match self.mistake {
            Mistake::NoGeometricPart => {
                let truesdell = Convention::abaqus(Measure::Truesdell);
                let geometric = convert(&Matrix::zeros(6, 6), &truesdell, convention, at).ok()?;
                Some(right.mapped(|row, column| right[(row, column)] - geometric[(row, column)]))
            }
            Mistake::OtherMeasure(measure) => {
                let other = Convention { measure, ..convention.clone() };
                convert(right, convention, &other, at).ok()
            }
            Mistake::RateTerm([from, to]) => {
                let [from, to] = [from, to].map(|measure| restricted(convention, measure));
                let term = convert(&Matrix::zeros(right.rows, right.columns), &from, &to, at).ok()?;
                Some(right.mapped(|row, column| right[(row, column)] + term[(row, column)]))
            }
            Mistake::TakenForTruesdell(measure) => {
                let other = restricted(convention, measure);
                let taken = convert(right, convention, &other, at).ok()?;
                convert(&taken, &restricted(convention, Measure::Truesdell), convention, at).ok()
            }
            Mistake::WithoutSpin(measure) => {
                let other = restricted(convention, measure);
                let taken = convert(right, convention, &other, at).ok()?;
                convert(&taken, &restricted(convention, Measure::JaumannCauchy), convention, &without_stress).ok()
            }
            _ => None,
        }
    }
}

/// Q ℂ Qᵀ: the tangent in axes turned by Q.
fn turned(convention: &Convention, right: &Matrix, q: &Tensor) -> Matrix {
    let column = |k: usize| {
        let unit = unit_strain(convention, k);
        let strain = convention.strain.vector(&product3(&transposed(q), &unit, q));
        let stress = convention.stress.symmetric_tensor(&right.times(&strain));
        convention.stress.vector(&product3(q, &stress, &transposed(q)))
    };
    let columns: Vec<Vec<f64>> = (0..right.columns).map(column).collect();
    Matrix::from_columns(right.rows, &columns)
}

/// A spatial measure in as many of Abaqus' components as the convention has: six, or four in plane strain.
fn restricted(convention: &Convention, measure: Measure) -> Convention {
    if convention.plane() { Convention::abaqus_plane(measure) } else { Convention::abaqus(measure) }
}
