//! The product of a linearised step with a nodal field, on a device (`kernels/data.h` and `kernels/transfer.h`).

use super::device::{Buffer, GpuError, arguments};
use super::followers::{Followers, clear_fixed};
use super::points::{PointSums, Points};
use super::rows::{Rows, RowsArguments};
use super::transfer::{Gathers, NodalSums, PassArguments, Transfer};
use super::vectors::GpuVector;
use crate::parallel::{self, held};
use std::sync::{Arc, Mutex};

/// Most sets of rows of a product.
pub(crate) const SETS: usize = 4;

/// The masses of all particles by group and lane, and the lumped masses of all nodes, on a device.
#[derive(Debug)]
pub(crate) struct Masses {
    pub consistent: Buffer<f64>,
    pub lumped: Buffer<f64>,
}

/// α M̃ on a device.
#[derive(Clone, Debug)]
pub(crate) struct Inertia {
    pub masses: Arc<Masses>,
    /// α
    pub factor: f64,
    /// ε
    pub lumping: f64,
}

/// `Inertia` of `kernels/data.h`.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct InertiaArguments {
    mass: u64,
    factor: f64,
    consistent: f64,
}

impl InertiaArguments {
    /// The consistent part of the inertia.
    pub(super) fn of(inertia: Option<&Inertia>) -> Self {
        let consistent = inertia.filter(|of| of.lumping < 1.0);
        Self {
            mass: consistent.map_or(0, |of| of.masses.consistent.address()),
            factor: consistent.map_or(0.0, |of| of.factor),
            consistent: consistent.map_or(0.0, |of| 1.0 - of.lumping),
        }
    }

    fn exists(&self) -> bool {
        self.mass != 0
    }
}

/// The tangents and masses of the particles in a linearised step, on a device.
#[derive(Debug)]
pub(crate) struct OfParticles {
    pub transfer: Arc<Transfer>,
    pub inertia: Option<Inertia>,
    pub rows: Vec<Rows>,
}

/// `Product` of `kernels/data.h`.
#[derive(Clone, Copy)]
#[repr(C)]
struct ProductArguments {
    pass: PassArguments,
    inertia: InertiaArguments,
    sets: i32,
    rows: [RowsArguments; SETS],
}

impl OfParticles {
    fn has_pass(&self) -> bool {
        InertiaArguments::of(self.inertia.as_ref()).exists() || !self.rows.is_empty()
    }

    /// The arguments of a pass with these rows.
    fn arguments(&self, u: u64, of: impl Fn(&Rows) -> RowsArguments) -> ProductArguments {
        let mut rows = [RowsArguments::default(); SETS];
        for (to, from) in rows.iter_mut().zip(&self.rows) {
            *to = of(from);
        }
        let inertia = InertiaArguments::of(self.inertia.as_ref());
        let gathers = Gathers { values: inertia.exists(), gradients: !self.rows.is_empty(), magnitudes: false };
        let sets = self.rows.len().min(SETS) as i32;
        ProductArguments { pass: self.transfer.pass(u, gathers), inertia, sets, rows }
    }

    /// Adds the diagonal blocks of the particles to those at the nodes, which are stored column by column. Returns whether the blocks were
    /// added. Otherwise `blocks` is unchanged.
    pub(crate) fn add_diagonal_blocks(&self, blocks: &mut [f64]) -> bool {
        let (gpu, d) = (self.transfer.gpu(), self.transfer.dimension);
        if gpu.check_shared(self.transfer.shared_of_blocks).is_err() {
            return false;
        }
        let mut rows: Vec<Vec<f64>> = (0..d).map(|_| vec![0.0; blocks.len() / d]).collect();
        for (i, row) in rows.iter_mut().enumerate() {
            parallel::each(row, |k, entry| *entry = blocks[k / d * d * d + k % d * d + i]);
        }
        self.add_rows_of_blocks(&mut rows);
        let succeeded = gpu.check().is_ok();
        if succeeded {
            parallel::each(blocks, |k, entry| *entry = rows[k % d][k / (d * d) * d + k / d % d]);
        }
        succeeded
    }

    /// Adds the particles to row i of all blocks, for each i. The loop is not shared, because tasks of other simulations could wait here for the
    /// locked device.
    fn add_rows_of_blocks(&self, rows: &mut [Vec<f64>]) {
        let gpu = self.transfer.gpu();
        let _lock = gpu.lock();
        let product = self.arguments(0, Rows::alone);
        for (i, row) in rows.iter_mut().enumerate() {
            let (start, mut sums) = (gpu.copy_of(row), gpu.memory_for(row.len()));
            // `DiagonalBlocks` of `kernels/data.h`.
            let kernels = ["diagonal_blocks_1", "diagonal_blocks_2", "diagonal_blocks_3"];
            self.transfer.launch(kernels, self.transfer.shared_of_blocks, &arguments! { product, i: i as i32 });
            self.transfer.add_boxes(&start, &mut sums);
            gpu.read_at(&sums, 0, row);
        }
    }
}

/// A linearised step on a device.
#[derive(Debug)]
pub(crate) struct Product {
    pub of_particles: OfParticles,
    /// Follower pressures, and contact.
    pub points: [Option<Points>; 2],
    /// Whether each value is prescribed.
    pub prescribed: Buffer<u8>,
    pub followers: Option<Followers>,
    /// Memory for E û.
    pub extended: Mutex<GpuVector>,
}

impl Product {
    /// `y = K x`
    pub(crate) fn apply(&self, x: &GpuVector, y: &mut GpuVector) {
        let gpu = self.of_particles.transfer.gpu();
        let _lock = gpu.lock();
        if x.0.len().min(y.0.len()) < self.prescribed.len() {
            return gpu.keep_failure(Err(GpuError::Length {
                needed: self.prescribed.len(),
                found: x.0.len().min(y.0.len()),
            }));
        }
        let Some(followers) = &self.followers else { return self.apply_to_all(x, self.prescribed.address(), y) };
        let mut extended = held(&self.extended);
        gpu.copy(&x.0, &mut extended.0);
        followers.extend(gpu, &mut extended);
        self.apply_to_all(&extended, 0, y);
        followers.restrict(gpu, y);
        clear_fixed(gpu, &self.prescribed, y);
    }

    /// K u at all nodes. `prescribed` is the address of the mask of the values that become zero, or 0.
    fn apply_to_all(&self, u: &GpuVector, prescribed: u64, y: &mut GpuVector) {
        let (transfer, inertia) = (&*self.of_particles.transfer, &self.of_particles.inertia);
        let has_pass = self.of_particles.has_pass();
        if has_pass {
            let arguments = self.of_particles.arguments(u.address(), |rows| rows.arguments(transfer, u));
            transfer.launch(["product_1", "product_2", "product_3"], transfer.shared, &arguments);
        }
        let none = PointSums::default();
        let sums = NodalSums {
            boxes: if has_pass { transfer.boxes() } else { 0 },
            start: 0,
            lumped: inertia.as_ref().map_or(0, |of| of.masses.lumped.address()),
            lumped_factor: inertia.as_ref().map_or(0.0, |of| of.factor * of.lumping),
            u: u.address(),
            prescribed,
            points: self.points.each_ref().map(|of| of.as_ref().map_or(none, |of| of.forces(transfer.gpu(), u))),
        };
        transfer.sum_at_nodes(sums, y.address());
    }
}
