//! Operations on long vectors. The results do not depend on the number of threads.
//!
//! A reduction is cut into chunks of fixed length. The sums of the chunks are added in the order of the chunks, whichever thread made them.
//! Every function takes vectors of one length; if lengths differ, the shorter one counts. [`Vectors::dot`] does not scale its products, so its
//! entries should be zero or lie between 1e-150 and 1e150 in magnitude. [`Vectors::norm`] takes entries of any magnitude.
//!
//! ```
//! use bfree::pooled::Pool;
//! use bfree::space::vector::Vectors;
//!
//! let memory = Pool::default();
//! // One step of Gram and Schmidt: the remainder of y is orthogonal to x.
//! let (mut x, mut y) = (vec![0.0; 3], vec![2.0, 1.0, 5.0]);
//! memory.scaled(1.0 / memory.norm(&[1.0, 2.0, 2.0]), &[1.0, 2.0, 2.0], &mut x);
//! let along = memory.dot(&x, &y);
//! memory.axpy(-along, &x, &mut y);
//! assert!((memory.norm(&x) - 1.0).abs() < 1e-15 && memory.dot(&x, &y).abs() < 1e-14);
//! // y ← x + β y, the next direction of conjugate gradients
//! memory.xpby(&x, 0.5, &mut y);
//! assert!((memory.dot(&x, &y) - 1.0).abs() < 1e-14);
//! // Nothing overflows: ‖(3, 4)·1e200‖ = 5e200
//! assert!((memory.norm(&[3e200, 4e200]) / 5e200 - 1.0).abs() < 1e-15);
//! ```

use crate::parallel::{self, FEW};
use crate::pooled::{Pool, Pooled};
use std::ops::DerefMut;

/// The place where the vectors of a Krylov method lie, and the operations on them: the memory of the processor (a [`Pool`]), or a
/// [device](crate::gpu). Both have the same bits.
pub trait Vectors {
    /// A vector.
    type Vector: ?Sized;
    /// A vector with memory of its own.
    type Owned: DerefMut<Target = Self::Vector>;

    /// Number of entries.
    fn len(&self, x: &Self::Vector) -> usize;

    /// `n` entries that are unspecified.
    fn unspecified(&self, n: usize) -> Self::Owned;

    /// `y ← 0`
    fn clear(&self, y: &mut Self::Vector);

    /// `y ← x`
    fn copy(&self, x: &Self::Vector, y: &mut Self::Vector);

    /// `Σ xᵢ yᵢ`
    fn dot(&self, x: &Self::Vector, y: &Self::Vector) -> f64;

    /// ‖x‖, with `square` = x·x; not finite if any entry is not.
    fn norm_with(&self, square: f64, x: &Self::Vector) -> f64;

    /// `y ← a x + y`
    fn axpy(&self, a: f64, x: &Self::Vector, y: &mut Self::Vector);

    /// `y ← x + b y`
    fn xpby(&self, x: &Self::Vector, b: f64, y: &mut Self::Vector);

    /// `y ← a x`
    fn scaled(&self, a: f64, x: &Self::Vector, y: &mut Self::Vector);

    /// `y ← x / a`
    fn divided(&self, x: &Self::Vector, a: f64, y: &mut Self::Vector);

    /// `y ← a x + b y`
    fn axpby(&self, a: f64, x: &Self::Vector, b: f64, y: &mut Self::Vector);

    /// `x ← x + p`, `r ← r − q`
    fn move_along(&self, p: &Self::Vector, q: &Self::Vector, x: &mut Self::Vector, r: &mut Self::Vector);

    /// A step of conjugate gradients: `next ← x + α p`, `r ← r − α q`. Returns r·r.
    fn advance(&self, α: f64, along: Along<'_, Self::Vector>, next: &mut Self::Vector, r: &mut Self::Vector) -> f64;

    /// ‖x‖
    fn norm(&self, x: &Self::Vector) -> f64 {
        self.norm_with(self.dot(x, x), x)
    }

    /// `n` zeros.
    fn zeros(&self, n: usize) -> Self::Owned {
        let mut zeros = self.unspecified(n);
        self.clear(&mut zeros);
        zeros
    }

    /// A copy of x.
    fn copied(&self, x: &Self::Vector) -> Self::Owned {
        let mut copy = self.unspecified(self.len(x));
        self.copy(x, &mut copy);
        copy
    }
}

/// The direction of a [step](Vectors::advance) of conjugate gradients.
#[derive(Debug)]
pub struct Along<'a, V: ?Sized> {
    /// p
    pub p: &'a V,
    /// A p
    pub q: &'a V,
    /// x
    pub x: &'a V,
}

impl Vectors for Pool {
    type Vector = [f64];
    type Owned = Pooled<f64>;

    fn len(&self, x: &[f64]) -> usize {
        x.len()
    }

    fn unspecified(&self, n: usize) -> Pooled<f64> {
        Pool::unspecified(self, n)
    }

    fn clear(&self, y: &mut [f64]) {
        parallel::fill(y, 0.0);
    }

    fn copy(&self, x: &[f64], y: &mut [f64]) {
        parallel::copy(x, y);
    }

    fn dot(&self, x: &[f64], y: &[f64]) -> f64 {
        dot(x, y)
    }

    fn norm_with(&self, square: f64, x: &[f64]) -> f64 {
        norm_with(square, x)
    }

    fn axpy(&self, a: f64, x: &[f64], y: &mut [f64]) {
        axpy(a, x, y);
    }

    fn xpby(&self, x: &[f64], b: f64, y: &mut [f64]) {
        xpby(x, b, y);
    }

    fn scaled(&self, a: f64, x: &[f64], y: &mut [f64]) {
        update(x, y, |x, _| a * x);
    }

    fn divided(&self, x: &[f64], a: f64, y: &mut [f64]) {
        update(x, y, |x, _| x / a);
    }

    fn axpby(&self, a: f64, x: &[f64], b: f64, y: &mut [f64]) {
        update(x, y, |x, y| b * y + a * x);
    }

    fn move_along(&self, p: &[f64], q: &[f64], x: &mut [f64], r: &mut [f64]) {
        update_pair([p, q], x, r, |[p, q], x, r| {
            *x += p;
            *r -= q;
        });
    }

    fn advance(&self, α: f64, Along { p, q, x }: Along<'_, [f64]>, next: &mut [f64], r: &mut [f64]) -> f64 {
        update_pair([p, q, x], next, r, |[p, q, x], next, r| {
            *next = x + α * p;
            *r -= α * q;
        })
    }
}

/// Entries per partial sum.
pub(crate) const CHUNK: usize = 2048;

/// Independent accumulators inside a chunk, so that the compiler may use vector instructions without changing the order.
const LANES: usize = 8;

/// `Σ xᵢ yᵢ`
pub(crate) fn dot(x: &[f64], y: &[f64]) -> f64 {
    if x.len() < FEW {
        x.chunks(CHUNK).zip(y.chunks(CHUNK)).map(|(x, y)| dot_chunk(x, y)).sum()
    } else {
        let part = |k| Some(dot_chunk(x.chunks(CHUNK).nth(k)?, y.chunks(CHUNK).nth(k)?));
        mutant!("solver: several threads leave out the first chunk of a dot product": { return parallel::map(x.len().div_ceil(CHUNK), &part).iter().flatten().skip(1).sum(); });
        parallel::map(x.len().div_ceil(CHUNK), &part).iter().flatten().sum()
    }
}

fn dot_chunk(x: &[f64], y: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    for (x, y) in x.chunks(LANES).zip(y.chunks(LANES)) {
        for ((sum, x), y) in lanes.iter_mut().zip(x).zip(y) {
            *sum += x * y;
        }
    }
    lanes.iter().sum()
}

/// A smaller sum of squares may have lost some or all digits to underflow.
const SAFE_SQUARE: f64 = 1e-280;

/// `√(Σ xᵢ²)`; not finite if any entry is not.
pub(crate) fn norm(x: &[f64]) -> f64 {
    norm_with(dot(x, x), x)
}

/// Whether a sum of squares has lost no digit to underflow or overflow.
pub(crate) fn is_safe_square(square: f64) -> bool {
    (SAFE_SQUARE..=f64::MAX).contains(&square)
}

/// [`norm`], with `square` = x·x.
pub(crate) fn norm_with(square: f64, x: &[f64]) -> f64 {
    if is_safe_square(square) {
        return square.sqrt();
    }
    // Squares underflow or overflow, all entries are zero, or one entry is not finite.
    let largest = x.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    if largest == 0.0 || !largest.is_finite() || square.is_nan() {
        return square.sqrt();
    }
    // ‖x‖ = 2ᵏ ‖x/2ᵏ‖ with 2ᵏ near the largest entry is exact. Two factors make up 2ᵏ, so that neither overflows or underflows.
    let k = largest.log2() as i32;
    let (half, rest) = (2.0_f64.powi(-(k / 2)), 2.0_f64.powi(-(k - k / 2)));
    let scaled: Vec<f64> = x.iter().map(|x| x * half * rest).collect();
    dot(&scaled, &scaled).sqrt() / half / rest
}

/// `y ← a x + y`
pub(crate) fn axpy(a: f64, x: &[f64], y: &mut [f64]) {
    update(x, y, |x, y| a * x + y);
}

/// `y ← x + b y`
pub(crate) fn xpby(x: &[f64], b: f64, y: &mut [f64]) {
    update(x, y, |x, y| x + b * y);
}

/// `yᵢ ← f(xᵢ, yᵢ)`
#[track_caller]
pub(crate) fn update(x: &[f64], y: &mut [f64], f: impl Fn(f64, f64) -> f64 + Sync) {
    parallel::zip(y, x, |y, x| *y = f(*x, *y));
}

/// Calls `f([aᵢ, bᵢ, …], xᵢ, yᵢ)` for all entries. Returns y·y.
pub(crate) fn update_pair<const N: usize>(
    given: [&[f64]; N],
    x: &mut [f64],
    y: &mut [f64],
    f: impl Fn([f64; N], &mut f64, &mut f64) + Sync,
) -> f64 {
    let chunk = |(k, (x, y)): (usize, (&mut [f64], &mut [f64]))| {
        let given = given.map(|a| &a[k * CHUNK..k * CHUNK + y.len()]);
        for (i, (x, y)) in x.iter_mut().zip(&mut *y).enumerate() {
            f(given.map(|a| a[i]), x, y);
        }
        dot_chunk(y, y)
    };
    let is_short = y.len() < FEW;
    let parts = x.chunks_mut(CHUNK).zip(y.chunks_mut(CHUNK)).enumerate();
    if is_short { parts.map(chunk).sum() } else { parallel::collect(parts, &chunk).into_iter().sum() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::testing::irregular;

    #[test]
    fn reductions_do_not_depend_on_the_number_of_threads() {
        let x = irregular(300_001);
        let y: Vec<f64> = x.iter().map(|x| 1.0 / (x + 1.5)).collect();
        let sequential: f64 = x.chunks(CHUNK).zip(y.chunks(CHUNK)).map(|(x, y)| dot_chunk(x, y)).sum();
        for threads in [1, 2, 3] {
            let (shared, added) = parallel::with_threads(threads, || {
                let mut z = y.clone();
                Pool::default().axpy(0.1, &x, &mut z);
                (dot(&x, &y), z)
            });
            assert_eq!(shared.to_bits(), sequential.to_bits(), "{threads} threads");
            assert!(added.iter().zip(&x).zip(&y).all(|((z, x), y)| z.to_bits() == (0.1 * x + y).to_bits()));
        }
    }

    #[test]
    fn every_entry_counts_once() {
        // Sums of integers are exact in any order: Σ i = n(n+1)/2. The lengths lie around lanes, chunks and the switch to threads.
        for n in [0, 1, 7, 8, 9, CHUNK - 1, CHUNK, CHUNK + 1, FEW - 1, FEW, FEW + 5] {
            let x: Vec<f64> = (1..=n).map(|i| i as f64).collect();
            assert_eq!(dot(&x, &vec![1.0; n]), (n * (n + 1) / 2) as f64, "{n}");
            let mut y = x.clone();
            Pool::default().xpby(&x, 2.0, &mut y);
            assert!(y.iter().zip(&x).all(|(y, x)| *y == 3.0 * x), "{n}");
            Pool::default().scaled(-2.0, &x, &mut y);
            assert!(y.iter().zip(&x).all(|(y, x)| *y == -2.0 * x), "{n}");
        }
    }

    #[test]
    fn norm_scales_exactly_with_powers_of_two_and_keeps_nan() {
        let x = irregular(10_000);
        for exponent in [-121, -30, 1, 31, 120] {
            let factor = 2.0_f64.powi(exponent);
            let scaled: Vec<f64> = x.iter().map(|x| factor * x).collect();
            assert_eq!(norm(&scaled).to_bits(), (factor * norm(&x)).to_bits());
        }
        let mut x = x;
        x[7777] = f64::NAN;
        assert!(norm(&x).is_nan());
        x[7777] = f64::INFINITY;
        assert_eq!(norm(&x), f64::INFINITY);
        assert_eq!(norm(&[0.0, -0.0]), 0.0);
    }

    #[test]
    fn the_norm_neither_under_nor_overflows_where_its_value_does_not() {
        let x = irregular(1000);
        for exponent in [-960, -540, -500, 500, 540, 1000] {
            let factor = 2.0_f64.powi(exponent);
            let scaled: Vec<f64> = x.iter().map(|x| factor * x).collect();
            assert_eq!(norm(&scaled).to_bits(), (factor * norm(&x)).to_bits(), "2^{exponent}");
        }
        // 3-4-5 triangles of the smallest and the largest numbers
        let tiny = f64::from_bits(1);
        assert_eq!(norm(&[3.0 * tiny, 4.0 * tiny]), 5.0 * tiny);
        assert_eq!(norm(&[0.6 * f64::MAX, 0.8 * f64::MAX]).log2(), f64::MAX.log2());
    }
}
