//! The cells of a system in motions and pressures, and their volume changes under hat functions of the grid.

use crate::solver::preconditioner::LocalForm;
use crate::solver::preconditioner::hats::corners;
use crate::tensor::{Tensor, Vector};
use rustc_hash::{FxHashMap, FxHashSet};

/// A cell with more than this share of its volume counts as full.
const FULL: f64 = 0.999;

/// The largest v̂, in volumes of the largest cell. Where all nodes of a cell are held, B_c K_II⁻¹ B_cᵀ is 0.
const STIFFEST: f64 = 100.0;

/// The cells of a system in motions and pressures, one entry for each. Lengths are in the user's unit, unless they are said to be in cells.
#[derive(Clone, Debug, Default)]
pub struct PressureCells {
    /// The nodes and the occupied cells of the grid, without tangents.
    pub occupied: LocalForm,
    /// Whether the occupied cells and nodes have masses.
    pub inertia: bool,
    /// Index of the cell; 0 along axes that do not exist.
    pub index: Vec<[u32; 3]>,
    /// Centroid, in cells from the origin of the grid.
    pub centroid: Vec<[f64; 3]>,
    /// ∂v/∂(∇u) with gradients in units of 1/h, D×D, column by column.
    pub volume_gradient: Vec<f64>,
    /// v
    pub volume: Vec<f64>,
    /// G
    pub shear: Vec<f64>,
    /// B_c K_II⁻¹ B_cᵀ, with the diagonal blocks K_II of A + Bᵀ γ B.
    pub compliance: Vec<f64>,
    /// k = 1/C, the change of pressure per change of volume.
    pub stiffness: Vec<f64>,
    /// γ
    pub augmentation: Vec<f64>,
    /// The change of v that belongs to a unit of the unknown of the cell.
    pub unit: Vec<f64>,
    /// The residual of the cell per difference of volumes.
    pub weight: Vec<f64>,
}

impl PressureCells {
    /// v̂ of every cell: v²/(G B_c K_II⁻¹ B_cᵀ), divided by the median of its ratio to v in full cells.
    pub(super) fn effective_volumes(&self) -> Vec<f64> {
        let (cells, occupied) = (self, &self.occupied);
        let shares = occupied.cells.iter().zip(&occupied.filled);
        let full: FxHashSet<[u32; 3]> = shares.filter(|(_, share)| **share > FULL).map(|(cell, _)| *cell).collect();
        let raw = |c: usize| cells.volume[c].powi(2) / (cells.shear[c] * cells.compliance[c]);
        let median = |chosen: &dyn Fn(usize) -> bool| {
            let ratios = (0..cells.volume.len()).filter(|&c| chosen(c)).map(|c| raw(c) / cells.volume[c]);
            let mut all: Vec<f64> = ratios.filter(|x| x.is_finite() && *x > 0.0).collect();
            all.sort_unstable_by(f64::total_cmp);
            all.get(all.len() / 2).copied()
        };
        let unit = median(&|c| full.contains(&cells.index[c])).or_else(|| median(&|_| true)).unwrap_or(1.0);
        let largest = cells.volume.iter().copied().fold(0.0, f64::max);
        // Softness is not positive where A + Bᵀ γ B is indefinite.
        let effective =
            |c: usize| if raw(c) >= 0.0 { (raw(c) / unit).min(STIFFEST * largest) } else { cells.volume[c] };
        (0..cells.volume.len()).map(effective).collect()
    }

    /// The volume change of each cell under a motion of each hat function, by cell and node. Outer nodes follow inner ones.
    pub(super) fn pulls<const D: usize>(&self) -> Vec<(u32, u32, Vector<f64, D>)> {
        let (cells, occupied) = (self, &self.occupied);
        let numbers: FxHashMap<[u32; 3], u32> =
            (0..).zip(&occupied.nodes).map(|(number, &index)| (index, number)).collect();
        let followers = occupied.followers::<D>(&occupied.prescribed);
        let mut all: Vec<(u32, u32, Vector<f64, D>)> = Vec::new();
        for (cell, (index, centroid)) in cells.index.iter().zip(&cells.centroid).enumerate() {
            let volume_gradient = &cells.volume_gradient[cell * D * D..(cell + 1) * D * D];
            let volume_gradient = Tensor::<f64, D>::from_column_slice(volume_gradient);
            let first = all.len();
            let mut add = |node: u32, b: Vector<f64, D>| match all[first..].iter_mut().find(|entry| entry.1 == node) {
                Some(entry) => entry.2 += b,
                None => all.push((cell as u32, node, b)),
            };
            for (corner, _, slope) in corners::<D>(*index, *centroid) {
                let Some(&node) = numbers.get(&corner) else { continue };
                let b = volume_gradient * slope;
                let Some((follows, leaders)) = followers.row(node as usize) else {
                    add(node, b);
                    continue;
                };
                let part = |of: bool| Vector::from_fn(|i, _| if follows[i] == of { b[i] } else { 0.0 });
                add(node, part(false));
                leaders.for_each(|(leader, weight)| add(leader as u32, part(true) * weight));
            }
        }
        all
    }
}
