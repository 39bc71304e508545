//! `reactions.csv`: the force of every prescribed condition on the bodies, and the torque of rotations, at the end of every step.

use super::OutputError;
use super::csv::{Row, Table};
use super::files::Written;
use super::history::AXES;
use crate::mechanics::loads::Loads;
use crate::simulation::StepReport;
use std::path::PathBuf;

/// Writes `reactions.csv`.
#[derive(Debug)]
pub(crate) struct Reactions(pub(crate) Table);

impl Reactions {
    /// Creates the file, or continues a file after its first `kept` bytes. Every prescribed condition has one column per axis, such as
    /// `name_x`. A rotation also has the column `name_torque`.
    pub(crate) fn open<const D: usize>(
        path: PathBuf,
        loads: &Loads<D>,
        kept: Option<Written>,
    ) -> Result<Self, OutputError> {
        let mut columns = vec!["time".to_owned()];
        for condition in &loads.prescribed {
            columns.extend(AXES.iter().take(D).map(|axis| format!("{}_{axis}", condition.name)));
            columns.extend(condition.rotation().map(|_| format!("{}_torque", condition.name)));
        }
        Ok(Self(Table::open(path, &columns, kept)?))
    }

    /// Appends the reactions at the end of a step.
    pub(crate) fn write<const D: usize>(
        &mut self,
        time: f64,
        loads: &Loads<D>,
        step: &StepReport<D>,
    ) -> Result<(), OutputError> {
        let mut row = Row::default();
        row.push(time);
        for (condition, reaction) in loads.prescribed.iter().zip(&step.reactions) {
            row.extend(reaction.force.iter().copied());
            row.extend(condition.rotation().map(|_| reaction.torque));
        }
        self.0.row(&row)
    }
}
