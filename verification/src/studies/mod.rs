//! The studies: one file a study, one list.

use crate::figure::Figure;
use crate::known;
use crate::report::{Counts, Report};
use crate::sheet::Sheet;
use crate::table::Table;

/// How much a study does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effort {
    /// What CI runs: seconds.
    Short,
    /// Long sweeps too: minutes.
    Full,
}

/// What a study found.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// What is judged.
    pub reports: Vec<Report>,
    /// What is only shown.
    pub tables: Vec<Table>,
    /// What there is to say, in sentences.
    pub remarks: Vec<String>,
    /// Pictures.
    pub figures: Vec<Figure>,
    /// Pictures for print.
    pub sheets: Vec<Sheet>,
}

impl Outcome {
    /// Whether every report passes, and there is one.
    pub fn passed(&self) -> bool {
        !self.reports.is_empty() && self.reports.iter().all(Report::passed)
    }

    /// How many cells of all reports are judged, shown, known to fail.
    pub fn counts(&self) -> Counts {
        self.reports.iter().map(Report::counts).sum()
    }
}

/// Why a study could not be finished: whatever the simulations in it can fail with.
pub type StudyError = Box<dyn std::error::Error>;

/// A study.
#[derive(Clone, Copy, Debug)]
pub struct Study {
    /// What it is called on the command line.
    pub name: &'static str,
    /// What it shows, in a sentence.
    pub about: &'static str,
    run: fn(&Effort) -> Result<Outcome, StudyError>,
}

impl Study {
    /// Runs it, and holds what fails against the list of known failures.
    ///
    /// # Errors
    /// Those of the simulations in it.
    pub fn run(&self, effort: Effort) -> Result<Outcome, StudyError> {
        let mut outcome = (self.run)(&effort)?;
        known::mark(known::KNOWN, self.name, effort, &mut outcome.reports);
        Ok(outcome)
    }
}

/// The studies that repeat section 4 of the paper, for `cargo verify results`.
pub const PAPER: &[&str] = &["riemann", "compaction", "rebound"];

/// The name of a law in a narrow column.
fn short(name: &str) -> String {
    name.trim_start_matches("neo-Hookean, ").replace("St. Venant", "St.V.")
}

/// The list of studies. A word here makes a study known to the program.
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
    taylor,
    newton,
    baseline,
    operator,
    patch,
    balance,
    symmetry,
    digits,
    memory,
    extremes,
    manufactured,
    minimiser,
    order,
    riemann,
    compaction,
    column,
    loads,
    locking,
    expansion,
    robust,
    rebound,
    tradeoff,
    mutants
);
