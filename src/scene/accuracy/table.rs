//! The measured table. `cargo verify tradeoff --effort full` measures it anew, and fails where an error is not met.

use serde_json::{Value, json};

/// A row of the table: knobs, and the error that smooth problems have with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Its word, if it has one.
    pub name: Option<&'static str>,
    /// The error of the displacement, relative to its size: the largest of the study's smooth problems, rounded up; with more than 12
    /// cells, of those in two dimensions.
    pub error: f64,
    /// Cells across the least extent of the smallest body.
    pub cells: f64,
    /// c Δt/h with the greatest speed of sound c.
    pub courant: f64,
    /// Particles per cell along each axis.
    pub particles_per_cell: u32,
    /// γ̂ of the shape functions.
    pub gamma: f64,
    /// ε of the mass matrix.
    pub lumping: f64,
    /// Where Newton's method stops.
    pub tolerance: f64,
}

/// The first row; others have in common with it what they do not name.
const DRAFT: Level = Level {
    name: Some("draft"),
    error: 0.035,
    cells: 6.0,
    courant: 2.0,
    particles_per_cell: 2,
    gamma: 1.4,
    lumping: 0.1,
    tolerance: 1e-4,
};

/// All rows, by falling error.
const LEVELS: [Level; 5] = [
    DRAFT,
    Level { name: None, error: 0.014, cells: 8.0, courant: 1.0, ..DRAFT },
    Level { name: Some("standard"), error: 0.005, cells: 12.0, courant: 1.0, ..DRAFT },
    Level { name: None, error: 0.0022, cells: 18.0, courant: 1.0, tolerance: 1e-6, ..DRAFT },
    Level { name: Some("reference"), error: 0.0014, cells: 24.0, courant: 0.5, tolerance: 1e-9, ..DRAFT },
];

/// The rows of the table, by falling error.
///
/// ```
/// use bfree::scene::accuracy::levels;
///
/// // A smaller error takes more cells.
/// assert!(levels().windows(2).all(|pair| pair[1].error < pair[0].error && pair[1].cells > pair[0].cells));
/// ```
pub fn levels() -> &'static [Level] {
    &LEVELS
}

/// The least and the greatest error that can be asked for.
pub(super) fn range() -> [f64; 2] {
    [LEVELS[LEVELS.len() - 1].error, LEVELS[0].error]
}

/// The knobs of the first row that is as accurate, with as few cells as the line from the row before it allows, log over log.
pub(super) fn between(error: f64) -> Option<Level> {
    let [least, greatest] = range();
    if !(least..=greatest).contains(&error) {
        return None;
    }
    let at = LEVELS.iter().position(|level| level.error <= error)?;
    let level = LEVELS[at];
    let Some(before) = at.checked_sub(1).map(|at| LEVELS[at]) else { return Some(level) };
    let share = (error / level.error).ln() / (before.error / level.error).ln();
    Some(Level { name: None, error, cells: level.cells * (before.cells / level.cells).powf(share), ..level })
}

impl Level {
    /// Keys of the scene, but those that follow from lengths and speeds.
    pub(super) fn keys(&self) -> [(&'static str, Value); 3] {
        [
            ("approximation", json!({ "lme": { "gamma": self.gamma } })),
            ("time.lumping", self.lumping.into()),
            ("solver.newton.tolerance", self.tolerance.into()),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_fall_and_cells_rise_from_row_to_row_and_between_them() {
        for pair in LEVELS.windows(2) {
            assert!(pair[1].error < pair[0].error && pair[1].cells > pair[0].cells);
            let middle = between((pair[0].error * pair[1].error).sqrt()).map_or(f64::NAN, |level| level.cells);
            assert!(middle > pair[0].cells && middle < pair[1].cells, "{middle}");
            assert_eq!(between(pair[1].error), Some(Level { name: None, ..pair[1] }));
        }
        // What the schema says of the range.
        let schema = schemars::schema_for!(super::super::Accuracy).to_value().to_string();
        let [least, greatest] = range();
        assert!(
            schema.contains(&format!("\"minimum\":{least}")) && schema.contains(&format!("\"maximum\":{greatest}")),
            "{schema}"
        );
        assert_eq!((between(2.0 * LEVELS[0].error), between(f64::NAN), between(0.0)), (None, None, None));
    }
}
