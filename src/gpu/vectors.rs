//! Vectors on a device, and their operations (`kernels/vectors.h`).

use super::device::{Buffer, Gpu, SHARED_SUM, arguments};
use crate::space::vector::{self, Along, CHUNK, Vectors};

/// A vector of numbers on a device.
#[derive(Debug)]
pub struct GpuVector(pub(crate) Buffer<f64>);

impl Gpu {
    /// The vector with these numbers.
    pub fn vector(&self, numbers: &[f64]) -> GpuVector {
        GpuVector(self.copy_of(numbers))
    }

    /// The numbers of a vector; NaN after a failure.
    pub fn numbers(&self, vector: &GpuVector) -> Vec<f64> {
        let mut numbers = vec![f64::NAN; vector.0.len()];
        self.read_at(&vector.0, 0, &mut numbers);
        numbers
    }
}

impl GpuVector {
    pub(super) fn address(&self) -> u64 {
        self.0.address()
    }
}

impl Gpu {
    /// z = M r for a matrix M of diagonal blocks with `dimension` rows, stored column by column. Where there are no blocks, z = r.
    pub(crate) fn multiply_blocks(&self, blocks: &Buffer<f64>, dimension: usize, r: &GpuVector, z: &mut GpuVector) {
        let n = (blocks.len() / dimension).min(r.0.len()).min(z.0.len());
        if n < r.0.len() {
            Vectors::copy(self, r, z);
        }
        let (r, z) = (r.address(), z.address());
        let arguments = arguments! { blocks: blocks.address(), r, z, n: n as i64, dimension: dimension as i32 };
        self.launch_for("multiply_blocks", n, &arguments);
    }

    fn update(&self, kernel: &'static str, [a, b]: [f64; 2], x: &GpuVector, y: &GpuVector) {
        let n = x.0.len().min(y.0.len());
        self.launch_for(kernel, n, &arguments! { x: x.address(), y: y.address(), a, b, n: n as i64 });
    }
}

impl Vectors for Gpu {
    type Vector = GpuVector;
    type Owned = Box<GpuVector>;

    fn len(&self, x: &GpuVector) -> usize {
        x.0.len()
    }

    fn unspecified(&self, n: usize) -> Box<GpuVector> {
        Box::new(GpuVector(self.memory_for(n)))
    }

    fn clear(&self, y: &mut GpuVector) {
        Self::clear(self, &mut y.0);
    }

    fn copy(&self, x: &GpuVector, y: &mut GpuVector) {
        Self::copy(self, &x.0, &mut y.0);
    }

    fn dot(&self, x: &GpuVector, y: &GpuVector) -> f64 {
        let n = x.0.len().min(y.0.len());
        let count = n.div_ceil(CHUNK);
        self.sum(count, |partial| {
            let arguments = arguments! { x: x.address(), y: y.address(), partial, n: n as i64 };
            self.launch("dot", count, SHARED_SUM, &arguments);
        })
    }

    fn norm_with(&self, square: f64, x: &GpuVector) -> f64 {
        if vector::is_safe_square(square) {
            return square.sqrt();
        }
        // Squares underflow or overflow, or an entry is not finite. This is rare.
        vector::norm_with(square, &self.numbers(x))
    }

    fn axpy(&self, a: f64, x: &GpuVector, y: &mut GpuVector) {
        self.update("axpy", [a, 0.0], x, y);
    }

    fn xpby(&self, x: &GpuVector, b: f64, y: &mut GpuVector) {
        self.update("xpby", [0.0, b], x, y);
    }

    fn scaled(&self, a: f64, x: &GpuVector, y: &mut GpuVector) {
        self.update("scaled", [a, 0.0], x, y);
    }

    fn divided(&self, x: &GpuVector, a: f64, y: &mut GpuVector) {
        self.update("divided", [a, 0.0], x, y);
    }

    fn axpby(&self, a: f64, x: &GpuVector, b: f64, y: &mut GpuVector) {
        self.update("axpby", [a, b], x, y);
    }

    fn move_along(&self, p: &GpuVector, q: &GpuVector, x: &mut GpuVector, r: &mut GpuVector) {
        let n = p.0.len().min(q.0.len()).min(x.0.len()).min(r.0.len());
        let [p, q, x, r] = [p, q, &*x, &*r].map(GpuVector::address);
        self.launch_for("move_along", n, &arguments! { p, q, x, r, n: n as i64 });
    }

    fn advance(
        &self, α: f64, Along { p, q, x }: Along<'_, GpuVector>, next: &mut GpuVector, r: &mut GpuVector
    ) -> f64 {
        let n = [p, q, x, &*next, &*r].map(|one| one.0.len()).into_iter().min().unwrap_or(0);
        let count = n.div_ceil(CHUNK);
        self.sum(count, |partial| {
            let [p, q, x, next, r] = [p, q, x, &*next, &*r].map(GpuVector::address);
            let arguments = arguments! { p, q, x, next, r, partial, a: α, n: n as i64 };
            self.launch("advance", count, SHARED_SUM, &arguments);
        })
    }
}
