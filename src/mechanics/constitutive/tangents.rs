//! Stored tangents of the linearisation, the particles of a group side by side: δσ = 𝔸 : L with L = Σ u ⊗ ∇_r N.

use crate::lanes::{In, LANES, Lane, Lanes, WithLanes, in_dimension};
use crate::material::ClosedTangent;
use crate::mechanics::sweep::{Quadratic, pair};

/// The storage form of a tangent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Form {
    /// A, B, κ and q of a [`ClosedTangent`].
    Closed,
    /// A, B, κ and q, then b and c.
    ClosedWithFactors,
    /// 𝔸 itself, as the blocks 𝔸_kl of all pairs of unit gradients (e_k, e_l).
    General,
}

impl Form {
    /// Number of stored numbers a particle.
    pub(crate) const fn rows(self, dimension: usize) -> usize {
        let symmetric = dimension * (dimension + 1) / 2;
        let closed = dimension * dimension + symmetric + 2;
        match self {
            Self::Closed => closed,
            Self::ClosedWithFactors => closed + 2 * symmetric,
            Self::General => dimension.pow(4),
        }
    }

    /// Reads the closed tangent from the rows of a group.
    #[inline(always)]
    fn read<S: Lanes, const D: usize>(self, s: S, rows: &[[f64; LANES]]) -> ClosedTangent<S::N, D> {
        let mut at = 0;
        let mut a = [[s.splat(0.0); D]; D];
        for i in 0..D {
            for k in 0..D {
                a[i][k] = s.load(&rows[at]);
                at += 1;
            }
        }
        let right = symmetric(s, rows, &mut at);
        let (bulk, q) = (s.load(&rows[at]), s.load(&rows[at + 1]));
        at += 2;
        let with_factors = self == Self::ClosedWithFactors;
        let factors =
            if with_factors { Some([symmetric(s, rows, &mut at), symmetric(s, rows, &mut at)]) } else { None };
        ClosedTangent { a, right, bulk, q, factors }
    }
}

/// The row of entry (i, j) of the block 𝔸_kl in a general tangent.
#[inline(always)]
pub(crate) const fn general<const D: usize>(k: usize, l: usize, i: usize, j: usize) -> usize {
    ((k * D + l) * D + i) * D + j
}

/// Reads a symmetric tensor from its upper triangle, stored column by column.
#[inline(always)]
fn symmetric<S: Lanes, const D: usize>(s: S, rows: &[[f64; LANES]], at: &mut usize) -> [[S::N; D]; D] {
    let mut b = [[s.splat(0.0); D]; D];
    for k in 0..D {
        for i in 0..=k {
            b[i][k] = s.load(&rows[*at]);
            b[k][i] = b[i][k];
            *at += 1;
        }
    }
    b
}

/// `out` += 𝔸 : L of a group. `l` and `out` are stored by rows.
pub(crate) struct Product<'a> {
    /// The form of the tangents.
    pub form: Form,
    /// The tangents.
    pub rows: &'a [[f64; LANES]],
    /// L
    pub l: &'a [[f64; LANES]],
    /// δσ
    pub out: &'a mut [[f64; LANES]],
}

impl<const D: usize> WithLanes for In<Product<'_>, D, D> {
    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        let Product { form, rows, l, out } = self.0;
        let mut gradient = [[s.splat(0.0); D]; D];
        for i in 0..D {
            for k in 0..D {
                gradient[i][k] = s.load(&l[i * D + k]);
            }
        }
        let product = match form {
            Form::Closed => Form::Closed.read::<S, D>(s, rows).product(&gradient),
            Form::ClosedWithFactors => Form::ClosedWithFactors.read::<S, D>(s, rows).product(&gradient),
            Form::General => {
                // δσ e_k = Σ_l 𝔸_kl L e_l
                let mut product = [[s.splat(0.0); D]; D];
                for k in 0..D {
                    for l in 0..D {
                        let block = entries::<S, D>(s, rows, k, l);
                        for i in 0..D {
                            for j in 0..D {
                                product[i][k] = product[i][k].add_product(block[i][j], gradient[j][l]);
                            }
                        }
                    }
                }
                product
            }
        };
        for i in 0..D {
            for k in 0..D {
                let sum = s.load(&out[i * D + k]) + product[i][k];
                s.store(sum, &mut out[i * D + k]);
            }
        }
    }
}

/// Adds `factor` times the quadratic form of the tangents of a group to `into`.
pub(crate) struct AddTo<'a> {
    pub form: Form,
    pub rows: &'a [[f64; LANES]],
    pub factor: f64,
    pub into: &'a mut Quadratic,
}

impl<const D: usize> WithLanes for In<AddTo<'_>, D, D> {
    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        let AddTo { form, rows, factor, into } = self.0;
        let factor = s.splat(factor);
        let closed = if form == Form::General { None } else { Some(form.read::<S, D>(s, rows)) };
        for l in 0..D {
            for k in 0..=l {
                let (one, other) = match &closed {
                    Some(closed) => (closed.unit_block(k, l), closed.unit_block(l, k)),
                    None => (entries::<S, D>(s, rows, k, l), entries::<S, D>(s, rows, l, k)),
                };
                for i in 0..D {
                    for j in 0..D {
                        let sum = if k < l { one[i][j] + other[i][j] } else { one[i][j] };
                        mutant!("sweep: blocks without the other half of a pair": sum = one[i][j]);
                        let slot = &mut into.bilinear[pair(k, l)][i][j];
                        let sum = s.load(slot).add_product(factor, sum);
                        s.store(sum, slot);
                    }
                }
            }
        }
    }
}

/// 𝔸_kl of a general tangent.
#[inline(always)]
fn entries<S: Lanes, const D: usize>(s: S, rows: &[[f64; LANES]], k: usize, l: usize) -> [[S::N; D]; D] {
    let mut block = [[s.splat(0.0); D]; D];
    for i in 0..D {
        for j in 0..D {
            block[i][j] = s.load(&rows[general::<D>(k, l, i, j)]);
            mutant!("sweep: a general tangent is transposed": { block[i][j] = s.load(&rows[general::<D>(k, l, j, i)]); });
        }
    }
    block
}

/// Adds the product 𝔸 : L of a group's tangents with its gradients.
pub(crate) fn product(dimension: usize, work: Product<'_>) {
    in_dimension!(dimension, work);
}

/// Adds the quadratic form of the tangents of a group.
pub(crate) fn add_quadratic(dimension: usize, work: AddTo<'_>) {
    in_dimension!(dimension, work);
}
