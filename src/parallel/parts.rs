//! Rows of arrays, one for each particle, that several processes share: each process has those of a contiguous range of particles, its own.

use super::processes::{Message, Processes};
use bytemuck::Pod;
use std::ops::Range;

/// Terms of a sum that are in memory at the same time.
const TERMS: usize = 64 * super::PART;

/// The particles of each process.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Parts {
    /// The first particle of each process; at the end, the number of particles. Empty if every process has all.
    bounds: Vec<usize>,
    /// The first particle whose rows are here.
    first: usize,
}

/// A change of all arrays.
pub(crate) trait Change {
    /// Changes an array with `width` elements a particle.
    fn apply<T: Pod + Send + Sync>(&self, array: &mut Vec<T>, width: usize);
}

/// Particles that go to other processes, and to other places in memory.
pub(crate) struct Moved<'a> {
    processes: &'a Processes,
    /// The first particle that was here.
    first: usize,
    /// The former places of the particles that are to be here.
    from: Vec<usize>,
    /// The former places of the particles that go to another process, by the process that has them.
    leaving: Vec<Vec<usize>>,
    /// The particles that come: the number in `from`, the process that has it, and its number there.
    arriving: Vec<(usize, usize, usize)>,
}

impl Change for Moved<'_> {
    fn apply<T: Pod + Send + Sync>(&self, array: &mut Vec<T>, width: usize) {
        if width == 0 || self.processes.each(array.len() as u64).iter().all(|len| *len == 0) {
            return;
        }
        let row = |from: usize| (from - self.first) * width..(from - self.first + 1) * width;
        let lengths: Vec<usize> = self.leaving.iter().map(|leaving| leaving.len() * width).collect();
        let starts: Vec<usize> = (0..lengths.len()).map(|process| lengths[..process].iter().sum()).collect();
        let rank = self.processes.rank();
        let mut told = vec![T::zeroed(); lengths.iter().sum()];
        for (to, &from) in told[starts[rank]..].chunks_mut(width).zip(&self.leaving[rank]) {
            to.copy_from_slice(&array[row(from)]);
        }
        self.processes.share(&lengths, &mut told);
        let mut moved = vec![T::zeroed(); self.from.len() * width];
        let here = self.first..self.first + array.len() / width;
        super::rows(&mut moved, width, |number, to| {
            let from = self.from[number];
            if here.contains(&from) {
                to.copy_from_slice(&array[row(from)]);
            }
        });
        for &(number, process, place) in &self.arriving {
            let from = starts[process] + place * width;
            moved[number * width..][..width].copy_from_slice(&told[from..from + width]);
        }
        *array = moved;
    }
}

/// All particles come to process 0, or to everyone.
pub(crate) struct Collected<'a> {
    processes: &'a Processes,
    parts: &'a Parts,
    to_everyone: bool,
}

impl Change for Collected<'_> {
    fn apply<T: Pod + Send + Sync>(&self, array: &mut Vec<T>, width: usize) {
        let Self { processes, parts, to_everyone } = self;
        if width == 0 || processes.each(array.len() as u64).iter().all(|len| *len == 0) {
            return;
        }
        let lengths: Vec<usize> = parts.counts().map(|count| count * width).collect();
        if *to_everyone {
            *array = processes.joined(std::mem::take(array)).0;
        } else if let Some(all) = processes.collected(&lengths, array) {
            *array = all;
        }
    }
}

/// Only the own particles stay: those from the first one that was here.
pub(crate) struct Kept(Range<usize>);

impl Change for Kept {
    fn apply<T: Pod + Send + Sync>(&self, array: &mut Vec<T>, width: usize) {
        if array.len() > self.0.len() * width {
            *array = array[self.0.start * width..self.0.end * width].to_vec();
        }
    }
}

impl Parts {
    /// Whether every process has the rows of all particles.
    pub(crate) fn are_whole(&self) -> bool {
        self.bounds.is_empty()
    }

    /// The first particle of each process; at the end, the number of particles. Empty if every process has all.
    pub(crate) fn bounds(&self) -> &[usize] {
        &self.bounds
    }

    /// The index of the row of a particle of this process.
    #[inline(always)]
    pub(crate) fn local_index(&self, particle: usize) -> usize {
        particle - self.first
    }

    /// Whether this process has the particle as its own.
    pub(crate) fn is_own(&self, processes: &Processes, particle: usize) -> bool {
        self.of(processes.rank()).contains(&particle)
    }

    /// The process that has a particle.
    pub(crate) fn owner(&self, particle: usize) -> usize {
        self.bounds.partition_point(|&first| first <= particle) - 1
    }

    /// The particles of a process.
    fn of(&self, process: usize) -> Range<usize> {
        self.bounds[process]..self.bounds[process + 1]
    }

    /// The number of particles of each process.
    fn counts(&self) -> impl Iterator<Item = usize> {
        self.bounds.windows(2).map(|ends| ends[1] - ends[0])
    }

    /// The change by which each process has the particles between its two `bounds`, after the particle at `order[i]` has moved to the place `i`;
    /// and the parts then.
    pub(crate) fn moved<'a>(
        &self,
        order: Option<&[u32]>,
        bounds: Vec<usize>,
        processes: &'a Processes,
    ) -> (Moved<'a>, Self) {
        let rank = processes.rank();
        let from = |place: usize| order.map_or(place, |order| order[place] as usize);
        let (mut leaving, mut arriving) = (vec![Vec::new(); processes.count()], Vec::new());
        for (process, ends) in bounds.windows(2).enumerate().filter(|_| !self.are_whole()) {
            let was_here = self.of(process);
            for place in (ends[0]..ends[1]).filter(|&place| !was_here.contains(&from(place))) {
                let owner = self.owner(from(place));
                if process == rank {
                    arriving.push((place - ends[0], owner, leaving[owner].len()));
                }
                leaving[owner].push(from(place));
            }
        }
        let own = bounds[rank]..bounds[rank + 1];
        let after = Self { bounds, first: own.start };
        (Moved { processes, first: self.first, from: own.map(from).collect(), leaving, arriving }, after)
    }

    /// The change by which process 0 gets all particles, from those that every process has after [`Self::kept`]; and the parts then.
    pub(crate) fn collected<'a>(&'a self, processes: &'a Processes) -> (Collected<'a>, Self) {
        let first = if processes.is_first() { 0 } else { self.first };
        (Collected { processes, parts: self, to_everyone: false }, Self { first, ..self.clone() })
    }

    /// The change by which every process gets all particles; and the parts then.
    pub(crate) fn joined<'a>(&'a self, processes: &'a Processes) -> (Collected<'a>, Self) {
        (Collected { processes, parts: self, to_everyone: true }, Self::default())
    }

    /// The change by which a process forgets the particles of others, and the parts then.
    pub(crate) fn kept(&self, processes: &Processes) -> (Kept, Self) {
        let own = self.of(processes.rank());
        (Kept(self.local_index(own.start)..self.local_index(own.end)), Self { first: own.start, ..self.clone() })
    }

    /// `value(p)` of some particles in the order of memory, which their own processes evaluate.
    pub(crate) fn of_some<R: Message>(
        &self,
        processes: &Processes,
        some: impl IntoIterator<Item = usize>,
        value: impl Fn(usize) -> R,
    ) -> Vec<R> {
        if self.are_whole() {
            return some.into_iter().map(value).collect();
        }
        let here = some.into_iter().filter(|&p| self.is_own(processes, p));
        processes.told(&here.map(value).collect::<Vec<R>>()).into_iter().flatten().collect()
    }

    /// `value` at any particle. If not every process has all particles, their own processes evaluate it at once.
    pub(crate) fn everywhere<R: Pod + Send + Sync>(
        &self,
        processes: &Processes,
        value: impl Fn(usize) -> R + Sync,
    ) -> impl Fn(usize) -> R + Sync {
        let told = self.bounds.last().map(|&count| {
            let (mut all, own) = (vec![R::zeroed(); count], self.of(processes.rank()));
            super::each(&mut all[own.clone()], |number, one| *one = value(own.start + number));
            processes.share(&self.counts().collect::<Vec<_>>(), &mut all);
            all
        });
        move |p| told.as_ref().map_or_else(|| value(p), |all| all[p])
    }

    /// `start` + value(0) + value(1) + … of so many particles, added in this order. With `processes`, each adds its own particles in turn, and all
    /// make this call.
    pub(crate) fn sum<const N: usize>(
        &self,
        (processes, count): (Option<&Processes>, usize),
        start: [f64; N],
        value: impl Fn(usize) -> [f64; N] + Sync,
    ) -> [f64; N] {
        let terms = |some: Range<usize>| {
            let of_part = |part: Range<usize>| part.map(|number| value(some.start + number)).collect::<Vec<_>>();
            super::collect(super::parts(some.len()), &of_part)
        };
        let added = |sum: [f64; N], terms: &[Vec<[f64; N]>]| {
            terms.iter().flatten().fold(sum, |sum, term| std::array::from_fn(|k| sum[k] + term[k]))
        };
        let Some(processes) = processes.filter(|_| !self.are_whole()) else {
            let some = (0..count).step_by(TERMS).map(|first| first..count.min(first + TERMS));
            return some.fold(start, |sum, some| added(sum, &terms(some)));
        };
        let own = terms(self.of(processes.rank()));
        (0..processes.count()).fold(start, |sum, turn| {
            let sum = if turn == processes.rank() { added(sum, &own) } else { sum };
            processes.each(sum)[turn]
        })
    }
}
