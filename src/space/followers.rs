//! The extension E applied to vector fields, some of whose components are prescribed.

use crate::aggregation::Extension;
use crate::gpu::{self, Gpu};
use crate::parallel;
use crate::scalar::Real;
use crate::tensor::Vector;
use std::sync::Arc;

/// The extension E for vector fields. A prescribed component of an outer node does not follow inner nodes.
#[derive(Clone, Debug, Default)]
pub struct Followers<const D: usize> {
    extension: Arc<Extension>,
    /// For each outer node, the components that follow.
    follows: Vec<[bool; D]>,
}

impl<const D: usize> Followers<D> {
    /// E without the pairs `(node, component)` in `prescribed`: a prescribed component does not follow.
    ///
    /// ```
    /// use bfree::aggregation::{Extension, Occupied, Pieces};
    /// use bfree::space::Followers;
    /// use bfree::tensor::Vector;
    ///
    /// let nodes: Vec<[u32; 3]> = (0..5).map(|i| [i, 0, 0]).collect();
    /// let cells = [1.0, 1.0, 1.0, 0.1].iter().zip(0..).map(|(&share, i)| ([i, 0, 0], share)).collect();
    /// let occupied = Occupied { dimension: 1, grid: [8, 0, 0], nodes: &nodes, cells };
    /// let followers = Followers::<1>::new(Extension::new(Pieces::LINEAR, &occupied).into(), [].into_iter());
    /// // u = E û continues a linear field; Eᵀ f keeps its resultant and its moment.
    /// let mut field: Vec<_> = [0.0, 1.0, 2.0, 3.0, 0.0].map(|x| Vector::from([x])).into();
    /// followers.extend(&mut field);
    /// assert_eq!(field[4][0], 4.0);
    /// let mut force: Vec<_> = [0.0, 0.0, 0.0, 0.0, 1.0].map(|x| Vector::from([x])).into();
    /// followers.restrict(&mut force);
    /// assert_eq!(force, [0.0, 0.0, -1.0, 2.0, 0.0].map(|x| Vector::from([x])));
    /// ```
    pub fn new(extension: Arc<Extension>, prescribed: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut follows = vec![[true; D]; extension.len()];
        for (node, component) in prescribed {
            if let Ok(place) = extension.outer().binary_search(&(node as u32)) {
                follows[place][component] = false;
            }
        }
        Self { extension, follows }
    }

    /// Whether every node is an unknown.
    pub(crate) fn is_empty(&self) -> bool {
        self.extension.is_empty()
    }

    /// For each outer node: the components that follow, and the inner nodes with their weights.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (usize, [bool; D], impl Iterator<Item = (usize, f64)>)> {
        self.extension.rows().zip(&self.follows).map(|((outer, leaders), follows)| (outer, *follows, leaders))
    }

    /// E on a device; `None` if every node is an unknown.
    pub(crate) fn on_device(&self, gpu: &Gpu) -> Option<gpu::Followers> {
        (!self.is_empty())
            .then(|| gpu::Followers::new(gpu, self.extension.rows_and_transpose(), self.follows.as_flattened()))
    }

    /// The row of an outer node; `None` for other nodes.
    pub(crate) fn row(&self, node: usize) -> Option<([bool; D], impl Iterator<Item = (usize, f64)>)> {
        let place = self.extension.outer().binary_search(&(node as u32)).ok()?;
        Some((self.follows[place], self.extension.leaders(place)))
    }

    /// u = E û, in place.
    pub fn extend<T: Real + Send + Sync>(&self, field: &mut [Vector<T, D>]) {
        let sum = |place: usize| {
            let leaders = self.extension.leaders(place);
            leaders.fold(Vector::<T, D>::zeros(), |sum, (leader, weight)| sum + field[leader] * T::lit(weight))
        };
        let sums = parallel::values_by(PART, self.extension.len(), sum);
        for ((&outer, follows), sum) in self.extension.outer().iter().zip(&self.follows).zip(sums) {
            (0..D).filter(|&i| follows[i]).for_each(|i| field[outer as usize][i] = sum[i]);
        }
    }

    /// R̂ = Eᵀ R, in place. Components that follow become zero.
    pub fn restrict<T: Real + Send + Sync>(&self, forces: &mut [Vector<T, D>]) {
        self.restrict_with(forces, |weight| weight);
    }

    /// |E|ᵀ applied to round-off bounds, in place.
    pub(crate) fn restrict_magnitudes<T: Real + Send + Sync>(&self, magnitudes: &mut [Vector<T, D>]) {
        self.restrict_with(magnitudes, f64::abs);
    }

    fn restrict_with<T: Real + Send + Sync>(&self, forces: &mut [Vector<T, D>], of: impl Fn(f64) -> f64 + Sync) {
        let mut moved = vec![Vector::<T, D>::zeros(); self.extension.len()];
        for ((&outer, follows), moved) in self.extension.outer().iter().zip(&self.follows).zip(&mut moved) {
            for i in (0..D).filter(|&i| follows[i]) {
                moved[i] = std::mem::replace(&mut forces[outer as usize][i], T::zero());
            }
        }
        let inner = self.extension.inner();
        let sum = |at: usize| {
            let followers = self.extension.followers(at);
            let force = forces[inner[at] as usize];
            followers.fold(force, |sum, (place, weight)| sum + moved[place] * T::lit(of(weight)))
        };
        let sums = parallel::values_by(PART, inner.len(), sum);
        inner.iter().zip(sums).for_each(|(&leader, sum)| forces[leader as usize] = sum);
    }
}

/// Number of rows in one part of the work of a thread.
const PART: usize = 128;
