//! The join of averaged cells that a body hardly fills. A few particles in a thin layer do not determine a pressure. Therefore they share
//! the pressure of a better filled cell of the same body.

use crate::grid::Grid;
use crate::tensor::Vector;

/// The filled fraction of a cell below which its particles belong to a cell next to it.
const HARDLY_FILLED: f64 = 0.3;

/// Distances that differ by less than this, in spacings, count as equal.
const TIE: f64 = 1e-6;

/// A cell by its id in the grid, and the number of a body in it.
pub(super) type Key = (u64, u32);

/// A particle of an averaged cell.
pub(super) struct Content<const D: usize> {
    pub key: Key,
    pub volume: f64,
    pub position: Vector<f64, D>,
}

/// The part of a body in a cell.
struct Part<const D: usize> {
    key: Key,
    /// The filled fraction of the cell.
    filled: f64,
    centroid: Vector<f64, D>,
}

impl<const D: usize> Part<D> {
    fn of(same: &[Content<D>], grid: &Grid<D>) -> Self {
        let volume: f64 = same.iter().map(|one| one.volume).sum();
        let moment: Vector<f64, D> = same.iter().map(|one| one.position * one.volume).sum();
        Self { key: same[0].key, filled: volume / grid.spacing.powi(D as i32), centroid: moment / volume }
    }

    /// The cell that takes the particles: among the well filled cells around, the one whose middle is nearest to the centroid.
    /// Cells at equal distances do not count, because a mirrored scene would take the other one.
    fn nearest(&self, grid: &Grid<D>, is_well_filled: impl Fn(Key) -> bool) -> Option<Key> {
        let mut near: Vec<(f64, Key)> = Vec::new();
        for cell in grid.around(grid.index(self.key.0), 1) {
            let key = (grid.id(cell), self.key.1);
            let middle = grid.position(cell).add_scalar(0.5 * grid.spacing);
            if is_well_filled(key) {
                near.push(((middle - self.centroid).norm(), key));
            }
        }
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let alone = near.chunk_by(|a, b| b.0 - a.0 < TIE * grid.spacing).find(|equal| equal.len() == 1);
        alone.map(|of| of[0].1)
    }
}

/// The hardly filled cells, ascending, each with the cell that takes its particles. A hardly filled cell without such a cell is left out.
/// `contents` are sorted by their keys.
pub(super) fn joined_cells<const D: usize>(grid: &Grid<D>, contents: &[Content<D>]) -> Vec<(Key, Key)> {
    let parts = contents.chunk_by(|one, next| one.key == next.key);
    let parts: Vec<Part<D>> = parts.map(|same| Part::of(same, grid)).collect();
    let is_well_filled = |key| {
        let found = parts.binary_search_by_key(&key, |part| part.key);
        found.is_ok_and(|at| parts[at].filled >= HARDLY_FILLED)
    };
    let hardly_filled = parts.iter().filter(|part| part.filled < HARDLY_FILLED);
    hardly_filled.filter_map(|part| Some((part.key, part.nearest(grid, is_well_filled)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELLS: u32 = 6;
    const GRID: Grid<2> = Grid { origin: nalgebra::Vector2::new(0.0, 0.0), spacing: 0.5, cells: [CELLS, CELLS] };

    /// A particle for each `(cell, filled fraction, position in the cell from 0 to 1)`.
    fn contents(of: &[([u32; 2], f64, [f64; 2])], body: u32) -> Vec<Content<2>> {
        let content = |&(cell, filled, at): &([u32; 2], f64, [f64; 2])| Content {
            key: (GRID.id(cell), body),
            volume: filled * 0.25,
            position: GRID.position(cell) + Vector::from(at) * 0.5,
        };
        let mut all: Vec<_> = of.iter().map(content).collect();
        all.sort_by_key(|one| one.key);
        all
    }

    /// The joined cells by their indices.
    fn joined(contents: &[Content<2>]) -> Vec<([u32; 2], [u32; 2])> {
        joined_cells(&GRID, contents).iter().map(|(from, to)| (GRID.index(from.0), GRID.index(to.0))).collect()
    }

    #[test]
    fn a_hardly_filled_cell_joins_the_nearest_well_filled_one() {
        let middle = [0.5, 0.5];
        let corner = ([3, 2], 0.1, [0.1, 0.3]);
        // Full cells to the left, above and at the upper left.
        let full = [([2, 2], 1.0, middle), ([3, 3], 0.31, middle), ([2, 3], 1.0, middle)];
        assert_eq!(joined(&contents(&[&full[..], &[corner]].concat(), 0)), [([3, 2], [2, 2])]);
        // Of another body, none counts.
        let mut two = contents(&full, 1);
        two.extend(contents(&[corner], 0));
        two.sort_by_key(|one| one.key);
        assert_eq!(joined(&two), []);
        // A cell two cells away does not count either.
        assert_eq!(joined(&contents(&[([1, 2], 1.0, middle), corner], 0)), []);
    }

    #[test]
    fn of_cells_at_the_same_distance_none_is_taken() {
        let middle = [0.5, 0.5];
        let tip = ([3, 3], 0.1, [0.2, 0.2]);
        let beside = [([2, 3], 1.0, middle), ([3, 2], 1.0, middle), tip];
        assert_eq!(joined(&contents(&beside, 0)), []);
        // On the diagonal, the cell behind both is the nearest cell that its mirror image would take as well.
        assert_eq!(joined(&contents(&[&beside[..], &[([2, 2], 1.0, middle)]].concat(), 0)), [([3, 3], [2, 2])]);
    }

    #[test]
    fn a_mirrored_body_has_mirrored_joins() {
        // The staircase of a round edge: fractions and centroids without a symmetry of their own.
        let body = |flip: bool| {
            let mut of = Vec::new();
            for i in 0..4_u32 {
                for k in 0..4 - i {
                    let filled = if i + k == 3 { 0.05 + 0.1 * f64::from(i) } else { 1.0 };
                    let (cell, at) =
                        ([i + 1, k + 1], if i + k == 3 { [0.23, 0.11 + 0.07 * f64::from(k)] } else { [0.5; 2] });
                    of.push(if flip {
                        ([CELLS - 1 - cell[0], cell[1]], filled, [1.0 - at[0], at[1]])
                    } else {
                        (cell, filled, at)
                    });
                }
            }
            contents(&of, 0)
        };
        let mirror = |cell: [u32; 2]| [CELLS - 1 - cell[0], cell[1]];
        let mut mirrored: Vec<_> = joined(&body(false)).iter().map(|&(from, to)| (mirror(from), mirror(to))).collect();
        let mut of_mirrored = joined(&body(true));
        mirrored.sort_unstable();
        of_mirrored.sort_unstable();
        assert_eq!(mirrored, of_mirrored);
        assert_eq!(mirrored.len(), 3, "{mirrored:?}");
    }

    #[test]
    fn a_thin_body_keeps_the_cells_that_it_hardly_fills() {
        let strip: Vec<_> = (0..CELLS).map(|i| ([i, 2], 0.2, [0.5, 0.1])).collect();
        assert_eq!(joined(&contents(&strip, 0)), []);
    }
}
