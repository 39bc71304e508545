//! Eight numbers at a time, with whatever the processor has: AVX-512, AVX2 with FMA, or plain arrays.
//!
//! The operations and their order are the same everywhere; a·b + c is rounded once where the processor has FMA and
//! twice where it has not, and that is all a result can differ by between processors.

use crate::scalar::Arithmetic;

/// Numbers of a vector.
pub(super) const LANES: usize = 8;

/// Arithmetic on eight lanes. A value of the type is the proof that the processor has the instructions.
pub(super) trait Lanes: Arithmetic {
    fn splat(self, x: f64) -> Self::N;
    fn load(self, x: &[f64; LANES]) -> Self::N;
    fn store(self, v: Self::N, out: &mut [f64; LANES]);
    fn abs(self, a: Self::N) -> Self::N;
    /// Rows become columns.
    fn transpose(self, rows: [Self::N; LANES]) -> [Self::N; LANES];
}

/// Something to be done with the widest lanes there are.
pub(super) trait WithLanes {
    /// What comes out.
    type Output;
    /// Does it.
    fn run<S: Lanes>(self, s: S) -> Self::Output;
}

/// Plain arrays.
#[derive(Clone, Copy)]
pub(super) struct Portable;

impl Arithmetic for Portable {
    type N = [f64; LANES];
    #[inline(always)]
    fn add(self, a: Self::N, b: Self::N) -> Self::N {
        std::array::from_fn(|i| a[i] + b[i])
    }
    #[inline(always)]
    fn mul(self, a: Self::N, b: Self::N) -> Self::N {
        std::array::from_fn(|i| a[i] * b[i])
    }
    #[inline(always)]
    fn mul_add(self, a: Self::N, b: Self::N, c: Self::N) -> Self::N {
        std::array::from_fn(|i| a[i] * b[i] + c[i])
    }
    #[inline(always)]
    fn mul_sub(self, a: Self::N, b: Self::N, c: Self::N) -> Self::N {
        std::array::from_fn(|i| c[i] - a[i] * b[i])
    }
    #[inline(always)]
    fn zero(self) -> Self::N {
        [0.0; LANES]
    }
}

impl Lanes for Portable {
    #[inline(always)]
    fn splat(self, x: f64) -> Self::N {
        [x; LANES]
    }
    #[inline(always)]
    fn load(self, x: &[f64; LANES]) -> Self::N {
        *x
    }
    #[inline(always)]
    fn store(self, v: Self::N, out: &mut [f64; LANES]) {
        *out = v;
    }
    #[inline(always)]
    fn transpose(self, rows: [Self::N; LANES]) -> [Self::N; LANES] {
        std::array::from_fn(|i| std::array::from_fn(|k| rows[k][i]))
    }
    #[inline(always)]
    fn abs(self, a: Self::N) -> Self::N {
        let mut out = a;
        for x in &mut out {
            *x = x.abs();
        }
        out
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Arithmetic, LANES, Lanes};
    use pulp::x86::{V3, V4};
    use pulp::{Simd, cast, f64x4, f64x8};

    impl Arithmetic for V4 {
        type N = f64x8;
        #[inline(always)]
        fn add(self, a: f64x8, b: f64x8) -> f64x8 {
            self.add_f64s(a, b)
        }
        #[inline(always)]
        fn mul(self, a: f64x8, b: f64x8) -> f64x8 {
            self.mul_f64s(a, b)
        }
        #[inline(always)]
        fn mul_add(self, a: f64x8, b: f64x8, c: f64x8) -> f64x8 {
            self.mul_add_f64s(a, b, c)
        }
        #[inline(always)]
        fn mul_sub(self, a: f64x8, b: f64x8, c: f64x8) -> f64x8 {
            cast(self.avx512f._mm512_fnmadd_pd(cast(a), cast(b), cast(c)))
        }
        #[inline(always)]
        fn zero(self) -> Self::N {
            self.splat_f64s(0.0)
        }
    }

    impl Lanes for V4 {
        #[inline(always)]
        fn splat(self, x: f64) -> f64x8 {
            self.splat_f64s(x)
        }
        #[inline(always)]
        fn load(self, x: &[f64; LANES]) -> f64x8 {
            cast(*x)
        }
        #[inline(always)]
        fn store(self, v: f64x8, out: &mut [f64; LANES]) {
            *out = cast(v);
        }
        #[inline(always)]
        fn transpose(self, rows: [f64x8; LANES]) -> [f64x8; LANES] {
            let x = self.avx512f;
            let [r0, r1, r2, r3, r4, r5, r6, r7] = rows;
            // Two rows interleaved: columns (0, 2, 4, 6) or (1, 3, 5, 7) of both, two numbers a quarter.
            let e0 = x._mm512_unpacklo_pd(cast(r0), cast(r1));
            let o0 = x._mm512_unpackhi_pd(cast(r0), cast(r1));
            let e1 = x._mm512_unpacklo_pd(cast(r2), cast(r3));
            let o1 = x._mm512_unpackhi_pd(cast(r2), cast(r3));
            let e2 = x._mm512_unpacklo_pd(cast(r4), cast(r5));
            let o2 = x._mm512_unpackhi_pd(cast(r4), cast(r5));
            let e3 = x._mm512_unpacklo_pd(cast(r6), cast(r7));
            let o3 = x._mm512_unpackhi_pd(cast(r6), cast(r7));
            // Then quarters: 0 and 2 of both, or 1 and 3 of both.
            const EVEN: i32 = 0b10_00_10_00;
            const ODD: i32 = 0b11_01_11_01;
            let (a, b) = (x._mm512_shuffle_f64x2::<EVEN>(e0, e1), x._mm512_shuffle_f64x2::<ODD>(e0, e1));
            let (c, d) = (x._mm512_shuffle_f64x2::<EVEN>(e2, e3), x._mm512_shuffle_f64x2::<ODD>(e2, e3));
            let (e, f) = (x._mm512_shuffle_f64x2::<EVEN>(o0, o1), x._mm512_shuffle_f64x2::<ODD>(o0, o1));
            let (g, h) = (x._mm512_shuffle_f64x2::<EVEN>(o2, o3), x._mm512_shuffle_f64x2::<ODD>(o2, o3));
            [
                cast(x._mm512_shuffle_f64x2::<EVEN>(a, c)),
                cast(x._mm512_shuffle_f64x2::<EVEN>(e, g)),
                cast(x._mm512_shuffle_f64x2::<EVEN>(b, d)),
                cast(x._mm512_shuffle_f64x2::<EVEN>(f, h)),
                cast(x._mm512_shuffle_f64x2::<ODD>(a, c)),
                cast(x._mm512_shuffle_f64x2::<ODD>(e, g)),
                cast(x._mm512_shuffle_f64x2::<ODD>(b, d)),
                cast(x._mm512_shuffle_f64x2::<ODD>(f, h)),
            ]
        }
        #[inline(always)]
        fn abs(self, a: Self::N) -> Self::N {
            self.abs_f64s(a)
        }
    }

    impl Arithmetic for V3 {
        type N = [f64x4; 2];
        #[inline(always)]
        fn add(self, a: Self::N, b: Self::N) -> Self::N {
            [self.add_f64s(a[0], b[0]), self.add_f64s(a[1], b[1])]
        }
        #[inline(always)]
        fn mul(self, a: Self::N, b: Self::N) -> Self::N {
            [self.mul_f64s(a[0], b[0]), self.mul_f64s(a[1], b[1])]
        }
        #[inline(always)]
        fn mul_add(self, a: Self::N, b: Self::N, c: Self::N) -> Self::N {
            [self.mul_add_f64s(a[0], b[0], c[0]), self.mul_add_f64s(a[1], b[1], c[1])]
        }
        #[inline(always)]
        fn mul_sub(self, a: Self::N, b: Self::N, c: Self::N) -> Self::N {
            let one = |a, b, c| cast(self.fma._mm256_fnmadd_pd(cast(a), cast(b), cast(c)));
            [one(a[0], b[0], c[0]), one(a[1], b[1], c[1])]
        }
        #[inline(always)]
        fn zero(self) -> Self::N {
            [self.splat_f64s(0.0); 2]
        }
    }

    impl Lanes for V3 {
        #[inline(always)]
        fn splat(self, x: f64) -> Self::N {
            [self.splat_f64s(x); 2]
        }
        #[inline(always)]
        fn load(self, x: &[f64; LANES]) -> Self::N {
            cast(*x)
        }
        #[inline(always)]
        fn store(self, v: Self::N, out: &mut [f64; LANES]) {
            *out = cast(v);
        }
        #[inline(always)]
        fn transpose(self, rows: [Self::N; LANES]) -> [Self::N; LANES] {
            let rows: [[f64; LANES]; LANES] = rows.map(|row| cast(row));
            std::array::from_fn(|i| cast(std::array::from_fn::<f64, LANES, _>(|k| rows[k][i])))
        }
        #[inline(always)]
        fn abs(self, a: Self::N) -> Self::N {
            [self.abs_f64s(a[0]), self.abs_f64s(a[1])]
        }
    }
}

/// Does it with the widest lanes of this processor.
#[inline]
pub(super) fn widest<W: WithLanes>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    {
        /// The call as `pulp` wants it.
        struct Call<W, S>(W, S);
        impl<W: WithLanes, S: Lanes> pulp::NullaryFnOnce for Call<W, S> {
            type Output = W::Output;
            #[inline(always)]
            fn call(self) -> W::Output {
                self.0.run(self.1)
            }
        }
        use pulp::x86::{V3, V4};
        if let Some(s) = V4::try_new() {
            return s.vectorize(Call(work, s));
        }
        if let Some(s) = V3::try_new() {
            return s.vectorize(Call(work, s));
        }
    }
    work.run(Portable)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums, products and the transposition of an irregular matrix.
    #[derive(Clone, Copy)]
    struct Everything;

    fn entry(i: usize, k: usize) -> f64 {
        ((i * LANES + k + 1) as f64 * 0.618_033_988_749_894_9).fract() - 0.5
    }

    impl WithLanes for Everything {
        type Output = Vec<[f64; LANES]>;

        #[inline(always)]
        fn run<S: Lanes>(self, s: S) -> Self::Output {
            let mut rows = [s.zero(); LANES];
            for (i, row) in rows.iter_mut().enumerate() {
                let mut numbers = [0.0; LANES];
                for (k, x) in numbers.iter_mut().enumerate() {
                    *x = entry(i, k);
                }
                *row = s.load(&numbers);
            }
            let columns = s.transpose(rows);
            let (a, b, c) = (rows[1], columns[2], s.splat(0.3));
            let results = [s.add(a, b), s.mul(a, b), s.mul_add(a, b, c), s.mul_sub(a, b, c), s.abs(a)];
            let mut out = Vec::new();
            for v in columns.into_iter().chain(results) {
                let mut numbers = [0.0; LANES];
                s.store(v, &mut numbers);
                out.push(numbers);
            }
            out
        }
    }

    #[test]
    fn all_instruction_sets_compute_the_same() {
        let mut all = vec![Everything.run(Portable), widest(Everything)];
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(pulp::x86::V4::try_new().map(|s| Everything.run(s)));
            all.extend(pulp::x86::V3::try_new().map(|s| Everything.run(s)));
        }
        for results in all {
            for i in 0..LANES {
                for k in 0..LANES {
                    assert_eq!(results[i][k], entry(k, i));
                }
            }
            for k in 0..LANES {
                let (a, b, c) = (entry(1, k), entry(k, 2), 0.3);
                let expected = [a + b, a * b, a * b + c, c - a * b, a.abs()];
                for (result, expected) in results[LANES..].iter().zip(expected) {
                    assert!((result[k] - expected).abs() <= f64::EPSILON, "{} for {expected}", result[k]);
                }
            }
        }
    }
}
