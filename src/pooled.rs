//! A memory pool for vectors, like deal.II's `GrowingVectorMemory`. A step that takes as many vectors as the step before allocates none.

use crate::parallel::{self, held};
use bytemuck::Pod;
use bytemuck::allocation::try_cast_vec;
use nalgebra::{SMatrix, SVector};
use std::fmt::{Debug, Formatter};
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex};

/// Vectors of fewer bytes are not pooled: they are no burden to the system's allocator.
const SMALL: usize = 1 << 14;

/// A spare vector more than this many times larger than needed is kept for a larger request.
const TOO_LARGE: usize = 4;

/// A new vector has spare room of one part in this number, so that a few more nodes need no new allocation.
const ROOM: usize = 64;

/// Lengths of new vectors are multiples of this number, so that the memory fits vectors and tensors of 1 to 3 dimensions, and vector lanes.
const MULTIPLE: usize = 144;

/// A memory pool that lends vectors. A clone shares the memory of the pool. A vector returns to the pool when it is dropped. The pool is
/// freed with its last clone and its last vector.
///
/// ```
/// use bfree::pooled::Pool;
///
/// let pool = Pool::default();
/// let mut ones = pool.filled(100_000, 1.0);
/// ones[7] = 8.0;
/// let at = ones.as_ptr();
/// assert_eq!(ones.iter().sum::<f64>(), 100_007.0);
/// drop(ones);
/// // A slightly shorter vector has the same memory.
/// let next = pool.collect((0..99_990).map(f64::from));
/// assert_eq!((next.len(), next[7], next.as_ptr()), (99_990, 7.0, at));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Pool(Arc<Mutex<Vec<Vec<f64>>>>);

/// An element of a pooled vector: a number, or several numbers side by side. Vectors of different elements can reuse the same memory.
pub trait Element: Pod + Send + Sync {}

impl Element for f64 {}

impl<const R: usize, const C: usize> Element for SMatrix<f64, R, C> where Self: Pod {}

impl<const N: usize> Element for [f64; N] {}

impl Pool {
    /// A vector of `count` times `value`.
    #[track_caller]
    pub fn filled<T: Element>(&self, count: usize, value: T) -> Pooled<T> {
        self.made(count, |_| value)
    }

    /// `f(0)`, …, `f(count − 1)`, on all cores.
    #[track_caller]
    pub(crate) fn made<T: Element>(&self, count: usize, f: impl Fn(usize) -> T + Sync) -> Pooled<T> {
        let mut vector = self.unspecified(count);
        parallel::each(&mut vector, |i, x| *x = f(i));
        vector
    }

    /// A copy, made on all cores.
    #[track_caller]
    pub(crate) fn copy_of<T: Element>(&self, x: &[T]) -> Pooled<T> {
        let mut copy = self.unspecified(x.len());
        parallel::copy(x, &mut copy);
        copy
    }

    /// A vector of `count` unspecified elements, to be overwritten.
    pub(crate) fn unspecified<T: Element>(&self, count: usize) -> Pooled<T> {
        Pooled { vector: self.taken(count), len: count, pool: self.clone() }
    }

    /// A vector of all items, with room for the least number of items that the iterator promises.
    pub fn collect<T: Element>(&self, items: impl IntoIterator<Item = T>) -> Pooled<T> {
        let mut items = items.into_iter();
        let mut vector = self.taken(items.size_hint().0);
        let mut len = 0;
        for (place, item) in vector.iter_mut().zip(items.by_ref()) {
            *place = item;
            len += 1;
        }
        if len == vector.len() {
            vector.extend(items);
            len = vector.len();
        }
        Pooled { vector, len, pool: self.clone() }
    }

    /// A vector of at least `count` unspecified elements: the smallest spare one that fits, or a new one. A new vector replaces a spare one
    /// that has become too small. The system gives it as zeros, and provides its memory when it is first written, on any thread.
    fn taken<T: Element>(&self, count: usize) -> Vec<T> {
        if count * size_of::<T>() < SMALL {
            return vec![T::zeroed(); count];
        }
        let numbers = size_of::<T>() / size_of::<f64>();
        let length = count * numbers;
        let fits = |one: &Vec<f64>| (length..=TOO_LARGE * length).contains(&one.len());
        let kept = {
            let mut list = held(&self.0);
            let smallest = list.iter().enumerate().filter(|(_, one)| fits(one)).min_by_key(|(_, one)| one.len());
            let small = || list.iter().position(|one| one.len() < length && length <= TOO_LARGE * one.len());
            smallest.map(|(at, _)| at).or_else(small).map(|at| list.swap_remove(at))
        };
        // A vector that is too small is freed here, after the lock is released.
        let kept = kept.filter(fits).unwrap_or_else(|| vec![0.0; (length + length / ROOM).next_multiple_of(MULTIPLE)]);
        try_cast_vec(kept).unwrap_or_else(|_| vec![T::zeroed(); count])
    }
}

/// A vector on loan from a [`Pool`].
pub struct Pooled<T: Element> {
    /// The elements, and behind them unspecified ones.
    vector: Vec<T>,
    len: usize,
    pool: Pool,
}

impl<T: Element> Pooled<T> {
    /// The pool of the vector.
    pub(crate) fn pool(&self) -> &Pool {
        &self.pool
    }

    /// The vector as plain numbers, in the same memory.
    pub(crate) fn into_numbers(mut self) -> Pooled<f64> {
        let vector = try_cast_vec(std::mem::take(&mut self.vector)).unwrap_or_default();
        Pooled { vector, len: self.len * size_of::<T>() / size_of::<f64>(), pool: self.pool.clone() }
    }
}

impl Pooled<f64> {
    /// The numbers as vectors of R components, in the same memory.
    pub(crate) fn of_vectors<const R: usize>(mut self) -> Pooled<SVector<f64, R>>
    where
        SVector<f64, R>: Element,
    {
        let vector = try_cast_vec(std::mem::take(&mut self.vector)).unwrap_or_default();
        Pooled { vector, len: self.len / R, pool: self.pool.clone() }
    }
}

impl<T: Element + Debug> Debug for Pooled<T> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self).finish()
    }
}

impl<T: Element> Drop for Pooled<T> {
    fn drop(&mut self) {
        let vector = std::mem::take(&mut self.vector);
        if size_of_val(&*vector) < SMALL {
            return;
        }
        if let Ok(kept) = try_cast_vec(vector) {
            held(&self.pool.0).push(kept);
        }
    }
}

impl<T: Element + PartialEq> PartialEq for Pooled<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T: Element> Default for Pooled<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T: Element> From<Vec<T>> for Pooled<T> {
    fn from(vector: Vec<T>) -> Self {
        Self { len: vector.len(), vector, pool: Pool::default() }
    }
}

impl<T: Element> Clone for Pooled<T> {
    fn clone(&self) -> Self {
        self.pool.copy_of(self)
    }
}

impl<T: Element> Deref for Pooled<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        &self.vector[..self.len]
    }
}

impl<T: Element> DerefMut for Pooled<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.vector[..self.len]
    }
}

impl<'a, T: Element> IntoIterator for &'a Pooled<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a, T: Element> IntoIterator for &'a mut Pooled<T> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}
