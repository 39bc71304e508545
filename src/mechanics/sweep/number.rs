//! The number types of nodal fields. Gather and scatter are linear, so a dual number is two fields of plain numbers.

use super::group::At;
use crate::parallel::Message;
use crate::scalar::Real;
use crate::tensor::Vector;
use num_dual::Dual64;
use std::array::from_fn;
use std::borrow::Cow;

/// A number made of one or more plain numbers. Each of them is a field of its own in the kernels.
pub trait Number: Real + Message + Send + Sync + 'static {
    /// Number of plain numbers in it.
    const FIELDS: usize;

    /// The `i`-th plain number.
    fn field(&self, i: usize) -> f64;

    /// The number made of the plain numbers `field(0)`, `field(1)`, ….
    fn from_fields(field: impl FnMut(usize) -> f64) -> Self;

    /// A nodal field as plain numbers: node after node, field after field, component after component.
    fn flat<const C: usize>(nodal: &[Vector<Self, C>]) -> Cow<'_, [f64]> {
        let numbers = |x: &Vector<Self, C>| {
            let x = *x;
            (0..Self::FIELDS).flat_map(move |i| (0..C).map(move |c| x[c].field(i)))
        };
        Cow::Owned(nodal.iter().flat_map(numbers).collect())
    }

    /// Calls `point` with the numbers made of the gathered `fields`. Its sums go into the fields of `sums`, which are zero before.
    #[doc(hidden)]
    fn at<const C: usize, const D: usize>(
        fields: &[At<f64, C, D>],
        sums: &mut [At<f64, C, D>],
        point: impl FnOnce(&At<Self, C, D>, &mut At<Self, C, D>),
    ) {
        let number = |x: &dyn Fn(&At<f64, C, D>) -> f64| Self::from_fields(|i| x(&fields[i]));
        let at = At {
            value: from_fn(|c| from_fn(|lane| number(&|at| at.value[c][lane]))),
            gradient: from_fn(|c| from_fn(|k| from_fn(|lane| number(&|at| at.gradient[c][k][lane])))),
        };
        let mut sum = At::<Self, C, D>::zero();
        point(&at, &mut sum);
        for (i, sums) in sums.iter_mut().enumerate() {
            let field = |x: Self| x.field(i);
            sums.value = sum.value.map(|row| row.map(field));
            sums.gradient = sum.gradient.map(|rows| rows.map(|row| row.map(field)));
        }
    }

    /// Calls `add` with a nodal field as plain numbers, and writes them back.
    fn add_flat<const C: usize>(nodal: &mut [Vector<Self, C>], add: impl FnOnce(&mut [f64])) {
        let mut sums = Self::flat(nodal).into_owned();
        add(&mut sums);
        for (x, sums) in nodal.iter_mut().zip(sums.chunks(C * Self::FIELDS)) {
            *x = Vector::from_fn(|c, _| Self::from_fields(|i| sums[i * C + c]));
        }
    }
}

impl Number for f64 {
    const FIELDS: usize = 1;

    #[inline(always)]
    fn field(&self, _: usize) -> f64 {
        *self
    }

    #[inline(always)]
    fn from_fields(mut field: impl FnMut(usize) -> f64) -> Self {
        field(0)
    }

    fn flat<const C: usize>(nodal: &[Vector<Self, C>]) -> Cow<'_, [f64]> {
        Cow::Borrowed(bytemuck::cast_slice(nodal))
    }

    fn at<const C: usize, const D: usize>(
        fields: &[At<f64, C, D>],
        sums: &mut [At<f64, C, D>],
        point: impl FnOnce(&At<Self, C, D>, &mut At<Self, C, D>),
    ) {
        point(&fields[0], &mut sums[0]);
    }

    fn add_flat<const C: usize>(nodal: &mut [Vector<Self, C>], add: impl FnOnce(&mut [f64])) {
        add(bytemuck::cast_slice_mut(nodal));
    }
}

impl Number for Dual64 {
    const FIELDS: usize = 2;

    #[inline(always)]
    fn field(&self, i: usize) -> f64 {
        [self.re, self.eps][i]
    }

    #[inline(always)]
    fn from_fields(mut field: impl FnMut(usize) -> f64) -> Self {
        Self::new(field(0), field(1))
    }
}
