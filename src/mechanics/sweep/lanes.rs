//! Vectors of eight numbers, a lane each, with whatever the processor has: AVX-512, AVX2 with FMA, or plain arrays.
//!
//! The operations and their order are the same everywhere; a·b + c is rounded once where the processor has FMA and
//! twice where it has not, and that is all a result can differ by between processors.

use crate::scalar::{Arithmetic, Real};

/// Lanes of a vector, in double and in single precision.
pub const LANES: usize = 8;

/// Arithmetic on lanes. A value of the type is the proof that the processor has the instructions.
pub trait Lanes: Arithmetic {
    /// The number in a lane.
    type X: Real;
    /// Whether these lanes are there for the rare processor that has no other: kernels then do without a copy for every width.
    const RARE: bool = false;
    fn splat(self, x: Self::X) -> Self::N;
    fn load(self, x: &[Self::X; LANES]) -> Self::N;
    fn store(self, v: Self::N, out: &mut [Self::X; LANES]);
    fn abs(self, a: Self::N) -> Self::N;
    fn sub(self, a: Self::N, b: Self::N) -> Self::N;
    fn div(self, a: Self::N, b: Self::N) -> Self::N;
    /// `then` where a < b, and `otherwise` elsewhere.
    fn where_less(self, a: Self::N, b: Self::N, then: Self::N, otherwise: Self::N) -> Self::N;
    /// Vectors of rows of nodes, no wider than the registers are.
    type Rows: Rows<X = Self::X, Particles = Self::N>;
    fn rows(self) -> Self::Rows;
}

/// Arithmetic on rows of nodes, a lane each, with as many as fill one register.
pub trait Rows: Arithmetic {
    /// The number in a lane.
    type X: Real;
    /// A vector with a lane for each particle.
    type Particles: Copy;
    /// Rows of a vector.
    const COUNT: usize;
    fn splat(self, x: Self::X) -> Self::N;
    /// From a vector of particles for each row to a vector of rows for each particle.
    fn columns(self, rows: [Self::Particles; LANES]) -> [Self::N; LANES];
    /// Adds the `k`-th of `sums` to the `k`-th number from `places[row]` on, for every row; a vector's length from there is read and written.
    fn add_up(self, sums: &[Self::N], places: &[usize], out: &mut [Self::X]);
}

/// Rows that are as many as the particles.
macro_rules! square {
    ($s:ty, $number:ty, $this:ident, $transpose:expr) => {
        impl Rows for $s {
            type X = $number;
            type Particles = <Self as Arithmetic>::N;
            const COUNT: usize = LANES;
            #[inline(always)]
            fn splat(self, x: $number) -> Self::N {
                Lanes::splat(self, x)
            }
            #[inline(always)]
            fn columns($this, rows: [Self::N; LANES]) -> [Self::N; LANES] {
                $transpose($this, rows)
            }
            #[inline(always)]
            fn add_up(self, sums: &[Self::N], places: &[usize], out: &mut [$number]) {
                for (part, some) in sums.chunks(LANES).enumerate() {
                    let mut rows = [self.zero(); LANES];
                    rows[..some.len()].copy_from_slice(some);
                    let rows = self.columns(rows);
                    for (row, &place) in rows.iter().zip(places) {
                        if let Some(slot) = out[place + part * LANES..].first_chunk_mut::<LANES>() {
                            let sum = Arithmetic::add(self, self.load(slot), *row);
                            self.store(sum, slot);
                        }
                    }
                }
            }
        }
    };
}

/// Rows become columns.
#[inline(always)]
fn transposed<S, X: Copy, const N: usize>(_: S, rows: [[X; N]; N]) -> [[X; N]; N] {
    let mut columns = rows;
    for i in 0..N {
        for k in 0..N {
            columns[i][k] = rows[k][i];
        }
    }
    columns
}

/// Something to be done with the widest lanes there are.
pub trait WithLanes<X> {
    /// What comes out.
    type Output;
    /// Does it.
    fn run<S: Lanes<X = X>>(self, s: S) -> Self::Output;
}

/// A number that has vectors.
pub trait Widest: Real {
    /// Does it with the widest lanes of this processor.
    fn widest<W: WithLanes<Self>>(work: W) -> W::Output;
}

/// Plain arrays.
#[derive(Clone, Copy)]
pub(super) struct Portable<X>(std::marker::PhantomData<X>);

impl<X> Portable<X> {
    pub(super) const NEW: Self = Self(std::marker::PhantomData);
}

macro_rules! portable {
    ($number:ty) => {
        impl Arithmetic for Portable<$number> {
            type N = [$number; LANES];
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

        impl Lanes for Portable<$number> {
            type X = $number;
            // An x86-64 without AVX2.
            const RARE: bool = cfg!(target_arch = "x86_64");
            #[inline(always)]
            fn splat(self, x: $number) -> Self::N {
                [x; LANES]
            }
            #[inline(always)]
            fn load(self, x: &[$number; LANES]) -> Self::N {
                *x
            }
            #[inline(always)]
            fn store(self, v: Self::N, out: &mut [$number; LANES]) {
                *out = v;
            }
            type Rows = Self;
            #[inline(always)]
            fn rows(self) -> Self {
                self
            }
            #[inline(always)]
            fn abs(self, a: Self::N) -> Self::N {
                a.map(<$number>::abs)
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

portable!(f64);
portable!(f32);
square!(Portable<f64>, f64, self, transposed);
square!(Portable<f32>, f32, self, transposed);

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Arithmetic, LANES, Lanes, Rows, transposed};
    use pulp::x86::{V3, V4};
    use pulp::{Simd, cast, f32x8, f64x4, f64x8};

    /// The same processor, in single precision: eight numbers are one register of AVX2.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Single(pub V3);

    /// Vectors of one register.
    macro_rules! whole {
        ($s:ty, $this:ident => $simd:expr, $vector:ty, $number:ty, $family:ident, $fnmadd:ident,
         $add:ident, $mul:ident, $mul_add:ident, $splat:ident, $abs:ident, $sub:ident, $div:ident, $less:ident, $select:ident) => {
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
                    cast($simd.$family.$fnmadd(cast(a), cast(b), cast(c)))
                }
                #[inline(always)]
                fn zero($this) -> $vector {
                    $simd.$splat(0.0)
                }
            }

            impl Lanes for $s {
                type X = $number;
                #[inline(always)]
                fn splat($this, x: $number) -> $vector {
                    $simd.$splat(x)
                }
                #[inline(always)]
                fn load(self, x: &[$number; LANES]) -> $vector {
                    cast(*x)
                }
                #[inline(always)]
                fn store(self, v: $vector, out: &mut [$number; LANES]) {
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
                type Rows = Self;
                #[inline(always)]
                fn rows(self) -> Self {
                    self
                }
            }
        };
    }

    whole!(V4, self => self, f64x8, f64, avx512f, _mm512_fnmadd_pd,
        add_f64s, mul_f64s, mul_add_f64s, splat_f64s, abs_f64s, sub_f64s, div_f64s, less_than_f64s, select_f64s);
    square!(V4, f64, self, transpose_8);
    whole!(Single, self => self.0, f32x8, f32, fma, _mm256_fnmadd_ps,
        add_f32s, mul_f32s, mul_add_f32s, splat_f32s, abs_f32s, sub_f32s, div_f32s, less_than_f32s, select_f32s);
    square!(Single, f32, self, transpose_single);

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
    fn transpose_single(s: Single, rows: [f32x8; LANES]) -> [f32x8; LANES] {
        let mut numbers = [[0.0_f32; LANES]; LANES];
        for k in 0..LANES {
            numbers[k] = cast(rows[k]);
        }
        let numbers = transposed(s, numbers);
        let mut columns = rows;
        for i in 0..LANES {
            columns[i] = cast(numbers[i]);
        }
        columns
    }

    /// Four rows in one register of AVX2: eight in two would leave no room for their sums.
    #[derive(Clone, Copy)]
    pub struct Four(V3);

    impl Arithmetic for Four {
        type N = f64x4;
        #[inline(always)]
        fn add(self, a: f64x4, b: f64x4) -> f64x4 {
            self.0.add_f64s(a, b)
        }
        #[inline(always)]
        fn mul(self, a: f64x4, b: f64x4) -> f64x4 {
            self.0.mul_f64s(a, b)
        }
        #[inline(always)]
        fn mul_add(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
            self.0.mul_add_f64s(a, b, c)
        }
        #[inline(always)]
        fn mul_sub(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
            cast(self.0.fma._mm256_fnmadd_pd(cast(a), cast(b), cast(c)))
        }
        #[inline(always)]
        fn zero(self) -> f64x4 {
            self.0.splat_f64s(0.0)
        }
    }

    impl Rows for Four {
        type X = f64;
        type Particles = [f64x4; 2];
        const COUNT: usize = 4;
        #[inline(always)]
        fn splat(self, x: f64) -> f64x4 {
            self.0.splat_f64s(x)
        }
        #[inline(always)]
        fn columns(self, rows: [[f64x4; 2]; LANES]) -> [f64x4; LANES] {
            let [a, b, c, d] = self.transpose([rows[0][0], rows[1][0], rows[2][0], rows[3][0]]);
            let [e, f, g, h] = self.transpose([rows[0][1], rows[1][1], rows[2][1], rows[3][1]]);
            [a, b, c, d, e, f, g, h]
        }
        #[inline(always)]
        fn add_up(self, sums: &[f64x4], places: &[usize], out: &mut [f64]) {
            for (part, some) in sums.chunks(4).enumerate() {
                let mut rows = [self.zero(); 4];
                rows[..some.len()].copy_from_slice(some);
                let rows = self.transpose(rows);
                for (row, &place) in rows.iter().zip(places) {
                    if let Some(slot) = out[place + part * 4..].first_chunk_mut::<4>() {
                        *slot = cast(self.0.add_f64s(cast(*slot), *row));
                    }
                }
            }
        }
    }

    impl Four {
        /// Rows become columns.
        #[inline(always)]
        fn transpose(self, [a, b, c, d]: [f64x4; 4]) -> [f64x4; 4] {
            let x = self.0.avx;
            let (ab_low, ab_high) = (x._mm256_unpacklo_pd(cast(a), cast(b)), x._mm256_unpackhi_pd(cast(a), cast(b)));
            let (cd_low, cd_high) = (x._mm256_unpacklo_pd(cast(c), cast(d)), x._mm256_unpackhi_pd(cast(c), cast(d)));
            [
                cast(x._mm256_permute2f128_pd::<0x20>(ab_low, cd_low)),
                cast(x._mm256_permute2f128_pd::<0x20>(ab_high, cd_high)),
                cast(x._mm256_permute2f128_pd::<0x31>(ab_low, cd_low)),
                cast(x._mm256_permute2f128_pd::<0x31>(ab_high, cd_high)),
            ]
        }
    }

    /// Vectors of two registers.
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
        type X = f64;
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
        type Rows = Four;
        #[inline(always)]
        fn rows(self) -> Four {
            Four(self)
        }
        #[inline(always)]
        fn abs(self, a: Self::N) -> Self::N {
            [self.abs_f64s(a[0]), self.abs_f64s(a[1])]
        }
        #[inline(always)]
        fn sub(self, a: Self::N, b: Self::N) -> Self::N {
            [self.sub_f64s(a[0], b[0]), self.sub_f64s(a[1], b[1])]
        }
        #[inline(always)]
        fn div(self, a: Self::N, b: Self::N) -> Self::N {
            [self.div_f64s(a[0], b[0]), self.div_f64s(a[1], b[1])]
        }
        #[inline(always)]
        fn where_less(self, a: Self::N, b: Self::N, then: Self::N, otherwise: Self::N) -> Self::N {
            let half = |i: usize| self.select_f64s(self.less_than_f64s(a[i], b[i]), then[i], otherwise[i]);
            [half(0), half(1)]
        }
    }
}

/// The call as `pulp` wants it.
#[cfg(target_arch = "x86_64")]
struct Call<W, S>(W, S);

#[cfg(target_arch = "x86_64")]
impl<W: WithLanes<S::X>, S: Lanes> pulp::NullaryFnOnce for Call<W, S> {
    type Output = W::Output;
    #[inline(always)]
    fn call(self) -> W::Output {
        self.0.run(self.1)
    }
}

impl Widest for f64 {
    #[inline]
    fn widest<W: WithLanes<Self>>(work: W) -> W::Output {
        #[cfg(target_arch = "x86_64")]
        {
            use pulp::x86::{V3, V4};
            if let Some(s) = V4::try_new() {
                return s.vectorize(Call(work, s));
            }
            if let Some(s) = V3::try_new() {
                return s.vectorize(Call(work, s));
            }
        }
        work.run(Portable::<f64>::NEW)
    }
}

impl Widest for f32 {
    #[inline]
    fn widest<W: WithLanes<Self>>(work: W) -> W::Output {
        #[cfg(target_arch = "x86_64")]
        if let Some(s) = pulp::x86::V3::try_new() {
            return s.vectorize(Call(work, x86::Single(s)));
        }
        work.run(Portable::<f32>::NEW)
    }
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

    impl<X: Real> WithLanes<X> for Everything {
        type Output = Vec<[X; LANES]>;

        #[inline(always)]
        fn run<S: Lanes<X = X>>(self, s: S) -> Self::Output {
            let mut rows = [s.zero(); LANES];
            for (i, row) in rows.iter_mut().enumerate() {
                let mut numbers = [X::zero(); LANES];
                for (k, x) in numbers.iter_mut().enumerate() {
                    *x = X::lit(entry(i, k));
                }
                *row = s.load(&numbers);
            }
            // As many columns as there are rows, one after the other, and back into memory.
            let r = s.rows();
            let (columns, count) = (r.columns(rows), <S::Rows as Rows>::COUNT);
            let mut written = vec![X::zero(); LANES * LANES + LANES];
            let places: Vec<usize> = (0..count).map(|row| row * LANES).collect();
            r.add_up(&columns, &places, &mut written);
            let (a, b, c) = (rows[1], rows[2], s.splat(X::lit(0.3)));
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
            let mut out: Vec<[X; LANES]> = written.as_chunks().0[..LANES].to_vec();
            out.truncate(count);
            out.resize(LANES, [X::zero(); LANES]);
            for v in results {
                let mut numbers = [X::zero(); LANES];
                s.store(v, &mut numbers);
                out.push(numbers);
            }
            out
        }
    }

    fn judge<X: Real>(all: Vec<Vec<[X; LANES]>>, epsilon: f64) {
        for results in all {
            // Rows become columns and rows again: at least four of them.
            let rows = if results[4][0].value() == 0.0 { 4 } else { LANES };
            for i in 0..rows {
                for k in 0..LANES {
                    assert_eq!(results[i][k].value(), X::lit(entry(i, k)).value());
                }
            }
            for k in 0..LANES {
                let (a, b, c) = (entry(1, k), entry(2, k), 0.3);
                let expected = [a + b, a * b, a * b + c, c - a * b, a.abs(), a - b, a / b, if a < b { c } else { a }];
                for (result, expected) in results[LANES..].iter().zip(expected) {
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
        let mut double = vec![Everything.run(Portable::<f64>::NEW), f64::widest(Everything)];
        let mut single = vec![Everything.run(Portable::<f32>::NEW), f32::widest(Everything)];
        #[cfg(target_arch = "x86_64")]
        if let Some(s) = pulp::x86::V3::try_new() {
            double.push(Everything.run(s));
            single.push(Everything.run(x86::Single(s)));
        }
        judge(double, f64::EPSILON);
        judge(single, 2.0 * f64::from(f32::EPSILON));
    }
}
