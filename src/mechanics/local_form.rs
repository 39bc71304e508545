//! The linearised tangent on the grid: as a bilinear form on cells, from which multigrid makes coarser grids.

use crate::lanes::LANES;
use crate::mechanics::linearized::{Along, PressureChanges};
use crate::mechanics::sweep::At;
use crate::mechanics::tangent::Tangent;
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
        let factor = self.connectivity().grid().spacing.recip().powi(2);
        let gradients: Vec<Tensor<f64, D>> = (0..D * D).map(|jl| unit_gradient(jl / D, jl % D)).collect();
        let changes: Vec<_> = gradients.iter().map(|gradient| self.pressure_changes(gradient)).collect();
        // The moduli of the cells of each group: ∂σ_ik/∂L_jl at ((i D + k) D + j) D + l.
        let moduli = self.connectivity().map_groups(|group| {
            let (own, slots) = distinct(&cells[group.number]);
            let mut moduli = vec![0.0; own.len() * tiles];
            for (jl, changes) in changes.iter().enumerate() {
                let (mut unit, mut sums) = (At::<f64, D, D>::zero(), At::<f64, D, D>::zero());
                unit.gradient[jl / D][jl % D] = [1.0; LANES];
                self.data.add_product_of_group(&self.mass, changes, group, &unit, &mut sums);
                for (lane, slot) in in_cells(&slots) {
                    for ik in 0..D * D {
                        moduli[slot * tiles + ik * D * D + jl] += factor * sums.gradient[ik / D][ik % D][lane];
                    }
                }
            }
            moduli
        });
        for (moduli, cells) in moduli.iter().zip(&cells) {
            for (moduli, cell) in moduli.chunks(tiles).zip(distinct(cells).0) {
                form.tangents[cell * tiles..][..tiles].iter_mut().zip(moduli).for_each(|(sum, one)| *sum += one);
            }
        }
        form
    }

    /// The form without tangent moduli: nodes, occupied cells, and masses. Also the cells of the particles of every group.
    pub(super) fn occupied_cells(&self) -> (LocalForm, Vec<[Option<usize>; LANES]>) {
        let mut form = LocalForm {
            grid: self.connectivity().lattice_cells(),
            aggregated: self.connectivity().extension().is_some(),
            degree: self.connectivity().extension().map_or(0, |extension| extension.degree()),
            nodes: self.connectivity().lattice_nodes(),
            prescribed: self.space.prescribed_mask(),
            follows: self.space.following_mask(),
            ..LocalForm::default()
        };
        let mut places = FxHashMap::default();
        let mut cells = Vec::with_capacity(self.connectivity().groups());
        self.connectivity().each_group(|group| {
            let (mut of_lanes, mut shares) = ([None; LANES], [Vector::<f64, 4>::zeros(); LANES]);
            let lanes = group.particles.iter().map(|&p| p as usize).enumerate();
            let mut last = None;
            for (lane, p) in lanes.filter(|&(_, p)| self.mass.particles.is_solid(p)) {
                let (at, share) = self.share_of_cell(p);
                // Particles of a cell lie beside each other.
                let cell = last.filter(|(cell, _)| *cell == at).map_or_else(
                    || {
                        *places.entry(at).or_insert_with(|| {
                            form.push_cell(at, D.pow(4));
                            form.cells.len() - 1
                        })
                    },
                    |(_, place)| place,
                );
                (last, of_lanes[lane], shares[lane]) = (Some((at, cell)), Some(cell), share);
            }
            let (own, slots) = distinct(&of_lanes);
            let mut sums = vec![Vector::<f64, 4>::zeros(); own.len()];
            in_cells(&slots).for_each(|(lane, slot)| sums[slot] += shares[lane]);
            for (cell, sum) in own.into_iter().zip(sums) {
                form.filled[cell] += sum[0];
                (0..3).for_each(|k| form.centres[cell][k] += sum[k + 1]);
            }
            cells.push(of_lanes);
        });
        form.finish_centres();
        let mut unit = At::<f64, D, D>::zero();
        unit.value[0] = [1.0; LANES];
        let at_rest = self.pressure_changes(&Tensor::zeros());
        let masses = self.connectivity().map_groups(|group| {
            let mut sums = At::<f64, D, D>::zero();
            self.data.add_product_of_group(&self.mass, &at_rest, group, &unit, &mut sums);
            sums.value[0]
        });
        for (masses, cells) in masses.iter().zip(&cells) {
            in_cells(cells).for_each(|(lane, cell)| form.masses[cell] += masses[lane]);
        }
        form.blocks = bytemuck::cast_slice(&self.blocks_under_uniform_motion()).to_vec();
        (form, cells)
    }

    /// δp of all averaged cells under one gradient, the same at all particles.
    fn pressure_changes(&self, gradient: &Tensor<f64, D>) -> PressureChanges {
        self.data.pressure_changes(self.connectivity(), Along::Gradient(gradient))
    }

    /// The cell of a particle in the lattice of the nodal fields, the volume of the particle over that of the cell, and this share times x.
    fn share_of_cell(&self, p: usize) -> ([u32; 3], Vector<f64, 4>) {
        let (grid, particles) = (self.connectivity().grid(), self.mass.particles);
        let (x, volume) = (&particles.reference().position[p], particles.reference().volume(p));
        let within = grid.cell(x).unwrap_or([0; D]);
        let at = self.connectivity().in_lattice(self.connectivity().field_of(particles.body[p]), within);
        let mut share = Vector::zeros();
        share[0] = volume / grid.spacing.powi(D as i32);
        for k in 0..D {
            let local = (x[k] - grid.origin[k]) / grid.spacing;
            share[k + 1] = share[0] * (local + f64::from(at[k] - within[k]));
        }
        (at, share)
    }

    /// For each node, the force at the node under uniform motions of its nodal field along the axes, from the terms at nodes. The other fields
    /// rest, since contact resists relative motions.
    fn blocks_under_uniform_motion(&self) -> Vec<Tensor<f64, D>> {
        let nodes = self.connectivity().nodes();
        let mut blocks = vec![Tensor::<f64, D>::zeros(); nodes];
        for (field, k) in (0..self.connectivity().field_count()).flat_map(|field| (0..D).map(move |k| (field, k))) {
            let moving = self.connectivity().nodes_of(field);
            let mut uniform = vec![Vector::<f64, D>::zeros(); nodes];
            uniform[moving.clone()].fill(Vector::from_fn(|i, _| if i == k { 1.0 } else { 0.0 }));
            let mut out = vec![Vector::<f64, D>::zeros(); nodes];
            self.data.add_product_at_nodes(&self.mass, &uniform, &mut out);
            blocks[moving.clone()].iter_mut().zip(&out[moving]).for_each(|(block, out)| block.set_column(k, out));
        }
        blocks
    }
}

/// The gradient e_j ⊗ e_l.
fn unit_gradient<const D: usize>(j: usize, l: usize) -> Tensor<f64, D> {
    Tensor::from_fn(|i, k| if (i, k) == (j, l) { 1.0 } else { 0.0 })
}

/// The cells of a group, each of them once, and for each lane the place of its cell among them.
fn distinct(cells: &[Option<usize>; LANES]) -> (Vec<usize>, [Option<usize>; LANES]) {
    let mut own = Vec::new();
    let slots = cells.map(|cell| {
        let cell = cell?;
        Some(own.iter().position(|&one| one == cell).unwrap_or_else(|| {
            own.push(cell);
            own.len() - 1
        }))
    });
    (own, slots)
}

/// The pairs (lane, cell) of the lanes that have a cell.
fn in_cells(cells: &[Option<usize>; LANES]) -> impl Iterator<Item = (usize, usize)> {
    cells.iter().enumerate().filter_map(|(lane, cell)| Some((lane, (*cell)?)))
}
