//! Vectors of eight numbers, a lane each, with the instructions of the processor: AVX-512, AVX2 with FMA, or plain arrays.
//!
//! The operations and their order are the same on every processor. Results differ between processors in one way only: a·b + c is
//! rounded once with FMA, and twice without.

use pulp::{Scalar, Simd};
use std::ops::{Add, Div, Mul, Sub};

#[cfg(target_arch = "x86_64")]
use pulp::x86::{V3, V4};

/// Number of lanes of a vector.
pub(crate) const LANES: usize = 8;

/// A number, or the lanes of a vector, so that a formula written once serves both. Numbers and lanes agree bitwise, except that the two
/// methods with products round once on a processor with FMA.
pub(crate) trait Lane:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The constant `x` in the type of `self`.
    fn constant(self, x: f64) -> Self;

    /// self + a b
    fn add_product(self, a: Self, b: Self) -> Self;

    /// self − a b
    fn sub_product(self, a: Self, b: Self) -> Self;

    /// `then` where `self` < `other`, and `otherwise` elsewhere.
    fn where_less(self, other: Self, then: Self, otherwise: Self) -> Self;

    /// |x|
    fn abs(self) -> Self;
}

impl Lane for f64 {
    #[inline(always)]
    fn constant(self, x: f64) -> Self {
        x
    }

    #[inline(always)]
    fn add_product(self, a: Self, b: Self) -> Self {
        self + a * b
    }

    #[inline(always)]
    fn sub_product(self, a: Self, b: Self) -> Self {
        self - a * b
    }

    #[inline(always)]
    fn where_less(self, other: Self, then: Self, otherwise: Self) -> Self {
        if self < other { then } else { otherwise }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
}

/// The vectors of a processor. A value of this type proves that the processor has the instructions.
pub(crate) trait Lanes: Copy {
    /// Whether these lanes only serve the rare processor without AVX2. Kernels are then not compiled for every width.
    const RARE: bool;
    /// A vector of eight numbers.
    type N: Lane;
    fn splat(self, x: f64) -> Self::N;
    fn load(self, x: &[f64; LANES]) -> Self::N;
    fn store(self, v: Self::N, out: &mut [f64; LANES]);
    /// A vector with a row of nodes in each lane. It holds as many rows as fill one register.
    type Rows: Lane;
    /// Number of rows in such a vector.
    const ROWS: usize;
    fn splat_rows(self, x: f64) -> Self::Rows;
    /// Transposes: a vector of particles for each row becomes a vector of rows for each particle.
    fn columns(self, rows: &[Self::N; LANES]) -> [Self::Rows; LANES];
    /// Adds the `k`-th of `sums` to the `k`-th number from `places[row]` on, for every row. Whole vectors are read and written, so `out`
    /// has to be one vector longer than the numbers it holds.
    fn add_up(self, sums: &[Self::Rows], places: &[usize], out: &mut [f64]);
}

/// An instruction set that transposes a square of numbers, one row a register.
pub(crate) trait Square: Simd {
    #[inline(always)]
    fn transpose(self, rows: &mut [Self::f64s]) {
        let numbers: &mut [f64] = bytemuck::cast_slice_mut(rows);
        for i in 0..Self::F64_LANES {
            for k in 0..i {
                numbers.swap(i * Self::F64_LANES + k, k * Self::F64_LANES + i);
            }
        }
    }
}

/// A computation that is generic over the lanes.
pub(crate) trait WithLanes {
    /// Runs the computation with the lanes `s`.
    fn run<S: Lanes>(self, s: S);
}

/// Runs `work` with the widest lanes of this processor.
#[inline]
pub(crate) fn widest(work: impl WithLanes) {
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(s) = V4::try_new() {
            return s.vectorize(Call(work, Registers::<_, 1, 1>(s)));
        }
        if let Some(s) = V3::try_new() {
            return s.vectorize(Call(work, Registers::<_, 2, 1>(s)));
        }
    }
    work.run(PORTABLE);
}

/// Whether this processor rounds a product and a sum once.
pub(crate) fn rounds_once() -> bool {
    #[cfg(target_arch = "x86_64")]
    return V3::try_new().is_some();
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// The name of the widest instructions of this processor. Those that round a product and a sum once give other bits than the others.
pub(crate) fn instructions() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    if let Some(name) = V4::try_new().map(|_| "AVX-512").or(V3::try_new().map(|_| "AVX2 and FMA")) {
        return name;
    }
    "no vector instructions of its own"
}

/// A computation `W` on C components in D dimensions.
pub(crate) struct In<W, const C: usize, const D: usize>(pub W);

/// Runs a computation with the widest lanes, for one component or for as many as there are axes. No generic parameter of a caller enters,
/// so that every computation is compiled once for each dimension and instruction set.
macro_rules! in_dimension {
    ($dimension:expr, $work:expr) => {
        match $dimension {
            1 => $crate::lanes::widest($crate::lanes::In::<_, 1, 1>($work)),
            2 => $crate::lanes::widest($crate::lanes::In::<_, 2, 2>($work)),
            _ => $crate::lanes::widest($crate::lanes::In::<_, 3, 3>($work)),
        }
    };
    ($dimension:expr, $components:expr, $work:expr) => {
        match ($dimension, $components) {
            (2, 1) => $crate::lanes::widest($crate::lanes::In::<_, 1, 2>($work)),
            (3, 1) => $crate::lanes::widest($crate::lanes::In::<_, 1, 3>($work)),
            _ => $crate::lanes::in_dimension!($dimension, $work),
        }
    };
}

pub(crate) use in_dimension;

/// The call in the form that `pulp` takes.
#[cfg(target_arch = "x86_64")]
struct Call<W, S>(W, S);

#[cfg(target_arch = "x86_64")]
impl<W: WithLanes, S: Lanes> pulp::NullaryFnOnce for Call<W, S> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        self.0.run(self.1);
    }
}

/// Eight numbers in `N` registers of the instruction set `I`. A vector of rows of nodes takes `R` registers. A value of `I` proves that the
/// processor has the instructions.
#[derive(Clone, Copy)]
pub(crate) struct Registers<I, const N: usize, const R: usize>(pub I);

/// Plain numbers, one a register.
pub(crate) const PORTABLE: Registers<Scalar, LANES, LANES> = Registers(Scalar);

/// `N` registers of the instruction set `I`.
#[derive(Clone, Copy)]
pub(crate) struct Wide<I: Simd, const N: usize>(I, [I::f64s; N]);

/// Defines operations on vectors, register by register.
macro_rules! by_register {
    ($($method:ident($this:ident $(, $other:ident)*) = $of_one:ident($($a:ident),+)),+) => {
        $(#[inline(always)]
        fn $method(self, $($other: Self),*) -> Self {
            // A loop, not a closure: a closure that is not inlined loses the wide instructions.
            let ($this, mut out) = (self, self);
            for i in 0..N {
                out.1[i] = self.0.$of_one($($a.1[i]),+);
            }
            out
        })+
    };
}

macro_rules! operator {
    ($operator:ident, $method:ident, $of_one:ident) => {
        impl<I: Simd, const N: usize> $operator for Wide<I, N> {
            type Output = Self;
            by_register! { $method(a, b) = $of_one(a, b) }
        }
    };
}

operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl<I: Simd, const N: usize> Lane for Wide<I, N> {
    #[inline(always)]
    fn constant(self, x: f64) -> Self {
        Self(self.0, [self.0.splat_f64s(x); N])
    }

    #[inline(always)]
    fn where_less(self, other: Self, then: Self, mut otherwise: Self) -> Self {
        for i in 0..N {
            let less = self.0.less_than_f64s(self.1[i], other.1[i]);
            otherwise.1[i] = self.0.select_f64s(less, then.1[i], otherwise.1[i]);
        }
        otherwise
    }

    by_register! {
        add_product(sum, a, b) = mul_add_e_f64s(a, b, sum),
        sub_product(sum, a, b) = negate_mul_add_e_f64s(a, b, sum),
        abs(a) = abs_f64s(a)
    }
}

impl<I: Square, const N: usize, const R: usize> Lanes for Registers<I, N, R> {
    // An x86-64 without AVX2.
    const RARE: bool = I::IS_SCALAR && cfg!(target_arch = "x86_64");
    type N = Wide<I, N>;
    #[inline(always)]
    fn splat(self, x: f64) -> Self::N {
        Wide(self.0, [self.0.splat_f64s(x); N])
    }
    #[inline(always)]
    fn load(self, x: &[f64; LANES]) -> Self::N {
        let mut out = self.splat(0.0);
        out.1.copy_from_slice(I::as_simd_f64s(x).0);
        out
    }
    #[inline(always)]
    fn store(self, v: Self::N, out: &mut [f64; LANES]) {
        I::as_mut_simd_f64s(out).0.copy_from_slice(&v.1);
    }
    type Rows = Wide<I, R>;
    const ROWS: usize = R * I::F64_LANES;
    #[inline(always)]
    fn splat_rows(self, x: f64) -> Self::Rows {
        Wide(self.0, [self.0.splat_f64s(x); R])
    }
    #[inline(always)]
    fn columns(self, rows: &[Self::N; LANES]) -> [Self::Rows; LANES] {
        transposed(self.0, rows)
    }
    #[inline(always)]
    fn add_up(self, sums: &[Self::Rows], places: &[usize], out: &mut [f64]) {
        for (part, some) in sums.chunks(Self::ROWS).enumerate() {
            let mut rows = [self.splat_rows(0.0); LANES];
            rows[..some.len()].copy_from_slice(some);
            let rows = transposed::<I, R, R>(self.0, &rows);
            for (row, &place) in rows[..Self::ROWS].iter().zip(places) {
                let to = &mut out[place + part * Self::ROWS..][..Self::ROWS];
                if let Some(to) = I::as_mut_simd_f64s(to).0.first_chunk_mut() {
                    *to = (Wide(self.0, *to) + *row).1;
                }
            }
        }
    }
}

/// Transposes rows of `A` registers into columns of `B` registers.
#[inline(always)]
fn transposed<I: Square, const A: usize, const B: usize>(simd: I, rows: &[Wide<I, A>; LANES]) -> [Wide<I, B>; LANES] {
    let zero = simd.splat_f64s(0.0);
    let mut columns = [Wide(simd, [zero; B]); LANES];
    for a in 0..A {
        for b in 0..B {
            let mut square = [zero; LANES];
            for i in 0..I::F64_LANES {
                square[i] = rows[b * I::F64_LANES + i].1[a];
            }
            simd.transpose(&mut square[..I::F64_LANES]);
            for i in 0..I::F64_LANES {
                columns[a * I::F64_LANES + i].1[b] = square[i];
            }
        }
    }
    columns
}

impl Square for Scalar {}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::Square;
    use pulp::x86::{V3, V4};
    use pulp::{cast, f64x4, f64x8};

    impl Square for V3 {
        #[inline(always)]
        fn transpose(self, rows: &mut [f64x4]) {
            let x = self.avx;
            let &mut [a, b, c, d] = rows else { return };
            let (ab_low, ab_high) = (x._mm256_unpacklo_pd(cast(a), cast(b)), x._mm256_unpackhi_pd(cast(a), cast(b)));
            let (cd_low, cd_high) = (x._mm256_unpacklo_pd(cast(c), cast(d)), x._mm256_unpackhi_pd(cast(c), cast(d)));
            rows.copy_from_slice(&[
                cast(x._mm256_permute2f128_pd::<0x20>(ab_low, cd_low)),
                cast(x._mm256_permute2f128_pd::<0x20>(ab_high, cd_high)),
                cast(x._mm256_permute2f128_pd::<0x31>(ab_low, cd_low)),
                cast(x._mm256_permute2f128_pd::<0x31>(ab_high, cd_high)),
            ]);
        }
    }

    /// Selects quarters 0 and 2 of both registers.
    const EVEN: i32 = 0b10_00_10_00;
    /// Selects quarters 1 and 3 of both registers.
    const ODD: i32 = 0b11_01_11_01;

    impl Square for V4 {
        #[inline(always)]
        fn transpose(self, rows: &mut [f64x8]) {
            let x = self.avx512f;
            // Two rows are interleaved into columns (0, 2, 4, 6) and (1, 3, 5, 7), two numbers a quarter. Then quarters are exchanged.
            let mut two = [[x._mm512_setzero_pd(); 4]; 2];
            for i in 0..4 {
                two[0][i] = x._mm512_unpacklo_pd(cast(rows[2 * i]), cast(rows[2 * i + 1]));
                two[1][i] = x._mm512_unpackhi_pd(cast(rows[2 * i]), cast(rows[2 * i + 1]));
            }
            for (k, two) in two.into_iter().enumerate() {
                let (a, b) =
                    (x._mm512_shuffle_f64x2::<EVEN>(two[0], two[1]), x._mm512_shuffle_f64x2::<ODD>(two[0], two[1]));
                let (c, d) =
                    (x._mm512_shuffle_f64x2::<EVEN>(two[2], two[3]), x._mm512_shuffle_f64x2::<ODD>(two[2], two[3]));
                rows[k] = cast(x._mm512_shuffle_f64x2::<EVEN>(a, c));
                rows[2 + k] = cast(x._mm512_shuffle_f64x2::<EVEN>(b, d));
                rows[4 + k] = cast(x._mm512_shuffle_f64x2::<ODD>(a, c));
                rows[6 + k] = cast(x._mm512_shuffle_f64x2::<ODD>(b, d));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums, products and the transposition of an irregular matrix.
    struct Everything<'a>(&'a mut Vec<[f64; LANES]>);

    fn results(run: impl FnOnce(Everything<'_>)) -> Vec<[f64; LANES]> {
        let mut out = Vec::new();
        run(Everything(&mut out));
        out
    }

    fn entry(i: usize, k: usize) -> f64 {
        ((i * LANES + k + 1) as f64 * 0.618_033_988_749_894_9).fract() - 0.5
    }

    impl WithLanes for Everything<'_> {
        #[inline(always)]
        fn run<S: Lanes>(self, s: S) {
            let mut rows = [s.splat(0.0); LANES];
            for (i, row) in rows.iter_mut().enumerate() {
                *row = s.load(&std::array::from_fn(|k| entry(i, k)));
            }
            // Transposed into columns, and back by adding them to rows in memory.
            let mut written = vec![0.0; LANES * LANES + LANES];
            let places: Vec<usize> = (0..S::ROWS).map(|row| row * LANES).collect();
            s.add_up(&s.columns(&rows), &places, &mut written);
            let (a, b, c) = (rows[1], rows[2], s.splat(0.3));
            let results =
                [a + b, a * b, c.add_product(a, b), c.sub_product(a, b), a.abs(), a - b, a / b, a.where_less(b, c, a)];
            let mut out: Vec<[f64; LANES]> = written.as_chunks().0[..LANES].to_vec();
            out.truncate(S::ROWS);
            out.resize(LANES, [0.0; LANES]);
            for v in results {
                let mut numbers = [0.0; LANES];
                s.store(v, &mut numbers);
                out.push(numbers);
            }
            *self.0 = out;
        }
    }

    fn judge(results: &[[f64; LANES]]) {
        // The rows were transposed twice. At least four of them were written.
        let rows = if results[4][0] == 0.0 { 4 } else { LANES };
        for i in 0..rows {
            for k in 0..LANES {
                assert_eq!(results[i][k], entry(i, k));
            }
        }
        for k in 0..LANES {
            let (a, b, c) = (entry(1, k), entry(2, k), 0.3);
            let expected = [a + b, a * b, a * b + c, c - a * b, a.abs(), a - b, a / b, if a < b { c } else { a }];
            for (result, expected) in results[LANES..].iter().zip(expected) {
                let apart = (result[k] - expected).abs();
                assert!(apart <= f64::EPSILON * expected.abs().max(1.0), "{} for {expected}", result[k]);
            }
        }
    }

    #[test]
    fn all_instruction_sets_compute_the_same() {
        judge(&results(|work| work.run(PORTABLE)));
        judge(&results(|work| widest(work)));
        #[cfg(target_arch = "x86_64")]
        if let Some(s) = V3::try_new() {
            judge(&results(|work| work.run(Registers::<_, 2, 1>(s))));
        }
    }
}
