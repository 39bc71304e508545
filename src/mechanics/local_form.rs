//! The linearised tangent on the grid: as a bilinear form on cells, from which multigrid makes coarser grids.

use crate::lanes::LANES;
use crate::mechanics::sweep::{At, Group};
use crate::mechanics::tangent::Tangent;
use crate::mechanics::terms::Along;
use crate::solver::LocalForm;
use crate::tensor::{Tensor, Vector};
use rustc_hash::FxHashMap;

impl<const D: usize> Tangent<'_, D> {
    /// The tangent as a form on cells: tangent moduli and masses, summed over the particles of each cell. Terms at nodes add a block for
    /// each node, the force under uniform motions.
    pub(super) fn on_cells(&self) -> LocalForm {
        let (mut form, cells) = self.occupied_cells();
        let tiles = D.pow(4);
        // The form takes gradients in units of 1/h.
        let factor = self.supports.grid().spacing.recip().powi(2);
        for (j, l) in (0..D).flat_map(|j| (0..D).map(move |l| (j, l))) {
            let (mut unit, mut gradient) = (At::<f64, D, D>::zero(), Tensor::zeros());
            unit.gradient[j][l] = [1.0; LANES];
            gradient[(j, l)] = 1.0;
            self.probe(&unit, &gradient, |group, sums| {
                for (lane, cell) in in_cells(&cells[group]) {
                    for (i, k) in (0..D).flat_map(|i| (0..D).map(move |k| (i, k))) {
                        form.tangents[cell * tiles + ((i * D + k) * D + j) * D + l] +=
                            factor * sums.gradient[i][k][lane];
                    }
                }
            });
        }
        form
    }

    /// The form without tangent moduli: nodes, occupied cells, and masses. Also the cells of the particles of every group.
    pub(super) fn occupied_cells(&self) -> (LocalForm, Vec<[Option<usize>; LANES]>) {
        let mut form = LocalForm {
            grid: self.supports.lattice_cells(),
            aggregated: self.supports.extension().is_some(),
            degree: self.supports.extension().map_or(0, |extension| extension.degree()),
            nodes: self.supports.lattice_nodes(),
            prescribed: self.unknowns.prescribed_mask(self.supports.nodes()),
            follows: self.unknowns.following_mask(self.supports.nodes()),
            ..LocalForm::default()
        };
        let (mut places, mut cells) = (FxHashMap::default(), vec![[None; LANES]; self.supports.groups()]);
        self.supports.each_group(|group| cells[group.number] = self.cells_of(group, &mut places, &mut form));
        form.finish_centres();
        let mut unit = At::<f64, D, D>::zero();
        unit.value[0] = [1.0; LANES];
        self.probe(&unit, &Tensor::zeros(), |group, sums| {
            for (lane, cell) in in_cells(&cells[group]) {
                form.masses[cell] += sums.value[0][lane];
            }
        });
        form.blocks = bytemuck::cast_slice(&self.blocks_under_uniform_motion()).to_vec();
        (form, cells)
    }

    /// Calls `take` with the number of each group, and with the result of the product for a value and a gradient that are the same at all
    /// particles.
    fn probe(&self, at: &At<f64, D, D>, gradient: &Tensor<f64, D>, mut take: impl FnMut(usize, At<f64, D, D>)) {
        let along = Along::Gradient(gradient);
        let terms: Vec<_> = self.terms.iter().filter_map(|term| Some(term.product_at_points(along)?.1)).collect();
        let evaluate = |group: Group<'_>| {
            let mut sums = At::<f64, D, D>::zero();
            terms.iter().for_each(|add| add(group, at, &mut sums));
            sums
        };
        self.supports.map_groups(evaluate, |group, sums| take(group.number, sums));
    }

    /// The cell of each particle of a group in the form; `None` for empty lanes and for surface points, which belong to no cell. Adds new
    /// cells to the form, and the share of the particle in its cell.
    fn cells_of(
        &self,
        group: Group<'_>,
        places: &mut FxHashMap<[u32; 3], usize>,
        form: &mut LocalForm,
    ) -> [Option<usize>; LANES] {
        let (grid, reference) = (self.supports.grid(), self.particles.reference());
        let volume = grid.spacing.powi(D as i32);
        let mut cells = [None; LANES];
        let solid = cells.iter_mut().zip(group.particles).filter(|(_, p)| self.particles.is_solid(**p as usize));
        for (of, &p) in solid {
            let x = &reference.position[p as usize];
            let within = grid.cell(x).unwrap_or([0; D]);
            let at = self.supports.in_lattice(self.supports.field_of(self.particles.body[p as usize]), within);
            let cell = *places.entry(at).or_insert_with(|| {
                form.push_cell(at, D.pow(4));
                form.cells.len() - 1
            });
            let share = reference.volume(p as usize) / volume;
            *of = Some(cell);
            form.filled[cell] += share;
            for k in 0..D {
                let local = (x[k] - grid.origin[k]) / grid.spacing;
                form.centres[cell][k] += share * (local + f64::from(at[k] - within[k]));
            }
        }
        cells
    }

    /// For each node, the force at the node under uniform motions of its nodal field along the axes, from the terms at nodes. The other fields
    /// rest, since contact resists relative motions.
    fn blocks_under_uniform_motion(&self) -> Vec<Tensor<f64, D>> {
        let nodes = self.supports.nodes();
        let mut blocks = vec![Tensor::<f64, D>::zeros(); nodes];
        for (field, k) in (0..self.supports.field_count()).flat_map(|field| (0..D).map(move |k| (field, k))) {
            let moving = self.supports.nodes_of(field);
            let mut uniform = vec![Vector::<f64, D>::zeros(); nodes];
            uniform[moving.clone()].fill(Vector::from_fn(|i, _| if i == k { 1.0 } else { 0.0 }));
            let mut out = vec![Vector::<f64, D>::zeros(); nodes];
            self.terms.iter().for_each(|term| term.add_product_at_nodes(&uniform, &mut out));
            blocks[moving.clone()].iter_mut().zip(&out[moving]).for_each(|(block, out)| block.set_column(k, out));
        }
        blocks
    }
}

/// The pairs (lane, cell) of the lanes that have a cell.
fn in_cells(cells: &[Option<usize>; LANES]) -> impl Iterator<Item = (usize, usize)> {
    cells.iter().enumerate().filter_map(|(lane, cell)| Some((lane, (*cell)?)))
}
