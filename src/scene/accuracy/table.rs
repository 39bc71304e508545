//! The measured table. `cargo verify tradeoff --effort full` measures the table anew, and fails if an error is exceeded.

use serde_json::{Value, json};

/// A row of the table: settings, and the error of smooth problems with these settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// The word for the row in a scene, if there is one.
    pub name: Option<&'static str>,
    /// The error of the displacement, relative to its size: the largest of the study's smooth problems, rounded up. Beyond 12 cells, only
    /// problems in two dimensions count. Infinite where no error is promised.
    pub error: f64,
    /// Cells across the smallest extent of the smallest body.
    pub cells: f64,
    /// The Courant number c Δt/h, with the greatest speed of sound c.
    pub courant: f64,
    /// Particles per cell along each axis.
    pub particles_per_cell: u32,
    /// γ̂ of the shape functions; `None` leaves the scene's default functions.
    pub gamma: Option<f64>,
    /// ε of the mass matrix; `None` leaves the scene's default.
    pub lumping: Option<f64>,
    /// The relative tolerance of Newton's method.
    pub tolerance: f64,
}

/// A fast row without a promised error. The grid is as coarse as the coarsest templates of `bfree new`, and steps are at least as long.
/// Implicit steps need not resolve waves to show a motion. No linear system is solved beside Newton's.
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

/// The first row with an error; the other rows inherit the values that they do not state.
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

/// The smallest and the largest error that a scene may ask for.
pub(super) fn range() -> [f64; 2] {
    [LEVELS[LEVELS.len() - 1].error, COARSEST.error]
}

/// The settings of the first row that is accurate enough. The number of cells is interpolated, log over log, between this row and the row
/// before.
pub(super) fn between(error: f64) -> Option<Level> {
    let [least, greatest] = range();
    if !(least..=greatest).contains(&error) {
        return None;
    }
    let at = LEVELS.iter().position(|level| level.error <= error)?;
    let level = LEVELS[at];
    let before = LEVELS[at.saturating_sub(1)];
    if before.error.is_infinite() {
        return Some(level);
    }
    let share = (error / level.error).ln() / (before.error / level.error).ln();
    Some(Level { name: None, error, cells: level.cells * (before.cells / level.cells).powf(share), ..level })
}

impl Level {
    /// Keys of the scene and their values, except keys that follow from lengths and speeds.
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
        // The schema states the range, too.
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
