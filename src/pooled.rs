//! Vectors whose memory serves again, as that of deal.II's `GrowingVectorMemory` does: a step that takes as many as the one before
//! allocates none of them.

use crate::parallel::held;
use bytemuck::Pod;
use bytemuck::allocation::try_cast_vec;
use nalgebra::SMatrix;
use std::any::{Any, TypeId};
use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut};
use std::sync::Mutex;

/// Vectors of fewer bytes are no burden to the system's allocator.
const SMALL: usize = 1 << 14;

/// Memory this many times as large as what is asked for waits for something larger.
const TOO_LARGE: usize = 4;

/// What an array has beyond its need, so that a few nodes more do not ask for another one: one part in so many.
const ROOM: usize = 64;

/// Numbers are kept in multiples of so many, so that they can become vectors and tensors of 1 to 3 dimensions, and vector lanes.
const MULTIPLE: usize = 144;

/// Vectors no longer needed, by what they are made of.
static SPARE: Mutex<BTreeMap<TypeId, Box<dyn Any + Send>>> = Mutex::new(BTreeMap::new());

/// What a pooled vector can be made of.
pub trait Element: Send + Sized + 'static {
    /// What its memory is kept as.
    type Kept: Send + 'static;
    /// How many of these it takes.
    const LENGTH: usize;
    /// Memory to be kept, if it has a length that can be.
    fn into_kept(vector: Vec<Self>) -> Option<Vec<Self::Kept>>;
    /// Memory that was kept, if it has a length that can be used.
    fn from_kept(kept: Vec<Self::Kept>) -> Option<Vec<Self>>;
}

/// What is kept as it is.
macro_rules! kept_as_it_is {
    ($($element:ty),*) => {
        $(impl Element for $element {
            type Kept = Self;
            const LENGTH: usize = 1;
            fn into_kept(vector: Vec<Self>) -> Option<Vec<Self>> {
                Some(vector)
            }
            fn from_kept(kept: Vec<Self>) -> Option<Vec<Self>> {
                Some(kept)
            }
        })*
    };
}
pub(crate) use kept_as_it_is;

kept_as_it_is!(f64, f32, u64);

/// What is several numbers is kept as numbers, so that each can have the memory of the other.
macro_rules! kept_as_numbers {
    ($element:ty, $length:expr, <$(const $constant:ident),*>) => {
        impl<X: Pod + Send, $(const $constant: usize),*> Element for $element
        where
            Self: Pod,
        {
            type Kept = X;
            const LENGTH: usize = $length;
            fn into_kept(vector: Vec<Self>) -> Option<Vec<X>> {
                try_cast_vec(vector).ok()
            }
            fn from_kept(mut kept: Vec<X>) -> Option<Vec<Self>> {
                kept.truncate(kept.len() - kept.len() % Self::LENGTH);
                try_cast_vec(kept).ok()
            }
        }
    };
}

kept_as_numbers!(SMatrix<X, R, C>, R * C, <const R, const C>);
kept_as_numbers!([X; N], N, <const N>);

/// Gives all memory that waits back to the system.
///
/// Example: [`Pooled`].
pub fn release() {
    let all = std::mem::take(&mut *held(&SPARE));
    drop(all);
}

/// A vector of anything with room for `count`: the smallest one there is, or a new one in the place of one that has become too small.
fn taken<T: Element>(count: usize) -> Vec<T> {
    if count * size_of::<T>() < SMALL {
        return Vec::with_capacity(count);
    }
    let length = count * T::LENGTH;
    let fits = |one: &Vec<T::Kept>| (length..=TOO_LARGE * length).contains(&one.capacity());
    let kept = held(&SPARE).get_mut(&TypeId::of::<T::Kept>()).and_then(|list| {
        let list = list.downcast_mut::<Vec<Vec<T::Kept>>>()?;
        let smallest = list.iter().enumerate().filter(|(_, one)| fits(one)).min_by_key(|(_, one)| one.capacity());
        let small = || list.iter().position(|one| one.capacity() < length && length <= TOO_LARGE * one.capacity());
        let at = smallest.map(|(at, _)| at).or_else(small)?;
        Some(list.swap_remove(at))
    });
    // What is too small goes now that nobody waits.
    let kept = kept.filter(fits);
    let anew = || T::from_kept(Vec::with_capacity((length + length / ROOM).next_multiple_of(MULTIPLE)));
    kept.and_then(T::from_kept).or_else(anew).unwrap_or_else(|| Vec::with_capacity(count))
}

/// A vector that leaves its memory to the next one.
///
/// ```
/// use bfree::pooled::Pooled;
///
/// let mut ones = Pooled::filled(100_000, 1.0);
/// ones[7] = 8.0;
/// let at = ones.as_ptr();
/// assert_eq!(ones.iter().sum::<f64>(), 100_007.0);
/// drop(ones);
/// // A little shorter, and in the same place.
/// let next: Pooled<f64> = (0..99_990).map(f64::from).collect();
/// assert_eq!((next.len(), next[7], next.as_ptr()), (99_990, 7.0, at));
/// drop(next);
/// bfree::pooled::release();
/// ```
#[derive(PartialEq)]
pub struct Pooled<T: Element>(Vec<T>);

impl<T: Element> Pooled<T> {
    /// Empty, with room for `count`.
    pub fn with_room(count: usize) -> Self {
        let mut vector = taken(count);
        vector.clear();
        Self(vector)
    }

    /// As many as `count` of whatever there is, or else of `value`: to be written over.
    pub fn unspecified(count: usize, value: T) -> Self
    where
        T: Clone,
    {
        let mut vector = taken(count);
        vector.resize(count, value);
        Self(vector)
    }

    /// As a vector that keeps its memory to itself, until it is pooled again.
    pub fn into_vec(mut self) -> Vec<T> {
        std::mem::take(&mut self.0)
    }

    /// One more.
    pub fn push(&mut self, value: T) {
        self.0.push(value);
    }

    /// `count` times `value`.
    pub fn filled(count: usize, value: T) -> Self
    where
        T: Clone,
    {
        let mut vector = Self::with_room(count);
        vector.0.resize(count, value);
        vector
    }
}

impl<T: Element> Drop for Pooled<T> {
    fn drop(&mut self) {
        let vector = std::mem::take(&mut self.0);
        if vector.capacity() * size_of::<T>() < SMALL {
            return;
        }
        let Some(kept) = T::into_kept(vector) else { return };
        let mut spare = held(&SPARE);
        let list = spare.entry(TypeId::of::<T::Kept>()).or_insert_with(|| Box::new(Vec::<Vec<T::Kept>>::new()));
        if let Some(list) = list.downcast_mut::<Vec<Vec<T::Kept>>>() {
            list.push(kept);
        }
    }
}

impl<T: Eq + Element> Eq for Pooled<T> {}

/// Room is taken for as many as the iterator is sure of.
impl<T: Element> FromIterator<T> for Pooled<T> {
    fn from_iter<I: IntoIterator<Item = T>>(items: I) -> Self {
        let items = items.into_iter();
        let mut vector = Self::with_room(items.size_hint().0);
        vector.0.extend(items);
        vector
    }
}

impl<T: Element> From<Vec<T>> for Pooled<T> {
    fn from(vector: Vec<T>) -> Self {
        Self(vector)
    }
}

impl<T: Element> Default for Pooled<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Clone + Element> Clone for Pooled<T> {
    fn clone(&self) -> Self {
        self.iter().cloned().collect()
    }
}

impl<T: std::fmt::Debug + Element> std::fmt::Debug for Pooled<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl<T: Element> Deref for Pooled<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T: Element> DerefMut for Pooled<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.0
    }
}

impl<'a, T: Element> IntoIterator for &'a Pooled<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl<'a, T: Element> IntoIterator for &'a mut Pooled<T> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.0.iter_mut()
    }
}
