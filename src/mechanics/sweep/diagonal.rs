//! The diagonal blocks of a quadratic form, B(∇N_I, ∇N_I) + m N_I², of one group of particles.

use super::kernel::{Pairs, Window, by_tile, tile};
use super::lanes::{LANES, Lanes};
use crate::scalar::Real;

/// Pairs (k, l) with k ≤ l of D axes.
const MOST_PAIRS: usize = 6;

/// The quadratic form of one group: B(∇N, ∇N) + m N² I, a lane a particle.
pub(super) struct Quadratic<X = f64, const L: usize = LANES> {
    /// B(e_k, e_l) + B(e_l, e_k) for k < l, B(e_k, e_k) for k = l, by `pair`; the first D rows and columns.
    pub bilinear: [[[[X; L]; 3]; 3]; MOST_PAIRS],
    /// m
    pub mass: [X; L],
}

impl<X: Real, const L: usize> Quadratic<X, L> {
    pub(super) fn zero() -> Self {
        Self { bilinear: [[[[X::zero(); L]; 3]; 3]; MOST_PAIRS], mass: [X::zero(); L] }
    }
}

/// The number of the pair (k, l), k ≤ l.
pub(super) const fn pair(k: usize, l: usize) -> usize {
    k + l * (l + 1) / 2
}

/// B_I += B(∇N_I, ∇N_I) + m N_I² I, summed over the particles of a group; `out` is a box of D×D blocks by rows, a vector longer
/// than its nodes.
///
/// With ∇N = (N_x' P_x, N_x P_y, N_x P_z), P_x = N_y N_z, …, row i of the block is
/// N_x'² B_xx P_x P_x + N_x N_x' (B_xy P_x P_y + B_xz P_x P_z) + N_x² (B_yy P_y P_y + B_yz P_y P_z + B_zz P_z P_z + m P_x P_x e_i).
#[inline(always)]
pub(super) fn scatter_blocks<S: Lanes<L>, const D: usize, const L: usize>(
    s: S,
    window: &Window<'_, S::X, L>,
    from: &Quadratic<S::X, L>,
    out: &mut [S::X],
) {
    let rows = window.width[1] * window.width[2];
    for chunk in 0..rows.div_ceil(L) {
        let pairs = Pairs::<S, D, L>::new(s, window, chunk * L);
        let mut start = 0;
        while start < window.width[0] {
            let tile = tile::<L>(window.width[0] - start);
            by_tile!(tile, blocks_tile::<S, D, L>(s, window, start, &pairs, from, out));
            start += tile;
        }
    }
}

#[inline(always)]
fn blocks_tile<S: Lanes<L>, const D: usize, const L: usize, const W: usize>(
    s: S,
    window: &Window<'_, S::X, L>,
    start: usize,
    pairs: &Pairs<S, D, L>,
    from: &Quadratic<S::X, L>,
    out: &mut [S::X],
    width: usize,
) {
    let zero = s.zero();
    let (n, dn) = window.axis(0);
    let (n, dn) = (&n[start..start + width], &dn[start..start + width]);
    let mut sums = [[[zero; D]; D]; W];
    let sums = &mut sums[..width.min(W)];
    for i in 0..D {
        let mut row = [[zero; D]; W];
        for p in 0..window.lanes.min(L) {
            // By powers of N_x': 2, 1, 0.
            let mut powers = [[zero; D]; 3];
            for l in 0..D {
                for k in 0..=l {
                    let power = usize::from(k > 0) + usize::from(l > 0);
                    let product = s.mul(pairs.products[k][p], pairs.products[l][p]);
                    for j in 0..D {
                        let coefficient = s.splat(from.bilinear[pair(k, l)][i][j][p]);
                        powers[power][j] = s.mul_add(coefficient, product, powers[power][j]);
                    }
                }
            }
            let square = s.mul(pairs.products[0][p], pairs.products[0][p]);
            powers[2][i] = s.mul_add(s.splat(from.mass[p]), square, powers[2][i]);
            for x in 0..sums.len() {
                let (nx, dx) = (n[x][p], dn[x][p]);
                let (two, one, none) = (s.splat(dx * dx), s.splat(nx * dx), s.splat(nx * nx));
                for j in 0..D {
                    row[x][j] = s.mul_add(powers[0][j], two, row[x][j]);
                    if D > 1 {
                        row[x][j] = s.mul_add(powers[1][j], one, row[x][j]);
                    }
                    row[x][j] = s.mul_add(powers[2][j], none, row[x][j]);
                }
            }
        }
        for x in 0..sums.len() {
            sums[x][i] = row[x];
        }
    }
    pairs.add(s, sums.as_flattened().as_flattened(), start, D * D, out);
}
