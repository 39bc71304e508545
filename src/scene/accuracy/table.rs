//! The measured table. `cargo verify tradeoff --effort full` measures it anew, and fails where an error is not met.

use serde_json::{Value, json};

/// A row of the table: knobs, and the error that smooth problems have with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Its word, if it has one.
    pub name: Option<&'static str>,
    /// The error of the displacement, relative to its size: the largest of the study's smooth problems, rounded up; with more than 12
    /// cells, of those in two dimensions. Infinite where none is promised.
    pub error: f64,
    /// Cells across the least extent of the smallest body.
    pub cells: f64,
    /// c Δt/h with the greatest speed of sound c.
    pub courant: f64,
    /// Particles per cell along each axis.
    pub particles_per_cell: u32,
    /// γ̂ of the shape functions; `None` leaves the scene's default functions.
    pub gamma: Option<f64>,
    /// ε of the mass matrix; `None` leaves the scene's default.
    pub lumping: Option<f64>,
    /// Where Newton's method stops.
    pub tolerance: f64,
}

/// As coarse as the coarsest templates of `bfree new`, with steps at least as long, and no linear system beside Newton's: implicit
/// steps need not resolve waves to show a motion. It is there to be fast; no error is promised.
const DRAFT: Level = Level {
    name: Some("draft"),
    error: f64::INFINITY,
    cells: 4.0,
    courant: 8.0,
    particles_per_cell: 2,
    gamma: None,
    lumping: None,
    tolerance: 1e-4,
};

/// The first row with an error; others have in common with it what they do not name.
const COARSEST: Level =
    Level { name: None, error: 0.035, cells: 6.0, courant: 2.0, gamma: Some(1.4), lumping: Some(0.1), ..DRAFT };

/// All rows, by falling error.
const LEVELS: [Level; 6] = [
    DRAFT,
    COARSEST,
    Level { error: 0.014, cells: 8.0, courant: 1.0, ..COARSEST },
    Level { name: Some("standard"), error: 0.005, cells: 12.0, courant: 1.0, ..COARSEST },
    Level { error: 0.0022, cells: 18.0, courant: 1.0, tolerance: 1e-6, ..COARSEST },
    Level { name: Some("reference"), error: 0.0014, cells: 24.0, courant: 0.5, tolerance: 1e-9, ..COARSEST },
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
    [LEVELS[LEVELS.len() - 1].error, COARSEST.error]
}

/// The knobs of the first row that is as accurate, with as few cells as the line from the row before it allows, log over log.
pub(super) fn between(error: f64) -> Option<Level> {
    let [least, greatest] = range();
    if !(least..=greatest).contains(&error) {
        return None;
    }
    let at = LEVELS.iter().position(|level| level.error <= error)?;
    let level = LEVELS[at];
    let before = match at.checked_sub(1).map(|at| LEVELS[at]) {
        Some(before) if before.error.is_finite() => before,
        _ => return Some(level),
    };
    let share = (error / level.error).ln() / (before.error / level.error).ln();
    Some(Level { name: None, error, cells: level.cells * (before.cells / level.cells).powf(share), ..level })
}

impl Level {
    /// Keys of the scene, but those that follow from lengths and speeds.
    pub(super) fn keys(&self) -> impl Iterator<Item = (&'static str, Value)> {
        let functions = self.gamma.map(|gamma| ("approximation", json!({ "lme": { "gamma": gamma } })));
        let lumping = self.lumping.map(|lumping| ("time.lumping", lumping.into()));
        functions.into_iter().chain(lumping).chain([("solver.newton.tolerance", self.tolerance.into())])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_fall_and_cells_rise_from_row_to_row_and_between_them() {
        for pair in LEVELS.windows(2) {
            assert!(pair[1].error < pair[0].error && pair[1].cells > pair[0].cells);
            if pair[0].error.is_finite() {
                let middle = between((pair[0].error * pair[1].error).sqrt()).map_or(f64::NAN, |level| level.cells);
                assert!(middle > pair[0].cells && middle < pair[1].cells, "{middle}");
            }
            assert_eq!(between(pair[1].error), Some(Level { name: None, ..pair[1] }));
        }
        // What the schema says of the range.
        let schema = schemars::schema_for!(super::super::Accuracy).to_value().to_string();
        let [least, greatest] = range();
        assert!(
            schema.contains(&format!("\"minimum\":{least}")) && schema.contains(&format!("\"maximum\":{greatest}")),
            "{schema}"
        );
        for outside in [2.0 * COARSEST.error, f64::INFINITY, f64::NAN, 0.0] {
            assert_eq!(between(outside), None);
        }
    }
}
