//! Tangents in closed form, the particles of a group side by side.

use super::block::{Block, Groups};
use super::kernel::of_lane;
use super::lanes::{LANES, Lanes, Number, SINGLE_LANES};
use super::of_block;
use super::tiled::{Tiled, first_error, keep_first};
use super::waves;
use crate::material::ClosedTangent;
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector};

/// Tangents of all particles in closed form, for the supports they were made with.
#[derive(Clone, Debug)]
pub struct ClosedTangents<const D: usize>(Numbers<f64, LANES>);

/// The same in single precision and without units: divided by h² and by `scale`.
#[derive(Clone, Debug)]
pub struct SingleTangents<const D: usize>(Numbers<f32, SINGLE_LANES>);

/// For each group its numbers, a row of lanes each.
#[derive(Clone, Debug)]
pub(super) struct Numbers<X, const L: usize> {
    numbers: Vec<[X; L]>,
    pub(super) form: Form,
}

impl<X, const L: usize> Numbers<X, L> {
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

    /// Puts the entries of a tangent, in the order of the rows.
    fn write<const D: usize>(self, tangent: &ClosedTangent<f64, D>, weight: f64, mut put: impl FnMut(f64)) {
        #[inline(always)]
        fn upper<const D: usize>(a: &[[f64; D]; D], put: &mut impl FnMut(f64)) {
            for k in 0..D {
                for i in 0..=k {
                    put(a[i][k]);
                }
            }
        }
        tangent.a.as_flattened().iter().for_each(|&x| put(x));
        upper(&tangent.right, &mut put);
        put(tangent.bulk);
        put(tangent.q);
        if self.both {
            // Beside laws that have the term, those that have not take b = c = 0.
            let [b, c] = tangent.both.unwrap_or([[[0.0; D]; D]; 2]);
            upper(&b, &mut put);
            upper(&c, &mut put);
        }
        if self.inertia {
            put(weight);
        }
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
    pub fn bytes(&self) -> usize {
        size_of_val(self.0.numbers.as_slice())
    }
}

impl<const D: usize> SingleTangents<D> {
    /// Bytes of all arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(self.0.numbers.as_slice())
    }
}

/// The weight of a particle's consistent inertia.
type Inertia<'a> = Option<&'a (dyn Fn(usize) -> f64 + Sync)>;

impl<const D: usize> Tiled<D> {
    /// The tangents `point(p, ∇u_p)` of all particles, and their consistent inertia if there is one.
    pub(super) fn closed<E: Send>(
        &self,
        field: &[Vector<f64, D>],
        both: bool,
        inertia: Inertia<'_>,
        point: impl Fn(usize, Tensor<f64, D>) -> Result<ClosedTangent<f64, D>, E> + Sync,
    ) -> Result<ClosedTangents<D>, E> {
        Ok(ClosedTangents(self.frozen(
            |block| Some(&block.groups),
            field,
            Form { both, inertia: inertia.is_some() },
            inertia,
            point,
        )?))
    }

    /// As [`Self::closed`], in single precision; `None` if the blocks are not prepared for it.
    pub(super) fn closed_single<E: Send>(
        &self,
        field: &[Vector<f64, D>],
        both: bool,
        inertia: Inertia<'_>,
        point: impl Fn(usize, Tensor<f64, D>) -> Result<ClosedTangent<f64, D>, E> + Sync,
    ) -> Option<Result<SingleTangents<D>, E>> {
        self.unit?;
        let form = Form { both, inertia: inertia.is_some() };
        let numbers = self.frozen(|block| block.single.as_ref(), field, form, inertia, point);
        Some(numbers.map(SingleTangents))
    }

    /// The numbers of the groups that `groups` picks; the deformation is gathered in double precision.
    fn frozen<X: Number<L>, const L: usize, E: Send>(
        &self,
        groups: impl Fn(&Block) -> Option<&Groups<X, L>> + Sync,
        field: &[Vector<f64, D>],
        form: Form,
        inertia: Inertia<'_>,
        point: impl Fn(usize, Tensor<f64, D>) -> Result<ClosedTangent<f64, D>, E> + Sync,
    ) -> Result<Numbers<X, L>, E> {
        let rows = form.rows(D);
        let count: usize = self.blocks.iter().filter_map(&groups).map(Groups::len).sum();
        let mut numbers = vec![[X::zero(); L]; count * rows];
        let mut chunks = Vec::with_capacity(self.blocks.len());
        let mut rest = numbers.as_mut_slice();
        for block in &self.blocks {
            let (chunk, behind) = rest.split_at_mut(groups(block).map_or(0, Groups::len) * rows);
            chunks.push(chunk);
            rest = behind;
        }
        let results = waves::gathered(self, field, chunks, |block, chunk, gathered| {
            let mut failure = None;
            let mut slots = groups(block).into_iter().flat_map(Groups::slots);
            block.groups.each(|group, lane, p| {
                let (_, gradient) = of_lane::<f64, D>(&gathered[group], lane);
                let Some((to, lane)) = slots.next() else { return };
                match point(p, gradient) {
                    Ok(tangent) => {
                        let mut places = chunk[to * rows..(to + 1) * rows].iter_mut();
                        form.write(&tangent, inertia.map_or(0.0, |weight| weight(p)), |x| {
                            if let Some(row) = places.next() {
                                row[lane] = X::lit(x);
                            }
                        });
                    }
                    Err(error) => keep_first(&mut failure, p, error),
                }
            });
            failure.map_or(Ok(()), Err)
        });
        first_error(results)?;
        Ok(Numbers { numbers, form })
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
                of_block::product(groups, nodal, buffer, &frozen.0);
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
                of_block::diagonal(groups, buffer, &frozen.0);
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
