//! The linearised tangent of averaged cells, as rows of numbers.

use super::{Along, FunctionsAt, TangentRows};
use crate::gpu::{self, Gpu};
use crate::lanes::LANES;
use crate::mechanics::constitutive::Form;
use crate::mechanics::dilatation::{Cells, Member, Scale};
use crate::mechanics::sweep::{At, Connectivity, Group};
use crate::tensor::{Tensor, Vector};
use std::sync::Arc;

/// The places of 𝔸, a and b among the numbers of a particle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellLayout {
    /// The form of 𝔸, whose numbers are the first.
    pub form: Form,
    /// The first number of a, by rows.
    pub a: usize,
    /// The first number of b, by rows.
    pub b: usize,
    /// The numbers of a particle.
    pub count: usize,
}

impl CellLayout {
    /// Cells with a potential: a and b are both the A of a closed tangent.
    pub(crate) const fn of_potential(dimension: usize) -> Self {
        Self { form: Form::Closed, a: 0, b: 0, count: Form::Closed.rows(dimension) }
    }

    /// Cells with a mean pressure of the step: 𝔸, then a, then b.
    pub(crate) const fn of_step(dimension: usize) -> Self {
        let (local, tensor) = (Form::General.rows(dimension), dimension * dimension);
        Self { form: Form::General, a: local, b: local + tensor, count: local + 2 * tensor }
    }
}

/// δσ = 𝔸 : L + δp a at the particles of averaged cells, with δp = k δv and δv = Σ b : L of the cell. All other particles have zeros.
#[derive(Clone, Debug)]
pub(crate) struct CellRows<const D: usize> {
    cells: Arc<Cells>,
    layout: CellLayout,
    /// 𝔸, a and b.
    pub rows: TangentRows,
    /// k of every cell; in the mixed form γ.
    pub stiffness: Vec<f64>,
    /// The cells of the mixed form.
    pub mixed: Option<Vec<MixedCell<D>>>,
}

/// A cell whose dilatation is an unknown of its own, at one trial state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MixedCell<const D: usize> {
    /// The nodal field of the cell.
    pub field: u32,
    /// The index of the cell in the grid.
    pub index: [u32; D],
    /// The centroid of the particles.
    pub centroid: Vector<f64, D>,
    /// v
    pub volume: f64,
    /// ∂v/∂(∇u)
    pub volume_gradient: Tensor<f64, D>,
    /// k = ∂π/∂v
    pub stiffness: f64,
    /// γ
    pub augmentation: f64,
    /// The units of the unknown and of its residual.
    pub scale: Scale,
    /// V_c
    pub reference_volume: f64,
}

impl<const D: usize> CellRows<D> {
    /// Cells in the displacement form. `fill(cell, particle, L, lane, rows)` writes the numbers of a particle in a cell, where L is that of
    /// the nodal motion `phi`.
    pub(crate) fn new(
        cells: Arc<Cells>,
        layout: CellLayout,
        stiffness: Vec<f64>,
        connectivity: &Connectivity<D>,
        phi: &[Vector<f64, D>],
        fill: impl Fn(usize, usize, &Tensor<f64, D>, usize, &mut [[f64; LANES]]) + Sync,
    ) -> Self {
        let mut rows = connectivity.pool().unspecified(connectivity.groups() * layout.count);
        connectivity.fill_all_rows(phi, layout.count, &mut rows, |group, at, rows| {
            rows.fill([0.0; LANES]);
            for (lane, &p) in group.particles.iter().enumerate() {
                if let Some(cell) = cells.cell(p) {
                    fill(cell, p as usize, &at.lane(lane).1, lane, rows);
                }
            }
        });
        let rows = TangentRows::new(layout.form, 0, layout.count, rows);
        Self { cells, layout, rows, stiffness, mixed: None }
    }

    /// The cells times a factor, where 𝔸 is zero.
    pub(crate) fn times(mut self, factor: f64) -> Self {
        self.stiffness.iter_mut().for_each(|stiffness| *stiffness *= factor);
        self
    }

    /// The tensor at `first` of a member.
    fn tensor(&self, member: &Member, first: usize) -> Tensor<f64, D> {
        let (group, lane) = (member.slot as usize / LANES, member.slot as usize % LANES);
        let rows = self.rows.of_group(group);
        Tensor::from_fn(|i, k| rows[first + i * D + k][lane])
    }

    /// b of a member.
    pub(crate) fn volume_gradient(&self, member: &Member) -> Tensor<f64, D> {
        self.tensor(member, self.layout.b)
    }

    /// A copy on a device.
    pub(crate) fn on_device(&self, gpu: &Gpu, connectivity: &Connectivity<D>) -> gpu::Rows {
        let (mut first, mut members) = (vec![0], Vec::new());
        let mut of_particles = vec![u32::MAX; connectivity.groups() * LANES];
        for (cell, (own, _)) in self.cells.iter().enumerate() {
            members.extend(own.iter().map(|member| member.slot));
            first.push(members.len() as u32);
            own.iter().for_each(|member| of_particles[member.slot as usize] = cell as u32);
        }
        let cells = gpu::Cells {
            first_of_a: self.layout.a,
            first_of_b: self.layout.b,
            volumes: gpu.memory_for(of_particles.len()),
            of_particles: gpu.copy_of(&of_particles),
            members: [first, members].map(|list| gpu.copy_of(&list)),
            changes: gpu.memory_for(self.stiffness.len()),
            stiffness: gpu.copy_of(&self.stiffness),
        };
        gpu::Rows { cells: Some(cells), ..self.rows.on_device(gpu) }
    }

    /// δp of every cell: as given in the mixed form, or k δv.
    pub(crate) fn pressure_changes(&self, connectivity: &Connectivity<D>, along: Along<'_, D>) -> Vec<f64> {
        let volumes = match along {
            Along::Field(_, Some(pressures)) if self.mixed.is_some() => return pressures.to_vec(),
            Along::Field(u, _) => self.volume_changes(connectivity, u),
            Along::Gradient(gradient) => {
                let sum = |members: &[Member]| members.iter().map(|one| self.volume_gradient(one).dot(gradient)).sum();
                self.cells.iter().map(|(members, _)| sum(members)).collect()
            }
        };
        volumes.iter().zip(&self.stiffness).map(|(v, k): (&f64, _)| k * v).collect()
    }

    /// δv of every cell.
    pub(crate) fn volume_changes(&self, connectivity: &Connectivity<D>, u: &[Vector<f64, D>]) -> Vec<f64> {
        let mut grown = connectivity.pool().unspecified(connectivity.groups());
        connectivity.fill_all_rows(u, 1, &mut grown, |group, at, grown| {
            let b = &self.rows.of_group(group.number)[self.layout.b..];
            grown[0] = [0.0; LANES];
            for (b, l) in b.iter().zip(at.gradient.as_flattened()) {
                (0..LANES).for_each(|lane| grown[0][lane] += b[lane] * l[lane]);
            }
        });
        self.cells.sums(&grown)
    }

    #[inline(always)]
    pub(crate) fn add_product(&self, changes: &[f64], group: Group<'_>, at: &At<f64, D, D>, sums: &mut At<f64, D, D>) {
        self.rows.add_product(group, at, sums);
        let mut pressures = [0.0; LANES];
        for (lane, &p) in group.particles.iter().enumerate() {
            pressures[lane] = self.cells.cell(p).map_or(0.0, |cell| changes[cell]);
            mutant!("mean dilatation: the product lacks the coupling within a cell": { pressures[lane] = 0.0; });
        }
        let a = &self.rows.of_group(group.number)[self.layout.a..];
        for (out, a) in sums.gradient.as_flattened_mut().iter_mut().zip(a) {
            (0..LANES).for_each(|lane| out[lane] += pressures[lane] * a[lane]);
        }
    }

    /// Calls `visit` with each cell, each node that moves it, a_I = Σ a ∇_r N_I and b_I = Σ b ∇_r N_I.
    fn each_node(
        &self,
        functions: &FunctionsAt<'_, D>,
        nodes: usize,
        mut visit: impl FnMut(usize, usize, [Vector<f64, D>; 2]),
    ) {
        let (mut sums, mut touched) = (vec![[Vector::<f64, D>::zeros(); 2]; nodes], Vec::new());
        for (cell, (members, _)) in self.cells.iter().enumerate() {
            for member in members {
                let both = [self.layout.a, self.layout.b].map(|first| self.tensor(member, first));
                for (node, function) in functions(member.particle as usize) {
                    for (sum, one) in sums[node].iter_mut().zip(&both) {
                        *sum += Vector::from_fn(|i, _| (one * function.gradient[i])[i]);
                    }
                    touched.push(node);
                }
            }
            for node in touched.drain(..) {
                // A node that several members share is visited once.
                let both = std::mem::replace(&mut sums[node], [Vector::zeros(); 2]);
                if both[1].norm_squared() > 0.0 {
                    visit(cell, node, both);
                }
            }
        }
    }

    /// Adds the coupling within the cells to the diagonal blocks: Σ_c k a_I ⊗ b_I.
    pub(crate) fn add_blocks(&self, functions: &FunctionsAt<'_, D>, blocks: &mut [Tensor<f64, D>]) {
        self.each_node(functions, blocks.len(), |cell, node, [a, b]| {
            blocks[node] += a * b.transpose() * self.stiffness[cell];
        });
    }

    /// B_c M B_cᵀ of every cell, for a block-diagonal M and B = ∂v/∂u.
    pub(crate) fn compliance(&self, functions: &FunctionsAt<'_, D>, inverse: &[Tensor<f64, D>]) -> Vec<f64> {
        let mut compliance = vec![0.0; self.stiffness.len()];
        self.each_node(functions, inverse.len(), |cell, node, [_, b]| compliance[cell] += b.dot(&(inverse[node] * b)));
        compliance
    }
}
