//! Vectors of 64 bytes, eight numbers of double or sixteen of single precision, with whatever the processor has: AVX-512, AVX2
//! with FMA, or plain arrays.
//!
//! The operations and their order are the same everywhere; a·b + c is rounded once where the processor has FMA and
//! twice where it has not, and that is all a result can differ by between processors.

use crate::pooled;
use crate::scalar::{Arithmetic, Real};

/// Numbers of a vector in double precision.
pub(super) const LANES: usize = 8;

/// Numbers of a vector in single precision.
pub(super) const SINGLE_LANES: usize = 16;

/// Arithmetic on `L` lanes. A value of the type is the proof that the processor has the instructions.
pub(super) trait Lanes<const L: usize>: Arithmetic {
    /// The number in a lane.
    type X: Real;
    /// Whether these lanes are there for the rare processor that has no other: kernels then do without a copy for every width.
    const RARE: bool = false;
    fn splat(self, x: Self::X) -> Self::N;
    fn load(self, x: &[Self::X; L]) -> Self::N;
    fn store(self, v: Self::N, out: &mut [Self::X; L]);
    fn abs(self, a: Self::N) -> Self::N;
    fn sub(self, a: Self::N, b: Self::N) -> Self::N;
    fn div(self, a: Self::N, b: Self::N) -> Self::N;
    /// `then` where a < b, and `otherwise` elsewhere.
    fn where_less(self, a: Self::N, b: Self::N, then: Self::N, otherwise: Self::N) -> Self::N;
    /// Rows become columns.
    fn transpose(self, rows: [Self::N; L]) -> [Self::N; L];
}

/// Something to be done with the widest lanes there are.
pub(super) trait WithLanes<X, const L: usize> {
    /// What comes out.
    type Output;
    /// Does it.
    fn run<S: Lanes<L, X = X>>(self, s: S) -> Self::Output;
}

/// A number whose vectors have `L` lanes.
pub(super) trait Number<const L: usize>: Real + pooled::Number + Sync {
    /// Does it with the widest lanes of this processor.
    fn widest<W: WithLanes<Self, L>>(work: W) -> W::Output;
}

/// Plain arrays.
#[derive(Clone, Copy)]
pub(super) struct Portable;

/// Plain arrays of single precision.
#[derive(Clone, Copy)]
pub(super) struct PortableSingle;

macro_rules! portable {
    ($name:ident, $number:ty, $lanes:expr) => {
        impl Arithmetic for $name {
            type N = [$number; $lanes];
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
                [0.0; $lanes]
            }
        }

        impl Lanes<$lanes> for $name {
            type X = $number;
            // An x86-64 without AVX2.
            const RARE: bool = cfg!(target_arch = "x86_64");
            #[inline(always)]
            fn splat(self, x: $number) -> Self::N {
                [x; $lanes]
            }
            #[inline(always)]
            fn load(self, x: &[$number; $lanes]) -> Self::N {
                *x
            }
            #[inline(always)]
            fn store(self, v: Self::N, out: &mut [$number; $lanes]) {
                *out = v;
            }
            #[inline(always)]
            fn transpose(self, rows: [Self::N; $lanes]) -> [Self::N; $lanes] {
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
            #[inline(always)]
            fn sub(self, a: Self::N, b: Self::N) -> Self::N {
                std::array::from_fn(|i| a[i] - b[i])
            }
            #[inline(always)]
            fn div(self, a: Self::N, b: Self::N) -> Self::N {
                std::array::from_fn(|i| a[i] / b[i])
            }
            #[inline(always)]
            fn where_less(self, a: Self::N, b: Self::N, then: Self::N, otherwise: Self::N) -> Self::N {
                std::array::from_fn(|i| if a[i] < b[i] { then[i] } else { otherwise[i] })
            }
        }
    };
}

portable!(Portable, f64, LANES);
portable!(PortableSingle, f32, SINGLE_LANES);

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Arithmetic, LANES, Lanes, SINGLE_LANES};
    use pulp::x86::{V3, V4};
    use pulp::{Simd, cast, f32x8, f32x16, f64x4, f64x8};

    /// The same processor, in single precision.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Single<S>(pub S);

    /// Vectors of one register.
    macro_rules! whole {
        ($s:ty, $this:ident => $simd:expr, $vector:ty, $number:ty, $lanes:expr,
         $add:ident, $mul:ident, $mul_add:ident, $fnmadd:ident, $splat:ident, $abs:ident, $sub:ident, $div:ident, $less:ident, $select:ident, $transpose:path) => {
            impl Arithmetic for $s {
                type N = $vector;
                #[inline(always)]
                fn add($this, a: $vector, b: $vector) -> $vector {
                    $simd.$add(a, b)
                }
                #[inline(always)]
                fn mul($this, a: $vector, b: $vector) -> $vector {
                    $simd.$mul(a, b)
                }
                #[inline(always)]
                fn mul_add($this, a: $vector, b: $vector, c: $vector) -> $vector {
                    $simd.$mul_add(a, b, c)
                }
                #[inline(always)]
                fn mul_sub($this, a: $vector, b: $vector, c: $vector) -> $vector {
                    cast($simd.avx512f.$fnmadd(cast(a), cast(b), cast(c)))
                }
                #[inline(always)]
                fn zero($this) -> $vector {
                    $simd.$splat(0.0)
                }
            }

            impl Lanes<$lanes> for $s {
                type X = $number;
                #[inline(always)]
                fn splat($this, x: $number) -> $vector {
                    $simd.$splat(x)
                }
                #[inline(always)]
                fn load(self, x: &[$number; $lanes]) -> $vector {
                    cast(*x)
                }
                #[inline(always)]
                fn store(self, v: $vector, out: &mut [$number; $lanes]) {
                    *out = cast(v);
                }
                #[inline(always)]
                fn abs($this, a: $vector) -> $vector {
                    $simd.$abs(a)
                }
                #[inline(always)]
                fn sub($this, a: $vector, b: $vector) -> $vector {
                    $simd.$sub(a, b)
                }
                #[inline(always)]
                fn div($this, a: $vector, b: $vector) -> $vector {
                    $simd.$div(a, b)
                }
                #[inline(always)]
                fn where_less($this, a: $vector, b: $vector, then: $vector, otherwise: $vector) -> $vector {
                    $simd.$select($simd.$less(a, b), then, otherwise)
                }
                #[inline(always)]
                fn transpose($this, rows: [$vector; $lanes]) -> [$vector; $lanes] {
                    $transpose($simd, rows)
                }
            }
        };
    }

    whole!(V4, self => self, f64x8, f64, LANES,
        add_f64s, mul_f64s, mul_add_f64s, _mm512_fnmadd_pd, splat_f64s, abs_f64s, sub_f64s, div_f64s, less_than_f64s, select_f64s, transpose_8);
    whole!(Single<V4>, self => self.0, f32x16, f32, SINGLE_LANES,
        add_f32s, mul_f32s, mul_add_f32s, _mm512_fnmadd_ps, splat_f32s, abs_f32s, sub_f32s, div_f32s, less_than_f32s, select_f32s, transpose_16);

    /// Quarters 0 and 2 of both.
    const EVEN: i32 = 0b10_00_10_00;
    /// Quarters 1 and 3 of both.
    const ODD: i32 = 0b11_01_11_01;

    #[inline(always)]
    fn transpose_8(s: V4, rows: [f64x8; LANES]) -> [f64x8; LANES] {
        let x = s.avx512f;
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
        // Then quarters.
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
    fn transpose_16(s: V4, rows: [f32x16; SINGLE_LANES]) -> [f32x16; SINGLE_LANES] {
        let x = s.avx512f;
        // Four rows at a time: `four[r][i]` holds the columns i, i + 4, i + 8, i + 12 of rows 4r … 4r + 3, one column a quarter.
        let mut four = [[s.splat_f32s(0.0); 4]; 4];
        for r in 0..4 {
            let [a, b, c, d] = [rows[4 * r], rows[4 * r + 1], rows[4 * r + 2], rows[4 * r + 3]];
            let (ab_low, ab_high) = (x._mm512_unpacklo_ps(cast(a), cast(b)), x._mm512_unpackhi_ps(cast(a), cast(b)));
            let (cd_low, cd_high) = (x._mm512_unpacklo_ps(cast(c), cast(d)), x._mm512_unpackhi_ps(cast(c), cast(d)));
            four[r] = [
                cast(x._mm512_unpacklo_pd(cast(ab_low), cast(cd_low))),
                cast(x._mm512_unpackhi_pd(cast(ab_low), cast(cd_low))),
                cast(x._mm512_unpacklo_pd(cast(ab_high), cast(cd_high))),
                cast(x._mm512_unpackhi_pd(cast(ab_high), cast(cd_high))),
            ];
        }
        // Then quarters, twice.
        let mut columns = [s.splat_f32s(0.0); SINGLE_LANES];
        for i in 0..4 {
            let low_even = x._mm512_shuffle_f32x4::<EVEN>(cast(four[0][i]), cast(four[1][i]));
            let low_odd = x._mm512_shuffle_f32x4::<ODD>(cast(four[0][i]), cast(four[1][i]));
            let high_even = x._mm512_shuffle_f32x4::<EVEN>(cast(four[2][i]), cast(four[3][i]));
            let high_odd = x._mm512_shuffle_f32x4::<ODD>(cast(four[2][i]), cast(four[3][i]));
            columns[i] = cast(x._mm512_shuffle_f32x4::<EVEN>(low_even, high_even));
            columns[i + 4] = cast(x._mm512_shuffle_f32x4::<EVEN>(low_odd, high_odd));
            columns[i + 8] = cast(x._mm512_shuffle_f32x4::<ODD>(low_even, high_even));
            columns[i + 12] = cast(x._mm512_shuffle_f32x4::<ODD>(low_odd, high_odd));
        }
        columns
    }

    /// Vectors of two registers.
    macro_rules! halves {
        ($s:ty, $this:ident => $simd:expr, $half:ty, $number:ty, $lanes:expr,
         $add:ident, $mul:ident, $mul_add:ident, $fnmadd:ident, $splat:ident, $abs:ident, $sub:ident, $div:ident, $less:ident, $select:ident) => {
            impl Arithmetic for $s {
                type N = [$half; 2];
                #[inline(always)]
                fn add($this, a: Self::N, b: Self::N) -> Self::N {
                    [$simd.$add(a[0], b[0]), $simd.$add(a[1], b[1])]
                }
                #[inline(always)]
                fn mul($this, a: Self::N, b: Self::N) -> Self::N {
                    [$simd.$mul(a[0], b[0]), $simd.$mul(a[1], b[1])]
                }
                #[inline(always)]
                fn mul_add($this, a: Self::N, b: Self::N, c: Self::N) -> Self::N {
                    [$simd.$mul_add(a[0], b[0], c[0]), $simd.$mul_add(a[1], b[1], c[1])]
                }
                #[inline(always)]
                fn mul_sub($this, a: Self::N, b: Self::N, c: Self::N) -> Self::N {
                    let one = |a, b, c| cast($simd.fma.$fnmadd(cast(a), cast(b), cast(c)));
                    [one(a[0], b[0], c[0]), one(a[1], b[1], c[1])]
                }
                #[inline(always)]
                fn zero($this) -> Self::N {
                    [$simd.$splat(0.0); 2]
                }
            }

            impl Lanes<$lanes> for $s {
                type X = $number;
                #[inline(always)]
                fn splat($this, x: $number) -> Self::N {
                    [$simd.$splat(x); 2]
                }
                #[inline(always)]
                fn load(self, x: &[$number; $lanes]) -> Self::N {
                    cast(*x)
                }
                #[inline(always)]
                fn store(self, v: Self::N, out: &mut [$number; $lanes]) {
                    *out = cast(v);
                }
                #[inline(always)]
                fn transpose(self, rows: [Self::N; $lanes]) -> [Self::N; $lanes] {
                    let rows: [[$number; $lanes]; $lanes] = rows.map(cast);
                    std::array::from_fn(|i| cast(std::array::from_fn::<$number, $lanes, _>(|k| rows[k][i])))
                }
                #[inline(always)]
                fn abs($this, a: Self::N) -> Self::N {
                    [$simd.$abs(a[0]), $simd.$abs(a[1])]
                }
                #[inline(always)]
                fn sub($this, a: Self::N, b: Self::N) -> Self::N {
                    [$simd.$sub(a[0], b[0]), $simd.$sub(a[1], b[1])]
                }
                #[inline(always)]
                fn div($this, a: Self::N, b: Self::N) -> Self::N {
                    [$simd.$div(a[0], b[0]), $simd.$div(a[1], b[1])]
                }
                #[inline(always)]
                fn where_less($this, a: Self::N, b: Self::N, then: Self::N, otherwise: Self::N) -> Self::N {
                    let half = |i: usize| $simd.$select($simd.$less(a[i], b[i]), then[i], otherwise[i]);
                    [half(0), half(1)]
                }
            }
        };
    }

    halves!(V3, self => self, f64x4, f64, LANES,
        add_f64s, mul_f64s, mul_add_f64s, _mm256_fnmadd_pd, splat_f64s, abs_f64s, sub_f64s, div_f64s, less_than_f64s, select_f64s);
    halves!(Single<V3>, self => self.0, f32x8, f32, SINGLE_LANES,
        add_f32s, mul_f32s, mul_add_f32s, _mm256_fnmadd_ps, splat_f32s, abs_f32s, sub_f32s, div_f32s, less_than_f32s, select_f32s);
}

macro_rules! number {
    ($number:ty, $lanes:expr, $portable:expr, $s:ident => $wrapped:expr) => {
        impl Number<$lanes> for $number {
            #[inline]
            fn widest<W: WithLanes<Self, $lanes>>(work: W) -> W::Output {
                #[cfg(target_arch = "x86_64")]
                {
                    /// The call as `pulp` wants it.
                    struct Call<W, S>(W, S);
                    impl<W: WithLanes<$number, $lanes>, S: Lanes<$lanes, X = $number>> pulp::NullaryFnOnce for Call<W, S> {
                        type Output = W::Output;
                        #[inline(always)]
                        fn call(self) -> W::Output {
                            self.0.run(self.1)
                        }
                    }
                    use pulp::x86::{V3, V4};
                    if let Some($s) = V4::try_new() {
                        return $s.vectorize(Call(work, $wrapped));
                    }
                    if let Some($s) = V3::try_new() {
                        return $s.vectorize(Call(work, $wrapped));
                    }
                }
                work.run($portable)
            }
        }
    };
}

number!(f64, LANES, Portable, s => s);
number!(f32, SINGLE_LANES, PortableSingle, s => x86::Single(s));

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums, products and the transposition of an irregular matrix.
    #[derive(Clone, Copy)]
    struct Everything;

    fn entry(i: usize, k: usize) -> f64 {
        ((i * SINGLE_LANES + k + 1) as f64 * 0.618_033_988_749_894_9).fract() - 0.5
    }

    impl<X: Real, const L: usize> WithLanes<X, L> for Everything {
        type Output = Vec<[X; L]>;

        #[inline(always)]
        fn run<S: Lanes<L, X = X>>(self, s: S) -> Self::Output {
            let mut rows = [s.zero(); L];
            for (i, row) in rows.iter_mut().enumerate() {
                let mut numbers = [X::zero(); L];
                for (k, x) in numbers.iter_mut().enumerate() {
                    *x = X::lit(entry(i, k));
                }
                *row = s.load(&numbers);
            }
            let columns = s.transpose(rows);
            let (a, b, c) = (rows[1], columns[2], s.splat(X::lit(0.3)));
            let results = [
                s.add(a, b),
                s.mul(a, b),
                s.mul_add(a, b, c),
                s.mul_sub(a, b, c),
                s.abs(a),
                s.sub(a, b),
                s.div(a, b),
                s.where_less(a, b, c, a),
            ];
            let mut out = Vec::new();
            for v in columns.into_iter().chain(results) {
                let mut numbers = [X::zero(); L];
                s.store(v, &mut numbers);
                out.push(numbers);
            }
            out
        }
    }

    fn judge<X: Real, const L: usize>(all: Vec<Vec<[X; L]>>, epsilon: f64) {
        for results in all {
            for i in 0..L {
                for k in 0..L {
                    assert_eq!(results[i][k].value(), X::lit(entry(k, i)).value());
                }
            }
            for k in 0..L {
                let (a, b, c) = (entry(1, k), entry(k, 2), 0.3);
                let expected = [a + b, a * b, a * b + c, c - a * b, a.abs(), a - b, a / b, if a < b { c } else { a }];
                for (result, expected) in results[L..].iter().zip(expected) {
                    assert!(
                        (result[k].value() - expected).abs() <= epsilon * expected.abs().max(1.0),
                        "{} for {expected}",
                        result[k]
                    );
                }
            }
        }
    }

    #[test]
    fn all_instruction_sets_compute_the_same() {
        let mut double = vec![Everything.run(Portable), f64::widest(Everything)];
        let mut single = vec![Everything.run(PortableSingle), f32::widest(Everything)];
        #[cfg(target_arch = "x86_64")]
        {
            use pulp::x86::{V3, V4};
            double.extend(V4::try_new().map(|s| Everything.run(s)));
            double.extend(V3::try_new().map(|s| Everything.run(s)));
            single.extend(V4::try_new().map(|s| Everything.run(x86::Single(s))));
            single.extend(V3::try_new().map(|s| Everything.run(x86::Single(s))));
        }
        judge(double, f64::EPSILON);
        judge(single, 2.0 * f64::from(f32::EPSILON));
    }
}
