//! The shape functions of all particles on a device (`Transfer` of `kernels/data.h`).

use super::device::{Buffer, Gpu, THREADS, arguments};
use super::points::PointSums;
use crate::lanes::LANES;
use crate::lists::Lists;
use std::sync::Arc;

/// Weights that are copied at a time.
const PART: usize = 4 << 20;

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
    /// Of each group: the first row of its weights, the first node of its window as a place in the box, its widths and lanes, a byte each, and
    /// its first particle in the order of the passes.
    pub weights_first: Vec<u32>,
    pub window_first: Vec<u32>,
    pub window_shape: Vec<u32>,
    pub particle_first: Vec<u32>,
    /// Of each active node of a block: its number, and its place in the box.
    pub nodes: Vec<u32>,
    pub places: Vec<u32>,
}

impl TransferArrays {
    /// For each node, the places of all boxes that belong to it, in the order of the blocks.
    fn entries(&self) -> Lists<u32> {
        let bounds = self.node_first.windows(2).zip(&self.box_first);
        let own = bounds.map(|(bounds, first)| (&self.places[bounds[0] as usize..bounds[1] as usize], first));
        let places: Vec<u32> = own.flat_map(|(own, first)| own.iter().map(move |place| first + place)).collect();
        Lists::of_places(&self.nodes, self.nodal).map(|entry| places[entry as usize])
    }

    /// Bytes on a device, with the entries of the nodes and the boxes, without the weights.
    pub(crate) fn bytes(&self) -> usize {
        let lists = [&self.group_first, &self.node_first, &self.box_first, &self.size, &self.weights_first];
        let more =
            [&self.window_first, &self.window_shape, &self.particle_first, &self.nodes, &self.places, &self.nodes];
        let numbers: usize = lists.into_iter().chain(more).map(Vec::len).sum::<usize>() + self.nodal + 1;
        let places = self.box_first.last().map_or(0, |&places| places as usize);
        numbers * size_of::<u32>() + places * self.dimension * size_of::<f64>()
    }

    /// Bytes of shared memory of a thread block: two boxes, the numbers of its particles, the windows of its groups, and the rows of the groups
    /// that are summed at a time.
    pub(crate) fn shared(&self) -> usize {
        self.shared_with(self.dimension * (1 + self.dimension))
    }

    /// [`Self::shared`] with so many numbers of a particle.
    fn shared_with(&self, numbers: usize) -> usize {
        let largest = self.box_first.windows(2).map(|bounds| bounds[1] - bounds[0]).max().unwrap_or(0) as usize;
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
    pub(super) dimension: usize,
    blocks: usize,
    pub(super) nodal: usize,
    /// Bytes of shared memory of a thread block in most passes, and in that of diagonal blocks.
    pub(super) shared: usize,
    pub(super) shared_of_blocks: usize,
    window: LargestWindow,
    /// The arrays of [`TransferArrays`], then the entries of the nodes.
    arrays: [Buffer<u32>; 12],
    weights: Buffer<f64>,
    boxes: Buffer<f64>,
}

/// The numbers that a pass gathers and scatters: values, gradients, or both. `magnitudes` says whether the scatter takes the magnitudes of all weights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gathers {
    pub(super) values: bool,
    pub(super) gradients: bool,
    pub(super) magnitudes: bool,
}

/// `Pass` of `kernels/data.h`.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct PassArguments {
    transfer: TransferArguments,
    u: u64,
    boxes: u64,
    together: i32,
    window_rows: i32,
    window_nodes: i32,
    values: i32,
    gradients: i32,
    magnitudes: i32,
}

/// `NodalSums` of `kernels/data.h`: addresses of the contributions at the nodes, 0 for none.
#[derive(Clone, Copy, Default)]
#[repr(C)]
pub(super) struct NodalSums {
    pub(super) boxes: u64,
    pub(super) start: u64,
    pub(super) lumped: u64,
    pub(super) lumped_factor: f64,
    pub(super) u: u64,
    pub(super) prescribed: u64,
    pub(super) points: [PointSums; 2],
}

/// `Transfer` of `kernels/data.h`.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct TransferArguments {
    before_weights: [u64; 8],
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
        let of_nodes = arrays.entries();
        let [entry_first, entries] = of_nodes.arrays();
        let a = arrays;
        let lists = [
            &a.group_first,
            &a.node_first,
            &a.box_first,
            &a.size,
            &a.weights_first,
            &a.window_first,
            &a.window_shape,
            &a.particle_first,
            &a.nodes,
            &a.places,
            entry_first,
            entries,
        ];
        Self {
            dimension: a.dimension,
            blocks: a.group_first.len().saturating_sub(1),
            nodal: a.nodal,
            shared: a.shared(),
            // Those of all pairs of axes and components, and the mass.
            shared_of_blocks: a.shared_with(a.dimension * a.dimension * (a.dimension + 1) / 2 + 1),
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

    /// The address of the boxes of all blocks.
    pub(super) fn boxes(&self) -> u64 {
        self.boxes.address()
    }

    /// The arguments of a pass that gathers a nodal field from the address `u`.
    pub(super) fn pass(&self, u: u64, gathers: Gathers) -> PassArguments {
        PassArguments {
            transfer: self.arguments(),
            u,
            boxes: self.boxes.address(),
            together: self.window.together(self.dimension) as i32,
            window_rows: self.window.rows as i32,
            window_nodes: self.window.nodes as i32,
            values: gathers.values.into(),
            gradients: gathers.gradients.into(),
            magnitudes: gathers.magnitudes.into(),
        }
    }

    /// Launches one of the kernels for one, two and three dimensions, a thread block for each block of cells.
    pub(super) fn launch<T: Copy>(&self, kernels: [&'static str; 3], shared: usize, arguments: &T) {
        self.gpu.launch(kernels[self.dimension - 1], self.blocks, shared, arguments);
    }

    /// `out = start +` the boxes of all blocks.
    pub(super) fn add_boxes(&self, start: &Buffer<f64>, out: &mut Buffer<f64>) {
        let boxes = NodalSums { boxes: self.boxes.address(), start: start.address(), ..NodalSums::default() };
        self.sum_at_nodes(boxes, out.address());
    }

    /// Sums the contributions at the nodes to the address `y`.
    pub(super) fn sum_at_nodes(&self, sums: NodalSums, y: u64) {
        let [entry_first, entries] = [10, 11].map(|k| self.arrays[k].address());
        let n = self.nodal * self.dimension;
        // `Nodes` of `kernels/data.h`.
        let arguments = arguments! { entry_first, entries, sums, y, n: n as i64, dimension: self.dimension as i32 };
        self.gpu.launch_for("add_boxes", n, &arguments);
    }

    pub(super) fn arguments(&self) -> TransferArguments {
        let at = |k: usize| self.arrays[k].address();
        TransferArguments {
            before_weights: std::array::from_fn(at),
            weights: self.weights.address(),
            after_weights: std::array::from_fn(|k| at(8 + k)),
        }
    }
}
