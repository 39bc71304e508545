//! The nodal diagonal blocks of a quadratic form, B(∇N_I, ∇N_I) + m N_I² I, summed over one group of particles.

use super::group::Window;
use super::kernel::{Pairs, each_tile, tile};
use crate::lanes::{In, LANES, Lane, Lanes, WithLanes, in_dimension};
use crate::tensor::{Tensor, Vector};

/// Number of pairs (k, l) of axes with k ≤ l, in 3D.
const MOST_PAIRS: usize = 6;

/// The quadratic forms B(∇N, ∇N) + m N² I of the particles of one group, a lane each.
#[derive(Clone, Debug)]
pub struct Quadratic {
    /// `[pair][i][j]`, the pair (k, l) at index k + l (l + 1)/2. It is B(e_k, e_l) + B(e_l, e_k) for k < l, and B(e_k, e_k) for k = l.
    /// The first D rows and columns are used.
    pub bilinear: [[[[f64; LANES]; 3]; 3]; MOST_PAIRS],
    /// m
    pub mass: [f64; LANES],
}

impl Quadratic {
    /// The form B = 0, m = 0.
    pub(crate) fn zero() -> Self {
        Self { bilinear: [[[[0.0; LANES]; 3]; 3]; MOST_PAIRS], mass: [0.0; LANES] }
    }

    /// B(∇N, ∇N) + m N² I of one particle.
    pub(crate) fn block<const D: usize>(&self, lane: usize, n: f64, grad_n: &Vector<f64, D>) -> Tensor<f64, D> {
        let mut block = Tensor::<f64, D>::identity() * (self.mass[lane] * n * n);
        for l in 0..D {
            for k in 0..=l {
                let of_pair = &self.bilinear[pair(k, l)];
                block += Tensor::from_fn(|i, j| of_pair[i][j][lane]) * (grad_n[k] * grad_n[l]);
            }
        }
        block
    }
}

/// The index of the pair (k, l) in [`Quadratic::bilinear`].
pub(crate) const fn pair(k: usize, l: usize) -> usize {
    k + l * (l + 1) / 2
}

/// B_I += B(∇N_I, ∇N_I) + m N_I² I, summed over the particles of a group. `out` is a box of D×D blocks stored by rows. It is one vector
/// of lanes longer than its nodes need.
///
/// With ∇N = (N_x' P_x, N_x P_y, N_x P_z), P_x = N_y N_z, …, row i of the block is
/// N_x'² B_xx P_x P_x + N_x N_x' (B_xy P_x P_y + B_xz P_x P_z) + N_x² (B_yy P_y P_y + B_yz P_y P_z + B_zz P_z P_z + m P_x P_x e_i).
pub(super) struct ScatterBlocks<'a> {
    pub window: Window<'a>,
    pub from: &'a Quadratic,
    pub out: &'a mut [f64],
}

impl<const D: usize> WithLanes for In<ScatterBlocks<'_>, D, D> {
    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        let ScatterBlocks { window, from, out } = self.0;
        for row in (0..window.width[1] * window.width[2]).step_by(S::ROWS) {
            let pairs = Pairs::<S, D>::new(s, &window, row);
            each_tile!(window, start => blocks_tile::<S, D>(s, &window, start, &pairs, from, out));
        }
    }
}

#[inline(always)]
fn blocks_tile<S: Lanes, const D: usize, const W: usize>(
    s: S,
    window: &Window<'_>,
    start: usize,
    pairs: &Pairs<S, D>,
    from: &Quadratic,
    out: &mut [f64],
    width: usize,
) {
    let zero = s.splat_rows(0.0);
    let (n, dn) = window.axis(0);
    let (n, dn) = (&n[start..start + width], &dn[start..start + width]);
    let mut sums = [[[zero; D]; D]; W];
    let sums = &mut sums[..width.min(W)];
    for i in 0..D {
        let mut row = [[zero; D]; W];
        for p in 0..window.lanes.min(LANES) {
            // The coefficients of N_x'², N_x N_x' and N_x².
            let mut powers = [[zero; D]; 3];
            for l in 0..D {
                for k in 0..=l {
                    let power = usize::from(k > 0) + usize::from(l > 0);
                    mutant!("sweep: blocks by the wrong power of N_x": power = 2 * usize::from(l > 0));
                    let product = pairs.products[k][p] * pairs.products[l][p];
                    for j in 0..D {
                        let coefficient = s.splat_rows(from.bilinear[pair(k, l)][i][j][p]);
                        powers[power][j] = powers[power][j].add_product(coefficient, product);
                    }
                }
            }
            let square = pairs.products[0][p] * pairs.products[0][p];
            powers[2][i] = powers[2][i].add_product(s.splat_rows(from.mass[p]), square);
            for x in 0..sums.len() {
                let (nx, dx) = (n[x][p], dn[x][p]);
                let (two, one, none) = (s.splat_rows(dx * dx), s.splat_rows(nx * dx), s.splat_rows(nx * nx));
                for j in 0..D {
                    row[x][j] = row[x][j].add_product(powers[0][j], two);
                    if D > 1 {
                        row[x][j] = row[x][j].add_product(powers[1][j], one);
                    }
                    row[x][j] = row[x][j].add_product(powers[2][j], none);
                }
            }
        }
        for x in 0..sums.len() {
            sums[x][i] = row[x];
        }
    }
    pairs.add(s, sums.as_flattened().as_flattened(), start, D * D, out);
}

/// Adds the diagonal blocks of a group's quadratic form to a box of D×D blocks.
pub(super) fn scatter_blocks(work: ScatterBlocks<'_>) {
    in_dimension!(work.window.dimension, work);
}
