//! New particles, and small ones that are joined to their neighbours.

use crate::tensor::Vector;

/// A new particle: its position and its volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed<const D: usize> {
    /// The position x.
    pub position: Vector<f64, D>,
    /// The initial volume V₀.
    pub volume: f64,
}

/// The new particles, cell by cell.
pub(super) struct Seeds<const D: usize> {
    seeds: Vec<Seed<D>>,
    /// The cells that have seeds, in order, and the first seed of each cell.
    cells: Vec<(u64, usize)>,
    /// The slivers: the cell and the number of each seed.
    slivers: Vec<(u64, usize)>,
    /// Cells along each axis.
    count: [u64; D],
}

impl<const D: usize> Seeds<D> {
    /// No seeds, in a box of `count` cells along each axis.
    pub(super) fn new(count: [u64; D]) -> Self {
        Self { seeds: Vec::new(), cells: Vec::new(), slivers: Vec::new(), count }
    }

    /// The seeds added from now on belong to `cell`.
    pub(super) fn begin_cell(&mut self, cell: u64) {
        self.cells.push((cell, self.seeds.len()));
    }

    pub(super) fn add(&mut self, seed: Seed<D>) {
        self.seeds.push(seed);
    }

    /// Adds the seeds of a part of a cell. A sliver becomes a single seed.
    pub(super) fn add_part(&mut self, cell: u64, part: Vec<Seed<D>>, sliver: bool) {
        if !sliver {
            self.seeds.extend(part);
            return;
        }
        let volume = part.iter().map(|seed| seed.volume).sum();
        let moment: Vector<f64, D> = part.iter().map(|seed| seed.position * seed.volume).sum();
        self.slivers.push((cell, self.seeds.len()));
        self.seeds.push(Seed { position: moment / volume, volume });
    }

    /// Joins each sliver to the nearest seed that is not a sliver, in its cell or in a neighbouring cell. Volume and first moments are
    /// kept. The positions before any joining decide which seed is nearest, so the order of cells has no influence.
    pub(super) fn joined(mut self) -> Vec<Seed<D>> {
        let mut gone = vec![false; if self.slivers.is_empty() { 0 } else { self.seeds.len() }];
        self.slivers.iter().for_each(|&(_, sliver)| gone[sliver] = true);
        let nearest = |&(cell, sliver): &(u64, usize)| {
            let far = |i: usize| (self.seeds[i].position - self.seeds[sliver].position).norm_squared();
            let near = self.beside(cell).filter(|&i| !gone[i]).min_by(|&a, &b| far(a).total_cmp(&far(b)));
            (sliver, near)
        };
        let joins: Vec<(usize, Option<usize>)> = self.slivers.iter().map(nearest).collect();
        for (sliver, near) in joins {
            let Some(near) = near else {
                gone[sliver] = false;
                continue;
            };
            let small = self.seeds[sliver];
            let Seed { position, volume } = &mut self.seeds[near];
            let sum = *volume + small.volume;
            *position = (*position * *volume + small.position * small.volume) / sum;
            *volume = sum;
        }
        let mut gone = gone.into_iter();
        self.seeds.retain(|_| !gone.next().unwrap_or(false));
        self.seeds
    }

    /// The seeds of a cell and of the cells that share a face with it.
    fn beside(&self, cell: u64) -> impl Iterator<Item = usize> {
        let (mut near, mut stride) = (vec![cell], 1);
        for &n in &self.count {
            let index = cell / stride % n;
            near.extend((index > 0).then(|| cell - stride));
            near.extend((index + 1 < n).then(|| cell + stride));
            stride *= n;
        }
        near.into_iter().flat_map(|cell| {
            let after = self.cells.partition_point(|one| one.0 < cell);
            let start = self.cells.get(after).filter(|one| one.0 == cell).map(|one| one.1);
            let end = self.cells.get(after + 1).map_or(self.seeds.len(), |one| one.1);
            start.into_iter().flat_map(move |start| start..end)
        })
    }
}
