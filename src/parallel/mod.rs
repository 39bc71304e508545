//! Work on all cores and in several [processes](Processes), in an order that does not depend on their number.
//!
//! Threads receive tasks as `dyn Fn`. Their code is therefore compiled once for each type of parts, and not for every kind of work.
//!
//! Shared work is a list of tasks, here called a *region*. The time outside of regions limits the speed-up by threads. [`record`] measures both.

mod as_threads;
mod mpi;
mod parts;
mod processes;

pub use mpi::MpiError;
pub(crate) use parts::{Change, Parts};
pub use processes::{Exchange, Message, Processes};

use bytemuck::Pod;
use rayon::prelude::*;
use std::cell::RefCell;
use std::ops::Range;
use std::panic::Location;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// The most threads of a run.
pub(crate) const MOST_THREADS: u64 = 1024;

/// Sets the number of threads. Without this call there are as many threads as cores.
///
/// # Errors
/// The threads cannot be started, or their number was set before.
pub(crate) fn use_threads(count: usize) -> Result<(), rayon::ThreadPoolBuildError> {
    rayon::ThreadPoolBuilder::new().num_threads(count).build_global()
}

/// The number of threads.
pub fn threads() -> usize {
    rayon::current_num_threads()
}

/// Whether there is more than one thread. While regions are recorded, the answer is yes.
pub(crate) fn several() -> bool {
    threads() > 1 || records()
}

/// A region that ran in [`record`]: one call of a function of this file.
#[derive(Clone, Debug)]
pub struct Region {
    /// The line that shares the work.
    pub place: &'static Location<'static>,
    /// The beginning.
    pub begin: Instant,
    /// The end.
    pub end: Instant,
    /// Seconds of each task.
    pub tasks: Vec<f64>,
}

thread_local! {
    /// The regions that this thread has recorded, while it records.
    static REGIONS: RefCell<Option<Vec<Region>>> = const { RefCell::new(None) };
}

fn records() -> bool {
    REGIONS.with_borrow(Option::is_some)
}

/// Runs `f` with the tasks of every region one after the other, and measures them. Results have the same bits as with any number of threads.
/// Only regions that this thread shares are recorded. A region inside a task belongs to that task.
///
/// ```
/// let mut simulation = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?.build::<2>("scenes".as_ref())?;
/// let (step, regions) = bfree::parallel::record(|| simulation.step());
/// assert!(step?.newton.history.iterations.len() > 1);
/// assert!(regions.iter().all(|region| region.tasks.iter().sum::<f64>() <= (region.end - region.begin).as_secs_f64()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn record<R>(f: impl FnOnce() -> R) -> (R, Vec<Region>) {
    REGIONS.set(Some(Vec::new()));
    let result = f();
    (result, REGIONS.take().unwrap_or_default())
}

/// Calls `task(0)`, …, `task(count − 1)`, each on any free thread. This is the only call of the pool, so its code is compiled once.
fn run(place: &'static Location<'static>, count: usize, task: &(dyn Fn(usize) + Sync)) {
    if records() {
        record_region(place, count, task);
    } else if count > 1 {
        (0..count).into_par_iter().for_each(task);
    } else {
        (0..count).for_each(task);
    }
}

/// Calls all tasks in order, and records the times.
fn record_region(place: &'static Location<'static>, count: usize, task: &(dyn Fn(usize) + Sync)) {
    let before = REGIONS.take();
    let begin = Instant::now();
    let mut last = begin;
    let tasks = (0..count).map(|number| {
        task(number);
        let before = std::mem::replace(&mut last, Instant::now());
        (last - before).as_secs_f64()
    });
    let tasks = tasks.collect();
    let mut regions = before.unwrap_or_default();
    regions.push(Region { place, begin, end: last, tasks });
    REGIONS.set(Some(regions));
}

/// Runs `f` on a thread of the pool. Shared work begins there at once. On any other thread, every piece of shared work first wakes a thread of the
/// pool, and at its end that thread wakes the caller.
///
/// A function that must run on its own thread does not belong here: Python's check for Ctrl-C, for example. The pool does not survive `fork`.
pub(crate) fn in_pool<R: Send>(f: impl FnOnce() -> R + Send) -> R {
    rayon::scope(|_| f())
}

/// Runs `f` with this number of threads.
#[cfg(test)]
pub(crate) fn with_threads<R: Send>(count: usize, f: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap().install(f)
}

/// Locks a mutex. The data stays usable after a thread panicked while it held the lock.
pub(crate) fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Calls `f(part)` for every part, each on any free thread.
#[track_caller]
pub(crate) fn for_each<P: Send>(parts: impl Iterator<Item = P>, f: &(dyn Fn(P) + Sync)) {
    collect(parts, f);
}

/// [`for_each`] with scratch space, which is reused from part to part.
#[track_caller]
pub(crate) fn for_each_with<P: Send, S: Send + Default>(
    parts: impl Iterator<Item = P>,
    f: &(dyn Fn(&mut S, P) + Sync),
) {
    let spare = Mutex::new(Vec::new());
    collect(parts, &|part| {
        let scratch = held(&spare).pop();
        let mut scratch = scratch.unwrap_or_default();
        f(&mut scratch, part);
        held(&spare).push(scratch);
    });
}

/// `f(0)`, …, `f(count − 1)`.
#[track_caller]
pub(crate) fn map<R: Send>(count: usize, f: &(dyn Fn(usize) -> R + Sync)) -> Vec<R> {
    collect(0..count, f)
}

/// `f(part)` of every part.
#[track_caller]
pub(crate) fn collect<P: Send, R: Send>(parts: impl Iterator<Item = P>, f: &(dyn Fn(P) -> R + Sync)) -> Vec<R> {
    if !several() {
        return parts.map(f).collect();
    }
    // A part, and then its result. Each is locked once.
    let tasks: Vec<_> = parts.map(|part| Mutex::new((Some(part), None))).collect();
    run(Location::caller(), tasks.len(), &|number| {
        let mut task = held(&tasks[number]);
        task.1 = task.0.take().map(f);
    });
    tasks.into_iter().filter_map(|task| task.into_inner().unwrap_or_else(PoisonError::into_inner).1).collect()
}

/// Particles or nodes in one task of a pass over arrays.
pub(crate) const PART: usize = 2048;

/// The parts of `0..count`.
pub(crate) fn parts(count: usize) -> impl Iterator<Item = Range<usize>> {
    parts_of(PART, count)
}

fn parts_of(size: usize, count: usize) -> impl Iterator<Item = Range<usize>> {
    (0..count).step_by(size).map(move |first| first..count.min(first + size))
}

/// Below this number of elements, waking the threads costs more than short work at each of them.
pub(crate) const FEW: usize = 8 * PART;

/// `f(i, x_i)` for all elements, with short work at each.
#[track_caller]
pub(crate) fn each<X: Send>(x: &mut [X], f: impl Fn(usize, &mut X) + Sync) {
    if x.len() < FEW { x.iter_mut().enumerate().for_each(|(i, x)| f(i, x)) } else { each_by(PART, x, f) }
}

/// `f(i, x_i)` for all elements, with `size` of them in a task.
#[track_caller]
pub(crate) fn each_by<X: Send>(size: usize, x: &mut [X], f: impl Fn(usize, &mut X) + Sync) {
    for_each(x.chunks_mut(size).enumerate(), &|(part, x): (usize, &mut [X])| {
        (part * size..).zip(x).for_each(|(i, x)| f(i, x));
    });
}

/// `f(x, y)` for all pairs of elements, with short work at each.
#[track_caller]
pub(crate) fn zip<X: Send, Y: Sync>(x: &mut [X], y: &[Y], f: impl Fn(&mut X, &Y) + Sync) {
    let part = |(x, y): (&mut [X], &[Y])| x.iter_mut().zip(y).for_each(|(x, y)| f(x, y));
    if x.len() < FEW { part((x, y)) } else { for_each(x.chunks_mut(PART).zip(y.chunks(PART)), &part) }
}

/// Copies `from` to `to`.
#[track_caller]
pub(crate) fn copy<X: Copy + Send + Sync>(from: &[X], to: &mut [X]) {
    zip(to, from, |to, from| *to = *from);
}

/// A copy in memory of its own.
#[track_caller]
pub(crate) fn copy_of<X: Pod + Send + Sync>(from: &[X]) -> Vec<X> {
    let mut to = bytemuck::zeroed_vec(from.len());
    copy(from, &mut to);
    to
}

/// Sets all elements to `value`.
#[track_caller]
pub(crate) fn fill<X: Copy + Send + Sync>(x: &mut [X], value: X) {
    each(x, |_, x| *x = value);
}

/// `f(i, row i)` for all rows of `width` elements.
#[track_caller]
pub(crate) fn rows<X: Send>(x: &mut [X], width: usize, f: impl Fn(usize, &mut [X]) + Sync) {
    let count = (PART / width).max(1);
    for_each(x.chunks_mut(count * width).enumerate(), &|(part, rows): (usize, &mut [X])| {
        (part * count..).zip(rows.chunks_mut(width)).for_each(|(i, row)| f(i, row));
    });
}

/// The list to which `f(0, list)`, …, `f(count − 1, list)` append in this order. A task makes `size` of the calls.
#[track_caller]
pub(crate) fn list_by<R: Send>(size: usize, count: usize, f: impl Fn(usize, &mut Vec<R>) + Sync) -> Vec<R> {
    let of_part = |part: Range<usize>| {
        let mut list = Vec::new();
        part.for_each(|i| f(i, &mut list));
        list
    };
    let mut parts = collect(parts_of(size, count), &of_part).into_iter();
    let mut all = parts.next().unwrap_or_default();
    parts.for_each(|part| all.extend(part));
    all
}

/// `f(0)`, …, `f(count − 1)`, with `size` of them in a task.
#[track_caller]
pub(crate) fn values_by<R: Send>(size: usize, count: usize, f: impl Fn(usize) -> R + Sync) -> Vec<R> {
    list_by(size, count, |i, list| list.push(f(i)))
}

/// `f(0) + f(1) + …`, added in this order.
#[track_caller]
pub(crate) fn sum(count: usize, f: impl Fn(usize) -> f64 + Sync) -> f64 {
    let of_part = |part: Range<usize>| -> Vec<f64> { part.map(&f).collect() };
    if count < FEW { (0..count).map(f).sum() } else { collect(parts(count), &of_part).iter().flatten().sum() }
}

/// Sorts. Elements that are equal must be the same.
pub(crate) fn sort<K: Ord + Send>(keys: &mut [K]) {
    keys.par_sort_unstable();
}

/// The failure with the smallest number, whichever threads and processes failed.
pub(crate) struct First<E>(Mutex<Option<(usize, E)>>);

impl<E> First<E> {
    pub(crate) fn none() -> Self {
        Self(Mutex::new(None))
    }

    pub(crate) fn keep(&self, number: usize, error: E) {
        let mut first = held(&self.0);
        if first.as_ref().is_none_or(|(before, _)| number < *before) {
            *first = Some((number, error));
        }
    }

    /// The failure with the smallest number in this process, and this number.
    pub(crate) fn here(self) -> Option<(usize, E)> {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    /// The failure with the smallest number of all processes, and this number.
    pub(crate) fn anywhere(self, processes: &Processes) -> Option<(usize, E)>
    where
        E: Message,
    {
        let all = processes.told(&self.here());
        all.into_iter().flatten().min_by_key(|(number, _)| *number)
    }

    /// # Errors
    /// The failure with the smallest number of all processes.
    pub(crate) fn check(self, processes: &Processes) -> Result<(), E>
    where
        E: Message,
    {
        self.anywhere(processes).map_or(Ok(()), |(_, error)| Err(error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_in_the_pool_runs_on_one_of_its_threads() {
        assert_eq!(rayon::current_thread_index(), None);
        let [outer, inner] = in_pool(|| [rayon::current_thread_index(), in_pool(rayon::current_thread_index)]);
        assert!(outer.is_some() && inner == outer, "{outer:?}, {inner:?}");
    }

    #[test]
    fn everything_is_done_once_and_in_its_place() {
        for threads in [1, 3] {
            with_threads(threads, || {
                assert_eq!(several(), threads > 1);
                assert_eq!(map(1000, &|k| 3 * k), (0..1000).map(|k| 3 * k).collect::<Vec<_>>());
                let mut numbers = vec![0; 1000];
                for_each_with(numbers.chunks_mut(7).enumerate(), &|scratch: &mut Vec<usize>, (k, part)| {
                    scratch.clear();
                    scratch.extend((0..part.len()).map(|i| 7 * k + i));
                    part.iter_mut().zip(scratch).for_each(|(number, &mut i)| *number += i);
                });
                assert!(numbers.iter().enumerate().all(|(i, &number)| i == number));
            });
        }
    }

    #[test]
    fn long_lists_are_cut_into_parts_and_keep_their_order() {
        for (threads, count) in [(1, 20_000), (3, 20_000), (3, 2 * PART), (3, FEW), (3, 1), (3, 0)] {
            with_threads(threads, || {
                assert_eq!(parts(count).flatten().collect::<Vec<_>>(), (0..count).collect::<Vec<_>>());
                assert_eq!(values_by(7, count, |i| 3 * i), (0..count).map(|i| 3 * i).collect::<Vec<_>>());
                let thirds = list_by(11, count, |i, list: &mut Vec<usize>| list.extend((i % 3 == 0).then_some(i)));
                assert_eq!(thirds, (0..count).step_by(3).collect::<Vec<_>>());
                let mut copied = vec![0; count];
                copy(&thirds, &mut copied);
                assert!(copied.iter().zip(&thirds).all(|(a, b)| a == b) && copy_of(&thirds) == thirds);
                let mut numbers = vec![1; count];
                each(&mut numbers, |i, x| *x += i);
                rows(&mut numbers, 7, |row, numbers| numbers.iter_mut().for_each(|x| *x += 10 * row));
                assert!(numbers.iter().enumerate().all(|(i, &x)| x == 1 + i + 10 * (i / 7)));
                // Harmonic numbers, added from the first term: another order has other bits.
                let term = |i: usize| 1.0 / (i + 1) as f64;
                assert_eq!(sum(count, term).to_bits(), (0..count).map(term).sum::<f64>().to_bits());
            });
        }
    }
}
