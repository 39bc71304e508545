//! Tangents in closed form, the particles of a group side by side.

use super::block::{Block, Groups};
use super::lanes::{LANES, Lanes, Number, SINGLE_LANES};
use super::laws::{Laws, Tangents};
use super::of_block;
use super::tiled::{Tiled, first_error, keep_first};
use super::waves;
use crate::material::{ClosedTangent, Law};
use crate::mechanics::point::Inadmissible;
use crate::pooled::{Pool, Pooled};
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector};
use std::ops::Range;

/// Tangents of all particles in closed form, for the supports they were made with.
#[derive(Clone, Debug)]
pub struct ClosedTangents<const D: usize>(Numbers<f64, LANES>);

/// The same in single precision and without units: divided by h² and by `scale`.
#[derive(Clone, Debug)]
pub struct SingleTangents<const D: usize>(Numbers<f32, SINGLE_LANES>);

/// For each group its numbers, a row of lanes each.
#[derive(Clone, Debug)]
pub(super) struct Numbers<X: Number<L>, const L: usize> {
    numbers: Pooled<[X; L]>,
    pub(super) form: Form,
}

impl<X: Number<L>, const L: usize> Numbers<X, L> {
    #[inline(always)]
    pub(super) fn of_group(&self, group: usize, rows: usize) -> &[[X; L]] {
        &self.numbers[group * rows..(group + 1) * rows]
    }
}

/// Which numbers there are: A, B, κ, q, then b and c, then the weight of the inertia.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    /// Whether the laws have the term b L c.
    pub both: bool,
    /// Whether there is a consistent inertia, q = (weight of the particle) u.
    pub inertia: bool,
}

impl Form {
    /// Rows of a group.
    pub(super) const fn rows(self, dimension: usize) -> usize {
        let symmetric = dimension * (dimension + 1) / 2;
        let both = if self.both { 2 * symmetric } else { 0 };
        dimension * dimension + symmetric + 2 + both + self.inertia as usize
    }

    /// The tangent from the rows of a group.
    #[inline(always)]
    pub(super) fn read<S: Lanes<L>, const D: usize, const L: usize>(
        self,
        s: S,
        rows: &[[S::X; L]],
    ) -> ClosedTangent<S::N, D> {
        let mut at = 0;
        let mut a = [[s.zero(); D]; D];
        for i in 0..D {
            for k in 0..D {
                a[i][k] = s.load(&rows[at]);
                at += 1;
            }
        }
        let right = symmetric(s, rows, &mut at);
        let (bulk, q) = (s.load(&rows[at]), s.load(&rows[at + 1]));
        at += 2;
        let both = if self.both { Some([symmetric(s, rows, &mut at), symmetric(s, rows, &mut at)]) } else { None };
        ClosedTangent { a, right, bulk, q, both }
    }
}

/// A symmetric tensor from its upper triangle, column by column.
#[inline(always)]
fn symmetric<S: Lanes<L>, const D: usize, const L: usize>(s: S, rows: &[[S::X; L]], at: &mut usize) -> [[S::N; D]; D] {
    let mut b = [[s.zero(); D]; D];
    for k in 0..D {
        for i in 0..=k {
            b[i][k] = s.load(&rows[*at]);
            b[k][i] = b[i][k];
            *at += 1;
        }
    }
    b
}

impl<const D: usize> ClosedTangents<D> {
    /// Bytes of all arrays.
    ///
    /// Example: [`super::Supports::closed_tangents`].
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.0.numbers)
    }
}

impl<const D: usize> SingleTangents<D> {
    /// Bytes of all arrays.
    ///
    /// Example: [`super::Supports::single_tangents`].
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.0.numbers)
    }
}

/// The weight of a particle's consistent inertia.
type Weight<'a> = Option<&'a (dyn Fn(usize) -> f64 + Sync)>;

/// Copies some of the lanes of a row. What comes behind them in `to` is still to be written, or belongs to no particle.
#[inline(always)]
fn copy<X: Real>(from: &[f64; LANES], lanes: Range<usize>, to: &mut [X]) {
    match to.first_chunk_mut::<LANES>() {
        Some(to) if lanes.start == 0 => *to = from.map(X::lit),
        _ => to.iter_mut().zip(&from[lanes]).for_each(|(to, &from)| *to = X::lit(from)),
    }
}

impl<const D: usize> Tiled<D> {
    /// The tangents of all particles at ∇u, and their consistent inertia if there is one.
    pub(super) fn closed<L: Law>(
        &self,
        laws: &Laws<'_, D, L>,
        field: &[Vector<f64, D>],
        both: bool,
        inertia: Weight<'_>,
        pool: &Pool,
    ) -> Result<ClosedTangents<D>, Option<Inadmissible>> {
        let form = Form { both, inertia: inertia.is_some() };
        self.frozen(laws, |block| Some(&block.groups), field, form, inertia, 1.0, pool).map(ClosedTangents)
    }

    /// As [`Self::closed`], in single precision; `None` if the blocks are not prepared for it.
    pub(super) fn closed_single<L: Law>(
        &self,
        laws: &Laws<'_, D, L>,
        field: &[Vector<f64, D>],
        both: bool,
        inertia: Weight<'_>,
        scale: f64,
        pool: &Pool,
    ) -> Option<Result<SingleTangents<D>, Option<Inadmissible>>> {
        let h = self.unit?;
        let form = Form { both, inertia: inertia.is_some() };
        let factor = 1.0 / (scale * h * h);
        let numbers = self.frozen(laws, |block| block.single.as_ref(), field, form, inertia, factor, pool);
        Some(numbers.map(SingleTangents))
    }

    /// The numbers of the groups that `groups` picks, tangents times `factor`; the deformation is gathered in double precision.
    #[allow(clippy::too_many_arguments)] // the ingredients of one array
    fn frozen<L: Law, X: Number<N>, const N: usize>(
        &self,
        laws: &Laws<'_, D, L>,
        groups: impl Fn(&Block) -> Option<&Groups<X, N>> + Sync,
        field: &[Vector<f64, D>],
        form: Form,
        inertia: Weight<'_>,
        factor: f64,
        pool: &Pool,
    ) -> Result<Numbers<X, N>, Option<Inadmissible>> {
        let rows = form.rows(D);
        let count: usize = self.blocks.iter().filter_map(&groups).map(Groups::len).sum();
        // What they hold is written over.
        let mut numbers = pool.unspecified(count * rows, [X::zero(); N]);
        let mut chunks = Vec::with_capacity(self.blocks.len());
        let mut rest = &mut *numbers;
        for block in &self.blocks {
            let (chunk, behind) = rest.split_at_mut(groups(block).map_or(0, Groups::len) * rows);
            chunks.push(chunk);
            rest = behind;
        }
        let evaluate = laws.tangents(form.both, factor);
        let results = waves::gathered(self, field, chunks, |block, chunk, gathered| {
            let Some(groups) = groups(block) else { return Ok(()) };
            let mut failure = None;
            let mut tangents: Tangents = [[0.0; LANES]; 32];
            // Where the particle goes: a group and a lane of it.
            let (mut to, mut at) = (0, 0);
            for group in 0..block.groups.len() {
                let particles = block.groups.particles(group);
                match evaluate(particles, &gathered[group], &mut tangents) {
                    Ok(()) => {}
                    Err(Some(error)) => keep_first(&mut failure, error.particle, Some(error)),
                    // What has no closed form anywhere is no error of a particle.
                    Err(None) => keep_first(&mut failure, usize::MAX, None),
                }
                if let Some(weight) = inertia {
                    for (lane, &p) in particles.iter().enumerate() {
                        tangents[rows - 1][lane] = weight(p as usize);
                    }
                }
                let mut start = 0;
                while start < particles.len() {
                    let lanes = groups.particles(to).len();
                    let end = particles.len().min(start + lanes - at);
                    for (row, tangents) in chunk[to * rows..(to + 1) * rows].iter_mut().zip(&tangents) {
                        copy(tangents, start..end, &mut row[at..]);
                    }
                    at += end - start;
                    start = end;
                    if at == lanes {
                        (to, at) = (to + 1, 0);
                    }
                }
            }
            failure.map_or(Ok(()), Err)
        });
        first_error(results).map(|_| Numbers { numbers, form })
    }

    /// `out_I += Σ_p (δP_p) ∇_n N_I + q_p N_I`, the product of the tangents with `field`.
    pub(super) fn product(&self, frozen: &ClosedTangents<D>, field: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        waves::run(self, Some(field), out, &|block, nodal, buffer| {
            of_block::product(&block.groups, nodal, buffer, &frozen.0);
        });
    }

    /// The same in single precision.
    pub(super) fn product_single(
        &self,
        frozen: &SingleTangents<D>,
        field: &[Vector<f32, D>],
        out: &mut [Vector<f32, D>],
    ) {
        waves::run(self, Some(field), out, &|block: &Block, nodal: &[f32], buffer: &mut [f32]| {
            if let Some(groups) = &block.single {
                of_block::product_single(groups, nodal, buffer, &frozen.0);
            }
        });
    }

    /// `out_I += Σ_p` the block of I with itself, inertia included.
    pub(super) fn add_blocks(&self, frozen: &ClosedTangents<D>, out: &mut [Tensor<f64, D>]) {
        self.blocks_by(out, &|block, buffer| of_block::diagonal(&block.groups, buffer, &frozen.0));
    }

    /// The same in single precision.
    pub(super) fn add_blocks_single(&self, frozen: &SingleTangents<D>, out: &mut [Tensor<f32, D>]) {
        self.blocks_by(out, &|block: &Block, buffer: &mut [f32]| {
            if let Some(groups) = &block.single {
                of_block::diagonal_single(groups, buffer, &frozen.0);
            }
        });
    }

    /// Adds the boxes of D×D blocks that `sums` fills.
    pub(super) fn blocks_by<X: Real + Send + Sync>(
        &self,
        out: &mut [Tensor<X, D>],
        sums: &(dyn Fn(&Block, &mut [X]) + Sync),
    ) {
        let add = |block: &Block, buffer: &[X], first: usize, out: &mut [Tensor<X, D>]| {
            block.add(buffer, D * D, first, out, |sum, rows| {
                *sum += Tensor::from_fn(|i, k| rows[i * D + k]);
            });
        };
        waves::each_block(self, D * D, out, &|block, _: &mut Vec<X>, buffer| sums(block, buffer), &add);
    }

    /// Bytes that the tangents of all particles take in closed form, in double and in single precision.
    pub(super) fn closed_bytes(&self, both: bool, inertia: bool, single: bool) -> usize {
        let groups: usize = match single {
            false => self.groups(),
            true => self.blocks.iter().flat_map(|block| &block.single).map(Groups::len).sum(),
        };
        // A row is 64 bytes in both.
        groups * Form { both, inertia }.rows(D) * size_of::<[f64; LANES]>()
    }
}
