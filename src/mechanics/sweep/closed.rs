//! Tangents in closed form, eight particles side by side.

use super::block::Block;
use super::kernel::of_lane;
use super::lanes::{LANES, Lanes};
use super::of_block;
use super::tiled::{Tiled, first_error, keep_first};
use super::waves;
use crate::material::ClosedTangent;
use crate::tensor::{Tensor, Vector};

/// Tangents of all particles in closed form, for the supports they were made with.
#[derive(Clone, Debug)]
pub struct ClosedTangents<const D: usize>(Numbers);

/// For each group its numbers, a row of eight lanes each.
#[derive(Clone, Debug)]
pub(super) struct Numbers {
    numbers: Vec<[f64; LANES]>,
    pub(super) form: Form,
}

impl Numbers {
    #[inline(always)]
    pub(super) fn of_group(&self, group: usize, rows: usize) -> &[[f64; LANES]] {
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
    pub(super) fn read<S: Lanes, const D: usize>(self, s: S, rows: &[[f64; LANES]]) -> ClosedTangent<S::N, D> {
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
fn symmetric<S: Lanes, const D: usize>(s: S, rows: &[[f64; LANES]], at: &mut usize) -> [[S::N; D]; D] {
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

impl<const D: usize> Tiled<D> {
    /// The tangents `point(p, ∇u_p)` of all particles, and their consistent inertia if there is one.
    pub(super) fn closed<E: Send>(
        &self,
        field: &[Vector<f64, D>],
        both: bool,
        inertia: Option<&(dyn Fn(usize) -> f64 + Sync)>,
        point: impl Fn(usize, Tensor<f64, D>) -> Result<ClosedTangent<f64, D>, E> + Sync,
    ) -> Result<ClosedTangents<D>, E> {
        let form = Form { both, inertia: inertia.is_some() };
        let rows = form.rows(D);
        let mut numbers = vec![[0.0; LANES]; self.groups() * rows];
        let mut chunks = Vec::with_capacity(self.blocks.len());
        let mut rest = numbers.as_mut_slice();
        for block in &self.blocks {
            let (chunk, behind) = rest.split_at_mut(block.groups() * rows);
            chunks.push(chunk);
            rest = behind;
        }
        let results = waves::gathered(self, field, chunks, |block, chunk, gathered| {
            let mut failure = None;
            block.each(|group, lane, p| {
                let (_, gradient) = of_lane::<f64, D>(&gathered[group], lane);
                match point(p, gradient) {
                    Ok(tangent) => {
                        let mut places = chunk[group * rows..(group + 1) * rows].iter_mut();
                        form.write(&tangent, inertia.map_or(0.0, |weight| weight(p)), |x| {
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
        Ok(ClosedTangents(Numbers { numbers, form }))
    }

    /// `out_I += Σ_p (δP_p) ∇_n N_I + q_p N_I`, the product of the tangents with `field`.
    pub(super) fn product(&self, frozen: &ClosedTangents<D>, field: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        waves::run(self, Some(field), out, &|block, nodal, buffer| of_block::product(block, nodal, buffer, &frozen.0));
    }

    /// `out_I += Σ_p` the block of I with itself, inertia included.
    pub(super) fn add_blocks(&self, frozen: &ClosedTangents<D>, out: &mut [Tensor<f64, D>]) {
        self.blocks_by(out, &|block, buffer| of_block::diagonal(block, buffer, &frozen.0));
    }

    /// Adds the boxes of D×D blocks that `sums` fills.
    pub(super) fn blocks_by(&self, out: &mut [Tensor<f64, D>], sums: &(dyn Fn(&Block, &mut [f64]) + Sync)) {
        let add = |block: &Block, buffer: &[f64], first: usize, out: &mut [Tensor<f64, D>]| {
            block.add(buffer, D * D, first, out, |sum, rows| {
                *sum += Tensor::from_fn(|i, k| rows[i * D + k]);
            });
        };
        waves::each_block(self, D * D, out, &|block, _, buffer| sums(block, buffer), &add);
    }

    /// Bytes that the tangents of all particles take in closed form.
    pub(super) fn closed_bytes(&self, both: bool, inertia: bool) -> usize {
        self.groups() * Form { both, inertia }.rows(D) * size_of::<[f64; LANES]>()
    }
}
