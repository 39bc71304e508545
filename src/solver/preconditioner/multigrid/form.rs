//! The data of an operator from which multigrid makes its coarse levels.

use crate::aggregation::{Extension, Occupied, Pieces};
use crate::parallel;
use crate::space::Followers;
use rustc_hash::FxHashMap;

/// An operator as a form on the cells of a grid: Σ_cells ∇w:A∇u + m w·u at one point a cell, and Σ_nodes w·B u. Lengths are in cells.
#[derive(Clone, Debug, Default)]
pub struct LocalForm {
    /// Cells along each axis; 0 along axes that do not exist.
    pub grid: [u32; 3],
    /// Whether outer nodes follow inner ones, on coarser grids too.
    pub aggregated: bool,
    /// The degree of the B-splines if their outer coefficients follow others; otherwise 0 or 1.
    pub degree: u32,
    /// Index of each node.
    pub nodes: Vec<[u32; 3]>,
    /// Whether a value is prescribed, node after node.
    pub prescribed: Vec<bool>,
    /// Whether a value follows others ([`aggregation`](crate::aggregation)) and is no unknown, node after node.
    pub follows: Vec<bool>,
    /// B of each node, D×D, column by column.
    pub blocks: Vec<f64>,
    /// Index of each cell that is not empty.
    pub cells: Vec<[u32; 3]>,
    /// Position in the grid of the centroid of each cell's filled part.
    pub centres: Vec<[f64; 3]>,
    /// Filled fraction of each cell.
    pub filled: Vec<f64>,
    /// m
    pub masses: Vec<f64>,
    /// `A[i][k][j][l]` of each cell, the coefficient of ∂w_i/∂x_k ∂u_j/∂x_l.
    pub tangents: Vec<f64>,
}

impl LocalForm {
    /// Zeros for all cells, with `tiles` entries of A for each.
    pub(crate) fn make_room(&mut self, tiles: usize) {
        let count = self.cells.len();
        (self.centres, self.filled, self.masses) = (vec![[0.0; 3]; count], vec![0.0; count], vec![0.0; count]);
        self.tangents = vec![0.0; tiles * count];
    }

    /// Divides the weighted sums in `centres` by the sums of their weights, `filled`.
    pub(crate) fn finish_centres(&mut self) {
        for (centre, &filled) in self.centres.iter_mut().zip(&self.filled) {
            centre.iter_mut().for_each(|x| *x /= filled);
        }
    }

    /// Whether a value is no unknown, node after node.
    pub(super) fn fixed(&self) -> Vec<bool> {
        self.prescribed.iter().zip(&self.follows).map(|(held, follows)| *held || *follows).collect()
    }

    /// The outer nodes of hat functions, which follow inner ones except at `held` values. None if the form is not aggregated.
    pub(in crate::solver::preconditioner) fn followers<const D: usize>(&self, held: &[bool]) -> Followers<D> {
        if !self.aggregated {
            return Followers::default();
        }
        let cells = self.cells.iter().copied().zip(self.filled.iter().copied()).collect();
        let occupied = Occupied { dimension: D, grid: self.grid, nodes: &self.nodes, cells };
        let held = held.iter().enumerate().filter(|(_, held)| **held).map(|(k, _)| (k / D, k % D));
        Followers::new(Extension::new(Pieces::LINEAR, &occupied).into(), held)
    }

    /// Sums the cells into those of the next coarser grid. Returns for each coarse cell the cells in it.
    pub(super) fn add_cells_to<const D: usize>(&self, next: &mut Self) -> Vec<Vec<usize>> {
        let (tiles, mut places) = (D.pow(4), FxHashMap::default());
        let mut finer: Vec<Vec<usize>> = Vec::new();
        for (cell, index) in self.cells.iter().enumerate() {
            let coarse = index.map(|i| i / 2);
            let at = *places.entry(coarse).or_insert_with(|| {
                next.cells.push(coarse);
                finer.push(Vec::new());
                next.cells.len() - 1
            });
            finer[at].push(cell);
        }
        next.make_room(tiles);
        // Lengths are in cells, so on the coarse grid a volume is smaller by 2^D, and a gradient larger by 2.
        for (at, cell) in finer.iter().enumerate().flat_map(|(at, finer)| finer.iter().map(move |&cell| (at, cell))) {
            let share = self.filled[cell] / f64::from(1 << D);
            next.filled[at] += share;
            next.masses[at] += self.masses[cell];
            (0..D).for_each(|k| next.centres[at][k] += share * 0.5 * self.centres[cell][k]);
            mutant!("multigrid: centroids of coarse cells are a tenth off": { (0..D).for_each(|k| next.centres[at][k] += share * 0.05 * self.centres[cell][k]); });
        }
        parallel::rows(&mut next.tangents, tiles, |at, sums| {
            for &cell in &finer[at] {
                let tangents = &self.tangents[cell * tiles..(cell + 1) * tiles];
                sums.iter_mut().zip(tangents).for_each(|(sum, one)| *sum += 0.25 * one);
            }
        });
        next.finish_centres();
        finer
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A full cell and a quarter of the next one fill 0.625 of a coarse cell. Their centroid lies at (1·0.5 + ¼·1.125)/1.25 in fine cells.
    #[test]
    fn coarse_cells_have_the_centroid_of_what_is_in_them() {
        let mut fine = LocalForm { grid: [2, 0, 0], cells: vec![[0, 0, 0], [1, 0, 0]], ..LocalForm::default() };
        fine.make_room(1);
        (fine.centres, fine.filled) = (vec![[0.5, 0.0, 0.0], [1.125, 0.0, 0.0]], vec![1.0, 0.25]);
        let mut coarse = LocalForm::default();
        assert_eq!(fine.add_cells_to::<1>(&mut coarse), [[0, 1]]);
        assert_eq!(coarse.filled, [0.625]);
        assert!((coarse.centres[0][0] - 0.5 * (0.5 + 0.25 * 1.125) / 1.25).abs() < 1e-15, "{:?}", coarse.centres);
    }
}
