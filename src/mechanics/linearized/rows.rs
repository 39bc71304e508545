//! Linearised tangents of particles, as rows of numbers.

use crate::gpu::{self, Buffer, Gpu};
use crate::lanes::LANES;
use crate::mechanics::constitutive::{AddTo, Form, Product, add_quadratic, product};
use crate::mechanics::sweep::{At, Group, Quadratic};
use crate::pooled::Pooled;
use std::sync::{Arc, OnceLock};

/// δσ = 𝔸 : L at all particles, one particle per lane.
#[derive(Clone, Debug)]
pub(crate) struct TangentRows {
    form: Form,
    /// The first group that has rows.
    first: usize,
    /// The rows of a group. Those of 𝔸 come first.
    count: usize,
    rows: Arc<Pooled<[f64; LANES]>>,
    factor: f64,
    /// The copy on a device, which all clones share.
    copy: Arc<OnceLock<Arc<Buffer<f64>>>>,
}

impl TangentRows {
    /// Tangents that are stored in `form`, from the group `first` on. Each group has `count` rows.
    pub(crate) fn new(form: Form, first: usize, count: usize, rows: Pooled<[f64; LANES]>) -> Self {
        Self { form, first, count, rows: Arc::new(rows), factor: 1.0, copy: Arc::default() }
    }

    pub(crate) fn times(self, factor: f64) -> Self {
        Self { factor: factor * self.factor, ..self }
    }

    /// A copy on a device.
    pub(crate) fn on_device(&self, gpu: &Gpu) -> gpu::Rows {
        let rows = self.copy.get_or_init(|| Arc::new(gpu.copy_of(self.rows.as_flattened()))).clone();
        gpu::Rows { rows, factor: self.factor, form: self.form as i32, count: self.count, cells: None }
    }

    /// The rows of a group.
    #[inline(always)]
    pub(super) fn of_group(&self, group: usize) -> &[[f64; LANES]] {
        &self.rows[(group - self.first) * self.count..][..self.count]
    }

    #[inline(always)]
    pub(crate) fn add_product<const D: usize>(&self, group: Group<'_>, at: &At<f64, D, D>, sums: &mut At<f64, D, D>) {
        let (form, l) = (self.form, at.gradient.as_flattened());
        let rows = &self.of_group(group.number)[..form.rows(D)];
        if self.factor == 1.0 {
            return product(D, Product { form, rows, l, out: sums.gradient.as_flattened_mut() });
        }
        let mut unscaled = [[[0.0; LANES]; D]; D];
        product(D, Product { form, rows, l, out: unscaled.as_flattened_mut() });
        for (sum, x) in sums.gradient.as_flattened_mut().iter_mut().zip(unscaled.as_flattened()) {
            (0..LANES).for_each(|lane| sum[lane] += self.factor * x[lane]);
        }
    }

    pub(crate) fn add_quadratic(&self, dimension: usize, group: Group<'_>, into: &mut Quadratic) {
        let rows = &self.of_group(group.number)[..self.form.rows(dimension)];
        add_quadratic(dimension, AddTo { form: self.form, rows, factor: self.factor, into });
    }
}
