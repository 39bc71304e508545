//! The studies: one file each, and one list.

use crate::known;
use crate::report::{Counts, Report};
use crate::sheet::Sheet;
use crate::table::Table;

/// The amount of work of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effort {
    /// The effort in CI: seconds.
    Short,
    /// Long sweeps included: minutes.
    Full,
}

/// The results of a study.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Reports with judged cells.
    pub reports: Vec<Report>,
    /// Tables without judgement.
    pub tables: Vec<Table>,
    /// Remarks, in sentences.
    pub remarks: Vec<String>,
    /// Pictures.
    pub sheets: Vec<Sheet>,
}

impl Outcome {
    /// Whether there is a report and every report passes.
    pub fn passed(&self) -> bool {
        !self.reports.is_empty() && self.reports.iter().all(Report::passed)
    }

    /// The numbers of judged, shown and known failing cells of all reports.
    pub fn counts(&self) -> Counts {
        self.reports.iter().map(Report::counts).sum()
    }
}

/// An error that ends a study, such as an error of its simulations.
pub type StudyError = Box<dyn std::error::Error + Send + Sync>;

/// A study.
#[derive(Clone, Copy, Debug)]
pub struct Study {
    /// The name on the command line.
    pub name: &'static str,
    /// A one-sentence summary.
    pub about: &'static str,
    run: fn(&Effort) -> Result<Outcome, StudyError>,
}

impl Study {
    /// Runs the study, and compares its failures with the list of known failures.
    ///
    /// # Errors
    /// Errors of the simulations in the study.
    pub fn run(&self, effort: Effort) -> Result<Outcome, StudyError> {
        let mut outcome = (self.run)(&effort)?;
        known::mark(known::KNOWN, self.name, effort, &mut outcome.reports);
        Ok(outcome)
    }
}

/// The studies that repeat section 4 of the paper, for `cargo verify results`.
pub const PAPER: &[&str] = &["riemann", "compaction", "rebound"];

/// The studies that measure time.
pub const MEASURE_TIME: &[&str] = &["baseline", "rebound", "tradeoff", "mutants"];

/// The studies that can solve their linear systems on a GPU.
pub const ON_DEVICE: &[&str] = &["tangent", "newton"];

/// The name of a law in a narrow column.
fn short(name: &str) -> String {
    name.trim_start_matches("neo-Hookean, ").replace("St. Venant", "St.V.")
}

/// The larger number, or NaN if either is NaN.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// The list of studies. One word here registers a study.
macro_rules! studies {
    ($($study:ident),* $(,)?) => {
        $(mod $study;)*

        /// All studies, in the order they run.
        pub const STUDIES: &[Study] =
            &[$(Study { name: stringify!($study), about: $study::ABOUT, run: $study::run }),*];
    };
}

studies!(
    tangent,
    scenes,
    newton,
    baseline,
    operator,
    patch,
    balance,
    energy,
    symmetry,
    digits,
    black_box,
    memory,
    extremes,
    manufactured,
    order,
    riemann,
    compaction,
    loads,
    locking,
    contact,
    expansion,
    robust,
    rebound,
    tradeoff,
    mutants
);
