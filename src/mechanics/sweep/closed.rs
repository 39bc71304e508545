//! The product with tangents in closed form, all eight particles of a group at once.

use super::infallible;
use super::kernel::{Gathered, Quadratic, Terms, pair, scatter_blocks};
use super::lanes::{LANES, Lanes, WithLanes, widest};
use super::tiled::{Block, Tiled, first_error, keep_first};
use super::waves::{self, Stage};
use crate::material::ClosedTangent;
use crate::tensor::{Tensor, Vector};

/// Tangents of all particles in closed form: for each group its numbers, a row of eight lanes each.
#[derive(Clone, Debug)]
pub struct ClosedTangents<const D: usize> {
    numbers: Vec<[f64; LANES]>,
    /// Whether the laws have the term b L c.
    both: bool,
    /// Whether there is a consistent inertia, q = (weight of the particle) u.
    inertia: bool,
}

/// Rows of a group: A, B, κ, q, then b and c, then the inertia.
const fn rows(dimension: usize, both: bool, inertia: bool) -> usize {
    let symmetric = dimension * (dimension + 1) / 2;
    dimension * dimension + symmetric + 2 + if both { 2 * symmetric } else { 0 } + inertia as usize
}

/// Writes the entries of a closed tangent, in the order of the rows.
fn write<const D: usize>(tangent: &ClosedTangent<f64, D>, both: bool, inertia: Option<f64>, mut put: impl FnMut(f64)) {
    let upper = |a: &[[f64; D]; D], put: &mut dyn FnMut(f64)| {
        for k in 0..D {
            for i in 0..=k {
                put(a[i][k]);
            }
        }
    };
    tangent.a.as_flattened().iter().for_each(|&x| put(x));
    upper(&tangent.right, &mut put);
    put(tangent.bulk);
    put(tangent.q);
    if both {
        // Beside laws that have the term, those that have not take b = c = 0.
        let [b, c] = tangent.both.unwrap_or([[[0.0; D]; D]; 2]);
        upper(&b, &mut put);
        upper(&c, &mut put);
    }
    inertia.into_iter().for_each(put);
}

/// The rows of a group, read one after the other.
struct Rows<'a, S> {
    s: S,
    rows: &'a [[f64; LANES]],
}

impl<S: Lanes> Rows<'_, S> {
    #[inline(always)]
    fn next(&mut self) -> S::N {
        match self.rows.split_first() {
            Some((row, behind)) => {
                self.rows = behind;
                self.s.load(row)
            }
            None => self.s.zero(),
        }
    }
}

/// The tangent from its rows.
#[inline(always)]
fn read<S: Lanes, const D: usize>(both: bool, rows: &mut Rows<'_, S>) -> ClosedTangent<S::N, D> {
    let first = rows.next();
    let mut a = [[first; D]; D];
    for at in 1..D * D {
        a[at / D][at % D] = rows.next();
    }
    let right = symmetric(first, rows);
    let (bulk, q) = (rows.next(), rows.next());
    let both = if both { Some([symmetric(first, rows), symmetric(first, rows)]) } else { None };
    ClosedTangent { a, right, bulk, q, both }
}

/// A symmetric tensor from its upper triangle, column by column.
#[inline(always)]
fn symmetric<S: Lanes, const D: usize>(any: S::N, rows: &mut Rows<'_, S>) -> [[S::N; D]; D] {
    let mut b = [[any; D]; D];
    for k in 0..D {
        for i in 0..=k {
            b[i][k] = rows.next();
            b[k][i] = b[i][k];
        }
    }
    b
}

impl<const D: usize> ClosedTangents<D> {
    /// Bytes of all arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(self.numbers.as_slice())
    }

    /// Rows of a group.
    fn rows(&self) -> usize {
        rows(D, self.both, self.inertia)
    }
}

impl<const D: usize> Tiled<D> {
    /// The tangents `point(p, ∇u_p)` of all particles, and their consistent inertia if there is one.
    pub(super) fn closed<E: Send>(
        &self,
        field: &[Vector<f64, D>],
        both: bool,
        inertia: Option<&(dyn Fn(usize) -> f64 + Sync)>,
        point: impl Fn(usize, Tensor<f64, D>) -> Result<ClosedTangent<f64, D>, E> + Sync,
    ) -> Result<ClosedTangents<D>, E> {
        let rows = rows(D, both, inertia.is_some());
        let mut numbers = vec![[0.0; LANES]; self.groups() * rows];
        let mut chunks = Vec::with_capacity(self.blocks.len());
        let mut rest = numbers.as_mut_slice();
        for block in &self.blocks {
            let (chunk, behind) = rest.split_at_mut(block.groups() * rows);
            chunks.push(chunk);
            rest = behind;
        }
        let results = waves::gathered(self, field, chunks, |block, chunk, stored| {
            let mut failure = None;
            block.each(|group, lane, p| {
                let (_, gradient) = stored[group].of_lane(lane);
                match point(p, gradient) {
                    Ok(tangent) => {
                        let mut places = chunk[group * rows..(group + 1) * rows].iter_mut();
                        write(&tangent, both, inertia.map(|weight| weight(p)), |x| {
                            if let Some(row) = places.next() {
                                row[lane] = x;
                            }
                        });
                    }
                    Err(error) => keep_first(&mut failure, p, error),
                }
            });
            failure.map_or(Ok(()), Err)
        });
        first_error(results)?;
        Ok(ClosedTangents { numbers, both, inertia: inertia.is_some() })
    }

    /// `out_I += Σ_p (δP_p) ∇_n N_I + q_p N_I`, the product of the tangents with `field`.
    pub(super) fn product(&self, frozen: &ClosedTangents<D>, field: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        match (frozen.both, frozen.inertia) {
            (false, false) => self.product_of(&Product::<D, false, false>(frozen), field, out),
            (false, true) => self.product_of(&Product::<D, false, true>(frozen), field, out),
            (true, false) => self.product_of(&Product::<D, true, false>(frozen), field, out),
            (true, true) => self.product_of(&Product::<D, true, true>(frozen), field, out),
        }
    }

    fn product_of<const BOTH: bool, const INERTIA: bool>(
        &self,
        stage: &Product<'_, D, BOTH, INERTIA>,
        field: &[Vector<f64, D>],
        out: &mut [Vector<f64, D>],
    ) {
        infallible(waves::run(self, Some(field), out, stage));
    }

    /// `out_I += Σ_p` the block of I with itself, inertia included.
    pub(super) fn add_blocks(&self, frozen: &ClosedTangents<D>, out: &mut [Tensor<f64, D>]) {
        let work = |block: &Block<D>, _: &mut Vec<f64>, buffer: &mut [f64]| {
            widest(DiagonalBlocks { block, frozen, buffer });
            None::<std::convert::Infallible>
        };
        let add = |block: &Block<D>, buffer: &[f64], first: usize, out: &mut [Tensor<f64, D>]| {
            block.add(buffer, D * D, first, out, |sum, rows| {
                *sum += Tensor::from_fn(|i, k| rows[i * D + k]);
            });
        };
        waves::each_block(self, D * D, out, work, add, |never| match never {});
    }

    /// Bytes that the tangents of all particles take in closed form.
    pub(super) fn closed_bytes(&self, both: bool, inertia: bool) -> usize {
        self.groups() * rows(D, both, inertia) * size_of::<[f64; LANES]>()
    }
}

/// The diagonal blocks from the particles of one block of cells.
struct DiagonalBlocks<'a, const D: usize> {
    block: &'a Block<D>,
    frozen: &'a ClosedTangents<D>,
    buffer: &'a mut [f64],
}

impl<const D: usize> WithLanes for DiagonalBlocks<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        let count = self.frozen.rows();
        let mut quadratic = Quadratic::<D>::zero();
        for group in 0..self.block.groups() {
            let first = (self.block.first_group + group) * count;
            let numbers = &self.frozen.numbers[first..first + count];
            let tangent: ClosedTangent<S::N, D> = read(self.frozen.both, &mut Rows { s, rows: numbers });
            for l in 0..D {
                for k in 0..=l {
                    let (one, other) = (tangent.unit_block(s, k, l), tangent.unit_block(s, l, k));
                    for i in 0..D {
                        for j in 0..D {
                            let sum = if k < l { s.add(one[i][j], other[i][j]) } else { one[i][j] };
                            s.store(sum, &mut quadratic.bilinear[pair(k, l)][i][j]);
                        }
                    }
                }
            }
            if self.frozen.inertia {
                quadratic.mass = numbers[count - 1];
            }
            scatter_blocks(s, &self.block.window(group), &quadratic, self.buffer);
        }
    }
}

/// σ = V₀ δP F_nᵀ, q = (inertia) u.
struct Product<'a, const D: usize, const BOTH: bool, const INERTIA: bool>(&'a ClosedTangents<D>);

impl<const D: usize, const BOTH: bool, const INERTIA: bool> Terms for Product<'_, D, BOTH, INERTIA> {
    const VALUE: bool = INERTIA;
    const GRADIENT: bool = true;
    const MAGNITUDE: bool = false;
}

impl<const D: usize, const BOTH: bool, const INERTIA: bool> Stage<D> for Product<'_, D, BOTH, INERTIA> {
    type Error = std::convert::Infallible;

    #[inline(always)]
    fn point<S: Lanes>(
        &self,
        s: S,
        group: usize,
        _particles: &[u32],
        at: &mut Gathered<S::N, D>,
    ) -> Result<(), (usize, Self::Error)> {
        let count = rows(D, BOTH, INERTIA);
        let numbers = &self.0.numbers[group * count..(group + 1) * count];
        let tangent: ClosedTangent<S::N, D> = read(BOTH, &mut Rows { s, rows: numbers });
        at.gradient = tangent.product(s, &at.gradient);
        if INERTIA {
            let weight = s.load(&numbers[count - 1]);
            for value in &mut at.value {
                *value = s.mul(weight, *value);
            }
        }
        Ok(())
    }
}
