//! The limits of the processor per second: fused multiply-adds and copied bytes, on one core.

use pulp::{Arch, Simd, WithSimd};
use std::hint::black_box;
use std::time::Instant;

/// Independent chains of multiply-adds.
const CHAINS: usize = 16;

/// Number of multiply-adds of each chain.
const LENGTH: usize = 1_000_000;

struct Chains;

impl WithSimd for Chains {
    /// Operations.
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let (factor, term) = (simd.splat_f64s(black_box(0.999_999)), simd.splat_f64s(black_box(1e-9)));
        let mut sums = [simd.splat_f64s(1.0); CHAINS];
        for _ in 0..LENGTH {
            for sum in &mut sums {
                *sum = simd.mul_add_f64s(*sum, factor, term);
            }
        }
        let mut total = simd.splat_f64s(0.0);
        for sum in sums {
            total = simd.add_f64s(total, sum);
        }
        black_box(simd.reduce_sum_f64s(total));
        (2 * CHAINS * LENGTH * S::F64_LANES) as f64
    }
}

/// Floating-point operations per second with the widest vectors, the best of several runs.
pub(super) fn peak() -> f64 {
    (0..9).fold(0.0, |best: f64, _| {
        let start = Instant::now();
        let operations = Arch::new().dispatch(Chains);
        best.max(operations / start.elapsed().as_secs_f64())
    })
}

/// Bytes per second, read and written, when copying an array larger than the caches.
pub(super) fn copy_bandwidth() -> f64 {
    const NUMBERS: usize = 1 << 26;
    let from = vec![1.0_f64; NUMBERS];
    let mut to = vec![0.0_f64; NUMBERS];
    (0..7).fold(0.0, |best: f64, _| {
        let start = Instant::now();
        to.copy_from_slice(black_box(&from));
        black_box(&mut to);
        best.max((2 * NUMBERS * size_of::<f64>()) as f64 / start.elapsed().as_secs_f64())
    })
}
