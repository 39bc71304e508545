//! The tangents of the laws and of averaged cells on a device (`Rows` of `kernels/data.h`).

use super::device::{Buffer, arguments};
use super::transfer::Transfer;
use super::vectors::GpuVector;
use std::sync::Arc;

/// The tangents of all particles in one form, times a factor.
#[derive(Debug)]
pub(crate) struct Rows {
    pub rows: Arc<Buffer<f64>>,
    pub factor: f64,
    /// The number of the form (`kernels/data.h`).
    pub form: i32,
    /// Numbers of a particle.
    pub count: usize,
    /// The averaged cells whose rows these are.
    pub cells: Option<Cells>,
}

/// Averaged cells on a device.
#[derive(Debug)]
pub(crate) struct Cells {
    /// The first number of a and of b of a particle.
    pub first_of_a: usize,
    pub first_of_b: usize,
    /// The cell of each particle by group and lane.
    pub of_particles: Buffer<u32>,
    /// For each cell the first of its members, and the members by group and lane.
    pub members: [Buffer<u32>; 2],
    pub stiffness: Buffer<f64>,
    /// The change of volume of each particle, and the change of pressure of each cell.
    pub volumes: Buffer<f64>,
    pub changes: Buffer<f64>,
}

impl Rows {
    /// The arguments of these rows without the pressures of averaged cells.
    pub(super) fn alone(&self) -> RowsArguments {
        let (rows, form, count) = (self.rows.address(), self.form, self.count as i32);
        RowsArguments { rows, factor: self.factor, form, count, ..RowsArguments::default() }
    }

    /// Computes the changes of pressure of averaged cells by a nodal field, and returns the arguments of these rows.
    pub(super) fn arguments(&self, transfer: &Transfer, u: &GpuVector) -> RowsArguments {
        let alone = self.alone();
        let RowsArguments { rows, count, .. } = alone;
        let Some(cells) = &self.cells else { return alone };
        // `Volumes` of `kernels/data.h`.
        let volumes = arguments! {
            transfer: transfer.arguments(),
            u: u.address(),
            rows,
            volumes: cells.volumes.address(),
            count,
            first_of_b: cells.first_of_b as i32,
        };
        transfer.launch(["volumes_1", "volumes_2", "volumes_3"], transfer.shared, &volumes);
        let [first, members] = cells.members.each_ref().map(Buffer::address);
        let n = cells.stiffness.len();
        // `Cells` of `kernels/points.h`.
        let sums = arguments! {
            first,
            members,
            stiffness: cells.stiffness.address(),
            volumes: cells.volumes.address(),
            changes: cells.changes.address(),
            n: n as i64,
        };
        transfer.gpu().launch_for("cell_pressures", n, &sums);
        RowsArguments {
            cells: cells.of_particles.address(),
            changes: cells.changes.address(),
            first_of_a: cells.first_of_a as i32,
            ..alone
        }
    }
}

/// `Rows` of `kernels/data.h`.
#[derive(Clone, Copy, Default)]
#[repr(C)]
pub(super) struct RowsArguments {
    rows: u64,
    factor: f64,
    cells: u64,
    changes: u64,
    form: i32,
    count: i32,
    first_of_a: i32,
}
