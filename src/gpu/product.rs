//! The product of a linearised step with a nodal field, on a device (`kernels/data.h` and `kernels/transfer.h`).

use super::device::{Buffer, GpuError, arguments};
use super::followers::{Followers, clear_fixed};
use super::points::{PointSums, Points};
use super::rows::{Rows, RowsArguments};
use super::transfer::Transfer;
use super::vectors::GpuVector;
use crate::parallel::held;
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

/// A linearised step on a device.
#[derive(Debug)]
pub(crate) struct Product {
    pub transfer: Arc<Transfer>,
    pub inertia: Option<Inertia>,
    pub rows: Vec<Rows>,
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
        let gpu = self.transfer.gpu();
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
        let (gpu, transfer) = (self.transfer.gpu(), &*self.transfer);
        let has_mass = self.inertia.as_ref().filter(|of| of.lumping < 1.0);
        let passes = has_mass.is_some() || !self.rows.is_empty();
        if passes {
            let mut rows = [RowsArguments::default(); SETS];
            for (to, from) in rows.iter_mut().zip(&self.rows) {
                *to = from.arguments(transfer, u);
            }
            // `Product` of `kernels/data.h`.
            let arguments = arguments! {
                transfer: transfer.arguments(),
                u: u.address(),
                boxes: transfer.boxes.address(),
                mass: has_mass.map_or(0, |of| of.masses.consistent.address()),
                mass_factor: has_mass.map_or(0.0, |of| of.factor),
                consistent: has_mass.map_or(0.0, |of| 1.0 - of.lumping),
                sets: self.rows.len().min(SETS) as i32,
                together: transfer.window.together(transfer.dimension) as i32,
                window_rows: transfer.window.rows as i32,
                window_nodes: transfer.window.nodes as i32,
                rows,
            };
            let kernel = ["product_1", "product_2", "product_3"][transfer.dimension - 1];
            gpu.launch(kernel, transfer.blocks, transfer.shared, &arguments);
        }
        let [entry_first, entries] = [9, 10].map(|k| transfer.arrays[k].address());
        let n = transfer.nodal * transfer.dimension;
        let none = PointSums::default();
        // `Nodes` of `kernels/data.h`.
        let arguments = arguments! {
            entry_first,
            entries,
            boxes: if passes { transfer.boxes.address() } else { 0 },
            lumped: self.inertia.as_ref().map_or(0, |of| of.masses.lumped.address()),
            lumped_factor: self.inertia.as_ref().map_or(0.0, |of| of.factor * of.lumping),
            u: u.address(),
            prescribed,
            points: self.points.each_ref().map(|points| points.as_ref().map_or(none, |points| points.forces(gpu, u))),
            y: y.address(),
            n: n as i64,
            dimension: transfer.dimension as i32,
        };
        gpu.launch_for("add_boxes", n, &arguments);
    }
}
