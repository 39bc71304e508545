//! Linearised tangents of particles, as rows of numbers.

use crate::gpu::{self, Buffer, Gpu};
use crate::lanes::LANES;
use crate::mechanics::constitutive::{AddTo, Form, Product, add_quadratic, product};
use crate::mechanics::sweep::{At, Group, Quadratic};
use crate::pooled::{Pool, Pooled};
use std::sync::{Arc, OnceLock};

/// δσ = 𝔸 : L at all particles, one particle per lane.
#[derive(Clone, Debug)]
pub(crate) struct TangentRows {
    form: Form,
    /// The first group that has rows.
    first: usize,
    /// The rows of a group. Those of 𝔸 come first.
    count: usize,
    factor: f64,
    /// The rows, which all clones share.
    copies: Arc<Copies>,
}

/// The rows of all groups on the processor, on a device, or on both: each is copied when it is first asked for.
#[derive(Debug)]
struct Copies {
    here: OnceLock<Pooled<[f64; LANES]>>,
    there: OnceLock<Arc<Buffer<f64>>>,
    /// The device on which the rows were computed, the number of all rows, and memory for a copy.
    source: Option<(Arc<Gpu>, usize, Pool)>,
}

impl Copies {
    #[inline(always)]
    fn here(&self) -> &[[f64; LANES]] {
        self.here.get_or_init(|| self.fetched())
    }

    /// The rows from the device; NaN after a failure.
    #[cold]
    fn fetched(&self) -> Pooled<[f64; LANES]> {
        let (Some((gpu, rows, pool)), Some(there)) = (&self.source, self.there.get()) else { return Pooled::default() };
        // A loop on all cores could take up another task here. That task would wait for these rows for ever.
        let mut here = pool.unspecified(*rows);
        here.fill([f64::NAN; LANES]);
        gpu.read_at(there, 0, here.as_flattened_mut());
        here
    }
}

impl TangentRows {
    /// Tangents that are stored in `form`, from the group `first` on. Each group has `count` rows.
    pub(crate) fn new(form: Form, first: usize, count: usize, rows: Pooled<[f64; LANES]>) -> Self {
        let copies = Copies { here: rows.into(), there: OnceLock::new(), source: None };
        Self { form, first, count, factor: 1.0, copies: Arc::new(copies) }
    }

    /// The tangents of so many groups, which were computed on a device.
    pub(crate) fn of_device(
        form: Form,
        count: usize,
        groups: usize,
        gpu: &Arc<Gpu>,
        rows: Buffer<f64>,
        pool: &Pool,
    ) -> Self {
        let source = Some((gpu.clone(), groups * count, pool.clone()));
        let copies = Copies { here: OnceLock::new(), there: Arc::new(rows).into(), source };
        Self { form, first: 0, count, factor: 1.0, copies: Arc::new(copies) }
    }

    pub(crate) fn times(self, factor: f64) -> Self {
        Self { factor: factor * self.factor, ..self }
    }

    /// The rows on a device.
    pub(crate) fn on_device(&self, gpu: &Gpu) -> gpu::Rows {
        let Copies { here, there, .. } = &*self.copies;
        let copied = || Arc::new(gpu.copy_of(here.get().map_or(&[], |here| here.as_flattened())));
        let rows = there.get_or_init(copied).clone();
        gpu::Rows { rows, factor: self.factor, form: self.form as i32, count: self.count, cells: None }
    }

    /// The rows of a group.
    #[inline(always)]
    pub(super) fn of_group(&self, group: usize) -> &[[f64; LANES]] {
        &self.copies.here()[(group - self.first) * self.count..][..self.count]
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
