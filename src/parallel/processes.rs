//! Processes that run the same program side by side, such as those that MPI starts, and their messages.
//!
//! All processes make the same calls in the same order, and all of them receive the same answers. So they hold the same numbers, and take the
//! same decisions.

use bytemuck::Pod;
use nalgebra::SMatrix;
use num_dual::Dual64;
use std::fmt::Debug;
use std::slice::Iter;
use std::sync::Arc;

/// The way in which processes reach each other.
pub trait Exchange: Debug + Send + Sync {
    /// The number of this process, from 0.
    fn rank(&self) -> usize;

    /// The number of processes.
    fn count(&self) -> usize;

    /// Each process has written its part of `all`. The parts lie one after the other in the order of the processes, and `lengths` has their
    /// bytes. Fills in the parts of all other processes.
    fn exchange(&self, lengths: &[usize], all: &mut [u8]);

    /// Joins the parts of all processes in `all` of process 0; the others receive nothing, and their `all` is empty. `lengths` has the bytes of
    /// the parts.
    fn collect(&self, lengths: &[usize], own: &[u8], all: &mut [u8]) {
        let (mut joined, before) = (vec![0; lengths.iter().sum()], lengths[..self.rank()].iter().sum::<usize>());
        joined[before..before + own.len()].copy_from_slice(own);
        self.exchange(lengths, &mut joined);
        if self.rank() == 0 {
            all.copy_from_slice(&joined);
        }
    }
}

/// The processes of a run. By default there is one.
///
/// ```
/// use bfree::parallel::Processes;
///
/// let alone = Processes::default();
/// assert_eq!((alone.rank(), alone.count()), (0, 1));
/// // Three processes, as threads of this program: each adds its own number.
/// let sums = std::thread::scope(|scope| {
///     let ask = |one: Processes| scope.spawn(move || one.joined(vec![one.rank() as f64]).0.iter().sum::<f64>());
///     Processes::as_threads(3).into_iter().map(ask).collect::<Vec<_>>().into_iter().map(|one| one.join()).collect::<Vec<_>>()
/// });
/// assert!(sums.into_iter().all(|sum| sum.is_ok_and(|sum| sum == 3.0)));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Processes(Option<Arc<dyn Exchange>>);

impl Processes {
    /// This process alone.
    pub(crate) const ALONE: Self = Self(None);

    /// The processes that reach each other in this way.
    pub fn new(exchange: impl Exchange + 'static) -> Self {
        if exchange.count() > 1 { Self(Some(Arc::new(exchange))) } else { Self::default() }
    }

    /// The number of this process, from 0.
    pub fn rank(&self) -> usize {
        self.0.as_ref().map_or(0, |exchange| exchange.rank())
    }

    /// The number of processes.
    pub fn count(&self) -> usize {
        self.0.as_ref().map_or(1, |exchange| exchange.count())
    }

    /// Whether this is process 0, which writes the results.
    pub(crate) fn is_first(&self) -> bool {
        self.rank() == 0
    }

    /// Whether there is more than one process.
    pub(crate) fn are_several(&self) -> bool {
        self.0.is_some()
    }

    /// Each process has written its part of `all`, whose lengths are known. Fills in the other parts.
    pub(crate) fn share<T: Pod>(&self, lengths: &[usize], all: &mut [T]) {
        if let Some(exchange) = &self.0 {
            let lengths: Vec<usize> = lengths.iter().map(|length| length * size_of::<T>()).collect();
            exchange.exchange(&lengths, bytemuck::cast_slice_mut(all));
        }
    }

    /// The parts of all processes, whose lengths are known, joined in their order in process 0. The others receive nothing.
    pub(crate) fn collected<T: Pod>(&self, lengths: &[usize], own: &[T]) -> Option<Vec<T>> {
        let Some(exchange) = &self.0 else { return Some(own.to_vec()) };
        let mut all = if self.is_first() { vec![T::zeroed(); lengths.iter().sum()] } else { Vec::new() };
        let lengths: Vec<usize> = lengths.iter().map(|length| length * size_of::<T>()).collect();
        exchange.collect(&lengths, bytemuck::cast_slice(own), bytemuck::cast_slice_mut(&mut all));
        self.is_first().then_some(all)
    }

    /// The lists of all processes, joined in their order, and their lengths.
    pub fn joined<T: Pod>(&self, own: Vec<T>) -> (Vec<T>, Vec<usize>) {
        let Some(exchange) = &self.0 else {
            let length = own.len();
            return (own, vec![length]);
        };
        let lengths: Vec<usize> = self.each(own.len() as u64).into_iter().map(|length| length as usize).collect();
        let before: usize = lengths[..exchange.rank()].iter().sum();
        let mut all = vec![T::zeroed(); lengths.iter().sum()];
        all[before..before + own.len()].copy_from_slice(&own);
        self.share(&lengths, &mut all);
        (all, lengths)
    }

    /// The values of all processes, in their order.
    pub fn each<T: Pod>(&self, own: T) -> Vec<T> {
        let mut all = vec![own; self.count()];
        self.share(&vec![1; self.count()], &mut all);
        all
    }

    /// Whether the answer of any process is yes.
    pub fn any(&self, own: bool) -> bool {
        self.each(u8::from(own)).contains(&1)
    }

    /// The first process with another value than process 0.
    pub(crate) fn first_other<T: Pod + PartialEq>(&self, own: T) -> Option<usize> {
        let all = self.each(own);
        all.iter().position(|one| *one != all[0])
    }

    /// The messages of all processes, in their order.
    pub(crate) fn told<M: Message>(&self, own: &M) -> Vec<M> {
        let mut numbers = Vec::new();
        own.put(&mut numbers);
        let (numbers, _) = self.joined(numbers);
        let mut numbers = numbers.iter();
        (0..self.count()).map(|_| M::take(&mut numbers)).collect()
    }
}

/// A value that travels between processes as numbers.
pub trait Message: Sized {
    /// Appends the numbers of the value.
    fn put(&self, to: &mut Vec<f64>);

    /// The value from the next numbers. Numbers behind the last are NaN.
    fn take(from: &mut Iter<'_, f64>) -> Self;

    /// The value made of zeros. It fills an array before the results are written.
    fn blank() -> Self {
        // No value has more numbers.
        Self::take(&mut [0.0; 128].iter())
    }
}

impl Message for f64 {
    fn put(&self, to: &mut Vec<f64>) {
        to.push(*self);
    }

    fn take(from: &mut Iter<'_, f64>) -> Self {
        from.next().copied().unwrap_or(f64::NAN)
    }
}

impl Message for Dual64 {
    fn put(&self, to: &mut Vec<f64>) {
        to.extend([self.re, self.eps]);
    }

    fn take(from: &mut Iter<'_, f64>) -> Self {
        Self::new(f64::take(from), f64::take(from))
    }
}

impl Message for usize {
    fn put(&self, to: &mut Vec<f64>) {
        to.push(*self as f64);
    }

    fn take(from: &mut Iter<'_, f64>) -> Self {
        f64::take(from) as Self
    }
}

impl Message for bool {
    fn put(&self, to: &mut Vec<f64>) {
        usize::from(*self).put(to);
    }

    fn take(from: &mut Iter<'_, f64>) -> Self {
        usize::take(from) == 1
    }
}

impl Message for () {
    fn put(&self, _: &mut Vec<f64>) {}

    fn take(_: &mut Iter<'_, f64>) -> Self {}
}

impl<M: Message> Message for Option<M> {
    fn put(&self, to: &mut Vec<f64>) {
        self.is_some().put(to);
        self.iter().for_each(|one| one.put(to));
    }

    fn take(from: &mut Iter<'_, f64>) -> Self {
        bool::take(from).then(|| M::take(from))
    }
}

impl<M: Message> Message for Vec<M> {
    fn put(&self, to: &mut Vec<f64>) {
        self.len().put(to);
        self.iter().for_each(|one| one.put(to));
    }

    fn take(from: &mut Iter<'_, f64>) -> Self {
        (0..usize::take(from)).map(|_| M::take(from)).collect()
    }
}

impl<M: Message, const N: usize> Message for [M; N] {
    fn put(&self, to: &mut Vec<f64>) {
        self.iter().for_each(|one| one.put(to));
    }

    fn take(from: &mut Iter<'_, f64>) -> Self {
        std::array::from_fn(|_| M::take(from))
    }
}

impl<M: Message + nalgebra::Scalar, const R: usize, const C: usize> Message for SMatrix<M, R, C> {
    fn put(&self, to: &mut Vec<f64>) {
        self.iter().for_each(|one| one.put(to));
    }

    fn take(from: &mut Iter<'_, f64>) -> Self {
        Self::from_fn(|_, _| M::take(from))
    }
}

impl<A: Message, B: Message> Message for (A, B) {
    fn put(&self, to: &mut Vec<f64>) {
        self.0.put(to);
        self.1.put(to);
    }

    fn take(from: &mut Iter<'_, f64>) -> Self {
        (A::take(from), B::take(from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    /// A value after it has travelled.
    fn travelled<M: Message>(value: &M) -> M {
        let mut numbers = Vec::new();
        value.put(&mut numbers);
        let mut left = numbers.iter();
        let arrived = M::take(&mut left);
        assert_eq!(left.next(), None);
        arrived
    }

    #[test]
    fn values_arrive_as_they_were() {
        let matrix = SMatrix::<f64, 2, 3>::new(1.0, -0.0, f64::NAN, 4.0, 5e-324, 6.0);
        assert!(travelled(&matrix).iter().zip(&matrix).all(|(a, b)| a.to_bits() == b.to_bits()));
        let nested = (vec![(7_usize, [true, false]), (0, [false, true])], Some(Dual64::new(1.0, 2.0)));
        assert_eq!(travelled(&nested), nested);
        assert_eq!(travelled(&None::<f64>), None);
    }

    #[test]
    fn everyone_receives_the_lists_of_all_in_order() {
        let ask = |one: Processes| {
            thread::spawn(move || {
                let own: Vec<u32> = (0..one.rank() as u32).collect();
                let (all, lengths) = one.joined(own);
                assert_eq!((all, lengths), (vec![0, 0, 1, 0, 1, 2], vec![0, 1, 2, 3]));
                assert_eq!([one.any(one.rank() == 2), one.any(false)], [true, false]);
                assert_eq!(one.told(&(one.rank(), true)).len(), 4);
            })
        };
        let team: Vec<_> = Processes::as_threads(4).into_iter().map(ask).collect();
        team.into_iter().for_each(|one| one.join().unwrap());
    }
}
