//! The result of one check: a verdict with its numbers.

use crate::matrix::Matrix;

/// A verdict over a tangent in one state, from best to worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The tangent is the derivative, within the measured error of the differences.
    Consistent,
    /// The tangent is off by less than about 1e-6 of the scale of the law, or by more if its cause is shown. [`Finding::reason`] says why.
    Inexact,
    /// The check cannot tell. [`Finding::reason`] says why.
    NotChecked,
    /// The tangent is not the derivative.
    Wrong,
}

/// A cause for which a tangent is inexact or could not be checked.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// Inexact: the tangent is a forward difference with this h.
    ForwardDifference(f64),
    /// Inexact: a literal or variable of the tangent has single precision.
    SinglePrecision,
    /// Inexact: a local iteration of the law ends at this relative size.
    LocalIteration(f64),
    /// Inexact: 1 − D has lost its digits, where D is near 1.
    RoundOff,
    /// Inexact: no cause was found.
    NotFound,
    /// The derivatives to both sides differ: the state lies on a kink, such as a yield surface.
    Kink,
    /// No perturbation changed the response.
    NothingExercised,
    /// Response and tangent are zero: consistent in a state, but a law without any other state is not checked.
    ZeroResponse,
    /// The noise of the law hides errors of this relative size and smaller.
    TooNoisy(f64),
    /// The check did not see an error of this relative size that it had planted itself.
    ControlMissed(f64),
    /// A call failed: crash, time limit, refused input, a number that is not finite. The text says which state.
    CallFailed(String),
}

/// An entry of the tangent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// The row: component of the stress or residual, from 0.
    pub row: usize,
    /// The column: component of the strain or unknown, from 0.
    pub column: usize,
    /// The entry as claimed by the law.
    pub claimed: f64,
    /// The entry as measured by differences.
    pub measured: f64,
    /// The estimated error of the measured entry.
    pub error: f64,
}

impl Entry {
    /// |claimed − measured|.
    pub fn deviation(&self) -> f64 {
        (self.claimed - self.measured).abs()
    }
}

/// The check of one tangent in one state.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The state, the term, or both: "uniaxial stretch 1.2, step 3".
    pub name: String,
    /// The verdict.
    pub verdict: Verdict,
    /// The cause of [`Verdict::NotChecked`] or [`Verdict::Inexact`].
    pub reason: Option<Reason>,
    /// The entry with the greatest deviation, in the units of the tangent.
    pub worst: Option<Entry>,
    /// The greatest deviation |claimed − measured|, relative to the greatest entry of the measured tangent.
    pub deviation: f64,
    /// The greatest estimated error of the differences, with the same scale.
    pub error: f64,
    /// The noise of the response, relative to its greatest component.
    pub noise: f64,
    /// The smallest planted error that the check saw, relative to the spoiled entry; `None` if it saw none.
    pub control: Option<f64>,
    /// Calls of the law or residual.
    pub calls: usize,
    /// The tangent as claimed.
    pub claimed: Matrix,
    /// The tangent as measured; entries that could not be measured are NaN.
    pub measured: Matrix,
    /// The estimated error of each measured entry.
    pub errors: Matrix,
}

/// A frequent mistake that explains a wrong tangent.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnosis {
    /// A sentence: "The tangent is the right one with the shear components 13 and 23 exchanged."
    pub sentence: String,
    /// All mistakes that explain the tangent equally well in the states tried; one if the diagnosis is unique.
    pub candidates: Vec<String>,
    /// States that would tell the candidates apart; empty if there is one.
    pub states_that_tell: Vec<String>,
    /// The coefficient of a fitted term, if the mistake is a missing or surplus term.
    pub coefficient: Option<f64>,
    /// The part of the deviation that the mistake explains: 1 − Σ|rest|²/Σ|deviation|² over the wrong states.
    pub share: f64,
}

/// The checks of one subject: a law or a code.
#[derive(Clone, Debug)]
pub struct Report {
    /// The law or code: "libmine.so, umat".
    pub subject: String,
    /// The convention of the tangent in words, with the order of its components; empty for vectors.
    pub convention: String,
    /// The names of the components of the stress, or of the rows.
    pub rows: Vec<String>,
    /// The names of the components of the strain, or of the columns.
    pub columns: Vec<String>,
    /// The seed of the states.
    pub seed: u64,
    /// The checks.
    pub findings: Vec<Finding>,
    /// The mistakes that explain the wrong ones; empty if none does.
    pub diagnoses: Vec<Diagnosis>,
    /// Sentences for the reader: inputs that the law reads, mistakes that these states cannot show.
    pub notes: Vec<String>,
}

impl Diagnosis {
    /// The diagnosis of one mistake that explains all.
    pub(crate) fn alone(sentence: String) -> Self {
        Self {
            candidates: vec![sentence.clone()],
            sentence,
            states_that_tell: Vec::new(),
            coefficient: None,
            share: 1.0,
        }
    }
}

impl Report {
    /// The worst verdict. A report without findings, or with states of no response alone, is not checked.
    pub fn verdict(&self) -> Verdict {
        let judged = self.findings.iter().filter(|finding| finding.verdict != Verdict::NotChecked);
        let worst = judged.clone().map(|finding| finding.verdict).max().unwrap_or(Verdict::NotChecked);
        let responds = judged.into_iter().any(|finding| finding.reason != Some(Reason::ZeroResponse));
        match worst {
            Verdict::Wrong => Verdict::Wrong,
            _ if !responds || self.findings.iter().any(Finding::unexplained) => Verdict::NotChecked,
            verdict => verdict,
        }
    }
}

impl Finding {
    /// Not checked for a cause other than a kink. States at kinks do not spoil the verdict over a law that is checked elsewhere.
    pub fn unexplained(&self) -> bool {
        self.verdict == Verdict::NotChecked && self.reason != Some(Reason::Kink)
    }
}
