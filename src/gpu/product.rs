//! The product of a linearised step with a nodal field, on a device (`kernels/data.h` and `kernels/transfer.h`).

use super::device::{Buffer, Gpu, GpuError, THREADS};
use super::points::{PointSums, Points};
use super::vectors::GpuVector;
use crate::lanes::LANES;
use std::sync::{Arc, Mutex, PoisonError};

/// Weights that are copied at a time.
const PART: usize = 4 << 20;

/// Most sets of rows of a product.
pub(crate) const SETS: usize = 4;

/// Bytes of shared memory for the rows of groups that are summed at a time. Four thread blocks then fit on a multiprocessor.
const STAGED: usize = 12 << 10;

/// Bytes of `Window` of `kernels/data.h`.
const WINDOW: usize = 64;

/// The shape functions of all particles as plain arrays, block by block. Without the weights, which are large.
#[derive(Debug, Default)]
pub(crate) struct TransferArrays {
    pub dimension: usize,
    /// Number of active nodes.
    pub nodal: usize,
    /// Of each block, and at the end: the first group, the first entry of `nodes`, and the first place of all boxes.
    pub group_first: Vec<u32>,
    pub node_first: Vec<u32>,
    pub box_first: Vec<u32>,
    /// Nodes of each box along the three axes.
    pub size: Vec<u32>,
    /// Of each group: the first row of its weights, the first node of its window as a place in the box, and its widths and lanes, a byte each.
    pub weights_first: Vec<u32>,
    pub window_first: Vec<u32>,
    pub window_shape: Vec<u32>,
    /// Of each active node of a block: its number, and its place in the box.
    pub nodes: Vec<u32>,
    pub places: Vec<u32>,
}

impl TransferArrays {
    /// For each node, the start of its entries, and the entries: the places of all boxes that belong to it, in the order of the blocks.
    fn entries(&self) -> [Vec<u32>; 2] {
        let mut first = vec![0; self.nodal + 1];
        self.nodes.iter().for_each(|&node| first[node as usize + 1] += 1);
        (0..self.nodal).for_each(|node| first[node + 1] += first[node]);
        let (mut next, mut entries) = (first.clone(), vec![0; self.nodes.len()]);
        for (block, bounds) in self.node_first.windows(2).enumerate() {
            let own = bounds[0] as usize..bounds[1] as usize;
            for (&node, &place) in self.nodes[own.clone()].iter().zip(&self.places[own]) {
                let next = &mut next[node as usize];
                entries[*next as usize] = self.box_first[block] + place;
                *next += 1;
            }
        }
        [first, entries]
    }

    /// Bytes on a device, with the entries of the nodes and the boxes, without the weights.
    pub(crate) fn bytes(&self) -> usize {
        let lists = [&self.group_first, &self.node_first, &self.box_first, &self.size, &self.weights_first];
        let more = [&self.window_first, &self.window_shape, &self.nodes, &self.places, &self.nodes];
        let numbers: usize = lists.into_iter().chain(more).map(Vec::len).sum::<usize>() + self.nodal + 1;
        let places = self.box_first.last().map_or(0, |&places| places as usize);
        numbers * size_of::<u32>() + places * self.dimension * size_of::<f64>()
    }

    /// Bytes of shared memory of a thread block: two boxes, the numbers of its particles, the windows of its groups, and the rows of the groups
    /// that are summed at a time.
    pub(crate) fn shared(&self) -> usize {
        let largest = self.box_first.windows(2).map(|bounds| bounds[1] - bounds[0]).max().unwrap_or(0) as usize;
        let numbers = self.dimension * (1 + self.dimension);
        let staged = self.dimension * self.largest_window().together(self.dimension) * self.largest_window().nodes;
        size_of::<f64>() * (2 * self.dimension * largest + numbers * THREADS + staged) + THREADS / LANES * WINDOW
    }

    /// The most rows along x and nodes of a window.
    fn largest_window(&self) -> LargestWindow {
        let mut largest = LargestWindow { rows: 1, nodes: 1 };
        for [x, y, z, _] in self.window_shape.iter().map(|shape| shape.to_le_bytes()) {
            let rows = usize::from(y) * usize::from(z);
            largest = LargestWindow { rows: largest.rows.max(rows), nodes: largest.nodes.max(usize::from(x) * rows) };
        }
        largest
    }
}

/// The most rows along x and nodes of a window.
#[derive(Clone, Copy, Debug)]
struct LargestWindow {
    rows: usize,
    nodes: usize,
}

impl LargestWindow {
    /// Groups of particles whose rows are summed at a time.
    fn together(self, dimension: usize) -> usize {
        (STAGED / (self.nodes * dimension * size_of::<f64>())).clamp(1, THREADS / LANES)
    }
}

/// The shape functions of all particles on a device.
#[derive(Debug)]
pub(crate) struct Transfer {
    gpu: Arc<Gpu>,
    dimension: usize,
    blocks: usize,
    nodal: usize,
    shared: usize,
    window: LargestWindow,
    /// The arrays of [`TransferArrays`], then the entries of the nodes.
    arrays: [Buffer<u32>; 11],
    weights: Buffer<f64>,
    boxes: Buffer<f64>,
}

/// `Transfer` of `kernels/data.h`.
#[derive(Clone, Copy)]
#[repr(C)]
struct TransferArguments {
    before_weights: [u64; 7],
    weights: u64,
    after_weights: [u64; 4],
}

impl Transfer {
    /// Copies the arrays to a device, and the weights of block after block.
    pub(crate) fn new<'a>(
        gpu: Arc<Gpu>,
        arrays: &TransferArrays,
        weights: impl Iterator<Item = &'a [[f64; LANES]]> + Clone,
    ) -> Self {
        gpu.keep_failure(gpu.check_shared(arrays.shared()));
        let rows = weights.clone().map(<[_]>::len).sum::<usize>();
        let (mut on_device, mut at, mut part) = (gpu.memory_for(rows * LANES), 0, Vec::with_capacity(PART));
        for rows in weights {
            if part.len() + rows.len() * LANES > PART {
                gpu.write_at(&part, &mut on_device, at);
                at += part.len();
                part.clear();
            }
            part.extend_from_slice(rows.as_flattened());
        }
        gpu.write_at(&part, &mut on_device, at);
        let places = arrays.box_first.last().copied().unwrap_or(0) as usize;
        let [entry_first, entries] = arrays.entries();
        let a = arrays;
        let lists = [
            &a.group_first,
            &a.node_first,
            &a.box_first,
            &a.size,
            &a.weights_first,
            &a.window_first,
            &a.window_shape,
            &a.nodes,
            &a.places,
            &entry_first,
            &entries,
        ];
        Self {
            dimension: a.dimension,
            blocks: a.group_first.len().saturating_sub(1),
            nodal: a.nodal,
            shared: a.shared(),
            window: a.largest_window(),
            arrays: lists.map(|list| gpu.copy_of(list)),
            weights: on_device,
            boxes: gpu.memory_for(places * a.dimension),
            gpu,
        }
    }

    /// The device.
    pub(crate) fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    fn arguments(&self) -> TransferArguments {
        let at = |k: usize| self.arrays[k].address();
        TransferArguments {
            before_weights: std::array::from_fn(at),
            weights: self.weights.address(),
            after_weights: std::array::from_fn(|k| at(7 + k)),
        }
    }
}

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

/// `Volumes` of `kernels/data.h`.
#[derive(Clone, Copy)]
#[repr(C)]
struct VolumesArguments {
    transfer: TransferArguments,
    u: u64,
    rows: u64,
    volumes: u64,
    count: i32,
    first_of_b: i32,
}

/// `Cells` of `kernels/points.h`.
#[derive(Clone, Copy)]
#[repr(C)]
struct CellsArguments {
    first: u64,
    members: u64,
    stiffness: u64,
    volumes: u64,
    changes: u64,
    n: i64,
}

impl Rows {
    /// Computes the changes of pressure of averaged cells by a nodal field, and returns the arguments of these rows.
    fn arguments(&self, transfer: &Transfer, u: &GpuVector) -> RowsArguments {
        let (rows, form, count) = (self.rows.address(), self.form, self.count as i32);
        let alone = RowsArguments { rows, factor: self.factor, form, count, ..RowsArguments::default() };
        let Some(cells) = &self.cells else { return alone };
        let volumes = VolumesArguments {
            transfer: transfer.arguments(),
            u: u.address(),
            rows,
            volumes: cells.volumes.address(),
            count,
            first_of_b: cells.first_of_b as i32,
        };
        let kernel = ["volumes_1", "volumes_2", "volumes_3"][transfer.dimension - 1];
        transfer.gpu.launch(kernel, transfer.blocks, transfer.shared, &volumes);
        let [first, members] = cells.members.each_ref().map(Buffer::address);
        let n = cells.stiffness.len();
        let sums = CellsArguments {
            first,
            members,
            stiffness: cells.stiffness.address(),
            volumes: cells.volumes.address(),
            changes: cells.changes.address(),
            n: n as i64,
        };
        transfer.gpu.launch_for("cell_pressures", n, &sums);
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
struct RowsArguments {
    rows: u64,
    factor: f64,
    cells: u64,
    changes: u64,
    form: i32,
    count: i32,
    first_of_a: i32,
}

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

/// `Product` of `kernels/data.h`.
#[derive(Clone, Copy)]
#[repr(C)]
struct ProductArguments {
    transfer: TransferArguments,
    u: u64,
    boxes: u64,
    mass: u64,
    mass_factor: f64,
    consistent: f64,
    sets: i32,
    together: i32,
    window_rows: i32,
    window_nodes: i32,
    rows: [RowsArguments; SETS],
}

/// `Nodes` of `kernels/data.h`.
#[derive(Clone, Copy)]
#[repr(C)]
struct NodesArguments {
    entry_first: u64,
    entries: u64,
    boxes: u64,
    lumped: u64,
    lumped_factor: f64,
    u: u64,
    prescribed: u64,
    points: [PointSums; 2],
    y: u64,
    n: i64,
    dimension: i32,
}

/// E, by which outer nodes follow inner ones, on a device.
#[derive(Debug)]
pub(crate) struct Followers {
    outer: [Buffer<u32>; 3],
    follows: Buffer<u8>,
    leader_weights: Buffer<f64>,
    inner: [Buffer<u32>; 3],
    follower_weights: Buffer<f64>,
    moved: Buffer<f64>,
    dimension: usize,
}

/// `Followers` of `kernels/data.h`.
#[derive(Clone, Copy)]
#[repr(C)]
struct FollowersArguments {
    outer: u64,
    follows: u64,
    leader_first: u64,
    leaders: u64,
    leader_weights: u64,
    outer_count: i64,
    inner: u64,
    follower_first: u64,
    followers: u64,
    follower_weights: u64,
    inner_count: i64,
    field: u64,
    moved: u64,
    dimension: i32,
}

/// Sparse rows: the number of each row, and its entries with weights.
pub(crate) type SparseRows<'a> = &'a mut dyn Iterator<Item = (u32, Vec<(u32, f64)>)>;

/// Numbers of rows, starts of rows, entries, weights.
fn flat(rows: SparseRows<'_>) -> ([Vec<u32>; 3], Vec<f64>) {
    let (mut numbers, mut starts, mut entries, mut weights) = (Vec::new(), vec![0], Vec::new(), Vec::new());
    for (number, row) in rows {
        numbers.push(number);
        entries.extend(row.iter().map(|&(entry, _)| entry));
        weights.extend(row.iter().map(|&(_, weight)| weight));
        starts.push(entries.len() as u32);
    }
    ([numbers, starts, entries], weights)
}

impl Followers {
    /// The outer nodes with their inner ones, the inner nodes with the places of their outer ones, and whether each component of an outer node
    /// follows.
    pub(crate) fn new(gpu: &Gpu, outer: SparseRows<'_>, inner: SparseRows<'_>, follows: &[bool]) -> Self {
        let ((outer, leader_weights), (inner, follower_weights)) = (flat(outer), flat(inner));
        let follows: Vec<u8> = follows.iter().map(|&one| u8::from(one)).collect();
        Self {
            dimension: follows.len() / outer[0].len().max(1),
            outer: outer.map(|list| gpu.copy_of(&list)),
            leader_weights: gpu.copy_of(&leader_weights),
            inner: inner.map(|list| gpu.copy_of(&list)),
            follower_weights: gpu.copy_of(&follower_weights),
            moved: gpu.memory_for(follows.len()),
            follows: gpu.copy_of(&follows),
        }
    }

    fn launch(&self, gpu: &Gpu, kernel: &'static str, count: usize, field: &GpuVector) {
        let ([outer, leader_first, leaders], [inner, follower_first, followers]) =
            (self.outer.each_ref().map(Buffer::address), self.inner.each_ref().map(Buffer::address));
        let arguments = FollowersArguments {
            outer,
            follows: self.follows.address(),
            leader_first,
            leaders,
            leader_weights: self.leader_weights.address(),
            outer_count: self.outer[0].len() as i64,
            inner,
            follower_first,
            followers,
            follower_weights: self.follower_weights.address(),
            inner_count: self.inner[0].len() as i64,
            field: field.address(),
            moved: self.moved.address(),
            dimension: self.dimension as i32,
        };
        gpu.launch_for(kernel, count * self.dimension, &arguments);
    }

    /// u = E û, in place.
    pub(crate) fn extend(&self, gpu: &Gpu, field: &mut GpuVector) {
        self.launch(gpu, "extend", self.outer[0].len(), field);
    }

    /// R̂ = Eᵀ R, in place.
    pub(crate) fn restrict(&self, gpu: &Gpu, forces: &mut GpuVector) {
        self.launch(gpu, "take_followers", self.outer[0].len(), forces);
        self.launch(gpu, "give_leaders", self.inner[0].len(), forces);
    }
}

/// `Fixed` of `kernels/data.h`.
#[derive(Clone, Copy)]
#[repr(C)]
struct FixedArguments {
    fixed: u64,
    field: u64,
    n: i64,
}

/// Sets the fixed values of a field to zero.
pub(crate) fn clear_fixed(gpu: &Gpu, fixed: &Buffer<u8>, field: &mut GpuVector) {
    let n = fixed.len();
    gpu.launch_for("clear_fixed", n, &FixedArguments { fixed: fixed.address(), field: field.address(), n: n as i64 });
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
        let mut extended = self.extended.lock().unwrap_or_else(PoisonError::into_inner);
        gpu.copy(&x.0, &mut extended.0);
        followers.extend(gpu, &mut extended);
        self.apply_to_all(&extended, 0, y);
        followers.restrict(gpu, y);
        clear_fixed(gpu, &self.prescribed, y);
    }

    /// The product at all nodes, except those whose address is given as prescribed.
    fn apply_to_all(&self, u: &GpuVector, prescribed: u64, y: &mut GpuVector) {
        let (gpu, transfer) = (self.transfer.gpu(), &*self.transfer);
        let has_mass = self.inertia.as_ref().filter(|of| of.lumping < 1.0);
        let passes = has_mass.is_some() || !self.rows.is_empty();
        if passes {
            let mut rows = [RowsArguments::default(); SETS];
            for (to, from) in rows.iter_mut().zip(&self.rows) {
                *to = from.arguments(transfer, u);
            }
            let arguments = ProductArguments {
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
        let arguments = NodesArguments {
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
