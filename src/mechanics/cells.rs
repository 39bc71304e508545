//! The linearised tangent on the grid: as a bilinear form on cells, from which multigrid makes coarser grids; and its sparsity pattern.

use crate::lanes::LANES;
use crate::mechanics::sweep::{At, Group};
use crate::mechanics::tangent::Tangent;
use crate::mechanics::unknowns::padded;
use crate::solver::{LocalForm, Neighbours};
use crate::tensor::{Tensor, Vector};
use std::collections::HashMap;

impl<const D: usize> Tangent<'_, D> {
    /// The tangent as a form on cells: tangent moduli and masses, summed over the particles of each cell. Terms at nodes add a block for
    /// each node, the force under uniform motions.
    pub(super) fn on_cells(&self) -> LocalForm {
        let grid = self.supports.grid();
        let tiles = D.pow(4);
        let mut form = LocalForm {
            grid: std::array::from_fn(|k| if k < D { grid.cells[k] } else { 0 }),
            aggregated: self.supports.extension().is_some(),
            degree: self.supports.extension().map_or(0, |extension| extension.degree()),
            nodes: self.indices(),
            prescribed: self.unknowns.prescribed_mask(self.supports.nodes()),
            follows: self.unknowns.following_mask(self.supports.nodes()),
            ..LocalForm::default()
        };
        let terms: Vec<_> =
            self.terms.iter().filter_map(|term| term.product_at_points(None)).map(|(_, add)| add).collect();
        let probe = |group: Group<'_>, at: &At<f64, D, D>| {
            let mut sums = At::<f64, D, D>::zero();
            terms.iter().for_each(|add| add(group, at, &mut sums));
            sums
        };
        // The form takes gradients in units of 1/h.
        let factor = grid.spacing.recip().powi(2);
        let mut places = HashMap::new();
        self.supports.each_group(|group| {
            let cells = self.cells_of(group, &mut places, &mut form);
            let mut at = At::<f64, D, D>::zero();
            at.value[0] = [1.0; LANES];
            let sums = probe(group, &at);
            for (lane, cell) in in_cells(&cells) {
                form.masses[cell] += sums.value[0][lane];
            }
            for (j, l) in (0..D).flat_map(|j| (0..D).map(move |l| (j, l))) {
                let mut at = At::<f64, D, D>::zero();
                at.gradient[j][l] = [1.0; LANES];
                let sums = probe(group, &at);
                for (lane, cell) in in_cells(&cells) {
                    for (i, k) in (0..D).flat_map(|i| (0..D).map(move |k| (i, k))) {
                        form.tangents[cell * tiles + ((i * D + k) * D + j) * D + l] +=
                            factor * sums.gradient[i][k][lane];
                    }
                }
            }
        });
        form.finish_centres();
        form.blocks = bytemuck::cast_slice(&self.blocks_under_uniform_motion()).to_vec();
        form
    }

    /// The cell of each particle of a group in the form; `None` for empty lanes and for surface points, which belong to no cell. Adds new
    /// cells to the form, and the share of the particle in its cell.
    fn cells_of(
        &self,
        group: Group<'_>,
        places: &mut HashMap<[u32; D], usize>,
        form: &mut LocalForm,
    ) -> [Option<usize>; LANES] {
        let (grid, reference) = (self.supports.grid(), self.particles.reference());
        let volume = grid.spacing.powi(D as i32);
        let mut cells = [None; LANES];
        let solid = cells.iter_mut().zip(group.particles).filter(|(_, p)| self.particles.is_solid(**p as usize));
        for (of, &p) in solid {
            let x = &reference.position[p as usize];
            let at = grid.cell(x).unwrap_or([0; D]);
            let cell = *places.entry(at).or_insert_with(|| {
                form.push_cell(padded(at), D.pow(4));
                form.cells.len() - 1
            });
            let share = reference.volume(p as usize) / volume;
            *of = Some(cell);
            form.filled[cell] += share;
            for k in 0..D {
                let local = (x[k] - grid.origin[k]) / grid.spacing;
                form.centres[cell][k] += share * local;
            }
        }
        cells
    }

    /// For each node, the force at the node under uniform motions along the axes, from the terms at nodes.
    fn blocks_under_uniform_motion(&self) -> Vec<Tensor<f64, D>> {
        let nodes = self.supports.nodes();
        let mut blocks = vec![Tensor::<f64, D>::zeros(); nodes];
        for k in 0..D {
            let uniform = vec![Vector::<f64, D>::from_fn(|i, _| if i == k { 1.0 } else { 0.0 }); nodes];
            let mut out = vec![Vector::<f64, D>::zeros(); nodes];
            self.terms.iter().for_each(|term| term.add_product_at_nodes(&uniform, &mut out));
            blocks.iter_mut().zip(&out).for_each(|(block, out)| block.set_column(k, out));
        }
        blocks
    }

    /// The sparsity pattern: two nodes share an entry if they support the same particle. The inner nodes that they follow then share
    /// entries, too.
    pub(super) fn joined(&self) -> Neighbours {
        let further = self.terms.iter().map(|term| term.reach()).max().unwrap_or(0);
        let reach = self.supports.reach() + further;
        let mut leaders = vec![Vec::new(); self.supports.nodes()];
        for (outer, _, row) in self.unknowns.followers.rows() {
            leaders[outer] = row.map(|(leader, _)| leader).collect();
        }
        let mut fixed = self.unknowns.following_mask(self.supports.nodes());
        self.unknowns.prescribed.iter().for_each(|dof| fixed[dof.node * D + dof.component] = true);
        Neighbours { nodes: self.indices(), reach, leaders, fixed }
    }

    fn indices(&self) -> Vec<[u32; 3]> {
        let (grid, active) = (self.supports.grid(), self.supports.active());
        active.ids().iter().map(|&id| padded(grid.index(id))).collect()
    }
}

/// The pairs (lane, cell) of the lanes that have a cell.
fn in_cells(cells: &[Option<usize>; LANES]) -> impl Iterator<Item = (usize, usize)> {
    cells.iter().enumerate().filter_map(|(lane, cell)| Some((lane, (*cell)?)))
}
