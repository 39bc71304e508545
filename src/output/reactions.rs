//! `reactions.csv`: the force of every prescribed condition on the bodies, and the torque of rotations, at the end of every step.

use super::csv::{Row, cell};
use super::history::AXES;
use crate::mechanics::loads::{Loads, Reaction};

/// The row of a step that ended at `time`. Every prescribed condition has one column per axis, such as `name_x`. A rotation also has the
/// column `name_torque`.
pub(crate) fn row<const D: usize>(time: f64, loads: &Loads<D>, reactions: &[Reaction<D>]) -> Row {
    let mut row = vec![("time".to_owned(), cell(time))];
    for (condition, reaction) in loads.prescribed.iter().zip(reactions) {
        let name = &condition.name;
        row.extend(AXES.iter().zip(&reaction.force).map(|(axis, force)| (format!("{name}_{axis}"), cell(force))));
        row.extend(condition.rotation().map(|_| (format!("{name}_torque"), cell(reaction.torque))));
    }
    row
}
