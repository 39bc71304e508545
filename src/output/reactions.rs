//! `reactions.csv`: the force of every prescribed condition on the bodies, at the end of every step.

use super::OutputError;
use super::csv::{Row, Table};
use super::files::Written;
use super::history::AXES;
use crate::mechanics::loads::Loads;
use crate::tensor::Vector;
use std::path::PathBuf;

/// Writes `reactions.csv`.
#[derive(Debug)]
pub(crate) struct Reactions(pub(crate) Table);

impl Reactions {
    /// Creates the file, with columns `name_x`, `name_y`, … for every prescribed condition; or continues one whose first `kept`
    /// bytes are good.
    pub(crate) fn open<const D: usize>(
        path: PathBuf,
        loads: &Loads<D>,
        kept: Option<Written>,
    ) -> Result<Self, OutputError> {
        let mut columns = vec!["time".to_owned()];
        for condition in &loads.prescribed {
            columns.extend(AXES.iter().take(D).map(|axis| format!("{}_{axis}", condition.name)));
        }
        Ok(Self(Table::open(path, &columns, kept)?))
    }

    /// Appends the forces at `time`.
    pub(crate) fn write<const D: usize>(&mut self, time: f64, forces: &[Vector<f64, D>]) -> Result<(), OutputError> {
        let mut row = Row::default();
        row.push(time);
        row.extend(forces.iter().flatten().copied());
        self.0.row(&row)
    }
}
