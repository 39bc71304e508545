//! The linearised tangent on the grid: as a bilinear form on cells, from which multigrid makes coarser grids.

use crate::lanes::LANES;
use crate::lists::Lists;
use crate::mechanics::linearized::{Along, PressureChanges};
use crate::mechanics::sweep::At;
use crate::mechanics::tangent::Tangent;
use crate::parallel;
use crate::solver::LocalForm;
use crate::tensor::{Tensor, Vector};
use rustc_hash::FxHashMap;

impl<const D: usize> Tangent<'_, D> {
    /// The tangent as a form on cells: tangent moduli and masses, summed over the particles of each cell. Terms at nodes add a block for
    /// each node, the force under uniform motions.
    pub(super) fn on_cells(&self) -> LocalForm {
        let (mut form, groups) = self.occupied_cells();
        let tiles = D.pow(4);
        // The form takes gradients in units of 1/h.
        let factor = self.connectivity().grid().spacing.recip().powi(2);
        let gradients: Vec<Tensor<f64, D>> = (0..D * D).map(|jl| unit_gradient(jl / D, jl % D)).collect();
        let changes: Vec<_> = gradients.iter().map(|gradient| self.pressure_changes(gradient)).collect();
        // The moduli of the cells of each group: ∂σ_ik/∂L_jl at ((i D + k) D + j) D + l.
        let mut moduli = self.connectivity().map_groups(|group| {
            let lanes = &groups.lanes[group.number];
            let own: Vec<u32> = distinct(lanes).collect();
            let mut moduli = vec![0.0; own.len() * tiles];
            for (jl, changes) in changes.iter().enumerate() {
                let (mut unit, mut sums) = (At::<f64, D, D>::zero(), At::<f64, D, D>::zero());
                unit.gradient[jl / D][jl % D] = [1.0; LANES];
                self.data.add_product_of_group(&self.mass, changes, group, &unit, &mut sums);
                for (slot, &cell) in own.iter().enumerate() {
                    for lane in lanes_in(lanes, cell as usize) {
                        for ik in 0..D * D {
                            moduli[slot * tiles + ik * D * D + jl] += factor * sums.gradient[ik / D][ik % D][lane];
                        }
                    }
                }
            }
            moduli
        });
        parallel::rows(&mut form.tangents, tiles, |cell, sums| {
            for (group, lanes) in groups.of_cell(cell) {
                let slot = distinct(lanes).take_while(|&other| other as usize != cell).count();
                sums.iter_mut().zip(&moduli[group][slot * tiles..]).for_each(|(sum, one)| *sum += one);
            }
        });
        // All cores free these many small arrays.
        parallel::each_by(GROUPS, &mut moduli, |_, moduli| *moduli = Vec::new());
        form
    }

    /// The form without tangent moduli: nodes, occupied cells, and masses.
    pub(super) fn occupied_cells(&self) -> (LocalForm, GroupsOfCells) {
        let (connectivity, particles) = (self.connectivity(), self.mass.particles);
        let mut form = LocalForm {
            grid: connectivity.lattice_cells(),
            aggregated: connectivity.extension().is_some(),
            degree: connectivity.extension().map_or(0, |extension| extension.degree()),
            nodes: connectivity.lattice_nodes(),
            prescribed: self.space.prescribed_mask(),
            follows: self.space.following_mask(),
            ..LocalForm::default()
        };
        let mut cells = vec![[0; 3]; particles.len()];
        parallel::each(&mut cells, |p, cell| *cell = self.cell_of(p));
        let mut places = FxHashMap::default();
        let mut place = |at: [u32; 3]| {
            *places.entry(at).or_insert_with(|| {
                form.cells.push(at);
                form.cells.len() as u32 - 1
            })
        };
        let (mut lanes_of_groups, mut cells_of_groups) = (Vec::with_capacity(connectivity.groups()), Lists::default());
        let (mut particles_of_groups, mut last) = (Vec::with_capacity(connectivity.groups()), ([u32::MAX; 3], NONE));
        connectivity.each_group(|group| {
            let mut lanes = [NONE; LANES];
            for (lane, p) in lanes.iter_mut().zip(group.particles).filter(|(_, p)| particles.is_solid(**p as usize)) {
                let at = cells[*p as usize];
                // Particles of a cell lie beside each other.
                if last.0 != at {
                    last = (at, place(at));
                }
                *lane = last.1;
            }
            cells_of_groups.push(distinct(&lanes));
            lanes_of_groups.push(lanes);
            particles_of_groups.push(group.particles);
        });
        let groups = GroupsOfCells { lanes: lanes_of_groups, of_cells: cells_of_groups.transposed(form.cells.len()) };
        form.make_room(D.pow(4));
        let reference = particles.reference();
        let volume = particles.parts.everywhere(connectivity.processes(), |p| reference.volume(p));
        let of_group = |cell: usize, (group, lanes): (usize, &Lanes)| {
            let in_group = lanes_in(lanes, cell).map(|lane| particles_of_groups[group][lane] as usize);
            in_group.fold(Vector::<f64, 4>::zeros(), |sum, p| sum + self.share_of_cell(p, volume(p), cells[p]))
        };
        let sums = parallel::values_by(CELLS, form.cells.len(), |cell| {
            groups.of_cell(cell).fold(Vector::<f64, 4>::zeros(), |sum, group| sum + of_group(cell, group))
        });
        for (cell, sum) in sums.into_iter().enumerate() {
            (form.filled[cell], form.centres[cell]) = (sum[0], [sum[1], sum[2], sum[3]]);
        }
        form.finish_centres();
        self.add_masses(&groups, &mut form);
        form.blocks = bytemuck::cast_slice(&self.blocks_under_uniform_motion()).to_vec();
        (form, groups)
    }

    /// The masses of the cells: the forces under a uniform motion.
    fn add_masses(&self, groups: &GroupsOfCells, form: &mut LocalForm) {
        let mut unit = At::<f64, D, D>::zero();
        unit.value[0] = [1.0; LANES];
        let at_rest = self.pressure_changes(&Tensor::zeros());
        let masses = self.connectivity().map_groups(|group| {
            let mut sums = At::<f64, D, D>::zero();
            self.data.add_product_of_group(&self.mass, &at_rest, group, &unit, &mut sums);
            sums.value[0]
        });
        parallel::each_by(CELLS, &mut form.masses, |cell, mass| {
            let with_lanes = groups.of_cell(cell).flat_map(|(group, lanes)| {
                let masses = &masses[group];
                lanes_in(lanes, cell).map(move |lane| masses[lane])
            });
            with_lanes.for_each(|one| *mass += one);
        });
    }

    /// δp of all averaged cells under one gradient, the same at all particles.
    fn pressure_changes(&self, gradient: &Tensor<f64, D>) -> PressureChanges {
        self.data.pressure_changes(self.connectivity(), Along::Gradient(gradient))
    }

    /// The cell of a particle in the grid.
    fn cell_in_grid(&self, p: usize) -> [u32; D] {
        self.connectivity().grid().cell(&self.mass.particles.reference().position[p]).unwrap_or([0; D])
    }

    /// The cell of a particle in the lattice of the nodal fields.
    fn cell_of(&self, p: usize) -> [u32; 3] {
        let field = self.connectivity().field_of(self.mass.particles.body[p]);
        self.connectivity().in_lattice(field, self.cell_in_grid(p))
    }

    /// The `volume` of a particle over that of its cell `at` in the lattice, and this share times x.
    fn share_of_cell(&self, p: usize, volume: f64, at: [u32; 3]) -> Vector<f64, 4> {
        let (grid, reference) = (self.connectivity().grid(), self.mass.particles.reference());
        let within = self.cell_in_grid(p);
        let mut share = Vector::zeros();
        share[0] = volume / grid.spacing.powi(D as i32);
        for k in 0..D {
            let local = (reference.position[p][k] - grid.origin[k]) / grid.spacing;
            share[k + 1] = share[0] * (local + f64::from(at[k] - within[k]));
        }
        share
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

/// Cells, and groups, in one part of the work of a thread.
const CELLS: usize = 256;
const GROUPS: usize = 256;

/// The cell of a lane without particle, and of a surface point.
const NONE: u32 = u32::MAX;

/// For each lane of a group, the cell of its particle, or [`NONE`].
type Lanes = [u32; LANES];

/// The groups that have particles in each cell.
pub(super) struct GroupsOfCells {
    /// The cells of each group.
    lanes: Vec<Lanes>,
    /// The groups in each cell, ascending.
    of_cells: Lists<u32>,
}

impl GroupsOfCells {
    /// The groups in a cell, ascending, each with the cells of its lanes.
    fn of_cell(&self, cell: usize) -> impl Iterator<Item = (usize, &Lanes)> {
        self.of_cells.row(cell).iter().map(|&group| (group as usize, &self.lanes[group as usize]))
    }
}

/// The cells of a group, each of them once.
fn distinct(lanes: &Lanes) -> impl Iterator<Item = u32> {
    let is_first = |&(lane, cell): &(usize, &u32)| *cell != NONE && !lanes[..lane].contains(cell);
    lanes.iter().enumerate().filter(is_first).map(|(_, cell)| *cell)
}

/// The lanes whose particles lie in a cell.
fn lanes_in(lanes: &Lanes, cell: usize) -> impl Iterator<Item = usize> {
    lanes.iter().enumerate().filter(move |(_, one)| **one as usize == cell).map(|(lane, _)| lane)
}
